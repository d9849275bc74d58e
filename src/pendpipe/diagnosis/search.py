"""From the baseline to the answer: go to a neighbour of a smaller score, until there is none."""

from collections.abc import Iterator
from dataclasses import replace
from typing import Final

import numpy as np

from pendpipe.diagnosis.begin import Beginning
from pendpipe.diagnosis.faults import correct, examine
from pendpipe.diagnosis.hypothesis import (
    MOST_EFFECTS,
    Hypothesis,
    Step,
    Task,
    first_noise,
)
from pendpipe.diagnosis.neighbours import (
    adding,
    compared,
    describing,
    leading,
    shares_a_misfit,
    simpler,
    with_other_noise,
)
from pendpipe.diagnosis.refine import Fit, best_fit, fitted_from, refine
from pendpipe.diagnosis.remainder import with_errors
from pendpipe.diagnosis.rivals import NO_SCAN, Rival, Scale
from pendpipe.diagnosis.summary import BASELINES
from pendpipe.diagnosis.weighing import weigh
from pendpipe.dynamics.any_law import NoMotionError
from pendpipe.dynamics.eq8 import C

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
    """Go to a neighbour of a smaller score, until there is none that was not seen.

    Cheap neighbours come first, and the first kind that has a better one is taken.
    """
    seen = set()
    if state.beginning.starts:
        # Before any fault of the record: at the nodes of a beat the phase turns as if rows were
        # lost.
        state = with_other_noise(task.scanned(state), task)
        begun = max(_starts(state, task), key=lambda each: each.lower, default=None)
        if begun is not None and begun.lower > 0.0:
            task.progress(begun.words)
            state = begun.settle(begun.fit)
    while True:
        state = with_other_noise(task.scanned(correct(state, task)), task)
        seen.add(state.key)
        for some in (_additions, simpler, _descriptions):
            new = [each for each in some(state, task) if each.key not in seen]
            best = max(new, key=lambda each: each.lower, default=None)
            if best is not None and best.lower > 0.0:
                task.progress(best.words)
                state = best.settle(best.fit)
                break
        else:
            state = _judged(examine(state, task))
            return replace(state, steps=tuple(weigh(state, step) for step in state.steps))


def _starts(state: Hypothesis, task: Task) -> Iterator[Hypothesis]:
    """Add an effect from a start of its own, where it leaves less of the readings.

    Without its phase a model's chi^2 says less than the squares of what it leaves.
    """
    before, data, noise = state.fit, state.data, state.noise
    for start in state.beginning.starts:
        task.progress(f"the turning points beat: fitting {start.effect.name} first")
        value = np.concatenate([state.beginning.value, start.values])
        fit = fitted_from(before.model.adding(start.effect), data, noise, value, held=state.held)
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
    # Of two laws that share a misfit neither may pay its price before the other is there.
    if one.lower < -one.steps[-1].predicted_worse and shares_a_misfit(step, state):
        trial = task.scanned(correct(one.settle(one.fit), task))
        for more in _additions(trial, task, names_first=True):
            yield _from(state, more)


def _from(state: Hypothesis, after: Hypothesis) -> Hypothesis:
    """Compare a neighbour of a neighbour with the hypothesis before both."""
    model = state.fit.model.at_times(after.data.time_s)
    fit = refine(model, after.data, after.noise, state.fit.value, held=state.held, rounds=0)
    (found,) = compared(replace(after, fit=fit, steps=state.steps), [after])
    return found


def _descriptions(state: Hypothesis, task: Task) -> Iterator[Hypothesis]:
    if state.remainder.systematic and not _ends_with_curve(state):
        yield from describing(state, task)


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
