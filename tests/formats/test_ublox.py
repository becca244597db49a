"""UBX logs that the tests write themselves, message by message."""

import struct

import numpy as np
import pytest
from pyubx2 import GET, UBXMessage

from altijax.recordings import RecordingError, RecordingWarning, read_recording

WEEK = 604_800_000


def pvt(itow: int, fix: int = 1) -> bytes:
    fields = {"velN": 12_345, "velE": -2_000, "velD": -250, "lat": 47.3977, "lon": 8.5456, "height": 488_250}
    return UBXMessage(
        "NAV", "NAV-PVT", GET, iTOW=itow % WEEK, fixType=3 * fix, gnssFixOk=fix, sAcc=150, **fields
    ).serialize()


def words(values) -> bytes:
    return b"".join(struct.pack("<I", (value & 0xFFFFFF) | kind << 24) for kind, value in values)


def meas(tag: int, values) -> bytes:
    payload = struct.pack("<IHH", tag, len(values) << 11, 0) + words(values)
    return UBXMessage("ESF", "ESF-MEAS", GET, payload=payload).serialize()


def raw(samples) -> bytes:
    payload = bytes(4) + b"".join(words([value]) + struct.pack("<I", tag) for tag, value in samples)
    return UBXMessage("ESF", "ESF-RAW", GET, payload=payload).serialize()


def counts(k: int) -> dict[int, int]:
    """Types and values of one instant: accelerometer 16, 17, 18, gyro 14, 13, 5, temperature 12."""
    return {16: 100 + k, 17: -200 - k, 18: 10_040, 14: 1000 * k, 13: -1000 * k, 5: 4096, 12: 2150}


def check_imu(imu, n):
    k = np.arange(n)
    acceleration = np.stack([100 + k, -200 - k, 10_040 + 0 * k], -1) / 1024
    rate = np.radians(np.stack([1000 * k, -1000 * k, 4096 + 0 * k], -1) / 4096)
    np.testing.assert_allclose(imu[["ax", "ay", "az"]], acceleration, rtol=1e-15)
    np.testing.assert_allclose(imu[["gx", "gy", "gz"]], rate, rtol=1e-12)
    assert imu["temperature"].to_numpy() == pytest.approx(21.5)


def test_esf_meas_and_nav_pvt_round_trip(tmp_path):
    log = b"$GNGGA,ignored*00\r\n"
    for k in range(50):
        log += meas(7000 + 20 * k, list(counts(k).items()))
        log += meas(7000 + 20 * k, [(11, 15_000 + k), (6, 12)])
        if k % 10 == 9:
            # The receiver needs 40 ms to give out an epoch.
            log += pvt(400_000 + 20 * k - 40)
    (tmp_path / "drive.ubx").write_bytes(log)
    r = read_recording(tmp_path / "drive.ubx")
    assert (r.name, r.axes, r.reference) == ("drive", "FLU", None)
    assert any("dated by its place among the NAV-PVT messages" in note for note in r.notes)
    np.testing.assert_allclose(r.imu.index, 0.02 * np.arange(50), atol=1e-9)
    check_imu(r.imu, 50)
    np.testing.assert_allclose(r.wheel["speed"], 15 + 0.001 * np.arange(50), rtol=1e-12)
    np.testing.assert_allclose(r.gnss.index, 0.18 + 0.2 * np.arange(5), atol=1e-9)
    np.testing.assert_allclose(
        r.gnss.iloc[0], [-2.0, 12.345, 0.25, 47.3977, 8.5456, 488.25, 0.15, 0.15, 0.15], rtol=1e-12
    )


