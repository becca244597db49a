"""Elevation as a function of named constants, and its derivatives."""

from dataclasses import replace

import jax.numpy as jnp
import numpy as np
import pytest

from altijax.drives import Drive, drive_arrays
from altijax.elevation_estimate import model as model
from tests.exact import EXACT


@pytest.fixture(scope="module")
def drive() -> Drive:
    return drive_arrays(EXACT, turns=True)[0]


@pytest.mark.parametrize("method", ["shirai", "slope"])
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


def test_standing_still_leaves_no_doubt_about_the_vertical_speed(drive: Drive) -> None:
    assert model.uncertain_constants(drive, "shirai")["initial_vertical_speed"] == pytest.approx(0, abs=1e-12)


@pytest.mark.parametrize("method", ["shirai", "slope"])
def test_the_car_pitches_on_a_slope_as_much_as_when_it_speeds_up(drive: Drive, method: str) -> None:
    """A weight transfer of k makes the forward reading 1 + k times what it was; the length of the force is unmoved."""
    squatting = replace(drive, f=drive.f.at[:, 0].multiply(1.06))
    found = model.elevation({"weight_transfer": jnp.asarray(0.06)}, squatting, method)["elevation"]
    if method == "slope":
        np.testing.assert_allclose(found, model.elevation({}, drive, method)["elevation"], atol=1e-9)
    else:
        untouched = {"initial_vertical_speed": jnp.asarray(0.0)}
        by_norm = model.elevation(untouched, drive, method)["elevation"]
        with_k = model.elevation(untouched | {"weight_transfer": jnp.asarray(0.06)}, drive, method)["elevation"]
        np.testing.assert_array_equal(with_k, by_norm)
