"""The noise of the readings: its spectrum and its level in time, by which they are weighed.

It is estimated between the harmonics of the motion, where no misfit reaches. It has no form that
is known beforehand. Only that its variance changes smoothly is assumed: along the frequency (its
spectrum) or along the record (its level). ln S is a sum of a constant and of smooth random
functions whose strengths are unknown, zero among them, so that a variance that does not change is
found to be constant, and precisely so.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from itertools import product
from typing import TYPE_CHECKING, ClassVar, Final, NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from scipy.fft import dct, idct
from scipy.ndimage import maximum_filter1d, median_filter

from pendpipe.arrays import BoolArray, FloatArray, IntArray
from pendpipe.solve import Bounds, Problem, Quadratic, Summed, bounded_least_squares, minimise

if TYPE_CHECKING:
    from pendpipe.diagnosis.data import Data


TAPS: Final = 32
"""Readings over which a filter may reach; a running mean of m has coefficients to some 3 m."""
_ORDER: Final = 4
"""Of the differences that measure fast noise, as in `analysis.noise`."""


@dataclass(frozen=True)
class Noise:
    """The variance of each cosine (DCT-II, orthonormal) of the readings over their level.

    Parameters
    ----------
    variance
        Shape (n,): S_k.
    weight
        1 where a reading counts; shape (n,).
    level
        The relative standard deviation of each reading, shape (n,); None where it is constant.
    starts, uncertainty
        The first cosine of each bin, and the covariance of ln S in the bins; empty where S is
        exactly known.
    charge
        By how much -2 ln of the cosines' probability density is larger since S was estimated.
    harmonics
        The cosines about the harmonics, from which S was not estimated, shape (n,).
    """

    known: ClassVar[bool] = False
    """Whether it is not to be estimated again."""
    variance: FloatArray
    weight: FloatArray
    level: FloatArray | None = None
    starts: IntArray = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    uncertainty: FloatArray = field(default_factory=lambda: np.zeros((0, 0)))
    charge: float = 0.0
    harmonics: BoolArray = field(default_factory=lambda: np.zeros(0, dtype=bool))

    def whiten(self, columns: FloatArray) -> FloatArray:
        """Turn readings (or columns of them) into numbers of unit variance, shape kept."""
        scale = 1.0 / np.sqrt(self.variance)
        if not self.coloured:
            return np.asarray((columns.T * (self.scale * scale)).T)
        # The transform is much faster on contiguous memory.
        rows = np.multiply(columns.T, self.scale, order="C")
        return np.asarray((dct(rows, norm="ortho") * scale).T)

    def adjoint(self, columns: FloatArray) -> FloatArray:
        """Apply the transpose of `whiten`: from white numbers back to weights of readings."""
        scale = 1.0 / np.sqrt(self.variance)
        if not self.coloured:
            return np.asarray((columns.T * (self.scale * scale)).T)
        rows = np.multiply(columns.T, scale, order="C")
        return np.asarray((idct(rows, norm="ortho") * self.scale).T)

    def numbers_of(self, residual: FloatArray) -> FloatArray:
        """Return what columns are compared with, of a whitened residual: here the residual."""
        return residual

    @property
    def scale(self) -> FloatArray:
        """What each reading is multiplied by before its cosines are taken, shape (n,)."""
        return self.weight if self.level is None else self.weight / self.level

    @property
    def coloured(self) -> bool:
        """Whether cosines differ in variance; else the readings are white."""
        return bool(np.any(self.variance != self.variance[0]))

    def white(self, data: Data) -> Noise:
        """Return white noise as large as this, of other readings."""
        return white_noise(data, self.white_rms)

    @property
    def cost(self) -> float:
        """-2 ln of its probability density, less chi^2 and constants."""
        logs = float(np.mean(np.log(self.variance))) * float(np.count_nonzero(self.weight))
        if self.level is not None:
            logs += 2.0 * float(np.sum(np.log(self.level[self.weight > 0.0])))
        return logs + self.charge

    @property
    def memory(self) -> float:
        """Correlation of neighbouring readings."""
        turn = np.cos(math.pi * np.arange(len(self.variance)) / len(self.variance))
        return float(turn @ self.variance / self.variance.sum())

    @property
    def rms(self) -> float:
        """Standard deviation of one reading, its colour included."""
        level = 1.0 if self.level is None else float(np.mean(self.level**2))
        return math.sqrt(float(np.mean(self.variance)) * level)

    @property
    def white_rms(self) -> float:
        """Standard deviation of the white noise whose differences are as large.

        It is what `analysis.noise.noise_rms` measures, which no slow motion can touch.
        """
        passed = np.sin(0.5 * math.pi * np.arange(len(self.variance)) / len(self.variance))
        passed = passed ** (2 * _ORDER)
        level = 1.0 if self.level is None else float(np.mean(self.level**2))
        return math.sqrt(float(passed @ self.variance / passed.sum()) * level)

    def rms_at(self, frequency: float) -> float:
        """Standard deviation of white noise with the density at a frequency in cycles a reading."""
        cosine = min(int(2.0 * len(self.variance) * frequency), len(self.variance) - 1)
        return self.rms * math.sqrt(float(self.variance[cosine] / np.mean(self.variance)))

    @property
    def sd(self) -> FloatArray:
        """Standard deviation of each reading, shape (n,)."""
        mean = math.sqrt(float(np.mean(self.variance)))
        return np.full(len(self.variance), mean) if self.level is None else mean * self.level

    def log_scale_variance(self, rows: FloatArray) -> FloatArray:
        """Return the variance of the logarithm of the noise that unit columns meet.

        Parameters
        ----------
        rows
            Whitened columns of unit length, shape (k, n or more).
        """
        if not len(self.starts):
            return np.zeros(len(rows))
        energy = self.energy_in_bins(rows)
        return np.asarray(np.einsum("km,mn,kn->k", energy, self.uncertainty, energy, optimize=True))

    def energy_in_bins(self, rows: FloatArray) -> FloatArray:
        """Return the squares of unit columns in each bin of S, shape (k, bins)."""
        rows = rows[:, : len(self.variance)]
        rows = rows if self.coloured else dct(rows, norm="ortho")
        return np.asarray(np.add.reduceat(rows**2, self.starts, axis=1))

    def misfit(self, residual: FloatArray) -> float:
        """Return the mean square about the harmonics of a whitened residual: 1 for noise alone."""
        white = residual[: len(self.variance)]
        white = white if self.coloured else dct(white, norm="ortho")
        return float(np.mean(white[self.harmonics] ** 2)) if self.harmonics.any() else 1.0

    def log_variance_at(self, cosine: FloatArray) -> FloatArray:
        """Return the variance of ln S at each (not whole) number of a cosine."""
        if not len(self.starts):
            return np.zeros(len(cosine))
        return np.asarray(np.interp(cosine, self.starts, np.diag(self.uncertainty)))

    def first(self, count: int, weight: FloatArray) -> Noise:
        """Return the noise of the first `count` readings."""
        whole = np.arange(len(self.variance)) / len(self.variance)
        variance = np.interp(np.arange(count) / count, whole, self.variance)
        level = None if self.level is None else self.level[:count]
        return Noise(variance, weight, level)


def white_noise(data: Data, rms: float, level: FloatArray | None = None) -> Noise:
    """Return white noise of an rms, times a level at each reading."""
    return Noise(np.full(len(data), rms * rms), data.weight, level)


def noise_of_counts(residual: FloatArray, speed: FloatArray) -> FloatArray:
    """Return the noise of each row that comes with a count, rad.

    The place of an edge errs, and the time at which it is seen: sigma^2 = s^2 + (tau v)^2. Both are
    told by the squares of fourth differences between rows, in which no motion is left.
    """
    square = np.convolve(residual, (1.0, -4.0, 6.0, -4.0, 1.0), "same") ** 2 / 70.0
    parts = np.stack([np.ones(len(speed)), (speed / np.sqrt(np.mean(speed**2))) ** 2], axis=1)
    variance, ends = np.full(len(speed), np.mean(square)), (np.zeros(2), np.full(2, np.inf))
    for _ in range(_CLEANINGS):
        # Their errors are as large as themselves; neither part is below a hundredth.
        share = bounded_least_squares(parts / variance[:, None], square / variance, *ends)
        variance = parts @ np.maximum(share, 0.01 * share.sum())
    return np.asarray(np.sqrt(variance))


_HARMONICS: Final = 7
"""The first of the motion that no misfit fills: a swing of 90 degrees has 1e-5 of itself there."""
_HARMONIC_HALF_WIDTH: Final = 0.08
"""Half width of the band about each harmonic that a misfit may fill, over the frequency."""
_LOBE: Final = 1.5
"""Half width of the line of a short decay, times its cycles: its first side lobes lie within."""
_CYCLES_TOGETHER: Final = 5.0
"""Cycles over which the readings in a cycle are counted."""
_FEWEST_COSINES: Final = 40
"""Between the harmonics; if there are fewer, those about them are used as well."""
_SLOPES: Final = (0.0, 1.5, 4.0)
"""Rms slopes of ln S against ln f that are tried, at the slowest cosine. Known noises have 0
(white), 1 (flicker) and 2 (random walk), and steeper ones where a drift is filtered."""
_CORNERS: Final = 25
"""Frequencies at which the slope may change, evenly spaced in ln f."""
_FILTERS: Final = (0.0, 0.3, 1.0, 4.0)
"""Rms first cepstral coefficients of ln S that are tried: a memory phi of one reading has 2 phi, a
running mean 2."""
_LEVELS: Final = (0.0, 0.3, 1.0, 3.0)
"""Rms first coefficients of ln level^2 that are tried; a level that falls by 3 has 0.9."""
_LEVEL_WAVES: Final = 16
"""Cosines of a level that changes: sixteen half waves of a record."""
_LEVEL_BINS: Final = 64
"""Parts of a record in which the level is counted: four for each cosine."""
_FEWEST_IN_BIN: Final = 8
"""Readings in each: their mean square is known to a half, which the others average."""
_LARGEST_SQUARE: Final = 20.0
"""Of a whitened reading, over the median (3 standard deviations of normal noise): single large
errors don't make a level."""
_BINS: Final = 128
"""Parts of the spectrum at least."""
_RELATIVE_BIN: Final = 0.1
"""Width of a part over its frequency: a power law of slope 4 changes by half within."""
_READINGS_AT_ENDS: Final = 100.0
"""Readings over which the leakage of the ends of a filtered record adds up."""
_SLOWEST_LINE: Final = 6
"""The cosine with three cycles in the record: what is slower is a drift and no line."""
_BESIDE: Final = 12
"""Cosines beside a line: a choice; a stand's resonance of Q 15 is wider from 30 cycles on."""
_LINE: Final = 2
"""Cosines of the line itself, two to 1/duration: half of its main lobe."""
_MEDIAN_OF_A_SQUARE: Final = 0.455
"""Of a normal number, over its mean."""
_LEAKED: Final = 0.2
"""Part of the power from which a line's leak is no noise: the leak itself has nodes."""
_LEVEL_SD: Final = 10.0
"""Of the constant, about the mean of the squares: nothing is known of it."""
_LINES: Final = 1e-3
"""Part of the squares that may be lines and no noise."""
_RANGE_OF_LINES: Final = 20.0
"""Of ln P, over which they spread."""
_NOT_NOISE: Final = -2.0 * math.log(_LINES / _RANGE_OF_LINES) - math.log(2.0 * math.pi)
"""r - ln r above which a square of r times the variance is more probably no noise."""
_ROUNDS: Final = 12
"""Newton steps at most: the likelihood is nearly a parabola, and four are usual."""
_CONVERGED: Final = 1e-3
"""Gain in log-likelihood that is left when it ends: 0.05 sd of any number."""
_CLEANINGS: Final = 3
"""Times that lines are taken out: each shows those that a louder one has hidden."""


