"""Average over how b divides into its two parts, which one recording hardly tells.

Any roots of both parts are as likely beforehand (Jeffreys' prior of rates): one part alone is no
rarity.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import product
from typing import Final, NamedTuple

import numpy as np

from pendpipe.analysis.fit.waveform import DRIFT, Waveform
from pendpipe.arrays import FloatArray
from pendpipe.dynamics.eq8 import OMEGA, SHARE, START, A, B, C

_SHARES: Final = 33
"""Shares at which the likelihood is looked at, in a range that narrows until some of them count."""
_ENOUGH: Final = 8
"""Shares that count from which their mean is taken: the trapezoids of a bell are right to 1e-3."""
_UNLIKELY: Final = 0.02
"""Of the most likely, below which a share does not count."""
_LEAST: Final = 1e-60
"""Instead of zero, where a number is divided by."""
_SUBSETS: Final = np.array(list(product((1.0, 0.0), repeat=3)))
"""Of a, b, c that are not at their bound."""
_SLACK: Final = 1e-12
"""Part of a value by which rounding may take it below zero."""
_RIDGE: Final = 1e-13
"""For what the readings do not tell apart."""
_ZOOMS: Final = 12
"""Narrowings at most: each to a sixteenth of the range or less where nothing counts between."""


class Marginal(NamedTuple):
    """The parameters where b's hysteretic share is what the readings expect of it."""

    value: FloatArray
    """Shape (9,), the share among them."""
    covariance: FloatArray
    """With what the unknown share adds, shape (9, 9)."""
    gradient: FloatArray
    """Of -chi^2/2 at the mean share, shape (9,)."""
    chi2: float
    """Above the fit's."""


def marginalised(
    problem: Waveform,
    value: FloatArray,
    held: Sequence[int],
    noise_rms: float,
    enlarged: float = 1.0,
) -> Marginal:
    """Average over the share: at each the others are at their bounded minimum.

    Parameters
    ----------
    problem, value
        The readings and a minimum, where `problem` was evaluated last.
    held
        Indices that are not fitted.
    noise_rms, enlarged
        The noise by which chi^2 counts, and by what its variance is enlarged.
    """
    losses = _LossProfile(problem, value, held, noise_rms, enlarged)
    low, high = (0.0, 0.5 * math.pi) if SHARE not in held else (0.0, 0.0)
    for _ in range(_ZOOMS):
        arc = np.linspace(low, high, _SHARES if low < high else 1)
        shares = np.sin(arc) ** 2 if low < high else value[[SHARE]]
        found = losses.at(shares)
        # At a share b counts as wide as it is known.
        width = np.sqrt(np.maximum(found.covariance[:, B, B], _LEAST))
        likely = width * np.exp(0.5 * (found.chi2.min() - found.chi2))
        likely /= likely.max()
        inside = np.flatnonzero(likely > _UNLIKELY)
        if len(inside) >= min(_ENOUGH, len(shares)):
            break
        first, last = max(int(inside[0]) - 1, 0), min(int(inside[-1]) + 1, _SHARES - 1)
        low, high = float(arc[first]), float(arc[last])
    likely[[0, -1]] *= 0.5
    likely /= likely.sum()
    share = float(likely @ shares)
    return losses.averaged(share, losses.at(np.array([share])), shares, found, likely)


class _Conditional(NamedTuple):
    """At k shares: steps of a, b, c to their bounded minimum, and what they leave."""

    step: FloatArray
    """Shape (k, 3)."""
    parts: FloatArray
    """Steps of a, both parts of b, and c, shape (k, 4)."""
    change: FloatArray
    """Of the latter by the former, shape (k, 4, 3)."""
    chi2: FloatArray
    """Above the fit's, shape (k,)."""
    covariance: FloatArray
    """Of a, b, c, shape (k, 3, 3)."""
    gradient: FloatArray
    """Of -chi^2/2, shape (k, 3)."""


