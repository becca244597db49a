"""DataFlash logs that the tests write themselves, message by message."""

import struct

import numpy as np
import pytest

from altijax.recordings import RecordingError, RecordingWarning, read_recording

STRUCT = {
    "Q": "Q",
    "B": "B",
    "f": "f",
    "d": "d",
    "c": "h",
    "C": "H",
    "e": "i",
    "L": "i",
    "I": "I",
    "n": "4s",
    "h": "h",
    "H": "H",
}
STRUCT |= {"N": "16s", "Z": "64s"}
FORMATS = {
    "IMU": (1, "QBffffffIIfBBHH", "TimeUS,I,GyrX,GyrY,GyrZ,AccX,AccY,AccZ,EG,EA,T,GH,AH,GHz,AHz"),
    "GPS": (2, "QBBIHBcLLeffffB", "TimeUS,I,Status,GMS,GWk,NSats,HDop,Lat,Lng,Alt,Spd,GCrs,VZ,Yaw,U"),
    "GPA": (3, "QBCCCCBI", "TimeUS,I,VDop,HAcc,VAcc,SAcc,VV,SMS"),
    "ATT": (4, "QccccCC", "TimeUS,DesRoll,Roll,DesPitch,Pitch,DesYaw,Yaw"),
    "POS": (5, "QLLff", "TimeUS,Lat,Lng,Alt,RelHomeAlt"),
    "WENC": (6, "QfBfB", "TimeUS,Dist0,Qual0,Dist1,Qual1"),
    "MSG": (7, "QZ", "TimeUS,Message"),
}


def packed(kind: int, form: str, *values) -> bytes:
    return b"\xa3\x95" + bytes([kind]) + struct.pack("<" + "".join(STRUCT[f] for f in form), *values)


def message(name: str, *values) -> bytes:
    kind, form, _ = FORMATS[name]
    return packed(kind, form, *values)


def header(*names: str) -> bytes:
    out = packed(0x80, "BBnNZ", 0x80, 89, b"FMT", b"BBnNZ", b"Type,Length,Name,Format,Columns")
    for name in names:
        kind, form, columns = FORMATS[name]
        size = 3 + struct.calcsize("<" + "".join(STRUCT[f] for f in form))
        out += packed(0x80, "BBnNZ", kind, size, name.encode(), form.encode(), columns.encode())
    return out


def imu(k: int, instance: int = 0) -> bytes:
    rest = (0, 0, 31.5, 1, 1, 1000, 1000)
    return message("IMU", 5_000_000 + 20_000 * k, instance, 0.01, 0.02, 0.03 * k, 0.5, -0.25, -9.75 - instance, *rest)


def drive() -> bytes:
    out = header(*FORMATS) + message("MSG", 1, b"ArduRover V4.5")
    for k in range(100):
        t = 5_000_000 + 20_000 * k
        out += imu(k) + imu(k, 1)
        out += message("ATT", t, 0, 150, 0, -250, 0, 35_000)
        out += message("WENC", t, 0.1 * k, 100, 0.0, 0)
        if k % 10 == 0:
            status = 1 if k < 20 else 3
            place = (473977000, 85456000, 48825)
            out += message("GPS", t, 0, status, 0, 2300, 12, 80, *place, 5.0, 90.0, -0.5, 0, 1)
            out += message("GPA", t + 200, 0, 100, 100, 100, 15, 1, 0)
            out += message("POS", t, 473977000, 85456000, 488.0 + 0.1 * k, 0)
    return out


def test_a_rover_round_trip(tmp_path):
    (tmp_path / "00000007.BIN").write_bytes(drive())
    r = read_recording(tmp_path / "00000007.BIN")
    assert (r.name, r.axes) == ("00000007", "FRD")
    np.testing.assert_allclose(r.imu.index, 0.02 * np.arange(100), atol=1e-9)
    np.testing.assert_allclose(r.imu.iloc[10], [0.5, 0.25, 9.75, 0.01, -0.02, -0.3, 31.5], rtol=1e-6)
    assert len(r.gnss) == 8 and any("2 rows without a fix dropped" in note for note in r.notes)
    place = [47.3977, 8.5456, 488.25]
    np.testing.assert_allclose(r.gnss.iloc[0], [5, 0, 0.5, *place, 0.15, 0.15, 0.15], atol=1e-9)
    assert r.gnss.index[0] == pytest.approx(0.4)
    angles = np.radians([1.5, -2.5, 350])
    np.testing.assert_allclose(r.reference.iloc[5], [*angles, 47.3977, 8.5456, 488.5], rtol=1e-9)
    assert len(r.wheel) == 99 and r.wheel.index[0] == pytest.approx(0.01)
    np.testing.assert_allclose(r.wheel["speed"], 5.0, rtol=1e-4)


def test_damage_is_said_and_the_rest_read(tmp_path):
    content = drive()
    (tmp_path / "x.bin").write_bytes(content[:3000] + bytes(1000) + content[3000:])
    with pytest.warns(RecordingWarning, match=r"x.bin: 10\d\d of its bytes are no messages"):
        r = read_recording(tmp_path / "x.bin")
    assert len(r.imu) in (99, 100)


def test_a_log_that_is_cut_short_keeps_what_is_whole(tmp_path):
    content = header("IMU") + b"".join(map(imu, range(50)))
    (tmp_path / "x.bin").write_bytes(content[:-10])
    assert len(read_recording(tmp_path / "x.bin").imu) == 49


def test_without_imu_it_says_what_is_there(tmp_path):
    (tmp_path / "x.bin").write_bytes(header("MSG") + message("MSG", 1, b"hello"))
    with pytest.raises(RecordingError, match=r"x.bin: there are no IMU messages in it, only FMT, MSG; set LOG_BITMASK"):
        read_recording(tmp_path / "x.bin")
