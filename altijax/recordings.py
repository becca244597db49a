"""Recordings: files read, checked, and turned into streams in SI units and body axes, each on its own time stamps."""

import html
import math
import warnings
from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from functools import cached_property, partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from altijax.agreement.messages import tell_disagreements
from altijax.agreement.report import agreement_report
from altijax.formats.axes import axes_to_matrix
from altijax.formats.containers import only_file, unpacked
from altijax.formats.mixed_tables import read_mixed
from altijax.formats.quantities import COLUMNS, QUANTITIES, check_units, in_si_units, si_units
from altijax.formats.registry import described, format_of
from altijax.formats.sentinels import without_sentinels
from altijax.formats.stamps import mended_clocks
from altijax.formats.stream_checks import RecordingError, RecordingWarning, check_together
from altijax.formats.streams import final_stream
from altijax.formats.tidy_folder import wheel_from_pulses
from altijax.formats.tidy_writer import write_sheet, write_tidy_folder

_ACCELEROMETER, _GYRO = ["ax", "ay", "az"], ["gx", "gy", "gz"]
_STREAMS = ("imu", "wheel", "gnss", "reference")


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Recording:
    """Streams of one recording, DataFrames indexed by ``t`` in s; None where there is no such stream.

    ========== ============================== ==========================================================================
    stream     columns                        unit
    ========== ============================== ==========================================================================
    imu        ax, ay, az                     m/s^2, specific force forward, left, up
    ..         gx, gy, gz                     rad/s about forward, left, up; if recorded
    ..         temperature                    degC; if recorded
    wheel      speed                          m/s, mean of the wheels
    ..         left, front_left, ...           m/s; the single wheels that were recorded
    gnss       v_e, v_n, v_u                  m/s East, North, up; v_u is NaN where climb was not recorded
    ..         lat, lon                       deg, as in the files (not rad); if recorded
    ..         alt                            m; if recorded
    ..         sd_e, sd_n, sd_u               m/s, the receiver's own standard deviations; if recorded
    reference  roll, pitch, heading           rad
    ..         v_e, v_n, v_u                  m/s
    ..         lat, lon, alt                  deg, deg, m
    ========== ============================== ==========================================================================

    Of the optional columns of gnss and reference, and of temperature, single values may be NaN.

    Attributes
    ----------
    name, description : str
        What the recording is called and is.
    imu, wheel, gnss, reference : DataFrame or None
        The streams; a u-blox log without ESF messages is the only one without imu.
    axes : str
        The code by which sensor axes became body axes.
    pulses_per_turn : float or None
        Pulses of one wheel sensor in one turn of its wheel.
    wheel_radius, track_width : float or None
        Metres.
    site_latitude : float or None
        Geodetic latitude in rad.
    site_height : float or None
        Height in m.
    source : str
        Path of what was read.
    notes : tuple of str
        What was dropped, changed or ignored in reading.
    """

    name: str = ""
    description: str = ""
    imu: pd.DataFrame | None = None
    wheel: pd.DataFrame | None = None
    gnss: pd.DataFrame | None = None
    reference: pd.DataFrame | None = None
    axes: str = "FLU"
    pulses_per_turn: float | None = None
    wheel_radius: float | None = None
    track_width: float | None = None
    site_latitude: float | None = None
    site_height: float | None = None
    source: str = ""
    notes: tuple[str, ...] = ()

    def save(self, folder: str | Path, *, form: str = "csv") -> None:
        """Write the recording as a tidy folder, from which `read_recording` gets the same: streams to the last bit.

        The folder's recording.toml says the units and keeps the notes, which are not told again; `source` is not kept.

        Parameters
        ----------
        folder : path
            Folder to write, made where it is not there.
        form : str, optional
            "csv", "csv.gz" or "parquet".

        Raises
        ------
        FileExistsError
            If the folder holds a recording already.
        ValueError
            If the recording has no IMU, the form is none of these, or the files do not give the recording back.
        """
        folder = Path(folder)
        if self.imu is None:
            raise ValueError(
                f"recording {self.name!r} has no imu, which a tidy folder needs; save its streams by pandas"
            )
        C = axes_to_matrix(self.axes)
        tables = {stream: getattr(self, stream) for stream in _STREAMS if getattr(self, stream) is not None}
        for triad in (_ACCELEROMETER, _GYRO):
            if triad[0] in self.imu.columns:
                tables["imu"] = tables["imu"].assign(
                    **dict(zip(triad, C.T @ self.imu[triad].to_numpy().T, strict=True))
                )
        sheet = {
            "name": self.name,
            "description": self.description,
            "axes": self.axes,
            "wheel": {
                "pulses_per_turn": self.pulses_per_turn,
                "radius": self.wheel_radius,
                "track_width": self.track_width,
            },
            "site": {"latitude": _degrees(self.site_latitude), "height": self.site_height},
            "units": si_units({stream: table.reset_index() for stream, table in tables.items()}),
        }
        write_tidy_folder(folder, tables, sheet | {"saved": {"notes": [], "known": []}}, form)
        # What is found in these files is known: it need not be told again, and its words name other files.
        again, _ = _read(folder, None, {})
        write_sheet(folder, sheet | {"saved": {"notes": self.notes, "known": again.notes}})
        for stream in tables:
            if not getattr(self, stream).equals(getattr(again, stream)):
                raise ValueError(
                    f"{folder}: the stream {stream} does not come back equal; either it is not as read_recording gives "
                    "it (order of times and columns: make the recording by recording_from_tables), or a pandas before "
                    "3.1 rounds the last digits of a CSV: save with form='parquet'"
                )

    @cached_property
    def agreement(self) -> pd.DataFrame:
        """What the streams say of each other, a row a pair; see `altijax.agreement.report.agreement_report`."""
        return agreement_report({stream: getattr(self, stream) for stream in _STREAMS}, self.axes)[0]

    def __repr__(self) -> str:
        lines = [f"Recording {self.name!r}, axes {self.axes}: {self.description}", _formatted(self).to_string()]
        if len(self.agreement):
            lines += ["agreement of the streams", _shown(self.agreement).to_string()]
        return "\n".join(lines + [f"note: {note}" for note in self.notes])

    def _repr_html_(self) -> str:
        notes = "".join(f"<li>{html.escape(note)}</li>" for note in self.notes)
        quality = _shown(self.agreement).to_html(border=0) if len(self.agreement) else ""
        return (
            f"<p><b>{html.escape(self.name)}</b>: {html.escape(self.description)}<br>axes {html.escape(self.axes)}"
            f"</p>{_formatted(self).to_html(border=0)}{quality}<ul>{notes}</ul>"
        )


