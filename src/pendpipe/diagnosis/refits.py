"""Refit the leading effects side by side, and rank them; stop those that can't come near."""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np
from scipy.special import chdtrc

from pendpipe.arrays import FloatArray
from pendpipe.diagnosis.data import Data
from pendpipe.diagnosis.detect import Detection, Lead
from pendpipe.diagnosis.evidence import Rival, Scale, class_width, equivalent, ranked
from pendpipe.diagnosis.gauss_newton import SETTLED
from pendpipe.diagnosis.noise import Noise
from pendpipe.diagnosis.refine import ROUNDS, Fit, Refining, pulled
from pendpipe.diagnosis.released_parameters import ReleasedParameter
from pendpipe.diagnosis.scores import finer_shape, scores_and_lengths
from pendpipe.dynamics.any_law import NoMotionError
from pendpipe.effects import Effect
from pendpipe.effects.effect import Sudden

NEAR: Final = 16.0
"""Twice the log-likelihood by which a lead may be behind the best and still win in the end."""
_BEHIND_CURVE: Final = 0.6
"""Part of a curve's gain by which a refit may end behind it, beyond `NEAR`, and matter: a name has
far fewer values."""
_BEHIND_NAMED: Final = 0.1
"""The same behind a named effect."""
_FIRST_ROUNDS: Final = 4
"""Rounds after which the refits are compared."""
_STALLED_GAIN: Final = 0.3
"""Fall of chi^2 in two rounds below which a refit stops (a winner is refined again)."""
_LARGEST_DISPLACEMENT: Final = 0.5
"""Largest displacement that an effect may add to the reading, over the first amplitude."""
_MOST_REFITTED: Final = 9
_MORE_AT_BOUND: Final = 3
"""More named effects to refit where a value at its bound lowers the scores."""
_SCORE_MARGIN: Final = 0.3
"""Part of the best score that a refit may catch up."""
_SCORE_MARGIN_AT_BOUND: Final = 0.6
"""The same where a value at its bound lowers the scores."""


def refit_leads(
    base: Fit,
    data: Data,
    noise: Noise,
    detection: Detection,
    *,
    held: Sequence[int],
    phase_lost: bool,
    most: int = _MOST_REFITTED,
) -> list[Rival]:
    """Refit the leading effects nonlinearly, and return them ranked, the best first."""
    scanned = _about_one_instant(base, noise, detection.leads)
    leads = _worth_refitting(scanned, phase_lost, most, wide=bool(pulled(base)))
    fits: list[tuple[Lead, Fit]] = []
    for lead, fit in side_by_side(base, data, noise, leads, held, phase_lost=phase_lost):
        if fit is not None and believable(base, fit, lead.effect):
            fits.append((lead, fit))
    if not fits:
        return []
    scale = Scale.of(min((fit for _, fit in fits), key=lambda fit: fit.chi2), data, noise)
    rivals = ranked([Rival.of(lead, fit, base.chi2, scale, detection.chance) for lead, fit in fits])
    return rivals if scale.clean else _names_first(rivals)


def _names_first(rivals: list[Rival]) -> list[Rival]:
    """Rank names that explain most of a misfit before curves, which may follow the rest.

    Where even the best leaves a misfit, names and curves will be needed together, and a curve that
    was drawn first would hide the names. What is not needed beside the curve is dropped again.
    Among names that the record can't distinguish the prior decides; then a law that acts throughout
    comes before an event, which takes a part of any misfit.
    """
    half = 0.5 * max(rival.gain for rival in rivals)
    best = max(rivals, key=lambda rival: -math.inf if rival.drawn else rival.evidence)
    near = best.evidence - class_width(best)

    def order(rival: Rival) -> tuple[bool, float, bool, float]:
        prior = rival.prior if rival.evidence > near else -math.inf
        return rival.drawn or rival.gain < half, -prior, rival.lead.effect.local, -rival.evidence

    return sorted(rivals, key=order)


def _about_one_instant(base: Fit, noise: Noise, leads: Sequence[Lead]) -> Sequence[Lead]:
    """Score all that is sudden again about the instant of the best lead, if that is sudden.

    A knock's score depends on its phase in the cycle, and the scan's instants lie farther apart.
    """
    best = max(leads, key=_rank, default=None)
    if best is None or not isinstance(best.effect, Sudden):
        return leads
    found = []
    for lead in leads:
        if isinstance(lead.effect, Sudden):
            shape = finer_shape(base, noise, lead.effect, best.shape)
            score = float(scores_and_lengths(base, noise, lead.effect, [shape])[0][0] ** 2)
            lead = replace(lead, shape=shape, score=score) if score > lead.score else lead
        found.append(lead)
    return found


