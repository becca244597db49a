"""Wheel ticks against the way that made them: counters that roll over, turn round, or count from message to message."""

import numpy as np
import pandas as pd
import pytest

from altijax.formats.ubx_ticks import tick_rate, wheel_table

T = np.arange(0, 60, 0.1)
SPEED = 8 + 6 * np.sin(T / 5)
WAY = np.concatenate([[0], np.cumsum((SPEED[1:] + SPEED[:-1]) / 2 * np.diff(T))])
LENGTH = 0.02
MIDDLE = (T[1:] + T[:-1]) / 2


def gnss(speed=SPEED):
    return pd.DataFrame({"t": T, "v_e": 0.6 * speed, "v_n": 0.8 * speed})


@pytest.mark.parametrize("bits", [8, 12, 16, 23])
def test_counters_of_any_size_roll_over(bits):
    words = (2**bits - 500 + np.floor(WAY / LENGTH).astype(int)) % 2**bits
    t, rate = tick_rate(T, words)
    np.testing.assert_allclose(t, MIDDLE)
    np.testing.assert_allclose(rate * LENGTH, np.interp(MIDDLE, T, SPEED), atol=LENGTH / 0.1)


def test_backwards_the_count_goes_on_and_the_bit_tells():
    words = np.floor(WAY / LENGTH).astype(int) % 2**16 | np.where(T > 30, 0x800000, 0)
    _, rate = tick_rate(T, words)
    np.testing.assert_allclose(np.sign(rate), np.where(T[1:] > 30, -1, 1))


def test_ticks_since_the_message_before():
    steps = np.diff(np.floor(WAY / LENGTH).astype(int), prepend=0)
    _, rate = tick_rate(T, steps)
    np.testing.assert_allclose(rate * LENGTH, np.interp(MIDDLE, T, SPEED), atol=LENGTH / 0.1)


def test_a_wheel_that_stands():
    assert (tick_rate(T, np.full(len(T), 77))[1] == 0).all()


def test_wheels_are_scaled_together_by_gnss():
    counts = [(np.floor(scale * WAY / LENGTH).astype(int) % 2**16) for scale in (0.98, 1.02)]
    notes, problems = [], []
    table = wheel_table({8: (T, counts[0]), 9: (T, counts[1])}, gnss(), "x.ubx", problems, notes)
    assert list(table.columns) == ["t", "rear_left", "rear_right"] and not problems
    assert "a wheel tick is 0.02" in notes[0] and "not independent of GNSS" in notes[0]
    mean = table[["rear_left", "rear_right"]].mean(axis=1)
    np.testing.assert_allclose(mean, np.interp(table["t"], T, SPEED), atol=0.25)
    ratio = table["rear_right"].sum() / table["rear_left"].sum()
    assert ratio == pytest.approx(1.02 / 0.98, rel=1e-3)


def test_a_single_tick_is_the_speed():
    table = wheel_table({10: (T, np.floor(WAY / LENGTH).astype(int) % 2**16)}, gnss(), "x.ubx", [], [])
    assert list(table.columns) == ["t", "speed"]


@pytest.mark.parametrize("speeds", [None, gnss(0 * SPEED)])
def test_without_a_moving_gnss_nobody_knows_how_far_a_tick_is(speeds):
    problems = []
    assert wheel_table({10: (T, np.arange(len(T)))}, speeds, "x.ubx", problems, []) is None
    assert "wheel ticks left out" in problems[0] and "wheel.csv" in problems[0]
