"""What the misfit of a law does to the numbers that are quoted: the light by consequence.

Period and decrement are known from the turning points without a law: the backbone. Where the law
is refuted they are what is quoted, and a, b, c and the frequency of the law get the spread that
they ask for. How loud a misfit is in the readings does not matter: a sensor's third harmonic may
stand out by a thousand standard deviations and move neither Q nor the period.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from pendpipe.analysis.fit.backbone import Backbone, backbone_of
from pendpipe.analysis.fit.decrement import (
    CLEAR,
    CONFIRMED,
    TOLERANCE,
    Check,
    Light,
    loss_of,
)
from pendpipe.analysis.fit.fitted import PARAMETERS, Fit, Fitted, Verdict
from pendpipe.analysis.fit.quality import pendulum_of, qualities, relative_loss_sd, small_period
from pendpipe.analysis.turning_points import TurningPoints
from pendpipe.arrays import FloatArray
from pendpipe.dynamics import Eq8
from pendpipe.estimate import Estimate
from pendpipe.facts import Fact
from pendpipe.levels import deviations
from pendpipe.physics.pendulum import STANDARD_GRAVITY_M_PER_S2
from pendpipe.quantities import compact

_FEWEST: Final = 6
"""Turning points of which a period is asked."""
_OFF: Final = deviations(3, 0.05)
"""Standard deviations of the turning points, 2.4, beyond which a loss is off, where the law is
known to miss something: one of three is by chance in one decay of twenty."""
_TOLD: Final = 4.0
"""Amplitudes at which a backbone tells its loss independently: three and a bit of curvature."""
_SAME: Final = 0.01
"""Part of the best known change of a, b, c below which the backbone does not tell one."""


def judged(result: Fit, points: TurningPoints, law: Eq8, *, misfit: float) -> Fit:
    """Light a fit; where its law is refuted, measure the backbone and let the errors cover it.

    Parameters
    ----------
    result
        A fit with its ``decrement_check``, and with the errors of its noise and misfit.
    points, law
        What was fitted.
    misfit
        Variance of what is left over that of the noise (`goodness.Goodness.misfit`).
    """
    shown = None
    if result.refuted and not any(check.contradicts for check in result.decrement_check):
        # Of a law that contradicts the decay nothing is quoted, and another may be tried.
        shown = backbone_of(points, law, result.agreement.bent)
    if shown is not None:
        result = replace(_off_by(result, shown), shown=shown)
    elif misfit > 1.0:
        result = _with_errors(result, result.covariance)
    clear = int(np.sum(points.amplitude_rad > CLEAR * points.angle_sd_rad))
    quotable, problems = _quotable(result, clear)
    light, reason = _light(result, problems)
    return replace(result, verdict=Verdict(light, reason, quotable=quotable))


def _off_by(result: Fit, shown: Backbone) -> Fit:
    """Add to the errors of a misfit what the backbone shows a law to be off by.

    Of a, b, c and the frequency: the least change of them that takes the law's loss to the
    backbone's.
    """
    order, covariance = PARAMETERS, result.covariance.copy()
    own = [order.index(name) for name in "abc"]
    by_loss = _asked(result, shown, covariance[np.ix_(own, own)])
    covariance[np.ix_(own, own)] += by_loss
    small, place = shown.small_period, order.index("frequency")
    if math.isfinite(small.value):
        frequency, off = result.value("frequency"), 1.0 / small.value
        covariance[place, place] += (off - frequency) ** 2 + (small.sd * off**2) ** 2
    return _with_errors(result, covariance)


def _with_errors(result: Fit, covariance: FloatArray) -> Fit:
    """Give the parameters the errors of a covariance.

    A law that is refuted knows no better on which side of a value the truth lies.
    """
    parameters = dict(result.parameters)
    for name, sd in zip(PARAMETERS, np.sqrt(np.diag(covariance).clip(0.0)).tolist(), strict=True):
        found = replace(parameters[name], sd=sd, interval95=None)
        low, high = found.bounds95
        least = min(0.0, found.value) if name in "abc" else -math.inf
        parameters[name] = replace(found, interval95=(max(low, least), high))
    return replace(result, parameters=parameters, covariance=covariance)


def _asked(result: Fitted, shown: Backbone, noise: FloatArray) -> FloatArray:
    """What the backbone adds to the covariance of a, b, c, shape (3, 3)."""
    seen = shown.amplitude_rad >= shown.seen_rad[1] * (1.0 - 1e-9)
    y, sd = shown.amplitude_rad[seen], shown.decrement_sd[seen]
    by_rate = np.stack([y, np.ones_like(y), 1.0 / y], axis=1)
    held = np.sqrt(np.maximum(np.diag(noise), 0.0))
    excess = shown.decrement[seen] - np.array([loss_of(result.law, each) for each in y.tolist()])
    # In units of what the fit knows: its own weak directions may move most.
    values, vectors = np.linalg.eigh(noise / np.outer(held, held).clip(1e-300))
    unit = held[:, None] * vectors * np.sqrt(np.maximum(values, 0.0))
    seen_by = by_rate @ unit / sd[:, None]
    left, size, right = np.linalg.svd(seen_by, full_matrices=False)
    # What moves the loss by next to nothing is left where it is.
    gain = size / np.maximum(size**2 + (_SAME * size[0]) ** 2, 1e-300)
    inverse = unit @ (right.T * gain) @ left.T / sd
    off, spread = inverse @ excess, inverse * sd
    return np.asarray(np.outer(off, off) + spread @ spread.T * (len(y) / _TOLD))


def scaled(estimate: Estimate, factor: float, name: str) -> Estimate:
    """A parameter with a larger error; the interval of a loss keeps to its bound at zero."""
    value, (low, high) = estimate.value, estimate.bounds95
    least = min(0.0, low) if name in "abc" else -math.inf
    ends = max(value - factor * (value - low), least), value + factor * (high - value)
    return replace(estimate, sd=factor * estimate.sd, interval95=ends)


def _quotable(result: Fitted, clear: int) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """What may be quoted, and why the rest may not."""
    checks, unit = result.decrement_check, result.parameters["amplitude"].unit
    period, timeless = small_period(result), math.isnan(result.value("frequency"))
    problems, quotable = [], []
    if result.method == "amplitudes":
        # Its period is given, or there is none.
        pass
    elif clear < _FEWEST:
        problems.append("the period: too few turning points confirm it")
    elif not period.sd <= TOLERANCE * period.value:
        known = 100.0 * period.sd / period.value
        problems.append(f"the period of small swings: the turning points show it to {known:.0f} %")
    else:
        quotable.append("period")
    off, unseen = unsure(result)
    name, seen_in = (
        "half-lives" if timeless else "Q",
        "amplitudes" if result.method == "amplitudes" else "turning points",
    )
    if not checks:
        problems.append(f"{name}: too few {seen_in} confirm it")
    problems += [
        f"a, b, c: at {compact(each.amplitude_rad, unit)} they give a loss that is"
        f" {abs(100.0 * each.excess):.0f} % {'higher' if each.excess > 0.0 else 'lower'} than the"
        f" {seen_in} show"
        for each in off
    ]
    if unseen:
        where = ", ".join(compact(each.amplitude_rad, unit) for each in unseen)
        known = max(each.seen_sd / abs(each.seen) for each in unseen)
        shown = f"show it to {100.0 * known:.0f} % only" if known < 1.0 else "do not show it"
        problems.append(f"{name} at {where}: the {seen_in} {shown}")
    if checks and not unseen:
        quotable += [] if timeless else ["Q"]
        if not off and all(each.dominant for each in qualities(result)):
            quotable += ["losses"] if result.refuted else ["losses", "a", "b", "c"]
    return tuple(quotable), tuple(problems)


def unsure(result: Fitted) -> tuple[list[Check], list[Check]]:
    """Return where the law has another loss than the turning points, and where none is known well.

    Where the one test of fit finds nothing but noise, a difference is its chance, and the loss is
    known as well as the law knows it; else as well as the backbone shows it.
    """
    checks, shown = result.decrement_check, result.lawless
    if not result.refuted:
        return [], [
            each
            for each in checks
            if not each.confirms and relative_loss_sd(result, each.amplitude_rad) > TOLERANCE
        ]
    off = [each for each in checks if each.misses(_OFF)]
    if shown is None:
        return off, [each for each in checks if each not in off and not each.confirms]
    seen = [(each, shown.loss(each.amplitude_rad)) for each in checks]
    return off, [each for each, loss in seen if not loss.sd <= CONFIRMED * loss.value]


def _light(result: Fitted, problems: Sequence[str]) -> tuple[Light, str]:
    """Return the light and its reason, a clause."""
    wrong = [check for check in result.decrement_check if check.contradicts]
    if wrong:
        worst = max(wrong, key=lambda check: abs(check.excess))
        of = "amplitudes" if result.method == "amplitudes" else "turning points"
        said = worst.sentence(result.parameters["amplitude"].unit, of)
        return "red", f"the law contradicts the decay; {said}"
    if problems:
        return "amber", f"don't quote {'; nor '.join(problems)}"
    if result.method == "amplitudes":
        return "green", "the amplitudes fall as the law says"
    if result.refuted:
        return "green", (
            "period and Q are those of the turning points, and the law has them right to"
            f" {100.0 * TOLERANCE:.0f} %; it is not the whole story: see pendpipe diagnose"
        )
    return "green", "period and Q are those of the turning points, and noise explains the rest"


_ABSURD: Final = 2.0
"""Ratio of g, or of its inverse, that no rod, no buoyancy and no stretched string makes of it."""
_TALLEST_M: Final = 70.0
"""The longest pendulum of Foucault (67 m); what is longer is given in cm."""


def doubted(result: Fit, facts: Sequence[Fact], time_s: FloatArray) -> Fit:
    """Take green from an answer that rests on a guess or is absurd, and say what settles it.

    Parameters
    ----------
    result
        A fit; amber and red keep their reasons. A period that rests on a guess is not quoted.
    facts
        Of the recording.
    time_s
        Of the readings that were fitted, shape (n,).
    """
    guessed = [fact for fact in facts if fact.changes]
    why = [
        *_absurd(result, time_s),
        *(f"it rests on a guess: {fact.words}" for fact in guessed),
    ]
    if any("period" in fact.changes for fact in guessed):
        kept = tuple(name for name in result.quotable if name != "period")
        result = replace(result, verdict=replace(result.verdict, quotable=kept))
    if not why or result.light != "green":
        return result
    return replace(result, verdict=replace(result.verdict, light="amber", light_reason=why[0]))


def _absurd(result: Fitted, time_s: FloatArray) -> Iterator[str]:
    """Say what no pendulum gives, with the option that settles it."""
    span, clock = float(np.ptp(time_s)), "check the unit of time (--unit s:)"
    if span < small_period(result).value:
        yield f"the readings span {span:.3g} s, less than a period: {clock}"
    for name, found in pendulum_of(result).items():
        usual = found.value / STANDARD_GRAVITY_M_PER_S2
        if name == "g" and not 1.0 / _ABSURD < usual < _ABSURD:
            yield f"g comes out as {found.value:.3g} m/s²: give the length in m (--length)"
        if name == "length" and found.value > _TALLEST_M:
            yield f"the pendulum would be {found.value:.3g} m long: {clock}"
