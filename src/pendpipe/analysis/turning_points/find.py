"""Turning points of a free decay, each from all the readings of its half cycle."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Final

import numpy as np

from pendpipe.analysis.noise import quantisation_rms
from pendpipe.analysis.turning_points.blocks import BLOCK, in_blocks
from pendpipe.analysis.turning_points.far import far_points
from pendpipe.analysis.turning_points.finish import State, finished, kept, last_seen
from pendpipe.analysis.turning_points.follow import first_places, follow_tail, resmoothed
from pendpipe.analysis.turning_points.harmonics import odd_harmonics, own_square
from pendpipe.analysis.turning_points.measure import Measured, Places, measure
from pendpipe.analysis.turning_points.rough import Rough, rough_half_cycles
from pendpipe.analysis.turning_points.samples import Samples, prepare
from pendpipe.analysis.turning_points.shape import (
    HARMONICS,
    LossRates,
    half_cycle_shape,
    loss_rates,
    shape_error,
)
from pendpipe.analysis.turning_points.table import TurningPoints
from pendpipe.arrays import FloatArray
from pendpipe.errors import NotAnalysableError
from pendpipe.recording import Recording

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
    state = State(samples, places, measured, shape, rates, level)
    keep = kept(state)
    if keep.sum() < 3:
        raise NotAnalysableError(place, *_too_few(samples, int(keep.sum())))
    return finished(state, keep)


def _too_few(samples: Samples, found: int) -> tuple[str, str]:
    """What to say of a record without three half cycles."""
    swing = float(samples.values.max() - samples.values.min())
    if swing < 12.0 * samples.noise_rms:
        problem = f"no motion stands out of the noise ({samples.noise_rms:.3g} rms)"
        return problem, "raise the amplitude, or pick another channel"
    return f"fewer than three half cycles ({found} turning points)", "record longer"


def _plain(number: int) -> FloatArray:
    """The shape of a half cycle without losses: a cosine."""
    return np.zeros((number, 4 + HARMONICS))


def _locate(samples: Samples, rough: Rough, stride: int) -> tuple[Places, Measured]:
    """Lock on to the half cycles with a bare cosine, and follow them into the tail."""
    places, steps = first_places(rough), 3
    while True:
        shape = _plain(len(places.number))
        measured = measure(samples, places, rough.level, shape, stride=stride)
        late = measured.phase(samples.noise_rms)[~measured.one_sided]
        places = resmoothed(places, measured, samples.noise_rms)
        if np.nanmax(np.abs(late), initial=0.0) < _LOCKED or (steps := steps - 1) == 0:
            break
    return follow_tail(samples, places, measured, rough.level)


def _losses(
    places: Places, measured: Measured, noise: float, start: float
) -> tuple[FloatArray, LossRates, float]:
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
        rates = LossRates(0.0, 0.0, 0.0)
    return np.nan_to_num(amplitude), rates, start + shift


def _shaped(
    samples: Samples, places: Places, amplitude: FloatArray, rates: LossRates, level: float,
    stride: int,
) -> tuple[Places, Measured, FloatArray]:  # fmt: skip
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
