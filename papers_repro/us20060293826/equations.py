"""The patent's equations as printed and as they must be, on exact readings of a motion that slips in all directions.

Axes here are the patent's: forward, right, down. All three velocities and angular rates differ from zero, so that every
term of every equation counts.
"""

from dataclasses import dataclass
from functools import partial
from math import inf

import jax
import jax.numpy as jnp

from altijax.motions import flight_pose, ideal_readings
from altijax.roads import rest_to_rest, winding_road
from altijax.rotations import matrix_to_euler
from papers_repro.comparison import Finding

G = 9.80665

# Rounding leaves over 1e-15, a wrong term 1e-2 or more.
EXACT = 1e-9


@jax.tree_util.register_dataclass
@dataclass(frozen=True, kw_only=True)
class Motion:
    """Exact quantities of a motion in forward-right-down axes, and the derivatives in time that the equations need."""

    f: jax.Array
    w: jax.Array
    v: jax.Array
    a: jax.Array
    roll: jax.Array
    pitch: jax.Array
    roll_rate: jax.Array
    pitch_rate: jax.Array


def slipping_motion() -> Motion:
    """A minute in the air, in a wind from the side and from below."""
    bends = jnp.array([0.8, 0.4]), jnp.array([400.0, 230.0]), jnp.array([0.0, 1.0])
    hills = jnp.array([0.15, 0.1]), jnp.array([300.0, 170.0]), jnp.array([0.0, 2.0])
    road = winding_road(*bends, *hills, 0.0)
    pose = partial(flight_pose, road, rest_to_rest(1200.0, 60.0, 8.0), jnp.array([3.0, -2.0, 1.0]), G)
    down = jnp.array([1.0, -1.0, -1.0])

    def at(t: jax.Array) -> tuple[jax.Array, jax.Array]:
        position_rate = jax.jvp(lambda t: pose(t)[0], (t,), (1.0,))[1]
        C_nb = pose(t)[1]
        return C_nb.T @ position_rate * down, matrix_to_euler(C_nb)

    @jax.jit
    def motion(t: jax.Array) -> Motion:
        readings = ideal_readings(pose, t, G)
        (v, euler), (a, euler_rate) = jax.vmap(lambda t: jax.jvp(at, (t,), (1.0,)))(t)
        return Motion(
            f=(readings.f_b * down).T,
            w=(readings.w_b * down).T,
            v=v.T,
            a=a.T,
            roll=euler[:, 0],
            pitch=euler[:, 1],
            roll_rate=euler_rate[:, 0],
            pitch_rate=euler_rate[:, 1],
        )

    return motion(jnp.linspace(5.0, 55.0, 501))


@dataclass(frozen=True, kw_only=True)
class Equation:
    """What an equation leaves over on the motion, root mean square: `printed`, and `corrected` where that differs."""

    number: str
    text: str
    unit: str
    printed: float
    correction: str = ""
    corrected: float = inf


# What each says and its unit, by its number.
PRINTED = {
    "1": ("theta' = w_Y cos(phi) - w_Z sin(phi)", "rad/s"),
    "2": ("phi' = w_X + w_Y sin(phi) tan(theta) + w_Z cos(phi) tan(theta)", "rad/s"),
    "4": ("f_X = a_X + g sin(theta) - w_Z V_Y + w_Y V_Z", "m/s^2"),
    "5": ("f_Y = a_Y - g sin(phi) cos(theta) + w_Z V_X + w_X V_Z", "m/s^2"),
    "7": ("theta = theta_0 + integral of w_Y cos(phi) - w_Y sin(phi)", "rad/s"),
    "11": ("theta' = w_Y cos(theta) - w_Z sin(phi)", "rad/s"),
}
CORRECTIONS = {"5": "- w_X V_Z", "7": "- w_Z sin(phi)", "11": "w_Y cos(phi)"}


def equations() -> list[Equation]:
    """Every equation that the motion can decide."""
    printed, corrected = _left_over(slipping_motion())
    return [
        Equation(
            number=number,
            text=text,
            unit=unit,
            printed=float(printed[number]),
            correction=CORRECTIONS.get(number, ""),
            corrected=float(corrected.get(number, inf)),
        )
        for number, (text, unit) in PRINTED.items()
    ]


@jax.jit
def _left_over(m: Motion) -> tuple[dict[str, jax.Array], dict[str, jax.Array]]:
    """What the equations leave over as printed, and those of them that need it with their correction."""
    (f_x, f_y, _), (w_x, w_y, w_z), (v_x, v_y, v_z), (a_x, a_y, _) = m.f, m.w, m.v, m.a
    sin_r, cos_r, sin_p, cos_p = jnp.sin(m.roll), jnp.cos(m.roll), jnp.sin(m.pitch), jnp.cos(m.pitch)
    pitching = m.pitch_rate - (w_y * cos_r - w_z * sin_r)
    lateral = f_y - (a_y - G * sin_r * cos_p + w_z * v_x)
    printed = {
        "1": pitching,
        "2": m.roll_rate - (w_x + (w_y * sin_r + w_z * cos_r) * sin_p / cos_p),
        "4": f_x - (a_x + G * sin_p - w_z * v_y + w_y * v_z),
        "5": lateral - w_x * v_z,
        "7": m.pitch_rate - (w_y * cos_r - w_y * sin_r),
        "11": m.pitch_rate - (w_y * cos_p - w_z * sin_r),
    }
    corrected = {"5": lateral + w_x * v_z, "7": pitching, "11": pitching}
    return jax.tree.map(lambda rest: jnp.sqrt(jnp.mean(rest * rest)), (printed, corrected))


def equation_findings(found: list[Equation]) -> list[Finding]:
    """The equations that do not hold as printed and do with their correction."""
    return [
        Finding(
            kind="printed equation",
            inconsistency=True,
            rule="An equation of kinematics holds on every exact motion.",
            where=f"Eq. ({equation.number})",
            printed=equation.text,
            expected=equation.correction,
            evidence=f"leaves over {equation.printed:.2g} {equation.unit} RMS as printed, "
            f"{equation.corrected:.0e} corrected",
        )
        for equation in found
        if equation.printed > EXACT > equation.corrected
    ]


def unexplained(found: list[Equation]) -> list[str]:
    """Numbers of the equations that hold neither as printed nor with a correction."""
    return [e.number for e in found if min(e.printed, e.corrected if e.correction else e.printed) > EXACT]
