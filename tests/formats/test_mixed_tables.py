"""One table of several sensors, whatever its columns are called."""

import numpy as np
import pandas as pd
import pytest

from altijax.recordings import RecordingError, RecordingWarning, read_recording

T = np.arange(0, 20, 0.01)
RNG = np.random.default_rng(0)
F = 0.05 * RNG.normal(size=(T.size, 3)) + [0, 0, 9.8]
W = 0.05 * RNG.normal(size=(T.size, 3))


def test_one_table_of_matlab(tmp_path):
    # The receiver's values are held for a second, the wheel's are there every 0.1 s.
    table = pd.DataFrame({"time_ms": 1000 * T})
    table[["accX", "accY", "accZ"]], table[["p", "q", "r"]] = F, W
    table["wheel (km/h)"] = np.where(np.arange(T.size) % 10 == 0, 36.0, np.nan)
    k = np.floor(T + 1e-9)
    table = table.assign(latitude=45 + 1e-5 * k, longitude=11.0, gps=10 + 0.1 * k, heading=90.0)
    table.to_csv(tmp_path / "drive.csv", index=False)
    columns = {"t": "time_ms", "ax": "accX", "ay": "accY", "az": "accZ", "gx": "p", "gy": "q", "gz": "r"}
    columns |= {
        "wheel.speed": "wheel (km/h)",
        "lat": "latitude",
        "lon": "longitude",
        "speed": "gps",
        "course": "heading",
    }
    r = read_recording(tmp_path / "drive.csv", columns=columns, units={"time": "ms"})
    assert r.name == "drive"
    np.testing.assert_allclose(r.imu.index, T, atol=1e-9)
    np.testing.assert_allclose(r.imu, np.concatenate([F, W], 1), rtol=1e-12)
    assert len(r.wheel) == 200 and (r.wheel["speed"] == 10).all()
    np.testing.assert_allclose(r.gnss.index, np.arange(20), atol=1e-9)
    np.testing.assert_allclose(r.gnss["v_e"], 10 + 0.1 * np.arange(20))
    assert any("column 'wheel (km/h)': read as km/h" in note for note in r.notes)
    with pytest.raises(RecordingError, match=r"drive.csv, imu, column t: rows are 10 s apart.*'ms'"):
        read_recording(tmp_path / "drive.csv", columns=columns)


def test_one_table_of_excel(tmp_path):
    lines = ["Messung;Auto;;;", "", "Zeit;Acc X;Acc Y;Acc Z;v", "hh:mm:ss;g;g;g;km/h"]
    clock = [
        (pd.Timestamp("2025-11-24 23:59:55") + pd.Timedelta(round(1e3 * s), "ms")).strftime("%H:%M:%S,%f") for s in T
    ]
    for k, (time, f) in enumerate(zip(clock, F / 9.80665, strict=True)):
        lines.append(";".join([time[:-3], *(f"{value:.6f}".replace(".", ",") for value in f), "" if k % 10 else "7,2"]))
    (tmp_path / "auto.csv").write_text("\n".join(lines), encoding="cp1252")
    columns = {"t": "Zeit", "ax": "Acc X", "ay": "Acc Y", "az": "Acc Z", "speed": "v"}
    r = read_recording(tmp_path / "auto.csv", columns=columns)
    np.testing.assert_allclose(r.imu.index, T, atol=1e-6)
    np.testing.assert_allclose(r.imu, F, atol=1e-5)
    assert len(r.wheel) == 200 and r.wheel["speed"].iloc[0] == 2
    # What is stated goes before what the table says.
    stated = read_recording(tmp_path / "auto.csv", columns=columns, units={"speed": "m/s"})
    assert stated.wheel["speed"].iloc[0] == 7.2


def test_an_outer_merge_is_taken_apart(tmp_path):
    a = pd.DataFrame(F, columns=["ax", "ay", "az"]).assign(t=T)
    g = pd.DataFrame({"t": T + 0.003, "gx": 0.0, "gy": 0.0, "gz": np.sin(T + 0.003)})
    merged = a.merge(g, on="t", how="outer")
    merged.to_csv(tmp_path / "one.csv", index=False)
    (tmp_path / "tidy").mkdir()
    merged.to_csv(tmp_path / "tidy" / "imu.csv", index=False)
    for path in (tmp_path / "one.csv", tmp_path / "tidy"):
        r = read_recording(path)
        assert len(r.imu) == T.size - 1 and any("as after an outer merge" in note for note in r.notes)
        np.testing.assert_allclose(r.imu[["ax", "ay", "az"]], F[1:])
        np.testing.assert_allclose(r.imu["gz"], np.sin(T[1:]), atol=2e-5)


def test_names_that_are_wrong(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("time;x;y;z\n" + "0;0;0;9,8\n1;0;0;9,8\n")
    for columns, said in (
        ({"t": "time", "ax": "X"}, r"a.csv has no column 'X'; its columns are 'time', 'x', 'y', 'z'"),
        ({"t": "time", "height": "x"}, r"columns has no name 'height'; known are imu: t, ax"),
        ({"t": "time", "imu.speed": "x"}, r"columns has no name 'imu.speed'"),
        ({"ax": "x"}, r"columns names no time; add 't'"),
        ({"t": "time"}, r"columns names a time only"),
    ):
        with pytest.raises(ValueError, match=said):
            read_recording(path, columns=columns)
    with pytest.raises(RecordingError, match=r"found a file with the columns 'time', 'x', 'y', 'z'; say what they are"):
        read_recording(path)
    (tmp_path / "b.csv").write_text("")
    with pytest.raises(RecordingError, match=r"b.csv: there is no table of numbers in it"):
        read_recording(tmp_path / "b.csv", columns={"t": "t", "ax": "x"})
    with pytest.raises(ValueError, match=r"columns is for one table; .* holds a.csv, b.csv"):
        read_recording(tmp_path, columns={"t": "t", "ax": "x"})
    with pytest.raises(FileNotFoundError):
        read_recording(tmp_path / "nowhere.csv", columns={"t": "t", "ax": "x"})


def test_a_unit_that_nobody_knows_and_a_stream_without_a_value(tmp_path):
    table = pd.DataFrame({"time [s]": T, "x [LSB]": F[:, 0], "y": F[:, 1], "z": F[:, 2], "v": np.nan, "old": T})
    table.to_csv(tmp_path / "a.csv", index=False)
    columns = {"t": "time [s]", "ax": "x [LSB]", "ay": "y", "az": "z", "speed": "v", "gnss.t": "old"}
    columns |= {"gnss.v_e": "y", "gnss.v_n": "y"}
    with pytest.warns(RecordingWarning) as seen:
        r = read_recording(tmp_path / "a.csv", columns=columns)
    said = " | ".join(str(w.message) for w in seen)
    assert "column 'x [LSB]': 'LSB' is not a unit of ax that is known" in said
    assert "a.csv, wheel: has no row with a value; the stream is left out" in said
    assert r.wheel is None and len(r.gnss) == T.size
