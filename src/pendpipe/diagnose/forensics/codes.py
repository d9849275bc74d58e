"""Codes of the converter beside the angles that the motion must have had."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from pendpipe.analysis.turning_points.samples import Samples
from pendpipe.arrays import BoolArray, FloatArray, IntArray
from pendpipe.diagnose.data import Data
from pendpipe.diagnose.forensics.lattice import (
    Lattice,
    lattice_of,
    noise_before_rounding,
    whole_readings,
)
from pendpipe.diagnose.forensics.local import error_of, local_residual
from pendpipe.diagnose.refine import Fit
from pendpipe.dynamics.sampling import lagrange

_MOST: Final = 12000
"""Readings that are looked at: of more, every second, third, ..."""
_MISFIT: Final = 0.15
"""Misfit of the model in steps from which the angles are taken from the readings' windows."""


@dataclass(frozen=True)
class Coded:
    """Readings as codes; only those that count, and far-off ones left out.

    Parameters
    ----------
    lattice
        Step and origin (its codes are those of all readings).
    code
        Of each reading, shape (m,).
    position
        The angle without noise, in steps from code 0, shape (m,).
    blur
        Standard deviation of `position`'s error, in steps.
    ratio
        Noise before rounding, in steps.
    index
        Which reading of the samples each is; shape (m,).
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
    """Readings as they were taken, where the data may be means of several; shape (m,).

    Parameters
    ----------
    values, residual, phase, used
        Readings, readings less model, the motion's phase, and which count.
    index
        Which of the samples each is.
    place
        Which of the data each belongs to.
    """

    values: FloatArray
    residual: FloatArray
    phase: FloatArray
    used: BoolArray
    index: IntArray
    place: IntArray


def raw_readings(data: Data, fit: Fit, samples: Samples) -> Raw:
    """Take the readings behind the data; of very many every second, third, ..."""
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
            np.arange(len(data)),
        )
    first = int(np.searchsorted(samples.time_s, data.time_s[0] - 1e-9))
    last = int(np.searchsorted(samples.time_s, data.time_s[-1] + 1e-9))
    index = np.arange(first, last, max(1, (last - first) // _MOST))
    when, values = samples.time_s[index], samples.values[index]
    return Raw(
        values,
        values - _between(data.time_s, reading, when),
        np.interp(when, data.time_s, sampled.phase),
        np.interp(when, data.time_s, data.weight) > 0.99,
        index,
        place_of(data, when),
    )


def place_of(data: Data, time_s: FloatArray) -> IntArray:
    """Which of the data lies nearest to each time."""
    middle = 0.5 * (data.time_s[1:] + data.time_s[:-1])
    return np.asarray(np.searchsorted(middle, time_s))


def read_codes(data: Data, fit: Fit, samples: Samples) -> Coded | None:
    """Set codes and angles side by side; None where the readings have no step.

    The angles are the fitted model's while it is good to a small part of a step, else the
    local fit's to the readings themselves.
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
    if misfit < _MISFIT:
        true, blur = values - residual, min(0.5 * misfit, 0.05)
    else:
        true = values - local.left
        blur = math.sqrt(noise) / step
    position = lattice.position(true[good])
    return Coded(lattice, lattice.code[good], position, blur, ratio, raw.index[good])


def _between(time: FloatArray, values: FloatArray, when: FloatArray) -> FloatArray:
    """Polynomials through six neighbouring values each."""
    first = np.clip(np.searchsorted(time, when) - 3, 0, len(time) - 6)
    weights = lagrange(time, first, when)
    near = np.stack([values[first + point] for point in range(len(weights))])
    return np.asarray(np.sum(weights * near, axis=0))
