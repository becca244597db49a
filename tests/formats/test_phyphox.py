"""Exports of phyphox, written here as the app writes them."""

import zipfile

import numpy as np
import pandas as pd
import pytest

from altijax.recordings import RecordingError, RecordingWarning, read_recording

T = np.arange(0, 20, 0.04)
RNG = np.random.default_rng(0)
F = np.stack([0 * T, np.sin(T / 3), 0 * T + 9.8], -1) + 0.02 * RNG.normal(size=(T.size, 3))
W = 0.01 * RNG.normal(size=(T.size, 3))


def vector(t, values, what, unit):
    names = [f"{what} {axis} ({unit})" for axis in "xyz"]
    return pd.DataFrame(np.column_stack([t, values]), columns=["Time (s)", *names])


def location():
    t = np.arange(0.5, 20.0)
    names = [
        "Latitude (°)",
        "Longitude (°)",
        "Height (m)",
        "Velocity (m/s)",
        "Direction (°)",
        "Horizontal Accuracy (m)",
    ]
    values = np.column_stack([48 + 1e-5 * t, 11 + 0 * t, 300 + t, 5 + 0 * t, 90 + 0 * t, 4 + 0 * t])
    values[0, 3:5] = np.nan
    return (
        pd.DataFrame(values, columns=names)
        .assign(**{"Vertical Accuracy (°)": 6.0})
        .assign(**{"Time (s)": t})[["Time (s)", *names, "Vertical Accuracy (°)"]]
    )


FILES = {
    "Accelerometer": vector(T, F, "Acceleration", "m/s^2").assign(**{"Absolute acceleration (m/s^2)": 9.8}),
    "Gyroscope": vector(T + 0.02, W, "Gyroscope", "rad/s"),
    "Linear Accelerometer": vector(T, F - [0, 0, 9.8], "Linear Acceleration", "m/s^2"),
    "Location": location(),
}


def check(r):
    np.testing.assert_allclose(r.imu[["ax", "ay", "az"]], np.stack([F[1:, 1], -F[1:, 0], F[1:, 2]], -1), atol=1e-8)
    np.testing.assert_allclose(r.imu["gz"], (W[1:, 2] + W[:-1, 2]) / 2, atol=1e-8)
    assert len(r.gnss) == 19 and r.axes == "RFU"
    np.testing.assert_allclose(r.gnss["v_e"], 5)
    np.testing.assert_allclose(r.gnss["lat"], 48 + 1e-5 * np.arange(1.5, 20))


@pytest.mark.parametrize(("separator", "decimal"), [(",", "."), ("\t", "."), (";", ","), ("\t", ",")])
def test_a_folder_in_every_way_that_the_app_writes_numbers(separator, decimal, tmp_path):
    for name, content in FILES.items():
        content.to_csv(tmp_path / f"{name}.csv", sep=separator, decimal=decimal, float_format="%.9E", index=False)
    (tmp_path / "meta").mkdir()
    (tmp_path / "meta" / "device.csv").write_text('"property","value"\n"deviceModel","X"\n')
    check(read_recording(tmp_path))


def test_a_zip(tmp_path):
    with zipfile.ZipFile(tmp_path / "a.zip", "w") as archive:
        for name, content in FILES.items():
            archive.writestr(f"{name}.csv", content.to_csv(index=False))
    check(read_recording(tmp_path / "a.zip"))


def test_one_file_in_another_language(tmp_path):
    content = vector(T, F, "Beschleunigung", "m/s²").rename(columns={"Time (s)": "Zeit (s)"})
    content.to_csv(tmp_path / "Raw Data.csv", index=False)
    with pytest.warns(RecordingWarning, match="there is no gyro"):
        r = read_recording(tmp_path / "Raw Data.csv")
    np.testing.assert_allclose(r.imu["az"], F[:, 2], atol=1e-8)


def test_acceleration_without_gravity_is_said_to_be_so(tmp_path):
    FILES["Linear Accelerometer"].to_csv(tmp_path / "Raw Data.csv", index=False)
    with pytest.raises(RecordingError, match="neither an accelerometer with gravity nor a location"):
        read_recording(tmp_path)
    FILES["Location"].to_csv(tmp_path / "Location.csv", index=False)
    with pytest.warns(RecordingWarning) as seen:
        assert read_recording(tmp_path).imu is None
    said = " | ".join(str(w.message) for w in seen)
    assert "Raw Data.csv holds acceleration without gravity and is left out; record" in said
