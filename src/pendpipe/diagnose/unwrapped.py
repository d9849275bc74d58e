"""The residual along the motion, where phases differ by more than a linear theory bears."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from pendpipe.arrays import FloatArray
from pendpipe.diagnose.data import Data
from pendpipe.diagnose.model import Evaluated

_SLIP: Final = 0.15
"""Phase in rad, and part of the amplitude, from which the plain difference is no longer used."""

_CHANCE: Final = 5.0
"""Standard deviations of a cycle's phase and amplitude below which they are not believed."""


def anchored(data: Data, at: Evaluated) -> tuple[float, float]:
    """Return a time near the beginning and the readings' phase then, turns counted.

    The model must be in phase with the first cycles, as a start from turning points is.
    """
    _, phase, centre = _alignment(data, at, data.residual(at.reading))
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
    slip_rad
        The largest phase between model and readings.
    """
    plain = data.residual(at.reading)
    log_ratio, phase, centre = _alignment(data, at, plain)
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


def _alignment(
    data: Data, at: Evaluated, plain: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Log ratio of amplitudes and phase in each cycle, and the cycle's middle (as psi)."""
    sampled = at.sampled
    observed = (plain + sampled.angle) * data.weight
    cycle = np.floor(sampled.phase / (2.0 * math.pi)).astype(np.int64)
    cycle -= cycle.min()
    count = int(cycle.max()) + 1
    carrier = sampled.motion.upwards * sampled.amplitude
    in_phase, quadrature = carrier * sampled.cosine, carrier * sampled.sine
    w = data.weight
    sums = [
        np.bincount(cycle, weights=w * part, minlength=count)
        for part in (
            np.ones(len(data)), in_phase, quadrature, in_phase**2, quadrature**2,
            in_phase * quadrature, sampled.phase,
        )
    ]  # fmt: skip
    data_sums = [
        np.bincount(cycle, weights=observed * part, minlength=count)
        for part in (np.ones(len(data)), in_phase, quadrature)
    ]
    good = sums[0] >= max(5.0, 0.6 * float(np.median(sums[0])))
    if np.count_nonzero(good) < 2:
        return np.zeros(0), np.zeros(0), np.zeros(0)
    n, si, sq, sii, sqq, siq, middle = (part[good] for part in sums)
    matrix = np.stack([np.stack([n, si, sq]), np.stack([si, sii, siq]), np.stack([sq, siq, sqq])])
    right = np.stack([part[good] for part in data_sums])
    try:
        solved = np.linalg.solve(matrix.transpose(2, 0, 1), right.T[..., None])[..., 0]
    except np.linalg.LinAlgError:
        return np.zeros(0), np.zeros(0), np.zeros(0)
    cosine, sine = solved[:, 1], solved[:, 2]
    # y = r (cosine cos psi + sine sin psi) = r R cos(psi + phase).
    phase = np.unwrap(np.arctan2(-sine, cosine))
    expected = 0.0
    if data.anchor is not None:
        when, turned = data.anchor
        expected = turned - float(np.interp(when, sampled.time_s, sampled.phase))
    phase -= 2.0 * math.pi * np.round((phase[0] - expected) / (2.0 * math.pi))
    ratio = np.log(np.maximum(np.hypot(cosine, sine), 1e-3))
    # What noise alone can do is no slip.
    chance = _CHANCE * data.noise_rms / np.sqrt(np.maximum(sii, 1e-300))
    phase = np.where(np.abs(phase) > chance, phase, 0.0)
    ratio = np.where(np.abs(ratio) > chance, ratio, 0.0)
    return ratio, phase, middle / n
