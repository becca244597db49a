"""The tidy folder's files: every form they may have, and every way they may be damaged."""

import gzip
import importlib.util

import numpy as np
import pandas as pd
import pytest

from altijax.recordings import RecordingError, RecordingWarning, read_recording

ROWS = ["t,ax,ay,az", *(f"{0.1 * k:.1f},{0.01 * k:.2f},0.2,9.8" for k in range(50))]


def imu(folder, rows=ROWS, name="imu.csv", encoding="utf-8"):
    (folder / name).write_text("\n".join(rows) + "\n", encoding=encoding)
    return folder


def with_line(number: int, text: str) -> list[str]:
    """ROWS with one line, counted from 1 as an editor does, replaced."""
    return [*ROWS[: number - 1], text, *ROWS[number:]]


def test_csv_may_be_compressed_spaced_or_marked(tmp_path):
    expected = read_recording(imu(tmp_path)).imu
    assert len(expected) == 50
    variants = {
        "gz": lambda f: (f / "imu.csv.gz").write_bytes(gzip.compress(("\n".join(ROWS)).encode())),
        "bom": lambda f: imu(f, encoding="utf-8-sig"),
        "spaces": lambda f: imu(f, [row.replace(",", " , ") for row in ROWS]),
        "blank": lambda f: imu(f, [*ROWS[:7], "", *ROWS[7:], "", ""]),
        "crlf": lambda f: (f / "imu.csv").write_bytes("\r\n".join(ROWS).encode()),
        "commas": lambda f: imu(f, [ROWS[0], *(row + "," for row in ROWS[1:])]),
    }
    for name, make in variants.items():
        folder = tmp_path / name
        folder.mkdir()
        make(folder)
        pd.testing.assert_frame_equal(read_recording(folder).imu, expected, check_exact=True)


def test_the_sheet_states_units_and_clock_and_the_call_overrides_it(tmp_path):
    expected = read_recording(imu(tmp_path)).imu
    imu(tmp_path, [ROWS[0], *(f"{100 * k},{0.01 * k:.2f},0.2,9.8" for k in range(50))])
    (tmp_path / "recording.toml").write_text("[units]\ntime = 'ms'\n[clock]\nimu = 18.0\n")
    stated = read_recording(tmp_path).imu
    np.testing.assert_allclose(stated.index, expected.index + 18, rtol=1e-15)
    over = read_recording(tmp_path, units={"time": "us", "accelerometer": "g"}).imu
    np.testing.assert_allclose(over.index, expected.index / 1000 + 18, rtol=1e-15)
    np.testing.assert_allclose(over["az"], 9.8 * 9.80665)


def test_parquet_is_read_or_says_what_is_missing(tmp_path):
    if importlib.util.find_spec("pyarrow"):
        frame = pd.DataFrame({"ax": 0.0, "ay": 0.0, "az": 9.8}, index=pd.Index(np.arange(7) * 0.1, name="t"))
        frame.to_parquet(tmp_path / "imu.parquet")
        pd.testing.assert_frame_equal(read_recording(tmp_path).imu, frame)
        return
    (tmp_path / "imu.parquet").write_bytes(b"PAR1")
    with pytest.raises(RecordingError, match=r"imu.parquet: reading Parquet needs pyarrow"):
        read_recording(tmp_path)


@pytest.mark.parametrize(
    ("line", "text", "message"),
    [
        (17, "1.5,oops,0.2,9.8", r"imu.csv, line 17, column ax: 'oops' is not a number"),
        (17, "noon,0,0.2,9.8", r"imu.csv, line 17, column t: 'noon' is not a number"),
        (
            51,
            '4.9,"0,2",0.2,9.8',
            r"imu.csv, line 51, column ax: '0,2' is not a number; write a plain number with a point",
        ),
        (17, "1.5,0,0.2,True", r"imu.csv, line 17, column az: 'True' is not a number"),
        (17, "1.5,0,0.2,9.8,7", r"imu.csv: Expected 4 fields in line 17, saw 5; give every row as many"),
        (1, "ax,ay,az,time", r"imu.csv, line 1: there is no column t among ax, ay, az, time"),
        (1, "0,0,0.2,9.8", r"imu.csv, line 1: there is no column t among .*; the first line must name the columns"),
    ],
)
def test_a_bad_line_is_named_with_what_it_holds(line, text, message, tmp_path):
    with pytest.raises(RecordingError, match=message):
        read_recording(imu(tmp_path, with_line(line, text)))


