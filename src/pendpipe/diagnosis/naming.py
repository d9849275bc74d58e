"""Naming: refit the leading effects, and rank them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from pendpipe.arrays import FloatArray
from pendpipe.diagnosis.data import Data
from pendpipe.diagnosis.detect import Detection, Lead
from pendpipe.diagnosis.evidence import (
    Rival,
    equivalent,
    evidence,
    ranked,
)
from pendpipe.diagnosis.noise import Noise
from pendpipe.diagnosis.progressive_window import progressive_start
from pendpipe.diagnosis.refine import Fit, pulled, refine
from pendpipe.diagnosis.refits import NEAR, believable, side_by_side
from pendpipe.diagnosis.released_parameters import ReleasedParameter
from pendpipe.dynamics.any_law import NoMotionError

_MOST_REFITTED: Final = 9
_MORE_AT_BOUND: Final = 3
"""More named effects to refit where a value at its bound lowers the scores."""
_SCORE_MARGIN: Final = 0.3
"""Part of the best score that a refit may catch up."""
_SCORE_MARGIN_AT_BOUND: Final = 0.6
"""The same where a value at its bound lowers the scores."""
_EQUAL_GAIN: Final = 0.98
_LOST_PHASE_RAD: Final = 1.0
"""Phase error in rad from which a model has lost the motion."""
_FROM_FIRST_CYCLES: Final = 4
"""Leads that are then refitted from the first cycles on."""
_NAMED_SHARE: Final = 0.5
"""Part of the best gain from which a named effect precedes a curve."""
_EXPECTED_SHARE: Final = 0.25
"""The same for effects that every pendulum has."""


def refit_leads(
    base: Fit,
    data: Data,
    noise: Noise,
    detection: Detection,
    *,
    held: Sequence[int],
    gross: bool,
    origin: FloatArray,
    most: int = _MOST_REFITTED,
) -> list[Rival]:
    """Refit the leading effects nonlinearly, and return them ranked, the best first."""
    leads = _worth_refitting(detection, gross, most, wide=bool(pulled(base)))
    fits: list[tuple[Lead, Fit]] = []
    for lead, fit in side_by_side(base, data, noise, leads, held, gross=gross):
        lost = base.max_phase_error_rad > _LOST_PHASE_RAD and len(fits) < _FROM_FIRST_CYCLES
        # With the baseline's friction the motion may stop before the end.
        if lost or (gross and fit is None):
            fit = _better(fit, _from_first_cycles(base, data, noise, lead, held, origin))
        if fit is not None and believable(base, fit, lead.effect):
            fits.append((lead, fit))
    if not fits:
        return []
    # A remaining misfit makes differences of chi^2 mean less.
    left = max(min(fit.chi2 for _, fit in fits) / max(data.used, 1), 1.0)
    rivals = []
    for lead, fit in fits:
        gain = base.chi2 - fit.chi2
        worth = evidence(lead, fit, gain / left, detection.chance)
        rivals.append(Rival(lead, fit, gain, worth, left))
    return _named_first(rivals) if gross else ranked(rivals)


def _named_first(rivals: list[Rival]) -> list[Rival]:
    """In a gross misfit, rank named effects that explain much of it before curves."""
    rivals = sorted(rivals, key=lambda rival: -rival.evidence)
    best = max(rival.gain for rival in rivals)
    named = [
        rival
        for rival in rivals
        if rival.lead.effect.kind != "unnamed"
        and rival.gain > (_EXPECTED_SHARE if rival.lead.effect.expected else _NAMED_SHARE) * best
    ]
    # A higher prior precedes a marginally better fit.
    near = _EQUAL_GAIN * max((rival.gain for rival in named), default=0.0)
    named.sort(key=lambda rival: (0, -rival.prior) if rival.gain > near else (1, 0.0))
    # Bearing friction and drag are always present: other effects are tested beside them.
    named.sort(key=lambda rival: not rival.lead.effect.expected)
    return [*named, *(rival for rival in rivals if rival not in named)]


def _worth_refitting(detection: Detection, gross: bool, most: int, wide: bool) -> list[Lead]:
    """Return the leads that may win, or be in the winner's class.

    There are more (`wide`) where the base has a value at its bound: the score keeps it there,
    while a refit may release it and gain far more.
    """
    leads = sorted(detection.leads, key=lambda lead: -_rank(lead))
    if not leads:
        return []
    best = _rank(leads[0])
    part = 0.9 if gross else _SCORE_MARGIN_AT_BOUND if wide else _SCORE_MARGIN
    near = [lead for lead in leads if _rank(lead) > best - NEAR - part * best]
    if gross:
        near = near[: most + 2]
    else:
        # Curves lead in many misfits; they don't count in the number of named effects.
        names = [lead for lead in near if lead.effect.kind != "unnamed"]
        names = names[: most + _MORE_AT_BOUND if wide else most]
        near = [lead for lead in near if lead.effect.kind == "unnamed" or lead in names]
    # Always refitted: parameters that the user holds (few), and in a gross misfit bearing friction
    # and drag, which every pendulum has.
    asked = [
        lead
        for lead in leads
        if isinstance(lead.effect, ReleasedParameter) or (gross and lead.effect.expected)
    ]
    return [*near, *(lead for lead in asked if lead not in near)]


def _rank(lead: Lead) -> float:
    return equivalent(lead.p_value, lead.score) + lead.effect.prior


def _from_first_cycles(
    base: Fit, data: Data, noise: Noise, lead: Lead, held: Sequence[int], origin: FloatArray
) -> Fit | None:
    """Refit in a progressive window where the base has lost the phase."""
    effect = lead.effect
    if isinstance(effect, ReleasedParameter) or effect.kind == "unnamed":
        return None
    sizes = np.ones(1) if effect.parameter_free else np.zeros(effect.sizes)
    known = base.value[len(origin) :]
    start = np.concatenate([origin, known, sizes, np.asarray(lead.shape, dtype=np.float64)])
    model = base.model.adding(effect)
    try:
        value = progressive_start(model, data, noise.white_rms, start, held=held)
        return refine(model, data, noise, value, held=held)
    except (NoMotionError, np.linalg.LinAlgError):
        return None


def _better(one: Fit | None, other: Fit | None) -> Fit | None:
    if one is None or other is None:
        return one or other
    return one if one.chi2 <= other.chi2 else other
