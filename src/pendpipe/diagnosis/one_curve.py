"""Several named effects or one unknown law: prefer a single curve that does as well.

Two effects of the catalogue together can imitate many a law outside it. That both are present is
less probable than one unknown effect.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

import numpy as np

from pendpipe.arrays import FloatArray
from pendpipe.diagnosis import Progress
from pendpipe.diagnosis.detect import Lead
from pendpipe.diagnosis.evidence import MISSHAPEN, NO_SCAN, Rival, evidence, ranked
from pendpipe.diagnosis.refine import Fit, refine
from pendpipe.diagnosis.review import stands_apart
from pendpipe.diagnosis.scores import build_bank
from pendpipe.diagnosis.state import State, Step
from pendpipe.dynamics.any_law import NoMotionError
from pendpipe.effects.curves import CURVES, FOLLOW_UP_CURVES, Curve

BETTER: Final = 22.0
"""Difference of chi^2 + 2 (free values) by which two named effects must be better than one curve:
each is one of some forty (2 ln 40 = 7.4), and needing two at once is as rare."""
_LOST_AT_KNOTS: Final = 0.012
"""Part of a curve's gain lost between its knots: at most a hundredth for laws outside the
catalogue (development recordings, opened challenges)."""
_SUDDEN_SHARE: Final = 0.5
"""Part of its gain that a sudden effect must keep beside a curve to stay."""
_PER_VALUE: Final = 2.0
_CORRECTION: Final = 1e-4
"""Part of the gain that further effects must add to be more than a correction of the first."""


def prefer_one_curve(state: State, progress: Progress) -> None:
    """Replace several named effects by one curve if it does as well.

    Some effects stay: those that every pendulum has, a separate spectral line larger than what a
    curve leaves, and a sudden effect that is as needed beside the curve. If one effect explains
    nearly everything, the others count as its corrections and nothing is replaced.
    """
    total = sum(step.winner.gain for step in state.steps)
    _prefer(
        state, [step for step in state.steps if _stays(step, state, MISSHAPEN * total)], progress
    )


def _prefer(state: State, kept: Sequence[Step], progress: Progress) -> None:
    names = [
        step
        for step in state.steps
        if step not in kept and step.winner.lead.effect.kind != "unnamed"
    ]
    if len(names) < 2 or any(not step.winner.lead.effect.count for step in names):
        return
    if _one_alone(names):
        return
    bare = _without_names(state, kept)
    if bare is None:
        return
    fits = [
        fit for curve in _curves(bare, state) for fit in [_with_curve(bare, curve, state)] if fit
    ]
    if not fits:
        return
    rivals = ranked([_rival(bare, fit) for fit in fits])
    best = rivals[0]
    if cost(best.fit) > cost(state.fit) + math.hypot(BETTER, _allowance(names) * best.gain):
        return
    sudden = [step for step in names if _needed_beside(step, best.fit, state)]
    if sudden:
        _prefer(state, [*kept, *sudden], progress)
        return
    progress(f"{best.name} alone does as well as {len(names)} effects")
    state.steps[:] = [*kept, Step(tuple(rivals), names[0].p_value, bare)]
    state.settle(best.fit)


def _needed_beside(step: Step, drawn: Fit, state: State) -> bool:
    """Whether a sudden effect is needed beside a curve, which can't be sudden."""
    effect = step.winner.lead.effect
    if not effect.local:
        return False
    position = next(position for other, position in state.fit.model.places() if other is effect)
    start = np.concatenate([drawn.value, state.fit.value[position]])
    try:
        both = refine(drawn.model.adding(effect), state.data, state.noise, start, held=state.held)
    except (NoMotionError, np.linalg.LinAlgError):
        return False
    return cost(drawn) - cost(both) > max(BETTER, _SUDDEN_SHARE * step.winner.gain)


def _stays(step: Step, state: State, left: float) -> bool:
    effect = step.winner.lead.effect
    if effect.expected:
        return True
    return stands_apart(effect, state.fit) and step.winner.gain > left


def _one_alone(names: Sequence[Step]) -> bool:
    """Whether one effect explains so much that the others may correct its form."""
    gains = [step.winner.gain for step in names]
    return sum(gains) - max(gains) < _CORRECTION * sum(gains)


def _allowance(names: Sequence[Step]) -> float:
    """Part of its gain by which a curve may fall short and still be preferred.

    If all effects but one add no more than a real law's form may differ from the catalogue's,
    they may be corrections of one wrong effect.
    """
    gains = [step.winner.gain for step in names]
    return _LOST_AT_KNOTS if sum(gains) - max(gains) > MISSHAPEN * sum(gains) else MISSHAPEN


def _rival(bare: Fit, fit: Fit) -> Rival:
    curve = fit.model.effects[-1]
    gain = bare.chi2 - fit.chi2
    lead = Lead(curve, (), gain, 0.0)
    return Rival(lead, fit, gain, evidence(lead, fit, gain, NO_SCAN))


def cost(fit: Fit) -> float:
    """Return chi^2 + 2 (free values) (Akaike)."""
    return fit.chi2 + _PER_VALUE * len(fit.free)


def _without_names(state: State, kept: Sequence[Step]) -> Fit | None:
    """Refit the baseline with the effects that are kept, with the present noise."""
    model, value = state.fit.model, state.fit.value
    for step in state.steps:
        if step not in kept:
            model, value = model.dropping(step.winner.lead.effect, value)
    start = np.concatenate([state.bare, value[len(state.bare) :]])
    try:
        return refine(model, state.data, state.noise, start, held=state.held)
    except (NoMotionError, np.linalg.LinAlgError):
        return None


def _curves(bare: Fit, state: State) -> list[Curve]:
    """Return the curves with the coefficients that the recording resolves; none against time."""
    drawn = [curve(bare.at.span) for curve in (*CURVES, *FOLLOW_UP_CURVES) if not curve.in_time]
    seen = build_bank(bare, state.noise, drawn).candidates
    return [candidate.effect for candidate in seen if isinstance(candidate.effect, Curve)]


def _with_curve(bare: Fit, curve: Curve, state: State) -> Fit | None:
    start: FloatArray = np.concatenate([bare.value, np.zeros(curve.count)])
    try:
        fit = refine(bare.model.adding(curve), state.data, state.noise, start, held=state.held)
    except (NoMotionError, np.linalg.LinAlgError):
        return None
    return fit if curve.believable(fit.value[len(bare.value) :]) else None
