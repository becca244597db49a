"""Simulated bands for the printed rows: every experiment with what all others say of the sensors."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
from scipy.stats import kstest

from papers_repro.comparison import Comparison
from papers_repro.shirai2000.experiments import CHAINS, OUTPUTS, Course, Sensors, at_fractions
from papers_repro.shirai2000.inference import Posterior, sensors_of
from papers_repro.shirai2000.tables import QUANTITIES, Row, number, row_name

POINTS = 61


@dataclass(frozen=True, kw_only=True)
class Cell:
    """A printed measurement, and where it stands among simulated ones, as a fraction of them that are smaller."""

    row: Row
    quantity: str
    percentile: float
    low: float
    median: float
    high: float
    inside: bool


@partial(jax.jit, static_argnames="samples")
def simulate(sensors: Sensors, courses: Course, keys: jax.Array, *, samples: int) -> jax.Array:
    """Runs of each course (courses, runs, points, chains, outputs), with sensors of their own (courses, runs)."""
    one = partial(at_fractions, samples=samples, points=POINTS)
    of_course = jax.vmap(one, (0, None, 0))
    return jax.lax.map(lambda each: of_course(*each), (sensors, courses, keys))


def drawn_sensors(posteriors: Sequence[Posterior], indoors: np.ndarray, runs: int) -> Sensors:
    """Sensors (experiments, runs) from a posterior for each experiment, by the same standard normal numbers."""
    normal = np.random.default_rng(0).standard_normal((runs, posteriors[0].mode.size))
    unknowns = np.stack([p.mode + normal @ np.linalg.cholesky(p.covariance).T for p in posteriors])
    of_runs = jax.vmap(jax.vmap(sensors_of, (0, None)))
    return of_runs(jnp.asarray(unknowns, jnp.float32), jnp.asarray(indoors))


def cells(rows: Sequence[Row], names: Sequence[tuple[str, str]], arrivals: np.ndarray) -> list[Cell]:
    """All printed measurements, `arrivals` (experiments, runs, chains, outputs) being simulated without them."""
    found = []
    for row in rows:
        if row["experiment"] != "average":
            place = "level" if row["course"] == "level" else "slope"
            of_chain = arrivals[names.index((place, row["experiment"])), :, CHAINS.index(row["sensor"])]
            for quantity in QUANTITIES:
                simulated = of_chain[:, OUTPUTS.index(quantity)]
                printed = float(number(row, f"{quantity}_m"))
                # Ways in steps repeat: half of the equal ones count as smaller.
                percentile = np.mean(simulated < printed - 5e-4) / 2 + np.mean(simulated <= printed + 5e-4) / 2
                low, outer_low, median, outer_high, high = np.quantile(simulated, [0.05, 0.025, 0.5, 0.975, 0.95])
                found.append(
                    Cell(
                        row=row,
                        quantity=quantity,
                        percentile=float(percentile),
                        low=float(low),
                        median=float(median),
                        high=float(high),
                        inside=bool(outer_low <= printed <= outer_high),
                    )
                )
    return found


def uniformity(found: Sequence[Cell]) -> float:
    """Probability of percentiles as uneven as these by chance (Kolmogorov-Smirnov), taken as independent."""
    return float(kstest([cell.percentile for cell in found], "uniform").pvalue)


def comparisons(found: Sequence[Cell]) -> list[Comparison]:
    """Each printed measurement beside the simulated median: a match inside the 2.5 to 97.5 % band."""
    return [
        Comparison(
            table=f"{cell.row['table']} simulated",
            row=row_name(cell.row),
            column=cell.quantity,
            unit="m",
            printed=cell.row[f"{cell.quantity}_m"],
            ours=cell.median,
            difference=cell.median - float(number(cell.row, f"{cell.quantity}_m")),
            verdict="match" if cell.inside else "differs",
            note=f"at {100 * cell.percentile:.1f} % of {cell.low:.3f}..{cell.high:.3f}",
        )
        for cell in found
    ]


def table_lines(found: Sequence[Cell], titles: dict[str, str]) -> list[str]:
    """Tables 1 to 5 in the paper's layout: printed, simulated median, 5 to 95 % band, percentile of the printed."""
    width = 35
    lines = []
    for table in dict.fromkeys(cell.row["table"] for cell in found):
        of_table = [cell for cell in found if cell.row["table"] == table]
        lines += ["", f"Table {table}, {titles[table]}: printed, median [5 %, 95 %], percentile"]
        lines.append("  " + "experiment".ljust(11) + "".join(q.ljust(width) for q in QUANTITIES).rstrip())
        for name in dict.fromkeys(row_name(cell.row) for cell in of_table):
            of_row = [_cell_text(cell) for cell in of_table if row_name(cell.row) == name]
            lines.append("  " + name.ljust(11) + "".join(text.ljust(width) for text in of_row).rstrip())
    return lines


def _cell_text(cell: Cell) -> str:
    printed = cell.row[f"{cell.quantity}_m"]
    mark = "" if cell.inside else "!"
    decimals = 2 if abs(cell.high) < 20 and cell.row["course"] == "level" else 1
    band = f"{cell.median:.{decimals}f} [{cell.low:.{decimals}f}, {cell.high:.{decimals}f}]"
    return f"{printed} {band} {100 * cell.percentile:.0f}%{mark}"
