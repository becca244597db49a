"""AndroSensor's table, written here as the app writes it."""

import numpy as np
import pytest

from altijax.recordings import read_recording

HEADER = (
    "ACCELEROMETER X (m/s²);ACCELEROMETER Y (m/s²);ACCELEROMETER Z (m/s²);GRAVITY X (m/s²);GYROSCOPE X (rad/s);"
    "GYROSCOPE Y (rad/s);GYROSCOPE Z (rad/s);LOCATION Latitude : ;LOCATION Longitude : ;LOCATION Altitude ( m);"
    "LOCATION Altitude-google ( m);LOCATION Speed ( Kmh);LOCATION Accuracy ( m);LOCATION ORIENTATION (°);"
    "Satellites in range;Time since start in ms ;YYYY-MO-DD HH-MI-SS_SSS"
)
N = 400


@pytest.mark.parametrize("encoding", ["utf-8", "cp1252"])
@pytest.mark.parametrize("comma", [False, True])
def test_a_table_whose_fixes_are_held(comma, encoding, tmp_path):
    lines = ["sep=;", HEADER]
    for k in range(N):
        s = k // 20
        fix = (0, 0, 0, 0, 0) if s < 2 else (48 + 1e-5 * s, 11.0, 300.0 + s, 36 + 3.6 * (s % 3), 90.0)
        lat, lon, alt, speed, course = fix
        imu = [0.01, 0.5, 9.8, 0.0, 0.001, 0.002, 0.003 * k]
        numbers = [*imu, lat, lon, alt, alt, speed, 4.0, course]
        text = [f"{value:.7f}" for value in numbers]
        text = [value.replace(".", ",") for value in text] if comma else text
        lines.append(";".join([*text, "8 / 12", str(50 * k), f"2018-04-04 21:39:{36 + k // 20:02d}:{k % 20 * 50:03d}"]))
    (tmp_path / "Sensor_record.csv").write_text("\n".join(lines), encoding=encoding)
    r = read_recording(tmp_path / "Sensor_record.csv")
    assert (r.name, r.axes) == ("Sensor_record", "RFU")
    np.testing.assert_allclose(r.imu.index, 0.05 * np.arange(N))
    np.testing.assert_allclose(r.imu["ax"], 0.5)
    np.testing.assert_allclose(r.imu["gz"], 0.003 * np.arange(N), atol=1e-7)
    # One row a fix, at its first; those before a fix are gone.
    s = np.arange(2, 20)
    np.testing.assert_allclose(r.gnss.index, s)
    np.testing.assert_allclose(r.gnss["v_e"], 10 + s % 3)
    np.testing.assert_allclose(r.gnss["alt"], 300 + s)
    assert any("2 rows at latitude and longitude 0" in note for note in r.notes)
