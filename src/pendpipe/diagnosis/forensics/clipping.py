"""Clipping: a range smaller than the motion."""

from __future__ import annotations

import math
from typing import Final, Literal, NamedTuple

import numpy as np
from scipy.special import log_ndtr

from pendpipe.analysis.turning_points.samples import Samples
from pendpipe.arrays import BoolArray, FloatArray, IntArray
from pendpipe.diagnosis.data import Data
from pendpipe.diagnosis.forensics.codes import Raw, raw_readings
from pendpipe.diagnosis.forensics.finding import Finding, nothing
from pendpipe.diagnosis.forensics.lattice import (
    Lattice,
    lattice_of,
    noise_before_rounding,
    whole_readings,
)
from pendpipe.diagnosis.forensics.local import Local, local_residual
from pendpipe.diagnosis.noise import Noise
from pendpipe.diagnosis.refine import Fit
from pendpipe.diagnosis.result import Location
from pendpipe.estimate import Estimate

_FEWEST_AT_END: Final = 2
"""Readings exactly at the end of the range that make a flat top."""
_SHARED_ERROR: Final = 0.1
"""Error in steps of the true angle that a window's readings share if rounding is coarse."""
_ROUNDING_RMS: Final = 0.5
"""Rms in steps up to which errors may be correlated by rounding alone."""
_MASK_BELOW: Final = 1e-2

Side = Literal["upper", "lower"]


class End(NamedTuple):
    """One end of the range."""

    side: Side
    limit: float
    at: BoolArray
    """Readings at this end; shape (m,) of `Raw`."""
    p_value: float
    delta_chi2: float


def find(data: Data, fit: Fit, noise: Noise, samples: Samples) -> Finding:
    """Test whether the largest (smallest) reading is smaller than the motion's.

    With the true angles x_j from the rest of each window (without readings at the end), the
    probability that no reading exceeds the limit m is

        p = product over j of Phi((m + q/2 - x_j)/sigma_j),

    the distribution of the largest reading. It is tested only if two readings or more are
    equal, as at the end of a converter's range.
    """
    if data.time_noise or samples.counts or data.used < 60:
        return nothing("clipping")
    raw = raw_readings(data, fit, samples)
    lattice = lattice_of(raw.values, samples)
    sides: tuple[Side, Side] = ("upper", "lower")
    ends = [_end(raw, lattice, side, noise.memory) for side in sides]
    p_value = -math.expm1(2.0 * math.log1p(-min(min(end.p_value for end in ends), 1.0 - 1e-12)))
    clipped = [end for end in ends if end.p_value < _MASK_BELOW]
    if not clipped:
        return Finding("clipping", p_value, summary="the largest readings agree with the motion")
    return _described(data, fit, samples, lattice, clipped, p_value)


def _at_end(raw: Raw, slack: float, sign: float) -> BoolArray:
    """Return the readings at the end of the observed range."""
    limit = float((sign * raw.values[raw.used]).max())
    return np.asarray(raw.used & (sign * raw.values >= limit - slack))


def _end(raw: Raw, lattice: Lattice | None, side: Side, memory: float) -> End:
    sign = 1.0 if side == "upper" else -1.0
    step = lattice.step if lattice is not None else 0.0
    slack = 0.5 * step if step else 1e-9 * float(np.ptp(raw.values[raw.used]))
    at, other = _at_end(raw, slack, sign), _at_end(raw, slack, -sign)
    limit = float((sign * raw.values[at]).max())
    if np.count_nonzero(at) < _FEWEST_AT_END:
        return End(side, sign * limit, at, 1.0, 0.0)
    local = local_residual(raw.phase, raw.residual, raw.used, leave_out=at | other)
    if local.smooth(memory) and local.rms > _ROUNDING_RMS * step:
        # The motion is not fitted well enough: its true extremes are unknown.
        return End(side, sign * limit, at, 1.0, 0.0)
    true = sign * (raw.values - local.left)
    before = _noise(local, step)
    spread = np.sqrt(before**2 + local.rms**2 * np.maximum(local.leverage, 0.0))
    near = raw.used & (true > limit - 6.0 * local.rms - 3.0 * step)
    p_value = _largest(limit + 0.5 * step - true[near], spread[near], _common(before, step))
    beyond = np.maximum(true[at] - limit - 0.5 * step, 0.0) / spread[at]
    return End(side, sign * limit, at, p_value, float(beyond @ beyond))


