"""Delay of GNSS velocities behind an accelerometer, with its error and a flag where the motion does not tell it."""

from dataclasses import dataclass
from functools import partial

import jax
import jax.numpy as jnp
from jax.typing import ArrayLike

from altijax import _safe
from altijax._shapes import require_shape
from altijax._values import checked, increasing
from altijax.signals import cumulative_integral, low_pass, resample


@jax.tree_util.register_dataclass
@dataclass(frozen=True, kw_only=True)
class Delay:
    """How late GNSS velocities are, and how well that is known.

    Attributes
    ----------
    delay : () s
        What to take off the stamps of the GNSS velocities; negative where they are early.
    std : () s
        Its standard deviation, from the misfit left and its correlation in time; at most that of a delay which may lie
        anywhere in the range considered.
    correlation : ()
        Between the accelerations by both sensors at that delay.
    ambiguous : ()
        True where another delay fits about as well, none fits, or the best lies at an end of the range.
    """

    delay: jax.Array
    std: jax.Array
    correlation: jax.Array
    ambiguous: jax.Array


@checked(t=increasing, t_gnss=increasing)
@partial(jax.jit, static_argnames="max_delay")
def estimate_delay(t: ArrayLike, a: ArrayLike, t_gnss: ArrayLike, v_gnss: ArrayLike, max_delay: float = 1.0) -> Delay:
    """Delay at which accelerations agree best with the changes of GNSS velocity.

    From epoch to epoch the velocity changes by the mean of the acceleration, shifted by the delay. Both are compared
    between 0.1 Hz, below which slopes and biases look like accelerations (on a real road they shifted the delay by
    0.09 s), and 1 Hz, above which Doppler noise prevails; so velocities of 1 to 10 Hz serve alike. The best of a grid
    is refined by Gauss's and Newton's method.

    Gravity must be off before: from an attitude, or along the road as ``f_x - g sin(pitch)``. Magnitudes of force,
    which need no attitude, do not tell the delay: gravity leaves in them the vertical acceleration only.

    Parameters
    ----------
    t : (time,) s
        Times of the accelerations, increasing.
    a : (components, time) m/s^2
        Components of the acceleration in axes of the velocity: one along the road, or East, North and up.
    t_gnss : (epochs,) s
        Stamps of the GNSS velocities, increasing, about uniform. At least eight.
    v_gnss : (components, epochs) m/s
        GNSS velocity; not finite where it is missing.
    max_delay : float, optional
        Largest delay, to both sides, that is considered, in s.

    Returns
    -------
    delay : Delay
        The delay, its standard deviation, and whether it is ambiguous.

    Raises
    ------
    ValueError
        If the shapes do not fit or there are fewer than eight epochs.
    """
    t = require_shape("t", t, (None,))
    a = require_shape("a", a, (None, t.size))
    t_gnss = require_shape("t_gnss", t_gnss, (None,))
    v_gnss = require_shape("v_gnss", v_gnss, (a.shape[0], t_gnss.size))
    if t_gnss.size < 8:
        raise ValueError(f"t_gnss must have at least 8 epochs, got {t_gnss.size}")
    gained = cumulative_integral(t, a)
    dt = jnp.diff(t_gnss)
    middle = 0.5 * (t_gnss[1:] + t_gnss[:-1])
    inside = (t_gnss - max_delay >= t[0]) & (t_gnss + max_delay <= t[-1])
    known = inside & jnp.isfinite(v_gnss)
    known = known[:, 1:] & known[:, :-1]
    band = partial(_band, middle)

    def change(series: jax.Array) -> jax.Array:
        return band(jnp.where(known, jnp.diff(jnp.where(jnp.isfinite(series), series, 0)) / dt, 0))

    def shifted(delay: jax.Array) -> jax.Array:
        """Means of the acceleration over the epochs, as GNSS of that delay would show them."""
        return change(resample(t_gnss - delay, t, gained, jnp.inf)[0])

    def slope(delay: jax.Array) -> jax.Array:
        # Over a fifth of a second: single samples vibrate, which would make the slope, and so the certainty, too large.
        return (shifted(delay + 0.1) - shifted(delay - 0.1)) / 0.2

    measured = change(v_gnss)
    grid = jnp.linspace(-max_delay, max_delay, _GRID, dtype=t.dtype)
    on_grid = jax.lax.map(lambda delay: _correlation(measured, shifted(delay)), grid)
    best = jnp.argmax(on_grid)
    spacing = 2 * max_delay / (_GRID - 1)

    def improve(_: jax.Array, delay: jax.Array) -> jax.Array:
        left, by_delay = _linearised(measured, shifted(delay), slope(delay))
        step = _ratio(jnp.sum(left * by_delay), jnp.sum(by_delay**2))
        return jnp.clip(delay + step, grid[best] - spacing, grid[best] + spacing)

    delay = jax.lax.fori_loop(0, 5, improve, grid[best])
    left, by_delay = _linearised(measured, shifted(delay), slope(delay))
    curvature = jnp.sum(by_delay**2)
    gradient_var = _long_run_variance(jnp.sum(left * by_delay, 0), _MEMORY / (t_gnss[-1] - t_gnss[0]))
    # Not known at all, it is somewhere in the range.
    widest = max_delay / 3**0.5
    std = jnp.minimum(jnp.where(curvature > 0, _ratio(_safe.sqrt(gradient_var), curvature), widest), widest)

    # Another peak is as good where its misfit is larger by less than three standard deviations would make it, in units
    # of a variance that counts the correlation in time; or where the grid, which may miss the top of a peak by a
    # hundredth, cannot tell them apart.
    found = _correlation(measured, shifted(delay))
    peaks = on_grid[1:-1]
    others = (peaks > on_grid[:-2]) & (peaks >= on_grid[2:]) & (jnp.abs(grid[1:-1] - grid[best]) > 1.5 * spacing)
    second = jnp.max(jnp.where(others, peaks, 0))
    count = jnp.sum(known)
    by_chance = 9 * jnp.maximum(_ratio(gradient_var, curvature * jnp.sum(left**2)), 1 / count)
    rival = (1 - second**2 < (1 - found**2) * (1 + by_chance)) | (second > 0.98 * found)
    weak = found**2 < by_chance * (1 - found**2)
    at_end = (best == 0) | (best == _GRID - 1)
    return Delay(delay=delay, std=std, correlation=found, ambiguous=rival | weak | at_end | (found <= 0))


