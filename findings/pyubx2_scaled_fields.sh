#!/usr/bin/env bash
# pyubx2 writes angles that are scaled by 1e-5 (NAV-ATT roll, pitch, heading; NAV-PVT headMot, headVeh; NAV-PVAT) one unit
# too small in about half of all cases: it divides by the scale and cuts off, and -2.5 / 1e-5 is -249999.99999999997.
# The message object still says -2.5, only its bytes and what is parsed of them are off. Fields of 1e-7 are right. Whoever
# writes UBX as a test's truth should take angles that survive, or write integers by struct.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/pip" install --quiet --disable-pip-version-check pyubx2==1.4.0 pynmeagps==1.1.8 pyrtcm==1.2.1
"$folder/env/bin/python" - <<'PY'
from importlib.metadata import version

from pyubx2 import GET, UBXMessage, UBXReader

print("pyubx2", version("pyubx2"))
m = UBXMessage("NAV", "NAV-ATT", GET, pitch=-2.5)
again = UBXReader.parse(m.serialize())
print("pitch", m.pitch, "deg is parsed as", again.pitch)


def lost(identity, field, place, scale, units):
    """Share of whole units that come out of the bytes as another number."""
    off = 0
    for unit in units:
        payload = UBXMessage("NAV", identity, GET, **{field: unit / scale}).payload
        off += int.from_bytes(payload[place : place + 4], "little", signed=True) != unit
    return off / len(units)


angles = lost("NAV-ATT", "pitch", 12, 100_000, range(-9_000_000, 9_000_001, 9_000))
positions = lost("NAV-POSLLH", "lat", 8, 10_000_000, range(-900_000_000, 900_000_001, 900_000))
print(f"of 2001 pitches in whole units of 1e-5 deg {angles:.0%} are written wrongly, of 2001 latitudes {positions:.0%}")
assert again.pitch == -2.49999 and 0.3 < angles < 0.7 and positions == 0, "the behaviour has changed"
PY