def read_recording(
    path: str | Path,
    *,
    axes: str | None = None,
    units: Mapping[str, str] | None = None,
    columns: Mapping[str, str] | None = None,
    clock: Mapping[str, float] | None = None,
) -> Recording:
    """Read a recording: a tidy folder, a log of a known format, or by `columns` any table of text.

    Known by their content, as a file, a folder or a zip of it: exports of the phone apps Sensor Logger, phyphox and
    AndroSensor; NMEA, RTKLIB solutions (.pos); Racelogic .vbo, RaceChrono and AiM CSV; the logs in the second table
    below; and whatever `register_format` added. Excel workbooks are read like a folder of tables.

    A tidy folder holds ``recording.toml`` and one CSV file (``.csv``, ``.csv.gz``, or ``.parquet``) a stream:

    ============== =====================================================================================================
    recording.toml name, description, axes; [wheel] pulses_per_turn, radius (m), track_width (m); [site] latitude (deg),
                   height (m); [units] as `units` below; [clock] seconds to add to the times of imu, wheel, pulses,
                   gnss or reference; [source] origin, licence; all of it optional
    imu.csv        t, ax, ay, az; optional gx, gy, gz, temperature
    wheel.csv      t and speed, or left, right, or front_left, front_right, rear_left, rear_right
    pulses.csv     t, wheel (its name as above): one row a pulse, instead of wheel.csv; recorded as long as the IMU, for
                   no pulse means standstill
    gnss.csv       t and v_e, v_n, v_u, or speed, course (deg) and optionally climb; optional lat, lon (deg), alt,
                   sd_e, sd_n, sd_u
    reference.csv  t and any of roll, pitch, heading (rad), v_e, v_n, v_u, lat, lon (deg), alt
    ============== =====================================================================================================

    Logs are known by their content, some need a package (``pip install 'altijax[logs]'``, ``[ros]``, ``[mdf]``):

    ============== =====================================================================================================
    u-blox UBX     ESF-RAW or ESF-MEAS with wheel ticks or speed; NAV-PVT, NAV-PVAT or NAV-VELNED
    PX4 ULog       sensor_combined, the GNSS receiver, PX4's own estimate; [logs]
    ArduPilot .bin IMU, GPS, GPA, WENC; ATT and POS as the reference; [logs]
    ROS bags       ROS 1, ROS 2, MCAP: Imu, NavSatFix with a velocity, wheel speeds by their topics, Odometry as the
                   reference; [ros]
    GoPro videos   ACCL and GYRO in camera axes (x left, y back, z up), GPS9 or GPS5; [logs]
    MDF            channels by name, such as AccX, YawRate, WheelSpeedFL, GPS_Speed, with their units; [mdf]
    KITTI          an OXTS folder; velocities and pose are one solution
    comma2k19      a segment: IMU, wheel speeds, u-blox receiver, its pose as the reference
    ============== =====================================================================================================

    A tidy folder keeps its times; the other formats start at 0 at the first IMU sample. Streams may start, stop and
    pause on their own. What is wrong but leaves the rest usable is left out with a `RecordingWarning`, which also
    becomes a note.

    Parameters
    ----------
    path : str or Path
        Folder or log file.
    axes : str, optional
        Where the sensor's x, y and z point: F or B, L or R, U or D; overrides what the recording says.
    units : mapping of str to str, optional
        Units of a tidy folder or a table where they are neither those above nor in its recording.toml, by quantity:
        ``time`` (s, ms, us, ns, min, h, d; all files), ``accelerometer`` (m/s^2, g, mg, gal; -m/s^2 and -g with the
        sign of iOS), ``gyro`` (rad/s, deg/s, mrad/s, mdeg/s, deg/h; -rad/s and -deg/s with the other sign), ``speed``
        (m/s, km/h, mph, kn, cm/s, mm/s; wheel.csv), ``gnss_speed`` (the same; velocities and their deviations in
        gnss.csv), ``course`` (deg, rad; gnss.csv), ``height`` (m, ft), ``attitude`` (rad, deg; reference.csv). What the
        table says of a unit that is stated does not count; what rests on it is no error, and warns where the streams
        say otherwise.
    columns : mapping of str to str, optional
        For one table of text in which several sensors stand, however its columns are called: the header of each of
        our columns, ``{"t": "Time", "ax": "Acc X [g]", "speed": "v (km/h)"}``. Where a name could mean several streams
        it is the wheel's or the receiver's, "gnss.speed" and "reference.alt" say otherwise. Units are taken from the
        headers or a line of units below them; separators, decimal commas, clock times and lines above the header are
        found. Each stream has the rows in which it has values.
    clock : mapping of str to float, optional
        Seconds to add to the times of a stream (imu, wheel, pulses, gnss, reference) whose clock is not that of the
        others; over what recording.toml says.

    Returns
    -------
    recording : Recording
        Streams in SI units and body axes (forward, left, up).

    Raises
    ------
    RecordingError
        If a file is damaged or its content cannot be right; it names file, line, column, what was seen and the fix.
    FileNotFoundError
        If there is nothing at `path`.
    ValueError
        If `axes`, `units`, `columns` or `clock` is not valid.
    """
    recording, problems = _read(Path(path), axes, dict(units or {}), columns, dict(clock or {}))
    tell(problems)
    return recording


