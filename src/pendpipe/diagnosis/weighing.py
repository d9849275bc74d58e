"""Final probabilities of each effect and its rivals; the most probable leads."""

import math
from collections.abc import Collection, Sequence
from contextlib import suppress
from dataclasses import replace
from typing import Final

import numpy as np

from pendpipe.diagnosis.found import Finding, FoundEffect, Mate
from pendpipe.diagnosis.hypothesis import RANDOM, Hypothesis, Step, is_further
from pendpipe.diagnosis.instants import with_instants
from pendpipe.diagnosis.location import locate
from pendpipe.diagnosis.missing_force import force_of
from pendpipe.diagnosis.refine import SETTLED, Fit, best_fit, is_gross, refine
from pendpipe.diagnosis.released_parameters import ReleasedParameter
from pendpipe.diagnosis.rivals import (
    Rival,
    Scale,
    class_width,
    near_harmonic_by_chance,
    of_one_class,
    off_harmonics,
    probabilities,
    useful_chi2,
)
from pendpipe.diagnosis.values import effect_parameters
from pendpipe.dynamics.any_law import NoMotionError
from pendpipe.effects import Effect
from pendpipe.estimate import LISTED
from pendpipe.levels import FALSE_ALARM
from pendpipe.score import NEAR

_CLEAN_CHARGE: Final = 5.0
"""Charge (in chi^2) against "none of these" if the model leaves only noise: then one effect
without rivals in thirteen is wrong, as on opened challenges."""
_OF_A_FURTHER_NAME: Final = 2.2
"""Charge for "none of these" for each further name: on an opened set of apparatus 93 % of single
names were right, 76 % of those beside another, 45 % of those beside two."""
_SEEN_IN_RESIDUAL: Final = (*RANDOM, "coloured-noise")
"""Faults detected in a residual: the misfit of a curve can look like any of them."""
_SAME_GAIN: Final = 0.02
"""Relative change of a gain below which the rivals are not refitted."""


def weigh(found: Hypothesis, step: Step) -> Step:
    """Compare one effect with its rivals, beside all other effects."""
    effect = step.winner.effect
    found = beside(found, effect)
    step = _refitted_beside(found, step)
    own = step.winner
    others = [rival for rival in step.rivals if rival.identifier != effect.identifier]
    mates = _best_of_each([mate for mate in others if of_one_class(own, mate)])
    # An effect that every pendulum has gets its prior against rivals and against "none of these".
    none = own.evidence - max(own.prior, 0.0)
    gain = step.before.chi2 - found.fit.chi2
    # A curve that leaves only noise says little: it can follow a law of another kind.
    if effect.kind != "unnamed":
        none += (
            _charge_for_several(found) - _little_left(found, effect, gain) - _clean_charge(found)
        )
    # Any law of the motion that nobody knows makes lines at its harmonics.
    none -= 2.0 * math.log(near_harmonic_by_chance(found.fit, effect))
    weights = probabilities([own, *mates], none)
    # What every pendulum has, and a line off the harmonics, no misfit can be mistaken for.
    if not (effect.expected or off_harmonics(found.fit, effect)):
        weights = weights * _explained(found, effect, gain)
    return replace(step, mates=tuple(mates), weights=tuple(weights.tolist()))


def beside(found: Hypothesis, effect: Effect) -> Hypothesis:
    """Return the search in which an effect is assessed: without a curve, unless it is one."""
    if effect.kind == "unnamed":
        return found
    # A curve added to the named effects could imitate any of them.
    return replace(found, fit=found.without_curve or found.fit)


def effect_named(found: Hypothesis, step: Step) -> FoundEffect:
    """Return one effect with its final values, probability and location."""
    effect = step.winner.effect
    found = beside(found, effect)
    mates = list(zip(step.mates, step.weights[1:-1], strict=True))
    return FoundEffect(
        effect.identifier,
        effect.name,
        effect.kind,
        effect.equation,
        with_instants(
            effect_parameters(found.fit, effect, found.data.unit),
            effect,
            _others_in_place(found, effect) or step.before,
            found.noise,
            found.fit.error_scale,
        ),
        step.before.chi2 - found.fit.chi2,
        step.p_value,
        step.weights[0],
        tuple(
            Mate(mate.identifier, weight)
            for mate, weight in mates
            if weight > LISTED or not mate.drawn
        ),
        effect.discriminating_test,
        locate(step.before, found.fit, found.data, effect),
        force_of(found, step),
    )


