"""Array functions refuse what they can give no answer for, by name, value and place."""

import jax
import numpy as np
import pytest

from altijax._values import checked, increasing, not_decreasing
from altijax.calibration.serial_correlation import mean_with_std, statistical_inefficiency
from altijax.calibration.static import fit_gyro_at_rest
from altijax.delays import estimate_delay
from altijax.metrics import coverage, rms
from altijax.rotations import interpolate_rotations
from altijax.signals import cumulative_integral, derivative, interval_means, low_pass, resample
from altijax.smoothing import match_endpoints, smooth_velocity
from altijax.wheels import speed_from_pulses

T = np.arange(12.0)
BACK = np.append(T[:-1], 3.0)
NONE = np.zeros(0)
STEP = r"must increase, got 3.0 after 10.0 at index 11; sort it, and keep one of equal times"


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: low_pass(T, T, 0.0), r"cutoff must be positive, got 0.0"),
        (lambda: low_pass(T, T, np.nan), r"cutoff must be positive, got nan"),
        (lambda: low_pass(BACK, T, 0.1), f"t {STEP}"),
        (lambda: derivative(BACK, T), f"t {STEP}"),
        (lambda: derivative([0, 1, 1], [0, 1, 2]), r"t must increase, got 1 after 1 at index 2; .* keep one of equal"),
        (lambda: derivative([0, np.nan, 2], [0, 1, 2]), r"t must increase, got nan after 0.0 at index 1"),
        (lambda: cumulative_integral(BACK, T), r"t must not decrease, got 3.0 after 10.0 at index 11; sort it"),
        (lambda: resample(T, BACK, T, 1.0), r"t_samples must not decrease"),
        (lambda: interval_means(T, T, BACK), r"edges must not decrease"),
        (lambda: speed_from_pulses([0.0, 1, 1, 2], T, 0.5), r"t_pulses must increase, got 1.0 after 1.0 at index 2"),
        (lambda: speed_from_pulses([[0.0, 1, 2], [0, 2, 1]], T, 0.5), r"t_pulses must increase, got 1.0 after 2.0"),
        (lambda: speed_from_pulses([0.0, np.inf, 2], T, 0.5), r"t_pulses must increase, got 2.0 after inf at index 2"),
        (lambda: estimate_delay(BACK, T[None], T, T[None]), f"t {STEP}"),
        (lambda: estimate_delay(T, T[None], BACK, T[None]), f"t_gnss {STEP}"),
        (lambda: match_endpoints(T, T, BACK, T), f"t_gnss {STEP}"),
        (lambda: match_endpoints(T, T, NONE, NONE), r"v_gnss must have at least 1 sample, got 0"),
        (lambda: smooth_velocity(NONE, NONE, T, T, T, 1, 1, 1), r"a must have at least 1 sample, got 0"),
        (lambda: interpolate_rotations(T, T[:2][::-1], np.stack([np.eye(3)] * 2)), r"t_knots must increase"),
        (lambda: rms(NONE), r"error must have at least 1 sample, got 0"),
        (lambda: coverage(NONE, NONE, 2), r"error must have at least 1 sample, got 0"),
        (lambda: statistical_inefficiency(NONE), r"series must have at least 2 samples, got 0"),
        (lambda: mean_with_std([1.0]), r"series must have at least 2 samples, got 1"),
        (lambda: fit_gyro_at_rest(np.zeros((0, 3))), r"w_b must have at least 2 samples, got 0"),
        (lambda: fit_gyro_at_rest(np.zeros((9, 3))), r"w_b is 0.0 throughout in column 0, so its noise cannot be told"),
    ],
)
def test_what_has_no_answer_is_refused(call, message):
    with pytest.raises(ValueError, match=message):
        call()


def test_the_advice_mends_it():
    repeated = np.array([0.0, 2, 1, 1])
    assert np.isfinite(speed_from_pulses(np.unique(repeated), T, 0.5)[0]).all()
    assert np.isfinite(derivative(np.sort(BACK[[0, 2, 1]]), T[:3])).all()


def test_what_is_being_traced_is_not_looked_at():
    function = checked(t=increasing, s=not_decreasing)(lambda t, s=0.0: t)
    assert jax.jit(function)(BACK).shape == (12,)
    assert jax.grad(lambda a: function(BACK * a).sum())(1.0) == BACK.sum()
    with pytest.raises(ValueError, match="t must increase"):
        function(BACK)
    with pytest.raises(TypeError, match="missing a required argument: 't'"):
        function()
    assert function(0.0) == 0.0
