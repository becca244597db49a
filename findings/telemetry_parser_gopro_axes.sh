#!/usr/bin/env bash
# telemetry-parser calls the three values of GoPro's ACCL and GYRO x, y and z in the order of the file, whatever ORIN says
# of them: "ZXY" (HERO5, HERO9 and later) means that the first is z, which points up in a camera that stands upright.
# `normalized_imu()` turns the cameras between (ORIN "YxZ" and the like, with ORIO and MTRX) into that same order, so for
# every camera its x is GoPro's z. A guess by the names puts gravity on a horizontal axis.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/pip" install --quiet --disable-pip-version-check telemetry-parser==0.3.0
"$folder/env/bin/python" - "$folder" <<'PY'
import pathlib
import struct
import sys
from importlib.metadata import version

import telemetry_parser

folder = pathlib.Path(sys.argv[1])


def klv(key, kind, size, repeat, content):
    return key + kind + struct.pack(">BH", size, repeat) + content + bytes(-len(content) % 4)


def nest(key, *parts):
    content = b"".join(parts)
    return klv(key, b"\0", 1, len(content), content)


def box(kind, *parts):
    content = b"".join(parts)
    return struct.pack(">I", 8 + len(content)) + kind + content


def video(payload):
    """An MP4 that holds one second of telemetry and nothing else."""
    head = box(b"ftyp", b"mp41", bytes(4), b"mp41")
    table = box(
        b"stbl",
        box(b"stsd", struct.pack(">II", 0, 1), box(b"gpmd", bytes(6), struct.pack(">HI", 1, 0))),
        box(b"stts", struct.pack(">4I", 0, 1, 1, 1000)),
        box(b"stsc", struct.pack(">5I", 0, 1, 1, 1, 1)),
        box(b"stsz", struct.pack(">4I", 0, 0, 1, len(payload))),
        box(b"stco", struct.pack(">3I", 0, 1, len(head) + 8)),
    )
    links = box(b"dinf", box(b"dref", struct.pack(">II", 0, 1), box(b"url ", bytes(4))))
    media = box(
        b"mdia",
        box(b"mdhd", struct.pack(">5I2H", 0, 0, 0, 1000, 1000, 0, 0)),
        box(b"hdlr", bytes(8), b"meta", bytes(12), b"GoPro MET\0"),
        box(b"minf", box(b"gmhd", bytes(4)), links, table),
    )
    track = box(b"trak", box(b"tkhd", struct.pack(">6I", 0, 0, 0, 1, 0, 1000), bytes(60)), media)
    movie = box(b"moov", box(b"mvhd", struct.pack(">5I", 0, 0, 0, 1000, 1000), bytes(80)), track)
    return head + box(b"mdat", payload) + movie


def parsed(up, *orientation):
    """The first values of a camera at rest whose row has gravity at the place `up`, with these entries beside it."""
    row = [10, 10, 10]
    row[up] = 981
    scale = klv(b"SCAL", b"s", 2, 1, struct.pack(">h", 100))
    streams = [
        nest(b"STRM", *orientation, scale, klv(key, b"s", 6, 4, 4 * struct.pack(">3h", *row))) for key in (b"ACCL", b"GYRO")
    ]
    (folder / "x.mp4").write_bytes(video(nest(b"DEVC", klv(b"DVID", b"L", 4, 1, struct.pack(">I", 1)), *streams)))
    parser = telemetry_parser.Parser(str(folder / "x.mp4"))
    return parser.telemetry()[0]["Accelerometer"]["Data"][0], parser.normalized_imu()[0]["accl"]


def orin(axes):
    return klv(b"ORIN", b"c", 3, 1, axes)


orio = klv(b"ORIO", b"c", 3, 1, b"ZXY"), klv(b"MTRX", b"f", 36, 1, struct.pack(">9f", 0, 0, 1, 0, -1, 0, 1, 0, 0))
print("telemetry-parser", version("telemetry-parser"))
zxy, zxy_normalized = parsed(0, orin(b"ZXY"))
yxz, yxz_normalized = parsed(2, orin(b"YxZ"), *orio)
print("gravity along z, ORIN ZXY: telemetry() has it in", max(zxy, key=zxy.get), "normalized_imu():", zxy_normalized)
print("gravity along z, ORIN YxZ: telemetry() has it in", max(yxz, key=yxz.get), "normalized_imu():", yxz_normalized)
assert (zxy["x"], yxz["z"], zxy_normalized[0], yxz_normalized[0]) == (981, 981, 9.81, 9.81), "the behaviour has changed"
PY
