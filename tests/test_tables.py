"""Recordings from memory are those from files; estimates are written and come back."""

import gpxpy
import numpy as np
import pandas as pd
import pytest

from altijax.datasets import dataset_path, load_dataset
from altijax.recordings import Recording, RecordingError, RecordingWarning, read_recording
from altijax.tables import recording_from_tables, save_estimate

STREAMS = ("imu", "wheel", "gnss", "reference")
TIME = pd.Index(np.arange(50) / 10, name="t")
IMU = pd.DataFrame({"ax": 0.1, "ay": 0.2, "az": 9.8}, index=TIME)


def equal(one: Recording, other: Recording) -> bool:
    same = all(
        getattr(one, name) == getattr(other, name)
        for name in ("name", "description", "axes", "pulses_per_turn", "wheel_radius", "track_width", "site_latitude")
    )
    frames = [(getattr(one, stream), getattr(other, stream)) for stream in STREAMS]
    return (
        same
        and (one.site_height, one.notes) == (other.site_height, other.notes)
        and all(a is b if a is None else a.equals(b) and a.index.equals(b.index) for a, b in frames)
    )


def test_tables_give_what_a_folder_gives():
    folder = dataset_path("hill-road")
    read = read_recording(folder)
    tables = {s: pd.read_csv(folder / f"{s}.csv.gz") for s in ("imu", "gnss", "reference")}
    recording = recording_from_tables("hill-road", **tables, site={"latitude": 35.0, "height": 100.0})
    for stream in tables:
        pd.testing.assert_frame_equal(getattr(recording, stream), getattr(read, stream), check_exact=True)
    indexed = recording_from_tables("hill-road", **{s: table.set_index("t") for s, table in tables.items()})
    assert indexed.imu.equals(recording.imu) and indexed.site_latitude is None
    assert recording.site_latitude == np.radians(35.0) and recording.site_height == 100.0 and recording.source == ""


def test_tables_are_left_as_they_are_and_checked():
    before = IMU.copy()
    with pytest.warns(RecordingWarning, match=r"table imu: unknown columns foo ignored") as caught:
        recording = recording_from_tables("a", imu=IMU.assign(foo=1))
    assert caught[0].filename == __file__ and recording.notes
    pd.testing.assert_frame_equal(IMU, before)
    with pytest.warns(RecordingWarning, match=r"table imu, row 3, column ax: nan is not a number"):
        recording_from_tables("a", imu=IMU.assign(ax=IMU["ax"].where(IMU.index != 0.3)))


@pytest.mark.parametrize(
    ("tables", "message"),
    [
        (
            {"imu": IMU.reset_index(drop=True)},
            r"table imu: there is no column or index t, in s, among ax, ay, az; rename",
        ),
        ({"imu": IMU.iloc[:0]}, "table imu: has no rows; leave the table out"),
        ({"imu": pd.concat([IMU, IMU[["ax"]]], axis=1)}, "table imu: there are several columns ax; keep one"),
        ({"imu": IMU.set_axis(pd.to_datetime(TIME, unit="s").rename("t"))}, r"table imu, column t: holds datetime64"),
        ({"imu": IMU.assign(ax="fast")}, "table imu, row 0, column ax: 'fast' is not a number"),
        ({"imu": IMU / 9.8}, "looks like g: read with units={'accelerometer': 'g'}"),
        (
            {"imu": IMU, "site": {"latitude": np.nan}},
            "site, site.latitude: nan is not a number; write one, or leave out",
        ),
        ({"imu": IMU, "site": {"latitude": 91}}, "site, site.latitude: 91 is not a latitude in degrees"),
    ],
)
def test_tables_that_cannot_be_right(tables, message):
    with pytest.raises(RecordingError, match=message):
        recording_from_tables("a", **tables)


def test_the_advice_for_tables_mends_them():
    dated = IMU.set_axis(pd.to_datetime(TIME, unit="s").rename("t")).reset_index()
    start = dated["t"][0]
    mended = dated.assign(t=(dated["t"] - start).dt.total_seconds())
    named = IMU.reset_index().rename(columns={"t": "time"}).rename(columns={"time": "t"})
    for imu, units in ((mended, {}), (named, {}), (IMU / 9.80665, {"accelerometer": "g"})):
        found = recording_from_tables("a", imu=imu, units=units).imu
        np.testing.assert_allclose(found.to_numpy(), IMU.to_numpy(), rtol=1e-15)
    with pytest.raises(ValueError, match=r"wheel must be a DataFrame, got list; make one by pd.DataFrame\(wheel\)"):
        recording_from_tables("a", imu=IMU, wheel=[1.0])
    with pytest.raises(ValueError, match="units has no quantity 'force'"):
        recording_from_tables("a", imu=IMU, units={"force": "N"})