def tell(problems: Collection[str]) -> None:
    """Show what was left out or looks wrong to whoever called the function that calls this one."""
    for problem in problems:
        warnings.warn(problem, RecordingWarning, stacklevel=3)


def _read(
    path: Path,
    axes: str | None,
    units: Mapping[str, str],
    columns: Mapping[str, str] | None = None,
    clock: Mapping[str, float] | None = None,
) -> tuple[Recording, list[str]]:
    check_units(units)
    unknown = [stream for stream in clock or {} if stream not in COLUMNS]
    if unknown:
        raise ValueError(f"clock has no stream {unknown[0]!r}; known are {', '.join(COLUMNS)}")
    problems: list[str] = []
    notes: list[str] = []
    with unpacked(path) as place:
        if columns is None:
            form, place = format_of(place)
            fixes_units, read = form.fixes_units, form.read
        else:
            place, fixes_units = only_file(place), False
            read = partial(read_mixed, columns, units)
        if fixes_units and units:
            raise ValueError(f"units is for a tidy folder; the format of {path} fixes its units")
        tables, sheet = read(place, problems, notes)
    sheet = {"name": place.resolve().name, **sheet}
    tables = described(tables, place, problems)
    given = dict.fromkeys(QUANTITIES) if fixes_units else units
    recording, problems = recording_of(tables, sheet, problems, notes, axes=axes, given=given, clock=clock)
    return replace(recording, source=str(path)), problems