def estimate_noise(
    data: Data,
    residual: FloatArray,
    frequency_hz: float,
    floor: float,
    *,
    cycles: float = math.inf,
    red: bool = True,
    level: FloatArray | None = None,
) -> Noise:
    """Estimate the noise from a residual.

    Bands about the harmonics of the motion and the slowest cosine are left out, since misfits lie
    there. Readings that are not evenly spaced are taken as they follow each other.

    Parameters
    ----------
    data, residual
        The readings and their residual, shape (n,).
    frequency_hz
        Of the motion.
    floor
        The smallest rms that is plausible.
    cycles
        Over which the motion is to be seen: what it leaves is a line as wide as one over these.
    red
        Whether the noise may grow to low frequencies; else it is told by what lies above half the
        motion's.
    level
        Of rows that come with counts: see `noise_of_counts`.
    """
    width = max(_HARMONIC_HALF_WIDTH, _LOBE / cycles)
    lowest, highest = _cycles_per_reading(data, frequency_hz)
    noise_only = _noise_only(len(data), lowest, highest, width)
    faster = noise_only & (np.arange(len(data)) > lowest * len(data))
    if not red and np.count_nonzero(faster) >= _FEWEST_COSINES:
        noise_only = faster
    noise = Noise(np.ones(len(data)), data.weight, level, harmonics=~noise_only)
    noise.harmonics[0] = False
    noise = _with_spectrum(noise, residual, noise_only, red=red)
    change, charge = _change_of_level(noise, residual, noise_only)
    if change is not None:
        noise = replace(noise, level=change if level is None else change * level)
        noise = _with_spectrum(noise, residual, noise_only, red=red)
        noise = replace(noise, charge=noise.charge + charge)
    return replace(noise, variance=noise.variance * max((floor / noise.rms) ** 2, 1.0))


