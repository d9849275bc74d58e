"""Codes of the converter, and the angles that the motion had."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from pendpipe.analysis.turning_points.samples import Samples
from pendpipe.arrays import BoolArray, FloatArray, IntArray
from pendpipe.diagnosis.data import Data
from pendpipe.diagnosis.forensics.lattice import (
    Lattice,
    lattice_of,
    noise_before_rounding,
    whole_readings,
)
from pendpipe.diagnosis.forensics.local import error_of, local_residual
from pendpipe.diagnosis.refine import Fit
from pendpipe.dynamics.sampling import lagrange

_MOST_READINGS: Final = 12000
"""Largest number of readings used: of more, every second, third, ..."""
_GOOD_MODEL: Final = 0.15
"""Misfit of the model in steps from which the angles come from local fits."""


@dataclass(frozen=True)
class Coded:
    """Readings as codes, without masked and outlying ones.

    Parameters
    ----------
    lattice
        Step and origin (with the codes of all readings).
    code
        Of each reading, shape (m,).
    position
        The angle without noise, in steps from code 0, shape (m,).
    blur
        Standard deviation of `position`'s error, in steps.
    ratio
        Noise before rounding, in steps.
    index
        Index among the samples; shape (m,).
    """

    lattice: Lattice
    code: IntArray
    position: FloatArray
    blur: float
    ratio: float
    index: IntArray

    @property
    def error(self) -> FloatArray:
        """Reading less angle, in steps, shape (m,)."""
        return self.code - self.position


@dataclass(frozen=True)
class Raw:
    """Original readings, where the data may be means of several; shape (m,).

    Parameters
    ----------
    values, residual, phase, used
        Readings, readings minus model, phase of the motion, and whether each counts.
    index
        Index among the samples.
    """

    values: FloatArray
    residual: FloatArray
    phase: FloatArray
    used: BoolArray
    index: IntArray


def raw_readings(data: Data, fit: Fit, samples: Samples) -> Raw:
    """Return the original readings of the data; of very many every second, third, ..."""
    sampled, reading = fit.at.sampled, fit.at.reading
    part = whole_readings(data, samples)
    if part is not None:
        index = np.arange(part.start, part.stop)
        return Raw(
            samples.values[part],
            error_of(data, fit),
            sampled.phase,
            data.weight > 0.0,
            index,
        )
    first = int(np.searchsorted(samples.time_s, data.time_s[0] - 1e-9))
    last = int(np.searchsorted(samples.time_s, data.time_s[-1] + 1e-9))
    index = np.arange(first, last, max(1, (last - first) // _MOST_READINGS))
    when, values = samples.time_s[index], samples.values[index]
    return Raw(
        values,
        values - _between(data.time_s, reading, when),
        np.interp(when, data.time_s, sampled.phase),
        np.interp(when, data.time_s, data.weight) > 0.99,
        index,
    )


def read_codes(data: Data, fit: Fit, samples: Samples) -> Coded | None:
    """Return codes and angles; None if the readings have no step.

    The angles are those of the model if it fits to a small part of a step, else those of local
    fits to the readings.
    """
    if samples.counts or samples.step is None:
        return None
    raw = raw_readings(data, fit, samples)
    values, residual, used = raw.values, raw.residual, raw.used
    lattice = lattice_of(values, samples)
    if lattice is None:
        return None
    local = local_residual(raw.phase, residual, used)
    step = lattice.step
    taken = float(np.mean((residual - local.left)[used] ** 2))
    noise = local.rms**2 * float(np.mean(np.abs(local.leverage[used])))
    misfit = math.sqrt(max(taken - noise, 0.0)) / step
    good = used & (np.abs(local.scaled) < 6.0)
    ratio = noise_before_rounding(local, step) / step
    if misfit < _GOOD_MODEL:
        true, blur = values - residual, min(0.5 * misfit, 0.05)
    else:
        true = values - local.left
        blur = math.sqrt(noise) / step
    position = lattice.position(true[good])
    return Coded(lattice, lattice.code[good], position, blur, ratio, raw.index[good])


def _between(time: FloatArray, values: FloatArray, when: FloatArray) -> FloatArray:
    """Interpolate by polynomials through six neighbouring values."""
    first = np.clip(np.searchsorted(time, when) - 3, 0, len(time) - 6)
    weights = lagrange(time, first, when)
    near = np.stack([values[first + point] for point in range(len(weights))])
    return np.asarray(np.sum(weights * near, axis=0))
