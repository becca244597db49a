"""NMEA logs, their sentences written and summed here."""

import functools
import operator

import numpy as np
import pytest

from altijax.formats import nmea
from altijax.recordings import RecordingError, RecordingWarning, read_recording

KNOT = 1852 / 3600


def sentence(body):
    return f"${body}*{functools.reduce(operator.xor, body.encode()):02X}"


def clock(t):
    t = t % 86400
    return f"{int(t // 3600):02d}{int(t // 60 % 60):02d}{t % 60:05.2f}"


def rmc(t, knots=10.0, course="090.0", status="A", date="311225"):
    return sentence(f"GNRMC,{clock(t)},{status},4807.0380,N,01131.0000,W,{knots},{course},{date},,,A")


def gga(t, height=500.0, quality=1):
    return sentence(f"GPGGA,{clock(t)},4807.0380,N,01131.0000,W,{quality},08,1.0,{height},M,46.9,M,,")


def vtg(knots=10.0, course=90.0):
    return sentence(f"GPVTG,{course},T,,M,{knots},N,{knots * 1.852},K,A")


def read(path, lines):
    path.write_bytes("\r\n".join(lines).encode() + b"\r\n")
    with pytest.warns(RecordingWarning, match="there is no IMU in it"):
        return read_recording(path)


def test_a_log_that_passes_midnight(tmp_path):
    start = 86400 - 2.0
    lines = ["garbage", sentence("GPGSV,1,1,01,01,10,100,30")]
    for k in range(20):
        lines += [gga(start + 0.25 * k, 500 + k), rmc(start + 0.25 * k, 10 + k)]
    r = read(tmp_path / "log.txt", lines)
    np.testing.assert_allclose(r.gnss.index, 0.25 * np.arange(20), atol=1e-9)
    np.testing.assert_allclose(r.gnss["v_e"], (10 + np.arange(20)) * KNOT)
    np.testing.assert_allclose(r.gnss["v_n"], 0, atol=1e-12)
    np.testing.assert_allclose(r.gnss["alt"], 500 + np.arange(20))
    np.testing.assert_allclose(r.gnss[["lat", "lon"]], np.tile([48 + 7.038 / 60, -11 - 31 / 60], (20, 1)))
    assert r.imu is None and r.gnss["v_u"].isna().all()


def test_velocity_by_vtg_where_there_is_no_rmc(tmp_path):
    r = read(tmp_path / "a.nmea", [line for k in range(5) for line in (gga(3600 + k), vtg(10 + k))])
    np.testing.assert_allclose(r.gnss["v_e"], (10 + np.arange(5)) * KNOT)


def test_what_is_left_out_is_counted(tmp_path):
    lines = [rmc(k) for k in range(10)]
    lines[0] = rmc(0, status="V")
    lines[1] = gga(1, quality=0)
    lines[2] = gga(2, quality=6)
    lines[3] = lines[3].replace("4807", "4808")
    lines[4] = rmc(4, knots=0.05, course="")
    r = read(tmp_path / "a.nmea", lines)
    np.testing.assert_allclose(r.gnss.index, np.arange(5))
    said = " | ".join(r.notes)
    for part in (
        "1 sentences damaged",
        "2 sentences without a fix",
        "1 sentences by dead reckoning",
        "1 rows without speed or course",
    ):
        assert part in said


def test_a_log_without_velocity(tmp_path):
    (tmp_path / "a.nmea").write_text("\n".join(gga(k) for k in range(5)))
    with pytest.raises(RecordingError, match="no RMC or VTG sentence in it has a velocity"):
        read_recording(tmp_path / "a.nmea")


def test_it_is_told_by_its_sentences(tmp_path):
    (tmp_path / "a.dat").write_text("x\n" + rmc(0))
    (tmp_path / "b.nmea").write_text("$PGRMC is of another kind")
    (tmp_path / "c.bin").write_bytes(b"\0" + rmc(0).encode())
    assert [nmea.reads(tmp_path / name) for name in ("a.dat", "b.nmea", "c.bin")] == [True, False, False]
