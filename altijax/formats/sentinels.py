"""Numbers that stand for "not known", and values that cannot be: found as they stand in the file, and left out."""

import numpy as np
import pandas as pd

# What loggers write where they know nothing: full counters, nines; as counts, or scaled by a power of ten.
_FULL = [2.0**15 - 1, -(2.0**15), 2.0**16 - 1, 2.0**31 - 1, -(2.0**31), 2.0**32 - 1]
_FULL += [sign * nines for nines in (999.0, 9999.0, 99999.0, 999999.0) for sign in (1, -1)]
_SCALED = np.round([value * 10.0**-k for value in _FULL for k in range(8)], 9)
_BEYOND_ANY = 1e15

# m/s^2, rad/s and m/s that no vehicle's sensor sees: 30 g, 16 turns a second, 540 km/h of a wheel.
_LIMITS = {
    "imu": dict.fromkeys(("ax", "ay", "az"), 300.0) | dict.fromkeys(("gx", "gy", "gz"), 100.0),
    "wheel": dict.fromkeys(("speed", "left", "right", "front_left", "front_right", "rear_left", "rear_right"), 150.0),
    "gnss": dict.fromkeys(("v_e", "v_n", "v_u", "speed", "climb"), 1000.0),
    "reference": {},
}
_NOT_KNOWN = "stands for a value that is not known"
_OPTIONAL = {
    "temperature",
    "course",
    "climb",
    "v_u",
    "lat",
    "lon",
    "alt",
    "sd_e",
    "sd_n",
    "sd_u",
    "roll",
    "pitch",
    "heading",
}


def without_sentinels(table: pd.DataFrame, stream: str, problems: list[str]) -> pd.DataFrame:
    """The table as it stands in the file, less numbers that stand for none."""
    found: dict[str, tuple[np.ndarray, str]] = {}
    for column in table.columns.drop("t"):
        if table[column].dtype.kind != "f":
            continue
        values = table[column].to_numpy(float)
        mask = _full_numbers(values)
        if (column == "speed" and stream == "gnss") or column.startswith("sd_"):
            mask |= values < 0
        elif stream == "wheel" and set(values[values < 0]) == {-1.0}:
            # Backwards a wheel turns at other speeds than exactly this one, too.
            mask |= values == -1
        elif column == "course":
            rest = values[np.isfinite(values) & (values != -1)]
            mask |= (values == -1) & (rest.min(initial=0.0) >= 0) | (np.abs(values) > 360.01)
        elif column in ("lat", "lon") and (values == 0).any():
            # Exactly on the equator or on Greenwich's meridian, while the rest is nowhere near.
            rest = np.abs(values[np.isfinite(values) & (values != 0)])
            mask |= (values == 0) & (rest.size > 0 and rest.min() > 0.5 * rest.max())
        if mask.any():
            found[column] = (mask, _NOT_KNOWN)
    return _left_out(table, found, problems)


def without_impossible_values(table: pd.DataFrame, stream: str, problems: list[str]) -> pd.DataFrame:
    """The table, in SI units, less single values that no such sensor can measure."""
    found = {}
    for column, limit in _LIMITS[stream].items():
        if column in table.columns:
            values = table[column].to_numpy(float)
            mask = np.isfinite(values) & (np.abs(values) > limit)
            # Where many are beyond it, the unit is wrong, not the value.
            if 0 < mask.mean() < 0.02:
                found[column] = (mask, f"is beyond what can be ({limit:g})")
    return _left_out(table, found, problems)


def _full_numbers(values: np.ndarray) -> np.ndarray:
    mask = np.isfinite(values) & (np.abs(values) >= _BEYOND_ANY)
    candidates = np.isin(np.round(np.where(mask, 0, values), 9), _SCALED) & ~mask
    rest = np.abs(values[~candidates & ~mask & np.isfinite(values)])
    if candidates.any() and rest.size:
        mask |= candidates & (np.abs(values) > 3 * rest.max() + 1)
    return mask


def _left_out(table: pd.DataFrame, found: dict[str, tuple[np.ndarray, str]], problems: list[str]) -> pd.DataFrame:
    keep = np.ones(len(table), bool)
    for column, (mask, why) in found.items():
        values = table[column].to_numpy(float)
        problems.append(
            f"{table.attrs['file']}, {table.index.name} {table.index[mask][0]}, column {column}: "
            f"{values[mask][0]:.10g} {why}; "
            f"rows like it: {mask.sum()} of {len(table)}, left out"
        )
        if column in _OPTIONAL:
            table = table.assign(**{column: np.where(mask, np.nan, values)})
        else:
            keep &= ~mask
    return table[keep]
