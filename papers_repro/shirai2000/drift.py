"""Why it drifts and what would have helped: the error budget at the sensors found, judged and put into words."""

from dataclasses import replace
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np

from altijax.instruments import ND_PG1
from papers_repro.comparison import Comparison, Finding, compare_bound
from papers_repro.shirai2000.budget import (
    CONSTANTS,
    SOURCES,
    elevation_errors,
    elevations_with_pulses,
    predicted_rms,
    rectified,
    sensitivities,
)
from papers_repro.shirai2000.experiments import CHAINS, sample_count
from papers_repro.shirai2000.study import RUNS, Study, mode_sensors


def shares(found: Study, place: str) -> dict[str, np.ndarray]:
    """RMS elevation error (chains,) by source at the sensors found, sources of nothing left out."""
    with jax.enable_x64(True):
        moments = found.sites[place].elevations
        mean, covariance = elevation_errors(moments, mode_sensors(found, place))
        by_source = np.sqrt(np.asarray(mean**2 + jnp.einsum("saa->sa", covariance)))
        at_zero = np.sqrt(np.asarray(moments.at_zero**2 + jnp.diagonal(moments.covariance_at_zero)))
    named = {name: by_source[i] for i, name in enumerate(SOURCES) if by_source[i].max() > 1e-4}
    return {**named, "pace and pulses alone": at_zero}


def rms_of(found: Study, place: str) -> tuple[np.ndarray, np.ndarray]:
    """Predicted and simulated RMS elevation error (chains,) at the sensors found."""
    with jax.enable_x64(True):
        predicted = np.asarray(predicted_rms(found.sites[place].elevations, mode_sensors(found, place)))
    error = found.at_mode[place][:, -1, :, 2] - float(found.courses[place].rise)
    return predicted, np.sqrt(np.mean(error**2, 0))


def budget_lines(found: Study) -> list[str]:
    """Errors of elevation by source, as text."""
    lines = []
    for place, course in found.courses.items():
        lines.append(
            f"RMS error of elevation by source, {place}, {float(course.duration):.1f} s (m): {', '.join(CHAINS)}"
        )
        for name, share in shares(found, place).items():
            lines.append(f"  {name:26}" + "".join(f"{value:10.3f}" for value in share))
        predicted, of_runs = rms_of(found, place)
        lines.append(f"  {'all, predicted':26}" + "".join(f"{value:10.3f}" for value in predicted))
        lines.append(f"  {'all, simulated':26}" + "".join(f"{value:10.3f}" for value in of_runs))
    return lines


def budget_comparisons(found: Study) -> list[Comparison]:
    """The budget against the runs, and the closed form of rectification against the derivative of the simulation."""
    judged = []
    for place in found.courses:
        predicted, of_runs = rms_of(found, place)
        judged += [
            compare_bound(
                table="budget",
                row=f"{chain} {place}",
                column="predicted over simulated RMS, off 1",
                unit="1",
                bound="0.15",
                ours=float(abs(predicted[i] / of_runs[i] - 1)),
            )
            for i, chain in enumerate(CHAINS)
        ]
    for place, course in found.courses.items():
        of_square = float(found.sites[place].elevations.quadratic[SOURCES.index("vibration"), 2])
        judged.append(
            compare_bound(
                table="budget",
                row=f"rectification {place}",
                column="3 sigma^2 T^2 / 4g over simulated, off 1",
                unit="1",
                bound="0.2",
                ours=abs(of_square / float(rectified(1.0, float(course.duration))) - 1),
            )
        )
    return judged


