"""The answer of a fit in words: a dozen lines to read, one to copy, one that says what next."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Final

import numpy as np

from pendpipe.analysis.angles import READ_AS
from pendpipe.analysis.fit.consequence import unsure
from pendpipe.analysis.fit.damping import FALLS, damping_of, is_extrapolated
from pendpipe.analysis.fit.fitted import Fitted
from pendpipe.analysis.fit.quality import (
    LEAST_QUALITY,
    LOSSES,
    Quality,
    pendulum_of,
    period_of_frequency,
    qualities,
    small_period,
    swings_longer,
)
from pendpipe.answer import SMALLEST, Answer
from pendpipe.estimate import Z95, Estimate
from pendpipe.quantities import compact, pretty_unit, stretch, with_error

WITHOUT_LAW: Final = "from the turning points alone"
_KINDS: Final = {
    "rad": "angle",
    "m": "displacement",
    "rad/s": "rate of the angle",
    "V": "voltage",
    "1": "readings of unknown unit",
}
SHORT: Final = {"a": "drag ~ speed²", "b": "viscous or internal", "c": "dry friction"}
_CLOCK: Final = 50e-6
"""By what part a laboratory's clock may well be off."""
_TIMELESS: Final = "not shown by amplitudes: give --period or --frequency, which also gives Q"
_OF_AN_ANGLE: Final = "of these swings, small ones are 0.2 % faster at 10°, 0.8 % at 20°"
_DIAGNOSE: Final = "pendpipe diagnose FILE says what the law lacks"


def size(amplitude: float, unit: str) -> str:
    """Print an amplitude; an angle in degrees and radians.

    >>> size(0.5135, "rad")
    '29.4° (514 mrad)'
    """
    if unit != "rad":
        return compact(amplitude, unit)
    return f"{degrees(amplitude)} ({compact(amplitude, unit)})"


def degrees(angle_rad: float) -> str:
    """Print an angle in degrees, to three digits.

    >>> degrees(0.5135)
    '29.4°'
    """
    return f"{math.degrees(angle_rad):.3g}°"


def short_size(amplitude: float, unit: str) -> str:
    """Print an amplitude in degrees, or in its own unit."""
    return degrees(amplitude) if unit == "rad" else compact(amplitude, unit)


def answer_of(result: Fitted, *, law: bool = False) -> Answer:
    """Make the answer of a fit: what is known first, what to do next last.

    Parameters
    ----------
    result
        The fit.
    law
        Whether to print a law that contradicts the decay.
    """
    return Answer(
        (heading(result),),
        tuple(facts(result, law=law)),
        result.light,
        tuple(_remarks(result)),
        sentence=sentence(result),
        following=following(result),
    )


def called(result: Fitted) -> str:
    """Return what to call a recording: the name of its file."""
    return result.name or ("a fit" if result.points is None else "recording")


def heading(result: Fitted) -> str:
    """Say what was fitted of a recording, in one line."""
    points, decay = result.points, result.decay
    unit = result.parameters["amplitude"].unit if decay is None else decay.unit
    kind = _KINDS.get(unit, f"readings in {pretty_unit(unit)}")
    what = "amplitudes" if result.method == "amplitudes" else "turning points"
    if points is None:
        return f"{kind}, {result.turning_points} {what}"
    amplitude, swings = points.amplitude_rad, f"{len(points)} {what}"
    ends = (short_size(abs(float(y)), points.unit) for y in (amplitude[0], amplitude[-1]))
    span = f"{float(f'{float(np.ptp(points.time_s)):.3g}'):g} s"
    if result.method != "amplitudes" and decay is not None:
        rate = 1.0 / decay.interval_s if decay.interval_s > 0.0 else math.nan
        span = f"{float(f'{rate:.4g}'):g} Hz, {span}"
        swings = f"{0.5 * float(points.half_cycle[-1] - points.half_cycle[0]):.0f} swings"
    return f"{kind}, {span}, {swings} from {' to '.join(ends)}"


def _remarks(result: Fitted) -> Iterator[str]:
    """What must be known before any number is read."""
    if result.light != "green":
        yield result.light_reason
    if result.restoring == "linear" and result.form.torque_odds is not None:
        digits = result.form.torque_odds / math.log(10.0)
        # How far out the noise goes nobody has tested.
        ratio = f"10^{digits:.0f}" if digits < -math.log10(SMALLEST) else "10^12 or more"
        yield f"x fits better than sin x, {ratio} to 1: a spring or torsion wheel, no pendulum"
    if result.decay is not None and READ_AS in result.decay.metadata:
        yield f"a guess: {result.decay.metadata[READ_AS]} (--unit)"
    if (other := result.form.other_frequency) is not None:
        text = period_text(other)
        yield f"as a spring or torsion wheel (--restoring linear) its period would be {text}"
    if result.cuts:
        cuts = (f"{stretch(cut['start_s'], cut['stop_s'])}, {cut['reason']}" for cut in result.cuts)
        yield f"left out: {'; '.join(cuts)}"


