"""Recordings damaged in some 500 ways: what is read right, refused, told, or silently wrong.

    python benchmarks/hostile.py [--all]

Each variant of a good recording is written, read, and compared with the good one, stream by stream, at its true times:
*right* (all values are those of the good recording, whether or not something was mended and told), *told* (values
are wrong or gone and a warning beyond those of the good recording says something), *refused* (RecordingError), *silent*
(wrong and nothing said), *crash* (another exception). Those that are silent are listed. Estimation is not run.
``--all`` prints every variant with what was said.
"""

import argparse
import collections
import itertools
import shutil
import tempfile
import time
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pandas as pd

from altijax.formats.axes import LETTERS, right_handed_codes
from altijax.recordings import Recording, RecordingError, read_recording
from altijax.samples.foreign_drives import foreign_drive

Tables = dict[str, pd.DataFrame]
ACCELEROMETER, GYRO = ["ax", "ay", "az"], ["gx", "gy", "gz"]


def good_drive(seed: int = 0) -> Tables:
    """A drive of two minutes as tables of a tidy folder, with stops and positions."""
    drive = foreign_drive(seed, duration=120.0, gnss_rate=5.0, mean_speed=10.0)
    assert drive.imu is not None and drive.wheel is not None and drive.gnss is not None and drive.reference is not None
    gnss = drive.gnss.copy()
    reference = drive.reference
    t = reference.index.to_numpy()
    steps = np.diff(t, prepend=t[0])
    east, north = (np.cumsum(reference[name].to_numpy() * steps) for name in ("v_e", "v_n"))
    rng = np.random.default_rng(seed)
    place = [np.interp(gnss.index, t, axis) + rng.normal(scale=0.3, size=len(gnss)) for axis in (east, north)]
    gnss["lat"], gnss["lon"] = (
        48 + np.degrees(place[1] / 6.371e6),
        11 + np.degrees(place[0] / 6.371e6 / np.cos(np.radians(48))),
    )
    gnss["alt"] = np.interp(gnss.index, t, reference["alt"]) + rng.normal(scale=0.5, size=len(gnss))
    gnss["sd_e"] = gnss["sd_n"] = gnss["sd_u"] = 0.05
    tables = {"imu": drive.imu, "wheel": drive.wheel, "gnss": gnss, "reference": reference[::5]}
    return {name: table.rename_axis("t").reset_index().astype(float) for name, table in tables.items()}


def changed(tables: Tables, stream: str, **columns: object) -> Tables:
    return tables | {stream: tables[stream].assign(**columns)}


def scaled(tables: Tables, stream: str, columns: list[str], factor: float) -> Tables:
    return changed(tables, stream, **{name: tables[stream][name] * factor for name in columns})


def with_times(tables: Tables, streams: tuple[str, ...], change: Callable[[np.ndarray], np.ndarray]) -> Tables:
    return tables | {
        name: tables[name].assign(t=change(tables[name]["t"].to_numpy())) for name in streams if name in tables
    }


Variant = tuple[str, str, Callable[[Tables], Tables]]


def variants() -> Iterator[Variant]:
    """Kind, name, and the change of the tables."""
    yield from _clock_variants()
    yield from _counter_variants()
    yield from _axes_variants()
    yield from _unit_variants()
    yield from _value_variants()
    yield from _row_variants()


