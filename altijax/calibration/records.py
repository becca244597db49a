"""A calibration: constants, how well they are known, and whether they help; as a table, and as a TOML file."""

import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path
from typing import Any

import jax
import numpy as np
import pandas as pd

from altijax.calibration.identifiability import Identification, identify_information
from altijax.calibration.parameters import ACCEPTED, CONSTANTS, triads
from altijax.toml_lines import toml_key, toml_line

# Less than this is no difference worth a word.
_WORSE = 1.01
_TABLE = ("value", "std", "unit", "prior", "prior_std")


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Calibration:
    """Constants found from recordings, how well they are known, and whether they help where they were not fitted.

    Attributes
    ----------
    method : str
        Method whose misfit was minimised, or "drive" where the sensors were made to agree.
    table : DataFrame
        One row a constant: value, std (from data and prior), unit, prior (its mean), prior_std, shift, by how many
        standard deviations of the prior the value has moved, and bits, the information gained on it.
    correlation : DataFrame
        Correlation between the constants.
    absorbed : DataFrame
        By how much each value moves if one of the constants left at nominal (columns) is off by one unit; empty where
        that is not known.
    undetermined : tuple of str
        In words, what the data do not determine, and which combinations of the same constants they do.
    held_out : DataFrame
        One row a recording and quantity: its unit, the first and the last time that was fitted (``start``, ``until``)
        and the last one that was held out (``end``), in s on the recording's time axis; the root mean square misfit
        with nominal and with fitted constants on both parts, NaN where there was nothing; and whether the constants
        made it worse, by more than 1 %, where they were not fitted.
    noise : Series
        Of "drive", the standard deviation of each kind of observation as it was found, m/s; it includes their
        correlation. Empty otherwise.
    nis : float
        Normalised innovation squared per degree of freedom with that noise; NaN where there is none.
    converged : bool
        False where the steps of the fit were used up, as on a drive that leaves much open: then the bars say too
        little.
    """

    method: str
    table: pd.DataFrame
    correlation: pd.DataFrame
    absorbed: pd.DataFrame
    undetermined: tuple[str, ...]
    held_out: pd.DataFrame
    noise: pd.Series = field(default_factory=lambda: noise_levels({}))
    nis: float = float("nan")
    converged: bool = True

    @property
    def values(self) -> pd.Series:
        """Value by name."""
        return self.table["value"]

    def known(self) -> dict[str, float]:
        """Value by name, in plain numbers."""
        return dict(zip(map(str, self.values.index), self.values.tolist(), strict=True))

    @property
    def std(self) -> pd.Series:
        """Standard deviation by name."""
        return self.table["std"]

    @property
    def covariance(self) -> pd.DataFrame:
        """Covariance of the constants."""
        return self.correlation * np.outer(self.std, self.std)

    @property
    def identification(self) -> Identification:
        """Which directions of the constants the data determine, and the information on each."""
        units = self.table["prior_std"].to_numpy(float)
        # By the covariance's own values, for the inverse of one that is small along some directions loses the others.
        known, directions = np.linalg.eigh(self.covariance.to_numpy(float) / np.outer(units, units))
        information = directions * (1 / np.clip(known, np.finfo(float).tiny, 1) - 1) @ directions.T
        with jax.enable_x64(True):
            return identify_information(information / np.outer(units, units), units, tuple(map(str, self.table.index)))

    @property
    def std_with_absorbed(self) -> pd.Series:
        """Standard deviation by name where the constants that were left at nominal may be off as `CONSTANTS` says."""
        presumed = np.array([CONSTANTS[name].spread for name in self.absorbed.columns])
        taken_up = np.square(self.absorbed.to_numpy(float) * presumed).sum(1)
        return np.sqrt(self.std**2 + pd.Series(taken_up, self.absorbed.index).reindex(self.std.index, fill_value=0.0))

    def save(self, path: str | PathLike[str]) -> None:
        """Write the calibration as a TOML file, from which `load` gets the same numbers, to the last digit.

        Parameters
        ----------
        path : path
            File to write; one that exists is replaced.
        """
        lines = ["# Calibration by AltiJAX: true = measured / scale - bias; see altijax.Calibration"]
        lines += [toml_line("method", self.method), toml_line("undetermined", list(self.undetermined))]
        lines += [toml_line("nis", self.nis), toml_line("converged", self.converged)]
        lines += ["", "[noise]", *(toml_line(str(kind), level) for kind, level in self.noise.items())]
        for name, row in self.table.iterrows():
            lines += ["", f"[constants.{toml_key(str(name))}]", *(toml_line(key, row[key]) for key in _TABLE)]
        for title, frame in (("correlation", self.correlation), ("absorbed", self.absorbed)):
            lines += ["", f"[{title}]", toml_line("columns", list(frame.columns))]
            lines += [toml_line(str(name), row.tolist()) for name, row in frame.iterrows()]
        for name, row in self.held_out.iterrows():
            lines += [
                "",
                "[[held_out]]",
                toml_line("recording", name),
                *(toml_line(str(key), row[key]) for key in row.index),
            ]
        Path(path).write_text("\n".join(lines) + "\n", encoding="utf-8")

    @classmethod
    def load(cls, path: str | PathLike[str]) -> "Calibration":
        """The calibration that `save` wrote.

        Parameters
        ----------
        path : path
            TOML file.

        Returns
        -------
        calibration : Calibration
            The same.

        Raises
        ------
        ValueError
            If the file is not TOML, lacks a part of a calibration, or says what no calibration can: it names the entry.
        """
        try:
            found = tomllib.loads(Path(path).read_text(encoding="utf-8"))
            constants = found["constants"]
            rows = {name: [constants[name][key] for key in _TABLE] for name in constants}
            frames = {title: _matrix(found[title], list(constants)) for title in ("correlation", "absorbed")}
            # What is no standard deviation has no logarithm, and is told below.
            with np.errstate(invalid="ignore", divide="ignore"):
                table = constants_table(pd.DataFrame.from_dict(rows, orient="index", columns=list(_TABLE)))
            calibration = cls(
                method=found["method"],
                table=table,
                undetermined=tuple(found["undetermined"]),
                held_out=held_out_table(found.get("held_out", [])),
                noise=noise_levels(found.get("noise", {})),
                nis=found.get("nis", cls.nis),
                converged=found.get("converged", cls.converged),
                **frames,
            )
        except (tomllib.TOMLDecodeError, UnicodeDecodeError, KeyError, TypeError, ValueError) as error:
            raise ValueError(f"{path} is not a calibration that `Calibration.save` wrote: {error!r}") from error
        wrong = next(_impossible(calibration), None)
        if wrong:
            raise ValueError(f"{path}: {wrong}; calibrate again and save, or mend that entry by hand")
        return calibration

    def __repr__(self) -> str:
        parts = [f"Calibration of {self.method!r}", self.table.to_string(), *self._noise(), *self.undetermined]
        return "\n".join(
            [*parts, *self._judgement(), self.held_out.T.to_string() if len(self.held_out) else ""]
        ).strip()

    def _repr_html_(self) -> str:
        parts = [f"<p>Calibration of <b>{self.method}</b></p>", self.table.to_html(border=0)]
        parts += [f"<p>{sentence}</p>" for sentence in (*self._noise(), *self.undetermined, *self._judgement())]
        return "".join([*parts, self.held_out.round(4).to_html(border=0) if len(self.held_out) else ""])

    def _noise(self) -> list[str]:
        if self.noise.empty:
            return []
        levels = ", ".join(f"{kind} {level:.3g}" for kind, level in self.noise.items())
        return [f"Noise found, m/s: {levels}; normalised innovation squared {self.nis:.2f}."]

    def _judgement(self) -> list[str]:
        if not len(self.held_out):
            return []
        worse = worse_where_held_out(self)
        return [worse or "Root mean square misfit where fitted, up to `until`, and where held out, after it:"]


