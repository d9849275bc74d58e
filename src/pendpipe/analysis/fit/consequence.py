"""What the misfit of a law does to the numbers that are quoted: the light by consequence.

The period, and Q at three amplitudes, are known from the turning points without a law. What a
misfit does to a fit is what the fit's numbers differ by from these: so much are the errors
widened, and not by how loud the misfit is in the readings. A sensor's third harmonic may stand out
by a thousand standard deviations and move neither Q nor the period.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from statistics import median
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from pendpipe.analysis.fit.decrement import CLEAR, TOLERANCE, Check, Light
from pendpipe.analysis.fit.period import fit_period
from pendpipe.analysis.fit.quality import relative_loss_sd
from pendpipe.analysis.turning_points import TurningPoints
from pendpipe.arrays import of_neighbours
from pendpipe.dynamics import Eq8
from pendpipe.estimate import Estimate
from pendpipe.quantities import compact

if TYPE_CHECKING:
    from pendpipe.analysis.fit.result import FitResult

_FEWEST: Final = 6
"""Turning points of which a period is asked."""
_LATE: Final = 4.0
"""Variance of their times over their own beyond which they are late as no law has it."""
_OFF: Final = 2.4
"""Standard deviations of the turning points beyond which a loss is off, where the law is known to
miss something: one of three is by chance in one decay of twenty."""
_LOSSES: Final = ("a", "b", "c", "amplitude", "offset")
_TIMES: Final = ("frequency", "phase")


class Widening(NamedTuple):
    """By what standard deviations are multiplied for what the law misses; 1 for nothing."""

    period: float = 1.0
    losses: float = 1.0


def check_period(points: TurningPoints, law: Eq8) -> tuple[Check, ...]:
    """Compare a law's period with the times of the turning points.

    Returns
    -------
    tuple of Check
        Of the whole decay, and of its large, middle and small swings; empty where there are too
        few of them.
    """
    clear = points.chosen(points.amplitude_rad > CLEAR * points.angle_sd_rad)
    count = len(clear)
    if count < _FEWEST or not np.all(np.isfinite(clear.time_sd_s)):
        # Somebody looked at these times, and nothing turned there.
        return ()
    parts = [slice(0, count)]
    if count >= 3 * _FEWEST:
        ends = [count * k // 3 for k in range(4)]
        parts += [slice(first, last) for first, last in pairwise(ends)]
    return tuple(_seen_period(clear.chosen(part), law) for part in parts)


def _seen_period(points: TurningPoints, law: Eq8) -> Check:
    rates = law.quadratic, law.hysteretic + law.viscous, law.coulomb
    found = fit_period(points, points.amplitude_rad, rates, restoring=law.restoring)
    late = found.late_rad - np.mean(found.late_rad)
    omega = found.angular_frequency
    # Neighbours that are late alike are fewer than they seem.
    correlated = of_neighbours(late, 0.9)
    variance = float(found.covariance[0, 0]) * correlated
    seen = 2.0 * math.pi / omega
    middle = math.sqrt(float(points.amplitude_rad[0]) * abs(float(points.amplitude_rad[-1])))
    return Check(
        middle,
        2.0 * math.pi / law.angular_frequency,
        seen,
        seen * math.sqrt(variance) / omega,
        max(found.chi2_per_dof * correlated, 1.0),
    )


def judged(result: FitResult, points: TurningPoints, law: Eq8, *, enlarged: float) -> FitResult:
    """Light a fit, and leave its errors as wide as the turning points ask.

    Parameters
    ----------
    result
        A fit with its ``decrement_check``, whose variances were enlarged.
    points, law
        What was fitted.
    enlarged
        By what the variances were multiplied.
    """
    periods, checks = check_period(points, law), result.decrement_check
    root = math.sqrt(enlarged)
    relative = result.period.sd / result.period.value / root
    of_times = [(each.excess, each.seen_sd / each.seen, relative) for each in periods]
    of_losses = [
        (
            each.excess,
            each.seen_sd / abs(each.seen),
            relative_loss_sd(result, each.amplitude_rad) / root,
        )
        for each in checks
    ]
    # Turning points that are fitted alone may be late as no law is, and fall as one does.
    late = result.method == "turning-points" and bool(periods) and periods[0].scatter > _LATE
    if enlarged > 1.0 or late:
        widening = Widening(
            max(_asked(of_times), _scattered(periods, enlarged)),
            max(_asked(of_losses), _scattered(checks, enlarged)) if enlarged > 1.0 else 1.0,
        )
        result = replace(_widened(result, widening, enlarged), widening=widening)
    quotable, problems = _quotable(result, periods)
    light, reason = _light(result, problems)
    return replace(
        result, light=light, light_reason=reason, quotable=quotable, period_check=periods
    )


def _scattered(checks: Sequence[Check], most: float) -> float:
    """By how much more than their own errors the turning points scatter about any smooth law."""
    return math.sqrt(min(median([each.scatter for each in checks] or [1.0]), most))


def _asked(differences: Sequence[tuple[float, float, float]]) -> float:
    """By what a fit's errors are to be multiplied, so that they explain what it is off by.

    Parameters
    ----------
    differences
        Difference of fit and turning points, standard deviation of the latter, and of the former.

    Returns
    -------
    float
        The least factor from 1 on for which ``difference^2/(factor^2 own^2 + seen^2)`` adds up to
        the number of differences.
    """
    known = [each for each in differences if all(map(math.isfinite, each)) and each[2] > 0.0]

    def excess(factor: float) -> float:
        return sum(off**2 / ((factor * own) ** 2 + seen**2) for off, seen, own in known) - len(
            known
        )

    if not known or excess(1.0) <= 0.0:
        return 1.0
    low = high = 1.0
    while excess(high) > 0.0:
        low, high = high, 4.0 * high
    for _ in range(40):
        middle = math.sqrt(low * high)
        low, high = (middle, high) if excess(middle) > 0.0 else (low, middle)
    return high


def _widened(result: FitResult, widening: Widening, enlarged: float) -> FitResult:
    """Replace one factor of all variances by those of the period and of the losses."""
    root = math.sqrt(enlarged)
    factors = dict.fromkeys(_LOSSES, widening.losses / root)
    factors |= dict.fromkeys(_TIMES, widening.period / root)
    scale = np.array([factors[name] for name in result.covariance_order])
    parameters = {
        name: scaled(each, factors[name], name) for name, each in result.parameters.items()
    }
    limit = result.quality_factor_limit
    return replace(
        result,
        parameters=parameters,
        covariance=result.covariance * scale[:, None] * scale,
        quality_factor_limit=limit and scaled(limit, factors["b"], "b"),
    )


def scaled(estimate: Estimate, factor: float, name: str) -> Estimate:
    """A parameter with a larger error; the interval of a loss keeps to its bound at zero."""
    value, (low, high) = estimate.value, estimate.bounds95
    least = min(0.0, low) if name in "abc" else -math.inf
    ends = max(value - factor * (value - low), least), value + factor * (high - value)
    return replace(estimate, sd=factor * estimate.sd, interval95=ends)


def _quotable(
    result: FitResult, periods: Sequence[Check]
) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """What may be quoted, and why the rest may not."""
    checks, unit = result.decrement_check, result.parameters["amplitude"].unit
    problems, quotable = [], []
    worst = max(periods, key=lambda each: abs(each.excess), default=None)
    if result.method == "amplitudes":
        # Its period is given, or there is none.
        pass
    elif worst is None:
        problems.append("the period: too few turning points confirm it")
    elif abs(worst.excess) > TOLERANCE:
        problems.append(
            f"the period: swings about {compact(worst.amplitude_rad, unit)} show"
            f" {worst.seen:.4g} s, and the law has {worst.fitted:.4g} s"
        )
    else:
        quotable.append("period")
    off, unseen = unsure(result)
    name = "half-lives" if math.isnan(result.value("frequency")) else "Q"
    seen_in = "amplitudes" if result.method == "amplitudes" else "turning points"
    if len(checks) < 3:
        problems.append(f"{name}: too few {seen_in} confirm it")
    problems += [
        f"{name} at {compact(each.amplitude_rad, unit)}: the {seen_in} show one that is"
        f" {abs(100.0 * each.excess):.0f} % {'higher' if each.excess > 0.0 else 'lower'}"
        for each in off
    ]
    if unseen:
        where = ", ".join(compact(each.amplitude_rad, unit) for each in unseen)
        known = max(each.seen_sd / abs(each.seen) for each in unseen)
        shown = f"show it to {100.0 * known:.0f} % only" if known < 1.0 else "do not show it"
        problems.append(f"{name} at {where}: the {seen_in} {shown}")
    if len(checks) >= 3 and not (off or unseen):
        quotable += [] if math.isnan(result.value("frequency")) else ["Q"]
        if all(each.dominant for each in result.quality_factors):
            quotable += ["losses"] if result.refuted else ["losses", "a", "b", "c"]
    return tuple(quotable), tuple(problems)


def unsure(result: FitResult) -> tuple[list[Check], list[Check]]:
    """Return where the turning points show another loss, and where nothing shows it well enough.

    Where the one test of fit finds nothing but noise, a difference is its chance, and the loss is
    known as well as the law knows it.
    """
    checks, refuted = result.decrement_check, result.refuted
    off = [each for each in checks if refuted and each.misses(_OFF)]
    return off, [
        each
        for each in checks
        if each not in off
        and not each.confirms
        and (refuted or relative_loss_sd(result, each.amplitude_rad) > TOLERANCE)
    ]


def _light(result: FitResult, problems: Sequence[str]) -> tuple[Light, str]:
    """Return the light and its reason, a clause."""
    wrong = [check for check in result.decrement_check if check.contradicts]
    if wrong:
        worst = max(wrong, key=lambda check: abs(check.excess))
        said = worst.sentence(result.parameters["amplitude"].unit)
        if result.method == "amplitudes":
            said = said.replace("turning points", "amplitudes")
        return "red", f"the fitted law contradicts the decay: {said}"
    if problems:
        return "amber", f"don't quote {'; nor '.join(problems)}"
    if result.method == "amplitudes":
        return "green", "the amplitudes fall as the law says"
    if result.refuted:
        return "green", (
            f"period and Q are right to {100.0 * TOLERANCE:.0f} % and to their errors; the law is"
            " not the whole story: see pendpipe diagnose"
        )
    return "green", "period and Q are those of the turning points, and noise explains the rest"