def _clock_variants() -> Iterator[Variant]:
    for stream in ("imu", "wheel", "gnss"):
        for offset in (-60, -37, -18, -5, -3, 3, 5, 18, 37, 60):
            yield (
                "offset of a clock",
                f"{stream} {offset:+d} s",
                lambda x, s=stream, d=offset: with_times(x, (s,), lambda t: t + d),
            )
        for rate in (0.98, 1.02):
            yield (
                "rate of a clock",
                f"{stream} x{rate}",
                lambda x, s=stream, r=rate: with_times(x, (s,), lambda t: t * r),
            )
        yield (
            "clock set within",
            f"{stream} +10 s from the middle",
            lambda x, s=stream: with_times(x, (s,), lambda t: t + 10 * (t > 60)),
        )
        yield (
            "clock set within",
            f"{stream} -10 s from the middle",
            lambda x, s=stream: with_times(x, (s,), lambda t: t - 10 * (t > 60)),
        )
        yield (
            "clock set within",
            f"{stream} restarts",
            lambda x, s=stream: with_times(x, (s,), lambda t: np.where(t > 60, t - 60, t)),
        )
        for where, value in ((0, -1e9), (-1, 1e6), (300, 1e7), (200, 0.0), (0, 1e12)):
            yield (
                "wild stamp",
                f"{stream} row {where} at {value:g}",
                lambda x, s=stream, w=where, v=value: _one(x, s, "t", w, v),
            )
        for unit, factor in {"ms": 1e3, "us": 1e6, "ns": 1e9, "min": 1 / 60, "h": 1 / 3600, "d": 1 / 86400}.items():
            yield (
                "unit of one time",
                f"{stream} in {unit}",
                lambda x, s=stream, f=factor: with_times(x, (s,), lambda t: t * f),
            )
    everything = ("imu", "wheel", "gnss", "reference")
    for unit, factor in {"ms": 1e3, "us": 1e6, "ns": 1e9, "min": 1 / 60, "h": 1 / 3600, "d": 1 / 86400}.items():
        yield "unit of time", f"all in {unit}", lambda x, f=factor: with_times(x, everything, lambda t: t * f)
    yield (
        "unit of time",
        "sample numbers",
        lambda x: {n: t.assign(t=np.arange(len(t), dtype=float)) for n, t in x.items()},
    )
    yield (
        "unit of time",
        "sample numbers of the IMU",
        lambda x: changed(x, "imu", t=np.arange(len(x["imu"]), dtype=float)),
    )
    for start in (45296.0, 86340.0, 3590.0):
        yield (
            "packed time",
            f"HHMMSS from {start:g} s",
            lambda x, s=start: with_times(x, everything, lambda t: _packed(t + s)),
        )
        yield (
            "packed time",
            f"HHMMSSmmm from {start:g} s",
            lambda x, s=start: with_times(x, everything, lambda t: 1e3 * _packed(t + s)),
        )
    for size in (5, 20, 50):
        yield (
            "packets",
            f"{size} rows, one stamp",
            lambda x, n=size: changed(x, "imu", t=_arrival(x["imu"]["t"].to_numpy(), n, 0.0)),
        )
        yield (
            "packets",
            f"{size} rows in a burst",
            lambda x, n=size: changed(x, "imu", t=_arrival(x["imu"]["t"].to_numpy(), n, 1e-5)),
        )
    yield "packets", "stamps in tenths", lambda x: changed(x, "imu", t=np.ceil(x["imu"]["t"] * 10 - 1e-9) / 10)


def _counter_variants() -> Iterator[Variant]:
    everything = ("imu", "wheel", "gnss", "reference")
    counters = [(16, "ms"), (24, "us"), (24, "ms"), (32, "ms"), (32, "us"), (32, "ns"), (16, "s"), (32, "s")]
    for (bits, unit), form in itertools.product(counters, ("in its unit", "in s", "signed")):
        scale = {"s": 1.0, "ms": 1e3, "us": 1e6, "ns": 1e9}[unit]
        yield (
            "counter starts again",
            f"{bits} bits of {unit}, {form}",
            lambda x, b=bits, s=scale, f=form: with_times(x, everything, lambda t: _counter(t, b, s, f)),
        )
    for name, period in (("week", 604800.0), ("midnight", 86400.0), ("12 hours", 43200.0), ("hour", 3600.0)):
        for scale in (1.0, 1e3):
            yield (
                "counter starts again",
                f"{name} in 1/{scale:g} s",
                lambda x, p=period, s=scale: with_times(x, everything, lambda t: np.mod(t + p - 60, p) * s),
            )


