"""Fit a model whose start is far from the readings, in a progressively longer window.

Over a whole record at large amplitude the phase of a wrong start is off by many turns, too far
for Gauss-Newton steps. Over the first cycles it is not: the model is fitted there, then over
more and more of the record, each time from the last result.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final

import numpy as np

from pendpipe.arrays import FloatArray
from pendpipe.diagnosis.data import Data
from pendpipe.diagnosis.noise import Noise, white_noise
from pendpipe.diagnosis.refine import Fit, refine
from pendpipe.dynamics.any_law import NoMotionError
from pendpipe.effects.baseline import OMEGA
from pendpipe.effects.model import Model

_FIRST_CYCLES: Final = 4
"""Cycles in the first window."""
_FEWEST_READINGS: Final = 24
_GROWTH: Final = 1.6
_ROUNDS: Final = 8


def fit_in_growing_window(
    model: Model, data: Data, noise: Noise, start: FloatArray, *, held: Iterable[int] = ()
) -> Fit | None:
    """Fit the first part of a record, then more and more of it, then all.

    Parameters
    ----------
    model
        The baseline with effects.
    data, noise
        All readings, and their noise.
    start
        Values that hold for the first cycles at least (from turning points).
    held
        Indices of values that are not fitted.

    Returns
    -------
    Fit or None
        None where the model has no such motion.
    """
    value, fixed = start, tuple(held)
    cycle = 2.0 * np.pi / value[OMEGA] / data.interval_s
    count = max(int(_FIRST_CYCLES * cycle), _FEWEST_READINGS)
    try:
        while count < len(data):
            part = data.first(count)
            short, white = model.at_times(part.time_s), white_noise(part, noise.white_rms)
            value = refine(short, part, white, value, held=fixed, rounds=_ROUNDS).value
            count = int(_GROWTH * count) + 1
        return refine(model, data, noise, value, held=fixed)
    except (NoMotionError, np.linalg.LinAlgError):
        return None
