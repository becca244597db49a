"""The paper's equations on an exact motion: which hold as printed, which do not, and what they leave undetermined.

Its axes are ours (East, North, up; x forward, y left, z up), and its R is the transpose of our C_nb.
"""

from dataclasses import dataclass
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np

from altijax.doppler import course_to_velocity
from altijax.motions import Readings
from altijax.rotations import euler_to_matrix, matrix_to_euler, rotvec_to_matrix
from altijax.signals import derivative
from papers_repro.chalko2010.experiments import FINE_RATE, MOTIONS, G, exact_readings
from papers_repro.comparison import Finding

UP = np.array([0.0, 0.0, G])

# Rounding leaves over 1e-15, a wrong term 1e-2 or more.
EXACT = 1e-9


@dataclass(frozen=True, kw_only=True)
class Equation:
    """What an equation leaves over on the motion, root mean square."""

    number: str
    text: str
    unit: str
    left_over: float


# What each says, by its number.
PRINTED = {
    "(1)": ("v = (SOG sin COG, SOG cos COG, CR)", "m/s"),
    "(2), product": ("R = R(phi) R(theta) R(psi), multiplied out", "1"),
    "(2), inverse": ("R^-1 = R^T, by reversed order and signs", "1"),
    "(2), attitude": ("R maps ENU to xyz", "1"),
    "(4)": ("R^-1 a = A + g U", "m/s^2"),
    "text before (4)": ("A = a-dot", "m/s^2 against m/s^3"),
    "text before (4), corrected": ("A = v-dot, as a mean between two velocities", "m/s^2"),
}


def equations() -> list[Equation]:
    """Every equation that the motion can decide, as printed."""
    left_over = _left_over(exact_readings("windsurfer"))
    return [
        Equation(number=number, text=text, unit=unit, left_over=float(left_over[number]))
        for number, (text, unit) in PRINTED.items()
    ]


@jax.jit
def _left_over(r: Readings) -> dict[str, jax.Array]:
    roll, pitch, yaw = matrix_to_euler(r.C_nb).T
    v, a = r.velocity, r.acceleration
    sog, cog = jnp.hypot(v[:, 0], v[:, 1]), jnp.arctan2(v[:, 0], v[:, 1])
    R = _printed(roll, pitch, yaw)
    turned = jnp.einsum("...ji,...j->...i", R, r.f_b)
    rests = {
        "(1)": course_to_velocity(sog, cog, v[:, 2]) - v,
        "(2), product": _factor_x(roll) @ _factor_y(pitch) @ _factor_z(yaw) - R,
        "(2), inverse": _factor_z(-yaw) @ _factor_y(-pitch) @ _factor_x(-roll) - jnp.swapaxes(R, -1, -2),
        "(2), attitude": R - jnp.swapaxes(r.C_nb, -1, -2),
        "(4)": turned - (a + UP),
        "text before (4)": derivative(r.t, r.f_b, axis=-2) - a,
        "text before (4), corrected": jnp.diff(v, axis=0) / jnp.diff(r.t)[:, None] - _means_by_simpson(a),
    }
    return {number: jnp.sqrt(jnp.mean(rest * rest)) for number, rest in rests.items()}


def singular_values(euler: jax.Array, f_b: jax.Array) -> jax.Array:
    """Singular values (..., 3) of the Jacobian of R^-1 a by the three angles."""

    def one(euler: jax.Array, f_b: jax.Array) -> jax.Array:
        return jnp.linalg.svd(jax.jacfwd(lambda e: euler_to_matrix(e) @ f_b)(euler), compute_uv=False)

    return jnp.vectorize(one, signature="(3),(3)->(3)")(euler, f_b)


@dataclass(frozen=True, kw_only=True)
class Rank:
    """Singular values of Eq. (4) along a motion: the least of the second, the most of the third; and what the norm
    of Eq. (5) becomes when the true attitude is turned about the specific force by up to half a turn."""

    second: float
    third: float
    turned: float


def rank(r: Readings) -> Rank:
    second, third, turned = (float(x) for x in _rank(r))
    return Rank(second=second, third=third, turned=turned)


