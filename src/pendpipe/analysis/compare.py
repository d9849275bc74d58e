"""A campaign's viscous losses beside Eq. 16: the drag's factor, C_H, the exponent of Eq. 11."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pendpipe.analysis.separate import SeparatedRecord
from pendpipe.analysis.viscous import (
    Line,
    SharedErrors,
    SharedEstimate,
    Surroundings,
    ViscousLosses,
    chi_square,
    fit_line,
    shared_effects,
    shifted,
    viscous_losses,
)
from pendpipe.arrays import FloatArray
from pendpipe.errors import InputError
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


@dataclass(frozen=True)
class ModelCheck:
    """What one theory says of the limiting Q of every record, beside what was measured.

    Parameters
    ----------
    history, hysteresis
        Whether the theory has Eq. 2's history term, and the internal friction.
    quality_factor_limit
        Its limits, shape (n,).
    ratio
        Those over the measured ones, shape (n,): above one where theory forgets a loss.
    chi2, degrees_of_freedom
        Of the measured rates about it, errors of k included.
    """

    history: bool
    hysteresis: bool
    quality_factor_limit: FloatArray
    ratio: FloatArray
    chi2: float
    degrees_of_freedom: int


@dataclass(frozen=True)
class Comparison:
    """All that `compare` finds.

    Parameters
    ----------
    losses
        The records that were compared, by frequency; the arrays below follow their order.
    quality_factor_theory, quality_factor_theory_sd
        Eq. 16 for each record, and its error from what is shared (k has no part in it).
    quality_factor_steady, radius_over_depth
        The steady Stokes law's Q, and a/delta.
    drag_over_theory
        Q_v of Eq. 16 over Q_v measured.
    theory_factor
        Inverse-variance mean of that (weights from the records' own errors).
    history_coefficient
        C_H of Eq. 2, fitted to the drag with the records' own weights.
    exponents
        Eq. 11 by branch.
    steady_stokes_percent
        How much the steady law underestimates the damping, least and most, per cent.
    checks
        The theories with and without history term and hysteresis.
    budget
        Relative error of `theory_factor` by source, the records' own first.
    """

    losses: ViscousLosses
    quality_factor_theory: FloatArray
    quality_factor_theory_sd: FloatArray
    quality_factor_steady: FloatArray
    radius_over_depth: FloatArray
    drag_over_theory: FloatArray
    theory_factor: SharedEstimate
    history_coefficient: SharedEstimate
    exponents: dict[str, Exponent]
    steady_stokes_percent: tuple[float, float]
    checks: tuple[ModelCheck, ...]
    budget: dict[str, float]


def compare(
    records: Sequence[SeparatedRecord],
    surroundings: dict[str, Surroundings],
    errors: SharedErrors,
) -> Comparison:
    """Compare the records in water with Eq. 16.

    Parameters
    ----------
    records
        After Eq. 17; those without surroundings or moment of inertia are left out.
    surroundings
        Sphere and fluid by record.
    errors
        Of what the records share.

    Raises
    ------
    InputError
        If no record can be compared.
    """
    losses = viscous_losses(records, surroundings)
    if not losses.records:
        raise InputError(
            "comparison", "no record swings in a fluid with a known sphere", "add a geometry"
        )
    factor = theory_factor(losses, errors)
    steady = losses.drag_over_theory(0.0)
    theory = losses.quality_factor_theory()
    effects = shared_effects(ViscousLosses.quality_factor_theory, losses, errors)
    return Comparison(
        losses=losses,
        quality_factor_theory=theory,
        quality_factor_theory_sd=np.sqrt(sum(effect**2 for effect in effects.values())),
        quality_factor_steady=losses.quality_factor_theory(0.0),
        radius_over_depth=losses.radius_over_depth,
        drag_over_theory=losses.drag_over_theory(),
        theory_factor=factor,
        history_coefficient=history_coefficient(losses, errors),
        exponents=_exponents(records, surroundings, errors),
        steady_stokes_percent=(
            100.0 * float(np.min(steady) - 1.0),
            100.0 * float(np.max(steady) - 1.0),
        ),
        checks=tuple(
            check_model(losses, errors, history=history, hysteresis=hysteresis)
            for history in (True, False)
            for hysteresis in (True, False)
        ),
        budget={"the records themselves": factor.sd_own / abs(factor.estimate.value)}
        | {
            source: abs(effect / factor.estimate.value)
            for source, effect in factor.shared.items()
            if effect != 0.0
        },
    )


def theory_factor(losses: ViscousLosses, errors: SharedErrors) -> SharedEstimate:
    """Drag measured over Eq. 2: the inverse-variance mean of Q_v(Eq. 16)/Q_v measured."""
    return fit_line(losses, errors, _drag_over_theory)


def history_coefficient(losses: ViscousLosses, errors: SharedErrors) -> SharedEstimate:
    """Fit C_H of ``drag = 6 pi eta a (1 + C_H a/delta) v`` by weighted least squares.

    The measured drag over the steady one, less 1, is C_H a/delta.
    """
    return fit_line(losses, errors, _excess_over_steady)


def check_model(
    losses: ViscousLosses, errors: SharedErrors, *, history: bool, hysteresis: bool
) -> ModelCheck:
    """Compare the measured limits of Q with a theory that has or lacks two of its terms."""

    def predicted(moved: ViscousLosses) -> FloatArray:
        viscous = np.pi * moved.frequency_hz / moved.quality_factor_theory(float(history))
        return viscous + hysteresis * moved.hysteretic_rate_per_s

    def excess(moved: ViscousLosses) -> FloatArray:
        return moved.rate_per_s + moved.hysteretic_rate_per_s - predicted(moved)

    effects = shared_effects(excess, losses, errors)
    rate = predicted(losses)
    return ModelCheck(
        history=history,
        hysteresis=hysteresis,
        quality_factor_limit=np.pi * losses.frequency_hz / rate,
        ratio=(losses.rate_per_s + losses.hysteretic_rate_per_s) / rate,
        chi2=chi_square(excess(losses), losses.drag_sd_per_s, effects),
        degrees_of_freedom=len(rate),
    )


def _drag_over_theory(losses: ViscousLosses) -> Line:
    per_rate = losses.quality_factor_theory() / (np.pi * losses.frequency_hz)
    return Line(
        np.ones_like(per_rate), per_rate * losses.rate_per_s, per_rate * losses.drag_sd_per_s
    )


def _excess_over_steady(losses: ViscousLosses) -> Line:
    per_rate = losses.quality_factor_theory(0.0) / (np.pi * losses.frequency_hz)
    return Line(
        losses.radius_over_depth,
        per_rate * losses.rate_per_s - 1.0,
        per_rate * losses.drag_sd_per_s,
    )


def _exponents(
    records: Sequence[SeparatedRecord],
    surroundings: dict[str, Surroundings],
    errors: SharedErrors,
) -> dict[str, Exponent]:
    """Eq. 11 for each branch of two or more records."""
    found = {}
    for branch in sorted({split.measured.branch for split in records} - {""}):
        members = [split for split in records if split.measured.branch == branch]
        exponent = fit_exponent(viscous_losses(members, surroundings), errors)
        if exponent is not None:
            found[branch] = exponent
    return found
