"""The campaign's numbers: k, each record's Q and Eq. 16, the drag's factor, C_H, exponents.

All of them come from one joint fit in which the drag of every record in the fluid is free, and the
sphere's added mass: what a record measures is then its own, and what the records share (loss
torque, sphere, temperature, distances, g, clock) is in the covariance. That covariance is
``G G^T`` with a column of G for each reading and each prior, so that an error can be traced to its
sources.
"""

import math
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product
from typing import Any, Final, NamedTuple

import numpy as np

from pendpipe import physics
from pendpipe.arrays import BoolArray, FloatArray
from pendpipe.campaign.design import Design, Terms, loss_torque, solve
from pendpipe.campaign.effects import DRAG_OF_ONE_RECORD, RATE_EXPONENT
from pendpipe.campaign.fit import (
    STEP,
    Candidate,
    JointFit,
    Measured,
    joint_fit,
    named,
    only,
    terms_with,
)
from pendpipe.campaign.tank import by_depth, told
from pendpipe.configuration.models import Tank
from pendpipe.estimate import Estimate, chi_square_p_value, quality_of_rate

WORST_LINE: Final = 1e-6
"""Probability of the benchmark's chi^2 below which no number is made from it."""

CHECKS: Final = tuple(product((True, False), (True, False)))
"""Theories with and without the history term, and with and without the loss torque."""

Quantities = dict[str, FloatArray]


@dataclass(frozen=True)
class Benchmark:
    """The records without a fluid by themselves: ``Q_hys = k f^2 (I/I_0)^(1 - p)``.

    Parameters
    ----------
    chi2, degrees_of_freedom, p_value
        Of their joint fit.
    free_exponent
        x of ``k f^x``, fitted freely: 2 where internal friction doesn't depend on the rate, 1
        for a viscous torque. Infinite error with one frequency only.
    exponent_p_value
        Probability of so large a gain in chi^2 over x = 2 by chance.
    records
        Their names.
    """

    chi2: float
    degrees_of_freedom: int
    p_value: float
    free_exponent: Estimate
    exponent_p_value: float
    records: tuple[str, ...]


class Line(NamedTuple):
    """A number made from all records in the fluid, as `Values.line` gives it."""

    estimate: Estimate
    sd_own: float
    sd_common: float
    chi2: float
    degrees_of_freedom: int
    p_value: float
    budget: dict[str, float]


class Exponent(NamedTuple):
    """A branch as a power law, and how far it is one.

    Parameters
    ----------
    exponent
        The (unweighted) least-squares slope of ln Q_v on ln f over the branch.
    sd_own, sd_common
        The parts of its error from the branch's own readings, and from all else.
    curvature
        Second derivative of ln Q_v with respect to ln f, from a parabola; NaN with fewer than
        three records. Zero for a power law.
    local_slopes
        Between neighbours in frequency, from the lowest up; NaN between equal frequencies.
    records
        The branch in the order of its frequencies.
    """

    exponent: Estimate
    sd_own: float
    sd_common: float
    curvature: Estimate
    local_slopes: tuple[float, ...]
    records: tuple[str, ...]


