"""Elevation from an accelerometer triad and a vehicle speed sensor, in two ways.

Shirai's way takes the length of the specific force, which no mounting angle changes, and integrates a vertical
acceleration twice: a constant error b of it grows as b t^2 / 2. The slope way takes the forward axis alone and
integrates a climb once: its constant error grows as the way, b / g metres a metre, but it cannot tell a forward bias
from a mounting pitch.
"""

import jax
import jax.numpy as jnp
from jax.typing import ArrayLike

from altijax import _safe
from altijax._shapes import require_shape
from altijax.signals import cumulative_integral, derivative, low_pass


def vertical_acceleration(
    f_norm: ArrayLike, a_progress: ArrayLike, a_centripetal: ArrayLike, gravity: ArrayLike
) -> jax.Array:
    """Vertical acceleration without attitude.

    Eq. (1) of [shirai2000]_: ``h = (G^2 - a_x^2 - a_y^2 - g^2) / (2 g)``. It presumes that all acceleration in the
    vertical plane lies along the path; where the road curves up or down, with pitch rate theta', h is too large by (v
    theta')^2 / 2g. Vibration raises it by the sum of the three axes' variances over 2g: filter the triad before taking
    its length.

    Parameters
    ----------
    f_norm : (...) m/s^2
        Length of the specific force, G.
    a_progress : (...) m/s^2
        Change of speed, a_x.
    a_centripetal : (...) m/s^2
        Horizontal acceleration across the path, a_y: speed times cos(pitch) times the rate of yaw.
    gravity : (...) m/s^2
        Magnitude of gravity, g.

    Returns
    -------
    h : (...) m/s^2
        Vertical acceleration, up positive.
    """
    f_norm, a_progress = require_shape("f_norm", f_norm, (...,)), require_shape("a_progress", a_progress, (...,))
    a_centripetal = require_shape("a_centripetal", a_centripetal, (...,))
    gravity = require_shape("gravity", gravity, (...,))
    # Eq. (1), its difference of squares factored: G and g are nearly equal.
    return ((f_norm - gravity) * (f_norm + gravity) - a_progress**2 - a_centripetal**2) / (2 * gravity)


def horizontal_acceleration(a_progress: ArrayLike, a_vertical: ArrayLike) -> tuple[jax.Array, jax.Array]:
    """Horizontal acceleration along the path as the second line of Eq. (1) of [shirai2000]_ has it.

    ``x = sign(a_x) sqrt(a_x^2 - h^2)``; the sign, which the paper leaves open, is that of the progress. On vertical
    curvature h exceeds a_x and x is imaginary: there zero is returned, flagged.

    Parameters
    ----------
    a_progress : (...) m/s^2
        Change of speed, a_x.
    a_vertical : (...) m/s^2
        Vertical acceleration, h.

    Returns
    -------
    x : (...) m/s^2
        Horizontal acceleration, forward positive.
    valid : (...)
        False where x would be imaginary.
    """
    a, h = require_shape("a_progress", a_progress, (...,)), require_shape("a_vertical", a_vertical, (...,))
    squared = (a - h) * (a + h)
    return jnp.sign(a) * _safe.sqrt(squared), squared >= 0


def slope_sine(f_x: ArrayLike, a_progress: ArrayLike, gravity: ArrayLike) -> jax.Array:
    """Sine of the road's inclination from the forward specific force.

    ``sin(theta) = (f_x - dv/dt) / g``, Eq. (12) of [us20060293826]_ solved for the inclination.

    Parameters
    ----------
    f_x : (...) m/s^2
        Specific force along the path.
    a_progress : (...) m/s^2
        Change of speed.
    gravity : (...) m/s^2
        Magnitude of gravity.

    Returns
    -------
    sine : (...)
        Uphill positive; beyond 1 where the readings contradict each other.
    """
    f_x, a_progress = require_shape("f_x", f_x, (...,)), require_shape("a_progress", a_progress, (...,))
    return (f_x - a_progress) / require_shape("gravity", gravity, (...,))