def drift(found: Study) -> list[Finding]:
    findings = []
    for place in found.courses:
        predicted, of_runs = rms_of(found, place)
        of = shares(found, place)
        for i, chain in enumerate(CHAINS):
            largest = sorted(of, key=lambda name: -of[name][i])
            findings.append(
                Finding(
                    kind="error budget",
                    inconsistency=False,
                    rule="Which source makes most of the elevation's error, by derivatives of the simulation.",
                    where=f"{chain} {place}",
                    printed="elevation",
                    expected=largest[0],
                    evidence=f"{of[largest[0]][i]:.2f} m of {predicted[i]:.2f} m RMS, next {largest[1]} "
                    f"{of[largest[1]][i]:.2f}; simulated {of_runs[i]:.2f}",
                )
            )
    course = found.courses["outdoors"]
    samples = sample_count(float(course.duration))
    slopes, curvature, imaginary = jax.jit(partial(sensitivities, samples=samples))(
        course, key=jax.random.key(3, impl="rbg")
    )
    time = float(course.duration)
    laws = {
        "bias_z": f"T^2/2 = {time**2 / 2:.0f}",
        "gravity": f"-T^2/2 = {-(time**2) / 2:.0f}",
        "initial_vertical_speed": f"T = {time:.0f}",
        "wheel_scale": "- double integral of a_x^2 / g",
        "track_width": "double integral of a_y^2 / (g track)",
    }
    units = ("m/s^2", "m/s^2", "m/s", "1", "m")
    for name, slope, unit in zip(CONSTANTS, np.asarray(slopes), units, strict=True):
        findings.append(
            Finding(
                kind="sensitivity of Eq. (1)",
                inconsistency=False,
                rule="Metres of elevation at arrival per unit of a constant, by jax.jacfwd through the whole chain.",
                where=name,
                printed=f"{time:.1f} s",
                expected=laws[name],
                evidence=f"{float(slope):.4g} m per {unit}",
            )
        )
    findings.append(
        Finding(
            kind="model of Eq. (1)",
            inconsistency=False,
            rule="a_x^2 = h^2 + x^2 leaves out the acceleration across the path in the vertical plane.",
            where="vertical curvature, imaginary x",
            printed="x = sqrt(a_x^2 - h^2)",
            expected="no cause of the errors at a walking pace",
            evidence=f"curvature adds {float(curvature):.4f} m; x is imaginary in {100 * float(imaginary):.0f} % of "
            "the time even with perfect sensors",
        )
    )
    return findings


def developments(found: Study) -> list[Finding]:
    """The future developments that the paper names, and others, by the RMS elevation error outdoors with each."""
    place = "outdoors"
    sensors = mode_sensors(found, place)
    with jax.enable_x64(True):
        before = np.asarray(predicted_rms(found.sites[place].elevations, sensors))
        zero = jnp.zeros(())
        changes = {
            "stiffer cart: half the shaking": ("vehicle_speed", {"vibration": sensors.vibration / 2}),
            "stiffer cart: no shaking": ("vehicle_speed", {"vibration": zero}),
            "other speed sensor: pulses in place": ("vehicle_speed", {"magnet_error": zero}),
            "both: no shaking, pulses in place": ("vehicle_speed", {"vibration": zero, "magnet_error": zero}),
            "other accelerometer: half the bias": (
                "fiber_optic_gyro",
                {"accelerometer_bias": sensors.accelerometer_bias / 2},
            ),
            "other gyro: a tenth of its errors": (
                "fiber_optic_gyro",
                {
                    "fiber_optic_gyro_drift": sensors.fiber_optic_gyro_drift / 10,
                    "fiber_optic_gyro_noise": sensors.fiber_optic_gyro_noise / 10,
                },
            ),
        }
        findings = []
        for name, (chain, change) in changes.items():
            after = np.asarray(predicted_rms(found.sites[place].elevations, replace(sensors, **change)))
            i = CHAINS.index(chain)
            findings.append(_development(name, chain, float(before[i]), float(after[i])))
    course = found.courses[place]
    keys = jax.random.split(jax.random.key(4, impl="rbg"), RUNS)
    samples = sample_count(float(course.duration))
    millimetres = 1000 * float(sensors.magnet_error) * ND_PG1.radius
    for pulses, share, name in (
        (2, 1.0, f"two pulses, placed to {millimetres:.0f} mm"),
        (24, 1.0, f"24 pulses, placed to {millimetres:.0f} mm"),
        (24, 1 / 12, f"24 pulses, placed to {millimetres / 12:.1f} mm"),
        (24, 0.0, "24 pulses, in place"),
    ):
        error = elevations_with_pulses(
            course,
            jnp.asarray(share * sensors.magnet_error, jnp.float32),
            keys,
            wheel_pulses_per_turn=pulses,
            samples=samples,
        ) - float(course.rise)
        with_pulses = float(jnp.sqrt(jnp.mean(error**2)))
        if pulses == 2:
            alone = with_pulses
        findings.append(_development(f"perfect accelerometer, {name}", "vehicle_speed", alone, with_pulses))
    return findings


def _development(name: str, chain: str, before: float, after: float) -> Finding:
    gain = before / max(after, 1e-9)
    words = ((2, "helps much"), (1.1, "helps"), (1 / 1.1, "hardly matters"), (0, "makes it worse"))
    return Finding(
        kind="future development",
        inconsistency=False,
        rule="RMS elevation error outdoors with a change of the equipment.",
        where=name,
        printed=chain,
        expected=next(word for least, word in words if gain >= least),
        evidence=f"{before:.2f} m before, {after:.2f} m after",
    )