class _LossProfile:
    """Chi^2 as a function of the losses alone, all else at its minimum.

    Parameters
    ----------
    problem, value, held, noise_rms, enlarged
        As for `marginalised`.
    """

    def __init__(
        self,
        problem: Waveform,
        value: FloatArray,
        held: Sequence[int],
        noise_rms: float,
        enlarged: float,
    ) -> None:
        self.problem, self.value = problem, value
        gradient, normal = problem.by_parts(value)
        scale = (1.0 if problem.step else (problem.noise_rms / noise_rms) ** 2) / enlarged
        gradient, normal = gradient * scale, normal * scale
        # Which of a, b, c are fitted, 1 or 0; and what else is.
        self.free: FloatArray = np.array([float(j not in held) for j in (A, B, C)])
        self.rest = rest = [j for j in range(OMEGA, DRIFT + 1) if j not in held]
        size = 1.0 / np.sqrt(np.maximum(normal[rest, rest], _LEAST))
        within = normal[np.ix_(rest, rest)] * size[:, None] * size + _RIDGE * np.eye(len(rest))
        # Covariance of the rest at known losses, its derivative by a, both parts of b and c, and
        # what it moves by at the same losses.
        self.own = np.linalg.inv(within) * size[:, None] * size
        self.following, self.settling = -self.own @ normal[rest, :4], self.own @ gradient[rest]
        # Of what is known at all: what the rest leaves of it may be rounding.
        ridge = np.diag(_RIDGE * normal.diagonal()[:4] + _LEAST)
        self.normal = ridge + normal[:4, :4] + normal[:4, rest] @ self.following
        self.gradient = gradient[:4] - normal[:4, rest] @ self.settling

    def at(self, shares: FloatArray) -> _Conditional:
        """Minimise over a, b, c within their bounds at each share."""
        value, change = self.value, np.zeros((len(shares), 4, 3))
        change[:, [0, 3], [A, C]] = 1.0
        change[:, 1:3, B] = [self.problem.parts_of_b(share) for share in shares.tolist()]
        # Only the parts of b differ, by as much as each other.
        off = np.zeros((len(shares), 4))
        off[:, 1] = value[B] * (shares - value[SHARE])
        off[:, 2] = -off[:, 1]
        normal = change.swapaxes(1, 2) @ self.normal @ change
        gradient = np.einsum("kqp,kq->kp", change, self.gradient - off @ self.normal)
        step = _not_negative(normal, gradient, value[:3], self.free)
        off += np.einsum("kpq,kq->kp", change, step)
        chi2 = np.einsum("kp,pq,kq->k", off, self.normal, off) - 2.0 * off @ self.gradient
        y = abs(float(value[START]))
        loss = float(value[A]) * y + float(value[B]) + float(value[C]) / y
        # No loss is more than the whole.
        whole = np.array([y, 1.0, 1.0 / y]) ** 2 / max(loss**2, 1e-200)
        both = np.outer(self.free, self.free)
        spread = np.linalg.inv((normal + np.diag(whole)) * both + np.diag(1.0 - self.free)) * both
        left = gradient - np.einsum("kpq,kq->kp", normal, step)
        return _Conditional(step, off, change, chi2, spread, left)

    def averaged(
        self,
        share: float,
        mean: _Conditional,
        shares: FloatArray,
        found: _Conditional,
        weight: FloatArray,
    ) -> Marginal:
        """All parameters at the mean share, and what theirs at the others scatter."""
        others = found.parts @ self.following.T + self.settling
        (own,), (settled,) = mean.step, mean.parts @ self.following.T + self.settling
        best, matrix, gradient = self.value.copy(), np.zeros((9, 9)), np.zeros(9)
        best[:3], best[SHARE], gradient[:3] = best[:3] + own, share, mean.gradient[0]
        best[self.rest] += settled
        places = [*range(3), *self.rest]
        tied = np.zeros((len(shares), len(places), 3))
        tied[:, :3], tied[:, 3:] = np.eye(3), self.following @ found.change
        each = (weight[:, None, None] * tied) @ found.covariance @ tied.swapaxes(1, 2)
        matrix[np.ix_(places, places)] = each.sum(axis=0)
        matrix[np.ix_(self.rest, self.rest)] += self.own
        off = np.zeros((len(shares), 9))
        off[:, :3], off[:, SHARE] = found.step - own, shares - share
        off[:, self.rest] = others - settled
        matrix += (weight[:, None] * off).T @ off
        return Marginal(best, matrix, gradient, float(mean.chi2[0]))


def _not_negative(
    normal: FloatArray, gradient: FloatArray, value: FloatArray, free: FloatArray
) -> FloatArray:
    """Steps of a, b, c that minimise ``d' H d/2 - g' d`` and leave none below zero, shape (k, 3).

    The best of those with any of them at its bound.
    """
    step, least = np.zeros_like(gradient), np.full(len(gradient), np.inf)
    subsets = _SUBSETS[(free >= _SUBSETS).all(axis=1)]
    # Most shares have the same ones at their bound.
    subsets = subsets[np.argsort(np.abs(subsets - (value > 0.0)).sum(axis=1), kind="stable")]
    left = np.arange(len(gradient))
    for chosen in subsets:
        own, pull = normal[left], gradient[left]
        at_zero = (free - chosen) * -value
        system = own * np.outer(chosen, chosen) + np.diag(1.0 - chosen)
        right = (pull - own @ at_zero) * chosen + at_zero
        tried = np.linalg.solve(system, right[..., None])[..., 0]
        slope = pull - np.einsum("kpq,kq->kp", own, tried)
        cost = -np.sum(tried * (pull + slope), 1)
        inside = (tried >= -value - _SLACK * np.abs(value)).all(axis=1)
        better = inside & (cost < least[left])
        step[left[better]], least[left[better]] = tried[better], cost[better]
        # A minimum: what is at its bound is pulled beyond it.
        left = left[~(inside & (slope * (free - chosen) <= 0.0).all(axis=1))]
        if not len(left):
            break
    return np.maximum(step, -value)
