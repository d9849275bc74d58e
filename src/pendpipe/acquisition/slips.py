"""Bytes that slipped out of step in a stream without marks, found by the signal itself.

In words of 16 bits the low byte of a smooth signal is noise and the high byte hardly moves.
After an odd number of lost or doubled bytes they change places: what was smooth becomes noise
of the full scale, and what is read one byte later becomes smooth. Only that *change*, from one
to the other, is believed: a signal that looks odd throughout is left alone.
"""

from collections.abc import Iterator
from typing import Final, NamedTuple

import numpy as np

from pendpipe.arrays import AnyArray, FloatArray

_SNIPPET: Final = 48
"""Scans that are looked at, out of every `_EVERY`."""
_EVERY: Final = 1024
_CLEARLY: Final = 8.0
"""How many times rougher the wrong reading must be."""
_MOSTLY: Final = 0.5
"""Share of the steps that must say so: a few odd ones are spikes, or the edges of clipping."""
_MARGIN: Final = 3
"""Scans on either side of a slip that are not believed."""
_NEAR: Final = 8


class Cut(NamedTuple):
    """Where a stream is taken apart: what is between the two bytes is thrown away.

    Parameters
    ----------
    last_byte
        Up to here the scans are in step as before: a whole number of them since the last cut.
    next_byte
        From here on they are in step again.
    reason
        ``"slip"``, ``"slip, channels unsure"`` where the levels don't tell which channel is
        which behind it, or ``"damage"``.
    bytes_missing
        What the stream lacks there besides.
    """

    last_byte: int
    next_byte: int
    reason: str
    bytes_missing: int = 0


def find_slips(data: bytes, channels: int, begin: int = 0) -> Iterator[Cut]:
    """Find where a stream of little-endian 16-bit words slips by an odd number of bytes.

    Parameters
    ----------
    data
        The stream.
    channels
        Words in a scan.
    begin
        From here on the words are held to be in step.

    Yields
    ------
    Cut
        In order. What slips by an even number (whole words: the channels change places), a
        signal that changes by more than some 2000 codes from scan to scan, or that stands
        still to the last bit, can't be found so.
    """
    while found := _next_slip(data, begin, 2 * channels):
        yield found
        begin = found.next_byte


def _next_slip(data: bytes, begin: int, size: int) -> Cut | None:
    """Find the first slip behind `begin`, where the words are held to be in step."""
    scans = (len(data) - begin) // size - 1
    in_step: int | None = None
    for first in [*range(0, scans - _SNIPPET, _EVERY), scans - _SNIPPET][scans < _SNIPPET :]:
        here, beside = _roughness(data, begin + first * size, _SNIPPET, size)
        if _CLEARLY * here.mean() < beside.mean():
            in_step = first
        # Nearly everything has to be smoother when read a byte later.
        elif (
            in_step is not None
            and _CLEARLY * beside.mean() < here.mean()
            and np.mean(beside < here) > _MOSTLY
        ):
            return _slip(data, begin, size, in_step, first + _SNIPPET)
    return None


def _slip(data: bytes, begin: int, size: int, first: int, last: int) -> Cut:
    """Place a slip between two scans: the sum of what is smooth on either side is least there."""
    here, beside = _roughness(data, begin + first * size, last - first, size)
    at = max(_MARGIN, first + int(np.argmin(np.cumsum(here - beside))) + 1)
    stop = begin + (at - _MARGIN) * size
    start = begin + (at + _MARGIN) * size
    expected = _onwards(_words(data, stop - _NEAR * size, _NEAR, size))
    jumps = [
        float(np.abs(_words(data, start + odd, _NEAR, size).mean(axis=0) - expected).sum())
        for odd in range(1, size, 2)
    ]
    best = int(np.argmin(jumps))
    # Channels that read alike can't decide: one lost byte is the most likely then.
    if len(jumps) == 1 or sorted(jumps)[1] >= 2.0 * jumps[best]:
        return Cut(stop, start + 2 * best + 1, "slip")
    return Cut(stop, start + size - 1, "slip, channels unsure")


def _onwards(words: AnyArray) -> FloatArray:
    """Where each channel will be behind the gap, on a straight line; shape (channels,)."""
    half = len(words) // 2
    early, late = words[:half].mean(axis=0), words[half:].mean(axis=0)
    ahead = (0.5 * len(words) + 0.5 * half + 2 * _MARGIN) / half
    return np.asarray(late + ahead * (late - early))


def _roughness(data: bytes, begin: int, scans: int, size: int) -> tuple[FloatArray, FloatArray]:
    """Steps from scan to scan, in codes, as the words stand and as they stand a byte later.

    Both of shape (scans - 1,), summed over the channels.
    """
    both = [_words(data, begin + late, scans, size) for late in (0, 1)]
    here, beside = (np.abs(np.diff(words, axis=0)).sum(axis=1) for words in both)
    return here.astype(np.float64), beside.astype(np.float64)


def _words(data: bytes, begin: int, scans: int, size: int) -> AnyArray:
    """Read so many scans, shape (scans, channels); fewer at the end of the stream."""
    begin = max(begin, 0)
    scans = max(1, min(scans, (len(data) - begin) // size))
    words = np.frombuffer(data, dtype="<i2", count=scans * size // 2, offset=begin)
    return words.reshape(scans, size // 2).astype(np.int64)
