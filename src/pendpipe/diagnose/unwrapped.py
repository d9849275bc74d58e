"""The residual along the motion, where phases differ by more than a linear theory bears."""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np

from pendpipe.arrays import FloatArray
from pendpipe.diagnose.data import Data
from pendpipe.diagnose.lock_in import lock_in
from pendpipe.effects.model import Evaluated

_SLIP: Final = 0.15
"""Phase in rad, and part of the amplitude, from which the plain difference is no longer used."""

_SLIGHT: Final = 0.05
"""Of the amplitude: residuals that no phase or ratio of 0.1 leaves in a full cycle."""
_WHOLE: Final = 0.6
"""Part of a cycle's readings that must be there."""
_CHANCE: Final = 5.0
"""Standard deviations of a cycle's phase and amplitude below which they are not believed."""


class Alignment(NamedTuple):
    """By how much the readings differ from a model, one number a cycle, shape (k,)."""

    log_ratio: FloatArray
    """Of the amplitudes."""
    phase: FloatArray
    """By which they are ahead, rad, whole turns counted."""
    middle: FloatArray
    """The model's phase in the middle of the cycle's readings, rad."""


_NO_CYCLES: Final = Alignment(np.zeros(0), np.zeros(0), np.zeros(0))


def anchored(data: Data, at: Evaluated) -> tuple[float, float]:
    """Return a time near the beginning and the readings' phase then, turns counted.

    The model must be in phase with the first cycles, as a start from turning points is.
    """
    _, phase, centre = alignment(data, at, data.residual(at.reading))
    if not len(phase):
        return float(at.sampled.time_s[0]), float(at.sampled.phase[0])
    when = float(np.interp(centre[0], at.sampled.phase, at.sampled.time_s))
    return when, float(centre[0] + phase[0])


def unwrapped(data: Data, at: Evaluated) -> tuple[FloatArray, float]:
    """Return readings minus model, linear in what changes amplitude and phase.

    In windows of one cycle the readings are compared with the model's cosine and sine; the
    ratio of the amplitudes and the phase between them, unwrapped along the record, align
    the model with the readings. What the aligned model leaves, and the alignment times the
    model's own derivatives, is the residual: it is what the difference would be if the
    model's readings were linear in amplitude and phase.

    Returns
    -------
    residual
        Shape (n,).
    max_phase_error_rad
        The largest phase between model and readings; 0 where it is seen to be slight.
    """
    plain = data.residual(at.reading)
    if _in_phase(data, at, plain):
        return plain, 0.0
    log_ratio, phase, centre = alignment(data, at, plain)
    slip = float(np.max(np.abs(phase), initial=0.0))
    if slip < _SLIP and np.max(np.abs(log_ratio), initial=0.0) < _SLIP:
        return plain, slip
    sampled = at.sampled
    by_log = np.interp(sampled.phase, centre, log_ratio)
    by_phase = np.interp(sampled.phase, centre, phase)
    amplitude = sampled.motion.upwards * sampled.amplitude
    moved = amplitude * np.exp(by_log) * np.cos(sampled.phase + by_phase)
    omega = sampled.motion.angular_frequency
    linear = sampled.angle * by_log + sampled.velocity / omega * by_phase
    return plain + sampled.angle - moved + linear, slip


def _in_phase(data: Data, at: Evaluated, plain: FloatArray) -> bool:
    """Whether no reading is far enough from the model for the phase to be, in any cycle."""
    sampled = at.sampled
    if np.max(np.abs(plain) * data.weight) > _SLIGHT * np.min(sampled.amplitude):
        return False
    return abs(_turned(data, at)) < math.pi


def _turned(data: Data, at: Evaluated) -> float:
    """By how much the readings are ahead at the anchor, whole turns counted; 0 without one."""
    if data.anchor is None:
        return 0.0
    when, turned = data.anchor
    return turned - float(np.interp(when, at.sampled.time_s, at.sampled.phase))


def alignment(data: Data, at: Evaluated, plain: FloatArray) -> Alignment:
    """Compare readings with a model cycle by cycle; empty where there are too few.

    Parameters
    ----------
    data, at
        The readings, and the model at them.
    plain
        What `data.residual` says of them, shape (n,).
    """
    sampled = at.sampled
    try:
        found = lock_in(plain + sampled.angle, data.weight, sampled, _WHOLE)
    except np.linalg.LinAlgError:
        return _NO_CYCLES
    if len(found.number) < 2:
        return _NO_CYCLES
    phase = found.phase
    turns = np.round((phase[0] - _turned(data, at)) / (2.0 * math.pi))
    phase = phase - 2.0 * math.pi * turns
    ratio = np.log(np.maximum(np.hypot(found.cosine, found.sine), 1e-3))
    # What noise alone can do is no slip.
    chance = _CHANCE * data.noise_rms / np.sqrt(np.maximum(found.strength, 1e-300))
    phase = np.where(np.abs(phase) > chance, phase, 0.0)
    ratio = np.where(np.abs(ratio) > chance, ratio, 0.0)
    return Alignment(ratio, phase, found.middle)
