"""Which driving would tell what is still unknown: the information of a planned drive and its gradient.

The information about the parameters of `DRIVE_PARAMETERS` that a drive of given `Manoeuvres` would bring is a smooth
function of them, so its derivatives say what to change: more braking, a stop, a bend, a hill.
"""

from collections.abc import Sequence

import jax
import jax.numpy as jnp
from jax.typing import ArrayLike

from altijax._shapes import require_shape
from altijax.calibration.drive_model import (
    DRIVE_PARAMETERS,
    STEP,
    STEPS_OF_INTERVAL,
    Stretch,
    drive_residuals,
    own_states,
)
from altijax.calibration.shared_parameters import shared_information
from altijax.calibration.simulated_drives import Manoeuvres, town_drive
from altijax.constants import STANDARD_GRAVITY

CHANGES = {
    "speed": (3.0, "drive {:.0f} m/s faster"),
    "ramp": (-2.0, "brake and accelerate harder, in {:.0f} s less"),
    "standstill": (4.0, "stand still {:.0f} s longer before each leg"),
    "variation": (0.05, "vary the speed under way by {:.0%} more"),
    "turning": (0.2, "take roads that turn {:.1f} rad further"),
    "slope": (0.01, "take roads that are {:.0%} steeper"),
}
"""By how much a driver can change each of `Manoeuvres` without trouble (assumed), and how one says it."""

_STEPS = 5 * STEPS_OF_INTERVAL


