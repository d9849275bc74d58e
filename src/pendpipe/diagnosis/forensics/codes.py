"""Codes of a converter: their lattice, rounding, and the angles that the motion had."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from pendpipe.analysis.noise import before_rounding, noise_rms, scatter
from pendpipe.analysis.turning_points.measure import Samples
from pendpipe.arrays import BoolArray, FloatArray, IntArray
from pendpipe.diagnosis.forensics.local import Local, local_residual
from pendpipe.dynamics.any_law import lagrange

if TYPE_CHECKING:
    from pendpipe.diagnosis.forensics.evidence import Evidence

_FIRST_CODES: Final = 256
"""Readings that show whether all lie on codes: a wrong step is a whole one off after 20 of them."""
_FEWEST_CODES: Final = 16
"""Number of different codes that lie on a coarser lattice by chance with 2^-16 at most."""
_ROUNDS: Final = 4
"""Times that gaps are counted anew: one that was counted wrong moves the line by less each time."""
_TOLERANCE: Final = 0.05
"""Tolerance of readings about their codes, in steps."""
_LARGEST_ROUNDING: Final = 0.6
"""Largest rounding of a coarser step's readings, in steps of the converter (half, and a margin)."""
_MOST_READINGS: Final = 12000
"""Largest number of readings used: of more, every second, third, ..."""
_GOOD_MODEL: Final = 0.15
"""Misfit of the model in steps from which the angles come from local fits."""


@dataclass(frozen=True)
class Lattice:
    """Readings as integer multiples of a step.

    Parameters
    ----------
    step
        In the unit of the readings.
    code
        Of each reading: its value is ``step code + origin``; shape (n,).
    origin
        The value of code 0: within half a step of zero.
    """

    step: float
    code: IntArray
    origin: float

    def position(self, value: FloatArray) -> FloatArray:
        """Return values in steps from code 0."""
        return np.asarray((value - self.origin) / self.step)


def lattice_of(values: FloatArray, samples: Samples) -> Lattice | None:
    """Number the codes of a recording's readings (or some of them); None if they lie on no lattice.

    The step is refined over the whole range, so that codes far from zero are numbered right. The
    coarser step of an earlier stage is rounded to the converter's own.
    """
    step, slack = samples.step, _TOLERANCE
    distinct, inverse = np.unique(values, return_inverse=True)
    if step is None or len(distinct) < 3:
        return None
    if samples.promised_step is not None:
        slack = max(_LARGEST_ROUNDING * samples.promised_step / step, slack)
    number = np.append(0, np.cumsum(np.rint(np.diff(distinct) / step).astype(np.int64)))
    if number[-1] < 2:
        return None
    refined, origin = np.polyfit(number, distinct, 1).tolist()
    if np.max(np.abs(distinct - origin - refined * number)) > slack * refined:
        return None
    shift = round(origin / refined)
    return Lattice(refined, (number + shift)[inverse], origin - shift * refined)


def with_true_step(samples: Samples) -> Samples:
    """Use the step of the observed codes if it is larger than the converter's.

    A converter with k dead bits gives every 2^k-th code: its step is 2^k times its nominal one.
    If an earlier stage has a step of its own, of any size, the observed codes are multiples of
    it, each rounded to the nearest code.
    """
    if samples.counts or samples.step is None:
        return samples
    codes = (samples.values - samples.values[0]) / samples.step
    whole = np.rint(codes)
    if np.max(np.abs(codes - whole)[:_FIRST_CODES]) > _TOLERANCE:
        return samples
    times = spacing_of(np.unique(whole))
    if times is None:
        return samples
    step = times * samples.step
    noise = max(samples.noise_rms, noise_rms(samples.values, step))
    return replace(samples, step=step, noise_rms=noise, promised_step=samples.step)