_GRID = 81
# Time in s over which the misfit is taken to remember itself.
_MEMORY = 3.0


def _band(t: jax.Array, series: jax.Array) -> jax.Array:
    return low_pass(t, series, 1.0) - low_pass(t, series, 0.1)


def _ratio(x: jax.Array, y: jax.Array) -> jax.Array:
    return jnp.where(y > 0, x / jnp.where(y > 0, y, 1), 0)


def _correlation(x: jax.Array, y: jax.Array) -> jax.Array:
    return _ratio(jnp.sum(x * y), _safe.sqrt(jnp.sum(x * x) * jnp.sum(y * y)))


def _linearised(measured: jax.Array, model: jax.Array, slope: jax.Array) -> tuple[jax.Array, jax.Array]:
    """What a multiple of the model leaves of the measured, and how the model moves with the delay beside it."""
    squared = jnp.sum(model * model)
    gain = _ratio(jnp.sum(measured * model), squared)
    return measured - gain * model, gain * (slope - _ratio(jnp.sum(slope * model), squared) * model)


def _long_run_variance(series: jax.Array, memory: jax.Array) -> jax.Array:
    """Variance of the sum of a correlated series (Newey and West), `memory` as a part of its length."""
    n = series.size
    power = jnp.abs(jnp.fft.rfft(series, 2 * n)) ** 2
    covariances = jnp.fft.irfft(power, 2 * n)[:n]
    weights = jnp.maximum(0, 1 - jnp.arange(n) / jnp.maximum(memory * n, 1)).astype(series.dtype)
    return 2 * jnp.sum(weights * covariances) - covariances[0]
