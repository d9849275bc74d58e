"""The readings that a diagnosis compares with its models."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pendpipe.arrays import BoolArray, FloatArray


@dataclass(frozen=True)
class Data:
    """Readings of one free decay.

    Parameters
    ----------
    time_s, values
        Shape (n,), times rising, values in rad (or m).
    interval_s
        Between neighbouring readings, usually.
    uniform
        Whether they are evenly spaced, so that noise can have a colour.
    weight
        1 where a reading counts, 0 where it is masked; shape (n,).
    step
        Of the readings; 0 where there is none.
    unit
        ``"rad"`` or ``"m"``.
    time_noise
        Whether the error is in the times (an encoder's counts).
    anchor
        A time in s near the beginning, and the phase of the readings then: so that whole
        turns are counted alike whatever the model.
    """

    time_s: FloatArray
    values: FloatArray
    interval_s: float
    uniform: bool
    weight: FloatArray
    step: float = 0.0
    unit: str = "rad"
    time_noise: bool = False
    anchor: tuple[float, float] | None = None

    def __len__(self) -> int:
        return len(self.time_s)

    @property
    def used(self) -> int:
        """How many readings count."""
        return int(np.count_nonzero(self.weight))

    def masked(self, bad: BoolArray) -> Data:
        """The same without some readings."""
        return replace(self, weight=np.where(bad, 0.0, self.weight))


def gather(
    time_s: FloatArray, values: FloatArray, *, step: float | None, unit: str, counts: bool,
    period_s: float, most: int = 8000,
) -> Data:  # fmt: skip
    """Take the readings, in means of several where there are very many in a cycle.

    A mean over m readings keeps what is slower than it; 48 in a cycle are left at least, so
    that the fifth harmonic loses less than 1 %, and the model's readings are not averaged.
    """
    intervals = np.diff(time_s)
    interval = float(np.median(intervals))
    uniform = bool(np.all(np.abs(intervals - interval) < 0.02 * interval)) and not counts
    fold = 1
    if uniform and len(time_s) > most:
        fold = max(1, int(min(len(time_s) // most + 1, period_s / interval / 48.0)))
    if fold > 1:
        whole = len(time_s) // fold * fold
        time_s = time_s[:whole].reshape(-1, fold).mean(axis=1)
        values = values[:whole].reshape(-1, fold).mean(axis=1)
        interval *= fold
    return Data(
        time_s, values, interval, uniform, np.ones(len(time_s)), (step or 0.0) / fold**0.5, unit,
        counts,
    )  # fmt: skip
