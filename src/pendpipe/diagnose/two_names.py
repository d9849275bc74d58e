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
from pendpipe.diagnose.state import State
from pendpipe.diagnose.task import Task, applicable

_PART: Final = 0.4
"""Of the curve's gain: what a name must explain by itself to be one of two."""
_FIRST: Final = 2
"""How many names are tried."""
_SECOND: Final = 3
"""How many are refitted beside each."""


def prefer_two_names(state: State, rivals: Sequence[Rival], task: Task) -> list[Rival]:
    """Put a name before the curve that leads, where it and a second are better than the curve.

    A curve bends far enough to follow some of both of two effects, and once it is drawn
    nothing is named on top of it. The margin is wider than that of `prefer_one_curve`, since
    the names come after it, and beyond what their own scans take off.
    """
    curve = rivals[0]
    if not curve.drawn:
        return list(rivals)
    least_gain = _PART * curve.gain
    names = [rival for rival in rivals if not rival.drawn and rival.gain > least_gain]
    names = names or [rival for rival in _first(state) if rival.gain > least_gain]
    for name in sorted(names, key=lambda rival: -rival.gain)[:_FIRST]:
        task.progress(f"is it {name.identifier} and something else?")
        second = max((rival.evidence for rival in _second(state, name, task)), default=0.0)
        if name.evidence + second > curve.evidence + math.hypot(BETTER, form_spread(curve)):
            return [name, *(rival for rival in rivals if rival is not name)]
    return list(rivals)


def _first(state: State) -> list[Rival]:
    """The best names, where curves alone were worth refitting."""
    assert state.now is not None
    leads = tuple(lead for lead in state.now.leads if lead.effect.kind != "unnamed")
    return _refitted(state.fit, replace(state.now, leads=leads), state, _FIRST)


def _second(state: State, name: Rival, task: Task) -> list[Rival]:
    """The best names that could be added to a first."""
    effects = [
        effect
        for effect in applicable(task.catalogue, name.fit, task.baseline, state.data.unit)
        if effect.kind != "unnamed"
    ]
    scanner = prepare(name.fit, state.data, state.noise, effects)
    found = detect(scanner, name.fit, seed=task.seed, known=state.now)
    if found.p_value > task.threshold:
        return []
    return _refitted(name.fit, found, state, _SECOND)


def _refitted(base: Fit, found: Detection, state: State, most: int) -> list[Rival]:
    return refit_leads(
        base, state.data, state.noise, found, held=state.holding, gross=False, most=most,
        origin=state.origin,
    )  # fmt: skip
