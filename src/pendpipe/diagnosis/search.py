"""The neighbours of a set of effects, from the baseline to the answer (`pendpipe.search`).

The neighbours of a set of effects are compared by one score (docs/score.md):

    S = lost(chi^2) + the charges of its effects + the price of each name

`lost` is the fall of the log-likelihood against the best of the sets compared (`rivals.Scale`):
chi^2 itself where that leaves noise alone. The charge of an effect is that of its scan, shapes and
sizes, less its prior (`rivals.Rival.charge`), with what its set predicts worse of cycles left out.
"""

import math
from collections.abc import Hashable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from typing import Final

import numpy as np

from pendpipe.analysis.fit.by_waveform import ODDS
from pendpipe.diagnosis.begin import Beginning
from pendpipe.diagnosis.data import Data
from pendpipe.diagnosis.detect import (
    CATALOGUE_SHARE,
    RED_NOISE_SHARE,
    Lead,
    build_bank,
    detect,
    more_leads,
    prepare,
)
from pendpipe.diagnosis.faults import correct, examine
from pendpipe.diagnosis.held_out import predicted_worse
from pendpipe.diagnosis.hypothesis import (
    MOST_EFFECTS,
    Hypothesis,
    Step,
    Task,
    first_noise,
    is_further,
    price,
    settled,
    undrawn,
)
from pendpipe.diagnosis.noise import Noise
from pendpipe.diagnosis.refine import (
    Fit,
    best_fit,
    fitted_from,
    is_gross,
    loses_phase,
    refine,
    remainder_of,
    with_errors,
)
from pendpipe.diagnosis.released_parameters import ReleasedParameter
from pendpipe.diagnosis.rivals import (
    NO_SCAN,
    Rival,
    Scale,
    off_harmonics,
    ranked,
    refit_leads,
    side_by_side,
)
from pendpipe.diagnosis.summary import BASELINES
from pendpipe.diagnosis.weighing import weigh
from pendpipe.dynamics.any_law import NoMotionError
from pendpipe.dynamics.eq8 import OFFSET, C
from pendpipe.dynamics.eq8_model import values_of
from pendpipe.effects import Effect
from pendpipe.effects.catalogue.in_time import PlaneCoupling
from pendpipe.effects.curves import CURVES, FOLLOW_UP_CURVES
from pendpipe.estimate import LISTED, NAMED
from pendpipe.quantities import compact
from pendpipe.score import CHOICE, NEAR, Trials, price_of_another
from pendpipe.search import descend


def with_other_noise(state: Hypothesis, task: Task) -> Hypothesis:
    """Test whether apparent red noise is an effect, or a few, and re-estimate the noise if so.

    No tone is asked: red noise has no line. The best effect for noise that is not red is fitted,
    and the noise is estimated from what it leaves; beside it the next, since one of several jumps
    leaves red noise. This replaces red noise if effects and noise together are more likely by a
    factor k^2/p, where k is their number and p this test's part of the significance level: a
    normalised density exceeds that of the true model by 1/p with a probability of at most p
    (Markov).
    """
    chance = state.scan.p_value > task.threshold
    asked = state.noise.coloured and not state.noise.known and (chance or not state.steps)
    if not asked or is_gross(state.fit, state.data):
        return state
    task.progress("testing whether the red noise is a drift or a step")
    found = _without_red_noise(state, task)
    if found is None:
        return state
    by_chance, data, noise = found
    fit = refine(state.fit.model, data, noise, state.fit.value, held=state.held)
    scanner = prepare(fit, data, noise, _not_red(fit, state, task))
    now = detect(scanner, fit, seed=task.seed, known=state.scan)
    # The same part of the catalogue's share of the level as of this test's share.
    rare = by_chance * CATALOGUE_SHARE / RED_NOISE_SHARE
    now = replace(now, p_value=max(now.p_value, rare))
    first = state.first if state.steps else now
    return replace(state, fit=fit, data=data, noise=noise, now=now, first=first)


def _not_red(fit: Fit, state: Hypothesis, task: Task) -> list[Effect]:
    """Return the names that red noise could be, beside those of a fit."""
    named = task.asked(fit, state.data.unit)
    return [each for each in named if each.kind != "unnamed" and not each.has_lines]


