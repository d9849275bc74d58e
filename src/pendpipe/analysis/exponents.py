"""How the viscous quality factor goes with the frequency along a branch (Eq. 11)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pendpipe.analysis.viscous import SharedErrors, ViscousLosses, shifted
from pendpipe.arrays import FloatArray
from pendpipe.estimate import Estimate

FEWEST_IN_A_RANGE = 4
MOST_LEFT_OUT = 2
"""At either end of the branch, when the dependence on the range is looked at."""


@dataclass(frozen=True)
class RangeSlope:
    """The exponent over a part of the branch, and the records where it begins and ends."""

    first: str
    last: str
    exponent: float
    sd: float


@dataclass(frozen=True)
class Exponent:
    """A branch as a power law, and how far it is one.

    Parameters
    ----------
    exponent
        The (unweighted) least-squares slope of ln Q_v on ln f over the branch.
    sd_own, sd_common
        Parts of its error: the records' own, and that of the hysteretic coefficient.
    curvature
        Second derivative of ln Q_v with respect to ln f, from a parabola; NaN with fewer
        than three records. Zero for a power law.
    local_slopes
        Between neighbours in frequency, from the lowest up; NaN between equal frequencies.
    ranges
        The slope over parts of the branch, with up to two records left out at each end.
    records
        The branch in the order of its frequencies.
    """

    exponent: Estimate
    sd_own: float
    sd_common: float
    curvature: Estimate
    local_slopes: tuple[float, ...]
    ranges: tuple[RangeSlope, ...]
    records: tuple[str, ...]


def fit_exponent(branch: ViscousLosses, errors: SharedErrors) -> Exponent | None:
    """Fit Eq. 11's exponent to a branch.

    Returns
    -------
    Exponent
        ``None`` with fewer than two records, with a single frequency, or where a viscous
        rate is not positive (there is no logarithm).
    """
    count = len(branch.records)
    if count < 2 or np.any(branch.rate_per_s <= 0.0) or np.ptp(branch.frequency_hz) <= 0.0:
        return None
    slope, own, common = _derivative(branch, errors, 1)
    nan = float("nan")
    bend, bend_own, bend_common = _derivative(branch, errors, 2) if count > 2 else (nan, nan, nan)
    logs = np.log(branch.frequency_hz)
    steps = np.diff(logs)
    local = np.diff(_log_quality(branch)) / np.where(steps > 0.0, steps, nan)
    return Exponent(
        exponent=Estimate(slope, float(np.hypot(own, common)), ""),
        sd_own=own,
        sd_common=common,
        curvature=Estimate(bend, float(np.hypot(bend_own, bend_common)), ""),
        local_slopes=tuple(local.tolist()),
        ranges=_ranges(branch, errors),
        records=branch.records,
    )


def _ranges(branch: ViscousLosses, errors: SharedErrors) -> tuple[RangeSlope, ...]:
    """The slope with up to two records left out at each end; none at a single frequency."""
    count = len(branch.records)
    parts = []
    for low in range(MOST_LEFT_OUT + 1):
        for high in range(count - MOST_LEFT_OUT, count + 1):
            part = _part(branch, low, high)
            if high - low < min(FEWEST_IN_A_RANGE, count) or np.ptp(part.frequency_hz) <= 0.0:
                continue
            slope, own, common = _derivative(part, errors, 1)
            parts.append(
                RangeSlope(
                    branch.records[low],
                    branch.records[high - 1],
                    slope,
                    float(np.hypot(own, common)),
                )
            )
    return tuple(parts)


def _derivative(
    branch: ViscousLosses, errors: SharedErrors, order: int
) -> tuple[float, float, float]:
    """Derivative of ln Q_v by ln f from a least-squares polynomial: value, own sd, common sd."""
    logs = np.log(branch.frequency_hz)
    powers = np.vander(logs - np.mean(logs), order + 1, increasing=True)
    # The derivative is a sum of the ln Q_v with these weights; 2 for the parabola's u^2.
    weights = order * np.linalg.pinv(powers)[order]
    value = float(weights @ _log_quality(branch))
    own = float(np.sqrt(np.sum((weights * branch.rate_sd_per_s / branch.rate_per_s) ** 2)))
    source = "hysteretic coefficient"
    ends = [_log_quality(shifted(branch, errors, source, sds)) for sds in (1.0, -1.0)]
    return value, own, float(abs(weights @ (ends[0] - ends[1])) / 2.0)


def _log_quality(branch: ViscousLosses) -> FloatArray:
    """Return ln Q_v; where an error of k leaves no loss at all, the smallest that counts."""
    rate = np.maximum(branch.rate_per_s, 1e-3 * branch.rate_sd_per_s + 1e-300)
    logarithm: FloatArray = np.log(np.pi * branch.frequency_hz / rate)
    return logarithm


def _part(branch: ViscousLosses, low: int, high: int) -> ViscousLosses:
    """The records from `low` up to and without `high`."""
    return ViscousLosses(
        **{name: column[low:high] for name, column in vars(branch).items()},
    )
