"""Generalised least squares: all records' frequencies and losses, and all priors, at once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Final, NamedTuple

import numpy as np

from pendpipe.arrays import BoolArray, FloatArray
from pendpipe.campaign.design import Design
from pendpipe.campaign.effects import CATALOGUE, CampaignEffect
from pendpipe.campaign.prediction import solve, terms_of
from pendpipe.estimate import Estimate

STEP: Final = 1e-4
"""Of the derivatives, in standard deviations of the priors."""


class Candidate(NamedTuple):
    """An effect with its discrete shape."""

    effect: CampaignEffect
    shape: Any = None

    @property
    def key(self) -> str:
        """What distinguishes it."""
        words = self.shape if isinstance(self.shape, tuple) else (self.shape,)
        return " ".join([self.effect.identifier, *(str(w) for w in words if w is not None)])

    @property
    def bounds(self) -> tuple[float, float]:
        """Of its size, in units of what is expected beforehand."""
        low, high = self.effect.parameter.low, self.effect.parameter.high
        return low / self.effect.expected, high / self.effect.expected


def candidates(design: Design) -> list[Candidate]:
    """The whole catalogue with its shapes."""
    return [
        Candidate(each, shape) for each in CATALOGUE.values() for shape in each.shapes_in(design)
    ]


def named(*identifiers: str) -> tuple[Candidate, ...]:
    """Effects without a shape, by identifier."""
    return tuple(Candidate(CATALOGUE[name]) for name in identifiers)


class Measured(NamedTuple):
    """Frequency and b of every record.

    Parameters
    ----------
    values
        Hz and 1/s, shape (records, 2).
    whitening
        Whitening matrices, shape (records, rows, 2): the inverse Cholesky factor of each record's
        covariance; one row where only b is used.
    """

    values: FloatArray
    whitening: FloatArray


def measured(values: FloatArray, covariance: FloatArray, *, frequency: bool = True) -> Measured:
    """Whiten each record by its covariance of frequency and b, shape (records, 2, 2)."""
    if not frequency:
        sd = np.sqrt(covariance[:, 1, 1])
        return Measured(values, np.stack([0.0 * sd, 1.0 / sd], axis=-1)[:, None, :])
    return Measured(values, np.linalg.inv(np.linalg.cholesky(covariance)))


def predict(design: Design, added: Sequence[Candidate], unknowns: FloatArray) -> FloatArray:
    """Frequency and b, shape (..., records, 2), for unknowns of shape (..., n).

    The unknowns are the nuisances in standard deviations of their priors, then the effects' sizes
    in those expected of them.
    """
    count = len(design.nuisances)
    inputs = design.inputs(unknowns[..., :count])
    sizes = [
        unknowns[..., count + number, None] * one.effect.expected
        for number, one in enumerate(added)
    ]
    for one, size in zip(added, sizes, strict=True):
        if one.effect.on == "inputs":
            inputs = one.effect.put(inputs, size, design, one.shape)
    terms = terms_of(design, inputs)
    for one, size in zip(added, sizes, strict=True):
        if one.effect.on == "terms":
            terms = one.effect.put(terms, size, design, one.shape)
    return solve(design, terms)


@dataclass(frozen=True)
class JointFit:
    """What the data and the priors say together.

    Parameters
    ----------
    design, data, added
        The model: the design with these effects.
    unknowns
        As in `predict`.
    residuals
        Whitened data, then priors.
    jacobian
        Of the residuals.
    """

    design: Design
    data: Measured
    added: tuple[Candidate, ...]
    unknowns: FloatArray
    residuals: FloatArray
    jacobian: FloatArray

    @property
    def chi2(self) -> float:
        """Of data and priors."""
        return float(self.residuals @ self.residuals)

    @property
    def degrees_of_freedom(self) -> int:
        """Data less what is free: a prior weighs as much as its unknown."""
        return len(self.residuals) - len(self.unknowns)

    @cached_property
    def covariance(self) -> FloatArray:
        """Of the unknowns."""
        information = self.jacobian.T @ self.jacobian
        # What no record depends on gets a huge error, not a division by zero.
        return np.asarray(np.linalg.inv(information + 1e-12 * np.eye(len(information))))

    def estimate(self, number: int, unit: str, scale: float, about: float = 0.0) -> Estimate:
        """One unknown as an estimate of ``about + scale u``."""
        sd = float(np.sqrt(self.covariance[number, number]))
        return Estimate(about + scale * float(self.unknowns[number]), abs(scale) * sd, unit)

    def size(self, position: int) -> Estimate:
        """The size of an added effect."""
        effect = self.added[position].effect
        number = len(self.design.nuisances) + position
        return self.estimate(number, effect.parameter.unit, effect.expected)

    @cached_property
    def prediction(self) -> FloatArray:
        """Frequency and b of every record, shape (records, 2)."""
        return predict(self.design, self.added, self.unknowns)

    def derivative(self, candidate: Candidate) -> FloatArray:
        """Change of the residuals with the size of one more effect, at none."""
        wider, at = (*self.added, candidate), np.append(self.unknowns, 0.0)
        step = np.zeros(len(at))
        step[-1] = STEP
        ends = _residuals(self.design, self.data, wider, at + np.array([[1.0], [0.0]]) * step)
        return np.asarray((ends[0] - ends[1]) / STEP)


def joint_fit(
    design: Design,
    data: Measured,
    added: Sequence[Candidate] = (),
    start: FloatArray | None = None,
) -> JointFit:
    """Fit nuisances and effects to all records and priors.

    Parameters
    ----------
    design, data
        What was measured, and where.
    added
        Effects whose sizes are free within their bounds.
    start
        Unknowns to start from; missing ones start at zero.

    Returns
    -------
    JointFit
        With the derivatives at the optimum.
    """
    added = tuple(added)
    count = len(design.nuisances)
    first = np.zeros(count + len(added))
    if start is not None:
        first[: len(start)] = start[: len(first)]
    low, high = np.full(len(first), -np.inf), np.full(len(first), np.inf)
    for number, one in enumerate(added):
        low[count + number], high[count + number] = one.bounds
    with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
        at = _least_squares(design, data, added, first, np.ones(len(first), dtype=np.bool_))
        outside = (at < low) | (at > high)
        if outside.any():  # that size stays on its bound
            at = _least_squares(design, data, added, np.clip(at, low, high), ~outside)
        at = np.clip(at, low, high)
        rows = _residuals(design, data, added, at), _derivatives(design, data, added, at)
    return JointFit(design, data, added, at, *rows)


def chi2_near(
    design: Design, data: Measured, added: Sequence[Candidate], unknowns: FloatArray
) -> float:
    """Least chi^2 of the model that is linear about some unknowns."""
    with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
        residuals = _residuals(design, data, added, unknowns)
        basis, _ = np.linalg.qr(_derivatives(design, data, added, unknowns))
    left = residuals - basis @ (basis.T @ residuals)
    return float(left @ left)


def _least_squares(
    design: Design,
    data: Measured,
    added: Sequence[Candidate],
    first: FloatArray,
    free: BoolArray,
) -> FloatArray:
    """Return the unknowns at the optimum, those not `free` held where they are."""
    from scipy.optimize import least_squares

    def whole(part: FloatArray) -> FloatArray:
        at = first.copy()
        at[free] += part
        return at

    def residuals(part: FloatArray) -> FloatArray:
        return _residuals(design, data, added, whole(part))

    def derivatives(part: FloatArray) -> FloatArray:
        return np.asarray(_derivatives(design, data, added, whole(part))[:, free])

    # From zero: MINPACK's first step goes as far as its starting point lies from there.
    start = np.zeros(int(free.sum()))
    found = least_squares(
        residuals, start, jac=derivatives, method="lm", xtol=1e-10, ftol=1e-10, max_nfev=100
    )
    return whole(found.x)


def _residuals(
    design: Design, data: Measured, added: Sequence[Candidate], unknowns: FloatArray
) -> FloatArray:
    """Whitened data, then priors; shape (..., rows)."""
    off = predict(design, added, unknowns) - data.values
    white = np.einsum("rij,...rj->...ri", data.whitening, off)
    white = white.reshape(*white.shape[:-2], -1)
    priors = unknowns[..., : len(design.nuisances)][..., design.has_prior]
    # A pendulum that would turn over predicts nothing: far off, but finite.
    rows = np.concatenate([white, priors], axis=-1)
    return np.asarray(np.nan_to_num(rows, nan=1e6, posinf=1e6, neginf=-1e6))


def _derivatives(
    design: Design, data: Measured, added: Sequence[Candidate], unknowns: FloatArray
) -> FloatArray:
    """Central differences of the residuals, all at once; shape (rows, unknowns)."""
    steps = np.full(len(unknowns), STEP)
    both = unknowns + np.concatenate([np.diag(steps), -np.diag(steps)])
    moved = _residuals(design, data, added, both)
    half = len(unknowns)
    return np.asarray((moved[:half] - moved[half:]).T / (2.0 * steps))