@pytest.mark.filterwarnings("ignore:processed_log/IMU/magnetometer_uncalibrated/value. cut short")
@pytest.mark.parametrize(
    ("name", "form"),
    [
        ("hill-road", "csv"),
        ("hill-road", "csv.gz"),
        ("rtk-drive", "parquet"),
        ("umn-thor75", "parquet"),
        ("dresden-motorbike", "csv"),
        ("comma2k19-example", "csv"),
    ],
)
def test_what_is_saved_is_read_back_equal(tmp_path, data_dir, name, form):
    recording = load_dataset(name)
    recording.save(tmp_path / "saved", form=form)
    assert equal(read_recording(tmp_path / "saved"), recording)


def test_notes_are_kept_and_not_told_again(tmp_path):
    gnss = pd.DataFrame({"t": TIME, "v_e": 5.0, "v_n": 0.0, "alt": np.where(TIME < 1, np.nan, 10.0)})
    turned = IMU.rename(columns={"ax": "az", "az": "ax"})
    with pytest.warns(RecordingWarning) as told:
        recording = recording_from_tables('a "b" \\ c', imu=turned, gnss=gnss, axes="BRU")
    assert len(told) == len(recording.notes) == 2
    recording.save(tmp_path / "saved")
    again = read_recording(tmp_path / "saved")
    assert equal(again, recording)
    again.save(tmp_path / "twice")
    assert equal(read_recording(tmp_path / "twice"), recording)
    with (tmp_path / "saved" / "imu.csv").open("a") as file:
        file.write("5.0,,0.1,9.8\n")
    with pytest.warns(RecordingWarning, match="imu.csv, line 52, column ax: nan is not a number") as told:
        changed = read_recording(tmp_path / "saved")
    assert len(told) == 1 and len(changed.notes) == 3


def test_what_cannot_be_saved(tmp_path):
    recording = recording_from_tables("a", imu=IMU)
    recording.save(tmp_path / "saved")
    with pytest.raises(FileExistsError, match="holds a recording already"):
        recording.save(tmp_path / "saved", form="parquet")
    with pytest.raises(ValueError, match="has no imu, which a tidy folder needs"):
        Recording(name="a", gnss=IMU).save(tmp_path / "other")
    # Columns in another order are one of the ways in which a recording made by hand is not as reading gives it.
    with pytest.raises(ValueError, match="the stream imu does not come back equal"):
        Recording(name="a", imu=IMU[["az", "ax", "ay"]]).save(tmp_path / "third")


def track(valid=True, height=100.0) -> pd.DataFrame:
    estimate = pd.DataFrame({"lat": 47.0 + TIME / 1e5, "lon": 11.0, "height": height, "valid": valid}, index=TIME)
    estimate.attrs["constants"] = IMU
    return estimate


@pytest.mark.parametrize("ending", ["csv", "csv.gz", "parquet"])
def test_an_estimate_as_a_table(tmp_path, ending):
    path = tmp_path / f"drive.{ending}"
    save_estimate(track(), path)
    found = pd.read_parquet(path) if ending == "parquet" else pd.read_csv(path, index_col="t")
    pd.testing.assert_frame_equal(found, track(), check_exact=True)


def test_a_track_has_a_piece_for_each_stretch_that_is_supported(tmp_path):
    valid, height = np.ones(50, bool), np.full(50, 100.0)
    valid[:5], valid[20:22], height[30] = False, False, np.nan
    save_estimate(track(valid, height), tmp_path / "drive.gpx")
    found = gpxpy.parse((tmp_path / "drive.gpx").read_text()).tracks[0].segments
    assert [len(segment.points) for segment in found] == [15, 8, 19]
    first = found[0].points[0]
    assert (first.latitude, first.longitude, first.elevation) == (47.0 + 0.5 / 1e5, 11.0, 100.0)
    save_estimate(track(valid, height), tmp_path / "drive.kml")
    text = (tmp_path / "drive.kml").read_text()
    assert text.count("<LineString") == 3 and "11.0,47.000005,100.0" in text and "absolute" in text


@pytest.mark.parametrize(
    ("estimate", "name", "message"),
    [
        (track(), "drive.xlsx", r"drive.xlsx: the ending must be one of .csv, .csv.gz, .parquet, .gpx, .kml"),
        (
            IMU,
            "drive.gpx",
            r"lat, lon, height of them are not .*; estimate_drive\(recording\) gives them where gnss has",
        ),
        (
            track(height=np.nan),
            "drive.kml",
            "no row has a position, as from a recording without gnss or whose gnss has no lat",
        ),
        (track(valid=False), "drive.gpx", "no row with a position is valid; save the estimate as .csv"),
    ],
)
def test_no_track_without_positions(tmp_path, estimate, name, message):
    with pytest.raises(ValueError, match=message):
        save_estimate(estimate, tmp_path / name)
    assert not (tmp_path / name).exists()
