"""The verbs have the arguments that their design promises, and answer from the one package as from `estimates`."""

import inspect
import warnings
from dataclasses import replace

import numpy as np
import pytest

import altijax
from altijax import estimates


@pytest.mark.parametrize(
    ("verb", "arguments"),
    [
        ("estimate_elevation", ("method", "calibration", "initial_vertical_speed", "known_heights")),
        (
            "estimate_speed",
            ("method", "aid_until", "calibration", "initial_speed", "initial_pitch", "sensors"),
        ),
        ("estimate_motion", ("method", "calibration", "use_gyro", "wind", "delay")),
        ("calibrate", ("method", "until")),
    ],
)
def test_verbs_take_what_is_promised_by_keyword(verb: str, arguments: tuple[str, ...]) -> None:
    function = getattr(estimates, verb)
    assert function is getattr(altijax, verb)
    keyword_only = [
        name
        for name, parameter in inspect.signature(function).parameters.items()
        if parameter.kind is inspect.Parameter.KEYWORD_ONLY
    ]
    assert set(arguments) <= set(keyword_only)


@pytest.mark.slow
def test_a_drive_needs_no_reference_and_serves_every_verb() -> None:
    """On the shipped recording, where the nose of the IMU is 1.4 degrees down and the wheel scale is 1.006."""
    recording = altijax.load_dataset("hill-road")
    names = ["wheel_scale", "gnss_delay", "accelerometer_bias_x", "gyro_bias_z", "mounting_pitch"]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # a short drive: what it does not determine is said
        found = estimates.calibrate(replace(recording, reference=None), names, method="drive", until=45.0)
    assert list(found.table.index) == names and (found.std < found.table["prior_std"]).all()
    assert found.values["wheel_scale"] == pytest.approx(1.006, abs=0.005)
    assert found.held_out["until"].eq(45.0).all() and found.held_out["fitted"].isna().all()
    slope = [
        estimates.score_elevation(estimates.estimate_elevation(recording, calibration=known), recording, after=45.0)
        for known in (None, found)
    ]
    assert slope[1]["rms_without_offset"] < slope[0]["rms_without_offset"]
    speed = estimates.estimate_speed(recording, calibration=found, aid_until=45.0)
    motion = estimates.estimate_motion(recording, method="window", calibration=found)
    assert np.isfinite(speed.to_numpy(float)).all() and np.isfinite(motion.to_numpy(float)).all()
    assert motion.attrs["delay"] == found.values["gnss_delay"]


def test_a_drive_that_did_not_converge_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    recording = altijax.load_dataset("hill-road")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        found = altijax.calibrate_drive(recording, ["gyro_bias_z"], until=45.0)
    monkeypatch.setattr(estimates, "calibrate_drive", lambda *_, **__: replace(found, converged=False))
    with pytest.warns(UserWarning) as said:
        calibration = estimates.calibrate(recording, "gyro_bias_z", method="drive", until=45.0)
    assert any("did not converge" in str(warning.message) for warning in said)
    assert "did not converge" in repr(calibration) and "did not converge" in repr(replace(found, converged=False))