def _cycles_per_reading(data: Data, frequency_hz: float) -> tuple[float, float]:
    """Return the lowest and the highest frequency of the motion, in cycles per reading.

    They differ where rows come with events: fewer in a cycle as the swings become smaller.
    """
    usual = frequency_hz * float(data.time_s[-1] - data.time_s[0]) / (len(data) - 1)
    if data.uniform:
        return usual, usual
    edges = np.arange(data.time_s[0], data.time_s[-1], _CYCLES_TOGETHER / frequency_hz)
    number = np.diff(np.searchsorted(data.time_s, edges))
    found = _CYCLES_TOGETHER / np.maximum(number, 1)
    every = [usual, *found.tolist()]
    return min(every), max(every)


def _with_spectrum(
    noise: Noise, residual: FloatArray, noise_only: BoolArray, *, red: bool
) -> Noise:
    """Estimate the spectrum for a given level."""
    count = len(residual)
    starts = _bins(count)
    slow, fast = _smooth_spectra(count)
    smooth = [slow if red else Smooth(slow.columns, (0.0,)), fast]
    filled = count / max(float(np.sum(noise.weight > 0.0)), 1.0)
    power = dct(residual * noise.scale, norm="ortho") ** 2 * filled
    known = noise_only & ~_about_lines(power, noise_only)
    found = log_variance(power, known, starts, smooth, lines_from=_SLOWEST_LINE)
    if found.constant > 0.5:
        width = np.diff(np.append(starts, count))
        variance = np.full(count, math.exp(float(found.mean @ width) / count))
    else:
        # The ends of the record leak into all cosines, all in one pattern.
        least = min(math.log(_READINGS_AT_ENDS / count), 0.0)
        middle = 0.5 * (starts + np.append(starts[1:], count) - 1)
        logs = np.maximum(found.mean, _largest_beside(found.mean, middle) + least)
        variance = np.exp(np.interp(np.arange(count), middle, logs))
    return replace(
        noise,
        variance=variance,
        starts=starts,
        uncertainty=found.covariance,
        charge=found.charge,
    )


