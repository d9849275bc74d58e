"""From the bytes of a stream to scans: samples with a frame mark, and words without any.

Families that mark a scan: every sample is two bytes. Bit 0 of the first byte of a scan is 0,
bit 0 of every other byte is 1. The upper seven bits of the second byte are the upper seven bits
of the sample, its lower bits stand at the top of the first byte (dataq-facts A1 for 8, 10
and 12 bits, A7 for 14); the code is offset binary.

The CDC family sends little-endian 16-bit words, and nothing between them (dataq-facts A8): a
lost byte shifts all that follows, and only the rate, the range or a channel of known reading
show it. A device whose buffer has overflowed sends ``stop 01`` among the words, and
nothing after it.

A *scan* is one reading of every enabled channel at one instant; a *count* is the converter's
signed number, zero at 0 V.
"""

import re
from dataclasses import dataclass, field
from typing import Final, TypeAlias

import numpy as np

from pendpipe.arrays import AnyArray


@dataclass(frozen=True)
class Loss:
    """A place where the bytes did not make scans.

    Parameters
    ----------
    after_scan
        How many good scans were decoded before it (since the decoder was made).
    discarded_bytes
        The bytes that had to be thrown away to get into step again.
    lost_scans
        The scans they stand for: the least whole number that could have held them. Whole
        scans missing besides leave no trace in the bytes, only in the clock.
    suspect_before
        Whether the scan before is suspect too: bytes without a frame mark followed it, so
        that one of them may belong inside it.
    reason
        The device's message (``"stop 01"``), or ``"clock"`` where the bytes are whole
        and the recorder's clock tells of the loss.
    """

    after_scan: int
    discarded_bytes: int
    lost_scans: int
    suspect_before: bool = False
    reason: str = ""


@dataclass(frozen=True)
class Scans:
    """What a decoder made of some bytes.

    Parameters
    ----------
    counts
        Signed counts, shape (scans, channels), 16-bit integers.
    losses
        The losses met, in order.
    """

    counts: AnyArray
    losses: tuple[Loss, ...] = field(default=())

    def __len__(self) -> int:
        return len(self.counts)