def _without_red_noise(state: Hypothesis, task: Task) -> tuple[float, Data, Noise] | None:
    """Find the effects that red noise is: the p-value, the readings, and the noise beside them."""
    held, charge, least = state.held, 0.0, task.level * RED_NOISE_SHARE
    best: tuple[float, Data, Noise] | None = None
    fit, data, noise = settled(state.fit, state.data, state.noise, held, red=False)
    for number in range(1, MOST_EFFECTS + 1):
        scanner = prepare(fit, data, noise, _not_red(fit, state, task))
        other = detect(scanner, fit, seed=task.seed, known=state.scan)
        if other.p_value > task.threshold:
            break
        rivals = refit_leads(fit, data, noise, other, held=held, phase_lost=False, most=3)
        if not rivals:
            break
        charge += _charge(state, rivals)
        extended, lattice, left = settled(rivals[0].fit, data, noise, held)
        gained = state.fit.chi2 + state.noise.cost - extended.chi2 - left.cost
        by_chance = number**2 * math.exp(0.5 * min(charge - gained, 0.0))
        if by_chance <= least:
            least, best = by_chance, (by_chance, lattice, left)
        if best is not None and not left.coloured:
            break
        fit, data, noise = settled(rivals[0].fit, data, noise, held, red=False)
    return best


def _charge(state: Hypothesis, rivals: Sequence[Rival]) -> float:
    """Return the charge for the effects and shapes that were tried, and for the fitted sizes.

    A size is known to one part in g^(1/2) of it, for a gain of g in chi^2 (Laplace). Tones are
    scanned at every second cosine.
    """
    effect, gain = rivals[0].effect, max(rivals[0].gain, 1.0)
    by_frequency = Trials(0.5 * len(state.data), 0.0)
    own = state.scan.chance.own.get(effect.key)
    trials = own or (by_frequency if effect.spectral else Trials(1.0, 0.0))
    tried = trials.number_at(-0.5 * gain) * len(rivals)
    return 2.0 * math.log(tried) + effect.sizes * math.log(gain)


_GOOD_PART: Final = 1.0 / 3.0
"""Of a misfit, that one of a few laws takes which share it."""
_MOST_RARE: Final = 2
"""Rare names that may take the place of one curve."""


def compared(here: Hypothesis, there: Sequence[Hypothesis]) -> Iterator[Hypothesis]:
    """Compare sets of effects with the present one by their scores."""
    best = min((here, *there), key=lambda each: each.fit.chi2)
    scale = Scale.of(best.fit, here.data, here.noise)

    def score(each: Hypothesis) -> float:
        return scale.lost(each.fit.chi2) + price(each.steps)

    for each in there:
        yield replace(each, lower=score(here) - score(each))


def simpler(state: Hypothesis, task: Task) -> Iterator[Hypothesis]:
    """Drop an effect, or exchange all names for a curve, or a curve for rare names or events."""
    there = [
        *_drops(state),
        *_curve_for_names(state),
        *_rare_for_a_curve(state, task.rare(state)),
        *_events_for_a_curve(state, task),
    ]
    yield from compared(state, there)
    for each in compared(state, list(_other_drag(state))):
        # The fit, too, calls the form of the drag told only at these odds.
        yield replace(each, lower=each.lower - 2.0 * ODDS)


def leading(state: Hypothesis, task: Task, *, names_first: bool) -> Step | None:
    """Refit what the scan asks for; return it as a step, the effect to add first."""
    rare = [effect for effect in task.rare(state) if effect.rare]
    unscanned = [*undrawn(FOLLOW_UP_CURVES, state.fit), *rare]
    closer = more_leads(state.fit, state.noise, unscanned)
    rivals = refit_leads(
        state.fit,
        state.data,
        state.noise,
        replace(state.scan, leads=(*state.scan.leads, *closer)),
        held=state.held,
        phase_lost=loses_phase(state.fit),
    )
    if not rivals:
        return None
    # A rare name is a rival of what it looks like, and leads where `prefer_rare` says so.
    rivals.sort(key=lambda rival: rival.effect.rare)
    if names_first:
        rivals.sort(key=lambda rival: rival.drawn)
    return Step(tuple(prefer_rare(state, rivals, task)), state.unexplained, state.fit)


