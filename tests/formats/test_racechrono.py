"""RaceChrono's CSV exports of both formats."""

import numpy as np
import pytest

from altijax.recordings import RecordingWarning, read_recording

TOP = [
    "This file is created using RaceChrono Pro v9.1.3 ( http://racechrono.com/ ).",
    "Format,3",
    'Session title,"A, B"',
    "Session type,Lap timing",
    "Created,31/12/2025,02:54",
    "Note,",
    "",
]
START = 1767150797.0


def test_format_3(tmp_path):
    lines = [
        *TOP,
        "timestamp,fragment_id,elapsed_time,altitude,bearing,latitude,longitude,speed,speed,speed,x_acc,y_acc,z_acc,"
        "x_rate_of_rotation,y_rate_of_rotation,z_rate_of_rotation",
        "unix time,,s,m,deg,deg,deg,m/s,m/s,km/h,G,G,G,deg/s,deg/s,deg/s",
        ",,,100: gps,100: gps,100: gps,100: gps,calc,100: gps,200: obd,"
        + ",".join(["101: acc"] * 3 + ["102: gyro"] * 3),
    ]
    for k in range(100):
        gps = f"{300 + k},90.0,48.0,11.0,99.0,12.5," if k % 10 == 0 else ",,,,,,"
        obd = "36.0" if k % 10 == 5 else ""
        lines.append(f"{START + 0.1 * k:.3f},0,{0.1 * k:.3f},{gps}{obd},0.1,0.0,1.0,1.0,2.0,{k}")
    (tmp_path / "session.csv").write_text("\n".join(lines))
    r = read_recording(tmp_path / "session.csv")
    np.testing.assert_allclose(r.imu.index, 0.1 * np.arange(100), atol=1e-6)
    np.testing.assert_allclose(r.imu[["ax", "az"]], np.tile([0.980665, 9.80665], (100, 1)))
    np.testing.assert_allclose(r.imu["gz"], np.radians(np.arange(100)))
    np.testing.assert_allclose(r.gnss["v_e"], 12.5)
    np.testing.assert_allclose(r.gnss["alt"], 300 + np.arange(0, 100, 10))
    np.testing.assert_allclose(r.wheel["speed"], 10)
    np.testing.assert_allclose(r.wheel.index, 0.5 + np.arange(10), atol=1e-6)


def test_format_2(tmp_path):
    lines = [line.replace("Format,3", "Format,2") for line in TOP]
    lines += [
        "Time (s),Lap #,Speed (m/s) *calc,Speed (km/h) *gps,Bearing (deg) *gps,Latitude (deg) *gps,Longitude (deg) *gps"
    ]
    lines += [f"{START + k},1,9.0,36.0,0.0,48.0,11.0{k}" for k in range(20)]
    (tmp_path / "session.csv").write_text("\n".join(lines))
    with pytest.warns(RecordingWarning, match="there is no accelerometer in it"):
        r = read_recording(tmp_path / "session.csv")
    assert r.imu is None and len(r.gnss) == 20
    np.testing.assert_allclose(r.gnss["v_n"], 10)
