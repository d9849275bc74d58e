"""Turning points of a free decay, each from all the readings of its half cycle.

Alternating extremes are numbered with no model of the motion; their times are smoothed over
neighbours, and the half cycles followed into the tail.
"""

from dataclasses import replace
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

from pendpipe.analysis.noise import quantisation_rms
from pendpipe.analysis.turning_points.finish import finished, kept, last_seen
from pendpipe.analysis.turning_points.harmonics import far_points, odd_harmonics, own_square
from pendpipe.analysis.turning_points.long_records import BLOCK, in_blocks
from pendpipe.analysis.turning_points.loops import count_half_cycles, find_extremes, smooth_times
from pendpipe.analysis.turning_points.measure import Measured, Places, measure
from pendpipe.analysis.turning_points.samples import Samples, prepare
from pendpipe.analysis.turning_points.shape import (
    HARMONICS,
    half_cycle_shape,
    loss_rates,
    shape_error,
)
from pendpipe.analysis.turning_points.table import TurningPoints
from pendpipe.arrays import FloatArray, IntArray
from pendpipe.errors import NotAnalysableError
from pendpipe.recording import Recording

_ENOUGH: Final = 24
"""Readings in a half cycle that a first look needs."""
_LOOK: Final = 200_000


class Rough(NamedTuple):
    """Extremes of the readings: their half cycle's number, time, side and value."""

    number: IntArray
    time_s: FloatArray
    side: IntArray
    value: FloatArray
    level: float