def _others_in_place(found: Hypothesis, effect: Effect) -> Fit | None:
    """Return the fit without a sudden effect where others stay at their instants.

    None where there are none: refitted, one of several jumps would take the place of another.
    """
    model, value = found.fit.model.dropping(effect, found.fit.value)
    places = [place for other, place in model.places() if other.local]
    if not (effect.local and places):
        return None
    held = [*found.held, *(k for place in places for k in range(place.start, place.stop))]
    fit = best_fit(model, found.data, found.noise, [value], held=held)
    return fit and refine(model, found.data, found.noise, fit.value, held=found.held, rounds=0)


def _best_of_each(rivals: Sequence[Rival]) -> list[Rival]:
    """Return the best of each identifier, the best first (several curves share one)."""
    best: dict[str, Rival] = {}
    for rival in sorted(rivals, key=lambda rival: -rival.evidence):
        best.setdefault(rival.identifier, rival)
    return list(best.values())


def _explained(found: Hypothesis, effect: Effect, gain: float) -> float:
    """Return the part of the misfit that an effect explains, an upper limit of its probability.

    What an unnamed curve describes beside it is not explained.
    """
    open_still = _described(found, effect)
    if found.remainder.systematic:
        open_still += found.remainder.excess
    return max(gain, 0.0) / max(max(gain, 0.0) + open_still, 1.0)


def _described(found: Hypothesis, effect: Effect) -> float:
    """Return the chi^2 that unnamed curves take beside an effect."""
    curves = [step.winner for step in found.steps if step.winner.drawn]
    return sum(each.gain for each in curves if each.effect is not effect)


def _little_left(found: Hypothesis, effect: Effect, gain: float) -> float:
    """Return the charge (in chi^2) against "none of these" where a misfit is left beside a name.

    A law that is wrong may leave any part of an amplitude; the best of all that were tried leaves
    less than a part x of it with the probability x times their number.
    """
    if found.unexplained > FALSE_ALARM or found.first is None:
        return 0.0  # what is left is noise: `_CLEAN_CHARGE`
    left = max(_described(found, effect) + found.remainder.excess, 1.0)
    by_chance = len(found.first.leads) ** 2 * left / (max(gain, 0.0) + left)
    return min(max(-math.log(by_chance), 0.0), _CLEAN_CHARGE)


def fault_named(found: Hypothesis, finding: Finding) -> FoundEffect:
    """Return a fault of the measurement found by its own test.

    A random cause takes what a wrong name leaves: it is no more probable than each name beside it,
    with its rivals.
    """
    from pendpipe.effects.catalogue import by_identifier

    effect = by_identifier(finding.identifier)
    doubt = math.exp(-0.5 * _clean_charge(found))
    if finding.identifier in _SEEN_IN_RESIDUAL and found.unexplained <= FALSE_ALARM:
        # What is left besides may be what each of these tests answers to.
        doubt = float(len(_SEEN_IN_RESIDUAL))
    if finding.confirmed is not None:
        doubt *= finding.confirmed.p_value
    doubt += math.exp(-0.5 * finding.margin)
    # Effects that give exactly the same codes are equally probable.
    each = 1.0 / (1.0 + len(finding.also) + doubt)
    if finding.identifier in _SEEN_IN_RESIDUAL:
        each *= _explained(found, effect, finding.delta_chi2)
    if finding.identifier in RANDOM:
        none = [step.weights[-1] for step in found.steps if not step.winner.drawn]
        each *= 1.0 - max(none, default=0.0)
    return FoundEffect(
        effect.identifier,
        effect.name,
        effect.kind,
        effect.equation,
        finding.parameters,
        finding.delta_chi2,
        finding.p_value,
        each,
        tuple(Mate(name, each) for name in finding.also),
        effect.discriminating_test,
        replace(finding.location, summary=finding.summary),
        confirmed=finding.confirmed,
    )


