"""Follow the half cycles through the whole record: smooth their times, extend into the tail."""

from __future__ import annotations

from typing import Final

import numpy as np

from pendpipe.analysis.turning_points.loops import smooth_times
from pendpipe.analysis.turning_points.measure import Measured, Places, measure
from pendpipe.analysis.turning_points.rough import Rough
from pendpipe.analysis.turning_points.samples import Samples
from pendpipe.analysis.turning_points.shape import HARMONICS
from pendpipe.arrays import FloatArray

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
        shape = np.zeros((count, 4 + HARMONICS))
        tried = measure(samples, new, level, shape)
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
