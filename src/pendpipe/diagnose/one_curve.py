"""Several names, or one law that has none: a curve that does as well alone is preferred.

Two entries of the catalogue together bend far enough to follow many a law that is in none.
That both should be there by chance is improbable; that one unknown thing is, is not.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from pendpipe.arrays import FloatArray
from pendpipe.diagnose.chance import Chance, Trials
from pendpipe.diagnose.detect import Lead
from pendpipe.diagnose.evidence import Rival, evidence, form_spread, needed_sizes, ranked
from pendpipe.diagnose.progress import Progress
from pendpipe.diagnose.refine import Fit, refine
from pendpipe.diagnose.scores import build_bank
from pendpipe.diagnose.state import State, Step
from pendpipe.dynamics.any_law import NoMotionError
from pendpipe.effects.closer_curves import CLOSER_CURVES
from pendpipe.effects.curve import Curve
from pendpipe.effects.curves import CURVES

_BETTER: Final = 40.0
"""By how much (in chi^2, two a free value counted) several names must be better than one
curve: each name is one of some forty (2 ln 40 = 7), and to need two at once is rare."""
_EACH: Final = 2.0
_NO_SCAN: Final = Chance(Trials(1.0, 0.0), {})
"""A curve has no shapes to try."""


def prefer_one_curve(state: State, progress: Progress) -> None:
    """Put one curve in the place of several names, where it does as well."""
    names = [step for step in state.steps if step.winner.lead.effect.kind != "unnamed"]
    if len(names) < 2 or any(not step.winner.lead.effect.count for step in names):
        return
    bare = _bare(state)
    if bare is None:
        return
    fits = [fit for curve in _curves(bare, state) for fit in [_drawn(bare, curve, state)] if fit]
    if not fits:
        return
    rivals = ranked([_rival(bare, fit) for fit in fits])
    best = rivals[0]
    if _cost(best.fit) > _cost(state.fit) + math.hypot(_BETTER, form_spread(best)):
        return
    progress(f"{best.identifier} alone does as well as {len(names)} names")
    state.steps[:] = [Step(tuple(rivals), names[0].p_value, bare)]
    state.settle(best.fit)


def _rival(bare: Fit, fit: Fit) -> Rival:
    curve = fit.model.effects[-1]
    gain = bare.chi2 - fit.chi2
    lead = Lead(curve, (), gain, 0.0)
    return Rival(lead, fit, gain, evidence(lead, gain, _NO_SCAN, needed_sizes(fit, curve)))


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
    drawn = [curve(bare.at.span) for curve in (*CURVES, *CLOSER_CURVES) if not curve.in_time]
    seen = build_bank(bare, state.noise, drawn).candidates
    return [candidate.effect for candidate in seen if isinstance(candidate.effect, Curve)]


def _drawn(bare: Fit, curve: Curve, state: State) -> Fit | None:
    start: FloatArray = np.concatenate([bare.value, np.zeros(curve.count)])
    try:
        fit = refine(bare.model.adding(curve), state.data, state.noise, start, held=state.holding)
    except (NoMotionError, np.linalg.LinAlgError):
        return None
    return fit if curve.believable(fit.value[len(bare.value) :]) else None
