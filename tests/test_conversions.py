"""Conversions of known recordings, on small originals made here; `test_datasets` has the checksums of the real ones."""

import struct

import numpy as np
import pandas as pd
import pytest
import scipy.io

from altijax.constants import STANDARD_GRAVITY
from altijax.conversions import CONVERSIONS, dresden_motorbike, rtk_drive, umn_thor75
from altijax.recordings import read_recording

TURN = 2 * np.pi


def written(tables, folder):
    for name, text in tables.items():
        (folder / name).write_text(text)
    return folder


def test_a_drive_of_rtklib(tmp_path):
    """The log takes 1.001 times what its own milliseconds say, and begins 0.25 s after the solution."""
    rows = [
        f"2025/07/08 19:34:{18.499 + k / 4:.3f} 40.1 -105.2 {1600 + k} {' '.join(map(str, range(5, 24)))}"
        for k in range(9)
    ]
    (tmp_path / "gnss_1934_sf.pos").write_text("%  GPST header\n" + "\n".join(rows))
    log = [f"0.1,0.02,1.01,{k},0,0,{261906 + 10 * k}" for k in range(102)]
    (tmp_path / "imu_1934.csv").write_text("\n".join(log) + "\n0.1,0.0")
    began = pd.Timestamp("2025-07-08 19:34:18.749").timestamp()
    tags = bytes(64) + struct.pack("<Id", int(began), began % 1) + struct.pack("<II", 1001, 0)
    (tmp_path / "imu_1934.csv.tag").write_bytes(tags)
    recording = read_recording(written(rtk_drive(tmp_path), tmp_path), axes="FLU")
    t = recording.imu.index.to_numpy()
    assert len(t) == 101 and t == pytest.approx(0.25 + np.arange(101) * 0.01001, abs=1.1e-5)
    assert recording.imu["ax"].to_numpy() == pytest.approx(0.1 * STANDARD_GRAVITY, abs=1e-5)
    assert recording.imu["gx"].to_numpy() == pytest.approx(np.radians(np.arange(1, 102)), abs=1e-5)
    assert recording.gnss.iloc[0].to_dict() == {
        "v_e": 16,
        "v_n": 15,
        "v_u": 17,
        "lat": 40.1,
        "lon": -105.2,
        "sd_e": 19,
        "sd_n": 18,
        "sd_u": 20,
    }
    assert recording.reference["alt"].to_list() == list(range(1600, 1609))


def test_a_flight_of_arrays(tmp_path):
    t = 225.9 + np.arange(200) / 50
    names = "lat lon alt ve vn vd p q r ax ay az navve navvn navvd navalt phi theta psi".split()
    arrays = {name: np.full(200, float(k)) for k, name in enumerate(names, 1)} | {"time": t, "psi": np.full(200, -0.5)}
    arrays |= {
        "GPS_TOW": np.floor(t),
        "az": np.full(200, -9.8),
        "ax": np.zeros(200),
        "ay": np.zeros(200),
        "p": np.zeros(200),
        "phi": np.zeros(200),
        "theta": np.zeros(200),
    }
    file = "thor_flight75_WaypointTracker_150squareWaypointNew_2012_10_10.mat"
    scipy.io.savemat(tmp_path / file, {"flight_data": arrays})
    recording = read_recording(
        written(umn_thor75(tmp_path), tmp_path), units={"gyro": "rad/s", "accelerometer": "m/s^2"}
    )
    assert recording.imu.index[0] >= 226 and recording.axes == "FRD"
    assert recording.imu["az"].to_numpy() == pytest.approx(9.8)
    assert recording.gnss.index.to_list() == pytest.approx([226.0, 227.0, 228.0, 229.0], abs=0.02)
    assert recording.gnss.iloc[0, :3].to_list() == [4, 5, -6]
    assert recording.reference["heading"].to_numpy() == pytest.approx(TURN - 0.5, abs=1e-6)


def test_a_log_of_a_telephone(tmp_path):
    t = np.arange(200) / 50
    logged = pd.to_datetime(1_470_740_991 + 7200 + t, unit="s").strftime("%Y-%m-%d %H:%M:%S.%f").str[:-3]
    log = pd.DataFrame({"loggingTime": logged, "accelerometerTimestamp_sinceReboot": 5000 + t})
    log["gyroTimestamp_sinceReboot"] = (5000 + t).round(6)
    for axis, force in zip("XYZ", (0.0, 0.0, -1.0), strict=True):
        log[f"accelerometerAcceleration{axis}"] = force
        log[f"gyroRotation{axis}"] = 0.1 * t
    log.loc[3, [f"gyroRotation{axis}" for axis in "XYZ"]] = np.nan
    fixes = np.arange(0, 200, 50)
    columns = {"Timestamp_since1970": 1_470_740_990 + t, "Latitude": 51.0, "Longitude": 13.0, "Altitude": 200.0}
    for name, values in (columns | {"Speed": 5.0, "Course": 90.0}).items():
        log[f"location{name}"] = pd.Series(values, index=log.index).where(log.index.isin(fixes))
    log.to_csv(tmp_path / "2016-08-09-Motorbike.csv", index=False)
    recording = read_recording(written(dresden_motorbike(tmp_path), tmp_path), axes="FLU")
    assert recording.imu["az"].to_numpy() == pytest.approx(STANDARD_GRAVITY)
    assert recording.imu["gx"].to_numpy() == pytest.approx(0.1 * t, abs=1e-6)
    assert recording.gnss.index.to_numpy() == pytest.approx([-1, 0, 1, 2], abs=1e-3)
    assert recording.gnss["v_e"].to_numpy() == pytest.approx(5.0)


def test_every_conversion_has_a_test_above():
    assert set(CONVERSIONS) == {"rtk-drive", "umn-thor75", "dresden-motorbike"}