def spacing_of(distinct: FloatArray) -> float | None:
    """Return the spacing of the observed codes in steps; None if they have none.

    Parameters
    ----------
    distinct
        Observed codes (whole numbers), rising.

    Returns
    -------
    float or None
        Whole if all codes are its multiples (from one of them on); else the spacing of a lattice
        of which they are the roundings.
    """
    gaps = np.diff(distinct)
    if len(distinct) < _FEWEST_CODES or gaps.min() < 2.0:
        return None
    common = int(np.gcd.reduce(gaps.astype(np.int64)))
    if common > 1:
        return float(common)
    # Neighbours are one spacing apart, rounded down or up; others two, three, ...
    spacing = float(np.mean(gaps[gaps <= 1.5 * gaps.min()]))
    number = np.append(0.0, np.cumsum(np.round(gaps / spacing)))
    for _ in range(_ROUNDS):
        spacing, first = np.polyfit(number, distinct, 1).tolist()
        if float(np.ptp(distinct - spacing * number)) < 2.0 * _LARGEST_ROUNDING:
            return float(spacing)
        # A gap may have been counted wrong: recount by the line through all of them.
        number = np.round((distinct - first) / spacing)
    return None


def noise_before_rounding(local: Local, step: float) -> float:
    """Estimate the noise before rounding, as a fit does (`before_rounding`).

    Outliers (glitches) are left out. The true angle comes from local fits, which take part of the
    noise.

    Parameters
    ----------
    local
        Readings minus their smooth part, which is taken as the true angle.
    step
        Of the readings.
    """
    near = local.used & (np.abs(local.left) < 5.0 * local.rms + step)
    kept = 1.0 + float(np.mean(np.maximum(local.leverage[near], -0.9)))
    left = local.left[near]
    return before_rounding(scatter(float(left @ left), kept * len(left)), step)


@dataclass(frozen=True)
class Coded:
    """Readings as codes, without masked and outlying ones.

    Parameters
    ----------
    step
        The lattice's.
    code
        Of each reading, shape (m,).
    position
        The angle without noise, in steps from code 0, shape (m,).
    blur
        Standard deviation of `position`'s error, in steps.
    ratio
        Noise before rounding, in steps.
    """

    step: float
    code: IntArray
    position: FloatArray
    blur: float
    ratio: float


class Raw(NamedTuple):
    """Original readings, where the data may be means of several; shape (m,).

    Parameters
    ----------
    values, residual, phase, used
        Readings, readings minus model, phase of the motion, and whether each counts.
    """

    values: FloatArray
    residual: FloatArray
    phase: FloatArray
    used: BoolArray


def raw_readings(evidence: Evidence) -> Raw:
    """Return the original readings of the data; of very many every second, third, ..."""
    data, samples, phase = evidence.data, evidence.samples, evidence.sampled.phase
    index = data.rows.reshape(-1)
    if data.fold == 1:
        return Raw(samples.values[index], evidence.error, phase, evidence.used)
    index = index[:: max(1, len(index) // _MOST_READINGS)]
    when, values = samples.time_s[index], samples.values[index]
    # The model by polynomials through six neighbouring means.
    start = np.clip(np.searchsorted(data.time_s, when) - 3, 0, len(data) - 6)
    weights = lagrange(data.time_s, start, when)
    near = evidence.fit.at.reading[start + np.arange(len(weights))[:, None]]
    used = np.interp(when, data.time_s, data.weight) == 1.0
    read = np.sum(weights * near, axis=0)
    return Raw(values, values - read, np.interp(when, data.time_s, phase), used)


def read_codes(evidence: Evidence) -> Coded | None:
    """Return codes and angles; None if the readings have no step, or mark counts.

    The angles are those of the model if it fits to a small part of a step, else those of local
    fits to the readings.
    """
    samples = evidence.samples
    if evidence.data.time_noise or samples.counts or samples.step is None:
        return None
    raw = raw_readings(evidence)
    lattice = lattice_of(raw.values, samples)
    if lattice is None:
        return None
    local, step = local_residual(raw.phase, raw.residual, raw.used), lattice.step
    taken = float(np.mean((raw.residual - local.left)[raw.used] ** 2))
    noise = local.rms**2 * float(np.mean(np.abs(local.leverage[raw.used])))
    misfit = math.sqrt(max(taken - noise, 0.0)) / step
    good = raw.used & (np.abs(local.scaled) < 6.0)
    ratio = noise_before_rounding(local, step) / step
    error, blur = local.left, math.sqrt(noise) / step
    if misfit < _GOOD_MODEL:
        error, blur = raw.residual, min(0.5 * misfit, 0.05)
    position = lattice.position((raw.values - error)[good])
    return Coded(step, lattice.code[good], position, blur, ratio)
