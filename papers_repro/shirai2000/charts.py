"""Figures 9 to 14, the running-through charts: elevation against way, simulated, with bands; and the error budget."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes

from papers_repro.shirai2000.experiments import CHAINS, RAMP

TITLES = {
    "vibration_gyro": "accelerometer and vibration gyro",
    "fiber_optic_gyro": "accelerometer and fibre-optic gyro",
    "vehicle_speed": "accelerometer and speed sensor",
}
# Numbers of the paper's figures by chain: one of descents and one of ascents each, as we read its captions.
FIGURES = {"vibration_gyro": (9, 10), "fiber_optic_gyro": (11, 12), "vehicle_speed": (13, 14)}


def plot_running_through(
    title: str, chain: str, profiles: np.ndarray, actual: np.ndarray, printed: np.ndarray, ax: Axes
) -> None:
    """Running-through chart: `profiles` (runs, points, chains, outputs), `actual` (points, 2) horizontal and height.

    The band is that of the elevation when the cart truly is at a place; the thin lines are runs as measured, which end
    where their horizontal distance does, as do the `printed` ones (rows, 2).
    """
    of_chain = profiles[:, :, CHAINS.index(chain)]
    low, median, high = np.quantile(of_chain[..., 2], [0.05, 0.5, 0.95], axis=0)
    ax.fill_between(actual[:, 0], low, high, color="C0", alpha=0.2, linewidth=0, label="5 to 95 % of runs")
    ax.plot(actual[:, 0], median, color="C0", label="median")
    for i, run in enumerate(of_chain[:8]):
        label = "eight runs, as measured" if i == 0 else None
        ax.plot(run[:, 1], run[:, 2], color="C7", linewidth=0.8, alpha=0.8, label=label)
    ax.plot(*actual.T, color="black", linestyle="--", linewidth=1.2, label="actual")
    ax.plot(*printed.T, "x", color="C3", markersize=8, markeredgewidth=2, label="ends printed in the table")
    ax.set(xlabel="horizontal distance (m)", ylabel="elevation (m)", title=f"{title}: {TITLES[chain]}")
    ax.grid(alpha=0.3)
    ax.legend(loc="best", fontsize="small")


def plot_budget(
    shares: dict[str, np.ndarray], predicted: np.ndarray, simulated: np.ndarray, axes: Sequence[Axes]
) -> None:
    """RMS elevation error by source (chains,), all together as predicted, and as simulated; axes one a chain."""
    names = [*shares, "all, predicted", "all, simulated"]
    for i, (ax, chain) in enumerate(zip(axes, CHAINS, strict=True)):
        values = [*(float(share[i]) for share in shares.values()), float(predicted[i]), float(simulated[i])]
        ax.barh(names, values, color=["C0"] * len(shares) + ["C1", "C7"])
        for y, value in enumerate(values):
            ax.text(value, y, f" {value:.2f}", va="center", fontsize="small")
        ax.set(title=TITLES[chain], xlabel="RMS error of elevation (m)", xlim=(0, 1.2 * max(*predicted, *simulated)))
        ax.title.set_fontsize("medium")
        ax.grid(alpha=0.3, axis="x")
    axes[0].invert_yaxis()


def actual_profile(way: float, horizontal: float, rise: float, duration: float, points: int) -> np.ndarray:
    """Horizontal distance and height (points, 2) at equal fractions of the time, pace even but for start and stop."""
    t = np.linspace(0, duration, points)
    speed = np.clip(np.minimum(t, duration - t) / RAMP, 0, 1)
    gained = np.concatenate([[0], np.cumsum((speed[1:] + speed[:-1]) / 2)])
    u = horizontal * gained / gained[-1]
    # As slope_road has it, whose swing follows from the way: mean of (1 + slope^2)^(1/2) to second order.
    grade = rise / horizontal
    swing = np.sqrt(max(4 * (way / horizontal - 1) - 2 * grade**2, 0.0))
    wave = swing * horizontal / (2 * np.pi) * np.sin(2 * np.pi * u / horizontal)
    return np.stack([u, grade * u - np.copysign(wave, rise * wave)], -1) if rise else np.stack([u, 0 * u], -1)
