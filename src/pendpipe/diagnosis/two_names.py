"""A curve or two named effects: what one effect leaves, a second may explain."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Final

from pendpipe.diagnosis.detect import Detection, detect, prepare
from pendpipe.diagnosis.evidence import Rival, form_spread
from pendpipe.diagnosis.naming import refit_leads
from pendpipe.diagnosis.one_curve import BETTER
from pendpipe.diagnosis.refine import Fit
from pendpipe.diagnosis.refits import OF_A_CURVE
from pendpipe.diagnosis.released_parameters import ReleasedParameter
from pendpipe.diagnosis.state import State
from pendpipe.diagnosis.task import Task, applicable

_FIRST_TRIED: Final = 2
"""Named effects tried as the first of two."""
_SECOND_TRIED: Final = 3
"""Named effects refitted as the second, beside each of them."""


def prefer_two_names(state: State, rivals: Sequence[Rival], task: Task) -> list[Rival]:
    """Put a named effect before the leading curve if it and a second one are better than it.

    A curve can follow parts of two effects, and no name is added after a curve. The margin is
    that of `prefer_one_curve`, beyond the charges for the effects' own scans. Beside a wrong held
    parameter, which bends nothing by itself, a named effect need only be as good as the curve.
    """
    curve = rivals[0]
    if not curve.drawn:
        return list(rivals)
    least_gain = OF_A_CURVE * curve.gain
    names = [rival for rival in rivals if not rival.drawn and rival.gain > least_gain]
    names = names or [rival for rival in _first(state) if rival.gain > least_gain]
    for name in sorted(names, key=lambda rival: -rival.gain)[:_FIRST_TRIED]:
        task.progress(f"trying {name.name} with a second effect instead of a curve")
        if any(
            name.evidence + second.evidence > curve.evidence + _margin(curve, name, second)
            for second in _second(state, name, task)
        ):
            return [name, *(rival for rival in rivals if rival is not name)]
    return list(rivals)


def _margin(curve: Rival, *names: Rival) -> float:
    """Return by how much two named effects must be better than a curve."""
    if any(isinstance(name.lead.effect, ReleasedParameter) for name in names):
        return 0.0
    return math.hypot(BETTER, form_spread(curve))


def _first(state: State) -> list[Rival]:
    """Refit the best named effects where only curves had been."""
    assert state.now is not None
    leads = tuple(lead for lead in state.now.leads if lead.effect.kind != "unnamed")
    return _refitted(state.fit, replace(state.now, leads=leads), state, state.held, _FIRST_TRIED)


def _second(state: State, name: Rival, task: Task) -> list[Rival]:
    """Return the best named effects that could be added to a first."""
    effects = [
        effect
        for effect in applicable(task.catalogue, name.fit, task.baseline, state.data.unit)
        if effect.kind != "unnamed"
    ]
    held = state.held
    if isinstance(name.lead.effect, ReleasedParameter):
        held = name.lead.effect.without(held)
    released = [entry for entry in task.released if entry not in name.fit.model.effects]
    scanner = prepare(name.fit, state.data, state.noise, [*effects, *released])
    found = detect(scanner, name.fit, seed=task.seed, known=state.now)
    if found.p_value > task.threshold:
        return []
    return _refitted(name.fit, found, state, held, _SECOND_TRIED)


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