def test_a_line_with_too_few_values_is_dropped_and_named(tmp_path):
    with pytest.warns(RecordingWarning, match=r"imu.csv, line 17, column az: nan is not a number; .*dropped"):
        assert len(read_recording(imu(tmp_path, with_line(17, "1.5,0,0.2"))).imu) == 49


def test_semicolons_without_a_column_t(tmp_path):
    with pytest.raises(RecordingError, match=r"no column t among s;ax;ay;az; separate columns by commas"):
        read_recording(imu(tmp_path, [row.replace(",", ";").replace("t", "s") for row in ROWS]))


def test_rows_all_longer_than_the_header(tmp_path):
    with pytest.raises(RecordingError, match=r"imu.csv: its rows have more values than line 1 has names"):
        read_recording(imu(tmp_path, [ROWS[0], *(row + ",1" for row in ROWS[1:])]))


@pytest.mark.parametrize("keep", [20, 150])
def test_a_truncated_gz_file_is_an_error(keep, tmp_path):
    rows = "\n".join([ROWS[0], *(f"{k},{np.sin(k):.9f},0.2,9.8" for k in range(500))])
    (tmp_path / "imu.csv.gz").write_bytes(gzip.compress(rows.encode())[:keep])
    with pytest.raises(RecordingError, match=r"imu.csv.gz: damaged or cut short"):
        read_recording(tmp_path)


def test_files_that_are_not_what_they_are_called(tmp_path):
    (tmp_path / "imu.csv.gz").write_text("\n".join(ROWS))
    with pytest.raises(RecordingError, match=r"imu.csv.gz: damaged or cut short \(Not a gzipped file"):
        read_recording(tmp_path)
    (tmp_path / "imu.csv.gz").unlink()
    with pytest.raises(RecordingError, match=r"imu.csv: not UTF-8 text"):
        read_recording(imu(tmp_path, encoding="utf-16"))
    (tmp_path / "imu.csv").write_bytes(b"")
    with pytest.raises(RecordingError, match=r"imu.csv: has no rows"):
        read_recording(tmp_path)


def test_two_files_for_one_stream(tmp_path):
    imu(tmp_path)
    (tmp_path / "imu.csv.gz").write_bytes(gzip.compress("\n".join(ROWS).encode()))
    with pytest.raises(RecordingError, match=r"imu.csv, imu.csv.gz all hold the stream 'imu'; keep one"):
        read_recording(tmp_path)


def test_unknown_columns_are_named_once_and_ignored(tmp_path):
    rows = [ROWS[0] + ",pressure,humidity", *(row + ",1013,50" for row in ROWS[1:])]
    with pytest.warns(RecordingWarning) as seen:
        r = read_recording(imu(tmp_path, rows))
    assert len(seen) == 1 and "imu.csv: unknown columns pressure, humidity ignored" in str(seen[0].message)
    assert list(r.imu.columns) == ["ax", "ay", "az"] and r.notes == (str(seen[0].message),)