def recording_of(
    tables: dict[str, pd.DataFrame],
    sheet: Mapping[str, Any],
    problems: list[str],
    notes: list[str],
    *,
    axes: str | None = None,
    given: Mapping[str, str | None],
    clock: Mapping[str, float] | None = None,
) -> tuple[Recording, list[str]]:
    """Streams checked, in SI units and body axes; and what is to be told.

    Parameters
    ----------
    tables : dict of str to DataFrame
        Streams by name, as `stream_checks` has tables.
    sheet : mapping
        What a recording.toml says, or would.
    problems, notes : list of str
        What reading has found so far; `problems` grows.
    axes : str, optional
        Overrides what the sheet says.
    given : mapping
        Units by quantity, over what the sheet says; None where the tables are in SI units already.
    clock : mapping, optional
        Seconds to add to the times of streams, over what the sheet says.

    Returns
    -------
    recording : Recording
        The recording, without a source.
    problems : list of str
        All problems but those that the sheet knows already.
    """
    insisted = {*given, *(f"clock {stream}" for stream in clock or {})}
    if axes is not None:
        axes_to_matrix(axes)
        insisted.add("axes")
    tables = mended_clocks(tables, problems)
    tables = {stream: without_sentinels(table, stream, problems) for stream, table in tables.items()}
    own = {quantity: unit for quantity, unit in sheet.get("units", {}).items() if quantity not in given}
    try:
        in_si_units(tables, own)
    except ValueError as error:
        raise RecordingError(f"recording.toml, {error}") from error
    in_si_units(tables, {quantity: unit for quantity, unit in given.items() if unit is not None})
    clock = {**sheet.get("clock", {}), **(clock or {})}
    tables = {stream: table.assign(t=table["t"] + clock.get(stream, 0.0)) for stream, table in tables.items()}
    stated = own.keys() | given.keys()
    if axes is None:
        axes = sheet.get("axes", "FLU")
        try:
            axes_to_matrix(axes)
        except ValueError as error:
            raise RecordingError(f"recording.toml, {error}") from error
    streams: dict[str, Any] = {}
    for stream in _STREAMS:
        table, imu = tables.get(stream), streams.get("imu")
        if stream == "wheel" and "pulses" in tables and imu is not None:
            table = wheel_from_pulses(tables["pulses"], sheet.get("wheel", {}), imu, problems)
        streams[stream] = None if table is None else final_stream(stream, table, stated, axes, problems, notes, tables)
    check_together(streams, problems)
    # What was saved was judged when it was read.
    tell_disagreements(streams, axes, None if "saved" in sheet else insisted | own.keys(), problems)
    wheel, site, saved = (sheet.get(part, {}) for part in ("wheel", "site", "saved"))
    latitude = site.get("latitude")
    for frame in streams.values():
        if frame is not None:
            frame.attrs = {}
    problems, notes = ([line for line in lines if line not in saved.get("known", ())] for lines in (problems, notes))
    recording = Recording(
        name=sheet.get("name", ""),
        description=sheet.get("description", ""),
        **streams,
        axes=axes,
        pulses_per_turn=wheel.get("pulses_per_turn"),
        wheel_radius=wheel.get("radius"),
        track_width=wheel.get("track_width"),
        site_latitude=None if latitude is None else math.radians(latitude),
        site_height=site.get("height"),
        notes=(*saved.get("notes", ()), *problems, *notes),
    )
    return recording, problems


