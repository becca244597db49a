"""Fast accelerations with slow velocities, by their errors: 50 Hz motion from 1 Hz GNSS Doppler.

Per axis the velocity grows by the acceleration less its bias; the acceleration errs by white noise, the bias walks, and
each GNSS velocity errs by its own standard deviation. Between GNSS epochs nothing is random that anything measures, so
the filter and the smoother run over the epochs alone, and what lies between follows in closed form.
"""

from dataclasses import dataclass

import jax
import jax.numpy as jnp
from jax.typing import ArrayLike

from altijax import _safe
from altijax._shapes import require_shape
from altijax._values import checked, increasing, samples
from altijax.signals import cumulative_integral

State = tuple[jax.Array, ...]


@jax.tree_util.register_dataclass
@dataclass(frozen=True, kw_only=True)
class SmoothVelocity:
    """Velocity and acceleration bias at every sample, and how the GNSS epochs agree with them.

    Attributes
    ----------
    v : (..., time) m/s
        Mean of the velocity, given all accelerations and all GNSS velocities used.
    v_std : (..., time) m/s
        Its standard deviation; infinite everywhere where no GNSS velocity was used.
    bias : (..., time) m/s^2
        What the acceleration reads too much.
    bias_std : (..., time) m/s^2
        Its standard deviation.
    nis : (..., epochs)
        Square of each epoch's innovation over its variance, given the epochs before: 1 on average where the noise
        levels are right. Zero for epochs not used, and for the first.
    used : (..., epochs)
        False for epochs that are missing, outside the accelerations' time, or outliers.
    log_likelihood : (...)
        Logarithm of the probability density of the epochs used, given the first: noise levels that maximise it fit.
    """

    v: jax.Array
    v_std: jax.Array
    bias: jax.Array
    bias_std: jax.Array
    nis: jax.Array
    used: jax.Array
    log_likelihood: jax.Array


@checked(t=increasing, a=samples(1), t_gnss=increasing, v_gnss=samples(1))
@jax.jit
def smooth_velocity(
    t: ArrayLike,
    a: ArrayLike,
    t_gnss: ArrayLike,
    v_gnss: ArrayLike,
    v_std: ArrayLike,
    a_noise: ArrayLike,
    bias_walk: ArrayLike,
    bias_std: ArrayLike,
    gate: ArrayLike = 5.0,
) -> SmoothVelocity:
    """Velocity from accelerations and slower GNSS velocities, "taking into account the measurement errors".

    The Kalman filter and Rauch-Tung-Striebel smoother of the model ``dv = (a - bias) dt + a_noise dW``, ``dbias =
    bias_walk dW'``, exact at every sample: `a` runs straight between samples. Velocity before the first epoch is
    unknown. What [chalko2010]_ asks for; `match_endpoints` is the literal form.

    An epoch is an outlier where its velocity differs from what all others say of it by more than `gate` standard
    deviations. The worst of each neighbourhood of nine epochs is taken out, and so on until none is left. The
    likelihoods of two noise levels compare only with the same epochs: for a search, give outliers an infinite `v_std`
    and an infinite gate.

    Components of a vector are series of their own: put time last and the components among the batch axes.

    Parameters
    ----------
    t : (time,) s
        Times of the accelerations, increasing.
    a : (..., time) m/s^2
        Acceleration, gravity removed.
    t_gnss : (epochs,) s
        Times of the GNSS velocities, increasing, at any rate; delays taken off.
    v_gnss : (..., epochs) m/s
        GNSS velocity; not finite where it is missing.
    v_std : (..., epochs) m/s
        Its standard deviation; infinite where it is missing.
    a_noise : (...) m/s^2/sqrt(Hz)
        Density of the white noise of `a`.
    bias_walk : (...) m/s^3/sqrt(Hz)
        Density of the noise that drives the bias.
    bias_std : (...) m/s^2
        Standard deviation of the bias at the first epoch.
    gate : (...), optional
        Standard deviations beyond which an epoch is an outlier; infinite for none.

    Returns
    -------
    motion : SmoothVelocity
        Velocity and bias at each sample, their standard deviations, and the epochs' agreement with them.

    Raises
    ------
    ValueError
        If the shapes do not fit.
    """
    t = require_shape("t", t, (None,))
    a = require_shape("a", a, (..., t.size))
    t_gnss = require_shape("t_gnss", t_gnss, (None,))
    v_gnss = require_shape("v_gnss", v_gnss, (..., t_gnss.size))
    v_std = require_shape("v_std", v_std, (..., t_gnss.size))
    levels = (
        require_shape(name, value, (...,)).astype(a.dtype)
        for name, value in (("a_noise", a_noise), ("bias_walk", bias_walk), ("bias_std", bias_std), ("gate", gate))
    )
    a_noise, bias_walk, bias_std, gate = levels
    known = jnp.isfinite(v_gnss) & jnp.isfinite(v_std) & (t_gnss >= t[0]) & (t_gnss <= t[-1])
    z = jnp.where(known, v_gnss, 0)
    r = jnp.where(known, v_std, 1) ** 2
    gained = cumulative_integral(t, a)
    epochs = z, r, t_gnss, _integral_at(t_gnss, t, a, gained)
    noise = a_noise * a_noise, bias_walk * bias_walk, bias_std * bias_std
    used = _without_outliers(*jax.lax.stop_gradient((epochs, known, noise, gate)))
    filtered, adjoint, nodes, likelihood, nis, _ = _smoothed_epochs(epochs, used, noise)
    v, v_var, bias, bias_var = _between(t, gained, t_gnss, filtered, adjoint, nodes, noise)
    any_used = jnp.any(used, -1, keepdims=True)
    return SmoothVelocity(
        v=v,
        v_std=jnp.where(any_used, _safe.sqrt(v_var), jnp.inf),
        bias=bias,
        bias_std=_safe.sqrt(bias_var),
        nis=nis,
        used=used,
        log_likelihood=likelihood,
    )