@pytest.mark.parametrize(
    ("sheet", "message"),
    [
        ("name = ", r"recording.toml: Invalid value \(at .*\); correct that line"),
        ("name = 7", r"recording.toml, name: 7 is not a text"),
        ("wheel = 3", r"recording.toml, wheel: 3 is not a table"),
        ("[wheel]\nradius = 'big'", r"recording.toml, wheel.radius: 'big' is not a number"),
        ("[wheel]\nradius = 0", r"recording.toml, wheel.radius: 0 is not positive"),
        ("[site]\nlatitude = 123.0", r"recording.toml, site.latitude: 123.0 is not a latitude"),
        ("[site]\nlatitude = true", r"recording.toml, site.latitude: True is not a number"),
        ("[site]\nlatitude = nan", r"recording.toml, site.latitude: nan is not a number; .* or leave out what is not"),
        ("[site]\nheight = inf", r"recording.toml, site.height: inf is not a number"),
        ("[clock]\ngnss = 'late'", r"recording.toml, clock.gnss: 'late' is not a number"),
        ("[units]\ngyro = 'rpm'", r"recording.toml, units: gyro has no unit 'rpm'; known are rad/s, deg/s"),
        ("[units]\ngyro = 'deg/s'", r"recording.toml, units gives 'gyro' .* the recording has none of its columns"),
    ],
)
def test_a_bad_sheet_is_an_error(sheet, message, tmp_path):
    (tmp_path / "recording.toml").write_text(sheet)
    with pytest.raises(RecordingError, match=message):
        read_recording(imu(tmp_path))


def test_unknown_keys_of_the_sheet_are_named(tmp_path):
    (tmp_path / "recording.toml").write_text("axis = 'FRD'\n[wheel]\ndiameter = 0.6\n")
    with pytest.warns(RecordingWarning) as seen:
        read_recording(imu(tmp_path))
    assert "recording.toml: axis ignored; known are name, description, axes" in str(seen[0].message)
    assert "recording.toml [wheel]: diameter ignored; known are pulses_per_turn, radius" in str(seen[1].message)


@pytest.mark.parametrize(
    ("units", "message"),
    [
        ({"speedo": "km/h"}, r"units has no quantity 'speedo'; known are time, accelerometer, gyro, speed"),
        ({"gyro": "rpm"}, r"units: gyro has no unit 'rpm'; known are rad/s, deg/s"),
        ({"gyro": "deg/s"}, r"units gives 'gyro' in 'deg/s', but the recording has none of its columns \(imu: gx"),
        ({"speed": "km/h"}, r"units gives 'speed' in 'km/h', but the recording has none of its columns"),
    ],
)
def test_units_that_cannot_be_used(units, message, tmp_path):
    with pytest.raises(ValueError, match=message):
        read_recording(imu(tmp_path), units=units)


SHEET = "[wheel]\npulses_per_turn = 48\nradius = 0.3\n"


def pulses(folder, ways, sheet=SHEET):
    """pulses.csv of wheels whose ways are given functions of time, every 1/48 turn."""
    imu(folder, [ROWS[0], *(f"{k * 0.1:.1f},0,0,9.8" for k in range(400))])
    (folder / "recording.toml").write_text(sheet)
    t = np.linspace(0, 40, 400_001)
    advance = 2 * np.pi * 0.3 / 48
    rows = []
    for wheel, way in ways.items():
        marks = advance * np.arange(1, int(way(t)[-1] / advance) + 1)
        rows += [(time, wheel) for time in np.interp(marks, way(t), t)]
    pd.DataFrame(sorted(rows), columns=["t", "wheel"]).to_csv(folder / "pulses.csv", index=False)
    return folder


def test_pulses_become_wheel_speeds(tmp_path):
    r = read_recording(pulses(tmp_path, {"left": lambda t: 10 * t, "right": lambda t: 5 * t + 0.2 * t**2}))
    assert list(r.wheel.columns) == ["speed", "left", "right"] and r.notes == ()
    inner = r.wheel.loc[1:39]
    np.testing.assert_allclose(inner["left"], 10, rtol=0.01)
    np.testing.assert_allclose(inner["right"], 5 + 0.4 * inner.index, rtol=0.01)
    np.testing.assert_allclose(inner["speed"], (inner["left"] + inner["right"]) / 2, rtol=1e-12)
    assert (r.pulses_per_turn, r.wheel_radius) == (48, 0.3)
    assert r.wheel.index[0] == r.imu.index[0] and r.wheel.index[-1] == pytest.approx(r.imu.index[-1], abs=0.03)


