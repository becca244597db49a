"""Basins, sweeps, the turning device, and a minute of the windsurfer."""

from collections.abc import Mapping
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd

from papers_repro.chalko2010.basins import Basin, initial_errors
from papers_repro.chalko2010.sweeps import SWEEPS, Errors

COLORS = {"windsurfer": "C0", "vehicle": "C1", "aircraft": "C2"}
DASHES = {"epochs": "-", "gyro windows": "--"}


def draw_basins(basins: Mapping[str, Basin], path: Path) -> None:
    """What each method makes of initial values all around: the angle to the truth, hatched without a minimum."""
    figure, axes = plt.subplots(1, len(basins), figsize=(12, 4.8), sharey=True, layout="constrained")
    for ax, (name, basin) in zip(axes, basins.items(), strict=True):
        errors = np.degrees(initial_errors(len(basin.norm)))
        image = ax.pcolormesh(errors, errors, np.degrees(basin.angle), vmin=0, vmax=180, cmap="viridis")
        lost = basin.norm > 0.01
        if lost.any():
            ax.contourf(errors, errors, lost, levels=[0.5, 1.5], colors="none", hatches=["xxx"])
        ax.plot(0, 0, "r+", markersize=12)
        close = np.mean(np.degrees(basin.angle) < 5)
        ax.set(
            title=f"{name}\nno minimum from {lost.mean():.1%},\nwithin 5° of the truth from {close:.1%}",
            xlabel="initial error of yaw (deg)",
        )
        ax.set_xticks(range(-180, 181, 90))
        ax.set_yticks(range(-180, 181, 90))
    axes[0].set_ylabel("initial error of roll (deg)")
    figure.colorbar(image, ax=axes, label="angle of the result to the truth (deg)")
    figure.savefig(path, dpi=110)
    plt.close(figure)


def draw_sweeps(sweeps: Mapping[tuple[str, str], Mapping[str, Errors]], path: Path) -> None:
    """A column a sweep: tilt, heading and velocity; colours are motions, dashes methods."""
    figure, axes = plt.subplots(3, len(SWEEPS), figsize=(20, 9), sharex="col", sharey="row", layout="constrained")
    for column, (name, (_, values)) in enumerate(SWEEPS.items()):
        x = np.array(values)
        for motion, color in COLORS.items():
            for method, dash in DASHES.items():
                found = sweeps[motion, name][method]
                for ax, y in zip(axes[:, column], (found.tilt, found.heading, found.velocity), strict=True):
                    ax.plot(x, y, dash, marker=".", color=color, label=f"{motion}, {method}")
            straight = sweeps[motion, name]["interpolated velocity"].velocity
            axes[2, column].plot(x, straight, ":", color=color, label=f"{motion}, interpolated")
        for ax in axes[:, column]:
            ax.set_yscale("log")
            if 0 in values:
                ax.set_xscale("symlog", linthresh=values[1])
            else:
                ax.set_xscale("log")
            ax.set_xticks(x, [f"{value:g}" for value in values])
            ax.minorticks_off()
            ax.grid(alpha=0.3)
        axes[2, column].set_xlabel(name)
    labels = ("tilt at mid-epoch (deg)", "heading at mid-epoch (deg)", "velocity at full rate (m/s)")
    for ax, label in zip(axes[:, 0], labels, strict=True):
        ax.set_ylabel(label)
    handles, names = axes[2, 0].get_legend_handles_labels()
    figure.legend(handles, names, ncols=5, loc="outside lower center")
    figure.suptitle("RMS errors against the instruments")
    figure.savefig(path, dpi=90)
    plt.close(figure)


def draw_turning(frequencies: np.ndarray, found: Mapping[str, Errors], path: Path) -> None:
    """Errors against the frequency of the device's turning."""
    figure, axes = plt.subplots(1, 2, figsize=(10, 4.2), layout="constrained")
    for method, dash in DASHES.items():
        errors = found[method]
        axes[0].plot(frequencies, errors.tilt, "C0" + dash, marker=".", label=f"{method}, mid-epoch")
        axes[0].plot(frequencies, errors.tilt_full_rate, "C3" + dash, marker=".", label=f"{method}, full rate")
        axes[1].plot(frequencies, errors.velocity, "C0" + dash, marker=".", label=method)
    axes[1].plot(frequencies, found["interpolated velocity"].velocity, "k:", label="interpolated")
    axes[0].set(title="Tilt of a device that turns by ±15° about each axis", ylabel="RMS error (deg)")
    axes[1].set(title="Velocity at full rate", ylabel="RMS error (m/s)")
    for ax in axes:
        ax.axvline(0.5, color="0.5", linewidth=1, linestyle="-.", label="Nyquist frequency of 1 Hz")
        ax.set(xscale="log", yscale="log", xlabel="frequency of the turning (Hz)")
        ax.grid(alpha=0.3)
        ax.legend(fontsize=8)
    figure.savefig(path, dpi=110)
    plt.close(figure)


def draw_minute(reference: pd.DataFrame, ways: Mapping[str, pd.DataFrame], path: Path) -> None:
    """Attitude and velocity at full rate of each way beside the truth, and the velocities' errors."""
    figure, axes = plt.subplots(5, 1, figsize=(11, 12), sharex=True, layout="constrained")
    quantities = ("roll", "pitch", "heading", "v_n")
    shown = {"the truth": reference, **ways}
    for (name, table), color in zip(shown.items(), ("black", "C3", "C0"), strict=False):
        for ax, quantity in zip(axes[:4], quantities, strict=True):
            values = table[quantity].to_numpy()
            if quantity == "heading":
                values = np.unwrap(values)
            if quantity != "v_n":
                values = np.degrees(values)
            ax.plot(table.index, values, color=color, linewidth=2 if name == "the truth" else 1, label=name)
        if name != "the truth":
            error = np.linalg.norm(table[["v_e", "v_n", "v_u"]] - reference[["v_e", "v_n", "v_u"]], axis=1)
            axes[4].plot(table.index, error, color=color, linewidth=1, label=name)
    for ax, label in zip(
        axes,
        ("roll (deg)", "pitch (deg)", "heading (deg)", "velocity North (m/s)", "error of the velocity (m/s)"),
        strict=True,
    ):
        ax.set_ylabel(label)
        ax.grid(alpha=0.3)
    axes[0].legend(ncols=3, loc="lower left")
    axes[0].set_title("A windsurfer's helmet at 50 Hz from Doppler velocities at 1 Hz")
    axes[4].set_yscale("log")
    axes[4].set_xlabel("time (s)")
    figure.savefig(path, dpi=100)
    plt.close(figure)