def drive_information(
    manoeuvres: Manoeuvres,
    noise: Sequence[float] = (0.05, 0.1, 0.02, 0.05, 0.1, 0.03),
    slow_noise: Sequence[float] = (1.4e-4, 3.5e-3, 0.02),
    *,
    minutes: int = 5,
    rate: int = 1,
) -> jax.Array:
    """Information about a drive's parameters that sensors on a drive would bring.

    Parameters
    ----------
    manoeuvres : Manoeuvres
        How one leg of a minute is driven; the others are like it.
    noise : (6,) m/s, optional
        Standard deviations of the observations, in the order of `GROUPS`.
    slow_noise : (3,) rad/sqrt(s), m/s/sqrt(s), m/s, optional
        Random walk of attitude and velocity that the IMU's noise makes, and the receiver's slow error.
    minutes : int, optional
        Number of legs.
    rate : int, optional
        Epochs of the GNSS receiver per second, a divisor of 20.

    Returns
    -------
    information : (19, 19)
        Inverse of the covariance that the data alone would give.

    Raises
    ------
    ValueError
        If the shapes do not fit.
    """
    levels = require_shape("noise", jnp.asarray(noise), (6,))
    walks = require_shape("slow_noise", jnp.asarray(slow_noise), (3,))
    stretches = round(60 / (STEP * _STEPS))
    t = STEP * jnp.arange(stretches * _STEPS, dtype=levels.dtype)
    middle = town_drive(manoeuvres, t + STEP / 2, STANDARD_GRAVITY, legs=1)
    node = town_drive(manoeuvres, t, STANDARD_GRAVITY, legs=1)

    def cut(series: jax.Array, every: int = 1) -> jax.Array:
        return series.reshape(stretches, _STEPS, *series.shape[1:])[:, ::every]

    def times(every: int) -> jax.Array:
        return jnp.broadcast_to(t[:_STEPS:every], (stretches, _STEPS // every))

    gnss, wheel = round(1 / (rate * STEP)), 4
    v_gnss, speed, turning = cut(node.velocity, gnss), cut(node.speed, wheel), cut(node.w_b[:, 2], wheel)
    data = Stretch(
        f=cut(middle.f_b),
        w=cut(middle.w_b),
        C_nb=cut(node.C_nb)[:, 0],
        gravity=jnp.full(stretches, STANDARD_GRAVITY, levels.dtype),
        noise=jnp.tile(walks, (stretches, 1)),
        t_gnss=times(gnss),
        v_gnss=v_gnss,
        gnss_std=jnp.broadcast_to(levels[:2], (*v_gnss.shape[:2], 2)),
        t_wheel=times(wheel),
        wheel=speed,
        apart=DRIVE_PARAMETERS["track_width"].nominal * turning,
        wheel_spread=jnp.zeros_like(speed),
        wheel_std=jnp.broadcast_to(levels[2:], (*speed.shape, 4)),
    )
    states = own_states(_STEPS)
    own = jnp.zeros((stretches, states), levels.dtype).at[:, 3:6].set(v_gnss[:, 0])
    own_std = jnp.ones(states, levels.dtype).at[:3].set(0.5).at[3:6].set(5.0)
    nominal = jnp.asarray([constant.nominal for constant in DRIVE_PARAMETERS.values()], levels.dtype)
    return minutes * shared_information(drive_residuals, data, nominal, own, own_std)


def manoeuvre_gains(manoeuvres: Manoeuvres, *, minutes: int = 5, rate: int = 1) -> tuple[jax.Array, jax.Array]:
    """What is known of each parameter after a drive, and what each change of the driving would add to first order.

    Parameters
    ----------
    manoeuvres : Manoeuvres
        How it is driven.
    minutes : int, optional
        Its length.
    rate : int, optional
        Epochs of the GNSS receiver per second, a divisor of 20.

    Returns
    -------
    bits : (19,)
        Information gained on each parameter, log2 of prior over posterior standard deviation.
    added : (6, 19)
        Change of these for each of `CHANGES`, from the gradient.
    """
    prior_std = jnp.asarray([constant.spread for constant in DRIVE_PARAMETERS.values()])

    def bits(x: jax.Array) -> jax.Array:
        plan = Manoeuvres(**dict(zip(CHANGES, x, strict=True)))
        scaled = drive_information(plan, minutes=minutes, rate=rate) * jnp.outer(prior_std, prior_std)
        return -0.5 * jnp.log2(jnp.diag(jnp.linalg.inv(scaled + jnp.eye(prior_std.size))))

    x = jnp.stack([jnp.asarray(getattr(manoeuvres, name), prior_std.dtype) for name in CHANGES])
    step = jnp.asarray([change for change, _ in CHANGES.values()], x.dtype)
    found, slope = jax.vmap(lambda direction: jax.jvp(bits, (x,), (direction,)), out_axes=(None, 0))(jnp.diag(step))
    return found, slope


def driving_protocol(bits: ArrayLike, added: ArrayLike, wanted: tuple[str, ...] | None = None) -> str:
    """What to change about the driving, in words.

    Parameters
    ----------
    bits, added : (19,), (6, 19)
        From `manoeuvre_gains`.
    wanted : tuple of str, optional
        Parameters that matter; the three least known by default.

    Returns
    -------
    protocol : str
        One line a parameter with the change that helps it most, then the changes by what they bring altogether.
    """
    names = list(DRIVE_PARAMETERS)
    known, gains = jnp.asarray(bits).tolist(), jnp.asarray(added).tolist()
    columns = [names.index(name) for name in wanted or sorted(names, key=lambda name: known[names.index(name)])[:3]]
    advice = [text.format(abs(change)) for change, text in CHANGES.values()]
    lines = []
    for column in columns:
        best = max(range(len(advice)), key=lambda row: gains[row][column])
        std = DRIVE_PARAMETERS[names[column]].spread * 2 ** -known[column]
        state = f"{names[column]}: std {std:.2g} {DRIVE_PARAMETERS[names[column]].unit}"
        if gains[best][column] < 0.02:
            lines.append(f"{state}; no change of the driving helps it.")
        else:
            lines.append(f"{state}; {advice[best]}: +{gains[best][column]:.2f} bits.")
    total = [sum(max(row[column], 0.0) for column in columns) for row in gains]
    order = sorted(range(len(advice)), key=lambda row: -total[row])
    ranking = "; ".join(f"{advice[row]} (+{total[row]:.2f})" for row in order if total[row] > 0.02)
    lines.append(f"In this order: {ranking}." if ranking else "The driving is as good as small changes can make it.")
    return "\n".join(lines)
