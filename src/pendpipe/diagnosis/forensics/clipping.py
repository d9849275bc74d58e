"""Clipping: a range smaller than the motion."""

from __future__ import annotations

import math
from typing import Final, Literal, NamedTuple

import numpy as np
from scipy.special import log_ndtr

from pendpipe.analysis.turning_points.samples import Samples
from pendpipe.arrays import BoolArray, FloatArray
from pendpipe.diagnosis.data import Data
from pendpipe.diagnosis.forensics.codes import (
    Lattice,
    Raw,
    lattice_of,
    noise_before_rounding,
    raw_readings,
    whole_readings,
)
from pendpipe.diagnosis.forensics.local import local_residual
from pendpipe.diagnosis.noise import Noise
from pendpipe.diagnosis.refine import Fit
from pendpipe.diagnosis.result import Finding, Location, nothing
from pendpipe.estimate import Estimate

_FEWEST_AT_END: Final = 2
"""Readings exactly at the end of the range that make a flat top."""
_SHARED_ERROR: Final = 0.1
"""Error in steps of the true angle that a window's readings share if rounding is coarse."""
_ROUNDING_RMS: Final = 0.5
"""Rms in steps up to which errors may be correlated by rounding alone."""
_MASK_BELOW: Final = 1e-2

Side = Literal["upper", "lower"]
_SIGN: Final[dict[Side, float]] = {"upper": 1.0, "lower": -1.0}


class End(NamedTuple):
    """One end of the range."""

    side: Side
    limit: float
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
    step = lattice.step if lattice is not None else 0.0
    ends = [_end(raw, step, side, noise.memory) for side in _SIGN]
    p_value = -math.expm1(2.0 * math.log1p(-min(min(end.p_value for end in ends), 1.0 - 1e-12)))
    clipped = [end for end in ends if end.p_value < _MASK_BELOW]
    if not clipped:
        return Finding("clipping", p_value, summary="the largest readings agree with the motion")
    return _described(data, fit, samples, lattice, clipped, p_value)


def _end(raw: Raw, step: float, side: Side, memory: float) -> End:
    sign, values = _SIGN[side], _SIGN[side] * raw.values
    limit, other = float(values[raw.used].max()), float(values[raw.used].min())
    slack = 0.5 * step if step else 1e-9 * (limit - other)
    at = raw.used & (values >= limit - slack)
    quiet = End(side, sign * limit, 1.0, 0.0)
    if np.count_nonzero(at) < _FEWEST_AT_END:
        return quiet
    outermost = at | (raw.used & (values <= other + slack))
    local = local_residual(raw.phase, raw.residual, raw.used, leave_out=outermost)
    if local.smooth(memory) and local.rms > _ROUNDING_RMS * step:
        # The motion is not fitted well enough: its true extremes are unknown.
        return quiet
    true = values - sign * local.left
    before = noise_before_rounding(local, step) if step else local.rms
    spread = np.sqrt(before**2 + local.rms**2 * np.maximum(local.leverage, 0.0))
    near = raw.used & (true > limit - 6.0 * local.rms - 3.0 * step)
    p_value = _largest(limit + 0.5 * step - true[near], spread[near], _common(before, step))
    beyond = np.maximum(true[at] - limit - 0.5 * step, 0.0) / spread[at]
    return End(side, sign * limit, p_value, float(beyond @ beyond))


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
        middle = 0.5 * (data.time_s[1:] + data.time_s[:-1])
        datum = np.searchsorted(middle, samples.time_s[index])
    else:
        index, datum = np.arange(part.start, part.stop), np.arange(len(data))
    clipped = np.zeros(len(index), dtype=bool)
    slack = 0.5 * step if step else 1e-9 * abs(ends[0].limit)
    for end in ends:
        clipped |= _SIGN[end.side] * (samples.values[index] - end.limit) >= -slack
    mask = np.zeros(len(data), dtype=bool)
    mask[datum[clipped]] = True
    return int(np.count_nonzero(clipped)), mask


def _described(
    data: Data,
    fit: Fit,
    samples: Samples,
    lattice: Lattice | None,
    ends: list[End],
    p_value: float,
) -> Finding:
    step, limits_at = 0.0, np.array([end.limit for end in ends])
    codes: tuple[int, ...] = ()
    if lattice is not None:
        step, codes = lattice.step, tuple(np.rint(lattice.position(limits_at)).astype(int).tolist())
    number, mask = _clipped(data, samples, ends, step)
    sd = step / math.sqrt(12.0)
    parameters = {f"{end.side}_level": Estimate(end.limit, sd, data.unit) for end in ends}
    parameters["number"] = Estimate(float(number), 0.0, "")
    when = data.time_s[mask]
    sides = " and ".join(end.side for end in ends)
    limits = " and ".join(f"{end.limit:.5g}" for end in ends)
    around = {"upper": 0.0, "lower": math.pi}[ends[0].side]
    phase = (around - 0.2) % (2.0 * math.pi), (around + 0.2) % (2.0 * math.pi)
    return Finding(
        "clipping",
        p_value,
        sum(end.delta_chi2 for end in ends),
        parameters,
        Location.over(
            when,
            fit.at.sampled.amplitude[mask],
            phase if len(ends) == 1 else None,
            adc_codes=codes,
        ),
        mask=mask,
        summary=f"{number} readings lie at the {sides} end of the range ({limits}"
        f" {data.unit}), which the motion exceeds, until {when[-1]:.4g} s",
    )