@checked(t=increasing, a=samples(1), t_gnss=increasing, v_gnss=samples(1))
@jax.jit
def match_endpoints(t: ArrayLike, a: ArrayLike, t_gnss: ArrayLike, v_gnss: ArrayLike) -> jax.Array:
    """Velocity from integrated acceleration, made to meet each GNSS velocity by a constant bias between the two.

    The literal combination of [chalko2010]_: it passes on the errors of the GNSS velocities whole. Before the first and
    after the last epoch the acceleration is integrated as it is.

    Parameters
    ----------
    t : (time,) s
        Times of the accelerations, increasing.
    a : (..., time) m/s^2
        Acceleration, gravity removed.
    t_gnss : (epochs,) s
        Times of the GNSS velocities, increasing.
    v_gnss : (..., epochs) m/s
        GNSS velocity.

    Returns
    -------
    v : (..., time) m/s
        Velocity at each sample.

    Raises
    ------
    ValueError
        If the shapes do not fit.
    """
    t = require_shape("t", t, (None,))
    a = require_shape("a", a, (..., t.size))
    t_gnss = require_shape("t_gnss", t_gnss, (None,))
    v_gnss = require_shape("v_gnss", v_gnss, (..., t_gnss.size))
    gained = cumulative_integral(t, a)
    off = v_gnss - _integral_at(t_gnss, t, a, gained)
    before = jnp.clip(jnp.searchsorted(t_gnss, t, side="right") - 1, 0, t_gnss.size - 1)
    after = jnp.minimum(before + 1, t_gnss.size - 1)
    gap = t_gnss[after] - t_gnss[before]
    part = jnp.clip((t - t_gnss[before]) / jnp.where(gap > 0, gap, 1), 0, 1)
    return gained + off[..., before] + part * (off[..., after] - off[..., before])


def _integral_at(t_new: jax.Array, t: jax.Array, a: jax.Array, gained: jax.Array) -> jax.Array:
    """Integral of the piecewise linear acceleration up to any time; held outside."""
    k = jnp.clip(jnp.searchsorted(t, t_new, side="right") - 1, 0, max(t.size - 2, 0))
    after = min(1, t.size - 1) + k
    gap = t[after] - t[k]
    into = jnp.clip(t_new - t[k], 0, gap)
    part = into / jnp.where(gap > 0, gap, 1)
    return gained[..., k] + into * (a[..., k] + 0.5 * part * (a[..., after] - a[..., k]))


# Epochs to each side among which only the worst is taken out in one round. An outlier makes its neighbours contradict
# the rest too, with signs that change, because it bends the bias.
_NEIGHBOURS = 4


