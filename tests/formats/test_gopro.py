"""GoPro videos without a picture that the tests write themselves, box by box."""

import struct
import sys

import numpy as np
import pytest

from altijax.recordings import RecordingError, RecordingWarning, read_recording

N, PAYLOADS = 200, 4


def klv(key, kind, size, repeat, content):
    """One entry of GPMF; it ends on a multiple of four bytes."""
    return key + kind + struct.pack(">BH", size, repeat) + content + bytes(-len(content) % 4)


def nest(key, *parts):
    content = b"".join(part for part in parts if part)
    return klv(key, b"\0", 1, len(content), content)


def inertial(key, k, vectors, scale, orin, stamped):
    """A stream of 16-bit values of vectors (rows, 3) in x, y, z, stored as `orin` says."""
    order = [vectors[:, "XYZ".index(axis.upper())] * (1 if axis.isupper() else -1) for axis in orin or "ZXY"]
    rows = np.round(np.stack(order, -1) * scale).astype(">i2")
    return nest(
        b"STRM",
        klv(b"STMP", b"J", 8, 1, struct.pack(">Q", 500_000 + 1_000_000 * k)) if stamped else b"",
        klv(b"ORIN", b"c", 3, 1, orin.encode()) if orin else b"",
        klv(b"SCAL", b"s", 2, 1, struct.pack(">h", scale)),
        klv(key, b"s", 6, len(rows), rows.tobytes()),
    )


def gps(k, kind, m=10):
    """10 rows a second, eastwards at 12 m/s; the first payload has no fix."""
    t, fix = k + np.arange(m) / m, 3 if k else 0
    lon = 8.5456 + np.degrees(12 * t / 6_378_137 / np.cos(np.radians(47.3977)))
    rows = [(473_977_000, round(x * 1e7), 488_250, 12_000, 1_200) for x in lon]
    stamp = klv(b"STMP", b"J", 8, 1, struct.pack(">Q", 500_000 + 1_000_000 * k))
    scale = (10_000_000, 10_000_000, 1000, 1000, 100)
    if kind == "GPS5":
        content = b"".join(struct.pack(">5i", *row) for row in rows)
        scales = klv(b"SCAL", b"l", 4, 5, struct.pack(">5i", *scale))
        fixed = klv(b"GPSF", b"L", 4, 1, struct.pack(">I", fix))
        return nest(b"STRM", stamp, fixed, scales, klv(b"GPS5", b"l", 20, m, content))
    content = b"".join(struct.pack(">7i2H", *row, 9556, 36_000_000, 150, fix) for row in rows)
    scales = klv(b"SCAL", b"l", 4, 9, struct.pack(">9i", *scale, 1, 1000, 100, 1))
    return nest(b"STRM", stamp, klv(b"TYPE", b"c", 1, 9, b"lllllllSS"), scales, klv(b"GPS9", b"?", 32, m, content))


def box(kind, *parts):
    content = b"".join(parts)
    return struct.pack(">I", 8 + len(content)) + kind + content


def video(payloads):
    """An MP4 with one track of telemetry, a second each."""
    n, scale = len(payloads), 1000
    head = box(b"ftyp", b"mp41", bytes(4), b"mp41")
    places = len(head) + 8 + np.concatenate([[0], np.cumsum([len(p) for p in payloads[:-1]])]).astype(int)
    table = box(
        b"stbl",
        box(b"stsd", struct.pack(">II", 0, 1), box(b"gpmd", bytes(6), struct.pack(">HI", 1, 0))),
        box(b"stts", struct.pack(">4I", 0, 1, n, scale)),
        box(b"stsc", struct.pack(">5I", 0, 1, 1, 1, 1)),
        box(b"stsz", struct.pack(f">3I{n}I", 0, 0, n, *map(len, payloads))),
        box(b"stco", struct.pack(f">2I{n}I", 0, n, *places)),
    )
    links = box(b"dinf", box(b"dref", struct.pack(">II", 0, 1), box(b"url ", bytes(4))))
    media = box(
        b"mdia",
        box(b"mdhd", struct.pack(">5I2H", 0, 0, 0, scale, n * scale, 0, 0)),
        box(b"hdlr", bytes(8), b"meta", bytes(12), b"GoPro MET\0"),
        box(b"minf", box(b"gmhd", bytes(4)), links, table),
    )
    track = box(b"trak", box(b"tkhd", struct.pack(">6I", 0, 0, 0, 1, 0, n * scale), bytes(60)), media)
    movie = box(b"moov", box(b"mvhd", struct.pack(">5I", 0, 0, 0, scale, n * scale), bytes(80)), track)
    return head + box(b"mdat", *payloads) + movie