def constants_table(table: pd.DataFrame) -> pd.DataFrame:
    """The table of a `Calibration` from value, std, unit, prior and prior_std by name.

    Parameters
    ----------
    table : DataFrame
        With these columns.

    Returns
    -------
    table : DataFrame
        The same with shift and bits, its index called parameter.
    """
    table = table.loc[:, list(_TABLE)].astype(dict.fromkeys(("value", "std", "prior", "prior_std"), float))
    shift, bits = (table["value"] - table["prior"]) / table["prior_std"], np.log2(table["prior_std"] / table["std"])
    return table.assign(shift=shift, bits=bits).rename_axis("parameter")


def noise_levels(levels: Mapping[str, float]) -> pd.Series:
    """`Calibration.noise` of standard deviations by kind of observation."""
    return pd.Series(dict(levels), name="std", dtype=float)


def worse_where_held_out(calibration: Calibration) -> str:
    """A sentence on the quantities that the constants made worse where they were not fitted; empty if there is none."""
    held_out = calibration.held_out
    if not len(held_out) or not held_out["worse"].any():
        return ""
    rows = held_out[held_out["worse"]]
    listed = ", ".join(
        f"{row['quantity']} of {name!r} ({row['held_out_nominal']:.3g} to {row['held_out']:.3g} {row['unit']})"
        for name, row in rows.iterrows()
    )
    return f"These constants make the estimate worse where they were not fitted: {listed}."