def adding(state: Hypothesis, step: Step) -> Hypothesis:
    """Add a step's leader. What its set predicts worse of cycles left out counts against it.

    Where it does not pay that is not asked.
    """
    winner, steps = step.winner, (*state.steps, step)
    effect, held = winner.effect, state.held
    if isinstance(effect, ReleasedParameter):
        held = tuple(effect.without(held))
    lower = winner.worth - (price(steps) - price(state.steps))
    if lower >= 0.0:
        worse = predicted_worse(
            state.fit,
            winner.fit,
            state.data,
            state.noise,
            state.held,
            held,
            drawn=winner.drawn,
        )
        lower, steps = lower - worse, (*state.steps, replace(step, predicted_worse=worse))
    rms = [state.data.rms_left(fit.at.reading) for fit in (state.fit, winner.fit)]
    before, after = (compact(each, state.data.unit) for each in rms)
    words = f"adding {winner.name}: residual {before} → {after} rms"
    return replace(state, fit=winner.fit, steps=steps, held=held, lower=lower, words=words)


def shares_a_misfit(step: Step, state: Hypothesis) -> bool:
    """Whether a name takes a good part of a misfit, of which another law may take the rest."""
    best = step.winner
    before, left = (remainder_of(fit, state.data, state.noise) for fit in (state.fit, best.fit))
    return best.gain > _GOOD_PART * before.excess and left.systematic and not best.drawn


def _drops(state: Hypothesis) -> Iterator[Hypothesis]:
    """Drop one effect; what was held may not be held again."""
    for step in state.steps:
        effect = step.winner.effect
        if isinstance(effect, ReleasedParameter):
            continue
        without = state.without(step)
        if without is not None:
            others = tuple(other for other in state.steps if other is not step)
            words = f"{effect.name} is no longer needed"
            yield replace(state, fit=without, steps=others, words=words)


def _other_drag(state: Hypothesis) -> Iterator[Hypothesis]:
    """Take the other form of the drag: with all effects, and without the curves it may replace.

    Neither form has a value of its own. The fit has chosen one of them without the effects.
    """
    drawn = [step for step in state.steps if step.winner.drawn]
    for gone in ([], drawn) if drawn else ([],):
        fit = state.other_drag(*gone)
        if fit is not None:
            steps = tuple(step for step in state.steps if step not in gone)
            words = f"drag {'v|v|' if fit.model.drag == 'speed' else 'by the energy'}"
            yield replace(state, fit=fit, steps=steps, words=words)


def _curve_for_names(state: Hypothesis) -> Iterator[Hypothesis]:
    """Put one curve in the place of several names."""
    names = [step for step in state.steps if is_further(step)]
    if len(names) < 2 or any(step.winner.drawn for step in state.steps):
        return
    bare = state.without(*names)
    fits = _with_curves(bare, state) if bare else []
    if bare is None or not fits:
        return
    scale = Scale.of(min((*fits, state.fit), key=lambda fit: fit.chi2), state.data, state.noise)
    rivals = ranked([_rival(bare, fit, scale) for fit in fits])
    kept = [step for step in state.steps if step not in names]
    words = f"{rivals[0].name} alone does as well as {len(names)} effects"
    step = Step(tuple(rivals), names[0].p_value, bare)
    yield replace(state, fit=rivals[0].fit, steps=(*kept, step), words=words)


def _rare_for_a_curve(state: Hypothesis, rare: Sequence[Effect]) -> Iterator[Hypothesis]:
    """Put a rare name, or two, in the place of a curve: a camera is oblique, and has a shutter."""
    for step in [step for step in state.steps if step.winner.drawn]:
        fit = state.without(step)
        steps = [other for other in state.steps if other is not step]
        for _ in range(_MOST_RARE):
            fits = _with_each(fit, rare, state) if fit else []
            if fit is None or not fits:
                break
            scale = Scale.of(state.fit, state.data, state.noise)
            names = ranked([_rival(fit, each, scale) for each in fits])
            steps.append(Step(tuple(names), step.p_value, fit))
            fit = names[0].fit
            words = f"{names[0].name} in place of {step.winner.name}"
            yield replace(state, fit=fit, steps=tuple(steps), words=words)


