"""The readings that a diagnosis compares with its models."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.polynomial import Polynomial
from scipy.fft import prev_fast_len
from scipy.special import ndtr

from pendpipe.analysis.noise import before_rounding, scatter
from pendpipe.analysis.turning_points.measure import Samples
from pendpipe.arrays import BoolArray, FloatArray, IntArray

_NEEDED_GAIN: Final = 12.0
"""Twice the log-likelihood by which a lattice must explain more: of its two numbers chance
gives it once in 400."""
_UNEVEN: Final = 0.02
"""Part of an interval by which evenly spaced readings may be off."""
_MOST_MEANS: Final = 64_000
"""Means that are kept at most where their noise is less than what averaging leaves."""
_MOST_UNEVEN: Final = 2
"""Largest number of unevenly spaced readings, over `most`."""
_FEWEST_IN_CYCLE: Final = 24.0
"""Fewest means in a cycle: the fifth harmonic loses 7 %; the loss of the fundamental is known."""


@dataclass(frozen=True)
class Data:
    """Readings of one free decay.

    Parameters
    ----------
    time_s, values
        Shape (n,), times rising, values in rad (or m).
    interval_s
        Median interval of neighbouring readings.
    uniform
        Whether they are evenly spaced, so that the noise may be coloured.
    weight
        1 where a reading counts, 0 where it is masked; shape (n,).
    step
        Of the readings; 0 if they have none.
    unit
        ``"rad"`` or ``"m"``.
    time_noise
        Whether the error is in the times (an encoder's counts).
    noise_rms
        First estimate of one reading's noise.
    fold
        Number of original readings in each mean.
    lattice
        The mean rounding error of each reading, rad, shape (n,): of a model that was fitted before,
        so that chi^2 stays that of numbers that are linear in the motion. None if noise makes
        rounding errors random.
    anchor
        A time in s near the beginning, and the phase of the readings then, so that whole turns
        are counted the same way for every model.
    row, every
        Of the first reading in the recording, and of how many recorded readings each is one where
        the others are left out.
    within_rms
        How much the readings of each mean scatter about it, less the motion, over all of them.
    turn_s
        When the first turning point kept is, s: its amplitude is that of the decay.
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
    lattice: FloatArray | None = None
    anchor: tuple[float, float] | None = None
    row: int = 0
    every: int = 1
    within_rms: float = 0.0
    turn_s: float = -math.inf

    def __len__(self) -> int:
        return len(self.time_s)

    @property
    def used(self) -> int:
        """Number of readings that count."""
        return int(np.count_nonzero(self.weight))

    @property
    def rows(self) -> IntArray:
        """The rows of the recording that each reading stands for, shape (n, fold)."""
        first = self.row + self.fold * self.every * np.arange(len(self))
        return np.asarray(first[:, None] + np.arange(self.fold))

    def residual(self, reading: FloatArray) -> FloatArray:
        """Return readings minus model, less their mean rounding error."""
        left = self.values - reading
        return left if self.lattice is None else left - self.lattice

    def rms_left(self, reading: FloatArray) -> float:
        """Return the rms of what a model leaves of the readings that count."""
        return float(np.sqrt(np.mean(self.residual(reading)[self.weight > 0.0] ** 2)))

    def rms_of_reading(self, rms: float) -> float:
        """Return the rms of single readings from that of their means."""
        return math.hypot(rms, self.within_rms)

    def chi2_per_dof(self, chi2: float, fitted: int) -> float:
        """Return chi^2 of single readings over their degrees of freedom, from that of means.

        What scatters within the means is noise, by the noise's definition.
        """
        readings = self.used * self.fold
        return (chi2 + readings - self.used) / max(readings - fitted, 1)

    def each(self) -> list[Data]:
        """Return each recording's readings: these are of one."""
        return [self]

    def first(self, count: int) -> Data:
        """Return the first `count` readings."""
        return replace(
            self,
            time_s=self.time_s[:count],
            values=self.values[:count],
            weight=self.weight[:count],
            lattice=None if self.lattice is None else self.lattice[:count],
        )

    def masked(self, bad: BoolArray) -> Data:
        """Return the same with some readings masked."""
        return replace(self, weight=np.where(bad, 0.0, self.weight))


def rounding_bias(angle: FloatArray, step: float, noise_rms: float) -> FloatArray:
    """Return the mean rounding error of a noisy reading, rad.

    A reading is n steps where x and Gaussian noise add to a value within half a step of n. Steps
    beyond five of the noise's standard deviations are never read.
    """
    turn = angle / step
    below = np.floor(turn)
    far = 1 + math.ceil(5.0 * noise_rms / step)
    edges = below[:, None] + np.arange(-far, far + 1) + 0.5
    # The mean of round(x): the lowest that is read, and one for each edge that is passed.
    passed = ndtr((turn[:, None] - edges) * (step / noise_rms)).sum(axis=1)
    return np.asarray(step * (below - far + passed - turn))


def with_lattice(data: Data, reading: FloatArray) -> Data:
    """Estimate the noise before rounding, if the readings show the mean rounding error.

    It is the fit's (`noise.before_rounding`). Where the model is still wrong by part of a step,
    which smooths the rounding error as noise does, it is larger, and the sawtooth that is taken
    off smaller. Whether one is there, the residual decides.

    Parameters
    ----------
    data
        The readings; their step must be known.
    reading
        A model that fits to a small part of the step.
    """
    if not data.step or data.time_noise:
        return data
    off = (data.values - reading)[data.weight > 0.0]
    if float(np.median(np.abs(off))) > 0.6 * data.step:
        return data
    turn = 2.0 * np.pi * data.values / data.step
    origin = float(np.angle(np.mean(np.exp(1j * turn)))) * data.step / (2.0 * np.pi)
    noise = before_rounding(scatter(float(off @ off), len(off)), data.step)
    finer = replace(data, lattice=rounding_bias(reading - origin, data.step, noise))
    left = finer.residual(reading)[data.weight > 0.0]
    gain = len(off) * float(np.log(np.mean(off**2) / np.mean(left**2)))
    return finer if gain > _NEEDED_GAIN else replace(data, lattice=None)


_MOST_SCATTERED: Final = 40_000
"""Readings from which the scatter within means is told to 0.4 %."""


def with_scatter(data: Data, samples: Samples, model: Callable[[FloatArray], FloatArray]) -> Data:
    """Measure how readings scatter within the means that stand for them.

    Parameters
    ----------
    data, samples
        The means, and the readings as they were recorded.
    model
        The readings of a model at some times; an error that is slow does no harm.
    """
    kept = np.flatnonzero(data.weight > 0.0)
    kept = kept[:: max(len(kept) * data.fold // _MOST_SCATTERED, 1)]
    rows = data.rows[kept]
    time_s = samples.time_s[rows]
    time_s = time_s + (data.time_s[kept] - time_s.mean(axis=1))[:, None]
    left = samples.values[rows] - model(time_s.reshape(-1)).reshape(rows.shape)
    return replace(data, within_rms=float(np.sqrt(np.mean(np.var(left, axis=1)))))


def at_even_times(data: Data, time_s: FloatArray) -> Data:
    """Return the readings with the times of a regular clock; evenly spaced if none is missing."""
    interval = float(np.median(np.diff(time_s)))
    even = bool(np.all(np.abs(np.diff(time_s) - interval) < 1e-3 * interval))
    moved = replace(data, time_s=time_s, interval_s=interval, uniform=even)
    return moved.first(prev_fast_len(len(data))) if even else moved


def gather(
    time_s: FloatArray,
    values: FloatArray,
    *,
    step: float | None,
    unit: str,
    counts: bool,
    period_s: float,
    noise_rms: float,
    friction_jump: float = 0.0,
    third: float = 0.0,
    most: int = 4000,
) -> Data:
    """Collect the readings, averaged where there are very many in a cycle.

    At least 24 means are left in a cycle. The averaging reduces the amplitude of the model's
    readings equally (`Model.fold`). Two things it leaves add less than one to chi^2: at a turning
    point the friction, and with it x'', jumps by `friction_jump` (rad/s^2), where a mean over the
    time T is off by up to jump T^2/48, of a rate by jump T/8; and of the `third` harmonic (rad) a
    mean loses (3 omega T)^4/1920 more than the model.
    """
    intervals = np.diff(time_s)
    interval = float(np.median(intervals))
    rows = np.arange(len(time_s))
    even = Polynomial.fit(rows, time_s, 1)(rows)
    if np.all(np.abs(time_s - even) < _UNEVEN * interval):
        # Stamps that are rounded to milliseconds differ in their intervals.
        intervals = np.diff(even)
        interval = float(intervals[0])
    uniform = bool(np.all(np.abs(intervals - interval) < _UNEVEN * interval)) and not counts
    fold = every = 1
    if uniform and len(time_s) > most:
        fold = max(1, int(min(len(time_s) // most + 1, period_s / interval / _FEWEST_IN_CYCLE)))
    fewest = len(time_s) // _MOST_MEANS + 1
    omega, half_cycles = 2.0 * math.pi / period_s, 2.0 * len(time_s) * interval / period_s
    rate = unit == "rad/s"
    while fold > fewest:
        width = fold * interval
        kink = friction_jump * (width / 8.0 if rate else width**2 / 48.0)
        bent = third * (3.0 * omega if rate else 1.0) * (3.0 * omega * width) ** 4 / 1920.0
        off = math.hypot(kink * math.sqrt(half_cycles), bent * math.sqrt(len(time_s) / fold))
        if off < noise_rms / math.sqrt(fold):
            break
        fold -= 1
    if fold > 1:
        whole = len(time_s) // fold * fold
        time_s = time_s[:whole].reshape(-1, fold).mean(axis=1)
        values = values[:whole].reshape(-1, fold).mean(axis=1)
        interval *= fold
    if uniform:
        # Fourier transforms are ten times slower if the length has a large prime factor.
        fast = prev_fast_len(len(time_s))
        time_s, values = time_s[:fast], values[:fast]
    else:
        # Means of unevenly spaced readings would mix phases: take every k-th reading.
        every = math.ceil(len(time_s) / (_MOST_UNEVEN * most))
        time_s, values = time_s[::every], values[::every]
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
        every=every,
    )
