"""Refit all leads side by side, and stop those that can't come near the best."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

import numpy as np

from pendpipe.arrays import FloatArray
from pendpipe.diagnosis.data import Data
from pendpipe.diagnosis.detect import Lead
from pendpipe.diagnosis.gauss_newton import SETTLED
from pendpipe.diagnosis.noise import Noise
from pendpipe.diagnosis.refine import ROUNDS, Fit, Refining
from pendpipe.diagnosis.released_parameters import ReleasedParameter
from pendpipe.diagnosis.scores import finer_shape
from pendpipe.dynamics.any_law import NoMotionError
from pendpipe.effects import Effect

NEAR: Final = 16.0
"""Twice the log-likelihood by which a lead may be behind the best and still win in the end."""
OF_A_CURVE: Final = 0.4
"""Part of a curve's gain that a named effect must explain alone to be tried with a second."""
_BEHIND_NAMED: Final = 0.1
"""Part of a named effect's gain by which a refit may end behind it, beyond `NEAR`, and matter."""
_FIRST_ROUNDS: Final = 4
"""Rounds after which the refits are compared."""
_STALLED_GAIN: Final = 0.3
"""Fall of chi^2 in two rounds below which a refit stops (a winner is refined again)."""
_LARGEST_DISPLACEMENT: Final = 0.5
"""Largest displacement that an effect may add to the reading, over the first amplitude."""


def side_by_side(
    base: Fit,
    data: Data,
    noise: Noise,
    leads: Sequence[Lead],
    held: Sequence[int],
    *,
    gross: bool,
) -> list[tuple[Lead, Fit | None]]:
    """Refit each lead; None where that fails.

    In a gross misfit all refits run to their end: an effect that explains a quarter may come
    first, and gains still grow while a scale is far off.
    """
    # The winner is refined again when the noise is estimated from its residual.
    little = SETTLED if gross or data.time_noise else _STALLED_GAIN
    refits = [_started(base, data, noise, lead, held, little) for lead in leads]
    useful = math.inf if gross else _limit(base, leads, refits)
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
        Whether the best is a curve: two named effects may replace it, and one with far fewer
        values is as good with a smaller gain.
    """
    return best + NEAR + (1.0 - OF_A_CURVE if drawn else _BEHIND_NAMED) * max(gain, 0.0)


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


def _limit(base: Fit, leads: Sequence[Lead], refits: Sequence[Refining | None]) -> float:
    """Return the largest useful chi^2, from the best credible refit so far."""
    best = [
        useful_chi2(refit.chi2, base.chi2 - refit.chi2, drawn=lead.effect.kind == "unnamed")
        for lead, refit in zip(leads, refits, strict=True)
        if refit and believable(base, refit.fit, lead.effect)
    ]
    return min(best, default=math.inf)


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