def _axes_variants() -> Iterator[Variant]:
    for code in itertools.permutations("FLU"):
        for signs in itertools.product((1, -1), repeat=3):
            letters = "".join(
                c if s > 0 else {"F": "B", "L": "R", "U": "D"}[c] for c, s in zip(code, signs, strict=True)
            )
            if letters == "FLU":
                continue
            handed = "right-handed" if letters in right_handed_codes() else "left-handed"
            C = np.array([LETTERS[letter] for letter in letters], float).T
            yield f"axes, {handed}", letters, lambda x, m=C: _mounted(x, m, (ACCELEROMETER, GYRO))
            if handed == "right-handed":
                yield "axes, accelerometer alone", letters, lambda x, m=C: _mounted(x, m, (ACCELEROMETER,))
                yield "axes, gyro alone", letters, lambda x, m=C: _mounted(x, m, (GYRO,))
    for column in (*ACCELEROMETER, *GYRO, "v_e", "v_n", "v_u"):
        stream = "gnss" if column.startswith("v") else "imu"
        yield "sign of a column", column, lambda x, s=stream, c=column: scaled(x, s, [c], -1)
    yield "sign of a column", "all of the gyro", lambda x: scaled(x, "imu", GYRO, -1)
    yield "sign of a column", "v_e and v_n", lambda x: scaled(x, "gnss", ["v_e", "v_n"], -1)
    yield "exchanged", "v_e, v_n", lambda x: changed(x, "gnss", v_e=x["gnss"]["v_n"], v_n=x["gnss"]["v_e"])
    yield "exchanged", "lat, lon", lambda x: changed(x, "gnss", lat=x["gnss"]["lon"], lon=x["gnss"]["lat"])


def _unit_variants() -> Iterator[Variant]:
    sizes = {
        "accelerometer": {
            "g": 1 / 9.80665,
            "mg": 1e3 / 9.80665,
            "gal": 100.0,
            "counts": 16384 / 9.80665,
            "2 g": 2.0,
            "half": 0.5,
        },
        "gyro": {"deg/s": 57.29578, "mrad/s": 1e3, "mdeg/s": 57295.78, "deg/h": 206264.8, "counts": 131 * 57.29578},
        "speed": {"km/h": 3.6, "mph": 2.23694, "kn": 1.94384, "cm/s": 100.0, "mm/s": 1e3},
        "gnss speed": {"km/h": 3.6, "mph": 2.23694, "kn": 1.94384, "cm/s": 100.0, "mm/s": 1e3},
    }
    where = {
        "accelerometer": ("imu", ACCELEROMETER),
        "gyro": ("imu", GYRO),
        "speed": ("wheel", ["speed"]),
        "gnss speed": ("gnss", ["v_e", "v_n", "v_u"]),
    }
    for quantity, units in sizes.items():
        stream, columns = where[quantity]
        for unit, factor in units.items():
            yield "unit", f"{quantity} in {unit}", lambda x, s=stream, c=columns, f=factor: scaled(x, s, c, f)
            if stream != "gnss":
                yield (
                    "unit, without GNSS",
                    f"{quantity} in {unit}",
                    lambda x, s=stream, c=columns, f=factor: _without(scaled(x, s, c, f), "gnss"),
                )
            if stream == "gnss":
                yield (
                    "unit, without positions",
                    f"{quantity} in {unit}",
                    lambda x, s=stream, c=columns, f=factor: _without_columns(
                        scaled(x, s, c, f), "gnss", "lat", "lon", "alt"
                    ),
                )
            yield (
                "unit, without wheels",
                f"{quantity} in {unit}",
                lambda x, s=stream, c=columns, f=factor: (
                    _without(scaled(x, s, c, f), "wheel") if s != "wheel" else _without(scaled(x, s, c, f), "reference")
                ),
            )
        for column in columns[: 3 if len(columns) == 3 else 0]:
            unit, factor = next(iter(units.items()))
            yield (
                "unit of one column",
                f"{column} in {unit}",
                lambda x, s=stream, c=column, f=factor: scaled(x, s, [c], f),
            )
    yield "unit", "positions in rad", lambda x: scaled(x, "gnss", ["lat", "lon"], np.pi / 180)
    yield "unit", "positions in 1e-7 deg", lambda x: scaled(x, "gnss", ["lat", "lon"], 1e7)
    yield "unit", "alt in ft", lambda x: scaled(x, "gnss", ["alt"], 1 / 0.3048)
    yield "unit", "alt in mm", lambda x: scaled(x, "gnss", ["alt"], 1e3)
    yield "unit", "gravity removed", lambda x: changed(x, "imu", az=x["imu"]["az"] - 9.81)


