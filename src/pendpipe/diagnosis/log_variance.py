"""The logarithm of a variance that changes smoothly, from squares of normal numbers.

Noise has no form that is known beforehand. Only that its variance changes smoothly is assumed:
along the frequency (its spectrum) or along the record (its level). ln S is a sum of a constant and
of smooth random functions whose strengths are unknown, zero among them, so that a variance that
does not change is found to be constant, and precisely so.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from typing import Final, NamedTuple

import numpy as np

from pendpipe.arrays import BoolArray, FloatArray, IntArray

_LEVEL_SD: Final = 10.0
"""Of the constant, about the mean of the squares: nothing is known of it."""
_LINES: Final = 1e-3
"""Part of the squares that may be lines and no noise."""
_RANGE_OF_LINES: Final = 20.0
"""Of ln P, over which they spread."""
_NOT_NOISE: Final = -2.0 * math.log(_LINES / _RANGE_OF_LINES) - math.log(2.0 * math.pi)
"""r - ln r above which a square of r times the variance is more probably no noise."""
_ROUNDS: Final = 12
_CONVERGED: Final = 1e-3
_CLEANINGS: Final = 3


class Squares(NamedTuple):
    """Squares of normal numbers, and the bins in which their variance is taken as constant.

    Parameters
    ----------
    value
        Shape (n,).
    known
        Which of them are noise, as far as is known beforehand; shape (n,).
    starts
        The index of each bin's first square, shape (m,).
    lines_from
        The first square that may be a line and no noise.
    independent
        Independent numbers in each square: less than one where they are not normal.
    """

    value: FloatArray
    known: BoolArray
    starts: IntArray
    lines_from: int = 0
    independent: float = 1.0


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


@dataclass(frozen=True)
class LogVariance:
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


class _Found(NamedTuple):
    mean: FloatArray
    spread: FloatArray
    cost: float
    charge: float


def log_variance(squares: Squares, smooth: Sequence[Smooth]) -> LogVariance:
    """Estimate ln S: a weighted mean over all strengths, each by Laplace's approximation."""
    strengths = list(product(*(each.strengths for each in smooth)))
    found = [_at_strengths(squares, smooth, each) for each in strengths]
    cost = np.array([each.cost for each in found]) - 2.0 * np.log(_prior(smooth))
    weight = np.exp(-0.5 * (cost - cost.min()))
    total = float(weight.sum())
    constant = float(weight[0]) / total
    weight /= total
    mean = np.einsum("j,jm->m", weight, np.array([each.mean for each in found]))
    covariance = np.zeros((len(mean), len(mean)))
    for share, each in zip(weight.tolist(), found, strict=True):
        if share > 1e-4:
            off = each.mean - mean
            covariance += share * (each.spread @ each.spread.T + np.outer(off, off))
    best = found[int(np.argmin(cost))]
    averaged = float(cost.min()) - 2.0 * math.log(total) - best.cost
    return LogVariance(mean, covariance, constant, best.charge + averaged)


def stands_out(ratio: FloatArray | float) -> BoolArray:
    """Return whether squares that are so many times the variance are more probably no noise."""
    return np.asarray((np.asarray(ratio) > 1.0) & (ratio - np.log(ratio) > _NOT_NOISE))


def _prior(smooth: Sequence[Smooth]) -> FloatArray:
    """Return the probability of each combination of strengths."""
    others = [len(each.strengths) - 1 for each in smooth]
    parts = [[0.5] + [0.5 / number] * number if number else [1.0] for number in others]
    return np.array([math.prod(shares) for shares in product(*parts)])


def _at_strengths(squares: Squares, smooth: Sequence[Smooth], strengths: Sequence[float]) -> _Found:
    """Return mean and covariance (as a root) of ln S for given strengths."""
    starts, bins = squares.starts, len(squares.starts)
    parts = [size * each.columns for each, size in zip(smooth, strengths, strict=True) if size]
    columns = np.concatenate([np.full((bins, 1), _LEVEL_SD), *parts], axis=1)
    width = np.diff(np.append(starts, len(squares.value)))
    value = np.maximum(squares.value, 1e-300)
    noise = squares.known
    may_be_line = noise & (np.arange(len(value)) >= squares.lines_from)
    number, total = _binned(noise, value, starts)
    share = squares.independent
    middle = math.log(max(float(total.sum()) / max(float(number.sum()), 1.0), 1e-300))
    # A start that single lines don't move: the mean of ln P in each bin is 1.27 too low.
    logs = np.add.reduceat(np.where(noise, np.log(value) - middle + 1.27, 0.0), starts)
    normal = columns.T @ (columns * (0.2 * number)[:, None]) + np.eye(columns.shape[1])
    at = np.asarray(np.linalg.solve(normal, columns.T @ (0.2 * logs)), dtype=np.float64)
    for _ in range(_CLEANINGS):
        log = columns @ at
        ratio = value / np.exp(np.repeat(log, width) + middle)
        lines = may_be_line & stands_out(ratio)
        clean = squares.known & ~lines
        changed = not np.array_equal(clean, noise)
        noise = clean
        number, total = _binned(noise, value, starts)
        at, root = _maximised(columns, share * number, share * total / math.exp(middle), at)
        if not changed:
            break
    log = columns @ at
    cost = share * float(np.sum(number * (log + middle) + total / np.exp(log + middle)))
    cost += float(np.sum(np.log(value[lines]))) + np.count_nonzero(lines) * _NOT_NOISE
    charge = float(at @ at) + 2.0 * float(np.sum(np.log(np.diag(root))))
    return _Found(log + middle, np.linalg.solve(root, columns.T).T, cost + charge, charge)


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
    root = np.asarray(np.linalg.cholesky(information), dtype=np.float64)
    here = cost(at)
    for _ in range(_ROUNDS):
        pull = 0.5 * columns.T @ (total * np.exp(-(columns @ at)) - number) - at
        step = np.linalg.solve(root.T, np.linalg.solve(root, pull))
        expected = float(pull @ step)
        for part in (1.0, 0.3, 0.1, 0.03):
            there = cost(at + part * step)
            if there < here:
                at, here = at + part * step, there
                break
        else:
            break
        if expected < _CONVERGED:
            break
    return at, root
