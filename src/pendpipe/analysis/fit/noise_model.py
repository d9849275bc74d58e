"""The noise of the readings about a fitted waveform: white, rounding, and slow."""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np

from pendpipe.analysis.fit.waveform import Waveform
from pendpipe.analysis.noise import quantisation_rms, white_rms
from pendpipe.analysis.turning_points import TurningPoints
from pendpipe.analysis.turning_points.samples import Samples
from pendpipe.arrays import FloatArray, IntArray
from pendpipe.dynamics.kernel import kernel

_CHANCE: Final = 5.0
_COARSE: Final = 12.0
"""Readings in a half cycle below which differences would see the motion's own misfit."""


class Noise(NamedTuple):
    """Noise of one reading, and how much more there is at the motion's frequency."""

    rms: float
    slow: float
    """Variance of the half cycles' amplitudes over what white noise makes of it; 1 where
    chance explains the difference."""


def judge_noise(
    samples: Samples, points: TurningPoints, residual: FloatArray, problem: Waveform
) -> Noise:
    """Estimate the noise from what the fit leaves.

    The white part comes from fourth differences, which a slow misfit cannot touch, and is
    never taken below step/sqrt(12). What a, b, c suffer from is the noise at the motion's
    own frequency: drifts and misfits show there as scatter of the half cycles' residual
    amplitudes.
    """
    floor = quantisation_rms(samples.step)
    per_half_cycle = len(residual) / max(len(points), 1)
    if samples.counts or per_half_cycle < _COARSE:
        rms = points.noise_rms_rad
    else:
        rms = white_rms(residual)
    largest = max(float(problem.values.max()), -float(problem.values.min()))
    rms = max(rms, floor, 1e-15 * largest)
    return Noise(rms, _slow(points, residual, problem.time_s, rms))


def _slow(points: TurningPoints, residual: FloatArray, time: FloatArray, rms: float) -> float:
    """Scatter of the residual's amplitude in each half cycle against white noise's.

    Each is the residual's product with a parabola that vanishes at the middles between
    turning points (a half wave, near enough), over the root of the parabola's square.
    """
    middles = 0.5 * (points.time_s[1:] + points.time_s[:-1])
    edges = np.searchsorted(time, middles)
    readings = np.diff(edges)
    if len(middles) < 10 or readings.min() < 3:
        return 1.0
    ratio = _mean_square(middles, edges, time, residual) / rms**2
    return ratio if ratio > 1.0 + _CHANCE * math.sqrt(2.0 / len(readings)) else 1.0


@kernel(any_order=True)
def _mean_square(
    middles: FloatArray, edges: IntArray, time_s: FloatArray, residual: FloatArray
) -> float:
    """Return the mean square of the half cycles' residual amplitudes; see `_slow`."""
    total = 0.0
    for k in range(middles.size - 1):
        inverse, product, square = 1.0 / (middles[k + 1] - middles[k]), 0.0, 0.0
        for i in range(edges[k], edges[k + 1]):
            share = (time_s[i] - middles[k]) * inverse
            parabola = share * (1.0 - share)
            product += residual[i] * parabola
            square += parabola * parabola
        total += product * product / square
    return total / (middles.size - 1)
