"""Held parameters that are wrong, or physics that was left out: the parameters are asked first.

A wrong parameter bends nothing that the baseline could not bend by itself. So where held
parameters, set free together, explain as much as the best name or curve does, nothing needs to
be missing; and of those only the ones that it takes are accused.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np

from pendpipe.diagnose.evidence import SIZE, Rival
from pendpipe.diagnose.naming import refit_leads
from pendpipe.diagnose.one_curve import BETTER
from pendpipe.diagnose.refine import Fit, refine
from pendpipe.diagnose.released_parameters import ReleasedParameter
from pendpipe.diagnose.review import fit_without
from pendpipe.diagnose.state import State, Step
from pendpipe.diagnose.task import Task
from pendpipe.diagnose.two_names import prefer_two_names
from pendpipe.dynamics.any_law import NoMotionError


def prefer_parameters(state: State, rivals: Sequence[Rival]) -> list[Rival]:
    """Put a held parameter first, where such alone explain as much as all else that was tried.

    Parameters
    ----------
    state
        What the effects would be added to.
    rivals
        Refitted effects, every held parameter among them; the best first.

    Returns
    -------
    list
        The same; of the fewest held parameters that it takes, the one that gains most leads.
    """
    freed = [rival for rival in rivals if isinstance(rival.lead.effect, ReleasedParameter)]
    if not freed or (len(freed) == 1 and rivals[0] is freed[0]):
        return list(rivals)
    most = _together(state, freed)
    if most is None or not _do_as_well(state, most, freed[:1], rivals):
        return list(rivals)
    needed, fit = _fewest(state, freed, most)
    if not _do_as_well(state, fit, needed, rivals):
        return list(rivals)
    first = max(needed, key=lambda rival: rival.gain)
    return [first, *(rival for rival in rivals if rival is not first)]


def reconsider_curve(state: State, task: Task) -> bool:
    """Take the last curve back where a held parameter and a name do as well; say whether they do.

    What was added one by one to a wrong prediction may be neither, and a curve follows both.
    """
    if not task.freed or not state.steps or not state.steps[-1].winner.drawn:
        return False
    drawn = state.steps[-1]
    without = fit_without(state, drawn)
    if without is None or all(entry in without.model.effects for entry in task.freed):
        return False
    before = replace(state, fit=without, steps=state.steps[:-1])
    task.scanned(before)
    assert before.now is not None
    leads = tuple(lead for lead in before.now.leads if lead.effect.kind in ("parameter", "unnamed"))
    rivals = refit_leads(
        without,
        state.data,
        state.noise,
        replace(before.now, leads=leads),
        held=state.holding,
        gross=False,
        origin=state.origin,
    )
    rivals = prefer_two_names(before, sorted(rivals, key=lambda each: -each.evidence), task)
    if not rivals or not isinstance(rivals[0].lead.effect, ReleasedParameter):
        return False
    task.progress(f"{rivals[0].identifier} and a name do as well as the curve")
    state.steps[:] = [*before.steps, Step(tuple(rivals), drawn.p_value, without)]
    state.holding = rivals[0].lead.effect.without(state.holding)
    state.settle(rivals[0].fit)
    return True


def _fewest(state: State, freed: Sequence[Rival], most: Fit) -> tuple[Sequence[Rival], Fit]:
    """The fewest parameters to which no other would add more than chance does, and their fit."""
    for number in range(1, len(freed)):
        tried = [(some, _together(state, some)) for some in combinations(freed, number)]
        fits = [(some, fit) for some, fit in tried if fit is not None]
        some, best = min(fits, key=lambda each: each[1].chi2, default=(freed, most))
        if best.chi2 - most.chi2 < SIZE * freed[0].left * (len(freed) - number):
            return some, best
    return freed, most


def _together(state: State, freed: Sequence[Rival]) -> Fit | None:
    """The model with some held parameters set free."""
    if len(freed) == 1:
        return freed[0].fit
    model, held = state.fit.model, list(state.holding)
    for rival in freed:
        effect = rival.lead.effect
        assert isinstance(effect, ReleasedParameter)
        model, held = model.adding(effect), effect.without(held)
    best = min(freed, key=lambda rival: rival.fit.chi2)
    try:
        return refine(model, state.data, state.noise, best.fit.value, held=held)
    except (NoMotionError, np.linalg.LinAlgError):
        return None


def _do_as_well(state: State, fit: Fit, needed: Sequence[Rival], rivals: Sequence[Rival]) -> bool:
    """Whether wrong parameters explain as much as each name and curve does.

    That one is wrong is likely beforehand. Several must be better than one name that does as
    well alone, as two names must be: that all of them are needed at once is as rare.
    """
    one, more = needed[0], len(needed) - 1
    worth = (state.fit.chi2 - fit.chi2) / one.left - SIZE * more + (0.0 if more else one.prior)
    return all(
        worth >= rival.evidence + (BETTER if more and not rival.drawn else 0.0)
        for rival in rivals
        if not isinstance(rival.lead.effect, ReleasedParameter)
    )