def horizontal_distance(t: ArrayLike, speed: ArrayLike, vertical_speed: ArrayLike) -> jax.Array:
    """Horizontal distance travelled: the integral of ``sqrt(v^2 - v_z^2)``, which never exceeds the way.

    The horizontal distances printed in [shirai2000]_ do exceed the way in places: they were formed from
    `horizontal_acceleration` integrated twice.

    Parameters
    ----------
    t : (time,) s
        Times, increasing.
    speed : (..., time) m/s
        Speed along the path.
    vertical_speed : (..., time) m/s
        Its vertical part.

    Returns
    -------
    distance : (..., time) m
        Zero at the first sample; where the vertical speed exceeds the speed nothing is added.

    Raises
    ------
    ValueError
        If the shapes do not fit.
    """
    t = require_shape("t", t, (None,))
    v = require_shape("speed", speed, (..., t.size))
    v_z = require_shape("vertical_speed", vertical_speed, (..., t.size))
    return cumulative_integral(t, _safe.sqrt((v - v_z) * (v + v_z)))


def elevation_by_norm(
    t: ArrayLike,
    f_b: ArrayLike,
    speed: ArrayLike,
    yaw_rate: ArrayLike,
    gravity: ArrayLike,
    initial_vertical_speed: ArrayLike,
    cutoff: ArrayLike = 1.0,
) -> tuple[jax.Array, jax.Array]:
    """Elevation by Eq. (1) of [shirai2000]_ from uniformly sampled readings.

    The triad, the speed and the yaw rate pass the same zero-phase low pass before the norm is taken.

    Parameters
    ----------
    t : (time,) s
        Times, uniformly spaced. At least three.
    f_b : (..., time, 3) m/s^2
        Specific force; any mounting will do.
    speed : (..., time) m/s
        Speed along the path.
    yaw_rate : (..., time) rad/s
        Rate of turn.
    gravity : (...) m/s^2
        Magnitude of gravity.
    initial_vertical_speed : (...) m/s
        Vertical speed at the first sample: zero at standstill.
    cutoff : () Hz, optional
        Of the low pass. The paper names none; 1 Hz was best on a real drive.

    Returns
    -------
    elevation : (..., time) m
        Zero at the first sample.
    vertical_speed : (..., time) m/s
        Its rate of change.

    Raises
    ------
    ValueError
        If the shapes do not fit.
    """
    t = require_shape("t", t, (None,))
    f_b = low_pass(t, require_shape("f_b", f_b, (..., t.size, 3)), cutoff, axis=-2)
    speed = low_pass(t, require_shape("speed", speed, (..., t.size)), cutoff)
    yaw_rate = low_pass(t, require_shape("yaw_rate", yaw_rate, (..., t.size)), cutoff)
    gravity = require_shape("gravity", gravity, (...,))[..., None]
    h = vertical_acceleration(_safe.norm(f_b), derivative(t, speed), speed * yaw_rate, gravity)
    v_0 = require_shape("initial_vertical_speed", initial_vertical_speed, (...,))[..., None]
    vertical_speed = v_0 + cumulative_integral(t, h)
    return cumulative_integral(t, vertical_speed), vertical_speed


def elevation_by_slope(
    t: ArrayLike, f_x: ArrayLike, speed: ArrayLike, gravity: ArrayLike, cutoff: ArrayLike = 1.0
) -> tuple[jax.Array, jax.Array]:
    """Elevation by the slope: climb is speed times `slope_sine`.

    It amounts to the balance of energy ``(integral of f_x ds - v^2 / 2) / g`` and so hardly depends on the filter.

    Parameters
    ----------
    t : (time,) s
        Times, uniformly spaced. At least three.
    f_x : (..., time) m/s^2
        Specific force along the path.
    speed : (..., time) m/s
        Speed along the path.
    gravity : (...) m/s^2
        Magnitude of gravity.
    cutoff : () Hz, optional
        Of the zero-phase low pass on both readings.

    Returns
    -------
    elevation : (..., time) m
        Zero at the first sample.
    vertical_speed : (..., time) m/s
        Its rate of change.

    Raises
    ------
    ValueError
        If the shapes do not fit.
    """
    t = require_shape("t", t, (None,))
    f_x = low_pass(t, require_shape("f_x", f_x, (..., t.size)), cutoff)
    speed = low_pass(t, require_shape("speed", speed, (..., t.size)), cutoff)
    gravity = require_shape("gravity", gravity, (...,))[..., None]
    vertical_speed = speed * slope_sine(f_x, derivative(t, speed), gravity)
    return cumulative_integral(t, vertical_speed), vertical_speed
