"""Elevation as a function of named constants, and its derivatives."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from altijax.altitude import elevation_by_norm, elevation_by_slope
from altijax.drives import Drive, drive_arrays
from altijax.elevation_estimate import model as model
from altijax.rotations import euler_to_matrix
from altijax.signals import resample
from tests.exact import EXACT


@pytest.fixture(scope="module")
def drive() -> Drive:
    return drive_arrays(EXACT, turns=True)[0]


SOME = {
    **{"accelerometer_scale_x": 1.02, "accelerometer_bias_y": 0.1, "mounting_pitch": 0.02, "mounting_yaw": -0.03},
    **{"yaw_rate_bias": 0.01, "lever_arm": 0.7, "wheel_scale": 1.01, "wheel_delay": 0.013, "weight_transfer": 0.04},
    "initial_vertical_speed": 0.2,
}


def by_array_functions(x: jax.Array, drive: Drive, method: str) -> jax.Array:
    """Elevation of the readings corrected first and filtered then, at their own length."""
    value = dict(zip(SOME, x, strict=True))
    f_s = jnp.asarray(drive.f).at[:, 0].divide(value["accelerometer_scale_x"])
    f_s = f_s.at[:, 1].add(-value["accelerometer_bias_y"])
    mounting = euler_to_matrix(jnp.stack([jnp.zeros(()), value["mounting_pitch"], value["mounting_yaw"]]))
    yaw_rate = drive.yaw_rate - value["yaw_rate_bias"]
    f_b = (f_s @ mounting.T).at[:, 0].add(value["lever_arm"] * yaw_rate**2)
    speed, _ = resample(drive.t + value["wheel_delay"], drive.t_speed, drive.speed, jnp.inf)
    speed = speed * value["wheel_scale"]
    if method == "shirai":
        start = value["initial_vertical_speed"]
        return elevation_by_norm(drive.t, f_b, speed, yaw_rate, drive.gravity, start)[0]
    return elevation_by_slope(drive.t, f_b[:, 0] / (1 + value["weight_transfer"]), speed, drive.gravity)[0]


@pytest.mark.parametrize("method", ["shirai", "slope"])
def test_elevation_and_sensitivities_are_those_of_the_array_functions(drive: Drive, method: str) -> None:
    """Neither what the readings are filled up with nor which came first, low pass or constants, shows."""
    found, sensitivity = model.elevation_and_sensitivity(SOME, drive, tuple(SOME), method)
    at = jnp.array(list(SOME.values()))
    plain, slopes = (np.asarray(f(at, drive, method)) for f in (by_array_functions, jax.jacfwd(by_array_functions)))
    np.testing.assert_allclose(found["elevation"], plain, rtol=0, atol=1e-12 * np.abs(plain).max())
    np.testing.assert_allclose(sensitivity, slopes, rtol=0, atol=1e-12 * np.abs(slopes).max())


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
    squatting = replace(drive, f=drive.f * np.array([1.06, 1.0, 1.0]))
    found = model.elevation({"weight_transfer": jnp.asarray(0.06)}, squatting, method)["elevation"]
    if method == "slope":
        np.testing.assert_allclose(found, model.elevation({}, drive, method)["elevation"], atol=1e-9)
    else:
        untouched = {"initial_vertical_speed": jnp.asarray(0.0)}
        by_norm = model.elevation(untouched, drive, method)["elevation"]
        with_k = model.elevation(untouched | {"weight_transfer": jnp.asarray(0.06)}, drive, method)["elevation"]
        np.testing.assert_array_equal(with_k, by_norm)
