"""`estimate_drive`: within its bars on drives made by other formulas, for every set of sensors, and honest options."""

import warnings
from dataclasses import replace
from functools import cache

import jax
import numpy as np
import pandas as pd
import pytest

from altijax.datasets import load_dataset
from altijax.recordings import Recording
from altijax.samples.foreign_drives import drive_errors, foreign_drive
from altijax.vehicle.estimates import CONSISTENT, estimate_drive
from tests.vehicle.made import cut
from tests.vehicle.test_mounting import mounted

SETS = {
    "all": None,
    "GNSS and gyro": ("gyro", "velocity"),
    "no gyro": ("velocity", "course"),
    "wheels and gyro": ("gyro", "wheel", "course", "standstill"),
    "places too": ("gyro", "wheel", "velocity", "position", "course", "standstill"),
}


@cache
def drive() -> Recording:
    return cut(load_dataset("hill-road"), 0.0, 60.0)


@cache
def estimate(name: str) -> pd.DataFrame:
    return estimate_drive(drive(), use=SETS[name])


def normalised(found: pd.DataFrame, recording: Recording) -> pd.DataFrame:
    """Errors in standard deviations: angles, velocities, speed and height."""
    error = drive_errors(found, recording)
    return error / found[[f"{name}_std" for name in error]].to_numpy()


@pytest.mark.slow
@pytest.mark.parametrize("name", SETS)
def test_errors_are_no_larger_than_their_bars_on_foreign_drives(name: str) -> None:
    drives = [foreign_drive(seed) for seed in (1, 4, 7)]
    off = pd.concat([normalised(estimate_drive(d, use=SETS[name]), d).iloc[10:] for d in drives])
    if name == "wheels and gyro":
        # It starts to the East.
        off = off[["roll", "pitch", "v_u", "speed", "height"]]
    assert (off**2).mean().max() < 2.5
    assert (np.abs(off) < 2).mean().min() > 0.85
    assert (off**2).mean().max() > 0.3


@pytest.mark.slow
def test_more_sensors_make_it_no_worse() -> None:
    def rms(name: str) -> float:
        squares = []
        for seed in (1, 4, 7):
            recording = foreign_drive(seed)
            truth = recording.reference[["v_e", "v_n", "v_u"]]
            found = estimate_drive(recording, use=SETS[name])
            squares.append(np.mean((found["speed"] - np.sqrt((truth**2).sum(axis=1))) ** 2))
        return float(np.sqrt(np.mean(squares)))

    assert rms("all") < 1.05 * min(rms("GNSS and gyro"), rms("wheels and gyro"))
    assert rms("GNSS and gyro") < 1.05 * rms("no gyro")


def test_what_comes_back() -> None:
    found = estimate("all")
    assert found.index.equals(drive().imu.index)
    assert found["valid"].dtype == bool and found["valid"].all()
    wanted = {
        "east",
        "north",
        "height",
        "elevation",
        "distance",
        "speed",
        "v_e",
        "v_n",
        "v_u",
        "roll",
        "pitch",
        "heading",
    }
    assert wanted | {f"{name}_std" for name in wanted} | {"lat", "lon", "valid"} == set(found)
    said = found.attrs
    assert set(said) == {"use", "constants", "noise", "nis", "nis_by_kind", "outliers", "verdict", "rejected"}
    assert said["use"] == ("gyro", "wheel", "velocity", "course", "standstill")
    assert said["verdict"] == CONSISTENT
    value, std = said["constants"]["gnss_delay"]
    assert abs(value - 0.12) < 4 * std + 0.02
    place = drive().gnss[["lat", "lon"]].iloc[-1]
    assert np.abs(found[["lat", "lon"]].iloc[-1] - place).max() < 1e-4


def test_known_heights_are_the_datum() -> None:
    heights = drive().reference["alt"]
    ends = [(float(heights.index[k]), float(heights.iloc[k])) for k in (0, -1)]
    found = estimate_drive(drive(), known_heights=ends)
    for t, height in ends:
        k = found.index.get_indexer([t], method="nearest")[0]
        assert abs(found["elevation"].iloc[k] - height) < 0.1
    assert found["elevation_std"].mean() < estimate("all")["elevation_std"].mean()
    truth = np.interp(found.index, heights.index, heights)
    assert np.abs(found["elevation"] - truth).max() < 1.0


def test_an_estimate_never_sees_the_reference() -> None:
    spoilt = replace(drive(), reference=drive().reference * np.nan)
    pd.testing.assert_frame_equal(estimate_drive(spoilt), estimate("all"), check_exact=True)


def test_epoch_times_and_single_precision_change_nothing() -> None:
    late = replace(
        drive(),
        **{
            n: getattr(drive(), n).set_axis(getattr(drive(), n).index + 1.7e9)
            for n in ("imu", "wheel", "gnss", "reference")
        },
    )
    with jax.enable_x64(False):
        found = estimate_drive(late)
    apart = found["v_n"].to_numpy() - estimate("all")["v_n"].to_numpy()
    # Times of 1.7e9 s are kept to 0.2 microseconds; the search of noise levels makes more of them.
    assert np.abs(apart).max() < estimate("all")["v_n_std"].mean()


@pytest.mark.slow
def test_a_device_turned_in_the_vehicle_makes_the_same_drive() -> None:
    found = estimate_drive(mounted(drive(), (40.0, 20.0, -30.0)))
    apart = (found["height"] - estimate("all")["height"]) / estimate("all")["height_std"].iloc[-1]
    assert np.abs(apart).max() < 1
    assert np.abs(found["speed"] - estimate("all")["speed"]).max() < 0.3


def test_it_is_not_valid_in_gaps() -> None:
    t = drive().imu.index
    holed = replace(drive(), imu=drive().imu[(t < 20) | (t > 22)], wheel=None)
    found = estimate_drive(holed)
    assert not found["valid"].loc[22.0:22.015].any()
    assert found["valid"].mean() > 0.95
    assert np.isfinite(found.drop(columns="valid").to_numpy(float)).all()


def test_receivers_that_stand_still_are_said_to_contradict() -> None:
    gnss = drive().gnss.copy()
    stuck = (gnss.index > 36) & (gnss.index < 46)
    gnss.loc[stuck, ["v_e", "v_n", "v_u"]] = gnss.loc[gnss.index <= 36, ["v_e", "v_n", "v_u"]].iloc[-1].to_numpy()
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        found = estimate_drive(replace(drive(), gnss=gnss))
    named = [t for t, what, _ in found.attrs["rejected"] if what.startswith("velocity")]
    assert any("not to be trusted" in str(w.message) for w in said) or sum(36 <= t <= 46 for t in named) > 5


@pytest.mark.parametrize(
    ("use", "message"),
    [
        (("gyro", "sonar"), "use must be several of gyro, wheel, .*; got 'sonar'"),
        (("gyro", "course"), "needs wheel speeds or GNSS velocities, and neither is in use"),
    ],
)
def test_wrong_sources_are_named(use: tuple[str, ...], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        estimate_drive(drive(), use=use)


def test_missing_streams_are_named() -> None:
    with pytest.raises(ValueError, match="has nothing for use='wheel'"):
        estimate_drive(replace(drive(), wheel=None), use=("wheel", "gyro"))
    with pytest.raises(ValueError, match=r"neither is there: add a wheel\.csv, pulses\.csv or gnss\.csv"):
        estimate_drive(replace(drive(), wheel=None, gnss=None))
