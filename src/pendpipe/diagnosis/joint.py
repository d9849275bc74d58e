"""Several recordings of one pendulum as one measurement: physics shared, start and noise their own.

Each recording is diagnosed alone first: that gives its noise, its start, and what happened in it
alone. Then all readings are one problem (`effects.stack`), which the search of a single diagnosis
solves: by the same score, the same moves, the same check on cycles left out.
"""

from __future__ import annotations

from collections import ChainMap
from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from pendpipe.diagnosis import Progress
from pendpipe.diagnosis.begin import Beginning
from pendpipe.diagnosis.evidence import Scale
from pendpipe.diagnosis.faults import Forensics
from pendpipe.diagnosis.moves import price
from pendpipe.diagnosis.refine import Fit, best_fit
from pendpipe.diagnosis.remainder import remainder_of
from pendpipe.diagnosis.run import Outcome
from pendpipe.diagnosis.search import LESS_FRICTION, Search, grown
from pendpipe.diagnosis.stacked import StackedData, StackedNoise
from pendpipe.diagnosis.state import State, Step, loses_phase
from pendpipe.diagnosis.task import Task
from pendpipe.diagnosis.weighing import Weighed, swap_in_likelier
from pendpipe.dynamics.any_law import NoMotionError
from pendpipe.effects import Effect
from pendpipe.effects.baseline import BASELINE, C
from pendpipe.effects.catalogue import CATALOGUE
from pendpipe.effects.model import Model
from pendpipe.effects.stack import MAY_DIFFER, Differs, Stack

_MOST_EFFECTS: Final = 4


class _TestedAlone(Forensics):
    """The tests of the measurement: they are made on each recording alone."""

    def __init__(self) -> None:
        self.clock_notes = []

    def p_value(self, *_: object) -> float:
        """One: nothing was tested."""
        return 1.0

    def before(self, *_: object) -> None:
        """Nothing is corrected."""

    def after(self, *_: object) -> None:
        """Nothing is tested."""

    def again(self, *_: object) -> bool:
        """Nothing was masked."""
        return False

    def kicked_at_random(self, *_: object) -> bool:
        """Random kicks are no law."""
        return False


def search_together(
    outcomes: Sequence[Outcome],
    *,
    baseline: str,
    level: float,
    seed: int,
    same_sensor: bool,
    own: Sequence[str],
    progress: Progress,
) -> tuple[Search, tuple[Weighed, ...]]:
    """Search for what all recordings lack, or do not share, and weigh it.

    Parameters
    ----------
    outcomes
        Of each recording alone.
    baseline, level, seed, progress
        As in a single diagnosis.
    same_sensor
        Whether the sensor's errors have the same sizes in all.
    own
        Names (`MAY_DIFFER`) of what the recordings are known not to share.

    Raises
    ------
    NoMotionError
        If the recordings have no motion in common.
    """
    searches = [outcome.search for outcome in outcomes]
    data = StackedData.of([found.data for found in searches])
    misfits = [_misfit(found) for found in searches]
    # A recording counts less by as much as it follows its own law worse than the best does.
    noise = StackedNoise.of(
        [
            replace(found.noise, variance=(misfit / min(misfits)) ** 2 * found.noise.variance)
            for found, misfit in zip(searches, misfits, strict=True)
        ]
    )
    members = [_member(outcome) for outcome in outcomes]
    model = Stack.of(members, own, same_sensor=same_sensor)
    held = model.held_of([_of_baseline(found) for found in searches])
    fit = _fitted(model, data, noise, searches, held)
    if fit is None:
        raise NoMotionError("the recordings have no motion in common")
    begun = [outcome.beginning for outcome in outcomes]
    rms = float(np.sqrt(np.mean([each.noise_rms**2 for each in begun])))
    beginning = Beginning(data, model, fit.value, tuple(held), rms, begun[0].points)
    differing = [
        Differs(name, number)
        for name in MAY_DIFFER
        if name not in own
        for number in range(len(searches) == 2, len(searches))
    ]
    task = Task(CATALOGUE, differing, baseline, level, seed, _TestedAlone(), progress)
    state = State(fit, data, noise, held, fit.value, fit.value)
    state.settle(fit)
    _known_first(state, task, searches)
    return swap_in_likelier(grown(state, task, beginning), beginning, progress)


