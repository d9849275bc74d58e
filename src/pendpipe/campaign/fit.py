"""Generalised least squares: all records' frequencies and losses, and all priors, at once.

What these say of k, the drag and the added mass stands beside the numbers of the paper's route.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial, singledispatch
from typing import Any, Final, NamedTuple

import numpy as np

from pendpipe.arrays import BoolArray, FloatArray
from pendpipe.campaign.design import Design, Terms, solve, terms_of
from pendpipe.campaign.effects import CATALOGUE, CampaignEffect, wrong_inputs
from pendpipe.estimate import Estimate, chi_square_p_value
from pendpipe.physics import POTENTIAL_FLOW_ADDED_MASS
from pendpipe.solve import Bounds, Problem, Weighted, minimise

STEP: Final = 1e-4
"""Of the derivatives, in standard deviations of the priors."""

_APPROACH: Final = (1e-4, 1e-2)
"""Weights of the data on the way to the optimum. Where weights nearly balance, the frequency that
is configured can be several times the measured one, by a million of its standard deviations."""


class Candidate(NamedTuple):
    """An effect with its discrete shape."""

    effect: CampaignEffect
    shape: Any = None

    @property
    def bounds(self) -> tuple[float, float]:
        """Of its size, in units of what is expected beforehand."""
        low, high = self.effect.parameter.low, self.effect.parameter.high
        return low / self.effect.expected, high / self.effect.expected


@singledispatch
def candidates(design: Any) -> list[Candidate]:
    """The whole catalogue with its shapes, and every input; a table of numbers has its own."""
    known = (*CATALOGUE.values(), *wrong_inputs(design))
    return [Candidate(each, shape) for each in known for shape in each.shapes_in(design)]


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
        Whitening matrices, shape (records, 2, 2): the inverse Cholesky factor of each record's
        covariance.
    """

    values: FloatArray
    whitening: FloatArray


def measured(values: FloatArray, covariance: FloatArray) -> Measured:
    """Whiten each record by its covariance of frequency and b, shape (records, 2, 2)."""
    return Measured(values, np.linalg.inv(np.linalg.cholesky(covariance)))


def terms_with(design: Design, added: Sequence[Candidate], unknowns: FloatArray) -> Terms:
    """The equation of motion with effects in it, for unknowns of shape (..., n).

    The unknowns are the nuisances in standard deviations of their priors, then the effects' sizes
    in those expected of them.
    """
    count = len(design.nuisances)
    moved = unknowns[..., :count]
    sizes = [
        unknowns[..., count + number, None] * one.effect.expected
        for number, one in enumerate(added)
    ]
    for one, size in zip(added, sizes, strict=True):
        if one.effect.on == "nuisances":
            moved = one.effect.put(moved, size, design, one.shape)
    inputs = design.inputs(moved)
    for one, size in zip(added, sizes, strict=True):
        if one.effect.on == "inputs":
            inputs = one.effect.put(inputs, size, design, one.shape)
    terms = terms_of(design, inputs)
    for one, size in zip(added, sizes, strict=True):
        if one.effect.on == "terms":
            terms = one.effect.put(terms, size, design, one.shape)
    return terms


@singledispatch
def predict(design: Any, added: Sequence[Candidate], unknowns: FloatArray) -> FloatArray:
    """Frequency and b, shape (..., records, 2), for the unknowns of `terms_with`.

    Of a table of published numbers n, shape (..., records, 1).
    """
    return solve(design, terms_with(design, added, unknowns))


