"""Messages of a UBX file: found by their sync bytes, believed by their check sums, all of them at once."""

from dataclasses import dataclass

import numpy as np

_AROUND = 8
"""Bytes of a frame beside its payload: sync, class, identifier, length before it, two check sums after it."""


@dataclass(frozen=True)
class Frames:
    """The whole messages of a file, in its order.

    Attributes
    ----------
    content : (bytes,)
        The file.
    kind : (messages,)
        Class and identifier, as one number of 16 bits.
    start, length : (messages,)
        Place and size of each payload in `content`.
    damaged : (others,)
        Places of frames of the wanted kinds with a wrong check sum or cut short.
    """

    content: np.ndarray
    kind: np.ndarray
    start: np.ndarray
    length: np.ndarray
    damaged: np.ndarray

    def structures(self, kind: int, layout: np.dtype) -> tuple[np.ndarray, np.ndarray]:
        """Numbers (of `Frames`) and first fields of the messages of a kind, those that are too short left out."""
        found = np.flatnonzero((self.kind == kind) & (self.length >= layout.itemsize))
        return found, self._payloads(found, layout.itemsize).view(layout)[:, 0]

    def words(self, kind: int) -> list[tuple[np.ndarray, np.ndarray]]:
        """Numbers and payloads in unsigned words of 32 bits of the messages of a kind, one pair for each length."""
        of_kind = np.flatnonzero(self.kind == kind)
        counts = self.length[of_kind] // 4
        by_count = [(of_kind[counts == count], 4 * int(count)) for count in np.unique(counts) if count]
        return [(found, self._payloads(found, size).view("<u4")) for found, size in by_count]

    def _payloads(self, found: np.ndarray, size: int) -> np.ndarray:
        return self.content[self.start[found, None] + np.arange(size)]


def frames(content: np.ndarray, wanted: tuple[int, ...] = ()) -> Frames:
    """The messages among bytes (bytes,), whatever else stands between; `wanted` are the kinds missed if damaged."""
    sync = np.flatnonzero((content[:-7] == 0xB5) & (content[1:-6] == 0x62))
    header = content[sync[:, None] + np.arange(2, 6)].astype(np.int64)
    kind, length = header[:, 0] << 8 | header[:, 1], header[:, 2] | header[:, 3] << 8
    end = sync + length + _AROUND
    good = end <= content.size
    good[good] = _summed(content, sync[good], end[good])
    good[good] = _apart(sync[good], end[good])
    last = np.searchsorted(sync[good], sync, side="right") - 1
    inside = (last >= 0) & (sync < np.append(end[good], 0)[last])
    damaged = sync[~inside & np.isin(kind, wanted)]
    return Frames(content, kind[good], sync[good] + 6, length[good], damaged)


def _summed(content: np.ndarray, sync: np.ndarray, end: np.ndarray) -> np.ndarray:
    """Which frames have the check sums of their content; both are sums of bytes modulo 256, differences of two here."""
    first = np.append(np.zeros(1, np.uint8), np.cumsum(content, dtype=np.uint8))
    second = np.append(np.zeros(1, np.uint8), np.cumsum(first[1:], dtype=np.uint8))
    start, stop = sync + 2, end - 2
    a = first[stop] - first[start]
    b = second[stop] - second[start] - (stop - start).astype(np.uint8) * first[start]
    return (a == content[stop]) & (b == content[stop + 1])


def _apart(sync: np.ndarray, end: np.ndarray) -> np.ndarray:
    """Which frames do not begin inside one before them, as a frame that is the payload of another does."""
    keep = np.ones(len(sync), bool)
    if (sync[1:] >= end[:-1]).all():
        return keep
    free = 0
    for k, (begins, ends) in enumerate(zip(sync.tolist(), end.tolist(), strict=True)):
        keep[k] = begins >= free
        free = ends if keep[k] else free
    return keep
