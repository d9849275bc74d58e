"""What a diagnosis quotes: averages over the descriptions that share the probability.

A description is a set of effects: of each that was found its name, a mate of its class, or "none
of these", with the product of their probabilities. Each is fitted as it is named; with none at all
it is the fit, with its widened errors. Where those that leave only noise have half of the
probability, the others do not describe the recording. The frequency, a, b, c and Q are averaged
(`pendpipe.estimate.averaged`). What leaves more than noise is neither surer nor less sure than the
fit; a curve without a name is no surer.
"""

import itertools
import math
import operator
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final, NamedTuple

import numpy as np

from pendpipe.analysis.fit.quality import small_frequency
from pendpipe.analysis.fit.result import FitResult
from pendpipe.arrays import FloatArray
from pendpipe.diagnosis.hypothesis import Hypothesis, Step
from pendpipe.diagnosis.refine import Fit, best_fit, with_errors
from pendpipe.diagnosis.released_parameters import ReleasedParameter
from pendpipe.diagnosis.rivals import Rival
from pendpipe.diagnosis.values import constants_of, quality_factors_of, small_periods
from pendpipe.estimate import LISTED, NAMED, Estimate, averaged

_STARTS: Final = 2
"""Fits of other descriptions from which one begins: those that have most in common with it."""
Numbers = Mapping[Any, Estimate]
"""Quantities by name, and Q by amplitude."""


class Description(NamedTuple):
    """One set of effects.

    Parameters
    ----------
    probability
        That it is the right one.
    fit
        Of the model with these effects, with errors for what it leaves.
    """

    probability: float
    fit: Fit


class _Choice(NamedTuple):
    """What one step may be."""

    probability: float
    rival: Rival | None


_Chosen = tuple[_Choice, ...]


def descriptions_of(found: Hypothesis) -> list[Description]:
    """Fit each description of a probability of 5 % and more, the most probable first.

    Where some leave only noise, these alone, if they have half of the probability: a few unlikely
    names together may imitate what has none. Of a recording that lacks nothing it is the fit, and
    where none of them has a motion it is the search's own.
    """
    choices = [_choices(step) for step in found.steps]
    sets = [
        (math.prod(choice.probability for choice in chosen), chosen)
        for chosen in itertools.product(*choices)
        if not _twice(chosen)
    ]
    sets.sort(key=lambda each: -each[0])
    known = _known(found)
    described = []
    for number, (probability, chosen) in enumerate(sets):
        if number and probability < LISTED:
            break
        key = _key(chosen)
        near = sorted(known, key=lambda other: sum(map(operator.ne, key, other)))[:_STARTS]
        fit = known.get(key) or _fitted(found, chosen, [known[other] for other in near])
        if fit is not None:
            described.append(Description(probability, with_errors(fit, found.data, found.noise)))
    if not described:
        return [Description(1.0, with_errors(found.fit, found.data, found.noise))]
    clean = [each for each in described if each.fit.scatter is None]
    share = sum(each.probability for each in clean) / sum(each.probability for each in described)
    return clean if share >= NAMED else described


def _choices(step: Step) -> list[_Choice]:
    """Return the effect that was added, the mates of its class, and none of these."""
    rivals = (step.winner, *step.mates)
    named = list(map(_Choice, step.weights[:-1], rivals))
    return [*named, _Choice(max(1.0 - sum(each.probability for each in named), 0.0), None)]


def _twice(chosen: _Chosen) -> bool:
    """Whether a curve is drawn twice: the mate of one step is what another has added."""
    drawn = [each.rival.effect.key for each in chosen if each.rival and each.rival.drawn]
    return len(set(drawn)) < len(drawn)


def _key(chosen: _Chosen) -> tuple[str, ...]:
    """Which effects, by step; what happens twice is told apart by its step."""
    return tuple(each.rival.effect.key if each.rival else "" for each in chosen)


def _known(found: Hypothesis) -> dict[tuple[str, ...], Fit]:
    """Return what was fitted already: each step's mates, and the model without it.

    Names were weighed without the curve at the end.
    """
    own = tuple(step.winner.effect.key for step in found.steps)
    known = {("",) * len(own): found.baseline, own: found.fit}
    names = own
    if found.without_curve:
        names = (*own[:-1], "")
        known[names] = found.without_curve
    for number, step in enumerate(found.steps):
        beside = own if step.winner.drawn else names
        for key, fit in [("", step.before), *((m.effect.key, m.fit) for m in step.mates)]:
            known.setdefault((*beside[:number], key, *beside[number + 1 :]), fit)
    return known


