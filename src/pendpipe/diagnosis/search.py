"""Add one effect after another, until nothing significant is left."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from pendpipe.analysis.turning_points.measure import Samples
from pendpipe.diagnosis import Progress, silent
from pendpipe.diagnosis.begin import Beginning
from pendpipe.diagnosis.data import Data
from pendpipe.diagnosis.detect import CATALOGUE_SHARE, Lead, more_leads, printed
from pendpipe.diagnosis.faults import correct, examine, random_torque
from pendpipe.diagnosis.held_out import predicts_worse
from pendpipe.diagnosis.hypothesis import (
    Hypothesis,
    Step,
    Task,
    first_noise,
    is_gross,
    loses_phase,
    price,
    undrawn,
)
from pendpipe.diagnosis.moves import (
    describe,
    improve,
    prefer_parameters,
    prefer_rare,
    reconsider_red_noise,
)
from pendpipe.diagnosis.refine import Fit, best_fit, fitted_from
from pendpipe.diagnosis.released_parameters import ReleasedParameter
from pendpipe.diagnosis.remainder import remainder_of, with_errors
from pendpipe.diagnosis.result import BASELINES
from pendpipe.diagnosis.rivals import NO_SCAN, Rival, Scale, refit_leads
from pendpipe.dynamics.any_law import NoMotionError
from pendpipe.effects import Effect
from pendpipe.effects.baseline import C
from pendpipe.effects.catalogue.in_time import BEATING_MODE
from pendpipe.effects.curves import FOLLOW_UP_CURVES
from pendpipe.quantities import compact


def second_mode_first(state: Hypothesis, task: Task) -> Hypothesis:
    """Fit it from its own start, and take it as the first effect if it leaves less.

    Parameters
    ----------
    state
        After the baseline's fit.
    task
        What the search is to do.
    """
    beginning = state.beginning
    if beginning.second_mode is None:
        return state
    task.progress(f"the turning points beat: fitting {BEATING_MODE.name} first")
    before, data, noise = state.fit, state.data, state.noise
    start = np.concatenate([beginning.value, beginning.second_mode])
    fit = fitted_from(before.model.adding(BEATING_MODE), data, noise, start, held=state.held)
    # Without its phase a model's chi^2 says less than the squares of what it leaves.
    if fit is None or not _square(fit, state) < _square(before, state):
        return state
    state = task.scanned(state)
    lead = Lead(BEATING_MODE, (), before.chi2 - fit.chi2, 0.0)
    rival = Rival.of(lead, fit, before.chi2, Scale.of(fit, data, noise), NO_SCAN)
    step = Step((rival,), state.scan.p_value / CATALOGUE_SHARE, before)
    return replace(state, steps=(step,)).settle(fit)


def _square(fit: Fit, state: Hypothesis) -> float:
    return float(np.sum((state.data.residual(fit.at.reading) * state.data.weight) ** 2))


_MOST_EFFECTS: Final = 4
_GOOD_PART: Final = 1.0 / 3.0
"""Of a misfit, that one of a few laws takes which share it."""
LESS_FRICTION: Final = (1.0, 0.9, 0.7, 0.4)
"""Fractions of the Coulomb friction to try if the baseline stops before the last reading."""


def search(
    beginning: Beginning,
    samples: Samples,
    catalogue: Sequence[Effect],
    *,
    baseline: str,
    level: float,
    seed: int,
    released: Sequence[ReleasedParameter] = (),
    progress: Progress = silent,
) -> Hypothesis:
    """Fit the baseline, and add what improves it most, until chance explains the rest.

    Parameters
    ----------
    beginning
        Readings, baseline and start values.
    samples
        The readings as they were recorded.
    catalogue
        The effects that may be missing.
    baseline
        Its name.
    level
        The significance level (global p-value).
    seed
        Of the random draws that count trials.
    released
        The held parameters that may be wrong.
    progress
        Receives one line for each step.
    """
    data, held = beginning.data, list(beginning.held)
    progress(f"fitting {BASELINES.get(baseline, baseline)} to {data.used} readings")
    white = first_noise(beginning)
    fit = fitted_from(beginning.model, data, white, beginning.value, held=held)
    if fit is None:
        raise NoMotionError("it stops")
    state = Hypothesis(beginning, fit, data, white, beginning.held, fit, samples).settle(fit)
    task = Task(catalogue, released, baseline, level, seed, progress, samples)
    return grown(second_mode_first(state, task), task)


def grown(state: Hypothesis, task: Task) -> Hypothesis:
    """Add effects to a hypothesis, until chance explains the rest."""
    state, named = _described(_grow(state, task), task)
    state = examine(state, task)
    return replace(
        state,
        fit=with_errors(state.fit, state.data, state.noise),
        baseline=_baseline_alone(state),
        without_curve=named,
    )


def _grow(state: Hypothesis, task: Task) -> Hypothesis:
    """Add effects until chance explains the rest, then improve the set.

    Of two laws that share a misfit neither may pay its price before the other is there. From the
    first that does not pay on, names stand if together they leave noise alone.
    """
    paid: Hypothesis | None = None
    while len(state.steps) < _MOST_EFFECTS:
        before = correct(state, task)
        state = _add_one(before, task, names_first=paid is not None)
        if len(state.steps) == len(before.steps):
            break
        if paid is None and not _pays(state.steps[-1], state.steps[:-1]):
            paid = before
    state = _improve(state, task)
    clean = Scale.of(state.fit, state.data, state.noise).clean
    if paid is not None and (not clean or any(step.winner.drawn for step in state.steps)):
        task.progress("more than noise is left: dropping what does not pay its price")
        state = _improve(paid, task)
    return state


def _improve(state: Hypothesis, task: Task) -> Hypothesis:
    """Make the moves that lower the score; readings that were left out may come back with them."""
    better = improve(state, task.progress, task.rare(state))
    after = correct(better, task)
    if after.fit is better.fit:
        return after
    return improve(after, task.progress, task.rare(after))


def _described(state: Hypothesis, task: Task) -> tuple[Hypothesis, Fit | None]:
    """Describe what the names leave by rare names and a curve; return the fit without the curve.

    None where there is no curve, or no name beside it.
    """
    state = task.scanned(state)
    while state.remainder.systematic and not _ends_with_curve(state):
        named = with_errors(state.fit, state.data, state.noise)
        better = describe(state, state.scan.p_value / CATALOGUE_SHARE, task)
        if better is state:
            break
        state = task.scanned(better)
        task.progress(f"describing what is left by {state.steps[-1].winner.name}")
        if _ends_with_curve(state):
            return state, named
    return state, None


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


def _add_one(state: Hypothesis, task: Task, *, names_first: bool) -> Hypothesis:
    """Scan the catalogue and add the best effect, or name."""
    gross, progress = is_gross(state.fit, state.data), task.progress
    state = task.scanned(state)
    chance = state.scan.p_value > task.threshold
    if state.noise.coloured and not state.noise.known and not gross and (chance or not state.steps):
        state = reconsider_red_noise(state, task.level, task.seed, progress)
    if state.scan.p_value > task.threshold or _ends_with_curve(state):
        return state
    p_value = state.scan.p_value / CATALOGUE_SHARE
    progress(f"chance does not explain the residual ({printed(p_value)}): refitting leads")
    rare = [effect for effect in task.rare(state) if effect.rare]
    unscanned = [*undrawn(FOLLOW_UP_CURVES, state.fit), *rare]
    closer = more_leads(state.fit, state.noise, unscanned)
    found = replace(state.scan, leads=(*state.scan.leads, *closer))
    rivals = refit_leads(
        state.fit,
        state.data,
        state.noise,
        found,
        held=state.held,
        phase_lost=loses_phase(state.fit),
    )
    # A rare name is a rival of what it looks like, and leads where `prefer_rare` says so.
    rivals.sort(key=lambda rival: rival.lead.effect.rare)
    if rivals:
        rivals = prefer_parameters(state, rivals)
    if names_first:
        rivals.sort(key=lambda rival: rival.drawn)
    if rivals:
        rivals = prefer_rare(state, rivals, task)
    if not rivals:
        return state
    if not gross and (kicked := random_torque(state, rivals[0], task)):
        return kicked
    step = Step(tuple(rivals), p_value, state.fit)
    pays = _pays(step, state.steps)
    if not (_predicts(step, state, progress) if pays else _on_trial(step, state)):
        return state
    winner = step.winner
    released = winner.lead.effect
    held = state.held
    if isinstance(released, ReleasedParameter):
        held = released.without(held)
    unit, fits = state.data.unit, (state.fit, winner.fit)
    before, after = (compact(_rms(fit, state.data), unit) for fit in fits)
    progress(f"adding {winner.name}: the residual falls from {before} to {after} rms")
    return replace(state, held=held, steps=(*state.steps, step)).settle(winner.fit)


def _predicts(step: Step, state: Hypothesis, progress: Progress) -> bool:
    """Whether an effect predicts cycles left out no worse.

    In a gross misfit it is what is still missing that decides how well cycles are predicted.
    """
    best, held = step.winner, state.held
    effect = best.lead.effect
    if isinstance(effect, ReleasedParameter):
        held = effect.without(held)
    fits = (state.fit, best.fit, state.data, state.noise, state.held, held)
    if is_gross(state.fit, state.data) or not predicts_worse(*fits, drawn=best.drawn):
        return True
    progress(f"{best.name} predicts cycles that are left out worse: it is not added")
    return False


def _on_trial(step: Step, state: Hypothesis) -> bool:
    """Whether a name that does not pay its price alone takes a good part of a misfit."""
    best = step.winner
    before, left = (remainder_of(fit, state.data, state.noise) for fit in (state.fit, best.fit))
    return best.gain > _GOOD_PART * before.excess and left.systematic and not best.drawn


def _pays(step: Step, before: Sequence[Step]) -> bool:
    """Whether an effect is worth the price of its name."""
    return step.winner.worth >= price([*before, step]) - price(before)


def _rms(fit: Fit, data: Data) -> float:
    """Root mean square of the readings that count less the model."""
    residual = data.residual(fit.at.reading)[data.weight > 0.0]
    return float(np.sqrt(np.mean(residual**2)))


def _ends_with_curve(state: Hypothesis) -> bool:
    """Whether the last effect is a curve without a name: no name is added after it."""
    return bool(state.steps) and state.steps[-1].winner.lead.effect.kind == "unnamed"