def test_esf_raw_is_dated_by_the_receiver_over_the_turn_of_clock_and_week(tmp_path):
    # So long that the clock of 24 bits passes every count twice.
    tick, n, step = 1 / 25_600, 700, 51_200
    tags = [(2**24 - 500_000 + step * k) % 2**24 for k in range(n)]
    log = b""
    for k, tag in enumerate(tags):
        log += raw([(tag, value) for value in counts(k).items()])
        if k % 25 == 24:
            log += pvt(WEEK - 300_000 + 2000 * k)
    (tmp_path / "drive.ubx").write_bytes(log)
    r = read_recording(tmp_path / "drive.ubx")
    np.testing.assert_allclose(r.imu.index, step * tick * np.arange(n), atol=1e-6)
    check_imu(r.imu, n)
    np.testing.assert_allclose(r.gnss.index, 48 + 50 * np.arange(n // 25), atol=1e-6)


def test_without_esf_there_is_no_imu(tmp_path):
    (tmp_path / "fixes.ubx").write_bytes(b"".join(pvt(1000 * k, fix=k > 2) for k in range(10)))
    with pytest.warns(RecordingWarning, match=r"fixes.ubx: there is no IMU in it"):
        r = read_recording(tmp_path / "fixes.ubx")
    assert r.imu is None and any("3 epochs without a fix dropped" in note for note in r.notes)
    np.testing.assert_allclose(r.gnss.index, np.arange(7))
    assert "gnss" in repr(r)


def test_parts_that_cannot_be_used_are_named(tmp_path):
    log = b"".join(meas(20 * k, [(16, 0), (17, 0), (18, 10_040), (6, k)]) for k in range(10))
    damaged = bytearray(pvt(1000))
    damaged[20] ^= 0xFF
    (tmp_path / "x.ubx").write_bytes(log + bytes(damaged))
    with pytest.warns(RecordingWarning) as seen:
        r = read_recording(tmp_path / "x.ubx")
    text = " | ".join(str(w.message) for w in seen)
    assert "x.ubx: 1 damaged message(s) skipped" in text
    assert "x.ubx ESF-MEAS: there is no gyro" in text and "x.ubx ESF-MEAS: wheel ticks left out" in text
    assert list(r.imu.columns) == ["ax", "ay", "az"] and r.gnss is None and r.wheel is None


def test_esf_raw_without_nav_pvt_cannot_be_dated(tmp_path):
    (tmp_path / "x.ubx").write_bytes(raw([(0, value) for value in counts(0).items()]) + pvt(1000) + pvt(2000))
    with pytest.warns(RecordingWarning) as seen:
        assert read_recording(tmp_path / "x.ubx").imu is None
    assert "ESF-RAW: left out, at least 2 NAV-PVT messages between its own" in str(seen[0].message)


def test_a_file_without_any_of_it(tmp_path):
    (tmp_path / "x.ubx").write_bytes(b"$GNGGA,nothing*00\r\n" * 5)
    with pytest.raises(RecordingError, match=r"x.ubx: has neither NAV-PVT nor NAV-PVAT nor NAV-VELNED nor ESF-RAW"):
        read_recording(tmp_path / "x.ubx")


def meas_of(tag: int, values, provider: int = 0, stated: bool = True, calibrated: bool = False) -> bytes:
    flags = (len(values) << 11 if stated else 0) | (8 if calibrated else 0)
    payload = struct.pack("<IHH", tag, flags, provider) + words(values) + (bytes(4) if calibrated else b"")
    return UBXMessage("ESF", "ESF-MEAS", GET, payload=payload).serialize()


@pytest.mark.parametrize("calibrated", [False, True])
def test_a_count_of_measurements_that_is_left_out_follows_from_the_length(tmp_path, calibrated):
    log = b"".join(meas_of(20 * k, list(counts(k).items()), stated=False, calibrated=calibrated) for k in range(50))
    (tmp_path / "x.ubx").write_bytes(log)
    r = read_recording(tmp_path / "x.ubx")
    np.testing.assert_allclose(r.imu.index, 0.02 * np.arange(50), atol=1e-9)
    check_imu(r.imu, 50)


@pytest.mark.parametrize("ahead", [0, 50, 30_000, 6_500_000])
def test_the_speed_of_a_host_is_dated_by_its_own_clock(tmp_path, ahead):
    log = b""
    for k in range(500):
        log += meas_of(7000 + 20 * k, list(counts(k).items())) + meas_of(
            7000 + 20 * k + ahead, [(11, 10 * k)], provider=1
        )
        if k % 50 == 49:
            log += pvt(400_000 + 20 * k)
    (tmp_path / "x.ubx").write_bytes(log)
    r = read_recording(tmp_path / "x.ubx")
    np.testing.assert_allclose(r.gnss.index, 0.98 + np.arange(10), atol=1e-9)
    shift = 0.05 if ahead == 50 else 0.0
    np.testing.assert_allclose(r.wheel.index, shift + 0.02 * np.arange(500), atol=1e-9)
    assert any("provider 1 counts" in note for note in r.notes) == (ahead > 50)


@pytest.mark.parametrize("jump", [18_000, 7_200_000])
def test_epochs_without_a_fix_do_not_date(tmp_path, jump):
    log = b""
    for k in range(600):
        log += raw([(1000 + 256 * k, value) for value in counts(k).items()])
        if k % 10 == 9:
            log += pvt(400_000 + 10 * k - (jump if k < 200 else 0), fix=int(k >= 200))
    (tmp_path / "x.ubx").write_bytes(log)
    r = read_recording(tmp_path / "x.ubx")
    np.testing.assert_allclose(r.imu.index, 0.01 * np.arange(600), atol=1e-6)
    np.testing.assert_allclose(r.gnss.index, 2.09 + 0.1 * np.arange(40), atol=1e-6)
    assert any("dated by the 40 of 60 epochs with a fix" in note for note in r.notes)


def test_a_clock_that_is_set_under_way_is_said(tmp_path):
    log = b""
    for k in range(600):
        log += raw([(1000 + 256 * k, value) for value in counts(k).items()])
        if k % 10 == 9:
            log += pvt(400_000 + 10 * k + (18_000 if k > 500 else 0))
    (tmp_path / "x.ubx").write_bytes(log)
    with pytest.warns(RecordingWarning, match="part by up to 18 s, as they do where a clock is set"):
        r = read_recording(tmp_path / "x.ubx")
    np.testing.assert_allclose(r.imu.index, 0.01 * np.arange(600), atol=1e-3)


def test_wheel_ticks_become_speed_by_gnss(tmp_path):
    log = b""
    for k in range(500):
        ticks = (2**16 - 100 + 15 * k) % 2**16
        log += meas_of(20 * k, [*counts(k).items(), (8, ticks), (9, ticks)])
        if k % 10 == 9:
            log += pvt(400_000 + 20 * k)
    (tmp_path / "x.ubx").write_bytes(log)
    r = read_recording(tmp_path / "x.ubx")
    np.testing.assert_allclose(r.wheel[["rear_left", "rear_right"]], np.hypot(2.0, 12.345), rtol=1e-6)