def _worth_refitting(found: Sequence[Lead], phase_lost: bool, most: int, wide: bool) -> list[Lead]:
    """Return the leads that may win, or be in the winner's class.

    There are more (`wide`) where the base has a value at its bound: the score keeps it there,
    while a refit may release it and gain far more.
    """
    leads = sorted(found, key=lambda lead: -_rank(lead))
    if not leads:
        return []
    best = _rank(leads[0])
    part = 0.9 if phase_lost else _SCORE_MARGIN_AT_BOUND if wide else _SCORE_MARGIN
    near = [lead for lead in leads if _rank(lead) > best - NEAR - part * best]
    if phase_lost:
        near = near[: most + 2]
    else:
        # Curves lead in many misfits; they don't count in the number of named effects.
        names = [lead for lead in near if lead.effect.kind != "unnamed"]
        names = names[: most + _MORE_AT_BOUND if wide else most]
        near = [lead for lead in near if lead.effect.kind == "unnamed" or lead in names]
    # Always refitted: parameters that the user holds (few), and where the phase is lost bearing
    # friction and drag, which every pendulum has.
    asked = [
        lead
        for lead in leads
        if isinstance(lead.effect, ReleasedParameter) or (phase_lost and lead.effect.expected)
    ]
    return [*near, *(lead for lead in asked if lead not in near)]


def _rank(lead: Lead) -> float:
    """Return what a score is worth with the noise as it is, as the refits are ranked later."""
    local = float(chdtrc(max(lead.effect.sizes, 1), max(lead.score, 0.0)))
    return equivalent(local, lead.score) + lead.effect.prior


def side_by_side(
    base: Fit,
    data: Data,
    noise: Noise,
    leads: Sequence[Lead],
    held: Sequence[int],
    *,
    phase_lost: bool,
) -> list[tuple[Lead, Fit | None]]:
    """Refit each lead; None where that fails.

    Where the phase is lost all refits run to their end: an effect that explains a quarter may
    come first, and gains still grow while a scale is far off.
    """
    # The winner is refined again when the noise is estimated from its residual.
    little = SETTLED if phase_lost or data.time_noise else _STALLED_GAIN
    refits = [_started(base, data, noise, lead, held, little) for lead in leads]
    useful = math.inf if phase_lost else _limit(base, data, noise, leads, refits)
    return [
        (lead, _finished(refit, useful) if refit else None)
        for lead, refit in zip(leads, refits, strict=True)
    ]


def useful_chi2(best: float, gain: float, *, drawn: bool) -> float:
    """Return the largest chi^2 at which a rival still matters.

    Parameters
    ----------
    best, gain
        The best chi^2, and its gain over the model without the effect.
    drawn
        Whether the best is a curve.
    """
    return best + NEAR + (_BEHIND_CURVE if drawn else _BEHIND_NAMED) * max(gain, 0.0)


def believable(base: Fit, fit: Fit, effect: Effect) -> bool:
    """Whether the displacements that an effect adds are smaller than the motion itself.

    A second tone that is as large as the motion and has nearly its frequency describes a change
    of phase, not a second mode.
    """
    first = len(base.value) + effect.parameter_free
    own = fit.value[first:]
    if not effect.believable(own):
        return False
    span = base.at.span
    return effect.displacement(own, span.duration_s) < _LARGEST_DISPLACEMENT * span.first_amplitude


def _limit(
    base: Fit,
    data: Data,
    noise: Noise,
    leads: Sequence[Lead],
    refits: Sequence[Refining | None],
) -> float:
    """Return the largest useful chi^2, from the best credible refit so far."""
    found = [
        (refit, lead.effect.kind == "unnamed")
        for lead, refit in zip(leads, refits, strict=True)
        if refit and believable(base, refit.fit, lead.effect)
    ]
    if not found:
        return math.inf
    best = min((refit for refit, _ in found), key=lambda refit: refit.chi2)
    scale = Scale.of(best.fit, data, noise)
    if not scale.clean:
        return scale.within(NEAR)
    return min(
        useful_chi2(refit.chi2, base.chi2 - refit.chi2, drawn=drawn) for refit, drawn in found
    )


def _started(
    base: Fit, data: Data, noise: Noise, lead: Lead, held: Sequence[int], little: float
) -> Refining | None:
    """Start a lead's refit: its first rounds."""
    effect = lead.effect
    if isinstance(effect, ReleasedParameter):
        held = effect.without(held)
    start = np.concatenate(
        [base.value, _sizes(effect), finer_shape(base, noise, effect, lead.shape)]
    )
    try:
        model = base.model.adding(effect)
        refit = Refining(model, data, noise, start, held=held, little=little)
        refit.go(_FIRST_ROUNDS)
    except (NoMotionError, np.linalg.LinAlgError):
        return None
    return refit


def _sizes(effect: Effect) -> FloatArray:
    """Start sizes: 1 for an effect without a free size, else 0."""
    return np.ones(1) if effect.parameter_free else np.zeros(min(effect.sizes, effect.count))


def _finished(refit: Refining, useful: float) -> Fit | None:
    try:
        refit.go(ROUNDS - _FIRST_ROUNDS, useful)
    except (NoMotionError, np.linalg.LinAlgError):
        return None
    return refit.fit
