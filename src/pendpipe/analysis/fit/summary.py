"""What a fit answers: Q, the period and the dominant loss at the amplitudes of the decay."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from pendpipe.analysis.fit.by_points import swing_phase
from pendpipe.analysis.fit.decrement import loss_of
from pendpipe.analysis.two_modes import BEAT
from pendpipe.dynamics import Release, turning_points
from pendpipe.estimate import Estimate
from pendpipe.quantities import compact, with_error

if TYPE_CHECKING:
    from pendpipe.analysis.fit.result import FitResult

LOSSES: Final = {
    "quadratic": "drag that grows with the square of the speed (a)",
    "linear": "viscous and hysteretic loss (b)",
    "coulomb": "dry friction (c)",
}


WITHOUT_LAW: Final = "from the turning points alone"


class Quality(NamedTuple):
    """The quality factor at one amplitude, with what loses most there."""

    amplitude_rad: float
    quality_factor: Estimate
    """pi/(T loss): T the period and loss the relative loss of amplitude at this amplitude."""
    period_s: float
    dominant: str
    """A key of `LOSSES`."""
    share: float
    """The dominant loss over all losses."""


def qualities(result: FitResult) -> list[Quality]:
    """Evaluate the fitted law at a large, a middle and a small amplitude of the decay."""
    first = result.parameters["amplitude"].value
    seen = [check.amplitude_rad for check in result.decrement_check] or [first]
    return [_quality(result, amplitude) for amplitude in seen]


def seen_qualities(result: FitResult) -> list[tuple[float, Estimate]]:
    """Amplitudes and the quality factors there that the turning points show without a law."""
    found = []
    for check in result.decrement_check:
        if check.seen > 0.0:
            q = math.pi / (period_of(result, check.amplitude_rad) * check.seen)
            found.append((check.amplitude_rad, Estimate(q, q * check.seen_sd / check.seen, "")))
    return found


def _quality(result: FitResult, amplitude: float) -> Quality:
    law = result.law
    parts = {
        "quadratic": replace(law, hysteretic=0.0, viscous=0.0, coulomb=0.0),
        "linear": replace(law, quadratic=0.0, coulomb=0.0),
        "coulomb": replace(law, quadratic=0.0, hysteretic=0.0, viscous=0.0),
    }
    losses = {name: loss_of(part, amplitude) for name, part in parts.items()}
    loss = loss_of(law, amplitude)
    dominant = max(losses, key=lambda name: losses[name])
    period = period_of(result, amplitude)
    value = math.pi / (period * loss) if loss > 0.0 else math.inf
    error = Estimate(value, value * _relative_sd(result, amplitude), "")
    return Quality(amplitude, error, period, dominant, losses[dominant] / sum(losses.values()))


def _relative_sd(result: FitResult, amplitude: float) -> float:
    """Relative standard deviation of a y + b + c/y, from the covariance of the three."""
    place = [result.covariance_order.index(name) for name in "abc"]
    slope = np.array([amplitude, 1.0, 1.0 / amplitude])
    variance = float(slope @ result.covariance[np.ix_(place, place)] @ slope)
    loss = float(slope @ [result.value(name) for name in "abc"])
    return math.sqrt(max(variance, 0.0)) / loss if loss > 0.0 else math.inf


def period_of(result: FitResult, amplitude: float) -> float:
    """Period at one amplitude, s; that of small amplitudes where the law cannot swing there."""
    law = replace(result.law, quadratic=0.0, hysteretic=0.0, viscous=0.0, coulomb=0.0)
    try:
        cycle = turning_points(law, Release(0.0, amplitude), count=3)
    except ValueError:
        return 1.0 / result.value("frequency")
    return float(cycle.time_s[2])


def small_period(result: FitResult) -> Estimate:
    """Period 1/f of Eq. 8's frequency, s: with the torque of sin x that of small amplitudes."""
    frequency = result.parameters["frequency"]
    return Estimate(1.0 / frequency.value, frequency.sd / frequency.value**2, "s")


def gravity_line(
    result: FitResult, *, length_m: float | None = None, gravity: float | None = None
) -> str:
    """Print g from the length of a simple pendulum, or its length from g: omega_0^2 = g/l.

    Parameters
    ----------
    result
        A fit of angles.
    length_m, gravity
        The one that is known, m or m/s^2.

    Notes
    -----
    With the torque of sin x the fitted omega is omega_0, that of small amplitudes. Otherwise
    omega_0 = omega 2 K(sin(y/2))/pi at the root-mean-square amplitude y, and the line names this
    correction.
    """
    omega = 2.0 * math.pi * result.value("frequency")
    relative = 2.0 * result["frequency"].sd / result.value("frequency")
    corrected = ""
    if result.restoring == "linear":
        squares = [quality.amplitude_rad**2 for quality in qualities(result)]
        amplitude = math.sqrt(sum(squares) / len(squares))
        factor = float(swing_phase(np.full(2, amplitude), "sine")[0]) / math.pi
        omega *= factor
        corrected = f", finite-amplitude correction {100.0 * (factor**2 - 1.0):+.2g} % included"
    if length_m is not None:
        value, name, unit = omega**2 * length_m, "g", "m/s^2"
    else:
        assert gravity is not None
        value, name, unit = gravity / omega**2, "length", "m"
    return _line(name, with_error(value, relative * value, unit, short=True) + corrected)