def _events_for_a_curve(state: Hypothesis, task: Task) -> Iterator[Hypothesis]:
    """Put events of one kind in the place of a curve in time, which gains more than each of them.

    The first are the three best of all kinds; each is followed by others of its own.
    """
    for step in [step for step in state.steps if step.winner.effect.in_time]:
        bare = state.without(step)
        kept = tuple(other for other in state.steps if other is not step)
        enough = Scale.of(state.fit, state.data, state.noise).within(step.winner.charge)
        for first in _events(bare, state, task) if bare else []:
            best: Rival | None = first
            fit, steps = bare, kept
            while fit and best and len(steps) < MOST_EFFECTS:
                steps, gain = (*steps, Step((best,), step.p_value, fit)), fit.chi2 - best.fit.chi2
                fit, times = best.fit, f"{best.name}, {len(steps) - len(kept)} times"
                words = f"{times}, in place of {step.winner.name}"
                yield replace(state, fit=fit, steps=steps, words=words)
                if fit.chi2 - (MOST_EFFECTS - len(steps)) * gain > enough:
                    break  # the others would have to gain more than this one
                best = next(iter(_events(fit, state, task, first.identifier)), None)


def _events(fit: Fit, state: Hypothesis, task: Task, kind: str = "") -> list[Rival]:
    """Return the three events, or those of a kind, that explain most of what a fit leaves."""
    named = task.asked(fit, state.data.unit)
    wanted = [each for each in named if each.local and kind in ("", each.identifier)]
    found = detect(
        prepare(fit, state.data, state.noise, wanted), fit, seed=task.seed, known=state.scan
    )
    return refit_leads(
        fit, state.data, state.noise, found, held=state.held, phase_lost=False, most=3
    )


def describing(state: Hypothesis, task: Task) -> Iterator[Hypothesis]:
    """Describe what is left by the best curve, or a rare name.

    Where nothing was found in what chance does not explain, a curve says so, whatever it is worth.
    """
    if not state.remainder.systematic or _ends_with_curve(state):
        return
    fits = _with_curves(state.fit, state, in_time=True)
    if not fits:
        return
    scale = Scale.of(min(fits, key=lambda fit: fit.chi2), state.data, state.noise)
    rivals = ranked([_rival(state.fit, fit, scale) for fit in fits])
    found = any(map(is_further, state.steps)) or state.faults
    step = Step(tuple(prefer_rare(state, rivals, task)), state.unexplained, state.fit)
    lower = rivals[0].evidence - CHOICE if found else math.inf
    words, steps = f"describing what is left by {step.winner.name}", (*state.steps, step)
    yield replace(state, fit=step.winner.fit, steps=steps, lower=lower, words=words)


def prefer_rare(state: Hypothesis, rivals: Sequence[Rival], task: Task) -> list[Rival]:
    """Put a rare name before a leading curve, or a tone at a harmonic, if its score is smaller.

    Rare names are not scanned for: they look much like others, which would then be in doubt more
    often. They are asked where what leads only describes what they would explain.
    """
    leader, before = rivals[0], state.fit
    tone = leader.effect.spectral or isinstance(leader.effect, PlaneCoupling)
    tone = tone and not off_harmonics(leader.fit, leader.effect)
    if not (leader.drawn or tone):
        return list(rivals)
    fits = _with_each(before, task.rare(state), state)
    if not fits:
        return list(rivals)
    lowest = min((leader.fit, *fits), key=lambda fit: fit.chi2)
    scale = Scale.of(lowest, state.data, state.noise)
    others = [each.again(each.fit, before.chi2, scale) for each in rivals if not each.effect.rare]
    named = ranked([_rival(before, fit, scale) for fit in fits])
    added = price_of_another(sum(map(is_further, state.steps))) if leader.drawn else 0.0
    if named[0].evidence - added <= others[0].evidence:
        return list(rivals)
    return [named[0], *others, *named[1:]]


def _rival(bare: Fit, fit: Fit, scale: Scale) -> Rival:
    return Rival.of(fit.model.effects[-1], fit, bare.chi2, scale, NO_SCAN)


def _with_curves(bare: Fit, state: Hypothesis, *, in_time: bool = False) -> list[Fit]:
    """Fit each curve with the coefficients that the recording resolves; or those in time, too."""
    curves = undrawn((*CURVES, *FOLLOW_UP_CURVES), bare)
    drawn = [curve for curve in curves if in_time >= curve.in_time]
    resolved = build_bank(bare, state.noise, drawn).candidates
    return _with_each(bare, [each.effect for each in resolved], state)


