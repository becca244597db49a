"""The verbs have the arguments that their design promises, and answer from the one package as from `estimates`."""

import inspect
import warnings
from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pandas as pd
import pytest

import altijax
from altijax import estimates
from altijax.calibration import drives
from altijax.calibration.drive_model import DRIVE_PARAMETERS
from altijax.calibration.simulated_drives import Manoeuvres, recorded_drive, town_drive
from altijax.constants import STANDARD_GRAVITY
from altijax.doppler import DopplerReceiver
from altijax.instruments import MEMS_ACCELEROMETER, MEMS_GYRO
from altijax.motions import Readings
from altijax.recordings import Recording
from altijax.sensors import Accelerometer, Gyro


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


def town(car: np.ndarray, seed: int) -> Recording:
    """Two minutes of a car's sensors in a town."""
    truth, recorded = _town(car, jax.random.key(seed))
    truth, found = jax.tree.map(np.asarray, (truth, recorded))
    index, velocity = pd.Index(found["t"], name="t"), ["v_e", "v_n", "v_u"]
    sides = {"left": found["wheel"] - found["apart"] / 2, "right": found["wheel"] + found["apart"] / 2}
    return Recording(
        name=f"town {seed}",
        imu=pd.DataFrame(np.hstack([found["f"], found["w"]]), index, ["ax", "ay", "az", "gx", "gy", "gz"]),
        wheel=pd.DataFrame({"speed": found["wheel"]} | sides, pd.Index(found["t_wheel"], name="t")),
        gnss=pd.DataFrame(found["v_gnss"], pd.Index(found["t_gnss"], name="t"), velocity),
        reference=pd.DataFrame(truth.velocity, index, velocity).assign(alt=truth.position[:, 2]),
    )


@jax.jit
def _town(car: jax.Array, key: jax.Array) -> tuple[Readings, dict[str, jax.Array]]:
    how = Manoeuvres(turning=0.8 + 0.2 * jax.random.uniform(key), slope=0.04 + 0.02 * jax.random.uniform(key))
    motion = town_drive(how, jnp.arange(60 * 50 * 2 + 1) / 50, STANDARD_GRAVITY, legs=2)
    recorded = recorded_drive(
        motion,
        car,
        accelerometer=Accelerometer(noise_density=MEMS_ACCELEROMETER.noise_density),
        gyro=Gyro(noise_density=MEMS_GYRO.noise_density),
        receiver=DopplerReceiver(rate=10.0, horizontal_noise=0.05, vertical_noise=0.1),
        wheel_noise=0.03,
        epochs=1200,
        key=key,
    )
    return motion, recorded


@pytest.mark.slow
def test_bars_of_elevation_and_speed_hold_after_a_calibration_by_driving() -> None:
    """A car's constants from one drive, with all their errors, on another drive of the same car; four cars."""
    rng, away = np.random.default_rng(0), {"elevation": [], "speed": []}
    for seed in range(4):
        with jax.enable_x64(True):
            car = np.array([known.nominal + 0.5 * known.spread * rng.normal() for known in DRIVE_PARAMETERS.values()])
            before, after = town(car, 2 * seed), town(car, 2 * seed + 1)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # what a drive does not determine
            found = estimates.calibrate(before, list(DRIVE_PARAMETERS), method="drive")
        elevation = estimates.estimate_elevation(after, method="fused", calibration=found)
        speed = estimates.estimate_speed(after, aid_until=20.0, calibration=found)
        true_speed = np.linalg.norm(after.reference[["v_e", "v_n", "v_u"]], axis=1)
        for name, estimate, truth in (
            ("elevation", elevation, after.reference["alt"] - after.reference["alt"].iloc[0]),
            ("speed", speed, true_speed),
        ):
            later = estimate.index > 25.0
            away[name].append((np.abs(estimate[name] - truth) / estimate[f"{name}_std"])[later])
    for name, parts in away.items():
        every = np.concatenate(parts)
        assert 0.4 < np.mean(every < 1) and 0.85 < np.mean(every < 2), (name, np.mean(every < 1), np.mean(every < 2))


def test_a_drive_that_did_not_converge_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    recording, fit_drive = altijax.load_dataset("hill-road"), drives._fit_drive

    def too_short(*args: object) -> tuple:
        fit, noise = fit_drive(*args)
        return replace(fit, converged=np.asarray(False)), noise

    monkeypatch.setattr(drives, "_fit_drive", too_short)
    with pytest.warns(UserWarning) as said:
        calibration = estimates.calibrate(recording, "gyro_bias_z", method="drive", until=45.0)
    assert any("did not converge" in str(warning.message) for warning in said)
    assert "did not converge" in repr(calibration) and not calibration.converged
