"""Solutions of a receiver, written by pyubx2: units, signs, and which of them are GNSS."""

import numpy as np
import pytest
from pyubx2 import GET, UBXMessage

from altijax.recordings import RecordingWarning, read_recording

pytestmark = pytest.mark.filterwarnings("ignore:.*there is no IMU in it:altijax.recordings.RecordingWarning")
PLACE = {"lat": 47.3977, "lon": 8.5456, "height": 488_250}


def pvt(k: int, fix: int = 3, ok: int = 1, **more) -> bytes:
    fields = {"velN": 12_345, "velE": -2_000, "velD": -250, "sAcc": 150} | PLACE | more
    return UBXMessage("NAV", "NAV-PVT", GET, iTOW=1000 * k, fixType=fix, gnssFixOk=ok, **fields).serialize()


def read(tmp_path, *messages: bytes):
    (tmp_path / "x.ubx").write_bytes(b"".join(messages))
    return read_recording(tmp_path / "x.ubx")


def test_what_is_no_fix_of_gnss_is_dropped_and_said(tmp_path):
    kinds = [(0, 0), (5, 1), (1, 1), (3, 0), (3, 1), (4, 1), (4, 1), (2, 1), (0, 1)]
    with pytest.warns(RecordingWarning, match="column (v_u|alt): nan is not a number; rows like it: 1 of 4"):
        r = read(tmp_path, *(pvt(k, *kind) for k, kind in enumerate(kinds)))
    assert len(r.gnss) == 4
    notes = " | ".join(r.notes)
    assert "NAV-PVT: 2 epochs without a fix dropped" in notes
    assert "1 epochs of dead reckoning alone dropped" in notes and "1 epochs of time alone dropped" in notes
    assert "1 epochs dropped, whose fix the receiver itself does not trust" in notes
    assert "2 of 4 epochs are fused with the receiver's own IMU" in notes
    assert "1 epochs with a fix in two dimensions; their alt and v_u are left out" in notes
    assert np.isnan(r.gnss[["alt", "v_u"]].iloc[-1]).all() and r.gnss["v_n"].iloc[-1] == pytest.approx(12.345)


def test_a_position_that_the_receiver_takes_back_is_missing(tmp_path):
    with pytest.warns(RecordingWarning, match="column (lat|lon|alt): nan is not a number"):
        r = read(tmp_path, *(pvt(k, invalidLlh=int(k == 1)) for k in range(4)))
    assert np.isnan(r.gnss["lat"]).tolist() == [False, True, False, False] and len(r.gnss) == 4


def test_nothing_fixed(tmp_path):
    assert read(tmp_path, *(pvt(k, 0, 0) for k in range(4))).gnss is None


def test_nav_pvat_gives_velocity_and_the_vehicle_attitude(tmp_path):
    fields = {"velN": 12_345, "velE": -2_000, "velD": -250, "sAcc": 150} | PLACE
    angles = {"vehRoll": 1.5, "vehPitch": -3.0, "vehHeading": 350.0}
    log = b""
    for k in range(5):
        valid = dict.fromkeys(("vehRollValid", "vehPitchValid", "vehHeadingValid"), int(k > 1))
        m = UBXMessage("NAV", "NAV-PVAT", GET, iTOW=1000 * k, fixType=4, gnssFixOK=1, **fields, **angles, **valid)
        log += m.serialize()
    r = read(tmp_path, log)
    np.testing.assert_allclose(r.gnss.iloc[0], [-2, 12.345, 0.25, 47.3977, 8.5456, 488.25, 0.15, 0.15, 0.15])
    assert len(r.reference) == 3 and r.reference.index[0] == 2
    np.testing.assert_allclose(r.reference.iloc[0], [*np.radians([1.5, -3, 350]), -2, 12.345, 0.25], rtol=1e-12)
    assert any("the reference is the receiver's own fusion" in note for note in r.notes)


def velned(k: int, sd: int) -> bytes:
    m = UBXMessage("NAV", "NAV-VELNED", GET, iTOW=1000 * k, velN=1234, velE=-200, velD=-25, sAcc=sd)
    return m.serialize()


def test_nav_velned_with_position_and_status_of_the_same_epoch(tmp_path):
    log = b""
    for k in range(6):
        log += UBXMessage("NAV", "NAV-POSLLH", GET, iTOW=1000 * k, **PLACE).serialize()
        log += UBXMessage("NAV", "NAV-STATUS", GET, iTOW=1000 * k, gpsFix=3, gpsFixOk=int(k > 1)).serialize()
        log += velned(k, 15)
    r = read(tmp_path, log)
    assert len(r.gnss) == 4
    np.testing.assert_allclose(r.gnss.iloc[0], [-2, 12.34, 0.25, 47.3977, 8.5456, 488.25, 0.15, 0.15, 0.15])


def test_nav_velned_alone_is_believed_by_its_deviation(tmp_path):
    r = read(tmp_path, *(velned(k, 15 if k > 2 else 5000) for k in range(6)))
    assert len(r.gnss) == 3 and any("3 epochs without a fix dropped" in note for note in r.notes)
    assert list(r.gnss.columns) == ["v_e", "v_n", "v_u", "sd_e", "sd_n", "sd_u"]