@dataclass(frozen=True)
class JointFit:
    """What the data and the priors say together.

    Parameters
    ----------
    design, data, added
        The model: the design (or a table of published numbers) with these effects.
    unknowns
        As in `predict`.
    residuals
        Whitened data, then priors.
    jacobian
        Of the residuals.
    shaped
        Their derivatives by the logarithms of what is fitted of shapes, shape (rows, shapes).
    """

    design: Any
    data: Measured
    added: tuple[Candidate, ...]
    unknowns: FloatArray
    residuals: FloatArray
    jacobian: FloatArray
    shaped: FloatArray

    @property
    def tangent(self) -> FloatArray:
        """Derivatives of the residuals by all that is fitted."""
        return np.concatenate([self.jacobian, self.shaped], axis=-1)

    @property
    def chi2(self) -> float:
        """Of data and priors."""
        return float(self.residuals @ self.residuals)

    @property
    def degrees_of_freedom(self) -> int:
        """Data less what is free: a prior weighs as much as its unknown."""
        return len(self.residuals) - len(self.tangent.T)

    @property
    def free(self) -> BoolArray:
        """Which unknowns are fitted, shape (unknowns,): all but the sizes on their bounds."""
        low, high = _bounds(self.design, self.added)
        return np.asarray((self.unknowns > low) & (self.unknowns < high))

    @cached_property
    def root(self) -> FloatArray:
        """A square root of the covariance, from the Jacobian itself: no variance is negative."""
        _, sizes, directions = np.linalg.svd(self.tangent, full_matrices=False)
        # What no record depends on gets a huge error, not a division by zero.
        return np.asarray(directions.T / np.sqrt(sizes**2 + 1e-12))[: len(self.unknowns)]

    @cached_property
    def covariance(self) -> FloatArray:
        """Of the unknowns."""
        return np.asarray(self.root @ self.root.T)

    def estimate(self, number: int, unit: str, scale: float, about: float = 0.0) -> Estimate:
        """One unknown as an estimate of ``about + scale u``."""
        sd = float(np.sqrt(self.covariance[number, number]))
        return Estimate(about + scale * float(self.unknowns[number]), abs(scale) * sd, unit)

    def size(self, position: int = -1, about: float = 0.0) -> Estimate:
        """The size of an added effect, by default of the last; `about` is what it adds to."""
        effect = self.added[position].effect
        return self.estimate(
            range(len(self.design.nuisances), len(self.unknowns))[position],
            effect.parameter.unit,
            effect.expected,
            about,
        )

    @property
    def last(self) -> CampaignEffect:
        """The effect that was added last."""
        return self.added[-1].effect

    @property
    def log_evidence(self) -> float:
        """Logarithm of the last effect's evidence, for a Gaussian prior of its size (Laplace)."""
        sd = float(np.sqrt(self.covariance[-1, -1]))
        shapes = len(self.last.shapes_in(self.design))
        penalty = self.chi2 + float(self.unknowns[-1]) ** 2
        return -0.5 * penalty + math.log(min(sd, 1.0)) - math.log(shapes)

    @cached_property
    def prediction(self) -> FloatArray:
        """Frequency and b of every record, shape (records, 2)."""
        return predict(self.design, self.added, self.unknowns)

    def derivative(self, candidate: Candidate) -> FloatArray:
        """Change of the residuals with the size of one more effect, at none."""
        at = np.stack([np.append(self.unknowns, size) for size in (STEP, 0.0)])
        ends = _residuals(self.design, self.data, (*self.added, candidate), at)
        return np.asarray((ends[0] - ends[1]) / STEP)


