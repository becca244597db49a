"""Reading recordings: what comes out of good files, and what is said about bad ones."""

import itertools
import subprocess
import sys
import warnings
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from altijax.recordings import Recording, RecordingError, RecordingWarning, axes_to_matrix, describe, read_recording
from altijax.rotations import euler_to_matrix, heading_to_yaw

RIGHT_HANDED = [
    "".join(code)
    for code in itertools.product("FBLRUD", repeat=3)
    if np.linalg.det([[(c in p) * (1 - 2 * p.index(c) if c in p else 0) for p in ("FB", "LR", "UD")] for c in code]) > 0
]


@pytest.fixture
def drive() -> dict[str, pd.DataFrame]:
    """A car at 10 m/s through bends: tables as they stand in the files, in SI units, forward, left, up."""

    def yaw(t: np.ndarray) -> np.ndarray:
        return 0.3 + 0.9 * (1 - np.cos(2 * np.pi * t / 20))

    t = np.arange(0, 60, 0.02)
    rate = 0.9 * 2 * np.pi / 20 * np.sin(2 * np.pi * t / 20)
    rng = np.random.default_rng(0)
    noise = rng.normal(scale=0.05, size=(t.size, 6))
    imu = pd.DataFrame(noise + np.stack([0 * t, 10 * rate, 0 * t + 9.8, 0 * t, 0 * t, rate], -1))
    imu.columns = ["ax", "ay", "az", "gx", "gy", "gz"]
    imu.insert(0, "t", t)
    t_gnss = np.arange(1.0, 59, 0.2)
    course = np.pi / 2 - yaw(t_gnss)
    fine = np.arange(0, 60, 0.001)
    east, north = (np.interp(t_gnss, fine, np.cumsum(0.01 * f(yaw(fine)))) for f in (np.cos, np.sin))
    gnss = pd.DataFrame({"t": t_gnss, "speed": 10.0, "course": np.degrees(course) % 360, "climb": 0.5})
    gnss["lat"], gnss["lon"], gnss["alt"] = 45 + north / 111e3, 7 + east / (111e3 * np.cos(np.pi / 4)), 200.0
    t_wheel = np.arange(0.5, 59.5, 0.05)
    wheel = pd.DataFrame({"t": t_wheel, "left": 9.9, "right": 10.1 + 0.01 * np.sin(t_wheel)})
    reference = pd.DataFrame({"t": t_gnss, "roll": 0.0, "pitch": 0.05, "heading": course, "alt": 200 + 0.5 * t_gnss})
    return {"imu": imu, "gnss": gnss, "wheel": wheel, "reference": reference}


def write(folder: Path, tables: dict[str, pd.DataFrame], sheet: str = "") -> Path:
    folder.mkdir(exist_ok=True)
    for stream, table in tables.items():
        table.to_csv(folder / f"{stream}.csv", index=False)
    (folder / "recording.toml").write_text(sheet)
    return folder


def test_a_tidy_folder_becomes_streams_with_its_own_times(tmp_path, drive):
    sheet = (
        'name = "bends"\ndescription = "made up"\naxes = "FLU"\n'
        "[wheel]\npulses_per_turn = 48\nradius = 0.3\ntrack_width = 1.5\n[site]\nlatitude = 45\nheight = 200.0\n"
    )
    r = read_recording(write(tmp_path, drive, sheet))
    assert (r.name, r.description, r.axes, r.source) == ("bends", "made up", "FLU", str(tmp_path))
    assert (r.pulses_per_turn, r.wheel_radius, r.track_width, r.site_height) == (48, 0.3, 1.5, 200)
    assert r.site_latitude == pytest.approx(np.pi / 4)
    assert r.notes == ()
    pd.testing.assert_frame_equal(r.imu, drive["imu"].set_index("t"), check_exact=True)
    pd.testing.assert_frame_equal(r.reference, drive["reference"].set_index("t"), check_exact=True)
    assert list(r.wheel.columns) == ["speed", "left", "right"]
    np.testing.assert_allclose(r.wheel["speed"], (r.wheel["left"] + r.wheel["right"]) / 2, rtol=1e-15)
    assert list(r.gnss.columns) == ["v_e", "v_n", "v_u", "lat", "lon", "alt"]
    for frame in (r.imu, r.wheel, r.gnss, r.reference):
        assert frame.index.name == "t" and frame.index.dtype == np.float64