def write(path, orin="ZXY", kind="GPS5", stamped=True, gyro=True):
    payloads = []
    for k in range(PAYLOADS):
        n = N * k + np.arange(N)
        f = np.stack([0.5 + 0 * n, -0.001 * n, 9.75 + 0 * n], -1)
        w = np.stack([0.25 + 0 * n, -0.5 + 0 * n, 0.001 * n], -1)
        payloads.append(
            nest(
                b"DEVC",
                klv(b"DVID", b"L", 4, 1, struct.pack(">I", 1)),
                klv(b"DVNM", b"c", 1, 11, b"HERO9 Black"),
                inertial(b"ACCL", k, f, 2000, orin, stamped),
                inertial(b"GYRO", k, w, 4000, orin, stamped) if gyro else b"",
                gps(k, kind) if kind else b"",
            )
        )
    path.write_bytes(video(payloads))
    return path


@pytest.mark.parametrize("orin", ["ZXY", "YxZ", "zxY", "XzY", ""])
@pytest.mark.parametrize("stamped", [True, False])
def test_axes_are_in_the_order_that_orin_says(tmp_path, orin, stamped):
    r = read_recording(write(tmp_path / "GX010001.MP4", orin, None, stamped))
    n, second = np.arange(N * PAYLOADS), 1 if stamped else 1.001
    assert (r.name, r.axes) == ("GX010001", "LBU")
    np.testing.assert_allclose(r.imu.index, n * second / N, atol=1e-9)
    # Camera axes are left, back, up.
    np.testing.assert_allclose(r.imu[["ax", "ay", "az"]], np.stack([0.001 * n, 0.5 + 0 * n, 9.75 + 0 * n], -1))
    np.testing.assert_allclose(r.imu[["gx", "gy", "gz"]], np.stack([0.5 + 0 * n, 0.25 + 0 * n, 0.001 * n], -1))
    assert any("it has no stamps" in note for note in r.notes) != stamped


@pytest.mark.parametrize("kind", ["GPS5", "GPS9"])
def test_positions_give_the_course(tmp_path, kind):
    r = read_recording(write(tmp_path / "x.mp4", kind=kind))
    assert len(r.gnss) == 30 and any("GPS: 10 rows without a fix dropped" in note for note in r.notes)
    np.testing.assert_allclose(r.gnss.index, 1 + 0.1 * np.arange(30), atol=1e-9)
    np.testing.assert_allclose(r.gnss[["v_e", "v_n"]], np.tile([12.0, 0.0], (30, 1)), atol=1e-3)
    assert r.gnss["alt"].iloc[0] == 488.25 and r.gnss["v_u"].isna().all()


def test_without_a_gyro(tmp_path):
    with pytest.warns(RecordingWarning, match="there is no gyro"):
        assert list(read_recording(write(tmp_path / "x.mp4", gyro=False)).imu) == ["ax", "ay", "az"]


def test_videos_that_hold_none(tmp_path, monkeypatch):
    (tmp_path / "cut.mp4").write_bytes(write(tmp_path / "x.mp4").read_bytes()[:3000])
    (tmp_path / "plain.mp4").write_bytes(box(b"ftyp", b"mp41", bytes(4), b"mp41") + box(b"mdat", bytes(100)))
    for name in ("cut.mp4", "plain.mp4"):
        with pytest.raises(RecordingError, match=f"{name}: it holds no telemetry of a GoPro .*camera's card"):
            read_recording(tmp_path / name)
    (tmp_path / "empty.mp4").write_bytes(video([nest(b"DEVC", klv(b"DVID", b"L", 4, 1, bytes(4)))] * 2))
    with pytest.raises(RecordingError, match=r"empty.mp4: "):
        read_recording(tmp_path / "empty.mp4")
    monkeypatch.setitem(sys.modules, "telemetry_parser", None)
    with pytest.raises(ModuleNotFoundError, match=r"x.mp4: reading it needs telemetry_parser: pip install 'altijax\[l"):
        read_recording(tmp_path / "x.mp4")
