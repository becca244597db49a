"""Exports of Sensor Logger, written here as the app writes them."""

import shutil

import numpy as np
import pandas as pd
import pytest

from altijax.recordings import RecordingError, RecordingWarning, read_recording

T = np.arange(0, 20, 0.04)
RNG = np.random.default_rng(0)
# Flat on the dash, its top forward: x right, y forward, z up; it gathers speed and brakes.
F = np.stack([0 * T, np.sin(T / 3), 0 * T + 9.8], -1) + 0.02 * RNG.normal(size=(T.size, 3))
G = np.tile([0.0, 0.1, 9.8], (T.size, 1))
W = 0.01 * RNG.normal(size=(T.size, 3))
EPOCH = 1_700_000_000_000_000_000


def table(t, values, names):
    columns = pd.DataFrame(values, columns=names)
    columns.insert(0, "seconds_elapsed", t)
    columns.insert(0, "time", EPOCH + np.round(1e9 * t).astype(np.int64))
    return columns


def vector(t, values):
    # The app writes z first.
    return table(t, values[:, ::-1], ["z", "y", "x"])


def location(speed=5.0):
    t = np.arange(0.3, 20, 1.0)
    names = ["bearingAccuracy", "speedAccuracy", "verticalAccuracy", "horizontalAccuracy", "speed", "bearing"]
    values = np.tile([3.0, 0.4, 6.0, 4.0, speed, 90.0], (t.size, 1))
    values[0, [1, 4, 5]] = -1
    found = table(t, values, names)
    return found.assign(altitude=300 + 0.1 * t, longitude=11.0, latitude=48 + 1e-5 * t)


def export(folder, files, platform="android", standardisation=None):
    folder.mkdir(exist_ok=True)
    for name, content in files.items():
        content.to_csv(folder / f"{name}.csv", index=False)
    if platform:
        metadata = {"version": [3], "device name": ["Ä phone"], "platform": [platform], "appVersion": ["1.63"]}
        if standardisation is not None:
            metadata["standardisation"] = [standardisation]
        pd.DataFrame(metadata).to_csv(folder / "Metadata.csv", index=False)
    return folder


def android():
    gyro = vector(T + 0.016, W)
    return {
        "TotalAcceleration": vector(T, F),
        "Accelerometer": vector(T, F - G),
        "Gyroscope": gyro,
        "Location": location(),
    }


def test_android(tmp_path):
    r = read_recording(export(tmp_path / "drive", android()))
    assert (r.name, r.axes, r.description) == ("drive", "RFU", "Sensor Logger export")
    # Right, forward, up of the phone become forward, left, up; the first row has no gyro yet.
    np.testing.assert_allclose(r.imu[["ax", "ay", "az"]], np.stack([F[1:, 1], -F[1:, 0], F[1:, 2]], -1), atol=1e-9)
    between = 0.6 * W[1:] + 0.4 * W[:-1]
    np.testing.assert_allclose(r.imu["gz"], between[:, 2], atol=1e-9)
    assert r.imu.index[0] == 0 and any("interpolated" in note for note in r.notes)
    # The first fix has no speed.
    assert len(r.gnss) == 19 and r.gnss["sd_e"].iloc[0] == 0.4
    np.testing.assert_allclose(r.gnss["v_e"], 5)
    np.testing.assert_allclose(r.gnss.index[0], 1.3 - 0.04)
    assert list(r.gnss.columns) == ["v_e", "v_n", "v_u", "lat", "lon", "alt", "sd_e", "sd_n"]


def test_gravity_is_added_where_the_total_is_missing(tmp_path):
    files = {"Accelerometer": vector(T, F - G), "Gravity": vector(T + 0.002, G), "Gyroscope": vector(T, W)}
    r = read_recording(export(tmp_path, files))
    np.testing.assert_allclose(r.imu["ax"], F[1:, 1], atol=1e-9)
    np.testing.assert_allclose(r.imu["az"], F[1:, 2], atol=1e-9)


@pytest.mark.parametrize("files", [("Accelerometer", "Gravity"), ("AccelerometerUncalibrated",)])
@pytest.mark.parametrize(
    ("standardisation", "sign", "unit"), [("false", -1, 9.80665), (None, -1, 9.80665), ("true", 1, 1)]
)
def test_ios(files, standardisation, sign, unit, tmp_path):
    content = {"Accelerometer": sign * (F - G), "Gravity": sign * G, "AccelerometerUncalibrated": sign * F / unit}
    written = {name: vector(T, content[name]) for name in files} | {"Gyroscope": vector(T, W)}
    r = read_recording(export(tmp_path, written, "ios", standardisation))
    np.testing.assert_allclose(r.imu[["ax", "ay", "az"]], np.stack([F[:, 1], -F[:, 0], F[:, 2]], -1), atol=1e-9)
    np.testing.assert_allclose(r.imu["gz"], W[:, 2], atol=1e-9)
    assert any("iOS" in note for note in r.notes) == (sign < 0)


def test_a_platform_that_is_not_said(tmp_path):
    files = {"Accelerometer": vector(T, G - F), "Gravity": vector(T, -G)}
    with pytest.warns(RecordingWarning) as seen:
        read_recording(export(tmp_path, files, platform=None))
    said = " | ".join(str(w.message) for w in seen)
    assert "Metadata.csv does not say the platform" in said and "'-m/s^2'" in said
    with pytest.warns(RecordingWarning):
        r = read_recording(tmp_path, units={"accelerometer": "-m/s^2"})
    np.testing.assert_allclose(r.imu["ax"], F[:, 1], atol=1e-9)


def test_an_accelerometer_without_gravity_is_none(tmp_path):
    files = {"Accelerometer": vector(T, F - G), "Location": location()}
    with pytest.warns(RecordingWarning) as seen:
        r = read_recording(export(tmp_path, files))
    said = " | ".join(str(w.message) for w in seen)
    assert "Accelerometer.csv is without gravity and is left out; log Gravity" in said
    assert r.imu is None and len(r.gnss) == 19
    (tmp_path / "Location.csv").unlink()
    with pytest.raises(RecordingError, match=r"neither an accelerometer with gravity nor a location; found Accel"):
        read_recording(tmp_path)


def test_location_without_one_usable_row_does_not_stop_the_rest(tmp_path):
    with pytest.warns(RecordingWarning, match=r"Location.csv: has no row with speed and course"):
        r = read_recording(export(tmp_path, android() | {"Location": location(speed=-1.0)}))
    assert r.gnss is None and len(r.imu) == T.size - 1


def test_the_zip_of_an_export(tmp_path):
    folder = export(tmp_path / "drive", android())
    path = shutil.make_archive(str(tmp_path / "sunday"), "zip", folder)
    r = read_recording(path)
    assert r.name == "sunday"
    pd.testing.assert_frame_equal(r.imu, read_recording(folder).imu)
