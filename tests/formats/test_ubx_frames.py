"""UBX messages as pyubx2 frames them, found among other bytes."""

import numpy as np
import pytest
from pyubx2 import GET, UBXMessage

from altijax.formats.ubx_frames import frames


def message(kind: int, size: int) -> bytes:
    payload = np.random.default_rng(size).integers(0, 256, size, np.uint8).tobytes()
    return UBXMessage(bytes([kind >> 8]), bytes([kind & 0xFF]), GET, payload=payload).serialize()


def found(content: bytes, *wanted: int):
    return frames(np.frombuffer(content, np.uint8), wanted)


def test_messages_among_other_bytes():
    text, sync = b"$GNGGA,123519.00,4807.038,N*00\r\n", b"\xb5\x62"
    content = sync + message(0x0107, 92) + text + message(0x1003, 0) + sync + b"\x10" + message(0x1002, 700) + sync
    f = found(content)
    assert f.kind.tolist() == [0x0107, 0x1003, 0x1002] and f.length.tolist() == [92, 0, 700]
    assert content[f.start[0] : f.start[0] + 92] == message(0x0107, 92)[6:-2]
    assert f.damaged.size == 0


def test_every_byte_of_a_message_is_covered_by_its_sums():
    whole = message(0x0107, 92)
    for at in range(len(whole)):
        broken = bytearray(whole)
        broken[at] ^= 1 << at % 8
        assert found(bytes(broken)).kind.size == 0, at


def test_damaged_and_cut_messages_are_counted_if_wanted():
    broken = bytearray(message(0x0107, 92))
    broken[50] ^= 1
    content = bytes(broken) + message(0x1002, 40) + message(0x0107, 92)[:40]
    assert found(content, 0x0107).damaged.tolist() == [0, 148]
    assert found(content, 0x1002).damaged.size == 0 and found(content).kind.tolist() == [0x1002]


def test_a_message_inside_another_is_its_content():
    inner = message(0x0107, 92)
    outer = UBXMessage(b"\x02", b"\x13", GET, payload=inner).serialize()
    assert found(outer + inner, 0x0107).kind.tolist() == [0x0213, 0x0107]


@pytest.mark.parametrize("content", [b"", b"\xb5", b"\xb5\x62", b"\xb5\x62\x01\x07\x00\x00\x08"])
def test_what_is_too_short_holds_none(content):
    assert found(content).kind.size == 0


def test_words_come_by_length_and_keep_their_place():
    content = message(0x1002, 12) + message(0x1002, 8) + message(0x1002, 12) + message(0x1002, 0)
    groups = {words.shape[1]: (numbers.tolist(), words.shape) for numbers, words in found(content).words(0x1002)}
    assert groups == {2: ([1], (1, 2)), 3: ([0, 2], (2, 3))}


def test_fields_of_messages_that_are_long_enough():
    layout = np.dtype({"names": ["b"], "formats": ["<u2"], "offsets": [4], "itemsize": 8})
    content = message(0x1002, 4) + message(0x1002, 8) + message(0x1002, 12)
    numbers, fields = found(content).structures(0x1002, layout)
    expected = [int.from_bytes(message(0x1002, size)[10:12], "little") for size in (8, 12)]
    assert numbers.tolist() == [1, 2] and fields["b"].tolist() == expected