def period_text(frequency: Estimate) -> str:
    """Print the period of a frequency."""
    return f"{_number(period_of_frequency(frequency))} s"


def period_name(result: Fitted) -> str:
    """Return T0, the period of small swings of a pendulum, or T of what swings by x."""
    return "T0" if result.restoring == "sine" else "T"


def facts(result: Fitted, *, law: bool = False) -> Iterator[tuple[str, str]]:
    """Yield what is known, a title and a value each; nothing of two modes beside their own."""
    if result.hindered == "beat":
        return
    unit, has_law = result.parameters["amplitude"].unit, result.light != "red" or law
    known = qualities(result)
    period = small_period(result)
    small = "period, small swings" if result.restoring == "sine" else "period"
    text = with_error(period.value, period.sd, "s", short=True)
    if result.method == "amplitudes":
        text = f"{text}, as given" if math.isfinite(period.value) else _TIMELESS
    elif result.lawless is not None:
        text += f", {WITHOUT_LAW}"
    elif result.restoring == "sine" and known:
        large = known[0]
        text += f"  ({large.period_s:.5g} s at {short_size(large.amplitude_rad, unit)})"
    if unit == "m/s^2":
        if result.restoring == "linear":
            text += f"; {_OF_AN_ANGLE}"
        text += "; twice that, if the axis lies along the string (--column)"
    yield small, text
    by_clock = period.sd < _CLOCK * period.value and result.method != "amplitudes"
    if by_clock and result.told.clock_ppm is None:
        moved = with_error(float(f"{_CLOCK * period.value:.1g}"), None, "s")
        yield "clock", f"an error of 50 ppm adds {moved}, not included here (--clock-ppm)"
    if known:
        # The largest in radians as well.
        sizes = [size, *[short_size] * (len(known) - 1)]
        found = ", ".join(
            f"{_number(each.quality_factor)} at {where(each.amplitude_rad, unit)}"
            for each, where in zip(known, sizes, strict=True)
        )
        lawless = result.light == "red" or result.lawless is not None
        without = f"; {WITHOUT_LAW}" if lawless else ""
        if math.isfinite(period.value):
            yield "Q", found + without
        yield "damping", damping(result)
    if not has_law:
        return
    if result.light != "red":
        yield "energy goes to", energy(result)
    yield "law", f"−dy/dt = a y² + b y + c: {_law(result)}"
    yield "misfit", misfit(result)
    yield from _pendulum_line(result)


def damping(result: Fitted) -> str:
    """Print the times in which the largest amplitude shown falls, and the decrement there."""
    numbers, unit = damping_of(result), result.parameters["amplitude"].unit
    first = numbers["amplitude_rad"].value
    falls, beyond = [], [is_extrapolated(result, part * first) for part in FALLS.values()]
    for name, to in (("half_life_s", "1/2"), ("damping_time_s", "1/e")):
        time_s = numbers[name]
        falls.append(
            f"to {to} in {_number(time_s)} s" if math.isfinite(time_s.value) else f"never to {to}"
        )
    told = ", both extrapolated" if all(beyond) else " (extrapolated)" if any(beyond) else ""
    decrement = numbers["logarithmic_decrement"]
    swing = math.isfinite(decrement.value)
    per = f"; log. decrement {_number(decrement)} a period" if swing else ""
    return f"from {short_size(first, unit)} {', '.join(falls)}{told}{per}"


def energy(result: Fitted) -> str:
    """Say where the energy goes at the largest amplitude shown, as far as the fit tells.

    A loss whose share is not two standard deviations from nothing has its upper limit (95 %).
    """
    large = qualities(result)[0]
    where = short_size(large.amplitude_rad, result.parameters["amplitude"].unit)
    if large.dominant is None:
        return f"the decay does not separate drag, viscous loss and dry friction (at {where})"
    seen, limits = [], []
    for name, share in sorted(large.losses.items(), key=lambda pair: -pair[1].value):
        if share.value > Z95 * share.sd and not share.at_bound:
            seen.append(f"{percent(share)} {SHORT[name]} ({name})")
        else:
            limits.append(f"{SHORT[name]} ({name}) < {100.0 * share.bounds95[1]:.2g} %")
    return "; ".join([f"{', '.join(seen[:2])}, at {where}", *seen[2:], *limits])


def percent(share: Estimate) -> str:
    """Print a share with its error.

    >>> percent(Estimate(0.6217, 0.0334, ""))
    '62.2(3.3) %'
    """
    return f"{with_error(100.0 * share.value, 100.0 * share.sd, short=True)} %"


def _law(result: Fitted) -> str:
    if result.hindered == "overdamped" and result.method != "waveform":
        return "a, b, c need more than a cycle to lose it in"
    text = ", ".join(f"{name} {result.parameters[name].or_limit()}" for name in "abc")
    limit = result.quality_factor_limit
    if limit is not None and limit.value > 3.0 * limit.sd:
        text += f"; πf/b {_number(limit)}"
    return text


