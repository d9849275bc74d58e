"""Decoder of the CDC family: little-endian 16-bit words, and nothing between them.

There is no mark of any kind (dataq-facts A8): a lost byte shifts all that follows, and only
the rate, the range or a channel of known reading can tell.
"""

from __future__ import annotations

import numpy as np

from pendpipe.acquire.drivers.base import Loss, Scans


class WordDecoder:
    """One signed little-endian 16-bit word a channel, scan after scan.

    Parameters
    ----------
    channels
        Words in a scan.
    """

    def __init__(self, channels: int) -> None:
        self.bytes_per_scan = 2 * channels
        self._channels = channels
        self._pending = b""
        self._scans = 0

    def feed(self, data: bytes) -> Scans:
        """Decode further bytes; an unfinished scan waits for the next call."""
        data = self._pending + data
        whole = len(data) - len(data) % self.bytes_per_scan
        self._pending = data[whole:]
        counts = np.frombuffer(data, dtype="<i2", count=whole // 2).reshape(-1, self._channels)
        self._scans += len(counts)
        return Scans(counts)

    def finish(self) -> Scans:
        """Say what is left over at the end: no counts; part of a scan is a loss of one."""
        left, self._pending = len(self._pending), b""
        nothing = np.empty((0, self._channels), dtype=np.int16)
        return Scans(nothing, (Loss(self._scans, left, 1),) if left else ())
