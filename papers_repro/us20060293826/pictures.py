"""The patent's figures 6 and 7, the map of where its method helps, and how its errors grow."""

from collections.abc import Sequence
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from papers_repro.us20060293826.experiments import DT, Runs
from papers_repro.us20060293826.stability import Growth

GPS = {"color": "black", "linewidth": 1.2, "linestyle": "--"}
COLORS = {"without roll": "C3", "with roll": "C0", "aided roll": "C2"}


def draw_figure(name: str, runs: Runs, path: Path) -> None:
    """As the patent has it: A without the roll, B with it, each beside the GPS speed; a line a run."""
    figure, axes = plt.subplots(1, 2, figsize=(10, 4), sharey=True, layout="constrained")
    for ax, letter, method in zip(axes, "AB", ("without roll", "with roll"), strict=True):
        speeds = np.asarray(runs.speeds[method])
        t = DT * np.arange(speeds.shape[1])
        for i, speed in enumerate(speeds):
            label = f"$V_{{DR}}$ {method}, {len(speeds)} runs" if i == 0 else None
            ax.plot(t, speed, color=COLORS[method], linewidth=0.9, alpha=0.7, label=label)
        ax.plot(runs.t_gps, runs.gps[0], **GPS, label="$V_{GPS}$")
        ax.set(title=f"{name.capitalize()}{letter}: speed {method}", xlabel="time (s)")
        ax.grid(alpha=0.3)
        ax.legend(loc="lower left")
    axes[0].set_ylabel("speed (m/s)")
    figure.savefig(path, dpi=120)
    plt.close(figure)


def draw_map(turning: np.ndarray, qualities: Sequence[float], better: np.ndarray, path: Path) -> None:
    """Share of runs (qualities, turning) in which the roll made the speed better, a number a cell."""
    figure, ax = plt.subplots(figsize=(8, 4), layout="constrained")
    image = ax.imshow(better, origin="lower", aspect="auto", cmap="RdBu", vmin=0, vmax=1)
    for (row, column), share in np.ndenumerate(better):
        color = "white" if abs(share - 0.5) > 0.3 else "black"
        ax.text(column, row, f"{share:.2f}", ha="center", va="center", color=color)
    ax.set_xticks(range(len(turning)), [f"{x:.1f}" for x in turning])
    ax.set_yticks(range(len(qualities)), [f"{q:g}" for q in qualities])
    ax.set(
        xlabel="accumulated change of heading in one minute (rad)",
        ylabel="errors of the gyros\n(1: consumer MEMS)",
        title="Share of runs in which the roll made the speed better",
    )
    figure.colorbar(image, ax=ax)
    figure.savefig(path, dpi=120)
    plt.close(figure)


def draw_growth(growth: Growth, path: Path) -> None:
    """Growth of an initial error and of truncation, against the accumulated change of heading."""
    figure, axes = plt.subplots(1, 2, figsize=(10, 4), layout="constrained")
    axes[0].plot(growth.turning, growth.derivative, color="C0", linewidth=3, alpha=0.4, label="derivative of the loop")
    axes[0].plot(growth.turning, growth.simulated, color="C0", label="simulated")
    axes[0].plot(growth.turning, growth.linearised, "k--", label="$\\delta v'' = \\omega_z^2\\,\\delta v$")
    axes[0].plot(growth.turning, growth.constant_rate, "k:", label="cosh: constant yaw rate")
    axes[0].set(title="Growth of an error of the initial speed", ylabel="error / initial error")
    axes[1].plot(growth.turning, np.abs(growth.literal), color="C3", label="literal: previous estimates")
    axes[1].plot(growth.turning, np.abs(growth.second_order), color="C0", label="second order")
    axes[1].set(title="Error on error-free readings at 100 Hz", ylabel="error of the speed (m/s)", ylim=(1e-7, None))
    for ax in axes:
        ax.set_yscale("log")
        ax.set_xlabel("accumulated change of heading (rad)")
        ax.grid(alpha=0.3)
        ax.legend()
    figure.savefig(path, dpi=120)
    plt.close(figure)