def _with_each(bare: Fit, effects: Sequence[Effect], state: Hypothesis) -> list[Fit]:
    """Fit each effect beside those of a model; effects without a shape, and not twice the same."""
    present = {effect.key for effect in bare.model.effects}
    leads = [Lead(each) for each in effects if each.key not in present]
    lost = loses_phase(bare)
    fits = side_by_side(bare, state.data, state.noise, leads, state.held, phase_lost=lost)
    return [fit for _, fit in fits]


LESS_FRICTION: Final = (1.0, 0.9, 0.7, 0.4)
"""Fractions of the Coulomb friction to try if the baseline stops before the last reading."""


def baseline_fitted(beginning: Beginning, task: Task) -> Hypothesis:
    """Fit the baseline: where a search begins.

    Raises
    ------
    NoMotionError
        If it has no motion that reaches the last reading.
    """
    data, held = beginning.data, beginning.held
    task.progress(f"fitting {BASELINES.get(task.baseline, task.baseline)} to {data.used} readings")
    white = first_noise(beginning)
    fit = fitted_from(beginning.model, data, white, beginning.value, held=list(held))
    if fit is None:
        raise NoMotionError("it stops")
    return Hypothesis(beginning, fit, data, white, held, fit, task.samples).settle(fit)


def run_search(state: Hypothesis, task: Task) -> Hypothesis:
    """Descend to the set of effects of the smallest score, and weigh each of them."""

    def in_order(at: Hypothesis) -> Hypothesis:
        return with_other_noise(task.scanned(correct(at, task)), task)

    if state.beginning.starts:
        # Before any fault of the record: at the nodes of a beat the phase turns as if rows were
        # lost.
        state = with_other_noise(task.scanned(state), task)
        begun = max(_starts(state, task), key=lambda each: each.lower, default=None)
        if begun is not None and begun.lower > 0.0:
            task.progress(begun.words)
            state = begun.settle(begun.fit)
    state, seen = in_order(state), set[Hashable]()
    kinds = [partial(some, task=task) for some in (_additions, simpler, describing)]
    while True:
        state = descend(
            state, kinds, lambda each: in_order(each.settle(each.fit)), task.progress, seen
        )
        found = _weighed(_judged(examine(state, task)))
        other = _likelier(found)
        if other is None or other.key in seen:
            return found
        task.progress(other.words)
        state = in_order(other.settle(other.fit))


def _weighed(state: Hypothesis) -> Hypothesis:
    """Compare each effect with its rivals; drop one that explains nothing beside the others."""
    steps = tuple(weigh(state, step) for step in state.steps)
    for step, weighed in zip(state.steps, steps, strict=True):
        without = None if any(weighed.weights) else state.without(step)
        if without is not None:
            others = tuple(other for other in state.steps if other is not step)
            return _weighed(replace(state, fit=without, steps=others).settle(without))
    return replace(state, steps=steps)


def _likelier(found: Hypothesis) -> Hypothesis | None:
    """Put the most likely of its class in the place of a name, where it is told and that is not.

    It was the likelier beside others, or none, that were there then. What was drawn beside names
    goes, and may be drawn again.
    """
    for step in found.steps:
        others = zip(step.weights[1:-1], step.mates, strict=True)
        weight, mate = max(others, key=lambda each: each[0], default=(0.0, step.winner))
        released = any(isinstance(each.effect, ReleasedParameter) for each in (mate, step.winner))
        # Listed, or named.
        if released or not any(step.weights[0] < told <= weight for told in (LISTED, NAMED)):
            continue
        rivals = (mate, *(rival for rival in step.rivals if rival is not mate))
        kept = [replace(step, rivals=rivals) if each is step else each for each in found.steps]
        there = {id(effect) for effect in mate.fit.model.effects}
        steps = tuple(each for each in kept if id(each.winner.effect) in there)
        words = f"{mate.name} in place of {step.winner.name}"
        return replace(found, fit=mate.fit, steps=steps, without_curve=None, words=words)
    return None