def correct_imu(imu: pd.DataFrame, calibration: Calibration | None) -> pd.DataFrame:
    """Readings of accelerometers and gyros without their calibrated biases and scales.

    Parameters
    ----------
    imu : DataFrame
        IMU stream of a recording.
    calibration : Calibration, optional
        Nothing is corrected without one.

    Returns
    -------
    imu : DataFrame
        true = measured / scale - bias; the same table where nothing is known of these.
    """
    known = triads({} if calibration is None else calibration.known(), np)
    scales = np.append(known.accelerometer_scale, known.gyro_scale).tolist()
    biases = np.append(known.accelerometer_bias, known.gyro_bias).tolist()
    constants = zip(("ax", "ay", "az", "gx", "gy", "gz"), scales, biases, strict=True)
    changed = {
        name: imu[name] / scale - bias for name, scale, bias in constants if (scale, bias) != (1.0, 0.0) and name in imu
    }
    return imu.assign(**changed)


def held_out_row(
    recording: str,
    quantity: str,
    unit: str,
    interval: Sequence[float],
    fitted: Sequence[float],
    held_out: Sequence[float],
) -> dict[str, str | float | bool]:
    """A row of `Calibration.held_out`; `interval` is start, until and end, the misfits are nominal and fitted."""
    return {
        "recording": recording,
        "quantity": quantity,
        "unit": unit,
        **dict(zip(("start", "until", "end"), map(float, interval), strict=True)),
        **dict(zip(("fitted_nominal", "fitted"), map(float, fitted), strict=True)),
        **dict(zip(("held_out_nominal", "held_out"), map(float, held_out), strict=True)),
        "worse": bool(held_out[1] > _WORSE * held_out[0]),
    }


def held_out_table(rows: Sequence[dict[str, str | float | bool]]) -> pd.DataFrame:
    """`Calibration.held_out` of such rows."""
    return pd.DataFrame(rows).set_index("recording") if rows else pd.DataFrame()


def _matrix(entries: Mapping[str, list[Any]], constants: list[str]) -> pd.DataFrame:
    names = [name for name in constants if name in entries]
    short = [name for name in names if len(entries[name]) != len(entries["columns"])]
    if short:
        raise ValueError(f"the row of {short[0]} has {len(entries[short[0]])} values for columns {entries['columns']}")
    return pd.DataFrame([entries[name] for name in names], names, entries["columns"], dtype=float)


def _impossible(calibration: Calibration) -> Iterator[str]:
    """What a calibration from a file says and cannot, in words: entry, what was seen, what is known."""
    if calibration.method not in ACCEPTED:
        yield f"method is {calibration.method!r}, known are {', '.join(ACCEPTED)}"
    for name, row in calibration.table.iterrows():
        if name not in CONSTANTS:
            yield f"constants has {name!r}, known are {', '.join(CONSTANTS)}"
        elif row["unit"] != CONSTANTS[str(name)].unit:
            yield f"constants.{name}.unit is {row['unit']!r}, and it is in {CONSTANTS[str(name)].unit!r}"
        for key in ("value", "std", "prior", "prior_std"):
            if not np.isfinite(row[key]) and (name, key) != ("initial_vertical_speed", "prior"):
                yield f"constants.{name}.{key} is {row[key]}, which is no number"
        for key in ("std", "prior_std"):
            if row[key] <= 0:
                yield f"constants.{name}.{key} is {row[key]}, and must be positive"
    names, correlation = list(calibration.table.index), calibration.correlation
    if list(correlation.index) != names or list(correlation.columns) != names:
        yield f"correlation has rows {list(correlation.index)} and columns {list(correlation.columns)} for {names}"
        return
    values = correlation.to_numpy(float)
    # Rounding leaves a correlation of one above it, and its matrix not quite symmetric.
    if not (np.isfinite(values).all() and np.abs(values).max(initial=0) < 1 + 1e-6):
        yield "correlation has a value that is not between -1 and 1"
    elif not np.allclose(values, values.T, atol=1e-6) or not np.allclose(np.diag(values), 1, atol=1e-6):
        yield "correlation is not symmetric with ones on its diagonal"
    if list(calibration.absorbed.index) not in (names, []):
        yield f"absorbed has rows {list(calibration.absorbed.index)} for {names}"
    unknown = [name for name in calibration.absorbed.columns if name not in CONSTANTS]
    if unknown:
        yield f"absorbed has columns {unknown}, which are no constants"
