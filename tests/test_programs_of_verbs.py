"""How many programs a first call compiles: few, none the second time, and none for a recording of another length."""

from collections.abc import Callable
from dataclasses import replace

import jax
import pytest

from altijax.datasets import load_dataset
from altijax.estimates import ACCEPTED, calibrate, estimate_elevation, estimate_motion, estimate_speed
from altijax.programs import count_programs
from altijax.recordings import Recording
from altijax.vehicle.estimates import estimate_drive

Work = Callable[[Recording], object]


def calibrated(names: str | list[str], method: str) -> Work:
    return lambda recording: calibrate(recording, names, method=method, until=60.0)


HEIGHTS = [(0.0, 10.0), (60.0, 12.0)]
VERBS: dict[str, Work] = {
    **{f"elevation {m}": lambda r, m=m: estimate_elevation(r, method=m) for m in ("slope", "shirai", "fused")},
    "elevation slope, known heights": lambda r: estimate_elevation(r, method="slope", known_heights=HEIGHTS),
    **{f"speed {m}": lambda r, m=m: estimate_speed(r, method=m, aid_until=30.0) for m in ("filter", "roll", "aided")},
    "speed conventional": lambda r: estimate_speed(r, method="conventional", aid_until=30.0),
    **{f"speed filter {s}": lambda r, s=s: estimate_speed(r, sensors=s, aid_until=30.0) for s in ("2+2", "6")},
    **{f"motion {m}": lambda r, m=m: estimate_motion(r, method=m) for m in ("epoch", "window")},
}
SLOW_VERBS: dict[str, Work] = {
    "motion batch": lambda r: estimate_motion(r, method="batch"),
    "motion batch, no gyro": lambda r: estimate_motion(r, method="batch", use_gyro=False),
}
CALIBRATIONS: dict[str, Work] = {
    **{m: calibrated("accelerometer_bias_x", m) for m in ("slope", "shirai", "fused", "filter")},
    **{m: calibrated("gyro_bias_y", m) for m in ("conventional", "roll", "aided")},
    **{m: calibrated("gnss_delay", m) for m in ("epoch", "window")},
}
SLOW_CALIBRATIONS: dict[str, Work] = {
    "batch": calibrated("gnss_delay", "batch"),
    "drive": calibrated(ACCEPTED["drive"], "drive"),
}


@pytest.fixture(scope="module")
def recording() -> Recording:
    return load_dataset("hill-road")


def until(recording: Recording, last: float) -> Recording:
    streams = {name: getattr(recording, name) for name in ("imu", "wheel", "gnss", "reference")}
    return replace(recording, **{name: frame[:last] for name, frame in streams.items()})


def counted(work: Work, recording: Recording) -> list[str]:
    with count_programs() as programs:
        work(recording)
    return programs.names


def assert_few(work: Work, recording: Recording, most: int) -> None:
    jax.clear_caches()
    first = counted(work, recording)
    assert len(first) <= most, first
    assert counted(work, recording) == []
    assert counted(work, until(recording, 80.0)) == []


@pytest.mark.parametrize("name", VERBS)
def test_a_verb_compiles_five_programs_at_most(name: str, recording: Recording) -> None:
    assert_few(VERBS[name], recording, 5)


@pytest.mark.parametrize("name", CALIBRATIONS)
@pytest.mark.filterwarnings("ignore:.*worse where they were not fitted", "ignore:The data say less of")
def test_a_calibration_compiles_eight_programs_at_most(name: str, recording: Recording) -> None:
    assert_few(CALIBRATIONS[name], recording, 8)


@pytest.mark.slow
@pytest.mark.parametrize("name", SLOW_VERBS)
def test_a_search_compiles_few_programs(name: str, recording: Recording) -> None:
    """Without a gyro a wind is a search of its own."""
    assert_few(SLOW_VERBS[name], recording, {"motion batch": 5, "motion batch, no gyro": 7}[name])


@pytest.mark.slow
def test_a_drive_compiles_six_programs_at_most(recording: Recording) -> None:
    """The delay of its receiver is found at the epochs, its first trajectory at instants that are closer."""
    assert_few(estimate_drive, recording, 6)


@pytest.mark.slow
@pytest.mark.parametrize("name", SLOW_CALIBRATIONS)
@pytest.mark.filterwarnings("ignore:.*worse where they were not fitted", "ignore:The data say less of")
def test_a_long_calibration_compiles_eight_programs_at_most(name: str, recording: Recording) -> None:
    assert_few(SLOW_CALIBRATIONS[name], recording, 8)


def test_reading_compiles_what_pulses_need_and_nothing_else() -> None:
    jax.clear_caches()
    assert counted(lambda _: load_dataset("hill-road"), Recording()) == ["jit(_pulse_speeds)"]
    assert counted(lambda _: load_dataset("hill-road"), Recording()) == []


def test_fifty_recordings_take_two_sizes_at_most(recording: Recording) -> None:
    jax.clear_caches()
    one = counted(VERBS["elevation slope"], recording)
    lengths = [30.0 + 1.2 * k for k in range(50)]
    others = [name for last in lengths for name in counted(VERBS["elevation slope"], until(recording, last))]
    assert len(others) <= len(one)
