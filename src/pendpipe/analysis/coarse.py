"""Few readings in a cycle: the swing between them, by which its half cycles can be followed.

Extremes are found among readings, and 4 to 16 in a cycle rarely lie at one. So a wave of the
motion's frequency, its amplitude and phase as straight lines, is fitted to two and a half cycles
about each moment. That shows where the half cycles are; the fit of the motion takes the readings
themselves.
"""

import math
from typing import Final, NamedTuple

import numpy as np

from pendpipe.analysis.noise import scatter
from pendpipe.arrays import FloatArray

DENSE: Final = 16.0
"""Readings in a cycle from which half cycles are followed as they are."""
HARDLY: Final = 7.0
"""Readings in a cycle below which extremes are not even told from other motion."""
_FEWEST: Final = 16
"""Readings in which anything is sought, as in `turning_points.measure`."""
_SPARSE: Final = 3.6
"""Readings in a cycle below which a second harmonic can't be told from a wander."""
_WANTED: Final = 32.0
"""Points in a cycle, read and computed: a parabola through three is right to 5e-4 of the swing."""
_WINDOW: Final = 2.5
"""Cycles that a wave is fitted to."""
_EVEN: Final = 0.2
"""Part of an interval by which readings of an even record may be off."""
_AT_ONCE: Final = 1 << 15
"""Moments whose waves are fitted together."""
_MOST: Final = 1 << 16
"""Readings whose spectrum tells the frequency."""


class Between(NamedTuple):
    """Readings between those of a coarse record."""

    time_s: FloatArray
    values: FloatArray
    noise_rms: float
    """Of a reading of the record, about the wave of its window."""
    window: int
    """Readings that each is from."""


def between(
    time_s: FloatArray, values: FloatArray, step: float | None = None, dense: float = DENSE
) -> Between | None:
    """Read a coarse record between its readings; None where it is not coarse.

    Parameters
    ----------
    time_s, values
        The readings, shape (n,).
    step
        Between neighbouring readings, where known.
    dense
        Readings in a cycle from which it is not coarse.
    """
    count = len(values)
    above = values > float(np.mean(values))
    passages = np.count_nonzero(above[1:] != above[:-1])
    if count < _FEWEST or 2.0 * count > 1.2 * dense * passages:
        return None
    intervals = np.diff(time_s)
    interval = float(np.mean(intervals))
    if np.max(np.abs(intervals - interval)) > _EVEN * interval:
        return _between_uneven(time_s, values, step, dense) if count < _MOST_UNEVEN else None
    per_cycle = 1.0 / max(_frequency(values[:_MOST]), 1e-9)
    if not _SPARSE < per_cycle < dense:
        return None
    omega = 2.0 * math.pi / per_cycle
    window = min(2 * (round(_WINDOW * per_cycle) // 2) + 1, count - 1 + count % 2)
    reach = window // 2
    inside = np.arange(-reach, reach + 1.0)
    inverse = np.linalg.pinv(_wave(inside, omega), rcond=1e-9)
    windows = np.lib.stride_tricks.sliding_window_view(values, window)
    explained = (_wave(inside, omega) @ inverse).T
    # Some at a time: together they would be many times the recording.
    squares = [
        float(np.sum((part - part @ explained) ** 2))
        for part in np.array_split(windows, len(windows) // _AT_ONCE + 1)
    ]
    noise = scatter(sum(squares) / len(windows), window - len(inverse), step)
    fine = math.ceil(_WANTED / per_cycle)
    place = np.arange((count - 1) * fine + 1) / fine
    found = np.empty(len(place))
    for at, out in zip(
        *(np.array_split(each, len(place) // _AT_ONCE + 1) for each in (place, found)), strict=True
    ):
        # Near the ends the first and the last window reach further.
        middle = np.clip(np.rint(at), reach, count - 1 - reach)
        first, last = (int(middle[k]) - reach for k in (0, -1))
        sizes = windows[first : last + 1] @ inverse.T
        np.einsum(
            "np,np->n",
            _wave(at - middle, omega),
            sizes[middle.astype(np.int64) - reach - first],
            out=out,
        )
    return Between(np.interp(place, np.arange(count), time_s), found, noise, window)


_MOST_UNEVEN: Final = 1 << 12
"""Readings at uneven times, as people click them in a video: their spectrum takes n^2."""


_MOSTLY: Final = 0.8
"""Share of the readings in stretches as long as a window: of fewer some of the swing is lost."""


def _between_uneven(
    time_s: FloatArray, values: FloatArray, step: float | None, dense: float
) -> Between | None:
    """Read a coarse record at uneven times: the waves of each moment by least squares."""
    from scipy.signal import lombscargle

    count, span = len(values), float(np.ptp(time_s))
    rest = values - np.polynomial.Polynomial.fit(time_s, values, 1)(time_s)
    omegas = 2.0 * math.pi / span * np.arange(2.0, 0.5 * count / _SPARSE * 2.0, 0.1)
    power = lombscargle(time_s - time_s[0], rest, omegas)
    omega = float(omegas[np.argmax(power)])
    per_cycle = 2.0 * math.pi * count / (omega * span)
    # Nobody knows the swing in a gap of half a cycle: it is read to each side of it.
    parted = np.split(np.arange(count), np.flatnonzero(omega * np.diff(time_s) > math.pi) + 1)
    window = min(max(round(_WINDOW * per_cycle), 8), count)
    read = [part for part in parted if len(part) >= window]
    if not _SPARSE < per_cycle < dense or sum(map(len, read)) < _MOSTLY * count:
        return None
    places, found, squares = list[FloatArray](), list[FloatArray](), list[float]()
    for part in read:
        points = math.ceil(_WANTED * len(part) / per_cycle)
        place = np.linspace(time_s[part[0]], time_s[part[-1]], points)
        first = np.searchsorted(time_s[part], place) - window // 2
        rows = part[np.clip(first, 0, len(part) - window)][:, None] + np.arange(window)
        design = _wave(time_s[rows] - place[:, None], omega)
        sizes = np.einsum("npw,nw->np", np.linalg.pinv(design, rcond=1e-6), values[rows])
        left = values[rows] - np.einsum("nwp,np->nw", design, sizes)
        places, found = [*places, place], [*found, sizes[:, 0] + sizes[:, 1]]
        squares += np.sum(left**2, axis=1).tolist()
    noise = scatter(float(np.mean(squares)), window - design.shape[2], step)
    return Between(np.concatenate(places), np.concatenate(found), noise, window)


def _wave(at: FloatArray, omega: float) -> FloatArray:
    """A level, and a wave whose cosine and sine grow evenly, shape (..., 5)."""
    cosine, sine = np.cos(omega * at), np.sin(omega * at)
    return np.stack([np.ones_like(at), cosine, sine, at * cosine, at * sine], axis=-1)


def _frequency(values: FloatArray) -> float:
    """Of the largest peak of the spectrum, in cycles a reading."""
    count = len(values)
    trend = np.polynomial.Polynomial.fit(np.arange(count), values, 1)(np.arange(count))
    power = np.abs(np.fft.rfft((values - trend) * np.hanning(count), 4 * count)) ** 2
    power[:4] = 0.0
    peak = min(int(np.argmax(power)), len(power) - 2)
    before, top, after = np.log(np.maximum(power[peak - 1 : peak + 2], 1e-300))
    bend = before - 2.0 * top + after
    return float(peak + (0.5 * (before - after) / bend if bend < 0.0 else 0.0)) / (4 * count)