def _without_outliers(epochs: State, known: jax.Array, noise: State, gate: jax.Array) -> jax.Array:
    """Epochs left when those that the others contradict are taken out, in each round the worst of its neighbourhood."""

    def take_out(state: tuple[jax.Array, jax.Array]) -> tuple[jax.Array, jax.Array]:
        used, _ = state
        contradiction = _smoothed_epochs(epochs, used, noise)[-1]
        window = (1,) * (contradiction.ndim - 1) + (2 * _NEIGHBOURS + 1,)
        largest = jax.lax.reduce_window(contradiction, -jnp.inf, jax.lax.max, window, (1,) * len(window), "SAME")
        worst = contradiction == largest
        out = used & worst & (contradiction > gate[..., None] ** 2)
        return used & ~out, jnp.any(out)

    shape = jnp.broadcast_shapes(known.shape, epochs[3].shape, *((*level.shape, 1) for level in (*noise, gate)))
    return jax.lax.while_loop(lambda state: state[1], take_out, (jnp.broadcast_to(known, shape), jnp.array(True)))[0]


def _smoothed_epochs(
    epochs: State, used: jax.Array, noise: State
) -> tuple[State, State, State, jax.Array, jax.Array, jax.Array]:
    """Filtered states and adjoint variables at the epochs, where they lie, log-likelihood, NIS and contradiction.

    The smoother is Bryson's and Frazier's, which inverts no covariance: the smoothed state is ``x + P l``, its
    covariance ``P - P L P``. The first epoch used is the initial state; epochs before it are put at its time.
    """
    z, r, time, gained = epochs
    q_a, q_b, p_b = (level[..., None] for level in noise)
    shape = used.shape
    number = jnp.arange(shape[-1])
    first = jnp.argmax(used, -1)[..., None]
    updates = used & (number > first)
    z, r, time, gained = (jnp.broadcast_to(x, shape) for x in (z, r, time, gained))
    started = number > first
    time, gained = (jnp.where(started, x, jnp.take_along_axis(x, first, -1)) for x in (time, gained))
    dt, du = (jnp.diff(x, axis=-1, prepend=x[..., :1]) for x in (time, gained))
    zero = jnp.zeros_like(z[..., 0])
    start: State = (
        jnp.take_along_axis(z, first, -1)[..., 0],
        zero,
        jnp.take_along_axis(r, first, -1)[..., 0],
        zero,
        zero + p_b[..., 0],
    )
    q_a, q_b = q_a[..., 0], q_b[..., 0]

    def forward(state: State, epoch: State) -> tuple[State, tuple[State, State]]:
        dt, du, z, r, update = epoch
        v, b, p11, p12, p22 = _predicted(state, dt, du, q_a, q_b)
        weight = update / (p11 + r)
        innovation = z - v
        k1, k2 = weight * p11, weight * p12
        # r / (p11 + r) instead of 1 - k1 keeps the digits of a variance far below the predicted one
        left = jnp.where(update > 0, weight * r, 1)
        later = v + k1 * innovation, b + k2 * innovation, left * p11, left * p12, p22 - k2 * p12
        return later, (later, (innovation, weight, k1, k2))

    by_epoch = tuple(jnp.moveaxis(x, -1, 0) for x in (dt, du, z, r, updates.astype(z.dtype)))
    filtered, gains = jax.lax.scan(forward, start, by_epoch)[1]

    def backward(adjoint: State, epoch: tuple[jax.Array, State]) -> tuple[State, tuple[State, State]]:
        dt, (innovation, weight, k1, k2) = epoch
        l1, l2, l11, l12, l22 = adjoint
        smoothed = weight * innovation - k1 * l1 - k2 * l2
        spread = weight + k1 * k1 * l11 + 2 * k1 * k2 * l12 + k2 * k2 * l22
        before = (
            l1 + smoothed,
            l2,
            l11 - 2 * (k1 * l11 + k2 * l12) + spread,
            l12 - k1 * l12 - k2 * l22,
            l22,
        )
        return _carried_back(before, dt), (before, (smoothed, spread))

    none: State = (zero,) * 5
    adjoint, (smoothed, spread) = jax.lax.scan(backward, none, (by_epoch[0], gains), reverse=True)[1]
    filtered, adjoint = (tuple(jnp.moveaxis(x, 0, -1) for x in state) for state in (filtered, adjoint))
    innovation, weight, smoothed, spread = (jnp.moveaxis(x, 0, -1) for x in (*gains[:2], smoothed, spread))

    nis = innovation * innovation * weight
    likelihood = -0.5 * jnp.sum(nis + jnp.where(updates, jnp.log(2 * jnp.pi / jnp.where(updates, weight, 1)), 0), -1)
    # Squared difference from what all other epochs say, over its variance; of the first epoch its adjoint tells it.
    is_first = used & (number == first)
    difference = jnp.where(is_first, adjoint[0], smoothed)
    variance = jnp.where(is_first, adjoint[2], spread)
    contradiction = jnp.where(variance > 0, difference**2 / jnp.where(variance > 0, variance, 1), 0)
    return filtered, adjoint, (time, gained, first), likelihood, nis, contradiction