def _fitted(found: Hypothesis, chosen: _Chosen, fits: Sequence[Fit]) -> Fit | None:
    """Fit a set of effects, each from its last values, beside the baseline of other fits.

    None of a fit that is stuck where it is worse than without them.
    """
    model, held = found.fit.model.bare(), found.beginning.held
    here = {id(effect): found.fit.value[place] for effect, place in found.fit.model.places()}
    values = list[FloatArray]()
    for rival in (each.rival for each in chosen if each.rival):
        effect = rival.effect
        model = model.adding(effect)
        if isinstance(effect, ReleasedParameter):
            held = effect.without(held)
        last = rival.fit.value[len(rival.fit.value) - effect.count :]
        values.append(here.get(id(effect), last))
    starts = [np.concatenate([fit.value[: model.first], *values]) for fit in fits]
    fit = best_fit(model, found.data, found.noise, starts, held=held)
    return fit if fit and fit.chi2 <= found.baseline.chi2 else None


@dataclass(frozen=True)
class Quoted:
    """What is quoted of a recording.

    Parameters
    ----------
    numbers
        a, b, c, the offset, the frequency of small swings in Hz, and Q by amplitude.
    leading
        The fit of the most probable description.
    """

    numbers: Numbers
    leading: Fit

    @property
    def period_span_s(self) -> tuple[float, float] | None:
        """The least and the largest period of small swings, where it drifts beyond its error."""
        periods = small_periods(self.leading, self.leading.value)
        frequency = self.numbers["frequency"]
        error = frequency.sd / frequency.value**2
        return (periods.min(), periods.max()) if np.ptp(periods) > 2.0 * error else None

    @property
    def constants(self) -> dict[str, Estimate]:
        """The numbers that have a name."""
        return {name: each for name, each in self.numbers.items() if isinstance(name, str)}

    @property
    def quality_factors(self) -> dict[float, Estimate]:
        """Q by amplitude."""
        return {y: each for y, each in self.numbers.items() if not isinstance(y, str)}


def quoted(found: Hypothesis, fit: FitResult | None, level: float) -> Quoted:
    """Average the numbers of one recording.

    Parameters
    ----------
    found
        The end of a search.
    fit
        What ``pendpipe fit`` prints: it stands for "none of these", and its errors are the least
        of what leaves more than noise. None where it is not that of the baseline.
    level
        The p-value from which chance explains what is left.
    """
    unit = found.data.unit
    amplitudes = [each.amplitude_rad for each in fit.quality_factors] if fit else []

    def of(fit: Fit) -> Numbers:
        return {**constants_of(fit, unit), **quality_factors_of(fit, amplitudes)}

    bare = constants_of(with_errors(found.baseline, found.data, found.noise), unit)
    return averages(found, descriptions_of(found), of, {**bare, **printed_by(fit)}, level)


def averages(
    found: Hypothesis,
    described: Sequence[Description],
    of: Callable[[Fit], Numbers],
    none: Numbers,
    level: float,
) -> Quoted:
    """Average numbers over descriptions; those of the baseline are `none`."""
    numbers = []
    for each in described:
        own = none if each.fit.value is found.baseline.value else of(each.fit)
        kinds = {effect.kind for effect in each.fit.model.effects if not effect.form}
        more = each.fit.scatter is not None or found.unexplained < level
        if more or "unnamed" in kinds:
            own = {name: _beside(value, none.get(name), more=more) for name, value in own.items()}
        numbers.append(own)
    return Quoted(
        {
            name: averaged(
                [own[name] for own in numbers if name in own],
                [
                    each.probability
                    for own, each in zip(numbers, described, strict=True)
                    if name in own
                ],
            )
            for name in dict.fromkeys(name for own in numbers for name in own)
        },
        described[0].fit,
    )


def printed_by(fit: FitResult | None) -> Numbers:
    """Return the numbers of a fit; a, b, c of one to all readings, which the decay allows."""
    if fit is None:
        return {}
    numbers: dict[Any, Estimate] = {
        each.amplitude_rad: each.quality_factor for each in fit.quality_factors
    }
    if fit.method == "waveform" and fit.light != "red":
        numbers |= {name: fit.parameters[name] for name in "abc"}
    return {**numbers, "frequency": small_frequency(fit)}


def _beside(value: Estimate, fitted: Estimate | None, *, more: bool) -> Estimate:
    """Return a number of what explains nothing, no surer than the fit's.

    Of what leaves `more` than noise and is less sure, it is the fit's, which has period and Q from
    the turning points where its law misses; a curve, which follows whatever there is, is as right
    as the fit.
    """
    if fitted is None or not math.isfinite(fitted.sd):
        return value
    if more and not value.sd < fitted.sd:
        return fitted
    found = value if more else averaged([value, fitted], [1.0, 1.0])
    if not found.sd < fitted.sd:
        return found
    own, others = found.bounds95, fitted.bounds95
    low = min(own[0], found.value - (fitted.value - others[0]))
    if value.interval95 is not None:
        # That of a, b, c ends where they are zero.
        low = max(low, min(own[0], 0.0))
    high = max(own[1], found.value + (others[1] - fitted.value))
    return replace(found, sd=fitted.sd, interval95=(low, high))