def _about_lines(power: FloatArray, noise_only: BoolArray) -> BoolArray:
    """Return the cosines that a line reaches: what it leaks there, or as it dies away, is no noise.

    A line stands out of the frequencies on both of its sides, as no resonance of a stand does that
    is wider, and no red noise. To a distance d it leaks 1/d^2 of its power.
    """
    width, cosine = 2 * _BESIDE + 1, np.arange(len(power))
    heard = np.where(noise_only, power, 0.0)
    largest = maximum_filter1d(heard, width, mode="constant")
    peaks = np.flatnonzero(noise_only & (power == largest) & (cosine >= _SLOWEST_LINE))
    windows = sliding_window_view(np.pad(heard, _BESIDE), width)[peaks]
    sides = np.stack([windows[:, : _BESIDE - _LINE], windows[:, _BESIDE + _LINE + 1 :]])
    seen = np.count_nonzero(sides, axis=2)
    # Beside a harmonic, or an end, one side tells too little.
    told = np.all(2 * seen >= sides.shape[2], axis=0)
    peaks, beside = peaks[told], (sides.sum(axis=2)[:, told] / seen[:, told]).max(axis=0)
    leaks = np.zeros(len(power))
    for peak in peaks[stands_out(power[peaks] / beside)]:
        leaks += power[peak] / np.maximum(np.abs(cosine - peak), 1) ** 2
    if not leaks.any():
        return leaks > 0.0
    share = leaks * _MEDIAN_OF_A_SQUARE / np.maximum(median_filter(power, _BESIDE), 1e-300)
    # The half of the cosines that it leaks to least tells the noise in any case.
    return np.asarray(share > max(_LEAKED, float(np.median(share[noise_only]))))


