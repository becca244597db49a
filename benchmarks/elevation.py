"""How often the true elevation lies within the stated error bars, over simulated drives.

    python -m benchmarks.elevation [drives]

Every third drive has no known height, the heights of its ends, or those of its first third. The car's errors are those
that the estimator presumes, then of kinds that it does not know (trim in steps, springs that stick, patches of road).
"""

import sys

import numpy as np

from altijax.samples.hilly_drives import errors_and_bars, hilly_drive

# Of all samples, within one and two standard deviations.
WANTED = ("0.60 to 0.75", "0.92 to 0.98")
KNOWN = ("none", "ends", "first third")


def report(drives: int, car: str) -> None:
    """Print the coverage and the errors of each case and of all."""
    print(f"{car} cars")
    ratios: list[list[np.ndarray]] = [[], [], []]
    squares: list[list[float]] = [[], [], []]
    for seed in range(drives):
        error, std = errors_and_bars(hilly_drive(seed, car), KNOWN[seed % 3])
        ratios[seed % 3].append(np.abs(error) / std)
        squares[seed % 3].append(float(np.mean(error**2)))
    for name, of_case, of_squares in zip(("no heights", "ends", "first third"), ratios, squares, strict=True):
        every = np.concatenate(of_case)
        print(
            f"{name:12s} {len(of_case):4d} drives: within one {np.mean(every <= 1):.3f}, two "
            f"{np.mean(every <= 2):.3f}; "
            f"median RMS {np.sqrt(np.median(of_squares)):.2f} m"
        )
    every = np.concatenate([ratio for of_case in ratios for ratio in of_case])
    print(f"{'all':12s} {drives:4d} drives: within one {np.mean(every <= 1):.3f}, two {np.mean(every <= 2):.3f}")
    print(f"{'wanted':12s} {'':11s}  within one {WANTED[0]}, two {WANTED[1]}")


if __name__ == "__main__":
    for kind in ("presumed", "strange"):
        report(int(sys.argv[1]) if len(sys.argv) > 1 else 210, kind)
