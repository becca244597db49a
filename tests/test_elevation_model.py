"""Elevation as a function of named constants: its derivatives, and the error bar that is made of them."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from altijax import elevation_model as model
from altijax.drives import Drive, drive_arrays
from tests.exact import EXACT


@pytest.fixture(scope="module")
def drive() -> Drive:
    return drive_arrays(EXACT, turns=True)[0]


@pytest.mark.parametrize("method", model.ELEVATION_METHODS)
def test_sensitivities_are_differences(drive: Drive, method: str) -> None:
    """Of every constant that the method depends on.

    The speed is linear between its samples, on which the grid's times lie: a delay has two slopes there, and the one
    before counts.
    """
    names = tuple(model.uncertain_constants(drive, method))
    found, jacobian = model.elevation_and_sensitivity({}, drive, names, method)
    start = model.NOMINAL | {"initial_vertical_speed": found["vertical_speed"][0]}
    base = {name: jnp.asarray(start[name]) for name in names}
    for name, column in zip(names, np.asarray(jacobian).T, strict=True):
        step = 1e-5 * model.UNCERTAINTY[name]
        up = 0.0 if "delay" in name else step
        high = model.elevation(base | {name: base[name] + up}, drive, method)["elevation"]
        low = model.elevation(base | {name: base[name] - step}, drive, method)["elevation"]
        scale = np.abs(column).max()
        assert scale > 0
        np.testing.assert_allclose(column, (high - low) / (up + step), atol=1e-4 * scale, err_msg=name)


def test_the_error_bar_is_that_of_many_instruments(drive: Drive) -> None:
    """200 drives with constants drawn from what they may be off by: their spread is the stated one, to 15 %."""
    deviation = model.uncertain_constants(drive, "slope")
    names = tuple(deviation)
    found, jacobian = model.elevation_and_sensitivity({}, drive, names, "slope")
    covariance = np.diag(np.square(list(deviation.values())))
    stated = model.elevation_std(found, jacobian, covariance, drive.t, "slope")
    draws = np.random.default_rng(0).normal(size=(200, len(names))) * list(deviation.values())
    start = np.array([model.NOMINAL[name] for name in names])

    def height(x: jax.Array) -> jax.Array:
        return model.elevation(dict(zip(names, x, strict=True)), drive, "slope")["elevation"]

    spread = jax.lax.map(height, jnp.asarray(start + draws)).std(0)
    road = model.elevation_std(found, 0 * jacobian, covariance, drive.t, "slope")
    # five standard deviations of a standard deviation from 200 draws are 25 %
    np.testing.assert_allclose(np.hypot(spread, road)[500::500], stated[500::500], rtol=0.15)


def test_standing_still_leaves_no_doubt_about_the_vertical_speed(drive: Drive) -> None:
    assert model.uncertain_constants(drive, "shirai")["initial_vertical_speed"] == pytest.approx(0, abs=1e-12)