def _value_variants() -> Iterator[Variant]:
    columns = {"imu": ["ax", "az", "gx", "gz"], "wheel": ["speed"], "gnss": ["v_e", "v_n"]}
    for stream, names in columns.items():
        for column in names:
            for value in (
                -999.0,
                -9999.0,
                9999.0,
                65535.0,
                32767.0,
                -32768.0,
                2.0**31 - 1,
                1e30,
                1e300,
                np.nan,
                np.inf,
            ):
                yield (
                    "sentinel",
                    f"{column} {value:g} in 5 %",
                    lambda x, s=stream, c=column, v=value: _some(x, s, c, v, 0.05),
                )
            yield "sentinel", f"{column} 1e300 once", lambda x, s=stream, c=column: _one(x, s, c, 500, 1e300)
            yield "column empty", column, lambda x, s=stream, c=column: changed(x, s, **{c: np.nan})
    for column in ("lat", "lon", "alt", "sd_e", "v_u"):
        for value in (-1.0 if column == "sd_e" else 0.0 if column in ("lat", "lon") else 1e30, 1e30, np.nan):
            yield "sentinel, optional", f"{column} {value:g}", lambda x, c=column, v=value: _some(x, "gnss", c, v, 0.1)
    yield "sentinel", "speed -1 in 20 %", lambda x: _some(_by_course(x), "gnss", "speed", -1.0, 0.2)
    yield "sentinel", "course -1 in 20 %", lambda x: _some(_by_course(x), "gnss", "course", -1.0, 0.2)
    yield "sentinel", "wheel -1 in 5 %", lambda x: _some(x, "wheel", "speed", -1.0, 0.05)
    for stream, names in {
        "imu": ACCELEROMETER + GYRO,
        "wheel": ["speed"],
        "gnss": ["v_e", "v_n", "v_u", "lat", "lon", "alt"],
    }.items():
        for first, last in ((40.0, 55.0), (60.0, 62.0 if stream == "imu" else 70.0)):
            yield (
                "frozen",
                f"{stream} {first:g} to {last:g} s",
                lambda x, s=stream, c=names, a=first, b=last: _frozen(x, s, c, a, b),
            )
    yield "frozen", "accelerometer alone", lambda x: _frozen(x, "imu", ACCELEROMETER, 40, 45)
    yield "frozen", "gyro alone", lambda x: _frozen(x, "imu", GYRO, 40, 45)
    for column in ("ax", "ay", "gx", "gz"):
        yield "dead axis", column, lambda x, c=column: changed(x, "imu", **{c: 0.0})
    for span in (0.5, 2.0, 5.0):
        yield "filled by lines", f"{span:g} s", lambda x, n=span: _lines(x, 50.0, 50.0 + n)
    yield "zeros", "GNSS velocity 0 for 20 s", lambda x: _zeros(x, 40, 60)
    for limit in (0.7, 1.0):
        yield "saturated", f"ax at {limit:g}", lambda x, m=limit: changed(x, "imu", ax=x["imu"]["ax"].clip(-m, m))
    yield "saturated", "gz at 0.1", lambda x: changed(x, "imu", gz=x["imu"]["gz"].clip(-0.1, 0.1))
    for name in ("left", "right"):
        yield "dead wheel", name, lambda x, n=name: _wheels(x, **{n: 0.0})
        yield "dead wheel", f"{name} in km/h", lambda x, n=name: _wheels(x, **{n: x["wheel"]["speed"] * 3.6})
        yield "dead wheel", f"{name} misses half", lambda x, n=name: _wheels(x, **{n: x["wheel"]["speed"] / 2})