def _largest_beside(logs: FloatArray, middle: FloatArray) -> FloatArray:
    """Return the largest of each bin and those within an octave."""
    apart = np.abs(np.subtract.outer(np.log(middle + 1.0), np.log(middle + 1.0)))
    return np.asarray(np.max(np.where(apart < math.log(2.0), logs, -np.inf), axis=1))


def _change_of_level(
    noise: Noise, residual: FloatArray, noise_only: BoolArray
) -> tuple[FloatArray | None, float]:
    """Return the relative level, None if it is constant, and the charge for its estimate.

    The whitened residual between the harmonics is turned back into a series, whose squares show
    the level. Squares of heavy-tailed noise scatter more than those of normal numbers.
    """
    count = len(residual)
    bins: int = min(_LEVEL_BINS, count // _FEWEST_IN_BIN)
    if bins < 4:
        return None, 0.0
    white = dct(residual * noise.scale, norm="ortho") / np.sqrt(noise.variance)
    used = noise.weight > 0.0
    share = float(np.mean(noise_only))
    square = idct(white * noise_only, norm="ortho") ** 2
    square = np.minimum(square / np.median(square[used]), _LARGEST_SQUARE)
    kept = square[used]
    independent = share * min(2.0 * float(np.mean(kept)) ** 2 / float(np.var(kept)), 1.0)
    starts = np.linspace(0, count, bins, endpoint=False).astype(np.int64)
    middle = (np.arange(bins) + 0.5) / bins
    order = np.arange(1, _LEVEL_WAVES + 1)
    waves = np.cos(math.pi * np.outer(middle, order)) / order
    smooth = [Smooth(waves, _LEVELS)]
    found = log_variance(square, used, starts, smooth, lines_from=count, independent=independent)
    if found.constant > 0.5:
        return None, 0.0
    log = np.interp(np.arange(count) + 0.5, middle * count, found.mean)
    return np.exp(0.5 * (log - float(np.mean(log)))), found.charge


def _noise_only(count: int, lowest: float, highest: float, half_width: float) -> BoolArray:
    """Return which cosines contain noise alone; the offset itself is fitted.

    Parameters
    ----------
    count
        Of the readings.
    lowest, highest
        Frequency of the motion in cycles per reading.
    half_width
        Of the bands about its harmonics, over the frequency.
    """
    frequency = np.arange(count) / (2.0 * count)
    harmonic = np.arange(1, _HARMONICS)[:, None]
    below = frequency < (harmonic - half_width) * lowest
    above = frequency > (harmonic + half_width) * highest
    noise_only: BoolArray = np.all(below | above, axis=0)
    if np.count_nonzero(noise_only) < _FEWEST_COSINES:
        noise_only = np.ones(count, dtype=bool)
    noise_only[0] = False
    return noise_only


@lru_cache(maxsize=8)
def _bins(count: int) -> IntArray:
    """Return the first cosine of each bin: single slow ones, then a tenth of f, then equal bins."""
    starts = [0, 1]
    while starts[-1] < count:
        width = min(max(1, int(_RELATIVE_BIN * starts[-1])), max(1, count // _BINS))
        starts.append(starts[-1] + width)
    return np.array(starts[:-1])


@lru_cache(maxsize=8)
def _smooth_spectra(count: int) -> tuple[Smooth, Smooth]:
    """Return the two ways in which a spectrum may change.

    Towards low frequencies the slope of ln S against ln f may change at any frequency, softly (as
    where a steeper noise takes over): white noise that some slower one joins. A filter over some
    readings has cepstral coefficients that fall as 1/m.
    """
    starts = _bins(count)
    middle = np.maximum(0.5 * (starts + np.append(starts[1:], count) - 1), 1.0)
    corner = np.linspace(0.0, math.log(count), _CORNERS)
    below = 0.5 * np.log1p(np.exp(2.0 * (corner - np.log(middle)[:, None])))
    order = np.arange(1, TAPS + 1)
    waves = np.cos(math.pi * np.outer(middle / count, order)) / order
    return Smooth(below / math.sqrt(_CORNERS), _SLOPES), Smooth(waves, _FILTERS)


class Smooth(NamedTuple):
    """A smooth random function of unit strength, and the strengths that are tried.

    Parameters
    ----------
    columns
        Its values at the bins by independent normal numbers of unit variance, shape (m, p).
    strengths
        Zero first, which is as probable as all others together.
    """

    columns: FloatArray
    strengths: tuple[float, ...]


class LogVariance(NamedTuple):
    """What is known of ln S in each bin.

    Parameters
    ----------
    mean
        Shape (m,).
    covariance
        Of ln S, shape (m, m).
    constant
        The probability that it does not change.
    charge
        By how much -2 ln of the probability density of the squares, averaged over everything
        unknown, is larger than if `mean` were known.
    """

    mean: FloatArray
    covariance: FloatArray
    constant: float
    charge: float


def log_variance(
    value: FloatArray,
    known: BoolArray,
    starts: IntArray,
    smooth: Sequence[Smooth],
    *,
    lines_from: int,
    independent: float = 1.0,
) -> LogVariance:
    """Estimate ln S: a weighted mean over all strengths, each by Laplace's approximation.

    Parameters
    ----------
    value
        Squares of normal numbers, shape (n,).
    known
        Which of them are noise, as far as is known beforehand; shape (n,).
    starts
        The index of the first square of each bin, in which S is taken as constant; shape (m,).
    smooth
        How ln S may change.
    lines_from
        The first square that may be a line and no noise.
    independent
        Independent numbers in each square: less than one where they are not normal.
    """
    strengths = list(product(*(each.strengths for each in smooth)))
    value, may_be_line = np.maximum(value, 1e-300), known & (np.arange(len(value)) >= lines_from)
    found = []
    for sizes in strengths:
        parts = [size * each.columns for each, size in zip(smooth, sizes, strict=True) if size]
        columns = np.concatenate([np.full((len(starts), 1), _LEVEL_SD), *parts], axis=1)
        found.append(_at_strengths(value, known, may_be_line, starts, columns, independent))
    means, spreads, costs, charges = zip(*found, strict=True)
    cost = np.array(costs) - 2.0 * np.log(_prior(smooth))
    weight = np.exp(-0.5 * (cost - cost.min()))
    total = float(weight.sum())
    weight /= total
    mean, best = weight @ np.array(means), int(np.argmin(cost))
    covariance = np.zeros((len(mean), len(mean)))
    for share, each, spread in zip(weight.tolist(), means, spreads, strict=True):
        if share > 1e-4:
            covariance += share * (spread @ spread.T + np.outer(each - mean, each - mean))
    averaged = float(cost.min()) - 2.0 * math.log(total) - costs[best]
    return LogVariance(mean, covariance, float(weight[0]), charges[best] + averaged)


def stands_out(ratio: FloatArray | float) -> BoolArray:
    """Return whether squares that are so many times the variance are more probably no noise."""
    return np.asarray((np.asarray(ratio) > 1.0) & (ratio - np.log(ratio) > _NOT_NOISE))


def _prior(smooth: Sequence[Smooth]) -> FloatArray:
    """Return the probability of each combination of strengths."""
    others = [len(each.strengths) - 1 for each in smooth]
    parts = [[0.5] + [0.5 / number] * number if number else [1.0] for number in others]
    return np.array([math.prod(shares) for shares in product(*parts)])


def _at_strengths(
    value: FloatArray,
    known: BoolArray,
    may_be_line: BoolArray,
    starts: IntArray,
    columns: FloatArray,
    share: float,
) -> tuple[FloatArray, FloatArray, float, float]:
    """Return mean and root of the covariance of ln S for given strengths, cost and charge."""
    width, noise = np.diff(np.append(starts, len(value))), known
    number, total = _binned(noise, value, starts)
    middle = math.log(max(float(total.sum()) / max(float(number.sum()), 1.0), 1e-300))
    # A start that single lines don't move: the mean of ln P in each bin is 1.27 too low.
    logs = np.add.reduceat(np.where(noise, np.log(value) - middle + 1.27, 0.0), starts)
    normal = columns.T @ (columns * (0.2 * number)[:, None]) + np.eye(columns.shape[1])
    at = np.asarray(np.linalg.solve(normal, columns.T @ (0.2 * logs)), dtype=np.float64)
    for _ in range(_CLEANINGS):
        ratio = value / np.exp(np.repeat(columns @ at, width) + middle)
        lines = may_be_line & stands_out(ratio)
        before, noise = noise, known & ~lines
        number, total = _binned(noise, value, starts)
        at, root = _maximised(columns, share * number, share * total / math.exp(middle), at)
        if np.array_equal(before, noise):
            break
    log = columns @ at + middle
    cost = share * float(np.sum(number * log + total / np.exp(log)))
    cost += float(np.sum(np.log(value[lines]))) + np.count_nonzero(lines) * _NOT_NOISE
    charge = float(at @ at) + 2.0 * float(np.sum(np.log(np.diag(root))))
    spread = np.asarray(np.linalg.solve(root, columns.T).T, dtype=np.float64)
    return log, spread, float(cost) + charge, charge


def _binned(noise: BoolArray, value: FloatArray, starts: IntArray) -> tuple[FloatArray, FloatArray]:
    """Return the number of squares that are noise, and their sum, in each bin."""
    number = np.add.reduceat(noise.astype(np.float64), starts)
    return number, np.add.reduceat(np.where(noise, value, 0.0), starts)


def _maximised(
    columns: FloatArray, number: FloatArray, total: FloatArray, at: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the most probable coefficients, and the root of the information there."""

    def cost(at: FloatArray) -> float:
        log = columns @ at
        return float(number @ log + total @ np.exp(-log) + at @ at)

    information = 0.5 * columns.T @ (columns * number[:, None]) + np.eye(len(at))

    def derivatives(at: FloatArray) -> Quadratic:
        pull = 0.5 * columns.T @ (total * np.exp(-(columns @ at)) - number) - at
        return Quadratic(cost(at), pull, information)

    def there(at: FloatArray) -> Summed:
        return Summed(at, cost(at), derivatives)

    problem = Problem(there, Bounds.none(len(at)))
    found = minimise(problem, at, tolerance=_CONVERGED, rounds=_ROUNDS)
    return found.value, np.asarray(np.linalg.cholesky(information), dtype=np.float64)
