"""Stepping is the whole run, also after the state was kept as text; and it compiles once."""

import json
from collections.abc import Iterator

import jax
import numpy as np
import pytest

from altijax.programs import count_programs
from altijax.speed import speed_with_aided_roll, speed_with_roll
from altijax.speed_estimate.filter import MARGIN, filter_speed
from altijax.speed_estimate.steps import STEP, drive_in_steps, steps_until
from altijax.streaming import (
    FilterSample,
    FilterState,
    LoopSample,
    LoopState,
    filter_start,
    filter_step,
    speed_start,
    speed_step,
    state_from_dict,
    state_to_dict,
)
from tests.made_drives import curvy_recording

GRAVITY, DT = 9.80665, 0.02


@pytest.fixture(scope="module", autouse=True)
def double_precision() -> Iterator[None]:
    with jax.enable_x64(True):
        yield


@pytest.fixture(scope="module")
def readings() -> np.ndarray:
    """Forward and lateral force, rates about y and z, of bends; some of them beyond what a roll explains."""
    t = np.arange(0, 6, DT)
    rate = 0.5 * np.sin(1.5 * t)
    f_y = 10 * rate
    f_y[200:205] = 15.0
    return np.stack([0.8 * np.cos(t), f_y, 0.01 * np.sin(3 * t), rate])


def kept(state: LoopState | FilterState) -> LoopState | FilterState:
    return state_from_dict(type(state), json.loads(json.dumps(state_to_dict(state))))


@pytest.mark.parametrize("stepping", ["second_order", "literal"])
def test_steps_of_the_loop_are_the_whole_run(readings: np.ndarray, stepping: str) -> None:
    whole = speed_with_roll(*readings, 10.0, 0.02, GRAVITY, DT, stepping)
    state, first = speed_start(LoopSample(*readings[:, 0]), 10.0, 0.02, GRAVITY)
    found = [first]
    for number, sample in enumerate(readings[:, 1:].T):
        state, estimate = speed_step(state if number % 50 else kept(state), LoopSample(*sample), GRAVITY, DT, stepping)
        found.append(estimate)
    assert not whole[3].all()
    for one, all_at_once in zip(zip(*found, strict=True), whole, strict=True):
        np.testing.assert_allclose(np.array(one), all_at_once, rtol=0, atol=1e-12)


def test_steps_with_aid_are_the_whole_run(readings: np.ndarray) -> None:
    aid = 10 + 0.5 * np.sin(np.arange(readings.shape[1]) * DT)
    aided = np.arange(aid.size) % 100 < 30
    whole = speed_with_aided_roll(*readings, aid, aided, 10.0, 0.02, GRAVITY, DT)
    samples = [LoopSample(*sample) for sample in np.stack([*readings, aid, aided]).T]
    state, first = speed_start(samples[0], 10.0, 0.02, GRAVITY)
    found = [first]
    for sample in samples[1:]:
        state, estimate = speed_step(state, sample, GRAVITY, DT)
        found.append(estimate)
    for one, all_at_once in zip(zip(*found, strict=True), whole, strict=True):
        np.testing.assert_allclose(np.array(one), all_at_once, rtol=0, atol=1e-12)


@pytest.fixture(scope="module")
def samples() -> list[FilterSample]:
    drive = drive_in_steps(curvy_recording(), None, 20.0)
    inputs = steps_until(drive, 20.0)
    return [FilterSample(**{name: values[k] for name, values in inputs.items()}) for k in range(160)]


@pytest.mark.parametrize("sensors", ["2+3", pytest.param("6", marks=pytest.mark.slow)])
def test_steps_of_the_filter_are_the_whole_run(samples: list[FilterSample], sensors: str) -> None:
    columns = {name: np.stack([getattr(s, name) for s in samples]) for name in FilterSample._fields}
    whole = filter_speed(**columns, speed0=10.0, pitch0=0.0, gravity=GRAVITY, dt=STEP, sensors=sensors)
    state, found = filter_start(samples[0], 10.0, 0.0, GRAVITY, sensors), []
    for number, sample in enumerate([*samples, *MARGIN * [samples[-1]]]):
        state, estimate = filter_step(state if number % 40 else kept(state), sample, GRAVITY, STEP, sensors=sensors)
        assert estimate.number == number - MARGIN
        found.append(estimate)
    for name in ("speed", "speed_std", "pitch", "roll"):
        stepped = np.array([getattr(estimate, name) for estimate in found[MARGIN:]])
        np.testing.assert_allclose(stepped, getattr(whole, name), rtol=0, atol=1e-12, err_msg=name)
    np.testing.assert_allclose(state.states, whole.states[-1], rtol=0, atol=1e-12)


def test_steps_compile_once(readings: np.ndarray) -> None:
    state, _ = speed_start(LoopSample(*readings[:, 0]), 10.0, 0.0, GRAVITY)
    state, _ = speed_step(state, LoopSample(*readings[:, 1]), GRAVITY, DT)
    with count_programs() as programs:
        for sample in readings[:, 2:10].T:
            state, _ = speed_step(state, LoopSample(*sample), GRAVITY, DT)
        speed_step(kept(state), LoopSample(*readings[:, 10]), GRAVITY, DT)
    assert programs.names == []


def test_a_state_of_another_kind_is_named(samples: list[FilterSample]) -> None:
    stored = state_to_dict(filter_start(samples[0], 10.0, 0.0, GRAVITY))
    with pytest.raises(
        ValueError, match="must have the fields of LoopState, speed, inside, pitch, readings, got states"
    ):
        state_from_dict(LoopState, stored)
