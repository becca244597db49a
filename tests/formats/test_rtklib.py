"""Solutions of RTKLIB, written here in its three coordinate systems."""

import numpy as np
import pymap3d
import pytest

from altijax.recordings import RecordingError, RecordingWarning, read_recording

SITE = (48.1, 11.5, 550.0)
LLH = "latitude(deg) longitude(deg)  height(m)   Q  ns   sdn(m)   sde(m)   sdu(m) sdne(m) sdeu(m) sdun(m) age(s) ratio"
VELOCITY = "    vn(m/s)    ve(m/s)    vu(m/s)      sdvn     sdve     sdvu    sdvne    sdveu    sdvun"
REST = "0.010 0.010 0.020 0.000 0.000 0.000 0.50 99.9"


def write(path, header, rows, scale="GPST"):
    lines = ["% program   : RTKLIB ver.2.4.3", f"%  {scale}                  {header}", *rows]
    path.write_text("\n".join(lines) + "\n")
    return path


def epochs(n=5):
    return [
        f"2025/12/31 23:59:{58 + 0.5 * k:06.3f}" if k < 4 else f"2026/01/01 00:00:{0.5 * (k - 4):06.3f}"
        for k in range(n)
    ]


def read(path, said="there is no IMU in it"):
    with pytest.warns(RecordingWarning) as seen:
        recording = read_recording(path)
    assert any(said in str(w.message) for w in seen)
    return recording


@pytest.mark.parametrize("separator", [" ", ","])
def test_geodetic_with_velocity(separator, tmp_path):
    place = " ".join(map(str, SITE))
    rows = [
        f"{t} {place} {int(k != 1)} 12 {REST} 1.0 {2.0 + k} 0.5 0.01 0.02 0.03 0 0 0" for k, t in enumerate(epochs())
    ]
    if separator == ",":
        rows = [",".join([row[:23], *row[23:].split()]) for row in rows]
    r = read(write(tmp_path / "a.pos", LLH + VELOCITY, rows))
    # The epoch without a solution is gone.
    np.testing.assert_allclose(r.gnss.index, [0, 1, 1.5, 2])
    np.testing.assert_allclose(r.gnss["v_e"], [2, 4, 5, 6])
    first = r.gnss.iloc[0]
    np.testing.assert_allclose(
        first[["v_n", "v_u", "lat", "lon", "alt", "sd_e", "sd_n", "sd_u"]], [1, 0.5, *SITE, 0.02, 0.01, 0.03]
    )
    assert "GPS time" in r.description and any("1 epochs without a solution" in note for note in r.notes)


def test_geocentric_with_velocity_and_time_by_week(tmp_path):
    place = " ".join(map(repr, map(float, pymap3d.geodetic2ecef(*SITE))))
    v = " ".join(map(repr, map(float, pymap3d.enu2uvw(3.0, 4.0, 0.5, *SITE[:2]))))
    rows = [f"2399 {518400 + k:.3f} {place} 1 12 {REST} {v} 0 0 0 0 0 0" for k in range(3)]
    header = (LLH + VELOCITY).replace("latitude(deg) longitude(deg)  height(m)", "x-ecef(m) y-ecef(m) z-ecef(m)")
    header = header.replace("vn(m/s)    ve(m/s)    vu(m/s)", "vx(m/s) vy(m/s) vz(m/s)")
    r = read(write(tmp_path / "a.pos", header, rows, "UTC"))
    np.testing.assert_allclose(r.gnss.index, [0, 1, 2])
    np.testing.assert_allclose(
        r.gnss[["v_e", "v_n", "v_u", "lat", "lon"]], np.tile([3, 4, 0.5, *SITE[:2]], (3, 1)), rtol=1e-9
    )
    np.testing.assert_allclose(r.gnss["alt"], SITE[2], rtol=1e-7)


def test_positions_alone_are_a_reference(tmp_path):
    rows = [f"{t} {' '.join(map(str, SITE))} 1 12 {REST}" for t in epochs()]
    r = read(
        write(tmp_path / "a.pos", LLH, rows), "has positions and no velocities, so it is the reference only; solve"
    )
    assert r.gnss is None and r.reference["alt"].tolist() == [550.0] * 5


def test_distances_from_a_base(tmp_path):
    header = LLH.replace("latitude(deg) longitude(deg)  height(m)", "e-baseline(m) n-baseline(m) u-baseline(m)")
    rows = [f"{t} 1 2 3 1 12 {REST}" for t in epochs()]
    with pytest.raises(RecordingError, match=r"has distances from a base alone; solve again with RTKLIB's 'Output Vel"):
        read_recording(write(tmp_path / "a.pos", header, rows))
    rows = [f"{t} 1 2 3 1 12 {REST} 1 2 3 0 0 0 0 0 0" for t in epochs()]
    r = read(write(tmp_path / "b.pos", header + VELOCITY, rows))
    np.testing.assert_allclose(r.gnss[["v_e", "v_n", "v_u"]], np.tile([2, 1, 3], (5, 1)))


def test_damaged_lines_and_no_lines(tmp_path):
    rows = [f"{t} {' '.join(map(str, SITE))} 1 12 {REST}" for t in epochs()]
    rows[2] = rows[2][:40]
    rows.append("2026/01/01 nonsense")
    r = read(write(tmp_path / "a.pos", LLH, rows), "2 lines are not whole epochs")
    assert len(r.reference) == 4
    with pytest.raises(RecordingError, match=r"a.pos: has no epochs"):
        read_recording(write(tmp_path / "a.pos", LLH, []))


def test_a_damaged_line_of_names(tmp_path):
    rows = [f"{t} {' '.join(map(str, SITE))} 1 12 {REST}" for t in epochs()]
    with pytest.raises(RecordingError, match=r"a.pos: its line of names has .* but no height; copy it again"):
        read_recording(write(tmp_path / "a.pos", LLH.replace("height(m)", "h(m)"), rows))
