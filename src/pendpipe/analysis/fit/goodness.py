"""The one test of fit, and the noise of a reading, from what a fit leaves.

What a fit of the right law leaves is white. So the residual is demodulated: in blocks of a few
cycles a level and the first harmonics of the motion are fitted to it. What they leave is the noise;
what they take is asked whether noise explains it, as scatter from block to block and as a slow
change along the record. All questions share one level.
"""

import math
from collections.abc import Sequence
from functools import lru_cache
from typing import Final, NamedTuple

import numpy as np

from pendpipe.analysis.demodulation import harmonic_columns, normal_equations
from pendpipe.analysis.misfit import misfit_of
from pendpipe.analysis.noise import TOLD, scatter, undithered_rms
from pendpipe.arrays import FloatArray
from pendpipe.levels import REFUTED
from pendpipe.solve import invert

_BINS: Final = 32
"""Means in a cycle that stand for more readings than that."""
_READINGS: Final = 32
"""In a block, at least: its level and three harmonics are seven numbers."""
_BLOCKS: Final = 128
"""Of a record, at most."""
_SLOW: Final = 8
"""Polynomials that follow a slow change along the record."""

_ROWS: Final = 1 << 14
"""Rows of derivatives at most: of 500 cycles, over each of which a derivative changes by 0.2 %."""
_IN_PHASE: Final = 0.05
"""Part of the motion that a residual may have at its frequency where its third harmonic is read: a
phase of 0.05 that changes in a cycle leaves a hundredth of itself there."""
_RIDGE: Final = 1e-9
"""Of the level's square: a block with a gap has an inverse, and is then left out (`_GAPPED`)."""
_GAPPED: Final = 60.0
"""Variances of a block's coefficients, added up, over that of its mean: 13 where it is whole."""


class Question(NamedTuple):
    """A sum of squares, in units of the noise's variance, and its degrees of freedom."""

    name: str
    chi2: float
    freedom: float


class Left(NamedTuple):
    """What a refuted law leaves, for the error model: readings, or their means in a cycle."""

    time_s: FloatArray
    phase: FloatArray
    readings: FloatArray
    """That each stands for, shape (m,)."""
    sizes: tuple[float, ...]
    """Of the parts of the motion (`misfit.Misfit`)."""


class Goodness(NamedTuple):
    """How well a law describes the readings."""

    noise_rms: float
    """Of one reading, never below step/sqrt(12)."""
    chi2_per_dof: float
    """Of the residual against that noise."""
    p_values: tuple[float, ...]
    """Of each question."""
    misfit: float
    """Variance of what is left over that of the noise, at the motion's own frequency if more: 1
    where noise explains it."""
    bent: FloatArray | None = None
    """Third harmonic of the residual in phase with the first of the motion, over the largest
    amplitude Y: a constant, and by (y/Y)^3; shape (2,)."""
    left: Left | None = None
    """Where more than noise is left of the readings."""

    @property
    def p_value(self) -> float:
        """Of the worst answer, all questions considered."""
        return combined(self.p_values)


def combined(p_values: Sequence[float]) -> float:
    """The probability that the least of some p-values is as small by chance."""
    least = min(p_values, default=1.0)
    return -math.expm1(len(p_values) * math.log1p(-least)) if least < 1.0 else 1.0


def tail(ratio: float, freedom: float, of_noise: float) -> float:
    """Probability that Fisher's F exceeds a ratio, by Paulson's normal deviate.

    Examples
    --------
    >>> round(tail(3.84, 1.0, 1e9), 2)
    0.05
    """
    if not ratio > 0.0:
        return 1.0
    root = ratio ** (1.0 / 3.0)
    below, above = 2.0 / (9.0 * of_noise), 2.0 / (9.0 * freedom)
    deviate = ((1.0 - below) * root - (1.0 - above)) / math.sqrt(below * root**2 + above)
    return 0.5 * math.erfc(deviate * math.sqrt(0.5))


