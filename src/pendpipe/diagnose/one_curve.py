"""Several names, or one law that has none: a curve that does as well alone is preferred.

Two entries of the catalogue together bend far enough to follow many a law that is in none.
That both should be there by chance is improbable; that one unknown thing is, is not.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from pendpipe.arrays import FloatArray
from pendpipe.diagnose.detect import Lead
from pendpipe.diagnose.naming import Rival
from pendpipe.diagnose.progress import Progress
from pendpipe.diagnose.refine import Fit, refine
from pendpipe.diagnose.scores import build_bank
from pendpipe.diagnose.state import State, Step
from pendpipe.dynamics.any_law import NoMotionError
from pendpipe.effects.curve import Curve
from pendpipe.effects.curves import CURVES

_BETTER: Final = 40.0
"""By how much (in chi^2, two a free value counted) several names must be better than one
curve: each name is one of some forty (2 ln 40 = 7), and to need two at once is rare."""
_EACH: Final = 2.0


def prefer_one_curve(state: State, progress: Progress) -> None:
    """Put one curve in the place of several names, where it does as well."""
    names = [step for step in state.steps if step.winner.lead.effect.kind != "unnamed"]
    if len(names) < 2 or any(not step.winner.lead.effect.count for step in names):
        return
    bare = _bare(state)
    if bare is None:
        return
    found = [fit for curve in _curves(bare, state) for fit in [_drawn(bare, curve, state)] if fit]
    if not found:
        return
    best = min(found, key=_cost)
    if _cost(best) > _cost(state.fit) + _BETTER:
        return
    curve = best.model.effects[-1]
    progress(f"{curve.identifier} alone does as well as {len(names)} names")
    gain = bare.chi2 - best.chi2
    lead = Lead(curve, (), gain, 0.0)
    state.steps[:] = [Step((Rival(lead, best, gain, gain),), names[0].p_value, bare)]
    state.settle(best)


def _cost(fit: Fit) -> float:
    return fit.chi2 + _EACH * len(fit.free)


def _bare(state: State) -> Fit | None:
    """The baseline alone, as the readings and their noise are judged now."""
    model = state.fit.model.bare()
    try:
        return refine(model, state.data, state.noise, state.bare, held=state.holding)
    except (NoMotionError, np.linalg.LinAlgError):
        return None


def _curves(bare: Fit, state: State) -> list[Curve]:
    """The mixtures that the recording can see; a curve in time follows anything, and is none."""
    drawn = [curve(bare.at.span) for curve in CURVES if not curve.in_time]
    seen = build_bank(bare, state.noise, drawn).candidates
    return [candidate.effect for candidate in seen if isinstance(candidate.effect, Curve)]


def _drawn(bare: Fit, curve: Curve, state: State) -> Fit | None:
    start: FloatArray = np.concatenate([bare.value, np.zeros(curve.count)])
    try:
        return refine(bare.model.adding(curve), state.data, state.noise, start, held=state.holding)
    except (NoMotionError, np.linalg.LinAlgError):
        return None
