"""The refits of all leads side by side: none is followed that can't come near the best."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

import numpy as np

from pendpipe.arrays import FloatArray
from pendpipe.diagnose.data import Data
from pendpipe.diagnose.detect import Lead
from pendpipe.diagnose.gauss_newton import SETTLED
from pendpipe.diagnose.noise import Noise
from pendpipe.diagnose.refine import ROUNDS, Fit, Refining
from pendpipe.diagnose.released_parameters import ReleasedParameter
from pendpipe.diagnose.scores import finer_shape
from pendpipe.dynamics.any_law import NoMotionError
from pendpipe.effects import Effect

NEAR: Final = 16.0
"""By how much of twice the log-likelihood one may be behind the best, and win in the end."""
OF_A_CURVE: Final = 0.4
"""Part of a curve's gain that a name must explain by itself to be asked beside another."""
_BEHIND: Final = 0.1
"""Part of a name's gain by which a refit may end behind it, with `NEAR`, and be of use."""
_FIRST_ROUNDS: Final = 4
"""After how many the refits are compared."""
_LITTLE: Final = 0.3
"""Of chi^2: what two rounds must gain for a refit to go on that is refined again if it wins."""
_LARGEST: Final = 0.5
"""Of the first amplitude: what an effect may add to the reading."""


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

    In a gross misfit, where what explains a quarter may come first, and gains grow while a
    scale is still far off, all are followed to their ends.
    """
    # The winner is refined once more where the noise is judged by what it leaves.
    little = SETTLED if gross or data.time_noise else _LITTLE
    refits = [_begun(base, data, noise, lead, held, little) for lead in leads]
    of_use = math.inf if gross else _limit(base, leads, refits)
    return [
        (lead, _ended(refit, of_use) if refit else None)
        for lead, refit in zip(leads, refits, strict=True)
    ]


def limit_of_use(best: float, gain: float, *, drawn: bool) -> float:
    """Return up to which chi^2 a rival is of use.

    Parameters
    ----------
    best, gain
        The best's chi^2, and by how much that is lower than without it.
    drawn
        Whether the best is a curve: two names may take its place, and a name that has far fewer
        values is as good with a smaller gain.
    """
    return best + NEAR + (1.0 - OF_A_CURVE if drawn else _BEHIND) * max(gain, 0.0)


def believable(base: Fit, fit: Fit, effect: Effect) -> bool:
    """Whether displacements that an effect adds are smaller than the motion itself.

    Two tones of nearly one frequency can take each other's place: a second that is as large
    as the first describes a change of phase, and no second mode.
    """
    first = len(base.value) + effect.parameter_free
    own = fit.value[first:]
    if not effect.believable(own):
        return False
    span = base.at.span
    return effect.displacement(own, span.duration_s) < _LARGEST * span.first_amplitude


def _limit(base: Fit, leads: Sequence[Lead], refits: Sequence[Refining | None]) -> float:
    """The largest chi^2 of use, by the best that may be believed so far."""
    best = [
        limit_of_use(refit.chi2, base.chi2 - refit.chi2, drawn=lead.effect.kind == "unnamed")
        for lead, refit in zip(leads, refits, strict=True)
        if refit and believable(base, refit.fit, lead.effect)
    ]
    return min(best, default=math.inf)


def _begun(
    base: Fit, data: Data, noise: Noise, lead: Lead, held: Sequence[int], little: float
) -> Refining | None:
    """The first rounds of a lead's refit."""
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
    """A switch that is on, or sizes of nothing."""
    return np.ones(1) if effect.parameter_free else np.zeros(min(effect.sizes, effect.count))


def _ended(refit: Refining, of_use: float) -> Fit | None:
    try:
        refit.go(ROUNDS - _FIRST_ROUNDS, of_use)
    except (NoMotionError, np.linalg.LinAlgError):
        return None
    return refit.fit