class SyncBitDecoder:
    """Two bytes a sample with a frame mark in bit 0.

    Parameters
    ----------
    channels
        Samples in a scan.
    bits
        Bits of a sample, 8 to 14.

    Notes
    -----
    What breaks the pattern of the marks is noticed, and costs the scans it touches; bytes
    are thrown away up to the next byte with bit 0 = 0 that begins a whole scan. What keeps
    the pattern (flipped data bits, an even number of bytes lost at the wrong place, whole
    scans) can't be seen here.
    """

    ended = ""
    """Families with a mark send no message that their stream has ended."""

    def __init__(self, channels: int, bits: int) -> None:
        self.bytes_per_scan = 2 * channels
        self._bits = bits
        self._marks = np.full(channels, 0x0101, dtype="<u2")
        self._marks[0] = 0x0100
        self._pending = b""  # the beginning of a scan
        self._scans = 0
        self._discarded = 0  # since the last good scan
        self._suspect = False  # the last good scan was followed by bytes without a start

    def feed(self, data: bytes) -> Scans:
        """Decode further bytes; an unfinished scan waits for the next call."""
        data = self._pending + data
        whole = len(data) - len(data) % self.bytes_per_scan
        words = np.frombuffer(data, dtype="<u2", count=whole // 2).reshape(-1, len(self._marks))
        rest = data[whole:]
        in_step = self._begins_scan(rest) and bool(((words & 0x0101) == self._marks).all())
        if self._discarded or not in_step:
            return self._resynchronise(data)
        self._pending = rest
        self._scans += len(words)
        return Scans(self._counts(words))

    def finish(self) -> Scans:
        """Say what is left over at the end: no counts, perhaps a loss."""
        nothing = np.empty((0, len(self._marks)), dtype=np.int16)
        left = self._discarded
        self._discarded, self._pending = 0, b""
        return Scans(nothing, (self._loss(self._scans, left, self._suspect),) if left else ())

    @staticmethod
    def _begins_scan(rest: bytes) -> bool:
        """Whether these bytes can be the beginning of a scan (nothing at all can)."""
        return all((byte & 1) == (place > 0) for place, byte in enumerate(rest))

    def _counts(self, words: AnyArray) -> AnyArray:
        """Take the samples out of words that are in step; shape (scans, channels)."""
        code = (words & 0x00FF) >> (15 - self._bits) | (words >> 9) << (self._bits - 7)
        return np.asarray(code.astype(np.int16) - np.int16(1 << (self._bits - 1)))

    def _resynchronise(self, data: bytes) -> Scans:
        """Find the whole scans between broken ones, and count what is thrown away.

        A byte with bit 0 = 0 starts a scan; it is whole if the next start is at least a
        scan away. The bytes between the end of a whole scan and the next start, and the
        scans cut short, are thrown away.
        """
        size = self.bytes_per_scan
        octets = np.frombuffer(data, dtype=np.uint8)
        starts = np.flatnonzero((octets & 1) == 0)
        lead = int(starts[0]) if len(starts) else len(octets)
        length = np.diff(starts, append=len(octets))
        good = length >= size
        discard = np.where(good, length - size, length)
        self._pending = b""
        if len(starts) and not good[-1]:
            # The last scan is not broken but unfinished.
            self._pending = data[starts[-1] :]
            discard[-1] = 0
        # Thrown away before each start, since the beginning of these bytes.
        before = self._discarded + lead + np.concatenate(([0], np.cumsum(discard)))
        followed = self._suspect if self._discarded else (lead > 0 and self._scans > 0)
        index = np.flatnonzero(good)
        spent = 0
        thrown = before[index]
        fresh = np.diff(thrown, prepend=0)
        direct = [followed, *(discard[index[:-1]] > 0).tolist()]
        losses = [
            self._loss(self._scans + n, int(fresh[n]), direct[n])
            for n in np.flatnonzero(fresh).tolist()
        ]
        if len(index):
            spent = int(thrown[-1])
            followed = bool(discard[index[-1]])
        self._discarded = int(before[-1]) - spent
        self._suspect = followed
        words = np.ascontiguousarray(octets[starts[index][:, None] + np.arange(size)]).view("<u2")
        self._scans += len(index)
        return Scans(self._counts(words.reshape(-1, len(self._marks))), tuple(losses))

    def _loss(self, after_scan: int, discarded: int, suspect: bool) -> Loss:
        return Loss(
            after_scan,
            discarded,
            -(-discarded // self.bytes_per_scan),
            suspect_before=suspect and after_scan > 0,
        )


_STOP_CODE: Final = re.compile(rb"stop 0[123]")
"""In words of chance it stands once in 2e16 bytes."""
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
        # An unfinished scan; or what may begin a stop code; or that code and all behind it.
        self._pending = b""
        self._scans = 0
        self.ended = ""  # the stop code, once it was met

    def feed(self, data: bytes) -> Scans:
        """Decode further bytes; an unfinished scan waits for the next call."""
        data = self._pending + data
        if found := _STOP_CODE.search(data):
            self.ended = found.group().decode("ascii")
            free = found.start()
        else:
            free = len(data) - next((len(b) for b in _BEGINNINGS if data.endswith(b)), 0)
        whole = free - free % self.bytes_per_scan
        self._pending = data[whole:]
        return self._scans_of(data[:whole])

    def finish(self) -> Scans:
        """Return what was held back, forget an unfinished scan; or tell of a stop code."""
        held = self._pending
        if self.ended:
            loss = Loss(self._scans, len(held), 0, reason=self.ended)
            return Scans(self._scans_of(b"").counts, (loss,))
        self._pending = b""
        return self._scans_of(held[: len(held) - len(held) % self.bytes_per_scan])

    def _scans_of(self, data: bytes) -> Scans:
        """Turn whole scans into counts; shape (scans, channels)."""
        words: AnyArray = np.frombuffer(data, dtype="<i2").reshape(-1, self._channels)
        self._scans += len(words)
        return Scans(words >> self._shift if self._shift else words)


Decoder: TypeAlias = SyncBitDecoder | WordDecoder
"""Bytes in, scans and losses out; how the bytes are cut into pieces changes nothing."""