@jax.jit
def _rank(r: Readings) -> tuple[jax.Array, jax.Array, jax.Array]:
    values = singular_values(matrix_to_euler(r.C_nb), r.f_b)
    f_n = r.acceleration + UP
    axis = f_n / jnp.linalg.norm(f_n, axis=-1, keepdims=True)
    angles = jnp.linspace(-jnp.pi, jnp.pi, 9)[:, None, None]
    C = rotvec_to_matrix(angles * axis) @ r.C_nb
    turned = jnp.max(jnp.linalg.norm(jnp.einsum("...ij,...j->...i", C, r.f_b) - f_n, axis=-1))
    return jnp.min(values[:, 1]), jnp.max(values[:, 2]), turned


@dataclass(frozen=True, kw_only=True)
class MeanError:
    """By what the mean in body axes, at the mid-epoch attitude, differs from the mean in ENU, RMS over the epochs: as
    a vector, as an angle of the specific force, and as shortening; and what is left when every sample is first turned
    into the axes of mid-epoch, as a gyro allows."""

    vector: float
    angle: float
    shortening: float
    carried: float


def mean_error(motion: str, interval: float = 1.0) -> MeanError:
    """Of epochs of `interval` seconds; sums of many samples stand for the integrals."""
    return MeanError(**{name: float(x) for name, x in _mean_error(exact_readings(motion), interval).items()})