@dataclass(frozen=True)
class Values:
    """What a campaign with a benchmark measures. Build one with `campaign_values`.

    Parameters
    ----------
    fit
        The joint fit with a free drag of every record in the fluid, and a free added mass.
    benchmark
        The test of the records without a fluid.
    """

    fit: JointFit
    benchmark: Benchmark

    @property
    def design(self) -> Design:
        """Of all records."""
        design: Design = self.fit.design
        return design

    @cached_property
    def wet(self) -> list[int]:
        """The records with a sphere in a fluid, by frequency."""
        frequency = self.fit.data.values[:, 0]
        return sorted(np.flatnonzero(_spheres(self.design)).tolist(), key=frequency.__getitem__)

    @property
    def records(self) -> tuple[str, ...]:
        """The names of `wet`."""
        return tuple(self.design.runs[number].record for number in self.wet)

    @cached_property
    def quantities(self) -> Quantities:
        """Arrays of shape (records,), as `_quantities` names them."""
        return self._at(self.fit.unknowns)

    def _at(self, unknowns: FloatArray) -> Quantities:
        with np.errstate(invalid="ignore", divide="ignore"):  # nothing viscous without a fluid
            return _quantities(self.design, self.fit.added, unknowns)

    @cached_property
    def sources(self) -> dict[str, FloatArray]:
        """G of each of the `quantities`: shape (records, rows of the fit).

        Their changes by one sd of each reading and each prior.
        """
        steps = STEP * np.eye(len(self.fit.unknowns))
        ends = [self._at(self.fit.unknowns + each) for each in (steps, -steps)]
        inverse = self.fit.covariance @ self.fit.jacobian.T / (2.0 * STEP)
        with np.errstate(invalid="ignore"):
            return {name: (ends[0][name] - ends[1][name]).T @ inverse for name in ends[0]}

    @cached_property
    def labels(self) -> list[str]:
        """The source of each row of the fit: a reading's record, or a nuisance."""
        rows = self.fit.data.whitening.shape[1]
        readings = [run.record for run in self.design.runs for _ in range(rows)]
        known = zip(self.design.nuisances, self.design.has_prior.tolist(), strict=True)
        return [*readings, *(each.name for each, prior in known if prior)]

    def own(self, number: int) -> BoolArray:
        """Which rows are one record's alone: its readings, and clamps that no other record has."""
        runs = self.design.runs
        others = {c for n, run in enumerate(runs) if n != number for c in run.weights_m.items()}
        alone = {
            f"distance of {name} at {place:g} m"
            for name, place in runs[number].weights_m.items()
            if (name, place) not in others
        }
        return np.array([label in alone | {runs[number].record} for label in self.labels])

    def estimate(self, name: str, number: int, unit: str = "") -> Estimate:
        """One of the `quantities` of one record."""
        sd = float(np.linalg.norm(self.sources[name][number]))
        return Estimate(float(self.quantities[name][number]), sd, unit)

    def quality(self, rate: str, number: int) -> Estimate:
        """Q of one record from a rate, whose error is the symmetric one."""
        frequency = float(self.quantities["frequency"][number])
        return quality_of_rate(frequency, self.estimate(rate, number, "1/s"))

    @cached_property
    def theory_factor(self) -> Line:
        """Inverse-variance mean of Q_v of Eq. 16 over Q_v measured, by the records' own errors."""
        ones = np.ones(len(self.wet))
        return self.line(ones, 0.0 * self.sources["factor"][self.wet], "factor")

    @cached_property
    def penetration_m(self) -> FloatArray:
        """Delta of the records in the fluid."""
        nothing = np.zeros(len(self.design.nuisances))
        density, viscosity = self.design.fluids(self.design.inputs(nothing).warmer_k)
        omega = 2.0 * np.pi * self.quantities["frequency"]
        with np.errstate(divide="ignore"):
            return np.asarray(physics.penetration_depth(omega, viscosity, density)[self.wet])

    @property
    def _tank(self) -> tuple[Tank, float] | None:
        """The tank that is told, with room for the sphere, and the sphere's radius."""
        tank, sphere = self.design.tank, self.design.apparatus.sphere
        return (tank, 0.5 * sphere.diameter_m) if tank and sphere else None

    @cached_property
    def theory_factor_in_tank(self) -> Estimate | None:
        """As `theory_factor`, over Eq. 16 with the walls of the tank that is told."""
        if self._tank is None:
            return None
        walls = told(*self._tank, self.penetration_m)
        found = self.line(walls.factor, 0.0 * self.sources["factor"][self.wet], "factor").estimate
        relative = float(np.median(walls.sd / walls.factor))
        return replace(found, sd=math.hypot(found.sd, found.value * relative))

    @property
    def walls(self) -> dict[str, Any] | None:
        """The drag over Eq. 2 by the depth of the fluid, at the median frequency (`by_depth`)."""
        if self._tank is None:
            return None
        tank, radius_m = self._tank
        return {
            "frequency_hz": float(np.median(self.quantities["frequency"][self.wet])),
            "told_depth_m": tank.depth_m,
            "told_depth_sd_m": tank.depth_sd_m,
            **by_depth(tank, radius_m, float(np.median(self.penetration_m))),
        }

    @cached_property
    def history_coefficient(self) -> Line:
        """C_H of Eq. 2: the drag's excess over the steady law on that of Eq. 16, less 1 each."""
        x = self.quantities["theory_over_steady"][self.wet] - 1.0
        return self.line(x, self.sources["theory_over_steady"][self.wet], "over_steady", 1.0)

    def line(self, x: FloatArray, moved: FloatArray, name: str, less: float = 0.0) -> Line:
        """Slope of a quantity on x through the origin; `moved` is G of x.

        The weights are the records' own errors. The records are judged about their best line with
        the whole covariance.
        """
        y, errors = self.quantities[name][self.wet] - less, self.sources[name][self.wet]
        own = [self.own(number) for number in self.wet]
        sd = np.array([np.linalg.norm(e[mine]) for e, mine in zip(errors, own, strict=True)])
        weight = x / sd**2
        slope = float(weight @ y / (weight @ x))
        source = weight @ (errors - slope * moved) / (weight @ x)
        mine = np.any(own, axis=0)
        factor = np.linalg.cholesky((errors - slope * moved) @ (errors - slope * moved).T)
        white, along = np.linalg.solve(factor, np.stack([y, x], axis=-1)).T
        left = white - along * (along @ white) / (along @ along)
        chi2, dof = float(left @ left), len(y) - 1
        return Line(
            Estimate(slope, float(np.linalg.norm(source)), ""),
            float(np.linalg.norm(source[mine])),
            float(np.linalg.norm(source[~mine])),
            chi2,
            dof,
            chi_square_p_value(chi2, dof),
            self.budget(source / slope, mine),
        )

    def budget(self, source: FloatArray, own: BoolArray) -> dict[str, float]:
        """Errors by where they come from, the records' own first."""
        variances = {"the records themselves": 0.0}
        dry = {run.record for run in self.design.runs if run.fluid is None}
        for label, mine, part in zip(self.labels, own.tolist(), source.tolist(), strict=True):
            name = "the records themselves" if mine else _SOURCES.get(label.split(" ")[0], label)
            name = "hysteretic coefficient" if label in dry else name
            variances[name] = variances.get(name, 0.0) + part**2
        return {name: math.sqrt(each) for name, each in variances.items() if each > 1e-16}

    @cached_property
    def exponents(self) -> dict[str, Exponent]:
        """Eq. 11 by branch, where a branch has two frequencies and positive losses."""
        branches = dict.fromkeys(self.design.runs[number].branch for number in self.wet)
        found = {branch: self._exponent(branch) for branch in sorted(branches) if branch}
        return {branch: each for branch, each in found.items() if each}

    def _exponent(self, branch: str) -> Exponent | None:
        rows = [number for number in self.wet if self.design.runs[number].branch == branch]
        logs = np.log(self.quantities["frequency"][rows])
        rates = self.quantities["viscous_rate"][rows]
        if len(rows) < 2 or np.ptp(logs) <= 0.0 or not np.all(rates > 0.0):
            return None
        quality = logs - np.log(rates)
        errors = -self.sources["viscous_rate"][rows] / rates[:, None]
        own = np.any([self.own(number) for number in rows], axis=0)

        def derivative(order: int) -> tuple[float, FloatArray]:
            powers = np.vander(logs - np.mean(logs), order + 1, increasing=True)
            # The derivative is a sum of the ln Q_v with these weights; 2 for the parabola's u^2.
            weights = order * np.linalg.pinv(powers)[order]
            return float(weights @ quality), weights @ errors

        slope, source = derivative(1)
        bend, bent = derivative(2) if len(rows) > 2 else (math.nan, np.array([math.nan]))
        steps = np.diff(logs)
        local = np.diff(quality) / np.where(steps > 0.0, steps, np.nan)
        return Exponent(
            Estimate(slope, float(np.linalg.norm(source)), ""),
            float(np.linalg.norm(source[own])),
            float(np.linalg.norm(source[~own])),
            Estimate(bend, float(np.linalg.norm(bent)), ""),
            tuple(local.tolist()),
            tuple(self.design.runs[number].record for number in rows),
        )

    def checks(self) -> list[dict[str, Any]]:
        """Compare b with theories that have or lack two of their terms, as in comparison.json.

        ``ratio`` is the theory's limit of Q over the measured one, above one where it forgets a
        loss; ``chi2`` that of the ratios about one, with the whole covariance.
        """
        found = []
        for history, hysteresis in CHECKS:
            name = _check(history, hysteresis)
            ratio, errors = self.quantities[name][self.wet], self.sources[name][self.wet]
            off = np.linalg.solve(np.linalg.cholesky(errors @ errors.T), ratio - 1.0)
            named = {"history": history, "hysteresis": hysteresis, "ratio": ratio}
            found.append({**named, "chi2": float(off @ off), "dof": len(ratio)})
        return found