def test_only_the_imu_is_needed(tmp_path, drive):
    r = read_recording(write(tmp_path / "alone", {"imu": drive["imu"][["t", "ax", "ay", "az"]]}))
    assert r.name == "alone" and r.axes == "FLU"
    assert list(r.imu.columns) == ["ax", "ay", "az"]
    assert r.wheel is None and r.gnss is None and r.reference is None and r.site_latitude is None


def test_velocity_comes_from_speed_course_and_climb(tmp_path, drive):
    gnss = drive["gnss"]
    r = read_recording(write(tmp_path, drive))
    course = np.radians(gnss["course"].to_numpy())
    np.testing.assert_allclose(r.gnss["v_e"], 10 * np.sin(course), atol=1e-14)
    np.testing.assert_allclose(r.gnss["v_n"], 10 * np.cos(course), atol=1e-14)
    assert (r.gnss["v_u"] == 0.5).all()
    without = read_recording(write(tmp_path, {**drive, "gnss": gnss.drop(columns="climb")}))
    assert without.gnss["v_u"].isna().all() and without.notes == ()


def test_a_course_may_be_missing_at_rest(tmp_path, drive):
    gnss = drive["gnss"]
    gnss.loc[:4, "speed"] = 0
    gnss.loc[:4, "course"] = np.nan
    r = read_recording(write(tmp_path, drive))
    assert (r.gnss[["v_e", "v_n"]].iloc[:5] == 0).all(axis=None) and len(r.gnss) == len(gnss)


def test_velocity_components_are_kept_and_v_u_is_always_there(tmp_path, drive):
    t = drive["gnss"]["t"]
    drive["gnss"] = pd.DataFrame({"sd_e": 0.1, "v_n": 10 * np.sin(t), "v_e": 10 * np.cos(t), "t": t})
    drive["imu"] = drive["imu"].drop(columns=["gx", "gy", "gz"])
    r = read_recording(write(tmp_path, drive))
    assert list(r.gnss.columns) == ["v_e", "v_n", "v_u", "sd_e"]
    np.testing.assert_array_equal(r.gnss["v_e"], 10 * np.cos(t))
    assert r.gnss["v_u"].isna().all()


@pytest.mark.parametrize("code", RIGHT_HANDED)
def test_every_axes_code_is_undone(code, tmp_path, drive):
    sensor = drive["imu"].copy()
    for triad in (["ax", "ay", "az"], ["gx", "gy", "gz"]):
        sensor[triad] = drive["imu"][triad].to_numpy() @ axes_to_matrix(code)
    sensor = sensor.iloc[:400]
    by_file = read_recording(write(tmp_path, {"imu": sensor}, f'axes = "{code}"'))
    by_argument = read_recording(write(tmp_path, {"imu": sensor}, 'axes = "FLU"'), axes=code)
    assert by_file.axes == by_argument.axes == code
    for r in (by_file, by_argument):
        np.testing.assert_array_equal(r.imu.to_numpy(), drive["imu"].drop(columns="t").iloc[:400].to_numpy())


def test_there_are_24_right_handed_axes_codes():
    assert len(RIGHT_HANDED) == 24 == len(set(RIGHT_HANDED))


def test_a_bad_axes_code_in_the_file_names_the_file(tmp_path, drive):
    with pytest.raises(RecordingError, match=r"recording.toml, axes 'FRU' is left-handed; .*FRD"):
        read_recording(write(tmp_path, drive, 'axes = "FRU"'))
    with pytest.raises(ValueError, match="axes 'FFU' needs one letter of each pair"):
        read_recording(tmp_path, axes="FFU")


G = 9.80665


