"""Turning points of a free decay, each from all the readings of its half cycle."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

from pendpipe.analysis.noise import quantisation_rms
from pendpipe.analysis.turning_points import kernels
from pendpipe.analysis.turning_points.follow import first_places, follow_tail, resmoothed
from pendpipe.analysis.turning_points.harmonics import odd_harmonics, own_square
from pendpipe.analysis.turning_points.level import Level, estimate_level
from pendpipe.analysis.turning_points.measure import Measured, Places, measure
from pendpipe.analysis.turning_points.rough import Rough, rough_half_cycles
from pendpipe.analysis.turning_points.samples import Samples, prepare
from pendpipe.analysis.turning_points.shape import (
    LossRates,
    half_cycle_shape,
    loss_rates,
    shape_error,
)
from pendpipe.analysis.turning_points.table import TurningPoints
from pendpipe.arrays import BoolArray, FloatArray
from pendpipe.errors import NotAnalysableError
from pendpipe.recording import Recording

_LEAST_SHARE: Final = 0.3
"""Of the readings that its neighbours have; a half cycle with fewer is not kept."""
_SEEN: Final = 3.0
"""Standard deviations by which the last half cycle must stand out, with its neighbours."""


def find_turning_points(recording: Recording, place: str | Path = "recording") -> TurningPoints:
    """Measure the turning points of a free decay.

    Extremes give the half cycles' rough places; their times, smoothed over neighbours,
    the phase; then every half cycle is fitted by least squares with the shape that its
    losses give it (`shape.py`), at a level common to all (or slowly wandering). The
    errors of different half cycles are independent but for the level.

    Parameters
    ----------
    recording
        Angles (rad), displacements (m), or volts with a known sensor constant, of a free
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
        An angle beyond pi about its centre (a wrong unit).
    """
    return turning_points_of(prepare(recording, place), place)


def turning_points_of(samples: Samples, place: str | Path = "recording") -> TurningPoints:
    """As `find_turning_points`, of readings that are prepared already."""
    rough, stride = rough_half_cycles(samples)
    if len(rough.number) < 3:
        raise NotAnalysableError(place, *_too_few(samples, len(rough.number)))
    places, first = _locate(samples, rough, stride)
    amplitude, rates, level = _losses(places, first, samples.noise_rms, rough.level)
    places, measured, shape = _shaped(samples, places, amplitude, rates, level, stride)
    samples = replace(samples, noise_rms=_noise(samples, measured))
    state = _State(samples, places, measured, shape, rates, level)
    keep = _kept(state)
    if keep.sum() < 3:
        raise NotAnalysableError(place, *_too_few(samples, int(keep.sum())))
    return _finish(state, keep)


class _State(NamedTuple):
    """All that is known before the table is made."""

    samples: Samples
    places: Places
    measured: Measured
    shape: FloatArray
    rates: LossRates
    start: float
    """The level that the half cycles were measured at."""


def _too_few(samples: Samples, found: int) -> tuple[str, str]:
    """What to say of a record without three half cycles."""
    swing = float(samples.values.max() - samples.values.min())
    if swing < 12.0 * samples.noise_rms:
        problem = f"no motion stands out of the noise ({samples.noise_rms:.3g} rms)"
        return problem, "raise the amplitude, or pick another channel"
    return f"fewer than three half cycles ({found} turning points)", "record longer"


def _plain(number: int) -> FloatArray:
    """The shape of a half cycle without losses: a cosine."""
    return np.zeros((number, 4 + kernels.HARMONICS))


def _locate(samples: Samples, rough: Rough, stride: int) -> tuple[Places, Measured]:
    """Lock on to the half cycles with a bare cosine, and follow them into the tail."""
    places = first_places(rough)
    for _ in range(2):
        shape = _plain(len(places.number))
        measured = measure(samples, places, rough.level, shape, stride=stride)
        places = resmoothed(places, measured, samples.noise_rms)
    return follow_tail(samples, places, measured, rough.level)


def _losses(
    places: Places, measured: Measured, noise: float, start: float
) -> tuple[FloatArray, LossRates, float]:
    """Amplitudes at the mean level, the rates they fall at, and that level."""
    known = np.isfinite(measured.amplitude) & (measured.count > 4) & ~measured.lopsided
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
    known = np.isfinite(measured.amplitude) & (measured.count > 6) & ~measured.single
    size = 2 + measured.harmonics.shape[1]
    # The level is common; what a half cycle wants of its own is not noise of the readings.
    square = own_square(measured)
    freedom = float(np.sum(measured.count[known] - size - 1))
    if freedom < 8:
        return samples.noise_rms
    pooled = float(np.sqrt(max(float(np.sum(square[known])), 0.0) / freedom))
    return max(pooled, quantisation_rms(samples.step))


def _finish(state: _State, keep: BoolArray) -> TurningPoints:
    """Put level, amplitude and time together."""
    samples, places, measured = state.samples, state.places, state.measured
    noise = samples.noise_rms
    level = estimate_level(measured.information[keep], measured.score[keep], noise, state.start)
    side, rate = places.side[keep], places.angular_frequency[keep]
    coupling, sine = measured.coupling[keep], measured.sine[keep]
    amplitude = measured.amplitude[keep] - side * coupling * (level.value - state.start)
    sd = noise * np.sqrt(measured.variance[keep])
    sine_sd = noise * np.sqrt(measured.sine_variance[keep])
    height = 1.0 + state.shape[keep, 4:].sum(axis=1)
    turned = (amplitude + _late(amplitude, sine, sd, sine_sd)) * height
    clear = np.maximum(np.abs(amplitude), sd)
    relative, phase = shape_error(clear, rate, state.rates)
    # A period that changes from one half cycle to the next skews the wave about its turning.
    skew = np.where(measured.single | measured.lopsided, places.unsteady_phase, 0.0)[keep]
    relative, phase = np.hypot(relative, 0.1 * skew**2), np.hypot(phase, 0.1 * skew**2)
    return TurningPoints(
        half_cycle=places.number[keep] - places.number[keep][0],
        time_s=places.centre_s[keep] + measured.phase(noise)[keep] / rate,
        time_sd_s=np.hypot(np.minimum(sine_sd / clear, 1.0), phase) / rate,
        angle_rad=side * turned,
        angle_sd_rad=np.hypot(sd * height, relative * clear),
        level_rad=level.value,
        level_sd_rad=float(np.mean(level.sd)),
        level_coupling=float(np.mean(coupling * height)),
        noise_rms_rad=noise,
        step_rad=samples.step or 0.0,
        start_s=float(samples.time_s[0]),
        stop_s=float(samples.time_s[-1]),
        samples=len(samples),
        unit=samples.unit,
        wanders=level.wanders,
        notes=_notes(samples, keep, level),
    )


def _late(
    amplitude: FloatArray, sine: FloatArray, sd: FloatArray, sine_sd: FloatArray
) -> FloatArray:
    """What a small error of phase has taken off the amplitude; unbiased by the noise."""
    strong = amplitude > 5.0 * sd
    lost = (sine**2 - sine_sd**2) / (2.0 * np.where(strong, amplitude, 1.0))
    return np.where(strong, lost, 0.0)


def _kept(state: _State) -> BoolArray:
    """Half cycles that hold enough readings, and whose turning lies among the readings.

    A record that ends at rest ends here with the last half cycle that is seen.
    """
    samples, places, measured = state.samples, state.places, state.measured
    turning = places.centre_s
    slack = 0.02 * places.half_period_s
    inside = (turning >= samples.time_s[0] - slack) & (turning <= samples.time_s[-1] + slack)
    keep = inside & (measured.coverage > _LEAST_SHARE * _usual(measured.coverage))
    keep[last_seen(measured, samples.noise_rms) + 1 :] = False
    return keep


def last_seen(measured: Measured, noise: float) -> int:
    """The last half cycle that stands out of the noise, with its neighbours; -1 if none.

    Neighbours are on opposite sides: together they cancel an error of the level.
    """
    amplitude = np.nan_to_num(measured.amplitude)
    around = np.convolve(amplitude, [0.25, 0.5, 0.25], "same")
    sd = noise * np.sqrt(np.nan_to_num(measured.variance, nan=np.inf))
    seen = around > np.maximum(_SEEN * sd, 1e-6 * float(np.max(amplitude)))
    return int(np.max(np.flatnonzero(seen), initial=-1))


def _usual(coverage: FloatArray) -> FloatArray:
    """What is usual among the five neighbours to each side."""
    if len(coverage) < 12:
        return np.full(len(coverage), float(np.median(coverage[coverage > 0.0])))
    padded = np.pad(coverage, 5, mode="reflect")
    return np.asarray(np.median(np.lib.stride_tricks.sliding_window_view(padded, 11), axis=1))


def _notes(samples: Samples, keep: BoolArray, level: Level) -> tuple[str, ...]:
    notes = []
    inner = keep[int(np.argmax(keep)) : len(keep) - int(np.argmax(keep[::-1]))]
    lost = int(np.count_nonzero(~inner))
    if lost:
        notes.append(f"{lost} half cycle(s) are left out for lack of readings")
    if level.wanders:
        notes.append("the level wanders; it is followed by local lines")
    if samples.counts:
        notes.append("one row a count: the times of the counts are the data")
    return tuple(notes)