def _predicted(state: State, dt: jax.Array, du: jax.Array, q_a: jax.Array, q_b: jax.Array) -> State:
    """State and covariance after `dt`, or before it where `dt` is negative."""
    v, b, p11, p12, p22 = state
    span = jnp.abs(dt)
    grown = span * (q_a + q_b * span * span / 3)
    return (
        v + du - b * dt,
        b,
        p11 - dt * (2 * p12 - dt * p22) + grown,
        p12 - dt * p22 - 0.5 * q_b * dt * span,
        p22 + q_b * span,
    )


def _carried_back(adjoint: State, dt: jax.Array) -> State:
    """Adjoint variables `dt` earlier: by the transpose of the transition."""
    l1, l2, l11, l12, l22 = adjoint
    return l1, l2 - dt * l1, l11, l12 - dt * l11, l22 - dt * (2 * l12 - dt * l11)


def _corrected(state: State, adjoint: State) -> State:
    """Smoothed state and covariance."""
    v, b, p11, p12, p22 = state
    l1, l2, l11, l12, l22 = adjoint
    by_v = l11 * p11 + l12 * p12, l12 * p11 + l22 * p12
    by_b = l11 * p12 + l12 * p22, l12 * p12 + l22 * p22
    return (
        v + p11 * l1 + p12 * l2,
        b + p12 * l1 + p22 * l2,
        p11 - p11 * by_v[0] - p12 * by_v[1],
        p12 - p11 * by_b[0] - p12 * by_b[1],
        p22 - p12 * by_b[0] - p22 * by_b[1],
    )


def _between(
    t: jax.Array, gained: jax.Array, t_gnss: jax.Array, filtered: State, adjoint: State, nodes: State, noise: State
) -> State:
    """Smoothed velocity and bias and their variances at every sample, from the epoch before it and the one after."""
    time, gained_there, first = nodes
    q_a, q_b, _ = (level[..., None] for level in noise)
    # Up to the first epoch used the smoothed state there is carried back; after the last one nothing follows.
    held = jnp.arange(time.shape[-1]) < first
    smoothed = _corrected(filtered, adjoint)
    interval = jnp.searchsorted(t_gnss, t, side="right")

    def at_samples(of_epochs: jax.Array, before: jax.Array) -> jax.Array:
        """Value that belongs to the epoch before each sample; `before` serves samples before all epochs."""
        rows = jnp.concatenate([jnp.broadcast_to(before, of_epochs[..., :1].shape), of_epochs], -1)
        return jnp.take(rows, interval, axis=-1)

    base = tuple(at_samples(jnp.where(held, s, f), s[..., :1]) for f, s in zip(filtered, smoothed, strict=True))
    end = jnp.zeros_like(time[..., :1])
    following = (at_samples(jnp.where(held, 0, jnp.concatenate([x[..., 1:], end], -1)), end) for x in adjoint)
    next_time = jnp.concatenate([time[..., 1:], time[..., -1:]], -1)
    since = t - at_samples(time, time[..., :1])
    until = at_samples(next_time, time[..., :1]) - t
    state = _predicted(base, since, gained - at_samples(gained_there, gained_there[..., :1]), q_a, q_b)
    v, bias, v_var, _, bias_var = _corrected(state, _carried_back(tuple(following), until))
    return v, v_var, bias, bias_var
