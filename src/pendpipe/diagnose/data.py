"""The readings that a diagnosis compares with its models."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from pendpipe.arrays import BoolArray, FloatArray

_DITHERS: Final = tuple(np.linspace(0.04, 0.5, 12))
"""Noise over step that is tried."""
_WORTH: Final = 12.0
_MOST_UNEVEN: Final = 3
"""Times `most`: how many uneven readings are taken."""
_LEAST_IN_A_CYCLE: Final = 24.0
"""Means of readings: the fifth harmonic loses 7 %, and the fundamental's loss is known."""


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
    noise_rms
        First estimate of one reading's noise.
    fold
        How many readings each is the mean of.
    lattice
        Where the rounding rules: a reading's remainder by the step, and the noise before
        the rounding (rad); None where noise makes the rounding random.
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
    noise_rms: float = 0.0
    fold: int = 1
    lattice: tuple[float, float] | None = None
    anchor: tuple[float, float] | None = None

    def __len__(self) -> int:
        return len(self.time_s)

    @property
    def used(self) -> int:
        """How many readings count."""
        return int(np.count_nonzero(self.weight))

    def residual(self, reading: FloatArray) -> FloatArray:
        """Return the readings minus what a model makes of them, rounding included."""
        if self.lattice is None:
            return self.values - reading
        origin, noise = self.lattice
        return self.values - reading - rounding_bias(reading - origin, self.step, noise)

    def first(self, count: int) -> Data:
        """The first `count` of them."""
        return replace(
            self,
            time_s=self.time_s[:count],
            values=self.values[:count],
            weight=self.weight[:count],
        )

    def masked(self, bad: BoolArray) -> Data:
        """The same without some readings."""
        return replace(self, weight=np.where(bad, 0.0, self.weight))


def rounding_bias(angle: FloatArray, step: float, noise_rms: float) -> FloatArray:
    """Return by how much rounding shifts the mean of a noisy reading, rad.

    round(x) - x is a sawtooth; Gaussian noise takes its harmonic k down by
    exp(-2 pi^2 k^2 (noise/step)^2) (Widrow).
    """
    total = np.zeros_like(angle)
    turn = 2.0 * np.pi * angle / step
    for harmonic in range(1, 9):
        left = np.exp(-2.0 * (np.pi * harmonic * noise_rms / step) ** 2)
        if left < 1e-4:
            break
        sign = -1.0 if harmonic % 2 else 1.0
        total += sign * step / (np.pi * harmonic) * left * np.sin(harmonic * turn)
    return total


def with_lattice(data: Data, reading: FloatArray) -> Data:
    """Find the noise before the rounding, where the rounding's bias is seen in the readings.

    This is not the noise that makes the codes likeliest (`analysis.fit.rounding.best_noise`):
    the model may still be wrong by a part of the step, which smears the bias as noise does.
    What counts is how much of the sawtooth is left in the residual, and whether it is worth
    taking off.

    Parameters
    ----------
    data
        The readings; their step must be known.
    reading
        A model of them that is good to a small part of the step.
    """
    if not data.step or data.time_noise:
        return data
    off = (data.values - reading)[data.weight > 0.0]
    if float(np.median(np.abs(off))) > 0.6 * data.step:
        return data
    turn = 2.0 * np.pi * data.values / data.step
    origin = float(np.angle(np.mean(np.exp(1j * turn)))) * data.step / (2.0 * np.pi)
    best, least = None, len(off) * float(np.log(np.mean(off**2))) - _WORTH
    for share in _DITHERS:
        bias = rounding_bias((reading - origin)[data.weight > 0.0], data.step, share * data.step)
        cost = len(off) * float(np.log(np.mean((off - bias) ** 2)))
        if cost < least:
            best, least = share, cost
    return replace(data, lattice=None if best is None else (origin, best * data.step))


def fast_length(count: int) -> int:
    """Return the largest length up to `count` that has no prime factor above 11."""
    while True:
        left = count
        for prime in (2, 3, 5, 7, 11):
            while left > 1 and left % prime == 0:
                left //= prime
        if left <= 1:
            return count
        count -= 1


def at_even_times(data: Data, time_s: FloatArray) -> Data:
    """The same readings at an even clock's times; evenly spaced where none is missing."""
    interval = float(np.median(np.diff(time_s)))
    even = bool(np.all(np.abs(np.diff(time_s) - interval) < 1e-3 * interval))
    moved = replace(data, time_s=time_s, interval_s=interval, uniform=even)
    return moved.first(fast_length(len(data))) if even else moved


def gather(
    time_s: FloatArray,
    values: FloatArray,
    *,
    step: float | None,
    unit: str,
    counts: bool,
    period_s: float,
    noise_rms: float,
    most: int = 4000,
) -> Data:
    """Take the readings, in means of several where there are very many in a cycle.

    A mean over m readings keeps what is slower than it; 24 in a cycle are left at least.
    What it takes off the fundamental, the model's readings lose as well (`Model.fold`).
    """
    intervals = np.diff(time_s)
    interval = float(np.median(intervals))
    uniform = bool(np.all(np.abs(intervals - interval) < 0.02 * interval)) and not counts
    fold = 1
    if uniform and len(time_s) > most:
        fold = max(1, int(min(len(time_s) // most + 1, period_s / interval / _LEAST_IN_A_CYCLE)))
    if fold > 1:
        whole = len(time_s) // fold * fold
        time_s = time_s[:whole].reshape(-1, fold).mean(axis=1)
        values = values[:whole].reshape(-1, fold).mean(axis=1)
        interval *= fold
    if uniform:
        # The whitening's transforms are ten times slower where the length has a large prime.
        time_s, values = time_s[: fast_length(len(time_s))], values[: fast_length(len(values))]
    elif len(time_s) > _MOST_UNEVEN * most:
        # Means of uneven readings would be means of uneven phases: every k-th is taken.
        keep = slice(None, None, len(time_s) // (_MOST_UNEVEN * most) + 1)
        time_s, values = time_s[keep], values[keep]
    return Data(
        time_s,
        values,
        interval,
        uniform,
        np.ones(len(time_s)),
        (step or 0.0) if fold == 1 else 0.0,
        unit,
        counts,
        noise_rms / fold**0.5,
        fold=fold,
    )
