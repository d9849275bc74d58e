"""Start values for a model far from the readings, fitted in a progressively longer window.

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
from pendpipe.diagnosis.noise import white_noise
from pendpipe.diagnosis.refine import refine
from pendpipe.effects.baseline import OMEGA
from pendpipe.effects.model import Model

_FIRST_CYCLES: Final = 4
"""Cycles in the first window."""
_FEWEST_READINGS: Final = 24
_GROWTH: Final = 1.6
_SLOW_GROWTH: Final = 1.1
"""Growth of the window where much of the record is fitted already."""
_ROUNDS: Final = 8


def progressive_start(
    model: Model,
    data: Data,
    noise_rms: float,
    start: FloatArray,
    *,
    held: Iterable[int] = (),
    first: int | None = None,
) -> FloatArray:
    """Fit the first part of a record, then more and more of it.

    Parameters
    ----------
    model
        The baseline with effects.
    data
        All readings.
    noise_rms
        Standard deviation of one reading.
    start
        Values that hold for the first cycles at least (from turning points).
    held
        Indices of values that are not fitted.
    first
        How many readings the start values hold for, if known.

    Returns
    -------
    FloatArray
        Start values for a fit of the whole record, shape (size,).

    Raises
    ------
    NoMotionError
        If the model can't be evaluated over the first cycles.
    """
    value = np.asarray(start, dtype=np.float64)
    fixed = tuple(held)
    cycle = 2.0 * np.pi / value[OMEGA] / data.interval_s
    count = first or max(int(_FIRST_CYCLES * cycle), _FEWEST_READINGS)
    growth = _GROWTH if first is None else _SLOW_GROWTH
    if first is not None:
        count = int(growth * count)
    while count < len(data):
        part = data.first(count)
        short = model.at_times(part.time_s)
        value = refine(
            short, part, white_noise(part, noise_rms), value, held=fixed, rounds=_ROUNDS
        ).value
        count = int(growth * count) + 1
    return value