def rough_half_cycles(samples: Samples) -> tuple[Rough, int]:
    """Find and number the extremes of a decay.

    Returns
    -------
    rough, stride
        The extremes, and the stride between readings that is enough for a first look.
    """
    least = max(7.0 * samples.noise_rms, 1.5 * (samples.step or 0.0))
    if samples.counts:
        least = 40.0 * samples.noise_rms
    piece = samples.values[:_LOOK]
    start = 0.15 * float(piece.max() - piece.min())
    stride = 1
    if not samples.counts:
        index, _ = find_extremes(piece[: len(piece) // 8], least, start=start)
        if len(index) > 3:
            stride = max(1, int(np.median(np.diff(index))) // _ENOUGH)
    index, first = find_extremes(samples.values, least, start=start, stride=stride)
    time, value = samples.time_s[index], samples.values[index]
    side = first * (1 - 2 * (np.arange(len(index)) % 2))
    if len(index) < 3:
        return Rough(np.arange(len(index)), time, side, value, float(np.median(piece))), stride
    whole, gap_before = _beside_gaps(samples.time_s, index)
    time, value, side, gap_before = time[whole], value[whole], side[whole], gap_before[whole]
    number = np.zeros(len(time), dtype=np.int64)
    usual = float(np.median(np.diff(time[:6])))
    cut = slice(0, count_half_cycles(time, side, gap_before, usual, number))
    return Rough(number[cut], time[cut], side[cut], value[cut], _level(value[cut])), stride


def _beside_gaps(time: FloatArray, index: IntArray) -> tuple[np.ndarray, IntArray]:
    """Which extremes stand clear of gaps in the data; and which have one before them."""
    half_period = float(np.median(np.diff(time[index[: min(12, len(index))]])))
    # In pieces: the differences of all times would be another record in memory.
    piece = 1 << 20
    gaps = np.concatenate(
        [
            np.flatnonzero(np.diff(time[i : i + piece + 1]) > 0.4 * half_period) + i
            for i in range(0, len(time), piece)
        ]
    )
    clear = (index > 1) & (index < len(time) - 2)
    for gap in gaps:
        # An extreme at the very edge of a gap is where the data end, not where they turn.
        clear &= (index != gap) & (index != gap + 1)
    before = np.searchsorted(gaps, index)
    return clear, (np.diff(before, prepend=before[:1]) > 0).astype(np.int64)


def _level(value: FloatArray) -> float:
    """Middle of the swings, free of a steady decay: (e + 2 e' + e'')/4."""
    if len(value) < 3:
        return float(np.mean(value))
    return float(np.median(0.25 * (value[:-2] + 2.0 * value[1:-1] + value[2:])))


_PHASE_WANTED: Final = 0.01
"""Phase, in rad, to which the smoothed times should be known."""
_BLOCK: Final = 8
_VISIBLE: Final = 3.0


def first_places(rough: Rough) -> Places:
    """Places of all half cycles from the one before the first extreme on, smoothed.

    The readings may begin at a turning point (a release), which is no extreme of theirs.
    """
    at = np.arange(rough.number[0] - 1, rough.number[-1] + 1)
    weight = np.ones(len(rough.number))
    centre, half_period = smooth_times(rough.number, rough.time_s, weight, 5.0, at)
    return _places(at, centre, half_period, -int(rough.side[0]))


def _places(number: np.ndarray, centre: FloatArray, half_period: FloatArray, side: int) -> Places:
    alternating = side * (1.0 - 2.0 * ((number - number[0]) % 2))
    return Places(number, centre, half_period, alternating)


def times_and_weights(
    places: Places, measured: Measured, noise: float
) -> tuple[FloatArray, FloatArray]:
    """Times of turning, and their inverse variances (zero where nothing is known)."""
    rate = places.angular_frequency
    time = places.centre_s + measured.phase(noise) / rate
    # Beyond what noise does, real pendulums wander in phase by about this much.
    size = np.maximum(measured.amplitude, 1e-12 * np.nanmax(measured.amplitude))
    phase_sd = np.hypot(noise * np.sqrt(measured.sine_variance) / size, 1e-3)
    known = np.isfinite(time) & (measured.amplitude > noise * np.sqrt(measured.variance))
    known &= ~measured.one_sided
    weight = np.where(known, (rate / phase_sd) ** 2, 0.0)
    return np.where(known, time, places.centre_s), weight


def resmoothed(places: Places, measured: Measured, noise: float) -> Places:
    """Smooth the measured times over neighbours, and so the places of the half cycles."""
    time, weight = times_and_weights(places, measured, noise)
    known = weight > 0.0
    wanted = float(np.median(places.angular_frequency) / _PHASE_WANTED) ** 2
    centre, half_period = smooth_times(
        places.number[known], time[known], weight[known], wanted, places.number
    )
    return places._replace(centre_s=centre, half_period_s=half_period)


def _further(places: Places, measured: Measured, noise: float, count: int) -> Places:
    """Carry the last known half cycles on at their own mean period."""
    time, weight = times_and_weights(places, measured, noise)
    known = np.flatnonzero(weight > 0.0)[-60:]
    # As many of the last as it takes to know the period well, and no more: it may change.
    used = np.cumsum(weight[known][::-1])
    enough = int(np.searchsorted(used, 400.0 * weight[known].max())) + 1
    known = known[-max(enough, 24) :]
    n, t, w = places.number[known].astype(np.float64), time[known], weight[known]
    middle, mean = float(np.average(n, weights=w)), float(np.average(t, weights=w))
    slope = float(np.sum(w * (n - middle) * (t - mean)) / np.sum(w * (n - middle) ** 2))
    number = places.number[-1] + 1 + np.arange(count)
    return Places(
        number,
        mean + slope * (number - middle),
        np.full(count, slope),
        places.side[-1] * (2.0 * (np.arange(count) % 2) - 1.0),
    )


def follow_tail(
    samples: Samples, places: Places, measured: Measured, level: float
) -> tuple[Places, Measured]:
    """Add half cycles too small to be seen singly, as long as blocks of them are seen.

    A block is kept if its amplitude, in phase with what went before, stands out of the
    noise: the sign is the phase's, so noise alone adds up to nothing.
    """
    while True:
        left = (samples.time_s[-1] - places.centre_s[-1]) / places.half_period_s[-1]
        count = int(min(max(_BLOCK, len(places.number) // 8), left + 0.05))
        if count < 1:
            return places, measured
        new = _further(places, measured, samples.noise_rms, count)
        tried = measure(samples, new, level, np.zeros((count, 4 + HARMONICS)))
        if not _visible(tried, samples.noise_rms):
            return places, measured
        places = Places._make(np.concatenate(pair) for pair in zip(places, new, strict=True))
        measured = Measured._make(
            np.concatenate(pair) for pair in zip(measured, tried, strict=True)
        )


def _visible(measured: Measured, noise: float) -> bool:
    """Whether the mean amplitude of some half cycles stands out of the noise."""
    weight = np.where(np.isfinite(measured.amplitude), 1.0 / measured.variance, 0.0)
    if not weight.any():
        return False
    mean = float(np.sum(weight * np.nan_to_num(measured.amplitude)) / weight.sum())
    return mean > _VISIBLE * noise / float(np.sqrt(weight.sum()))


_LOCKED: Final = 0.1
"""Phase in rad by which rough places may be off when they are measured for the last time."""


def find_turning_points(recording: Recording, place: str | Path = "recording") -> TurningPoints:
    """Measure the turning points of a free decay.

    Extremes give the half cycles' rough places; their times, smoothed over neighbours,
    the phase; then every half cycle is fitted by least squares with the shape that its
    losses give it (`shape.py`), at a level common to all (or slowly wandering). The
    errors of different half cycles are independent but for the level.

    Parameters
    ----------
    recording
        Angles (rad), or any other readings in their own unit, of a free
        decay: what stands before the release is cut already. Times may be uneven.
    place
        Named in messages.

    Returns
    -------
    TurningPoints
        Time, signed angle and level of each, with standard deviations.

    Raises
    ------
    NotAnalysableError
        Dead or saturated channel, amplitude below the noise, under three half cycles.
    InputError
        A sensor constant that is no number.
    """
    return turning_points_of(prepare(recording, place), place)


def turning_points_of(samples: Samples, place: str | Path = "recording") -> TurningPoints:
    """As `find_turning_points`, of readings that are prepared already."""
    if len(samples) > 2 * BLOCK:
        points = in_blocks(samples, lambda piece: _of_piece(piece, place))
    else:
        points = _of_piece(samples, place)
    return far_points(samples, points)


def _of_piece(samples: Samples, place: str | Path) -> TurningPoints:
    """Measure readings that fit into the memory many times over."""
    rough, stride = rough_half_cycles(samples)
    if len(rough.number) < 3:
        raise NotAnalysableError(place, *_too_few(samples, len(rough.number)))
    places, first = _locate(samples, rough, stride)
    amplitude, rates, level = _losses(places, first, samples.noise_rms, rough.level)
    places, measured, shape = _shaped(samples, places, amplitude, rates, level, stride)
    samples = replace(samples, noise_rms=_noise(samples, measured))
    keep = kept(samples, places, measured)
    if keep.sum() < 3:
        raise NotAnalysableError(place, *_too_few(samples, int(keep.sum())))
    return finished(samples, places, measured, shape, rates, level, keep)


def _too_few(samples: Samples, found: int) -> tuple[str, str]:
    """What to say of a record without three half cycles."""
    swing = float(samples.values.max() - samples.values.min())
    if swing < 12.0 * samples.noise_rms:
        problem = f"no motion stands out of the noise ({samples.noise_rms:.3g} rms)"
        return problem, "raise the amplitude, or pick another channel"
    return f"fewer than three half cycles ({found} turning points)", "record longer"


def _locate(samples: Samples, rough: Rough, stride: int) -> tuple[Places, Measured]:
    """Lock on to the half cycles with a bare cosine, and follow them into the tail."""
    places, steps = first_places(rough), 3
    while True:
        cosine = np.zeros((len(places.number), 4 + HARMONICS))
        measured = measure(samples, places, rough.level, cosine, stride=stride)
        late = measured.phase(samples.noise_rms)[~measured.one_sided]
        places = resmoothed(places, measured, samples.noise_rms)
        if np.nanmax(np.abs(late), initial=0.0) < _LOCKED or (steps := steps - 1) == 0:
            break
    return follow_tail(samples, places, measured, rough.level)


def _losses(
    places: Places, measured: Measured, noise: float, start: float
) -> tuple[FloatArray, FloatArray, float]:
    """Amplitudes at the mean level, the rates they fall at, and that level."""
    known = np.isfinite(measured.amplitude) & (measured.readings > 4) & ~measured.one_sided
    shift = float(np.sum(measured.score[known]) / np.sum(measured.information[known]))
    amplitude = measured.amplitude - places.side * measured.coupling * shift
    sd = noise * np.sqrt(measured.variance)
    use = known & (amplitude > 2.0 * sd)
    use[last_seen(measured, noise) + 1 :] = False
    if use.sum() >= 3:
        rates = loss_rates(places.centre_s[use], amplitude[use], sd[use])
    else:
        rates = np.zeros(3)
    return np.nan_to_num(amplitude), rates, start + shift


def _shaped(
    samples: Samples,
    places: Places,
    amplitude: FloatArray,
    rates: FloatArray,
    level: float,
    stride: int,
) -> tuple[Places, Measured, FloatArray]:
    """Measure again with the shape that the losses, and odd harmonics, give the half cycles."""
    shape = half_cycle_shape(amplitude, places.angular_frequency, rates)
    measured = measure(samples, places, level, shape, stride=stride, amplitude=amplitude)
    places = resmoothed(places, measured, samples.noise_rms)
    measured = measure(samples, places, level, shape, amplitude=amplitude)
    size = np.abs(np.nan_to_num(measured.amplitude))
    relative, _ = shape_error(size, places.angular_frequency, rates)
    shape, measured, places = odd_harmonics(
        samples, places, level, shape, measured, relative * size
    )
    return places, measured, shape


def _noise(samples: Samples, measured: Measured) -> float:
    """Rms of one reading about the fitted half cycles, never below step/sqrt(12)."""
    size = 2 + measured.harmonics.shape[1]
    # A level of its own is taken off each: one reading more must be left to tell the noise.
    told = measured.readings > size + 1
    known = np.isfinite(measured.amplitude) & told & ~measured.single
    # The level is common; what a half cycle wants of its own is not noise of the readings.
    square = own_square(measured)
    freedom = float(np.sum(measured.readings[known] - size - 1))
    if freedom < 8:
        return samples.noise_rms
    pooled = float(np.sqrt(max(float(np.sum(square[known])), 0.0) / freedom))
    return max(pooled, quantisation_rms(samples.step))
