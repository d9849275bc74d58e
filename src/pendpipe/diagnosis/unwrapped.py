"""Readings beside a model's motion, cycle by cycle: amplitude, phase, and the residual along it."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from pendpipe.analysis.demodulation import lock_in
from pendpipe.arrays import FloatArray
from pendpipe.effects.model import Evaluated

if TYPE_CHECKING:
    from pendpipe.diagnosis.data import Data

LARGE_PHASE_ERROR: Final = 0.1
"""Phase difference e in rad, and relative difference of amplitude, from which a model has lost the
motion: first order misses e^2/2 of the amplitude, 0.5 %."""
_CYCLE_SHARE: Final = 0.6
"""Part of a cycle's readings that must be present."""
_NOISE_SD: Final = 5.0
"""Standard deviations below which a cycle's phase and amplitude differences count as zero."""


class Alignment(NamedTuple):
    """Difference of the readings from a model in each cycle, shape (k,)."""

    log_ratio: FloatArray
    """Log ratio of the amplitudes."""
    phase: FloatArray
    """Phase by which the readings are ahead, rad, with whole turns."""
    middle: FloatArray
    """The model's phase in the middle of the cycle's readings, rad."""


_NO_CYCLES: Final = Alignment(np.zeros(0), np.zeros(0), np.zeros(0))
"""Where the motion has none that can be compared."""


def anchored(data: Data, at: Evaluated) -> tuple[float, float]:
    """Return a time near the beginning and the readings' phase then, with whole turns.

    The model must be in phase with the first cycles, as a start from turning points is.
    """
    _, phase, centre = alignment(data, at, data.residual(at.reading))
    if not len(phase):
        return float(at.sampled.time_s[0]), float(at.sampled.phase[0])
    when = float(np.interp(centre[0], at.sampled.phase, at.sampled.time_s))
    return when, float(centre[0] + phase[0])


def unwrapped(data: Data, at: Evaluated) -> tuple[FloatArray, float]:
    """Return readings minus model, linear in what changes amplitude and phase.

    In each cycle the readings are compared with the model's cosine and sine. The ratio of the
    amplitudes and the phase between them, unwrapped along the record, align the model with the
    readings. The residual is the difference from the aligned model plus the alignment times the
    model's derivatives: the difference for a model linear in amplitude and phase.

    Returns
    -------
    residual
        Shape (n,).
    max_phase_error_rad
        The largest phase difference of model and readings; 0 where it is obviously small.
    """
    if at.parts:
        parts = [unwrapped(one, part.at) for one, part in zip(data.each(), at.parts, strict=True)]
        return np.concatenate([part for part, _ in parts]), max(slip for _, slip in parts)
    difference = data.residual(at.reading)
    # Where all residuals are small, no cycle's phase can differ, but for whole turns.
    small = np.max(np.abs(difference) * data.weight) <= 0.5 * LARGE_PHASE_ERROR * np.min(
        at.sampled.amplitude
    )
    if small and abs(_turned(data, at)) < math.pi:
        return difference, 0.0
    log_ratio, phase, centre = alignment(data, at, difference)
    slip = float(np.max(np.abs(phase), initial=0.0))
    if slip < LARGE_PHASE_ERROR and np.max(np.abs(log_ratio), initial=0.0) < LARGE_PHASE_ERROR:
        return difference, slip
    sampled = at.sampled
    by_log = np.interp(sampled.phase, centre, log_ratio)
    by_phase = np.interp(sampled.phase, centre, phase)
    amplitude = sampled.motion.upwards * sampled.amplitude
    moved = amplitude * np.exp(by_log) * np.cos(sampled.phase + by_phase)
    omega = sampled.motion.angular_frequency
    linear = sampled.angle * by_log + sampled.velocity / omega * by_phase
    return difference + sampled.angle - moved + linear, slip


def _turned(data: Data, at: Evaluated) -> float:
    """Return the phase by which the readings are ahead at the anchor; 0 without an anchor."""
    if data.anchor is None:
        return 0.0
    when, turned = data.anchor
    return turned - float(np.interp(when, at.sampled.time_s, at.sampled.phase))


def alignment(data: Data, at: Evaluated, difference: FloatArray) -> Alignment:
    """Compare readings with a model cycle by cycle; empty if there are too few cycles.

    Parameters
    ----------
    data, at
        The readings, and the model at them.
    difference
        Result of `data.residual`, shape (n,).
    """
    sampled = at.sampled
    try:
        found = lock_in(difference + sampled.angle, data.weight, sampled, _CYCLE_SHARE)
    except np.linalg.LinAlgError:
        return _NO_CYCLES
    if len(found.number) < 2:
        return _NO_CYCLES
    phase = found.phase
    turns = np.round((phase[0] - _turned(data, at)) / (2.0 * math.pi))
    phase = phase - 2.0 * math.pi * turns
    ratio = np.log(np.maximum(np.hypot(found.cosine, found.sine), 1e-3))
    # Differences within the noise count as zero.
    chance = _NOISE_SD * data.noise_rms / np.sqrt(np.maximum(found.strength, 1e-300))
    phase = np.where(np.abs(phase) > chance, phase, 0.0)
    ratio = np.where(np.abs(ratio) > chance, ratio, 0.0)
    return Alignment(ratio, phase, found.middle)