def _member(outcome: Outcome) -> Model:
    """Return a recording's baseline, with what happened in it alone.

    What may as well be a law of the pendulum did not.
    """
    found = outcome.search
    laws = {each.identifier for each in CATALOGUE if not happened(each)}
    doubted = {
        e.identifier for e in outcome.effects if laws.intersection(dict(e.indistinguishable))
    }
    model = found.baseline.model.bare().at_times(found.data.time_s)
    for effect in found.improved.model.effects:
        if happened(effect) and effect.identifier not in doubted:
            model = model.adding(effect)
    return model


def happened(effect: Effect) -> bool:
    """Whether an effect belongs to one recording: an instant, a tone, a wandering offset."""
    wanders = effect.in_time and effect.identifier == "unnamed-measurement"
    return effect.local or effect.spectral or wanders


def _of_baseline(found: Search) -> list[int]:
    return [index for index in found.held if index < len(BASELINE)]


def _misfit(found: Search) -> float:
    """Return the factor by which the misfit that a recording's own law leaves widens its errors.

    A curve of the motion against the time is no law: what it describes is a misfit too.
    """
    drawn = [effect for effect in found.improved.model.effects if effect.in_time]
    law = found.improved if all(map(happened, drawn)) else found.named
    return remainder_of(law, found.data, found.noise).error_scale


def _fitted(
    model: Stack,
    data: StackedData,
    noise: StackedNoise,
    searches: Sequence[Search],
    held: Sequence[int],
) -> Fit | None:
    """Fit each recording by itself, then all from there."""
    sizes = [
        {effect.key: fit.value[place] for effect, place in fit.model.places()}
        for fit in (found.improved for found in searches)
    ]
    fits = []
    of_each = zip(model.members, model.mixings(), searches, sizes, strict=True)
    for member, mixing, found, own in of_each:
        known = ChainMap(own, *sizes)
        starts = [
            np.concatenate([base.value[: len(BASELINE)], *(known[e.key] for e in member.effects)])
            for base in (found.improved, found.baseline)
        ]
        # What another recording shows may stop the motion in this one.
        starts.append(starts[1].copy())
        for effect, place in member.places():
            starts[2][place][: 0 if effect.parameter_free else effect.sizes] = 0.0
        fit = best_fit(member, found.data, found.noise, starts, held=_of_baseline(found))
        if fit is None:
            return None
        fits.append((mixing, fit))
    # The shared values of one recording after the other, the best first.
    values = []
    for last in fits:
        values.append(np.zeros(model.size))
        for mixing, fit in sorted(fits, key=lambda pair: pair is last):
            values[-1][np.argmax(mixing, axis=1)] = fit.value
    starts = [each.copy() for each in values for _ in LESS_FRICTION]
    for number, start in enumerate(starts):
        start[C] *= LESS_FRICTION[number % len(LESS_FRICTION)]
    return best_fit(model, data, noise, starts, held=held)


def _known_first(state: State, task: Task, searches: Sequence[Search]) -> None:
    """Begin with the names that the recordings have alone, where Eq. 8 loses the motion."""
    named: dict[str, list[Step]] = {}
    for found in searches:
        for step in found.steps:
            named.setdefault(step.winner.lead.effect.key, []).append(step)
    if loses_phase(state.fit):
        task.scanned(state)
    order = sorted(named.values(), key=lambda steps: -sum(step.winner.gain for step in steps))
    for steps in order:
        if not loses_phase(state.fit) or len(state.steps) == _MOST_EFFECTS:
            return
        model, before = state.fit.model, state.fit
        assert isinstance(model, Stack)
        assert isinstance(state.data, StackedData)
        assert isinstance(state.noise, StackedNoise)
        step = max(steps, key=lambda each: each.winner.gain)
        common = model.admitted([step.winner.lead.effect])
        if step.winner.drawn or not common:
            continue
        fit = _fitted(model.adding(common[0]), state.data, state.noise, searches, state.held)
        if fit is None:
            continue
        scale = Scale.of(fit, state.data, state.noise)
        lead = replace(step.winner.lead, effect=common[0])
        winner = replace(step.winner, lead=lead).again(fit, before.chi2, scale)
        # Rivals are refitted when they are weighed, each from its values in one recording.
        rivals = [winner]
        for rival in step.rivals[1:]:
            same = model.admitted([rival.lead.effect]) == [rival.lead.effect]
            rivals += [rival] if same and not rival.drawn else []
        added = Step(tuple(rivals), step.p_value, before)
        if winner.worth < price([*state.steps, added]) - price(state.steps):
            continue
        task.progress(f"beginning with {winner.name}")
        state.steps.append(added)
        state.settle(fit)
