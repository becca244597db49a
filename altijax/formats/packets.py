"""Rows that share a stamp or come in bursts: spread, averaged or dropped, by what they are."""

import numpy as np
import pandas as pd


def without_shared_stamps(table: pd.DataFrame, stream: str, problems: list[str]) -> pd.DataFrame:
    """The table with times that increase: rows repeated are dropped, packets spread, fixes of one instant averaged."""
    table = _without_repeated_rows(table, problems)
    steps = np.diff(table["t"].to_numpy(float))
    if stream in ("gnss", "reference"):
        return _averaged(table, problems) if (steps == 0).any() else table
    starts = _burst_starts(steps) if steps.size > 20 else None
    if starts is None:
        if not (steps == 0).any():
            return table
        starts = np.append(0, np.flatnonzero(steps > 0) + 1)
    return _spread(table, starts, problems)


def _without_repeated_rows(table: pd.DataFrame, problems: list[str]) -> pd.DataFrame:
    values = table.to_numpy(float)
    same = np.append(False, ((values[1:] == values[:-1]) | (np.isnan(values[1:]) & np.isnan(values[:-1]))).all(axis=1))
    if same.any():
        k = int(np.flatnonzero(same)[0])
        problems.append(
            f"{table.attrs['file']}, {table.index.name} {table.index[k]}, column t: {values[k, 0]:.6f} repeats the "
            f"row before "
            f"to the last digit; rows like it: {same.sum()} of {len(table)}, dropped"
        )
    return table[~same]


def _burst_starts(steps: np.ndarray) -> np.ndarray | None:
    """First rows of bursts that come regularly, None where rows come one by one."""
    long = steps > 3 * np.median(steps)
    if not long.any() or long.mean() > 0.5 or np.median(steps[long]) < 20 * np.median(steps):
        return None
    apart = steps[long]
    # A gap here and there is no burst: these come again and again, after about as long.
    if long.sum() < 5 or long.mean() < 0.002 or np.quantile(apart, 0.9) > 3 * np.quantile(apart, 0.1):
        return None
    if steps[~long].sum() > 0.3 * steps.sum():
        return None
    return np.append(0, np.flatnonzero(long) + 1)


def _spread(table: pd.DataFrame, starts: np.ndarray, problems: list[str]) -> pd.DataFrame:
    t = table["t"].to_numpy(float)
    counts = np.diff(np.append(starts, t.size))
    stamps = t[starts + counts - 1]
    each = np.append(np.nan, np.diff(stamps)) / counts
    usual = float(np.nanmedian(each))
    # After a gap, and before the first, the rows are as far apart as elsewhere.
    each = np.where(each > 2 * usual, usual, each)
    each[0] = usual
    back = np.repeat(starts + counts, counts) - 1 - np.arange(t.size)
    spread = np.repeat(stamps, counts) - back * np.repeat(each, counts)
    packets = counts > 1
    k = starts[packets][0]
    problems.append(
        f"{table.attrs['file']}, {table.index.name} {table.index[k]}, column t: {counts[packets][0]} rows come at "
        f"once, at "
        f"{t[k]:.6f}, as packets do that are stamped on arrival; {packets.sum()} such packets of "
        f"{counts[packets].mean():.3g} "
        f"rows are spread over the time before each stamp ({1 / usual:.4g} Hz)"
    )
    return table.assign(t=spread)


def _averaged(table: pd.DataFrame, problems: list[str]) -> pd.DataFrame:
    """One row an instant: means by the stated accuracies, which become that of the mean."""
    file, line = table.attrs["file"], table.index.name
    instant = table["t"].ne(table["t"].shift()).cumsum()
    shared = instant.duplicated()
    k = table.index[shared][0]
    problems.append(
        f"{file}, {line} {k}, column t: {table['t'][k]:.6f} is the time of the row before, which differs; rows like "
        f"it: "
        f"{shared.sum()} of {len(table)}, averaged by their accuracies"
    )
    averaged = table[~shared].copy()
    for column in table.columns.drop("t"):
        accuracy = {"v_e": "sd_e", "v_n": "sd_n", "v_u": "sd_u"}.get(column)
        values = table[column]
        if column == "course":
            around = np.exp(1j * np.radians(values))
            mean = pd.Series(around.to_numpy(), table.index).groupby(instant).mean()
            averaged[column] = np.mod(np.degrees(np.angle(mean.to_numpy())), 360)
            continue
        weights = pd.Series(1.0, table.index)
        if accuracy in table.columns:
            weights = 1 / table[accuracy] ** 2
        elif column in ("sd_e", "sd_n", "sd_u"):
            averaged[column] = ((1 / values**2).groupby(instant).sum() ** -0.5).to_numpy()
            continue
        known = values.notna() & weights.notna()
        total = (values * weights).where(known).groupby(instant).sum(min_count=1)
        averaged[column] = (total / weights.where(known).groupby(instant).sum(min_count=1)).to_numpy()
    averaged.attrs["file"] = file
    return averaged