_SOURCES: Final = {
    "distance": "distances of the weights",
    "mass": "masses",
    "zero": "distances of the weights",
}
"""Nuisances that stand together in a budget, by the first word of their names."""


def _check(history: bool, hysteresis: bool) -> str:
    return f"{'' if history else 'no '}history, {'' if hysteresis else 'no '}hysteresis"


def _spheres(design: Design) -> BoolArray:
    return np.asarray(design.wet * design.spheres > 0.0)


def campaign_values(design: Design, data: Measured) -> Values | None:
    """Measure every record of a campaign; None without records that swing in no fluid.

    Without such a benchmark the loss torque can't be told from the drag of one record.
    """
    dry = design.wet == 0.0
    if not dry.any():
        return None
    design = replace(design, walls=False)
    each = [
        Candidate(DRAG_OF_ONE_RECORD, run.record)
        for run, sphere in zip(design.runs, _spheres(design).tolist(), strict=True)
        if sphere
    ]
    return Values(
        joint_fit(design, data, [*named("added-mass"), *each]), _benchmark(*only(design, data, dry))
    )


def _benchmark(design: Design, data: Measured) -> Benchmark:
    line = joint_fit(design, data)
    free = joint_fit(design, data, [Candidate(RATE_EXPONENT)], line.unknowns)
    rate = free.size()
    return Benchmark(
        line.chi2,
        line.degrees_of_freedom,
        chi_square_p_value(line.chi2, line.degrees_of_freedom),
        Estimate(2.0 - rate.value, rate.sd, ""),
        chi_square_p_value(line.chi2 - free.chi2, 1),
        tuple(run.record for run in design.runs),
    )