@pytest.mark.parametrize(
    ("stream", "columns", "key", "unit", "size"),
    [
        ("imu", ["ax", "ay", "az"], "accelerometer", "g", G),
        ("imu", ["ax", "ay", "az"], "accelerometer", "mg", G / 1000),
        ("imu", ["ax", "ay", "az"], "accelerometer", "gal", 0.01),
        ("imu", ["gx", "gy", "gz"], "gyro", "deg/s", np.pi / 180),
        ("wheel", ["left", "right"], "speed", "km/h", 1 / 3.6),
        ("wheel", ["left", "right"], "speed", "mph", 0.44704),
        ("gnss", ["speed", "climb"], "gnss_speed", "kn", 1852 / 3600),
        ("gnss", ["course"], "course", "rad", 180 / np.pi),
        ("reference", ["roll", "pitch", "heading"], "attitude", "deg", np.pi / 180),
    ],
)
def test_units_are_undone(stream, columns, key, unit, size, tmp_path, drive):
    expected = read_recording(write(tmp_path, drive))
    drive[stream][columns] = drive[stream][columns] / size
    r = read_recording(write(tmp_path, drive), units={key: unit})
    pd.testing.assert_frame_equal(getattr(r, stream), getattr(expected, stream), rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize(("unit", "factor"), [("ms", 1e3), ("us", 1e6), ("ns", 1e9)])
def test_the_unit_of_time_holds_for_every_file(unit, factor, tmp_path, drive):
    for table in drive.values():
        table["t"] *= factor
    with pytest.raises(RecordingError, match=rf"imu.csv, column t: rows are .* s apart.*'time': '{unit}'"):
        read_recording(write(tmp_path, drive))
    r = read_recording(tmp_path, units={"time": unit})
    for frame, step in ((r.imu, 0.02), (r.gnss, 0.2), (r.wheel, 0.05), (r.reference, 0.2)):
        assert np.median(np.diff(frame.index)) == pytest.approx(step)


def test_a_fast_imu_in_milliseconds_is_noticed(tmp_path, drive):
    drive["imu"]["t"] = np.arange(len(drive["imu"]), dtype=float)
    with pytest.raises(
        RecordingError,
        match=r"imu.csv, column t: rows are 1 s apart, each by exactly 1: t counts samples.*'time': 'ms'",
    ):
        read_recording(write(tmp_path, drive))
    assert len(read_recording(tmp_path, units={"time": "s"}).imu) == 3000


def test_one_file_in_milliseconds_is_named(tmp_path, drive):
    drive["gnss"]["t"] *= 1000
    with pytest.raises(RecordingError, match=r"gnss.csv, column t: rows are 200 s apart"):
        read_recording(write(tmp_path, drive))


@pytest.mark.parametrize(
    ("stream", "columns", "factor", "message"),
    [
        ("imu", ["ax", "ay", "az"], 1 / G, r"imu.csv, columns ax.*\|a\| is 1.* looks like g:.*'accelerometer': 'g'"),
        ("imu", ["ax", "ay", "az"], 100, r"imu.csv.*looks like mg.*'accelerometer': 'mg'"),
        ("imu", ["gx", "gy", "gz"], 180 / np.pi, r"imu.csv, columns gx, gy, gz.*deg/s.*'gyro': 'deg/s'"),
        ("wheel", ["left", "right"], 3.6, r"wheel.csv: .*3.6 times.*looks like km/h.*'speed'"),
        ("wheel", ["left", "right"], 2.2369, r"wheel.csv: .*looks like mph"),
        ("gnss", ["speed"], 3600 / 1852, r"gnss.csv: .*looks like kn.*'gnss_speed': 'kn'"),
        ("reference", ["heading"], 180 / np.pi, r"reference.csv, column heading: it reaches .*'attitude': 'deg'"),
        ("gnss", ["course"], np.pi / 180, r"gnss.csv, column course: values up to .*'course': 'rad'"),
    ],
)
def test_a_wrong_unit_is_named_with_its_fix_unless_it_was_stated(stream, columns, factor, message, tmp_path, drive):
    if columns == ["course"]:
        drive["imu"] = drive["imu"].drop(columns=["gx", "gy", "gz"])
    drive[stream][columns] *= factor
    with pytest.raises(RecordingError, match=message) as error:
        read_recording(write(tmp_path, drive))
    key = str(error.value).split("units={'")[1].split("'")[0]
    si = {
        "accelerometer": "m/s^2",
        "gyro": "rad/s",
        "speed": "m/s",
        "gnss_speed": "m/s",
        "course": "deg",
        "attitude": "rad",
    }[key]
    if key in ("speed", "gnss_speed", "gyro", "attitude"):
        with warnings.catch_warnings():
            # What was stated is believed, though not without a word.
            warnings.simplefilter("ignore", RecordingWarning)
            assert getattr(read_recording(tmp_path, units={key: si}), stream) is not None


def test_a_quiet_gyro_in_degrees_is_found_by_the_turns(tmp_path, drive):
    quiet = drive["imu"].copy()
    quiet[["gx", "gy"]] = 0.0
    slow = 0.15
    quiet["gz"] *= slow * 180 / np.pi
    drive["imu"] = quiet
    drive["gnss"]["course"] = np.unwrap(drive["gnss"]["course"], period=360) * slow
    drive["gnss"] = drive["gnss"].drop(columns=["lat", "lon"])
    with pytest.raises(RecordingError, match=r"imu.csv: by 'turning and course' its gyro is 57.* looks like deg/s"):
        read_recording(write(tmp_path, drive))
    assert read_recording(tmp_path, units={"gyro": "deg/s"}).notes == ()


def test_a_gyro_with_the_wrong_sign_is_named(tmp_path, drive):
    drive["imu"]["gz"] *= -1
    with pytest.raises(RecordingError, match=r"column gz: the gyro turns -1.* to the other side"):
        read_recording(write(tmp_path, drive))


@pytest.mark.parametrize(
    ("code", "better"), [("FRD", "FLU"), ("FLU", None), ("BLD", "BRU"), ("LBU", None), ("FUR", "FLU"), ("UFL", "RFU")]
)
def test_gravity_that_is_not_up_suggests_a_code_that_puts_it_there(code, better, tmp_path, drive):
    folder = write(tmp_path, {"imu": drive["imu"]})
    if better is None:
        assert read_recording(folder, axes=code).notes == ()
        return
    with pytest.warns(RecordingWarning, match=rf"imu.csv, columns ax, ay, az: with axes='{code}'.*axes='{better}'"):
        read_recording(folder, axes=code)
    assert read_recording(folder, axes=better).imu["az"].mean() > 9


def test_linear_acceleration_is_suspected(tmp_path, drive):
    drive["imu"]["az"] -= 9.5
    with pytest.warns(RecordingWarning, match="specific force is wanted"):
        read_recording(write(tmp_path, drive))


def test_a_clock_that_starts_again_is_an_error_with_the_line(tmp_path, drive):
    drive["imu"].loc[2000:, "t"] -= drive["imu"].loc[2000, "t"]
    with pytest.raises(RecordingError, match=r"imu.csv, line 2002, column t: .*starts again, as after a restart; cut"):
        read_recording(write(tmp_path, drive))


def test_a_stamp_out_of_order_is_left_out(tmp_path, drive):
    drive["imu"].loc[10, "t"] = 0.05
    with pytest.warns(RecordingWarning, match=r"imu.csv, line 12, column t: 0.05 is out of order"):
        assert len(read_recording(write(tmp_path, drive)).imu) == len(drive["imu"]) - 1


def test_rows_repeated_are_dropped_and_different_rows_of_one_stamp_kept(tmp_path, drive):
    drive["imu"].loc[10] = drive["imu"].loc[9]
    with pytest.warns(RecordingWarning, match=r"imu.csv, line 12, column t: 0.18.* repeats the row before"):
        r = read_recording(write(tmp_path, drive))
    assert len(r.imu) == len(drive["imu"]) - 1 and r.imu.index.is_unique
    assert len(r.notes) == 1
    drive["imu"].loc[10, "ax"] += 1
    with pytest.warns(RecordingWarning, match=r"imu.csv, line 11, column t: 2 rows come at once, at 0.18"):
        r = read_recording(write(tmp_path, drive))
    assert len(r.imu) == len(drive["imu"]) and r.imu.index[[9, 10]].to_list() == pytest.approx([0.17, 0.18])


def test_rows_without_a_value_are_dropped_and_named(tmp_path, drive):
    drive["imu"].loc[[5, 6], "ay"] = np.nan
    drive["imu"].loc[7, "gz"] = np.inf
    with pytest.warns(RecordingWarning) as seen:
        r = read_recording(write(tmp_path, drive))
    text = [str(w.message) for w in seen]
    assert all(w.filename == __file__ for w in seen) and r.notes == tuple(text)
    assert any("imu.csv, line 7, column ay: nan is not a number; rows like it: 2 of 3000, dropped" in m for m in text)
    assert any("imu.csv, line 9, column gz: inf is not a number; rows like it: 1 of 3000, dropped" in m for m in text)
    assert len(r.imu) == 2997 and np.isfinite(r.imu.to_numpy()).all()


def test_optional_values_may_be_missing(tmp_path, drive):
    drive["gnss"].loc[3, "lat"] = np.nan
    with pytest.warns(RecordingWarning, match=r"gnss.csv, line 5, column lat: nan .* kept as missing"):
        r = read_recording(write(tmp_path, drive))
    assert len(r.gnss) == len(drive["gnss"]) and r.gnss["lat"].isna().sum() == 1


def test_streams_that_do_not_overlap_are_left_out(tmp_path, drive):
    drive["wheel"]["t"] += 1000
    with pytest.warns(
        RecordingWarning, match=r"wheel.csv: its times 1000.500 to .* overlap .* imu.csv, 0.000 to 59.980 s"
    ):
        r = read_recording(write(tmp_path, drive))
    assert r.wheel is None and r.gnss is not None


def test_an_empty_stream(tmp_path, drive):
    drive["gnss"] = drive["gnss"].iloc[:0]
    drive["wheel"] = drive["wheel"].iloc[:1]
    with pytest.warns(RecordingWarning) as seen:
        r = read_recording(write(tmp_path, drive))
    text = " ".join(str(w.message) for w in seen)
    assert "gnss.csv: has no rows" in text and "wheel.csv: has 1 usable row(s) and needs 2" in text
    assert r.gnss is None and r.wheel is None
    with pytest.raises(RecordingError, match=r"imu.csv: has no rows"):
        read_recording(write(tmp_path, {"imu": drive["imu"].iloc[:0]}))
    with pytest.raises(RecordingError, match=r"imu.csv: has 1 usable row"):
        read_recording(write(tmp_path, {"imu": drive["imu"].iloc[:1]}))


def test_missing_columns(tmp_path, drive):
    with pytest.raises(
        RecordingError, match=r"imu.csv: needs the columns ax and ay and az besides t and has t, ax, ay"
    ):
        read_recording(write(tmp_path, {"imu": drive["imu"][["t", "ax", "ay"]]}))
    drive["gnss"] = drive["gnss"][["t", "speed", "alt"]]
    with pytest.warns(
        RecordingWarning, match=r"gnss.csv: needs the columns v_e and v_n, or speed and course besides t"
    ):
        assert read_recording(write(tmp_path, drive)).gnss is None
    with pytest.warns(RecordingWarning, match=r"imu.csv: of the gyro only gz there"):
        r = read_recording(write(tmp_path / "new", {"imu": drive["imu"].drop(columns=["gx", "gy"])}))
    assert list(r.imu.columns) == ["ax", "ay", "az"]


@pytest.mark.parametrize(
    ("change", "likely"),
    [
        (lambda g: g.assign(lat=g["lat"] * 1e7, lon=g["lon"] * 1e7), "1e-7 deg"),
        (lambda g: g.assign(lat=g["lon"] - 120, lon=g["lat"]), "swapped"),
    ],
)
def test_impossible_positions_are_left_out(change, likely, tmp_path, drive):
    drive["gnss"] = change(drive["gnss"])
    with pytest.warns(RecordingWarning, match=rf"gnss.csv, columns lat, lon: .*left out.*{likely}"):
        r = read_recording(write(tmp_path, drive))
    assert list(r.gnss.columns) == ["v_e", "v_n", "v_u", "alt"]


def test_what_is_not_a_recording(tmp_path, drive):
    with pytest.raises(FileNotFoundError, match="there is no file or folder"):
        read_recording(tmp_path / "nowhere")
    (tmp_path / "log.bin").write_bytes(b"")
    with pytest.raises(RecordingError, match=r"not a recording: expected a folder with imu.csv.*found log.bin"):
        read_recording(tmp_path)
    with pytest.raises(RecordingError, match=r"log.bin is not a recording.*found a file"):
        read_recording(tmp_path / "log.bin")
    with pytest.raises(RecordingError, match=r"imu.csv .* is missing; found .*gnss.csv"):
        read_recording(write(tmp_path, {"gnss": drive["gnss"]}))


def test_describe_counts_gaps_and_jitter():
    t = np.concatenate([np.arange(0, 1, 0.1), np.arange(2, 3, 0.1), [3.2]])
    r = Recording(name="gappy", imu=pd.DataFrame({"ax": 0.0}, index=pd.Index(t, name="t")))
    row = describe(r).loc["imu"]
    assert (row["samples"], row["gaps"], row["columns"]) == (21, 1, "ax")
    assert row["rate"] == pytest.approx(19 / 2.1) and row["longest_gap"] == pytest.approx(1.1)
    assert (row["first"], row["last"], row["duration"]) == (0, 3.2, 3.2)
    assert row["dt_5"] == pytest.approx(0.1) and row["dt_95"] == pytest.approx(np.quantile(np.diff(t), 0.95))
    assert describe(Recording()).empty


def test_shown_as_text_and_html(tmp_path, drive):
    r = read_recording(write(tmp_path, drive, 'name = "<b>&"\ndescription = "a <script>"'))
    page = r._repr_html_()
    assert "&lt;b&gt;&amp;" in page and "<script>" not in page and "50.0 Hz" in page
    assert len(page) < 5000
    assert all(stream in repr(r) for stream in ("imu", "wheel", "gnss", "reference", "50.0 Hz", "59.98 s"))
    assert "note: wheel.csv: left out" in repr(Recording(notes=("wheel.csv: left out",)))


def test_importing_the_package_does_not_import_pandas():
    code = "import altijax, sys; assert 'pandas' not in sys.modules and 'matplotlib' not in sys.modules"
    subprocess.run([sys.executable, "-c", code], check=True)


def test_comma2k19_has_the_facts_that_were_measured_on_it(data_dir):
    with pytest.warns(RecordingWarning) as seen:
        r = read_recording(data_dir / "comma2k19-example")
    assert [str(w.message).split(",")[0] for w in seen] == [
        "processed_log/IMU/magnetometer_uncalibrated/value: cut short"
    ]
    assert "1776 elements expected and 1712 got" in r.notes[0]
    assert r.axes == "FRD" and r.imu.index[0] == 0
    assert describe(r)["rate"].to_list() == pytest.approx([104.3, 82.9, 9.7, 20.0], abs=0.1)
    assert 9.6 < r.imu["az"].mean() < 9.8
    assert r.wheel["speed"].min() > 7
    height = r.reference["alt"] - r.reference["alt"].iloc[0]
    # The Earth's curvature takes 1011 m squared over two radii, 8 cm, from what was measured in the plane of the start.
    assert height.iloc[-1] - 0.08 == pytest.approx(7.94, abs=0.05)
    assert height.min() == pytest.approx(-10.7, abs=0.05)
    assert np.trapezoid(r.reference["v_u"], r.reference.index) == pytest.approx(height.iloc[-1], abs=0.05)
    v = r.reference[["v_e", "v_n", "v_u"]].to_numpy()
    speed = np.linalg.norm(v, axis=1)
    inside = (r.reference.index >= r.wheel.index[0]) & (r.reference.index <= r.wheel.index[-1])
    by_wheel = np.interp(r.reference.index[inside], r.wheel.index, r.wheel["speed"])
    assert speed[inside].mean() / by_wheel.mean() == pytest.approx(1.0087, abs=0.0005)
    yaw = heading_to_yaw(r.reference["heading"].to_numpy())
    C_nb = euler_to_matrix(np.stack([r.reference["roll"], r.reference["pitch"], yaw], -1))
    ahead, left, up = np.einsum("tji,tj->it", C_nb, v)
    # The sensor looks 3.8 degrees below and 0.9 degrees to the left of where it goes.
    assert np.degrees(np.arctan2(up, ahead)).mean() == pytest.approx(3.80, abs=0.1)
    assert np.degrees(np.arctan2(left, ahead)).mean() == pytest.approx(-0.9, abs=0.1)
    assert np.degrees(r.reference["roll"]).mean() == pytest.approx(1.2, abs=0.1)
    by_gnss = np.interp(r.reference.index, r.gnss.index, np.hypot(r.gnss["v_e"], r.gnss["v_n"]))
    assert np.median(by_gnss / speed) == pytest.approx(1, abs=0.03)


@pytest.mark.parametrize("name", ["rtk-drive", "umn-thor75", "dresden-motorbike"])
def test_tidy_recordings_read_without_a_warning(name, data_dir):
    r = read_recording(data_dir / name)
    assert r.name == name and r.notes == ()
    assert 9 < r.imu["az"].mean() < 11
    assert (r.reference is None) == (name == "dresden-motorbike")
    assert r.gnss["v_u"].isna().all() == (name == "dresden-motorbike")


@pytest.mark.parametrize("name", ["rtk-drive", "umn-thor75", "dresden-motorbike"])
def test_a_gyro_in_degrees_is_noticed_on_real_drives(name, data_dir, tmp_path):
    tables = {stream: pd.read_csv(data_dir / name / f"{stream}.csv.gz") for stream in ("imu", "gnss")}
    tables["imu"][["gx", "gy", "gz"]] *= 180 / np.pi
    sheet = (data_dir / name / "recording.toml").read_text()
    with pytest.raises(RecordingError, match="deg/s"):
        read_recording(write(tmp_path, tables, sheet))