@partial(jax.jit, static_argnames="interval")
def _mean_error(r: Readings, interval: float) -> dict[str, jax.Array]:
    n = round(interval * FINE_RATE)
    epochs = (r.t.size - 1) // n
    # Samples of an epoch with both its ends, for the trapezoidal rule.
    index = np.arange(epochs)[:, None] * n + np.arange(n + 1)
    weight = np.r_[0.5, np.ones(n - 1), 0.5] / n
    C, f_b = r.C_nb[index], r.f_b[index]
    middle = C[:, n // 2]
    f_n = weight @ jnp.einsum("...ij,...j->...i", C, f_b)
    at_middle = jnp.einsum("eij,ej->ei", middle, weight @ f_b)
    carried = jnp.einsum("eij,ej->ei", middle, weight @ jnp.einsum("eji,ekjl,ekl->eki", middle, C, f_b))
    lengths = jnp.linalg.norm(f_n, axis=-1), jnp.linalg.norm(at_middle, axis=-1)
    cosine = jnp.sum(f_n * at_middle, -1) / (lengths[0] * lengths[1])

    def rms(x: jax.Array) -> jax.Array:
        return jnp.sqrt(jnp.mean(x * x))

    return {
        "vector": rms(jnp.linalg.norm(at_middle - f_n, axis=-1)),
        "angle": rms(jnp.degrees(jnp.arccos(jnp.clip(cosine, -1, 1)))),
        "shortening": jnp.mean(lengths[0] - lengths[1]),
        "carried": rms(jnp.linalg.norm(carried - f_n, axis=-1)),
    }


def kink(r: Readings) -> tuple[float, float]:
    """Slopes of Eq. (5) to either side of its minimum, per radian of roll, at the beginning of a motion."""
    before, after = _slopes(r, np.array([-1e-6, 1e-6]))
    return float(before), float(after)


@jax.jit
def _slopes(r: Readings, angles: jax.Array) -> jax.Array:
    C, f_b, f_n = r.C_nb[0], r.f_b[0], r.acceleration[0] + UP

    def goal(angle: jax.Array) -> jax.Array:
        return jnp.linalg.norm(C @ rotvec_to_matrix(jnp.array([1.0, 0.0, 0.0]) * angle) @ f_b - f_n)

    return jax.vmap(jax.grad(goal))(angles)


def equation_findings(found: list[Equation]) -> list[Finding]:
    """What the audit of the equations found."""
    r = exact_readings("windsurfer")
    ranks = {motion: rank(exact_readings(motion)) for motion in MOTIONS}
    means = {motion: mean_error(motion) for motion in MOTIONS}
    fast = mean_error("windsurfer", 0.2)
    before, after = kink(r)
    printed, corrected = found[-2:]
    return [
        Finding(
            kind="printed equation",
            inconsistency=True,
            rule="An equation of kinematics holds on every exact motion.",
            where="text before Eq. (4)",
            printed=printed.text,
            expected="A = v-dot" if corrected.left_over < 1e-3 < printed.left_over else "undecided",
            evidence=f"leaves over {printed.left_over:.2g} as printed, {corrected.left_over:.0e} m/s^2 corrected",
        ),
        Finding(
            kind="number of unknowns",
            inconsistency=True,
            rule="A rotation keeps lengths: one of the three equations says nothing about the angles.",
            where="Eq. (4)",
            printed="3 equations with 3 unknowns",
            expected="2 equations" if all(x.third < 1e-12 < x.second for x in ranks.values()) else "undecided",
            evidence="singular values, least second and largest third: "
            + "; ".join(f"{motion} {x.second:.2g}, {x.third:.0e} m/s^2" for motion, x in ranks.items()),
        ),
        Finding(
            kind="uniqueness",
            inconsistency=True,
            rule="Turning about the specific force A + gU changes nothing in Eq. (5).",
            where="Eq. (4), difficulty 1",
            printed="unique solution in limited intervals",
            expected="a circle of solutions at every epoch"
            if all(x.turned < EXACT for x in ranks.values())
            else "undecided",
            evidence=f"the norm stays below {max(x.turned for x in ranks.values()):.0e} m/s^2 through a full turn",
        ),
        Finding(
            kind="differentiability",
            inconsistency=True,
            rule="A norm has a kink where it is zero; its square has none.",
            where="Eq. (5), requirement 3",
            printed="continuous and differentiable",
            expected="not at its minimum" if before < -1 and after > 1 else "undecided",
            evidence=f"slopes {before:.1f} before and {after:.1f} m/s^2 per rad after it, on error-free data; least "
            "squares are differentiable",
        ),
        Finding(
            kind="average acceleration",
            inconsistency=False,
            rule="The mean of a turning vector's components is not the vector's mean: Eq. (4) does not hold for means.",
            where="Sampling rate considerations",
            printed="acceleration a needs to be an average",
            expected="in axes carried by a gyro, or the device must turn little within an epoch",
            evidence="; ".join(
                f"{motion}: {x.angle:.2f} deg and {x.vector:.2f} m/s^2 RMS at 1 Hz, {x.shortening:.2f} m/s^2 too short"
                for motion, x in means.items()
            )
            + f"; windsurfer at 5 Hz: {fast.angle:.2f} deg; carried by the true turns: "
            f"{max(x.carried for x in means.values()):.0e} m/s^2",
        ),
    ]


def _printed(roll: jax.Array, pitch: jax.Array, yaw: jax.Array) -> jax.Array:
    """Eq. (2) multiplied out, as printed."""
    (sr, cr), (sp, cp), (sy, cy) = ((jnp.sin(angle), jnp.cos(angle)) for angle in (roll, pitch, yaw))
    return _stack(
        [
            [cp * cy, cp * sy, sp],
            [-cr * sy - sp * cy * sr, cr * cy - sp * sr * sy, cp * sr],
            [sr * sy - cr * sp * cy, -cy * sr - cr * sp * sy, cp * cr],
        ]
    )


def _factor_x(angle: jax.Array) -> jax.Array:
    s, c, zero, one = jnp.sin(angle), jnp.cos(angle), 0 * angle, 0 * angle + 1
    return _stack([[one, zero, zero], [zero, c, s], [zero, -s, c]])


def _factor_y(angle: jax.Array) -> jax.Array:
    s, c, zero, one = jnp.sin(angle), jnp.cos(angle), 0 * angle, 0 * angle + 1
    return _stack([[c, zero, s], [zero, one, zero], [-s, zero, c]])


def _factor_z(angle: jax.Array) -> jax.Array:
    s, c, zero, one = jnp.sin(angle), jnp.cos(angle), 0 * angle, 0 * angle + 1
    return _stack([[c, s, zero], [-s, c, zero], [zero, zero, one]])


def _stack(rows: list[list[jax.Array]]) -> jax.Array:
    return jnp.stack([jnp.stack(row, -1) for row in rows], -2)


def _means_by_simpson(a: jax.Array) -> jax.Array:
    """Means (time - 1, 3) between neighbouring samples, by the parabolas through three: exact to third order."""
    inner = (5 * a[:-2] + 8 * a[1:-1] - a[2:]) / 12
    return jnp.concatenate([inner, (5 * a[-1:] + 8 * a[-2:-1] - a[-3:-2]) / 12])
