"""Odd harmonics of large swings: the shape of a half cycle that is no cosine.

A pendulum of 1 rad carries 0.5 % of third harmonic, one of 2.6 rad 7 %. Fitted half
cycle by half cycle each harmonic would cost precision; so where their share is a smooth
function of the amplitude, that function is found first and put into the shape.

Beyond 1.2 rad a turning point is measured by the readings next to it.
"""

import math
from dataclasses import replace
from typing import Final

import numpy as np

from pendpipe.analysis.noise import TOLD, white_rms
from pendpipe.analysis.turning_points.measure import (
    FITTED,
    HARMONICS,
    JUDGED,
    Measured,
    Places,
    Samples,
    edges,
    measure,
)
from pendpipe.analysis.turning_points.table import TurningPoints
from pendpipe.arrays import BoolArray, FloatArray

_CLEARLY: Final = 0.02
"""Part of the noise's variance by which the residual must exceed it: it is known to 2 % from 5,000
readings."""
_SIGNIFICANT: Final = 20.0
"""Fall of chi^2 that two more numbers must bring; chance does it once in 20,000 records."""
_NARROW: Final = 0.5
"""Part of a half cycle that is fitted where no shape fits the whole of it."""
_NEIGHBOURS: Final = 10
"""Half cycles on either side over which a harmonic is averaged."""


def odd_harmonics(
    samples: Samples,
    places: Places,
    level: float,
    shape: FloatArray,
    measured: Measured,
    open_error: FloatArray,
) -> tuple[FloatArray, Measured, Places]:
    """Add odd harmonics to the shape where the readings ask for them.

    Where even these don't fit (beyond 1.5 rad, where the period changes from one half
    cycle to the next), the middle half of the half cycle is fitted with a third harmonic
    of its own: precise enough, since so large a swing stands far out of the noise.

    Parameters
    ----------
    samples, places, level, shape, measured
        The readings, and what was made of them so far.
    open_error
        What the shape of the losses leaves open in each amplitude (`measure.shape_error`).

    Returns
    -------
    shape, measured, places
        As given, where a cosine with its losses is enough.
    """
    noise = _white(samples, places)
    before, _ = mean_square(measured)
    if before < (1.0 + _CLEARLY) * noise**2:
        return shape, measured, places
    count = float(np.nansum(measured.readings))
    for free in range(1, HARMONICS + 1):
        amplitude = measured.amplitude
        tried = measure(samples, places, level, shape, free=free, amplitude=amplitude)
        longer = shape.copy()
        longer[:, 4 : 4 + free] += _shares(places, tried, free)
        shared = measure(samples, places, level, longer, amplitude=amplitude)
        after, _ = mean_square(shared)
        if (before - after) * count < _SIGNIFICANT * max(after, noise**2):
            break
        shape, measured, before = longer, shared, after
        if before < (1.0 + 0.1 * _CLEARLY) * noise**2:
            break
    return _narrowed(samples, places, level, shape, measured, np.hypot(noise, open_error))


def _narrowed(
    samples: Samples,
    places: Places,
    level: float,
    shape: FloatArray,
    measured: Measured,
    noise: FloatArray,
) -> tuple[FloatArray, Measured, Places]:
    """Replace the half cycles that no shape fits by fits of their middle halves."""
    poor = _even_misfit(samples, places, level, shape, measured, noise)
    if not poor.any():
        return shape, measured, places
    bare = shape.copy()
    bare[:, 4:] = 0.0
    known = measured.amplitude
    first = measure(samples, places, level, bare, window=_NARROW, free=1, amplitude=known)
    # Where the wave turns: the curvature there is that of both harmonics.
    curvature = first.amplitude + 9.0 * first.harmonics[:, 0]
    late = np.where(curvature > 0.1 * first.amplitude, first.sine / curvature, 0.0)
    late = np.nan_to_num(np.clip(late, -0.5, 0.5))
    moved = places._replace(centre_s=places.centre_s + late / places.angular_frequency)
    middle = measure(samples, moved, level, bare, window=_NARROW, free=1, amplitude=known)
    poor &= middle.readings > JUDGED
    # What even the middle half does not fit counts as error, not as precision.
    enlarged = np.maximum(_ratio(middle, noise), 1.0)
    information, score = _level_of_peaks(places, middle, enlarged)
    single = middle._replace(
        amplitude=middle.peak[:, 0],
        variance=middle.peak[:, 1] * enlarged,
        coupling=middle.peak[:, 2],
        harmonics=measured.harmonics,
        coverage=measured.coverage,
        information=information,
        score=score,
        single=np.ones(len(poor), dtype=bool),
        residual_square=own_square(middle) + score**2 / np.maximum(information, 1e-300),
    )
    chosen = [
        np.where(poor.reshape(-1, *[1] * (new.ndim - 1)), new, old)
        for new, old in zip(single, measured, strict=True)
    ]
    centre = np.where(poor, moved.centre_s, places.centre_s)
    return (
        np.where(poor[:, None], bare, shape),
        Measured(*chosen),
        places._replace(centre_s=centre),
    )


