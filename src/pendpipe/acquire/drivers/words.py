"""Decoder of the CDC family: little-endian 16-bit words, and nothing between them.

There is no mark of any kind (dataq-facts A8): a lost byte shifts all that follows, and only
the rate, the range or a channel of known reading can tell. A device whose buffer has
overflowed says ``stop 01`` in the midst of the words, and no more.
"""

from __future__ import annotations

import re
from typing import Final

import numpy as np

from pendpipe.acquire.drivers.base import Loss, Scans
from pendpipe.arrays import AnyArray

STOP_CODE: Final = re.compile(rb"stop 0[123]")
"""In words of chance it stands once in 2e16 bytes."""
STOP_CODE_BYTES: Final = 7
_BEGINNINGS: Final = tuple(b"stop 0"[:size] for size in range(6, 0, -1))


class WordDecoder:
    """One signed little-endian 16-bit word a channel, scan after scan.

    Parameters
    ----------
    channels
        Words in a scan.
    bits
        Bits of a sample, at the top of its word; below may stand digital inputs.
    """

    def __init__(self, channels: int, bits: int = 16) -> None:
        self.bytes_per_scan = 2 * channels
        self._channels = channels
        self._shift = 16 - bits
        self._pending = b""  # an unfinished scan, or what may be the beginning of a stop code
        self._scans = 0
        self._ended = ""  # the stop code, once it was met
        self._discarded = 0

    def feed(self, data: bytes) -> Scans:
        """Decode further bytes; an unfinished scan waits for the next call."""
        if self._ended:
            self._discarded += len(data)
            return self._scans_of(b"")
        data = self._pending + data
        if found := STOP_CODE.search(data):
            self._ended = found.group().decode("ascii")
            whole = found.start() - found.start() % self.bytes_per_scan
            self._discarded = len(data) - whole
        else:
            free = len(data) - next((len(b) for b in _BEGINNINGS if data.endswith(b)), 0)
            whole = free - free % self.bytes_per_scan
        self._pending = b"" if self._ended else data[whole:]
        return self._scans_of(data[:whole])

    def finish(self) -> Scans:
        """Return what was held back, forget an unfinished scan, and tell of a stop code."""
        held = self._pending
        self._pending = b""
        scans = self._scans_of(held[: len(held) - len(held) % self.bytes_per_scan])
        if not self._ended:
            return scans
        return Scans(scans.counts, (Loss(self._scans, self._discarded, 0, reason=self._ended),))

    def _scans_of(self, data: bytes) -> Scans:
        """Turn whole scans into counts; shape (scans, channels)."""
        words: AnyArray = np.frombuffer(data, dtype="<i2").reshape(-1, self._channels)
        self._scans += len(words)
        return Scans(words >> self._shift if self._shift else words)
