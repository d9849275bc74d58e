"""Several names, or one law that has none: a curve that does as well alone is preferred.

Two entries of the catalogue together bend far enough to follow many a law that is in none.
That both should be there by chance is improbable; that one unknown thing is, is not.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

import numpy as np

from pendpipe.arrays import FloatArray
from pendpipe.diagnose import Progress
from pendpipe.diagnose.detect import Lead
from pendpipe.diagnose.evidence import MISSHAPEN, NO_SCAN, Rival, evidence, ranked
from pendpipe.diagnose.refine import Fit, refine
from pendpipe.diagnose.review import stands_apart
from pendpipe.diagnose.scores import build_bank
from pendpipe.diagnose.state import State, Step
from pendpipe.dynamics.any_law import NoMotionError
from pendpipe.effects.curves import CURVES, FOLLOW_UP_CURVES, Curve

BETTER: Final = 22.0
"""By how much (in chi^2, two a free value counted) two names must be better than one curve: each
is one of some forty (2 ln 40 = 7.4), and to need two at once is as rare."""
_KNOTS: Final = 0.012
"""Part of a curve's gain that it may miss between its knots: of laws that are in no catalogue
the best curve missed a hundredth at most (development recordings, opened challenges)."""
_PART: Final = 0.5
"""Of its gain beside other names: what something sudden must keep beside a curve."""
_EACH: Final = 2.0
_REST: Final = 1e-4
"""Part of the gain that further names must add to be more than a correction of the first."""


def prefer_one_curve(state: State, progress: Progress) -> None:
    """Put one curve in the place of several names, where it does as well.

    What every pendulum has, and a line of its own in the spectrum that is more than what a curve
    leaves, stay where they are, and so does what happened at an instant and is as needed beside
    the curve; and a name to which the others add next to nothing is not one of several.
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
    bare = _bare(state, kept)
    if bare is None:
        return
    fits = [fit for curve in _curves(bare, state) for fit in [_drawn(bare, curve, state)] if fit]
    if not fits:
        return
    rivals = ranked([_rival(bare, fit) for fit in fits])
    best = rivals[0]
    if cost(best.fit) > cost(state.fit) + math.hypot(BETTER, _misses(names) * best.gain):
        return
    sudden = [step for step in names if _lasts(step, best.fit, state)]
    if sudden:
        _prefer(state, [*kept, *sudden], progress)
        return
    progress(f"{best.identifier} alone does as well as {len(names)} names")
    state.steps[:] = [*kept, Step(tuple(rivals), names[0].p_value, bare)]
    state.settle(best.fit)


def _lasts(step: Step, drawn: Fit, state: State) -> bool:
    """Whether what happened at an instant is needed beside a curve, which has no instants."""
    effect = step.winner.lead.effect
    if not effect.local:
        return False
    place = next(place for other, place in state.fit.model.places() if other is effect)
    start = np.concatenate([drawn.value, state.fit.value[place]])
    try:
        both = refine(
            drawn.model.adding(effect), state.data, state.noise, start, held=state.holding
        )
    except (NoMotionError, np.linalg.LinAlgError):
        return False
    return cost(drawn) - cost(both) > max(BETTER, _PART * step.winner.gain)


def _stays(step: Step, state: State, left: float) -> bool:
    effect = step.winner.lead.effect
    if effect.expected:
        return True
    return stands_apart(effect, state.fit) and step.winner.gain > left


def _one_alone(names: Sequence[Step]) -> bool:
    """Whether one name explains so much that the others may be its own form."""
    gains = [step.winner.gain for step in names]
    return sum(gains) - max(gains) < _REST * sum(gains)


def _misses(names: Sequence[Step]) -> float:
    """Part of its gain by which a curve may fall short of names and still be preferred.

    Where all names but one add no more than the form of a real law may differ from the
    catalogue's, they may be corrections of one wrong name.
    """
    gains = [step.winner.gain for step in names]
    return _KNOTS if sum(gains) - max(gains) > MISSHAPEN * sum(gains) else MISSHAPEN


def _rival(bare: Fit, fit: Fit) -> Rival:
    curve = fit.model.effects[-1]
    gain = bare.chi2 - fit.chi2
    lead = Lead(curve, (), gain, 0.0)
    return Rival(lead, fit, gain, evidence(lead, fit, gain, NO_SCAN))


def cost(fit: Fit) -> float:
    """Return chi^2, with two for each free value (Akaike)."""
    return fit.chi2 + _EACH * len(fit.free)


def _bare(state: State, kept: Sequence[Step]) -> Fit | None:
    """The baseline and what is kept, as the readings and their noise are judged now."""
    model, value = state.fit.model, state.fit.value
    for step in state.steps:
        if step not in kept:
            model, value = model.dropping(step.winner.lead.effect, value)
    start = np.concatenate([state.bare, value[len(state.bare) :]])
    try:
        return refine(model, state.data, state.noise, start, held=state.holding)
    except (NoMotionError, np.linalg.LinAlgError):
        return None


def _curves(bare: Fit, state: State) -> list[Curve]:
    """The mixtures that the recording can see; a curve in time follows anything, and is none."""
    drawn = [curve(bare.at.span) for curve in (*CURVES, *FOLLOW_UP_CURVES) if not curve.in_time]
    seen = build_bank(bare, state.noise, drawn).candidates
    return [candidate.effect for candidate in seen if isinstance(candidate.effect, Curve)]


def _drawn(bare: Fit, curve: Curve, state: State) -> Fit | None:
    start: FloatArray = np.concatenate([bare.value, np.zeros(curve.count)])
    try:
        fit = refine(bare.model.adding(curve), state.data, state.noise, start, held=state.holding)
    except (NoMotionError, np.linalg.LinAlgError):
        return None
    return fit if curve.believable(fit.value[len(bare.value) :]) else None
