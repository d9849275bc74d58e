"""Sets of effects: their score, and the moves from one set to a better one.

The score of a set is

    S = lost(chi^2) + the charges of its effects + the price of each further name,

and the set with the smallest S is the answer. `lost` is the fall of the log-likelihood against
the best set (`evidence.Scale`): chi^2 itself where the best leaves noise alone. The charge of an
effect is that of its scan, shapes and sizes, less its prior (`evidence.Rival.charge`).
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np

from pendpipe.arrays import FloatArray
from pendpipe.diagnosis import Progress
from pendpipe.diagnosis.detect import Lead
from pendpipe.diagnosis.evidence import NO_SCAN, Rival, Scale, ranked
from pendpipe.diagnosis.hypothesis import (
    CHOICE,
    Hypothesis,
    Step,
    is_further,
    price,
    price_of_another,
)
from pendpipe.diagnosis.location import off_harmonics
from pendpipe.diagnosis.refine import Fit, best_fit
from pendpipe.diagnosis.released_parameters import ReleasedParameter
from pendpipe.diagnosis.scores import build_bank
from pendpipe.diagnosis.task import Task, undrawn
from pendpipe.effects import Effect
from pendpipe.effects.catalogue.in_time import PlaneCoupling
from pendpipe.effects.curves import CURVES, FOLLOW_UP_CURVES, Curve

_LOST_AT_KNOTS: Final = 0.012
"""Part of a curve's gain lost between its knots, where it is straight: h^2 F''/12 at the knots of
`effects.curves`; it is credited, as far as the names leave as much, where only noise is left."""
_MOST_MOVES: Final = 6
_MOST_RARE: Final = 2
"""Rare names that may take the place of one curve."""


class Proposed(NamedTuple):
    """A set of effects, as steps, with its fit."""

    fit: Fit
    steps: tuple[Step, ...]
    words: str = ""
    credit: float = 0.0


def improve(state: Hypothesis, progress: Progress, rare: Sequence[Effect] = ()) -> Hypothesis:
    """Make the best move, again and again, until none lowers the score.

    `rare` are the names that may take the place of a curve.
    """
    for _ in range(_MOST_MOVES):
        here = Proposed(state.fit, state.steps)
        there = [*_drops(state), *_curves_for_names(state), *_rare_for_a_curve(state, rare)]
        best = _best(here, there, state)
        if best is here:
            return state
        progress(best.words)
        state = replace(state, steps=best.steps).settle(best.fit)
    return state


def _best(here: Proposed, there: Sequence[Proposed], state: Hypothesis) -> Proposed:
    """Return the set of the smallest score; `here` if no other is smaller."""
    found = [here, *there]
    best = min(found, key=lambda each: each.fit.chi2)
    scale = Scale.of(best.fit, state.data, state.noise)
    return min(found, key=lambda each: scale.lost_by(each.fit, each.credit) + price(each.steps))


def _drops(state: Hypothesis) -> Iterator[Proposed]:
    """Drop one effect.

    The last one, which was significant, is not dropped where it leaves only noise, unless a fault
    of the measurement was found after it. A curve can follow sin x too, and does not replace it.
    """
    clean = Scale.of(state.fit, state.data, state.noise).clean
    joined = any(fault.after == len(state.steps) for fault in state.faults)
    if clean and len(state.steps) < 2 and not joined:
        return
    drawn = any(step.winner.drawn for step in state.steps)
    for step in state.steps:
        effect = step.winner.lead.effect
        if isinstance(effect, ReleasedParameter) or (effect.parameter_free and drawn):
            continue
        without = refit_without(state, [step])
        if without is not None:
            others = tuple(other for other in state.steps if other is not step)
            yield Proposed(without, others, f"{effect.name} is no longer needed")


def _curves_for_names(state: Hypothesis) -> Iterator[Proposed]:
    """Put one curve in the place of several names: all, or all but what is sudden or a line.

    Where more than noise is left, the name that gains most stays: a curve competes for the rest. A
    line off the harmonics, which no curve makes, stays too.
    """
    further = [step for step in state.steps if is_further(step)]
    own = [step for step in further if not off_harmonics(state.fit, step.winner.lead.effect)]
    if own and not Scale.of(state.fit, state.data, state.noise).clean:
        own.remove(max(own, key=lambda step: step.winner.gain))
    effects = [(step, step.winner.lead.effect) for step in own]
    steady = [step for step, effect in effects if not (effect.local or effect.spectral)]
    tried: list[list[Step]] = []
    for replaced in (own, steady):
        if len(replaced) < 2 or replaced in tried or any(s.winner.drawn for s in state.steps):
            continue
        tried.append(replaced)
        bare = refit_without(state, replaced)
        if bare is None:
            continue
        curves = [(curve, np.zeros(curve.count)) for curve in _curves(bare, state)]
        fits = [fit for pair in curves if (fit := _with(bare, *pair, state))]
        if not fits:
            continue
        scale = Scale.of(min((*fits, state.fit), key=lambda fit: fit.chi2), state.data, state.noise)
        rivals = ranked([_rival(bare, fit, scale) for fit in fits])
        step = Step(tuple(rivals), replaced[0].p_value, bare)
        kept = [other for other in state.steps if other not in replaced]
        left = max(state.fit.chi2 - state.data.used, 0.0) if scale.clean else 0.0
        best = rivals[0]
        yield Proposed(
            best.fit,
            (*kept, step),
            f"{best.name} alone does as well as {len(replaced)} effects",
            min(_LOST_AT_KNOTS * best.gain, left),
        )


def _rare_for_a_curve(state: Hypothesis, rare: Sequence[Effect]) -> Iterator[Proposed]:
    """Put a rare name, or two, in the place of a curve: a camera is oblique, and has a shutter."""
    for step in [step for step in state.steps if step.winner.drawn]:
        fit = refit_without(state, [step])
        steps = [other for other in state.steps if other is not step]
        for _ in range(_MOST_RARE):
            fits = _with_each(fit, rare, state) if fit else []
            if fit is None or not fits:
                break
            scale = Scale.of(state.fit, state.data, state.noise)
            names = ranked([_rival(fit, each, scale) for each in fits])
            steps.append(Step(tuple(names), step.p_value, fit))
            fit = names[0].fit
            yield Proposed(fit, tuple(steps), f"{names[0].name} in place of {step.winner.name}")


def _with_each(bare: Fit, names: Sequence[Effect], state: Hypothesis) -> list[Fit]:
    """Fit each of some names beside the effects of a model that has it not."""
    present = {effect.identifier for effect in bare.model.effects}
    starts = [
        (each, np.full(each.count, float(each.parameter_free)))
        for each in names
        if each.identifier not in present
    ]
    return [fit for pair in starts if (fit := _with(bare, *pair, state))]


def refit_without(state: Hypothesis, steps: Sequence[Step]) -> Fit | None:
    """Refit the model without some effects, from the present values and from the baseline's.

    None where it has no such motion: they are needed.
    """
    model, value = state.fit.model, state.fit.value
    for step in steps:
        model, value = model.dropping(step.winner.lead.effect, value)
    bare = np.concatenate([state.baseline.value, value[state.baseline.model.size :]])
    return best_fit(model, state.data, state.noise, [value, bare], held=state.held)


def describe(state: Hypothesis, p_value: float, task: Task) -> Hypothesis:
    """Add what describes best what is left, a curve or a rare name, if that lowers the score.

    Where nothing but sin x was found in what chance does not explain, the best curve says so.
    """
    curves = [(curve, np.zeros(curve.count)) for curve in _curves(state.fit, state, in_time=True)]
    fits = [fit for pair in curves if (fit := _with(state.fit, *pair, state))]
    if not fits:
        return state
    scale = Scale.of(min(fits, key=lambda fit: fit.chi2), state.data, state.noise)
    rivals = ranked([_rival(state.fit, fit, scale) for fit in fits])
    found = [*filter(is_further, state.steps), *state.faults]
    needed = not found and p_value < task.level
    if rivals[0].evidence <= CHOICE and not needed:
        return state
    rivals = prefer_rare(state, rivals, task)
    step = Step(tuple(rivals), p_value, state.fit)
    return replace(state, steps=(*state.steps, step)).settle(rivals[0].fit)


def prefer_rare(state: Hypothesis, rivals: Sequence[Rival], task: Task) -> list[Rival]:
    """Put a rare name before a leading curve, or a tone at a harmonic, if its score is smaller.

    Rare names are not scanned for: they look much like others, which would then be in doubt more
    often. They are asked where what leads only describes what they would explain.
    """
    leader, before = rivals[0], state.fit
    tone = leader.lead.effect.spectral or isinstance(leader.lead.effect, PlaneCoupling)
    tone = tone and not off_harmonics(leader.fit, leader.lead.effect)
    if not (leader.drawn or tone):
        return list(rivals)
    fits = _with_each(before, task.rare(state), state)
    if not fits:
        return list(rivals)
    lowest = min((leader.fit, *fits), key=lambda fit: fit.chi2)
    scale = Scale.of(lowest, state.data, state.noise)
    others = [
        each.again(each.fit, before.chi2, scale) for each in rivals if not each.lead.effect.rare
    ]
    named = ranked([_rival(before, fit, scale) for fit in fits])
    added = price_of_another(sum(map(is_further, state.steps))) if leader.drawn else 0.0
    if named[0].evidence - added <= others[0].evidence:
        return list(rivals)
    return [named[0], *others, *named[1:]]


def _rival(bare: Fit, fit: Fit, scale: Scale) -> Rival:
    lead = Lead(fit.model.effects[-1], (), bare.chi2 - fit.chi2, 0.0)
    return Rival.of(lead, fit, bare.chi2, scale, NO_SCAN)


def _curves(bare: Fit, state: Hypothesis, *, in_time: bool = False) -> list[Curve]:
    """Return the curves with the coefficients that the recording resolves."""
    curves = undrawn((*CURVES, *FOLLOW_UP_CURVES), bare)
    drawn = [curve for curve in curves if in_time >= curve.in_time]
    seen = build_bank(bare, state.noise, drawn).candidates
    return [candidate.effect for candidate in seen if isinstance(candidate.effect, Curve)]


def _with(bare: Fit, effect: Effect, own: FloatArray, state: Hypothesis) -> Fit | None:
    model, start = bare.model.adding(effect), np.concatenate([bare.value, own])
    fit = best_fit(model, state.data, state.noise, [start], held=state.held)
    return fit if fit and effect.believable(fit.value[len(bare.value) :]) else None