def _quantities(design: Design, added: tuple[Candidate, ...], unknowns: FloatArray) -> Quantities:
    """What is said of each record; shape (..., records).

    ``frequency``; ``hysteretic_quality``, I omega^2/kappa''; ``viscous_rate``, ``theory_rate`` and
    ``steady_rate``, the rates that the fluid alone would give: by the drag that the record
    measures, by Eq. 16, and without the history term; ``factor``, ``over_steady`` and
    ``theory_over_steady``, their quotients; ``limit_theory_rate``, Eq. 16 with the loss torque and
    the air; and b over what a theory has of it that lacks the history term, the loss torque, or
    both (`CHECKS`).
    """
    terms, bare = (terms_with(design, each, unknowns) for each in (added, added[:0]))
    read = solve(design, terms)
    frequency = read[..., 0] / (1.0 + terms.inputs.fast_clock)
    omega = 2.0 * np.pi * frequency
    torque, exponent = loss_torque(design, terms)

    root = physics.free_decay_root(
        terms.inertia,
        terms.steady + terms.screw,
        terms.history + terms.screw_history,
        terms.torque,
    )
    viscous = -root.real

    def drag(one: Terms) -> FloatArray:
        memory = (one.history + one.screw_history) * np.sqrt(omega / 2.0)
        return np.asarray(one.steady + one.screw + memory)

    # The decay's own memory is in all of them.
    per_drag = viscous / drag(terms)
    theory, steady = per_drag * drag(bare), per_drag * bare.steady
    measured = read[..., 1] / (1.0 + terms.inputs.fast_clock)
    solid = measured - viscous
    found = {
        "frequency": frequency,
        "hysteretic_quality": terms.torque / (torque * omega**exponent),
        "viscous_rate": viscous,
        "theory_rate": theory,
        "factor": viscous / theory,
        "over_steady": viscous / steady,
        "theory_over_steady": theory / steady,
        "steady_rate": steady,
        "limit_theory_rate": theory + solid,
    }
    for history, hysteresis in CHECKS:
        predicted = (theory if history else steady) + hysteresis * solid
        found[_check(history, hysteresis)] = measured / predicted
    return {name: np.broadcast_arrays(each, frequency)[0] for name, each in found.items()}