def _starts(state: Hypothesis, task: Task) -> Iterator[Hypothesis]:
    """Add an effect from a start of its own, where it leaves less of the readings.

    Without its phase a model's chi^2 says less than the squares of what it leaves.
    """
    before, data, noise = state.fit, state.data, state.noise
    for start in state.beginning.starts:
        task.progress(f"the turning points beat: fitting {start.effect.name} first")
        own = values_of(start.law, start.release, float(before.value[OFFSET]))
        model = replace(before.model, restoring=start.law.restoring).adding(start.effect)
        value = np.concatenate([own, start.values])
        fit = fitted_from(model, data, noise, value, held=state.held)
        if fit is None:
            continue
        scale = Scale.of(fit, data, noise)
        rival = Rival.of(start.effect, fit, before.chi2, scale, NO_SCAN)
        squares = [np.sum((data.residual(f.at.reading) * data.weight) ** 2) for f in (before, fit)]
        yield replace(
            state,
            fit=fit,
            steps=(Step((rival,), state.unexplained, before),),
            lower=float(squares[0] - squares[1]),
            words=f"beginning with {rival.name}",
        )


def _additions(state: Hypothesis, task: Task, *, names_first: bool = False) -> Iterator[Hypothesis]:
    """Add the effect that leads; or two names that share a misfit."""
    drawn, chance = _ends_with_curve(state), state.scan.p_value > task.threshold
    if chance or drawn or len(state.steps) >= MOST_EFFECTS:
        return
    step = leading(state, task, names_first=names_first)
    if step is None:
        return
    one = adding(state, step)
    yield one
    if not state.steps:
        # The drag was chosen without the effect; a curve is found beside either form.
        for other in map(task.scanned, _other_drag(state)):
            promised = _left_by_a_name(state) - _left_by_a_name(other) > NEAR
            lead = leading(other, task, names_first=True) if promised else None
            yield from compared(state, [adding(other, lead)] if lead else [])
    # Of two laws that share a misfit neither may pay its price before the other is there.
    pays = one.lower >= -one.steps[-1].predicted_worse
    if not (pays or names_first) and shares_a_misfit(step, state):
        trial = task.scanned(correct(one.settle(one.fit), task))
        # What is left may be noise of another colour.
        for more in (trial, *_additions(trial, task, names_first=True)):
            # A neighbour of a neighbour is compared with the hypothesis before both.
            model, value = state.fit.model.at_times(more.data.time_s), state.fit.value
            fit = refine(model, more.data, more.noise, value, held=state.held, rounds=0)
            yield from compared(replace(more, fit=fit, steps=state.steps), [more])


def _left_by_a_name(state: Hypothesis) -> float:
    """Return the chi^2 that the scan promises with its best name."""
    names = (lead.score for lead in state.scan.leads if lead.effect.kind != "unnamed")
    return state.fit.chi2 - max(names, default=0.0)


def _ends_with_curve(state: Hypothesis) -> bool:
    """Whether the last effect is a curve without a name: no name is added after it."""
    return bool(state.steps) and state.steps[-1].winner.drawn


def _judged(state: Hypothesis) -> Hypothesis:
    """Return it with errors, and with the fit of its names where a curve stands beside them."""
    named = None
    if _ends_with_curve(state) and len(state.steps) > 1:
        named = state.without(state.steps[-1])
        named = named and with_errors(named, state.data, state.noise)
    fit = with_errors(state.fit, state.data, state.noise)
    return replace(state, fit=fit, baseline=_baseline_alone(state), without_curve=named)


def _baseline_alone(state: Hypothesis) -> Fit:
    """Refit the baseline with the final noise, at the recorded times."""
    model, data, beginning = state.fit.model.bare(), state.data, state.beginning
    # Readings at the end may have been left out meanwhile.
    read = beginning.data.first(len(data))
    same_values = np.array_equal(data.values, read.values)
    if same_values and np.array_equal(data.time_s, read.time_s):
        if not state.fit.model.effects and sorted(state.held) == sorted(beginning.held):
            return state.fit
    else:
        model = model.at_times(read.time_s)
        data = replace(data, time_s=read.time_s, values=read.values, uniform=read.uniform)
    starts = [beginning.value]
    for share in LESS_FRICTION:
        starts.append(state.baseline.value.copy())
        starts[-1][C] *= share
    fit = best_fit(model, data, state.noise, starts, held=beginning.held)
    if fit is None:
        raise NoMotionError("it stops")
    return fit
