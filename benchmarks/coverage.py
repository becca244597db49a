"""How far the error bars of `estimate_drive` hold on drives that share no formula with it, as presumed and otherwise.

    python -m benchmarks.coverage [drives] [a mismatch ...]

Rows are mismatches (`altijax.samples.foreign_drives`) and outputs: NEES, the mean square of errors in standard
deviations (1 where bars are right), the share within one and two of them (.68, .95), RMS error and bar, and how many
drives the estimate calls not to be trusted. CPU seconds are those of a drive once everything is compiled.
"""

import sys
import time
import warnings

import numpy as np
import pandas as pd

from altijax.samples.foreign_drives import MISMATCHES, drive_errors, foreign_drive
from altijax.vehicle.estimates import CONSISTENT, estimate_drive

SETS = {"all": None, "no gyro": ("velocity", "course"), "GNSS and gyro": ("gyro", "velocity")}


def main(drives: int, mismatches: list[str]) -> None:
    """Print the table."""
    warnings.simplefilter("ignore")
    for name, use in SETS.items():
        for mismatch in mismatches or MISMATCHES:
            found, distrusted = [], 0
            seconds = []
            for seed in range(drives):
                recording = foreign_drive(seed, mismatch)
                begun = time.process_time()
                estimate = estimate_drive(recording, use=use)
                seconds.append(time.process_time() - begun)
                distrusted += estimate.attrs["verdict"] != CONSISTENT
                error = drive_errors(estimate, recording).iloc[10:]
                bar = estimate[[f"{output}_std" for output in error]].iloc[10:].to_numpy()
                found.append((error, bar))
            error = pd.concat([pair[0] for pair in found])
            bar = np.concatenate([pair[1] for pair in found])
            off = error / bar
            table = pd.DataFrame(
                {
                    "NEES": (off**2).mean(),
                    "within 1": (off.abs() < 1).mean(),
                    "within 2": (off.abs() < 2).mean(),
                    "RMS": np.sqrt((error**2).mean()),
                    "bar": np.sqrt(np.mean(bar**2, 0)),
                }
            )
            print(
                f"\n{name}, {mismatch}: {drives} drives, {distrusted} not to be trusted, "
                f"{np.median(seconds):.1f} CPU s each\n{table.round(4).T.to_string()}",
                flush=True,
            )


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 200, sys.argv[2:])