def misfit(result: Fitted) -> str:
    """Say how well the fit follows the swings, as a share of the swing."""
    swing = result.value("amplitude")
    if result.decay is not None and result.method == "waveform":
        # In the unit of the readings.
        swing = 0.5 * float(np.nanmax(result.decay.values) - np.nanmin(result.decay.values))
    share = 100.0 * result.residual_rms_rad / swing if swing > 0.0 else math.nan
    noise = 100.0 * result.noise_rms_rad / swing if swing > 0.0 else math.nan
    what = {"waveform": "swings"}.get(result.method, result.method.replace("-", " "))
    if result.method == "amplitudes":
        return f"the fit follows the {what} to {share:.2g} %"
    if not result.refuted:
        return f"the fit follows the {what} to {share:.2g} %; nothing but noise is left"
    story = "right to 5 %, but the law is" if result.light == "green" else "the law is"
    missed = f"it misses the {what} by {share:.2g} % (noise {noise:.1g} %)"
    return f"{missed}: {story} not the whole story"


def sentence(result: Fitted) -> str:
    """Return the sentence to copy."""
    if result.hindered == "beat":
        return f"{result.light_reason}."
    if result.hindered == "cut":
        return "nothing of this fit can be quoted."
    unit, said = result.parameters["amplitude"].unit, []
    if "period" in result.quotable:
        period = small_period(result)
        said.append(f"{period_name(result)} = {with_error(period.value, period.sd, 's')}")
    known = list(qualities(result))
    if result.light != "red":
        doubted = unsure(result)[1]
        checks = result.decrement_check or [None] * len(known)
        known = [each for each, seen in zip(known, checks, strict=False) if seen not in doubted]
    known = [each for each in known if not each.quality_factor.value < LEAST_QUALITY]
    if known:
        q = known[0]
        timeless = math.isnan(q.period_s)
        half = damping_of(result)["half_life_s"] if timeless else q.quality_factor
        number, name = (half, "half-life") if timeless else (half, "Q")
        said.append(f"{name} = {number} at {compact(q.amplitude_rad, unit)}")
        if "losses" in result.quotable and (loss := q.dominant):
            said.append(f"{percent(q.losses[loss])} of the loss there is {LOSSES[loss]}")
    if not said:
        return "nothing of this fit can be quoted."
    of = "amplitudes" if result.method == "amplitudes" else "turning points"
    lawless = result.light == "red" or result.lawless is not None
    without = f" (from the {of}, without a law)" if lawless else ""
    return f"{'; '.join(said)}{without}."


def following(result: Fitted) -> str:
    """Say what to do next."""
    if result.hindered == "beat":
        return "pendpipe diagnose FILE fits both modes"
    if result.light == "red":
        law = "--accept prints the law"
        # The diagnosis is one of all readings.
        return law if result.method == "amplitudes" else f"{_DIAGNOSE}; {law}"
    if result.refuted and result.method != "amplitudes":
        return f"{_DIAGNOSE}; pendpipe page FILE makes a sheet to hand out"
    if result.method == "amplitudes":
        lacks = math.isnan(small_period(result).value)
        return "--period T gives Q" if lacks else "record the swing itself to see its period"
    if "Q" not in result.quotable:
        return "record more swings: the turning points must show the decrement"
    if "losses" not in result.quotable:
        return "release from farther out and record longer, to separate a, b and c"
    return "pendpipe page FILE makes a sheet to hand out; --figure draws it, --json is for programs"


def _pendulum_line(result: Fitted) -> Iterator[tuple[str, str]]:
    """Print g, or the length, and what is not in it.

    A bob of radius r on a light string adds 2 r^2/(5 l^2) to g, air of density rho rho/rho_bob and
    more, a string of mass m less than m/(6 M): they are named and not made.
    """
    for name, found in pendulum_of(result).items():
        said = "; not in it: the finite bob, the string's mass, buoyancy and added mass"
        if result.length is not None and result.length.sd == 0.0:
            said += "; the length's error, which --length 0.600(1) would give"
        factor = swings_longer(result)
        if factor is None:
            said += f"; by T {_OF_AN_ANGLE}"
        elif factor > 1.0:
            change = 100.0 * (factor**2 - 1.0)
            said = f", finite-amplitude correction {change:+.2g} % included{said}"
        yield name, with_error(found.value, found.sd, found.unit, short=True) + said


def _number(estimate: Estimate) -> str:
    return with_error(estimate.value, estimate.sd, short=True)


def cause(quality: Quality) -> str:
    """Say which loss takes most at an amplitude, and how much, as far as it is told."""
    if not quality.losses:
        return WITHOUT_LAW
    if (name := quality.dominant) is None:
        return "by losses that this fit does not separate"
    return f"{percent(quality.losses[name])} {LOSSES[name]} ({name})"