def joint_fit(
    design: Any,
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
    bounds = _bounds(design, added)
    for weight in (*(_APPROACH if start is None else ()), 1.0):
        weighted = data._replace(whitening=weight * data.whitening)
        problem = Problem(partial(_weighted, design, weighted, added), bounds)
        found = minimise(problem, first)
        first = found.value
    shaped = _by_shapes(design, data, added, first)
    point = found.point
    return JointFit(design, data, added, first, -point.residual, point.columns, shaped)


def _by_shapes(
    design: Any, data: Measured, added: tuple[Candidate, ...], unknowns: FloatArray
) -> FloatArray:
    """Derivatives of the residuals by the logarithms of the shapes that are sought."""
    columns = [np.zeros((0, len(_residuals(design, data, added, unknowns))))]
    for at, one in enumerate(added):
        for turn in np.eye(len(one.shape)) if one.effect.finer else ():
            ends = [
                one._replace(shape=tuple((one.shape * np.exp(step * turn)).tolist()))
                for step in (STEP, -STEP)
            ]
            moved = [
                _residuals(design, data, (*added[:at], end, *added[at + 1 :]), unknowns)
                for end in ends
            ]
            columns.append((moved[0] - moved[1])[None] / (2.0 * STEP))
    return np.concatenate(columns).T


def _weighted(
    design: Any, data: Measured, added: Sequence[Candidate], unknowns: FloatArray
) -> Weighted:
    return Weighted(
        unknowns,
        -_residuals(design, data, added, unknowns),
        partial(_derivatives, design, data, added),
    )


def _bounds(design: Any, added: Sequence[Candidate]) -> Bounds:
    """Least and largest values of the unknowns, of which the effects' sizes alone are bound."""
    nuisances = [(-np.inf, np.inf)] * len(design.nuisances)
    return Bounds(*np.array([*nuisances, *(one.bounds for one in added)]).T)


def chi2_near(
    design: Any, data: Measured, added: Sequence[Candidate], unknowns: FloatArray
) -> float:
    """Least chi^2 of the model that is linear about some unknowns."""
    residuals = _residuals(design, data, added, unknowns)
    basis, _ = np.linalg.qr(_derivatives(design, data, added, unknowns))
    left = residuals - basis @ (basis.T @ residuals)
    return float(left @ left)


@np.errstate(invalid="ignore", over="ignore", divide="ignore")
def _residuals(
    design: Any, data: Measured, added: Sequence[Candidate], unknowns: FloatArray
) -> FloatArray:
    """Whitened data, then priors; shape (..., rows)."""
    found = predict(design, added, unknowns)
    off = found - data.values
    if isinstance(design, Design):
        # As f^2, which is linear in where the weights are, however near they are to balance.
        off[..., 0] *= 0.5 * (1.0 + found[..., 0] / data.values[:, 0])
    white = np.einsum("rij,...rj->...ri", data.whitening, off)
    white = white.reshape(*white.shape[:-2], -1)
    priors = unknowns[..., : len(design.nuisances)][..., design.has_prior]
    # A pendulum that would turn over predicts nothing: far off, but finite.
    rows = np.concatenate([white, priors], axis=-1)
    return np.asarray(np.nan_to_num(rows, nan=1e6, posinf=1e6, neginf=-1e6))


def _derivatives(
    design: Any, data: Measured, added: Sequence[Candidate], unknowns: FloatArray
) -> FloatArray:
    """Central differences of the residuals, all at once; shape (rows, unknowns)."""
    steps = STEP * np.eye(len(unknowns))
    ends = [_residuals(design, data, added, unknowns + each) for each in (steps, -steps)]
    return np.asarray((ends[0] - ends[1]).T / (2.0 * STEP))


def only(design: Design, data: Measured, keep: BoolArray) -> tuple[Design, Measured]:
    """The chosen records; shape of `keep` (records,), boolean."""
    chosen = np.flatnonzero(keep)
    runs = tuple(design.runs[number] for number in chosen)
    return replace(design, runs=runs), Measured(data.values[chosen], data.whitening[chosen])


def joint_values(design: Design, data: Measured) -> dict[str, Any]:
    """k, drag factor, C_H and added mass, with and without the benchmark.

    All are over Eq. 16, whose walls are far away. Beside the drag the added mass is free: no wall
    changes the one without the other. The loss torque in the fluid is none of them: with one factor
    for all of the drag it is what the law of the drag leaves over.

    Returns
    -------
    dict
        ``with_benchmark`` and ``without_benchmark`` (None where it cannot be fitted), each with
        estimates and the chi^2 of its fits; the form of campaign.json.
    """
    design = replace(design, walls=False)
    wet = design.wet > 0.0
    alone = _values(*only(design, data, wet)) if not wet.all() and wet.sum() > 1 else None
    return {"with_benchmark": _values(design, data), "without_benchmark": alone}


def _values(design: Design, data: Measured) -> dict[str, Any]:
    plain = joint_fit(design, data)
    factor, history = (
        joint_fit(design, data, named(name, "added-mass"), plain.unknowns)
        for name in ("uniform-drag-excess", "history-term")
    )
    return {
        "hysteretic_coefficient": coefficient(factor).as_json(),
        "drag_factor": factor.size(0, about=1.0).as_json(),
        "history_coefficient": history.size(0, about=1.0).as_json(),
        "added_mass_coefficient": factor.size(about=POTENTIAL_FLOW_ADDED_MASS).as_json(),
        "fits": {
            name: {
                "chi2": fit.chi2,
                "dof": fit.degrees_of_freedom,
                "p_value": chi_square_p_value(fit.chi2, fit.degrees_of_freedom),
            }
            for name, fit in (("eq16", plain), ("drag_factor", factor), ("history", history))
        },
    }


def coefficient(fit: JointFit) -> Estimate:
    """Return k of ``Q_hys = k f^2`` at the reference inertia, of the first assembly."""
    value = fit.design.coefficient_s2 * float(np.exp(fit.unknowns[0]))
    return Estimate(value, value * float(np.sqrt(fit.covariance[0, 0])), "s^2")


def loss_torques(fit: JointFit) -> dict[str, Estimate]:
    """Return kappa'' of each assembly at the reference inertia, ``4 pi^2 I_0/k``."""
    design, found = fit.design, {}
    for name in design.assemblies:
        slope = np.zeros(len(fit.unknowns))
        slope[0] = -1.0
        if (number := design.index.get(f"loss torque in {name}")) is not None:
            slope[number] = design.sds[number]
        log = float(slope @ fit.unknowns) - np.log(design.coefficient_s2)
        value = 4.0 * np.pi**2 * design.reference_inertia * float(np.exp(log))
        sd = value * float(np.sqrt(slope @ fit.covariance @ slope))
        found[name] = Estimate(value, sd, "N m/rad")
    return found


def inertia_errors(design: Design) -> tuple[FloatArray, FloatArray]:
    """Standard deviations of I from what is measured of the apparatus, correlated over records.

    Returns
    -------
    from_distances, from_frequency
        Changes of I (with its added mass), relative, for one sd of each nuisance, shape
        (nuisances, records): from distances and masses, and as ``K/omega^2`` of a measured
        frequency. The covariance over the records is ``x.T @ x``.
    """
    steps = 0.01 * np.eye(len(design.nuisances))
    ends = [terms_of(design, design.inputs(sign * steps)) for sign in (1.0, -1.0)]
    torques = [np.log(end.torque) for end in ends]
    inertias = [np.log(end.torque / end.angular_frequency**2) for end in ends]
    known = design.has_prior[:, None]
    return (
        known * (inertias[0] - inertias[1]) / 0.02,
        known * (torques[0] - torques[1]) / 0.02,
    )


class InertiaSds(NamedTuple):
    """Relative standard deviations of one record's moment of inertia, as `inertia_errors`."""

    from_distances: float
    from_frequency: float


def inertia_sds(design: Design) -> dict[str, InertiaSds]:
    """Return the errors of `inertia_errors` by record."""
    sds = np.array([np.sqrt(np.sum(each**2, axis=0)) for each in inertia_errors(design)]).T
    return {run.record: InertiaSds(*e) for run, e in zip(design.runs, sds.tolist(), strict=True)}