def _noise(local: Local, step: float) -> float:
    return noise_before_rounding(local, step) if step else local.rms


def _common(before: float, step: float) -> float:
    """Error of the true angle due to rounding, common to readings of one code."""
    if not step:
        return 0.0
    return _SHARED_ERROR * step * math.exp(-2.0 * math.pi**2 * min((before / step) ** 2, 30.0))


def _largest(room: FloatArray, spread: FloatArray, common: float) -> float:
    """Probability that no reading goes beyond, averaged over the common error."""
    nodes, weights = np.polynomial.hermite_e.hermegauss(9)
    shifted = (room[:, None] + common * nodes) / spread[:, None]
    chance = np.exp(np.sum(log_ndtr(shifted), axis=0))
    return float(min(chance @ weights / weights.sum(), 1.0))


def _clipped(data: Data, samples: Samples, ends: list[End], step: float) -> tuple[int, BoolArray]:
    """Return how many samples are at the ends, and which readings contain some; shape (n,)."""
    part = whole_readings(data, samples)
    if part is None:
        inside = (samples.time_s >= data.time_s[0]) & (samples.time_s <= data.time_s[-1])
        index = np.flatnonzero(inside)
        datum = _nearest_datum(data, samples.time_s[index])
    else:
        index, datum = np.arange(part.start, part.stop), np.arange(len(data))
    clipped = np.zeros(len(index), dtype=bool)
    slack = 0.5 * step if step else 1e-9 * abs(ends[0].limit)
    for end in ends:
        sign = 1.0 if end.side == "upper" else -1.0
        clipped |= sign * (samples.values[index] - end.limit) >= -slack
    mask = np.zeros(len(data), dtype=bool)
    mask[datum[clipped]] = True
    return int(np.count_nonzero(clipped)), mask


def _nearest_datum(data: Data, time_s: FloatArray) -> IntArray:
    """Return the index of the datum nearest to each time."""
    middle = 0.5 * (data.time_s[1:] + data.time_s[:-1])
    return np.asarray(np.searchsorted(middle, time_s))


def _described(
    data: Data,
    fit: Fit,
    samples: Samples,
    lattice: Lattice | None,
    ends: list[End],
    p_value: float,
) -> Finding:
    parameters = {}
    codes = []
    step = lattice.step if lattice is not None else 0.0
    number, mask = _clipped(data, samples, ends, step)
    for end in ends:
        parameters[f"{end.side}_level"] = Estimate(end.limit, step / math.sqrt(12.0), data.unit)
        if lattice is not None:
            codes.append(round(float(lattice.position(np.array(end.limit)))))
    parameters["number"] = Estimate(float(number), 0.0, "")
    when, amplitude = data.time_s[mask], fit.at.sampled.amplitude[mask]
    sides = " and ".join(end.side for end in ends)
    limits = " and ".join(f"{end.limit:.5g}" for end in ends)
    around = {"upper": 0.0, "lower": math.pi}[ends[0].side]
    return Finding(
        "clipping",
        p_value,
        sum(end.delta_chi2 for end in ends),
        parameters,
        Location(
            (float(when[0]), float(when[-1])),
            (float(amplitude.min()), float(amplitude.max())),
            ((around - 0.2) % (2.0 * math.pi), (around + 0.2) % (2.0 * math.pi))
            if len(ends) == 1
            else None,
            adc_codes=tuple(codes),
        ),
        mask=mask,
        summary=f"{number} readings lie at the {sides} end of the range ({limits}"
        f" {data.unit}), which the motion exceeds, until {when[-1]:.4g} s",
    )