def test_pulses_with_another_clock_are_left_out(tmp_path):
    pulses(tmp_path, {"left": lambda t: 10 * t})
    table = pd.read_csv(tmp_path / "pulses.csv")
    table.assign(t=table["t"] + 1.7e9).to_csv(tmp_path / "pulses.csv", index=False)
    with pytest.warns(RecordingWarning, match=r"pulses.csv: its times 1700000000.* do not overlap those of imu.csv"):
        assert read_recording(tmp_path).wheel is None


def test_no_pulse_is_standstill_also_before_the_first_and_after_the_last(tmp_path):
    r = read_recording(pulses(tmp_path, {"left": lambda t: 8 * np.clip(t - 10, 0, 20)}))
    assert (r.wheel.loc[:8.9, "speed"] == 0).all() and (r.wheel.loc[31.1:, "speed"] == 0).all()
    assert r.wheel.index[0] == 0


def test_a_long_time_without_pulses_is_standstill(tmp_path):
    r = read_recording(pulses(tmp_path, {"left": lambda t: 8 * np.minimum(t, 10) + 8 * np.maximum(t - 30, 0)}))
    assert (r.wheel.loc[11.1:28.9, "speed"] == 0).all()
    np.testing.assert_allclose(r.wheel.loc[1:9, "speed"], 8, rtol=0.01)
    np.testing.assert_allclose(r.wheel.loc[31:39, "speed"], 8, rtol=0.01)


def test_what_pulses_need(tmp_path):
    with pytest.raises(RecordingError, match=r"pulses.csv: needs radius under \[wheel\] in recording.toml"):
        read_recording(pulses(tmp_path, {"left": lambda t: 10 * t}, "[wheel]\npulses_per_turn = 48"))
    with pytest.raises(
        RecordingError, match=r"pulses.csv, line 2, column wheel: 'port' is not a wheel; use left, right"
    ):
        read_recording(pulses(tmp_path, {"port": lambda t: 10 * t}))
    with pytest.warns(RecordingWarning) as seen:
        r = read_recording(pulses(tmp_path, {"left": lambda t: 10 * t, "right": lambda t: 0.0015 * t}))
    assert "pulses.csv, column wheel: right has 1 pulse, too few" in str(seen[0].message)
    assert list(r.wheel.columns) == ["speed", "left"]


def test_wheel_speeds_win_over_pulses(tmp_path):
    pulses(tmp_path, {"left": lambda t: 10 * t})
    (tmp_path / "wheel.csv").write_text("t,speed\n0,3\n0.1,3\n0.2,4\n")
    with pytest.warns(RecordingWarning, match=r"pulses.csv: left out, because wheel.csv is there too"):
        assert read_recording(tmp_path).wheel["speed"].to_list() == [3, 3, 4]


def test_semicolons_decimal_commas_and_a_clock(tmp_path):
    lines = ["t;ax;ay;az"]
    lines += [
        f"23:59:{58 + 0.1 * k:06.3f};0,1;0,2;9,8" if k < 20 else f"00:00:{0.1 * k - 2:06.3f};0,1;0,2;9,8"
        for k in range(50)
    ]
    imu(tmp_path, lines)
    r = read_recording(tmp_path)
    np.testing.assert_allclose(r.imu.index - r.imu.index[0], 0.1 * np.arange(50), atol=1e-9)
    assert (r.imu["ax"] == 0.1).all() and (r.imu["az"] == 9.8).all()


def test_a_stream_without_one_usable_row_does_not_stop_the_rest(tmp_path):
    imu(tmp_path)
    (tmp_path / "wheel.csv").write_text("t,speed\n" + "\n".join(f"{k}," for k in range(5)))
    with pytest.warns(RecordingWarning) as seen:
        r = read_recording(tmp_path)
    assert r.wheel is None and len(r.imu) == 50
    assert any("wheel.csv: has 0 usable row(s) and needs 2" in str(w.message) for w in seen)


def test_a_value_beyond_every_quantity_is_left_out(tmp_path):
    imu(tmp_path, with_line(7, "0.5,1e308,0.2,9.8"))
    with pytest.warns(
        RecordingWarning, match=r"imu.csv, line 7, column ax: 1e\+308 stands for a value that is not known"
    ):
        assert len(read_recording(tmp_path).imu) == 49
