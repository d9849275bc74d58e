"""Decoder of the CDC family: little-endian 16-bit words, and nothing between them.

There is no mark of any kind (dataq-facts A8): a lost byte shifts all that follows, and only
the rate, the range or a channel of known reading can tell.
"""

from __future__ import annotations

import numpy as np

from pendpipe.acquire.drivers.base import Scans


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

    def feed(self, data: bytes) -> Scans:
        """Decode further bytes; an unfinished scan waits for the next call."""
        data = self._pending + data
        whole = len(data) - len(data) % self.bytes_per_scan
        self._pending = data[whole:]
        counts = np.frombuffer(data, dtype="<i2", count=whole // 2).reshape(-1, self._channels)
        return Scans(counts)

    def finish(self) -> Scans:
        """Forget an unfinished scan; a stream without marks has no losses to tell."""
        self._pending = b""
        return Scans(np.empty((0, self._channels), dtype=np.int16))
