"""From the bytes of a stream to scans, in the two forms that the instruments have.

A *scan* is one reading of every enabled channel at one instant; a *count* is the converter's
signed number, zero at 0 V.

Families that mark a scan: every sample is two bytes. Bit 0 of the first byte of a scan is 0, bit 0
of every other byte is 1. The upper seven bits of the second byte are the upper seven bits of the
sample, its lower bits stand at the top of the first byte (dataq-facts A1 for 8, 10 and 12 bits, A7
for 14); the code is offset binary.

The CDC family sends little-endian 16-bit words, and nothing between them (dataq-facts A8). A device
whose buffer has overflowed sends ``stop 01`` among the words, and nothing after it. A lost byte
shifts all that follows; in such a stretch nothing can be told but that it is suspect.
"""

import re
from dataclasses import dataclass
from typing import Final

import numpy as np

from pendpipe.arrays import AnyArray, BoolArray


@dataclass(frozen=True)
class Loss:
    """A place where the bytes did not make scans.

    Parameters
    ----------
    after_scan
        How many good scans were decoded before it.
    discarded_bytes
        The bytes that had to be thrown away to get into step again.
    lost_scans
        The scans they stand for: the least whole number that could have held them.
    reason
        The device's message (``"stop 01"``), or ``"damage"`` of the raw file.
    """

    after_scan: int
    discarded_bytes: int
    lost_scans: int
    reason: str = ""

    @property
    def is_gap(self) -> bool:
        """Whether scans are missing: bytes before the first scan are none, unless recorded."""
        return self.after_scan > 0 or self.reason == "damage"


@dataclass(frozen=True)
class Scans:
    """What some bytes are.

    Parameters
    ----------
    counts
        Signed counts, shape (scans, channels), 16-bit integers.
    suspect
        Scans that may not be what the device read, shape (scans,).
    losses
        The losses met, in order.
    """

    counts: AnyArray
    suspect: BoolArray
    losses: tuple[Loss, ...] = ()


def marked_scans(data: bytes, channels: int, bits: int) -> Scans:
    """Decode two bytes a sample with a frame mark in bit 0.

    Parameters
    ----------
    data
        The stream; an unfinished scan at its end is left out.
    channels
        Samples in a scan.
    bits
        Bits of a sample, 8 to 14.

    Notes
    -----
    A byte with bit 0 = 0 starts a scan; it is whole if the next start is at least a scan away. The
    bytes between the end of a whole scan and the next start, and the scans cut short, are thrown
    away; a whole scan that such bytes follow is suspect, since one of them may belong inside it.
    What keeps the pattern of the marks (flipped data bits, an even number of bytes lost at the
    wrong place, whole scans) can't be seen here.
    """
    size = 2 * channels
    octets = np.frombuffer(data, dtype=np.uint8)
    starts = np.flatnonzero((octets & 1) == 0)
    length = np.diff(starts, append=len(octets))
    whole = length >= size
    discard = np.where(whole, length - size, length)
    if len(starts) and not whole[-1]:
        discard[-1] = 0  # not broken but unfinished
    lead = int(starts[0]) if len(starts) else len(octets)
    index = np.flatnonzero(whole)
    # Thrown away before each whole scan and, last of all, before the end.
    before = lead + np.concatenate(([0], np.cumsum(discard)))
    thrown = np.diff(before[np.append(index, len(starts))], prepend=0)
    losses = tuple(
        Loss(n, int(thrown[n]), -(-int(thrown[n]) // size)) for n in np.flatnonzero(thrown).tolist()
    )
    words = np.ascontiguousarray(octets[starts[index][:, None] + np.arange(size)]).view("<u2")
    code = (words & 0x00FF) >> (15 - bits) | (words >> 9) << (bits - 7)
    counts = np.asarray(code.astype(np.int16) - np.int16(1 << (bits - 1)))
    return Scans(counts, discard[index] > 0, losses)


STOP_CODE: Final = re.compile(rb"stop 0[123]")
"""In words of chance it stands once in 2e16 bytes."""


def plain_scans(data: bytes, channels: int, bits: int = 16) -> Scans:
    """Decode one signed little-endian 16-bit word a channel, scan after scan.

    Parameters
    ----------
    data
        The stream; an unfinished scan at its end, or what follows a stop code, is left out.
    channels
        Words in a scan.
    bits
        Bits of a sample, at the top of its word; below may stand digital inputs.
    """
    stop = STOP_CODE.search(data)
    end = stop.start() if stop else len(data)
    end -= end % (2 * channels)
    words: AnyArray = np.frombuffer(data[:end], dtype="<i2").reshape(-1, channels)
    message = Loss(len(words), len(data) - end, 0, stop.group().decode()) if stop else None
    losses = (message,) if message else ()
    return Scans(words >> (16 - bits), out_of_step(data[:end], channels), losses)


_BLOCK: Final = 48
"""Scans that are looked at together."""
_CLEARLY: Final = 8.0
"""How many times rougher the wrong reading must be."""
_MOSTLY: Final = 0.5
"""Share of the steps that must say so: a few odd ones are spikes, or the edges of clipping."""


def out_of_step(data: bytes, channels: int) -> BoolArray:
    """Find the scans of plain words that are cut across, shape (scans,).

    In words of a smooth signal the low byte is noise and the high byte hardly moves. After an odd
    number of lost or doubled bytes they change places, and what is read one byte later is smooth
    instead. Suspect is what lies between the last block of 48 scans that is smooth as it stands and
    the next that is; a signal that is never so is left alone, as are losses of whole words, a
    signal that moves by more than some 2000 codes a scan, and fewer than 48 scans at the end.
    """
    scans = len(data) // (2 * channels)
    suspect = np.zeros(scans, dtype=bool)
    blocks = (scans - 1) // _BLOCK  # the last word has no byte behind it
    if blocks < 1:
        return suspect
    here, later = (
        np.abs(np.diff(words.reshape(blocks, _BLOCK, channels).astype(np.int32), axis=1)).sum(
            axis=2
        )
        for words in (np.frombuffer(data, "<i2", blocks * _BLOCK * channels, at) for at in (0, 1))
    )
    rough, rough_later = here.mean(axis=1), later.mean(axis=1)
    in_step = _CLEARLY * rough < rough_later
    out = _CLEARLY * rough_later < rough
    out &= (later < here).mean(axis=1) > _MOSTLY
    out &= np.logical_or.accumulate(in_step)
    clear = np.append(np.flatnonzero(in_step), blocks + 1)
    for place in np.unique(np.searchsorted(clear, np.flatnonzero(out))).tolist():
        # A few bad scans leave a block smooth enough: those at the ends are suspect, too.
        suspect[clear[place - 1] * _BLOCK : (clear[place] + 1) * _BLOCK] = True
    return suspect
