"""When samples were lost: between two readings, where a fit stays on the wrong side of one.

Behind lost samples a reading is so far off that it passes the turning point: how far the jump
reaches into the reading beside it has several solutions, and Gauss and Newton find the nearest.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final

import numpy as np

from pendpipe.arrays import FloatArray
from pendpipe.diagnose.data import Data
from pendpipe.diagnose.noise import Noise
from pendpipe.diagnose.refine import Fit, misfit, refine
from pendpipe.dynamics.any_law import NoMotionError
from pendpipe.effects.time_base import DroppedSamples

_WIDTHS: Final = (2.0, 0.125)
"""How far about an instant is looked, in intervals between readings: then again, closer."""
_SHIFTS: Final = np.linspace(-1.0, 1.0, 33)
_WORTH: Final = 1.0
"""By how much chi^2 must be lower beside an instant, for the fit to go on from there."""


def with_better_instants(fit: Fit, data: Data, noise: Noise, held: Iterable[int]) -> Fit:
    """Try the instants about each loss of samples, and refine from the best.

    Parameters
    ----------
    fit
        A model at its best values, as far as a fit went.
    data, noise
        The readings.
    held
        Indices of what is not fitted.
    """
    fixed = tuple(held)
    for effect, place in fit.model.places():
        if not isinstance(effect, DroppedSamples):
            continue  # others change little from one reading to the next
        for width in _WIDTHS:
            start = _best_beside(fit, data, noise, place.stop - 1, width * data.interval_s)
            if start is None:
                continue
            better = refine(fit.model, data, noise, start, held=fixed)
            fit = better if better.chi2 < fit.chi2 else fit
    return fit


def _best_beside(
    fit: Fit, data: Data, noise: Noise, instant: int, width_s: float
) -> FloatArray | None:
    """The values with one instant moved to where chi^2 is least; None where it stays."""
    least, best = fit.chi2 - _WORTH, None
    for shift in _SHIFTS:
        value = fit.value.copy()
        value[instant] += shift * width_s
        try:
            there = misfit(fit.model, data, noise, value)
        except NoMotionError:
            continue
        if there < least:
            least, best = there, value
    return best