def _level_of_peaks(
    places: Places, middle: Measured, enlarged: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """What neighbouring peaks say of the level, (p + 2 p' + p'')/4, whatever the wave's form."""
    seen = np.isfinite(middle.peak[:, 0]) & (middle.readings > JUDGED)
    peak = np.where(seen, middle.peak[:, 0], 0.0) * places.side
    level = np.convolve(peak, [0.25, 0.5, 0.25], "same")
    beside = np.pad(seen, 1)
    between = beside[:-2] & seen & beside[2:]
    # A hundredth: whole half cycles, where there are any, know better.
    information = 0.01 / np.nan_to_num(middle.peak[:, 1] * enlarged, nan=np.inf)
    information = np.where(between, information, 1e-9 * information)
    return information, np.where(between, information * level, 0.0)


def _even_misfit(
    samples: Samples,
    places: Places,
    level: float,
    shape: FloatArray,
    measured: Measured,
    noise: FloatArray,
) -> BoolArray:
    """Which half cycles would be fitted better with even terms of their own.

    Odd terms (of the unknown share of b) do no harm to the amplitude and are not asked for.
    """
    freer = measure(samples, places, level, shape, free=2, amplitude=measured.amplitude)
    known = np.isfinite(freer.amplitude) & (freer.readings > JUDGED)
    gain = np.where(known, own_square(measured) - own_square(freer), 0.0) / noise**2
    total, half_cycles = _around(gain), np.maximum(_around(known.astype(np.float64)), 1.0)
    return np.asarray(total > 2.0 * half_cycles + 5.0 * np.sqrt(4.0 * half_cycles))


def _around(values: FloatArray) -> FloatArray:
    """Sum over each half cycle and ten neighbours to each side."""
    box = np.ones(min(2 * _NEIGHBOURS + 1, 2 * (len(values) // 2) - 1))
    return np.convolve(values, box, "same")


def _ratio(measured: Measured, noise: FloatArray) -> FloatArray:
    """Misfit of half cycles over the noise's, with that of their neighbours."""
    known = np.isfinite(measured.amplitude) & (measured.readings > FITTED)
    square = np.where(known, own_square(measured), 0.0) / noise**2
    freedom = np.where(known, np.maximum(measured.readings - 3.0, 1.0), 0.0)
    return _around(square) / np.maximum(_around(freedom), 1.0)


def own_square(measured: Measured) -> FloatArray:
    """Sum of squares of each half cycle about its fit, at its own level."""
    return measured.residual_square - measured.score**2 / np.maximum(measured.information, 1e-300)


def _white(samples: Samples, places: Places) -> float:
    """White noise of the readings of the last quarter of the half cycles, by differences."""
    where = edges(samples, places)
    start = where[3 * len(where) // 4, 0]
    part = samples.values[start : where[-1, 1]][: 1 << 20]
    return max(white_rms(part) if len(part) > 2 * TOLD else 0.0, samples.noise_rms)


def mean_square(measured: Measured, least: int = JUDGED) -> tuple[float, float]:
    """Mean square of the readings about half cycles fitted as wholes, each at its own level.

    Of half cycles with more readings than `least`; and its degrees of freedom.
    """
    known = np.isfinite(measured.amplitude) & (measured.readings > least) & ~measured.single
    freedom = float(np.sum((measured.readings - measured.harmonics.shape[1] - 3)[known]))
    return float(np.sum(own_square(measured)[known])) / max(freedom, 1.0), freedom


def _shares(places: Places, measured: Measured, free: int) -> FloatArray:
    """Share of each harmonic as a polynomial in the squared amplitude, fitted to all."""
    amplitude = measured.amplitude
    known = np.isfinite(amplitude) & (amplitude > 0.0)
    square = (np.nan_to_num(amplitude) / float(np.nanmax(amplitude))) ** 2
    shares = np.zeros((len(places.number), free))
    terms = 3 if known.sum() >= 3 * FITTED else 1  # four half cycles tell one
    columns = np.stack([square**power for power in range(1, terms + 1)], axis=1)
    weight = np.where(known, np.nan_to_num(amplitude) ** 2, 0.0)
    for m in range(free):
        share = np.where(known, measured.harmonics[:, m] / np.where(known, amplitude, 1.0), 0.0)
        # Weighted by the amplitude: a harmonic is as well known as the readings are.
        root = np.sqrt(weight)
        solved, *_ = np.linalg.lstsq(columns * root[:, None], share * root, rcond=1e-9)
        shares[:, m] = columns @ solved
    return shares


FAR: Final = 1.2
"""Angle in rad from which a turning point is read off the readings next to it."""
_REACH: Final = 0.12
"""Of a half period: so near to the turning point a fourth power follows sin x to 0.1 mrad."""
_FEWEST: Final = 10
"""Half cycles through which a parabola is smoothed."""
_MOST: Final = 0.5
"""Of the reach, by which the turning point may lie off the middle of the readings."""


def far_points(samples: Samples, points: TurningPoints) -> TurningPoints:
    """Measure turning points beyond 1.2 rad again, by the readings next to each.

    The angle is a polynomial of the time up to the fourth power, without the third, and with the
    step of the acceleration where friction turns.
    """
    far = np.flatnonzero(np.abs(points.angle_rad) > FAR).tolist()
    if samples.unit != "rad" or not far:
        return points
    angle, time = points.angle_rad.copy(), points.time_s.copy()
    angle_sd, time_sd = points.angle_sd_rad.copy(), points.time_sd_s.copy()
    for k in far:
        beside = slice(max(k - 1, 0), k + 2)
        half = np.diff(points.time_s[beside]) / np.diff(points.half_cycle[beside])
        reach = _REACH * float(np.min(half))
        for _ in range(3):
            ends = np.searchsorted(samples.time_s, [time[k] - reach, time[k] + reach])
            near = slice(*ends.tolist())
            z = (samples.time_s[near] - time[k]) / reach
            if len(z) < _FEWEST:
                break
            columns = [np.ones_like(z), z, z**2, z**4]
            if min(-z[0], z[-1]) > _MOST:
                # Where the record begins with a release there is one side only, and no step.
                columns.append(z * np.abs(z))
            inverse = np.linalg.pinv(np.stack(columns, axis=1))
            top, slope, bend, _, *step = (inverse @ samples.values[near]).tolist()
            turn = -0.5 * slope / bend
            if not abs(turn) < _MOST:
                break
            time[k] += reach * turn
            bend += math.copysign(sum(step), turn)
            angle[k] = top + (slope + bend * turn) * turn - points.level_rad[k]
            errors = samples.noise_rms * np.linalg.norm(inverse[:2], axis=1)
            angle_sd[k] = max(float(errors[0]), points.angle_sd_rad[k])
            time_sd[k] = max(0.5 * reach * float(errors[1]) / abs(bend), points.time_sd_s[k])
    return replace(points, angle_rad=angle, time_s=time, angle_sd_rad=angle_sd, time_sd_s=time_sd)