def _row_variants() -> Iterator[Variant]:
    rng = np.random.default_rng(0)
    for stream in ("imu", "wheel", "gnss"):
        yield (
            "rows",
            f"{stream} every row twice",
            lambda x, s=stream: x | {s: x[s].loc[x[s].index.repeat(2)].reset_index(drop=True)},
        )
        yield "rows", f"{stream} shuffled", lambda x, s=stream: x | {s: x[s].iloc[rng.permutation(len(x[s]))]}
        yield "rows", f"{stream} reversed", lambda x, s=stream: x | {s: x[s].iloc[::-1]}
        yield (
            "rows",
            f"{stream} two exchanged",
            lambda x, s=stream: x | {s: x[s].iloc[[*range(100), 101, 100, *range(102, len(x[s]))]]},
        )
        yield "rows", f"{stream} 10 % missing", lambda x, s=stream: x | {s: x[s][rng.random(len(x[s])) > 0.1]}
        yield "rows", f"{stream} gap of 5 s", lambda x, s=stream: x | {s: x[s][(x[s]["t"] < 50) | (x[s]["t"] > 55)]}
        yield "rows", f"{stream} none", lambda x, s=stream: x | {s: x[s].iloc[:0]}
        yield "rows", f"{stream} one", lambda x, s=stream: x | {s: x[s].iloc[:1]}
        yield "rows", f"{stream} first half", lambda x, s=stream: x | {s: x[s].iloc[: len(x[s]) // 2]}
    yield "rows", "gnss two of one instant", lambda x: x | {"gnss": _doubled(x["gnss"])}
    yield "rows", "gnss held at 25 Hz", lambda x: x | {"gnss": _held(x["gnss"], 5)}


def _packed(t: np.ndarray) -> np.ndarray:
    t = np.mod(np.round(t, 3), 86400)
    return np.floor(t / 3600) * 10000 + np.floor(t / 60) % 60 * 100 + np.round(t % 60, 3)


def _counter(t: np.ndarray, bits: int, scale: float, form: str) -> np.ndarray:
    period = 2.0**bits
    counts = np.mod(np.floor(t * scale) + period - np.floor(60 * scale), period)
    if form == "signed":
        counts = np.mod(counts, period) - period / 2
        counts = np.where(counts < 0, counts + period / 2, counts - period / 2) if period / scale < 1 else counts
        counts = np.mod(counts + period / 2 + period / 2, period) - period / 2
    return counts / scale if form == "in s" else counts


def _arrival(t: np.ndarray, size: int, apart: float) -> np.ndarray:
    k = np.arange(t.size)
    last = np.minimum((k // size + 1) * size - 1, t.size - 1)
    return t[last] + apart * (k % size)


def _one(tables: Tables, stream: str, column: str, row: int, value: float) -> Tables:
    table = tables[stream].copy()
    table.iloc[row, table.columns.get_loc(column)] = value
    return tables | {stream: table}


def _some(tables: Tables, stream: str, column: str, value: float, share: float) -> Tables:
    table = tables[stream].copy()
    at = np.arange(int(0.4 * len(table)), int((0.4 + share) * len(table)))
    table.iloc[at, table.columns.get_loc(column)] = value
    return tables | {stream: table}


def _mounted(tables: Tables, C: np.ndarray, triads: tuple[list[str], ...]) -> Tables:
    imu = tables["imu"].copy()
    for triad in triads:
        imu[triad] = imu[triad].to_numpy() @ C
    return tables | {"imu": imu}


def _without(tables: Tables, stream: str) -> Tables:
    return {name: table for name, table in tables.items() if name != stream}


def _without_columns(tables: Tables, stream: str, *columns: str) -> Tables:
    return tables | {stream: tables[stream].drop(columns=list(columns))}


def _by_course(tables: Tables) -> Tables:
    g = tables["gnss"]
    course = np.mod(np.degrees(np.arctan2(g["v_e"], g["v_n"])), 360)
    return tables | {"gnss": pd.DataFrame({"t": g["t"], "speed": np.hypot(g["v_e"], g["v_n"]), "course": course})}


def _frozen(tables: Tables, stream: str, columns: list[str], first: float, last: float) -> Tables:
    table = tables[stream].copy()
    at = (table["t"] > first) & (table["t"] < last)
    table.loc[at, columns] = table.loc[at, columns].iloc[0].to_numpy()
    return tables | {stream: table}


def _lines(tables: Tables, first: float, last: float) -> Tables:
    imu = tables["imu"].copy()
    at = ((imu["t"] > first) & (imu["t"] < last)).to_numpy()
    for column in ACCELEROMETER + GYRO:
        imu.loc[at, column] = np.interp(imu["t"][at], imu["t"][~at], imu[column][~at])
    return tables | {"imu": imu}


def _zeros(tables: Tables, first: float, last: float) -> Tables:
    gnss = tables["gnss"].copy()
    at = (gnss["t"] > first) & (gnss["t"] < last)
    gnss.loc[at, ["v_e", "v_n", "v_u"]] = 0.0
    gnss.loc[at, ["lat", "lon"]] = gnss.loc[at, ["lat", "lon"]].iloc[0].to_numpy()
    return tables | {"gnss": gnss}


def _wheels(tables: Tables, **columns: object) -> Tables:
    wheel = tables["wheel"]
    both = pd.DataFrame({"t": wheel["t"], "left": wheel["speed"], "right": wheel["speed"]})
    return tables | {"wheel": both.assign(**columns)}


def _doubled(gnss: pd.DataFrame) -> pd.DataFrame:
    twice = gnss.loc[gnss.index.repeat(2)].reset_index(drop=True)
    twice.loc[1::2, "v_e"] += 0.01
    return twice


def _held(gnss: pd.DataFrame, times: int) -> pd.DataFrame:
    held = gnss.loc[gnss.index.repeat(times)].reset_index(drop=True)
    step = float(np.median(np.diff(gnss["t"]))) / times
    return held.assign(t=held["t"] + step * (np.arange(len(held)) % times))


def written(tables: Tables, folder: Path) -> Path:
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir()
    for stream, table in tables.items():
        table.to_csv(folder / f"{stream}.csv", index=False, float_format="%.15g" if stream == "gnss" else "%.13g")
    return folder


def read(folder: Path, **options: object) -> tuple[Recording | None, list[str], str]:
    """The recording, what was said, and the kind of error."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        try:
            recording = read_recording(folder, **options)
        except RecordingError as error:
            return None, [str(error)], "refused"
        except Exception as error:
            return None, [f"{type(error).__name__}: {error}"], "crash"
    return recording, [str(w.message) for w in caught], ""


def same(found: Recording, good: Recording) -> bool:
    """Whether what was read is true: each value that came out is the good one at its time, but for a common start."""
    ours, true = (next(getattr(r, s) for s in ("imu", "gnss") if getattr(r, s) is not None) for r in (found, good))
    # Counters and clock times start where they like, all streams alike.
    end = float(ours.index[-1] - true.index[-1])
    return _same(found, good, 0.0) or _same(found, good, end)


def _same(found: Recording, good: Recording, shift: float) -> bool:
    for stream in ("imu", "wheel", "gnss", "reference"):
        ours, true = getattr(found, stream), getattr(good, stream)
        if ours is None:
            continue
        if true is None or len(ours) < 0.4 * len(true):
            return False
        t = ours.index.to_numpy() - shift
        if np.median(np.diff(t)) > 5 * np.median(np.diff(true.index)):
            return False
        inside = (t >= true.index[0]) & (t <= true.index[-1])
        for column in true.columns.intersection(ours.columns):
            expected = np.interp(t[inside], true.index, true[column])
            error = np.abs(ours[column].to_numpy()[inside] - expected)
            scale = float(np.std(true[column])) + 0.1 * float(np.abs(true[column]).mean()) + 1e-9
            error = error[np.isfinite(error)]
            if inside.mean() < 0.95 or (error.size and np.quantile(error, 0.97) > 0.3 * scale):
                return False
    return True


def outcome(tables: Tables, good: Recording, folder: Path, spoken: list[str]) -> tuple[str, list[str], float]:
    """Right, told, refused, silent or crash; what was said; seconds."""
    start = time.perf_counter()
    recording, said, failed = read(written(tables, folder))
    took = time.perf_counter() - start
    said = [sentence for sentence in said if sentence not in spoken]
    if failed:
        return failed, said, took
    assert recording is not None
    if same(recording, good) and (recording.axes == good.axes):
        return "right", said, took
    return ("told" if said else "silent"), said, took


def study(seeds: tuple[int, ...] = (0,), every: int = 1) -> pd.DataFrame:
    """Outcome of each variant (each `every`-th) of each drive."""
    rows = []
    with tempfile.TemporaryDirectory() as place:
        for seed in seeds:
            tables = good_drive(seed)
            good, spoken, _ = read(written(tables, Path(place) / "good"))
            if good is None:
                raise SystemExit(f"the good recording is refused: {spoken}")
            for kind, name, change in itertools.islice(variants(), 0, None, every):
                result, said, took = outcome(change(tables), good, Path(place) / "bad", spoken)
                rows.append(
                    {"drive": seed, "kind": kind, "variant": name, "outcome": result, "seconds": took, "said": said}
                )
    return pd.DataFrame(rows)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--all", action="store_true", help="print every variant")
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    found = study((options.seed,))
    if options.all:
        for row in found.itertuples():
            print(f"{row.outcome:8s} {row.kind}: {row.variant} | {' || '.join(row.said)[:400]}")
    print(pd.crosstab(found["kind"], found["outcome"], margins=True).to_string())
    print(f"slowest {found['seconds'].max():.1f} s")
    for row in found[found["outcome"].isin(["silent", "crash"])].itertuples():
        print(f"{row.outcome}: {row.kind}: {row.variant} {row.said}")
    print(collections.Counter(found["outcome"]))


if __name__ == "__main__":
    main()