def describe(recording: Recording) -> pd.DataFrame:
    """Rates, jitter and gaps of a recording's streams.

    Parameters
    ----------
    recording : Recording
        Any recording.

    Returns
    -------
    table : DataFrame
        One row a stream: number of samples; rate in Hz (rows over their time, pauses aside); dt_5 and dt_95, the 5 %
        and 95 % quantiles of the interval in s; number of gaps (intervals above three medians) and the longest in s;
        first and last time and duration in s; columns.
    """
    rows = {}
    for stream in _STREAMS:
        frame = getattr(recording, stream)
        if frame is None:
            continue
        t = frame.index.to_numpy(float)
        dt = np.diff(t)
        usual = np.median(dt) if dt.size else np.nan
        gaps = dt[dt > 3 * usual]
        pauses = dt[dt > 3 * max(usual, dt.mean())] if dt.size else dt
        low, high = np.quantile(dt, [0.05, 0.95]) if dt.size else (np.nan, np.nan)
        rows[stream] = {
            "samples": len(t),
            "rate": (dt.size - pauses.size) / (dt.sum() - pauses.sum()) if dt.size else np.nan,
            "dt_5": low,
            "dt_95": high,
            "gaps": len(gaps),
            "longest_gap": gaps.max(initial=0.0),
            "first": t[0],
            "last": t[-1],
            "duration": t[-1] - t[0],
            "columns": ", ".join(frame.columns),
        }
    return pd.DataFrame.from_dict(rows, orient="index").rename_axis("stream")


def _degrees(latitude: float | None) -> float | None:
    """Degrees from which reading gets the same radians, where there are such."""
    if latitude is None:
        return None
    near = math.degrees(latitude)
    candidates = [near, math.nextafter(near, -math.inf), math.nextafter(near, math.inf)]
    return min(candidates, key=lambda degrees: abs(math.radians(degrees) - latitude))


def _formatted(recording: Recording) -> pd.DataFrame:
    table = describe(recording)
    forms = {"rate": "{:.1f} Hz", "dt_5": "{:.4f} s", "dt_95": "{:.4f} s", "longest_gap": "{:.2f} s"}
    forms |= dict.fromkeys(("first", "last", "duration"), "{:.2f} s")
    return table.assign(**{name: table[name].map(form.format) for name, form in forms.items() if len(table)})


def _shown(agreement: pd.DataFrame) -> pd.DataFrame:
    """The report for reading: rounded, and nothing where there is nothing."""
    numbers = agreement.columns.drop(["verdict", "cause", "remedy"])
    return agreement.assign(
        **{name: ["" if pd.isna(value) else f"{value:.2f}" for value in agreement[name]] for name in numbers}
    ).rename_axis(None)
