"""From the bytes of a stream to scans, in the two forms that the instruments have.

A *scan* is one reading of every enabled channel at one instant; a *count* is the converter's
signed number, zero at 0 V.

Families that mark a scan: every sample is two bytes. Bit 0 of the first byte of a scan is 0, bit 0
of every other byte is 1. The upper seven bits of the second byte are the upper seven bits of the
sample, its lower bits stand at the top of the first byte (dataq-facts A1 for 8, 10 and 12 bits, A7
for 14); the code is offset binary.

The CDC family sends little-endian 16-bit words, and nothing between them (dataq-facts A8). A device
whose buffer has overflowed sends ``stop 01`` among the words, and nothing after it. A lost byte
shifts all that follows; in such a stretch nothing can be told but that it is suspect. After a lost
word the channels change places, which smooth signals show (`exchanged`).

In either form a reading may be made of two halves of others; it is suspect where it is out of line
(`out_of_line`).
"""

import math
import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from pendpipe.arrays import AnyArray, BoolArray, FloatArray, IntArray


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
    parts, losses, begin = [], [], 0
    suspect = out_of_step(data[:end], channels)
    words: AnyArray = np.frombuffer(data[:end], dtype="<i2")
    while place := exchanged(words[begin:].reshape(-1, channels)):
        scan, spoilt = place
        parts.append(np.arange(begin, begin + scan * channels).reshape(-1, channels))
        losses.append(Loss(sum(map(len, parts)), 2 * spoilt, 1))
        begin += scan * channels + spoilt
        words = words[: begin + (len(words) - begin) // channels * channels]
    parts.append(np.arange(begin, len(words)).reshape(-1, channels))
    kept = np.concatenate(parts)
    if stop:
        losses.append(Loss(len(kept), len(data) - end, 0, stop.group().decode()))
    doubt = suspect[kept[:, 0] // channels]
    for loss in losses[: len(parts) - 1]:
        doubt[max(loss.after_scan - _NEAR, 0) : loss.after_scan + _NEAR] = True
    return Scans(words[kept] >> (16 - bits), doubt, tuple(losses))


_NEAR: Final = 2
"""Scans on either side of a lost word that may hold it."""


def exchanged(words: AnyArray) -> tuple[int, int] | None:
    """Find the first scan, of shape (scans, channels), behind which channels have changed places.

    Returns
    -------
    tuple of int, or None
        The scan in which words are missing or doubled, and how many words belong to it.

    Notes
    -----
    A cubic goes through four scans before one and four behind. Where it leaves more than eight
    times its median in at least two channels, and at most four times in all of them (3.4 is the
    most of a million by chance) if those behind are read so many channels on, words were lost or
    doubled. If they were lost, the channels that went over the end of a scan are of the next one;
    if doubled, the others are of the last.
    Where two channels read the same, within the noise, nothing shows it.
    """
    channels = words.shape[1]
    for begin, read in _pieces(words if channels > 1 else words[:0]):
        left, before, behind = _about(read)
        usual = np.maximum(np.median(left, axis=0), 1.0)
        here = np.flatnonzero((left > _CLEARLY * usual).sum(axis=1) > 1)
        found: list[tuple[int, int]] = []
        for moved in range(1, channels):
            turned = np.roll(behind[here], moved, axis=2)
            over = (np.arange(channels) < moved).astype(int)
            for late, spoilt in ((over, channels - moved), (over - 1, 2 * channels - moved)):
                good = (_left(before[here], turned, late) < 0.5 * _CLEARLY * usual).all(axis=1)
                found += [(begin + int(scan), spoilt) for scan in here[good][:1]]
        if found:
            return min(found)
    return None


_PIECE: Final = 1 << 15
"""Scans that are looked at together: those of days take no more memory than those of an hour."""


def _pieces(counts: AnyArray) -> Iterator[tuple[int, FloatArray]]:
    """Yield pieces, and the number of the first scan that has four before it in the piece."""
    ends = len(_BEFORE)
    for begin in range(0, max(len(counts) - _BLOCK - 2 * ends + 1, 0), _PIECE):
        yield begin + ends, counts[begin : begin + _PIECE + 2 * ends].astype(np.float64)


def _about(read: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """What a cubic leaves about each scan, (n, channels), and the four before and behind each."""
    each = _around(read)
    squares = np.zeros_like(each[0])
    for row in _OFF_CUBIC[0]:
        squares += sum(factor * one for factor, one in zip(row, each, strict=True)) ** 2
    window = sliding_window_view(read, 9, axis=0).transpose(0, 2, 1)
    return np.sqrt(squares / 8.0), window[:, :4], window[:, 5:]


def _around(read: FloatArray) -> list[FloatArray]:
    """The four scans before and the four behind each that has them, (n, channels) each."""
    return [read[at : at + len(read) - 8] for at in (*range(4), *range(5, 9))]


def _left(before: AnyArray, behind: AnyArray, late: IntArray) -> AnyArray:
    """What a cubic through four scans before one, and four behind, leaves: shape (n, channels).

    Those behind are so many scans late, by channel.
    """
    together = np.concatenate([before, behind], axis=1)
    off = np.stack([_OFF_CUBIC[number] for number in late.tolist()], axis=2)
    return np.asarray(np.sqrt(np.sum(np.einsum("ijc,njc->nic", off, together) ** 2, axis=1) / 8.0))


def _off_cubic(late: int) -> AnyArray:
    """Four directions of eight readings that no cubic has, shape (4, 8)."""
    powers = np.vander(np.concatenate([_BEFORE, _BEHIND + late]).astype(np.float64), 4)
    return np.linalg.qr(powers, mode="complete")[0][:, 4:].T


_BEFORE: Final = np.arange(-4, 0)
"""Four readings before a place: those of a cubic."""
_BEHIND: Final = np.arange(1, 5)
"""And four behind it."""
_AT_THE_SCAN: Final = np.linalg.pinv(
    np.vander(np.concatenate([_BEFORE, _BEHIND]).astype(np.float64), 4)
)[-1]
"""By which eight readings give the cubic's at the scan between them."""
_OFF_CUBIC: Final = {late: _off_cubic(late) for late in (-1, 0, 1)}
"""Weights by which eight readings tell how far a stretch is late, in rows."""


def out_of_line(counts: AnyArray) -> BoolArray:
    """Find scans with a reading that may be made of two halves of others, shape (scans,).

    Two bytes lost or doubled leave such a reading, and move those behind by a scan. A cubic goes
    through the four scans before one and the four behind, as they stand, or late by one or by minus
    one. Suspect is a scan if one of these leaves less than four times the usual, and the reading is
    more than eight times the usual off it, or the cubic of those as they stand leaves more than
    eight times its usual. Usual is the median of 48 scans. What is no more than the noise can't be
    seen, nor what is about equal readings, where a signal is cut off.
    """
    odd = np.zeros(len(counts), dtype=bool)
    as_it_stands = np.zeros(counts.shape[1], dtype=int)
    for begin, read in _pieces(counts):
        left, before, behind = _about(read)
        usual = np.maximum(_usual(left), _ROUNDED)
        seen = sum(part * one for part, one in zip(_AT_THE_SCAN, _around(read), strict=True))
        off = np.abs(read[4:-4] - seen)
        outlying = off > _CLEARLY * np.maximum(_usual(off), 1.0)
        level = np.zeros(left.shape, dtype=bool)
        for three in (before[:, :3], before[:, 1:], behind[:, :3], behind[:, 1:]):
            level |= np.ptp(three, axis=1) == 0.0
        moved = left > _CLEARLY * usual
        here = np.flatnonzero(((outlying | moved) & ~level).any(axis=1))
        for late in (-1, 0, 1):
            rest = _left(before[here], behind[here], as_it_stands + late)
            good = (rest < 0.5 * _CLEARLY * usual[here]).all(axis=1)
            odd[begin + here[good]] = True
    return odd


def _usual(left: AnyArray) -> AnyArray:
    """Median of the block that each scan is in, as a standard deviation; shape as given."""
    blocks = len(left) // _BLOCK
    inside = left[: blocks * _BLOCK].reshape(blocks, _BLOCK, -1)
    usual = 1.4826 * np.median(inside, axis=1)
    return np.asarray(usual[np.minimum(np.arange(len(left)) // _BLOCK, blocks - 1)])


_ROUNDED: Final = math.sqrt(0.5 / 12.0)
"""What such a cubic leaves of numbers that are rounded alone: four directions of eight."""


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