def judge(
    time_s: FloatArray,
    residual: FloatArray,
    turn_s: FloatArray,
    half_cycle: FloatArray,
    *,
    fitted: int,
    lines: int,
    amplitude: FloatArray,
    step: float | None,
    floor: float,
) -> Goodness:
    """Estimate the noise, and ask whether it explains the residual.

    Parameters
    ----------
    time_s, residual
        Readings less model, shape (n,).
    turn_s, half_cycle
        Times and numbers of turning points, shape (k,): the readings go with cos(pi number).
    fitted, lines
        How many parameters were fitted to the motion, and how many to its level.
    amplitude
        Of the turning points, in the unit of the readings; with the step it says what rounding
        leaves of the motion.
    step
        Of the readings, where known.
    floor
        Noise that can't be less.
    """
    n, freedom = len(residual), max(len(residual) - fitted - lines, 1)
    square = float(residual @ residual)
    phase, times, sums, weights = _binned(time_s, residual, turn_s, half_cycle)
    cycles = (phase[-1] - phase[0]) / (2.0 * math.pi)
    harmonics = int(min(max((n / max(cycles, 1.0) - 2.0) / 3.0, 1.0), 3.0))
    size = 1 + 2 * harmonics
    count = int(min(max(n // _READINGS, 1), max(cycles, 1.0), _BLOCKS))
    found = _demodulated(phase, sums, weights, count, harmonics)
    count = len(found.square)
    of_noise = n - size * count
    if of_noise < TOLD:
        noise = scatter(square, freedom, step, floor)
        return Goodness(noise, square / freedom / noise**2, (), 1.0)
    noise = scatter(square - float(np.sum(found.square)), of_noise, step, floor)
    rounding = undithered_rms(np.interp(found.phase, half_cycle * math.pi, amplitude), step, noise)
    asked = list(_questions(found, noise, rounding, fitted, lines))
    p_values = tuple(tail(each.chi2 / each.freedom, each.freedom, of_noise) for each in asked)
    ratio = square / freedom / noise**2
    if combined(p_values) >= REFUTED:
        # Where all of the residual is noise, all of it tells how large that is.
        return Goodness(scatter(square, freedom, step, floor), ratio, p_values, 1.0)
    # What a, b, c suffer from is what is left at the motion's own frequency.
    own = max((each.chi2 / each.freedom for each in asked if each.name == "motion"), default=1.0)
    bent, large = None, float(np.max(amplitude))
    y = np.interp(found.phase, half_cycle * math.pi, amplitude) / large
    # What has lost the phase leaks into all harmonics.
    near = np.linalg.norm(found.value[:, 1:3], axis=1) < _IN_PHASE * large * y
    if harmonics > 2 and np.sum(near) > 2:
        cubes = y[near, None] ** np.array([0.0, 3.0])
        bent = np.linalg.lstsq(cubes, found.value[near, 5] / large)[0]
    sizes = misfit_of(sums / np.sqrt(weights) / noise, phase).sizes
    # Derivatives change slowly: in a long record every so many cycles stand for the others.
    every = len(phase) // _ROWS + 1
    some = np.floor((phase - phase[0]) / (2.0 * math.pi)) % every == 0
    left = Left(times[some], phase[some], every * weights[some], sizes)
    return Goodness(noise, ratio, p_values, max(ratio, own, 1.0), bent, left)


def _binned(
    time_s: FloatArray, residual: FloatArray, turn_s: FloatArray, half_cycle: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Phase, time, sum and number of readings: of each, or of many in a part of a cycle."""
    turns = half_cycle * math.pi
    pace = np.diff(turns[[0, -1]])[0] / (turn_s[-1] - turn_s[0])
    span = float(time_s[-1] - time_s[0])
    # Beyond the turning points the motion goes on at its pace.
    turn_s = np.concatenate([[turn_s[0] - span], turn_s, [turn_s[-1] + span]])
    turns = np.concatenate([[turns[0] - pace * span], turns, [turns[-1] + pace * span]])
    if len(time_s) * 2.0 * math.pi < 2 * _BINS * pace * span:
        return np.interp(time_s, turn_s, turns), time_s, residual, np.ones(len(residual))
    first, last = np.interp(time_s[[0, -1]], turn_s, turns).tolist()
    edges = np.linspace(first, last, math.ceil((last - first) / (2.0 * math.pi) * _BINS) + 1)
    place = np.searchsorted(time_s, np.interp(edges, turns, turn_s))
    place[0], place[-1] = 0, len(time_s)
    weights = np.diff(place).astype(np.float64)
    some = weights > 0.0
    middle = 0.5 * (edges[1:] + edges[:-1])
    times = np.interp(middle[some], turns, turn_s)
    return middle[some], times, np.add.reduceat(residual, place[:-1][some]), weights[some]


class _Blocks(NamedTuple):
    """Whitened coefficients of some blocks, shape (k, terms), for unit noise."""

    phase: FloatArray
    """In the middle of each, shape (k,)."""
    value: FloatArray
    inverse: FloatArray
    """Covariance of the coefficients for unit noise, shape (k, terms, terms)."""
    square: FloatArray
    """What they take off the sum of squares, shape (k,)."""


def _demodulated(
    phase: FloatArray, sums: FloatArray, weights: FloatArray, count: int, harmonics: int
) -> _Blocks:
    """Fit a level and harmonics to each block."""
    edges, root = np.linspace(phase[0], phase[-1], count + 1), np.sqrt(weights)
    waves, starts = harmonic_columns(phase, harmonics), np.searchsorted(phase, edges[:-1])
    gram, right = normal_equations(waves * root, sums / root, starts)
    # Blocks with a gap tell not all of them.
    inverse = gram + _RIDGE * gram[:, :1, :1] * np.eye(len(waves))
    invert(inverse)
    whole = np.einsum("kpp->k", inverse) * gram[:, 0, 0] < _GAPPED
    inverse, right = inverse[whole], right[whole]
    value = np.einsum("kpq,kq->kp", inverse, right)
    middle = 0.5 * (edges[1:] + edges[:-1])[whole]
    return _Blocks(middle, value, inverse, np.einsum("kp,kp->k", value, right))


def _questions(
    found: _Blocks, noise: float, rounding: FloatArray, fitted: int, lines: int
) -> list[Question]:
    """What noise has to explain, of each harmonic: scatter of the blocks, and slow change."""
    size, count = found.value.shape[1], len(found.value)
    asked, slow = [], min(_SLOW, count // 3)
    # Each is a normal number of its own, the sine less what it shares with the cosine.
    variance = found.inverse * noise**2 + np.eye(size) * rounding[:, None, None] ** 2
    cosine, sine, white = np.arange(1, size, 2), np.arange(2, size, 2), found.value.copy()
    shared = variance[:, cosine, sine] / variance[:, cosine, cosine]
    white[:, sine] -= shared * white[:, cosine]
    square = variance.diagonal(axis1=1, axis2=2).copy()
    square[:, sine] -= shared * variance[:, cosine, sine]
    white /= np.sqrt(square)
    taken = (_slow_changes(count, slow).T @ white) ** 2
    for harmonic in range((size + 1) // 2):
        part = slice(2 * harmonic - 1, 2 * harmonic + 1) if harmonic else slice(0, 1)
        absorbed, wide = (lines, fitted)[harmonic] if harmonic < 2 else 0, 1 + (harmonic > 0)
        freedom = wide * count - absorbed
        name = ("level", "motion")[harmonic] if harmonic < 2 else f"harmonic {harmonic}"
        if freedom > 0:
            asked.append(Question(name, float(np.sum(white[:, part] ** 2)), freedom))
        if wide * slow > absorbed:
            along = float(np.sum(taken[:, part]))
            asked.append(Question(f"{name}, slow", along, wide * slow - absorbed))
    return asked


@lru_cache(maxsize=16)
def _slow_changes(count: int, slow: int) -> FloatArray:
    """Orthonormal polynomials along so many blocks, shape (count, slow)."""
    return np.linalg.qr(np.linspace(-1.0, 1.0, count)[:, None] ** np.arange(slow))[0]
