"""Names and spreads of constants are the same everywhere, but for exceptions that say why."""

import ast
from importlib import import_module
from pathlib import Path
from types import ModuleType

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from altijax.calibration.drive_model import DRIVE_PARAMETERS
from altijax.calibration.parameters import ACCEPTED, CONSTANTS, presumed, require_parameters, triads
from tests.docstrings import PACKAGE

# Where a method has spreads of its own.
OWN = ["calibration.drive_model", "speed_estimate.model"]
TABLE = PACKAGE / "calibration" / "parameters.py"


def numbers(node: ast.expr) -> bool:
    """Whether this is a number or begins with one."""
    if isinstance(node, ast.Tuple | ast.Call):
        inside = node.elts if isinstance(node, ast.Tuple) else node.args
        return bool(inside) and numbers(inside[0])
    return isinstance(node, ast.Constant) and isinstance(node.value, float | int)


def tables(path: Path) -> set[str]:
    """What a file calls its dicts of numbers by the name of a constant."""
    found = set()
    for node in ast.parse(path.read_text(encoding="utf-8")).body:
        for inner in ast.walk(node):
            if isinstance(inner, ast.Dict) and any(
                isinstance(key, ast.Constant) and key.value in CONSTANTS and numbers(value)
                for key, value in zip(inner.keys, inner.values, strict=True)
            ):
                found.add(ast.unparse(node.targets[0]) if isinstance(node, ast.Assign) else ast.unparse(node)[:50])
    return found


def test_no_other_module_has_spreads_but_those_listed() -> None:
    assert tables(TABLE) == {"CONSTANTS"}
    found = {path: tables(path) for path in PACKAGE.rglob("*.py") if path != TABLE}
    others = {path.relative_to(PACKAGE).with_suffix("").as_posix(): names for path, names in found.items() if names}
    assert others == {module.replace(".", "/"): {"SPREADS"} for module in OWN}


@pytest.mark.parametrize("module", OWN)
def test_a_spread_of_a_method_differs_and_says_why(module: str) -> None:
    for name, (spread, why) in import_module(f"altijax.{module}").SPREADS.items():
        assert spread != CONSTANTS[name].spread and why, name


def test_every_constant_says_where_its_spread_comes_from_and_who_finds_it() -> None:
    for name, constant in CONSTANTS.items():
        assert constant.spread > 0 and constant.why and constant.unit, name
        assert constant.methods and len(set(constant.methods)) == len(constant.methods), name
        assert all(name in ACCEPTED[method] for method in constant.methods)


def test_what_is_presumed_is_the_table_but_for_the_spread() -> None:
    found = presumed(["gyro_bias_x", "wheel_scale"], {"wheel_scale": (0.5, "an odd car")})
    assert list(found) == ["gyro_bias_x", "wheel_scale"] and found["gyro_bias_x"] == CONSTANTS["gyro_bias_x"]
    assert (found["wheel_scale"].nominal, found["wheel_scale"].spread, found["wheel_scale"].why) == (
        1,
        0.5,
        "an odd car",
    )
    assert list(DRIVE_PARAMETERS) == ACCEPTED["drive"] and DRIVE_PARAMETERS["gnss_delay"].unit == "s"


@pytest.mark.parametrize("arrays", [np, jnp])
def test_triads_are_nominal_but_for_what_is_named(arrays: ModuleType) -> None:
    ideal = triads({}, arrays)
    assert [np.asarray(part).tolist() for part in ideal] == [[0] * 3, [1] * 3, [0] * 3, [1] * 3, [0] * 3]
    values = {"accelerometer_scale": 1.02, "accelerometer_scale_y": 0.98, "gyro_bias_z": 0.1, "mounting_yaw": 0.2}
    found = triads(values | {"wheel_scale": 2.0}, arrays)
    np.testing.assert_allclose(found.accelerometer_scale, [1.02, 1.02 * 0.98, 1.02], rtol=1e-6)
    np.testing.assert_allclose([found.gyro_bias[2], found.mounting[2]], [0.1, 0.2], rtol=1e-6)


@pytest.mark.parametrize("dtype", [jnp.float32, jnp.float64])
def test_triads_keep_the_precision_and_have_derivatives(dtype: type) -> None:
    with jax.enable_x64(True):
        x = jnp.asarray(1.01, dtype)
        found = triads({"accelerometer_scale_x": x})
        assert found.accelerometer_scale.dtype == dtype
        slope = jax.jacfwd(lambda x: triads({"accelerometer_scale_x": x}).accelerometer_scale)(x)
        np.testing.assert_array_equal(slope, [1, 0, 0])


def test_names_are_checked_against_the_method() -> None:
    assert require_parameters("wheel_scale", "slope") == ["wheel_scale"]
    with pytest.raises(ValueError, match=r"'slope' must be different names out of wheel_scale, .*got gyro_bias_x"):
        require_parameters("gyro_bias_x", "slope")
    with pytest.raises(ValueError, match="got wheel_scale, wheel_scale"):
        require_parameters(["wheel_scale", "wheel_scale"], "slope")
    with pytest.raises(ValueError, match=r"method must be one of slope, shirai, .*drive, got 'ekf'"):
        require_parameters("wheel_scale", "ekf")
