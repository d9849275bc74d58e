"""A curve, or two things that have names: what one name leaves, a second may explain."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Final

from pendpipe.diagnose.detect import Detection, detect, prepare
from pendpipe.diagnose.evidence import Rival, form_spread
from pendpipe.diagnose.naming import refit_leads
from pendpipe.diagnose.one_curve import BETTER
from pendpipe.diagnose.refine import Fit
from pendpipe.diagnose.refits import OF_A_CURVE
from pendpipe.diagnose.released_parameters import ReleasedParameter
from pendpipe.diagnose.state import State
from pendpipe.diagnose.task import Task, applicable

_FIRST: Final = 2
"""How many names are tried."""
_SECOND: Final = 3
"""How many are refitted beside each."""


def prefer_two_names(state: State, rivals: Sequence[Rival], task: Task) -> list[Rival]:
    """Put a name before the curve that leads, where it and a second are better than the curve.

    A curve bends far enough to follow some of both of two effects, and once it is drawn
    nothing is named on top of it. The margin is wider than that of `prefer_one_curve`, since
    the names come after it, and beyond what their own scans take off. A held parameter that is
    wrong bends nothing by itself: a name beside it need only be as good as the curve.
    """
    curve = rivals[0]
    if not curve.drawn:
        return list(rivals)
    least_gain = OF_A_CURVE * curve.gain
    names = [rival for rival in rivals if not rival.drawn and rival.gain > least_gain]
    names = names or [rival for rival in _first(state) if rival.gain > least_gain]
    for name in sorted(names, key=lambda rival: -rival.gain)[:_FIRST]:
        task.progress(f"is it {name.identifier} and something else?")
        if any(
            name.evidence + second.evidence > curve.evidence + _margin(curve, name, second)
            for second in _second(state, name, task)
        ):
            return [name, *(rival for rival in rivals if rival is not name)]
    return list(rivals)


def _margin(curve: Rival, *names: Rival) -> float:
    """By how much two names must be better than a curve."""
    if any(isinstance(name.lead.effect, ReleasedParameter) for name in names):
        return 0.0
    return math.hypot(BETTER, form_spread(curve))


def _first(state: State) -> list[Rival]:
    """The best names, where curves alone were worth refitting."""
    assert state.now is not None
    leads = tuple(lead for lead in state.now.leads if lead.effect.kind != "unnamed")
    return _refitted(state.fit, replace(state.now, leads=leads), state, state.holding, _FIRST)


def _second(state: State, name: Rival, task: Task) -> list[Rival]:
    """The best names that could be added to a first."""
    effects = [
        effect
        for effect in applicable(task.catalogue, name.fit, task.baseline, state.data.unit)
        if effect.kind != "unnamed"
    ]
    held = state.holding
    if isinstance(name.lead.effect, ReleasedParameter):
        held = name.lead.effect.without(held)
    freed = [entry for entry in task.freed if entry not in name.fit.model.effects]
    scanner = prepare(name.fit, state.data, state.noise, [*effects, *freed])
    found = detect(scanner, name.fit, seed=task.seed, known=state.now)
    if found.p_value > task.threshold:
        return []
    return _refitted(name.fit, found, state, held, _SECOND)


def _refitted(
    base: Fit, found: Detection, state: State, held: Sequence[int], most: int
) -> list[Rival]:
    return refit_leads(
        base,
        state.data,
        state.noise,
        found,
        held=held,
        gross=False,
        most=most,
        origin=state.origin,
    )
