"""Values of a model that is far from the readings, from a window that grows.

Over a whole record at large amplitude the phase of a wrong start is off by many turns, and no
step of Gauss and Newton finds back. Over the first cycles it is not: there the model is
fitted, then over more and more of the record, each time from where the last one ended.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final

import numpy as np

from pendpipe.arrays import FloatArray
from pendpipe.diagnose.data import Data
from pendpipe.diagnose.noise import white_noise
from pendpipe.diagnose.refine import refine
from pendpipe.effects.baseline import OMEGA
from pendpipe.effects.model import Model

_FIRST: Final = 4
"""Cycles of the first window."""
_GROWTH: Final = 1.6
_CLOSER: Final = 1.1
"""Where much of the record is known."""
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
    """Fit the beginning of a record, then more and more of it.

    Parameters
    ----------
    model
        The baseline with effects.
    data
        All readings.
    noise_rms
        Standard deviation of one.
    start
        Values that are right for the first cycles at least (from turning points).
    held
        Indices of what is not fitted.
    first
        How many readings the start values are right for, if known.

    Returns
    -------
    FloatArray
        Values from which the whole record can be fitted, shape (size,).

    Raises
    ------
    NoMotionError
        If the model can't be evaluated over the first cycles.
    """
    value = np.asarray(start, dtype=np.float64)
    fixed = tuple(held)
    count = first or int(_FIRST * 2.0 * np.pi / value[OMEGA] / data.interval_s)
    growth = _GROWTH if first is None else _CLOSER
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