def _clean_charge(found: Hypothesis) -> float:
    """Return the charge against "none of these" if the model leaves only noise."""
    return _CLEAN_CHARGE if found.unexplained > FALSE_ALARM else 0.0


def _charge_for_several(found: Hypothesis) -> float:
    """Return the charge for "none of these" of several names.

    Together they leave only noise more easily than one does by itself.
    """
    names = sum(map(is_further, found.steps))
    names += sum(fault.identifier in RANDOM for fault in found.faults)
    alone = 1 if found.unexplained > FALSE_ALARM else 2
    return _OF_A_FURTHER_NAME * max(names - alone, 0)


def _refitted_beside(found: Hypothesis, step: Step) -> Step:
    """Return a step with the fit without its effect, and the rivals that could replace it."""
    effect = step.winner.effect
    without = found.without(step) or step.before
    gain = without.chi2 - found.fit.chi2
    same = abs(gain - step.winner.gain) < _SAME_GAIN * gain
    if len(found.steps) == 1 and same and not is_gross(without, found.data):
        return replace(step, before=without)
    # Refit what was behind in the search, but not far: noise and other effects have changed.
    hopeless = step.winner.evidence - 2.0 * (class_width(step.winner) + NEAR)
    scale = Scale.of(found.fit, found.data, found.noise)
    useful = useful_chi2(found.fit.chi2, gain, drawn=step.winner.drawn)
    if found.remainder.systematic:
        useful = scale.within(NEAR)
    fits = []
    others = {other.key for other in without.model.effects if not other.local}
    for rival in step.rivals:
        if rival.effect.key in others:
            continue  # one that was added later
        own = rival.effect.key == effect.key
        if not (own or rival.effect.expected) and rival.evidence < hopeless:
            continue
        fit = found.fit if own else refitted(without, found, rival, useful)
        if fit is not None:
            fits.append((rival, fit))
    rivals = tuple(rival.again(fit, without.chi2, scale) for rival, fit in fits)
    return replace(step, rivals=rivals, before=without)


def refitted(without: Fit, found: Hypothesis, rival: Rival, useful: float) -> Fit | None:
    """Refit a rival in the final model, from its earlier result, as far as it is useful."""
    effect = rival.effect
    held: Collection[int] = set(range(without.model.size)).difference(without.free)
    if isinstance(effect, ReleasedParameter):
        held = effect.without(held)
    if _is_of(rival.fit, without, effect, found):
        return rival.fit
    places = [place for each, place in rival.fit.model.places() if each is effect]
    # One that was the winner may stand before effects that came later.
    own = rival.fit.value[places[0]] if places else rival.fit.value[:0]
    start = np.concatenate([without.value, own])
    # With its shape but no size yet it begins where the fit without it ended.
    absent = start.copy()
    absent[len(without.value) :][: 0 if effect.parameter_free else effect.sizes] = 0.0
    model, starts = without.model.adding(effect), [start, absent, rival.fit.value]
    return best_fit(model, found.data, found.noise, starts, held=held, useful=useful)


def _is_of(fit: Fit, without: Fit, effect: Effect, found: Hypothesis) -> bool:
    """Whether a fit is that of an effect beside those of another, on the same readings."""
    keys = [each.key for each in (*without.model.effects, effect)]
    if [each.key for each in fit.model.effects] != keys:
        return False
    if fit.model.drag != without.model.drag:
        return False  # the other form of the drag was taken after it
    if not np.array_equal(fit.model.time_s, without.model.time_s):
        return False  # the time stamps were corrected after it
    with suppress(NoMotionError):
        now = refine(fit.model, found.data, found.noise, fit.value, rounds=0)
        return abs(now.chi2 - fit.chi2) < SETTLED
    return False