def lines(result: FitResult, *, law: bool | None = None) -> list[str]:
    """Print a fit: the light first, then what can be quoted, each with its error.

    Parameters
    ----------
    result
        The fit.
    law
        Whether to print a, b, c; by default unless the light is red.
    """
    found = [f"{result.light}: {result.light_reason}"]
    unit = result.parameters["amplitude"].unit
    found.append(
        f"  {result.equation} fitted to {result.turning_points} turning points"
        if result.method == "turning-points"
        else f"  {result.equation} fitted to {result.samples} readings"
    )
    if not (result.light != "red" if law is None else law):
        found += [f"  {check.sentence(unit)}" for check in result.decrement_check]
        for amplitude, seen in seen_qualities(result):
            q = with_error(seen.value, seen.sd, short=True)
            found.append(_line(f"Q at {compact(amplitude, unit)}", f"{q}, {WITHOUT_LAW}"))
        return [*found, "  " + quotable(result)]
    period = small_period(result)
    name = "period, small amplitude" if result.restoring == "sine" else "period"
    found.append(_line(name, with_error(period.value, period.sd, "s", short=True)))
    for letter in "abc":
        found.append(_line(letter, rate_with_error(result[letter])))
    for each in qualities(result):
        q = with_error(each.quality_factor.value, each.quality_factor.sd, short=True)
        found.append(
            _line(
                f"Q at {compact(each.amplitude_rad, unit)}",
                f"{q}, {100.0 * each.share:.0f} % {LOSSES[each.dominant]}",
            )
        )
    limit = result.quality_factor_limit
    if limit is not None and limit.value > 3.0 * limit.sd:
        found.append(_line("Q limit πf/b", with_error(limit.value, limit.sd, short=True)))
    return [*found, "  " + quotable(result)]


def _line(name: str, value: str) -> str:
    return f"  {name:<26}{value}"


def rate_with_error(rate: Estimate, *, short: bool = True) -> str:
    """Print a rate with its error, or its upper limit where it lies at zero."""
    if rate.at_bound:
        limit = float(f"{rate.bounds95[1]:.2g}")
        return f"below {with_error(limit, None, rate.unit)} (95 %)"
    return with_error(rate.value, rate.sd, rate.unit, short=short)


def quotable(result: FitResult) -> str:
    """Advise which of the numbers to quote."""
    if result.light == "green":
        return "Quote these numbers with their errors."
    if result.light_reason.startswith(BEAT):
        return "Quote the frequency and the loss of each mode; pendpipe diagnose fits both."
    if result.light == "red":
        what = "Q alone" if seen_qualities(result) else "none of these numbers"
        return f"Quote {what}, not a, b or c: run pendpipe diagnose to learn what the law lacks."
    if result.chi2_per_dof > 2.0:
        return (
            "Quote Q at these amplitudes. Physics is missing from the law: run pendpipe diagnose"
            " before you quote a, b or c."
        )
    return "Quote Q at these amplitudes. a, b and c are correlated: quote all three."


HEAD: Final = ("file", "light", "period (s)", "a (1/rad s)", "b (1/s)", "c (rad/s)", "Q", "at")


def row(file: str, result: FitResult | None) -> tuple[str, ...]:
    """Make a line of `table`; a recording that was refused has its name only."""
    if result is None:
        return (file, "refused", *[""] * (len(HEAD) - 2))
    period, large = small_period(result), qualities(result)[0]
    rates = ["" if result.light == "red" else _bare(result[name]) for name in "abc"]
    return (
        file,
        result.light,
        with_error(period.value, period.sd, short=True),
        *rates,
        ""
        if result.light == "red"
        else with_error(large.quality_factor.value, large.quality_factor.sd, short=True),
        compact(large.amplitude_rad, result["amplitude"].unit),
    )


def _bare(rate: Estimate) -> str:
    """Print a rate without its unit, which is in the head of the table."""
    return rate_with_error(replace(rate, unit="")).removesuffix(" (95 %)").replace("below ", "< ")


def table(rows: list[tuple[str, ...]]) -> str:
    """Lay rows out below their head, in columns as wide as they need."""
    full = [HEAD, *rows]
    width = [max(map(len, column)) for column in zip(*full, strict=True)]
    return "\n".join(
        "  ".join(cell.ljust(size) for cell, size in zip(line, width, strict=True)).rstrip()
        for line in full
    )
