"""A campaign's viscous losses beside Eq. 16: the drag's factor, C_H, the exponent of Eq. 11.

An estimate made from all records has an error of its own and errors that come in through
what the records share: 1/k of the hysteresis, the sphere, the water. Each of these is
followed by moving it by its standard deviation and making the estimate again.

Fits through all records take those shared errors into their covariance.

Beside them stand what theory says of one pendulum in its fluid (inertia, Eq. 16, the period's
lengthening), and how well a decay's shape is told: Eq. 14 beside a pure exponential, and the trap
of tails.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from operator import itemgetter
from typing import Any, NamedTuple

import numpy as np

from pendpipe import physics
from pendpipe.analysis.fit.by_points import fit_envelope, fit_points
from pendpipe.analysis.separate import Line, SeparatedRecord
from pendpipe.analysis.turning_points import TurningPoints
from pendpipe.arrays import FloatArray
from pendpipe.errors import InputError, refuse_if
from pendpipe.estimate import Estimate, chi_square_p_value


class Surroundings(NamedTuple):
    """The sphere and the fluid of one record, SI units."""

    radius_m: float
    distance_m: float
    viscosity_pa_s: float
    density_kg_per_m3: float


@dataclass(frozen=True)
class SharedErrors:
    """Standard deviations of what all records have in common.

    Parameters
    ----------
    inverse_k
        Of 1/k in 1/s^2 (`pendpipe.analysis.separate.Benchmark.inverse_sd`).
    radius_m, distance_m
        Of the sphere's radius and of its distance from the axis, m.
    relative_inertia
        Of all moments of inertia together (a mass, the local g), relative.
    temperature_k
        Of the water's temperature; it changes viscosity and density together.
    temperature_c
        The temperature about which it does.
    """

    inverse_k: float = 0.0
    radius_m: float = 0.0
    distance_m: float = 0.0
    relative_inertia: float = 0.0
    temperature_k: float = 0.0
    temperature_c: float = 20.0


Columns = dict[str, Any]
"""Records in columns by name, each an array of shape (records,)."""


def viscous_losses(
    records: Sequence[SeparatedRecord], surroundings: Mapping[str, Surroundings]
) -> Columns:
    """Collect the records whose surroundings and moment of inertia are known, by frequency.

    Returns
    -------
    Columns
        ``record``, ``branch``, ``frequency_hz``, ``angular_frequency_per_s``,
        ``moment_of_inertia_kg_m2`` (with the added mass) and ``relative_inertia_sd`` (as far as
        it is the record's own), ``rate_per_s`` (the viscous part of b) and ``rate_sd_per_s``
        (its own error), ``hysteretic_rate_per_s`` (the part of b that Eq. 17 took off),
        ``rate_per_inverse_k`` (change of the rate with 1/k), and those of `Surroundings`.
    """
    rows = [
        {
            "record": split.measured.record,
            "branch": split.measured.branch,
            "frequency_hz": split.measured.frequency.value,
            "angular_frequency_per_s": 2.0 * np.pi * split.measured.frequency.value,
            "moment_of_inertia_kg_m2": inertia.value,
            "rate_per_s": split.viscous_rate.value,
            "rate_sd_per_s": split.viscous_rate_sd_own,
            "relative_inertia_sd": inertia.sd / inertia.value,
            "hysteretic_rate_per_s": split.measured.linear.value - split.viscous_rate.value,
            "rate_per_inverse_k": split.viscous_rate_per_inverse_k,
            **around._asdict(),
        }
        for split in records
        if (around := surroundings.get(split.measured.record)) is not None
        and (inertia := split.measured.moment_of_inertia) is not None
    ]
    refuse_if(
        not rows,
        "comparison",
        "no record swings in a fluid with a known sphere",
        "add a geometry",
    )
    rows.sort(key=itemgetter("frequency_hz"))
    return {name: np.array([row[name] for row in rows]) for name in rows[0]}


def _columns(losses: Columns, *names: str) -> tuple[FloatArray, ...]:
    return tuple(losses[name] for name in names)


def quality_factor_theory(losses: Columns, history_coefficient: float = 1.0) -> FloatArray:
    """Eq. 16 with each record's own I and omega; C_H = 0 for the steady Stokes law."""
    radius, distance, viscosity, density = _columns(losses, *Surroundings._fields)
    return physics.viscous_quality_factor(
        losses["moment_of_inertia_kg_m2"],
        losses["angular_frequency_per_s"],
        radius,
        distance,
        viscosity,
        density,
        history_coefficient,
    )


def drag_sd_per_s(losses: Columns) -> FloatArray:
    """Own error of the drag, as one of the rate: the drag is 2 I b_v."""
    rate, sd, relative = _columns(losses, "rate_per_s", "rate_sd_per_s", "relative_inertia_sd")
    return np.hypot(sd, relative * rate)


def radius_over_depth(losses: Columns) -> FloatArray:
    """Return a/delta of Eq. 2."""
    radius, *around = _columns(
        losses, "radius_m", "angular_frequency_per_s", "viscosity_pa_s", "density_kg_per_m3"
    )
    return np.asarray(radius / physics.penetration_depth(*around))


def shifted(losses: Columns, errors: SharedErrors, sds: float) -> dict[str, Columns]:
    """Return the losses as they would be, were each shared quantity in turn off by some sds."""
    from_k = sds * errors.inverse_k * losses["rate_per_inverse_k"]
    now, then = errors.temperature_c, errors.temperature_c + sds * errors.temperature_k
    thinner = physics.water_viscosity(then) / physics.water_viscosity(now)
    lighter = physics.water_density(then) / physics.water_density(now)
    inertia, viscosity, density = _columns(
        losses, "moment_of_inertia_kg_m2", "viscosity_pa_s", "density_kg_per_m3"
    )
    changed: dict[str, Columns] = {
        "hysteretic coefficient": {
            "rate_per_s": losses["rate_per_s"] + from_k,
            "hysteretic_rate_per_s": losses["hysteretic_rate_per_s"] - from_k,
        },
        "sphere's radius": {"radius_m": losses["radius_m"] + sds * errors.radius_m},
        "distance to the axis": {"distance_m": losses["distance_m"] + sds * errors.distance_m},
        "moment of inertia": {
            "moment_of_inertia_kg_m2": inertia * (1.0 + sds * errors.relative_inertia)
        },
        "temperature": {
            "viscosity_pa_s": viscosity * thinner,
            "density_kg_per_m3": density * lighter,
        },
    }
    return {source: losses | columns for source, columns in changed.items()}


Ends = tuple[dict[str, Columns], dict[str, Columns]]
"""The losses `shifted` by one standard deviation up and down."""


def shared_effects(
    quantity: Callable[[Columns], FloatArray | float], ends: Ends
) -> dict[str, FloatArray]:
    """Change of a quantity for one standard deviation of each shared source."""
    up, down = ends
    return {
        source: np.asarray(quantity(up[source]) - np.asarray(quantity(down[source]))) / 2.0
        for source in up
    }


@dataclass(frozen=True)
class SharedEstimate:
    """A number made from all records, its error split by where it comes from.

    Parameters
    ----------
    estimate
        Value with the total error.
    sd_own
        From the records' own errors.
    sd_common
        From all that the records share.
    shared
        The parts of `sd_common` by source, with their signs.
    chi2, degrees_of_freedom, p_value
        Of the records about it, with the shared errors in the covariance.
    """

    estimate: Estimate
    sd_own: float
    sd_common: float
    shared: dict[str, float]
    chi2: float
    degrees_of_freedom: int
    p_value: float


def fit_line(losses: Columns, ends: Ends, line_of: Callable[[Columns], Line]) -> SharedEstimate:
    """Fit the slope with the records' own weights; follow the shared errors into it."""
    line = line_of(losses)
    slope, dof = line.slope(), len(line.sd) - 1
    effects = shared_effects(lambda moved: line_of(moved).slope().value, ends)
    shared = {source: float(effect) for source, effect in effects.items()}
    sd_common = math.hypot(*shared.values())
    # The records are judged about their own best line, found with the same covariance.
    spread = shared_effects(lambda moved: line_of(moved).off(slope.value), ends)
    chi2 = chi_square(line.off(slope.value), line.sd, spread, line.regressor)
    return SharedEstimate(
        estimate=replace(slope, sd=math.hypot(slope.sd, sd_common)),
        sd_own=slope.sd,
        sd_common=sd_common,
        shared=shared,
        chi2=chi2,
        degrees_of_freedom=dof,
        p_value=chi_square_p_value(chi2, dof),
    )


def chi_square(
    residual: FloatArray,
    sd: FloatArray,
    effects: dict[str, FloatArray],
    regressor: FloatArray | None = None,
) -> float:
    """chi^2 with the shared effects in the covariance, at the best slope if there is one."""
    covariance = np.diag(sd**2) + sum(np.outer(effect, effect) for effect in effects.values())
    factor = np.linalg.cholesky(covariance)
    white = np.linalg.solve(factor, residual)
    if regressor is not None:
        direction = np.linalg.solve(factor, regressor)
        white = white - direction * (direction @ white) / (direction @ direction)
    return float(white @ white)


@dataclass(frozen=True)
class Exponent:
    """A branch as a power law, and how far it is one.

    Parameters
    ----------
    exponent
        The (unweighted) least-squares slope of ln Q_v on ln f over the branch.
    sd_own, sd_common
        Parts of its error: the records' own, and that of the hysteretic coefficient.
    curvature
        Second derivative of ln Q_v with respect to ln f, from a parabola; NaN with fewer
        than three records. Zero for a power law.
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


def fit_exponent(branch: Columns, inverse_k_sd: float) -> Exponent | None:
    """Fit Eq. 11's exponent to a branch, where 1/k has an error.

    Returns
    -------
    Exponent
        ``None`` with fewer than two records, with a single frequency, or where a viscous
        rate is not positive (there is no logarithm).
    """
    frequency, names = branch["frequency_hz"], branch["record"].tolist()
    count = len(names)
    if count < 2 or np.any(branch["rate_per_s"] <= 0.0) or np.ptp(frequency) <= 0.0:
        return None
    slope, own, common = _derivative(branch, inverse_k_sd, 1)
    bend, bend_sd = math.nan, math.nan
    if count > 2:
        bend, *sds = _derivative(branch, inverse_k_sd, 2)
        bend_sd = math.hypot(*sds)
    steps = np.diff(np.log(frequency))
    local = np.diff(_log_quality(branch)) / np.where(steps > 0.0, steps, np.nan)
    return Exponent(
        exponent=Estimate(slope, math.hypot(own, common), ""),
        sd_own=own,
        sd_common=common,
        curvature=Estimate(bend, bend_sd, ""),
        local_slopes=tuple(local.tolist()),
        records=tuple(names),
    )


def _exponents(losses: Columns, inverse_k_sd: float) -> dict[str, Exponent]:
    """Fit the exponent of every branch that has one."""
    found = {
        branch: fit_exponent(
            {name: column[losses["branch"] == branch] for name, column in losses.items()},
            inverse_k_sd,
        )
        for branch in np.unique(losses["branch"]).tolist()
        if branch
    }
    return {branch: exponent for branch, exponent in found.items() if exponent}


def _derivative(branch: Columns, inverse_k_sd: float, order: int) -> tuple[float, float, float]:
    """Derivative of ln Q_v by ln f from a least-squares polynomial: value, own sd, common sd."""
    logs = np.log(branch["frequency_hz"])
    powers = np.vander(logs - np.mean(logs), order + 1, increasing=True)
    # The derivative is a sum of the ln Q_v with these weights; 2 for the parabola's u^2.
    weights = order * np.linalg.pinv(powers)[order]
    rate, rate_sd = _columns(branch, "rate_per_s", "rate_sd_per_s")
    ends = [_log_quality(branch, moved) for moved in (inverse_k_sd, -inverse_k_sd)]
    return (
        float(weights @ _log_quality(branch)),
        float(np.sqrt(np.sum((weights * rate_sd / rate) ** 2))),
        float(abs(weights @ (ends[0] - ends[1])) / 2.0),
    )


def _log_quality(branch: Columns, moved: float = 0.0) -> FloatArray:
    """Return ln Q_v with 1/k moved; where that leaves no loss at all, the smallest that counts."""
    frequency, rate, sd, per_inverse = _columns(
        branch, "frequency_hz", "rate_per_s", "rate_sd_per_s", "rate_per_inverse_k"
    )
    smallest = 1e-3 * sd + 1e-300
    return np.asarray(np.log(np.pi * frequency / np.maximum(rate + moved * per_inverse, smallest)))


@dataclass(frozen=True)
class Comparison:
    """All that `compare` finds.

    Parameters
    ----------
    table
        The columns of `viscous_losses`; ``quality_factor_theory`` of Eq. 16 and
        ``quality_factor_theory_sd``, its error from what is shared (k has no part in it);
        ``quality_factor_steady`` of the steady Stokes law; ``radius_over_depth``, a/delta;
        ``drag_over_theory``, Q_v of Eq. 16 over Q_v measured; and ``quality_factor_limit`` of
        Eq. 16 and hysteresis together.
    theory_factor
        Inverse-variance mean of that (weights from the records' own errors).
    history_coefficient
        C_H of Eq. 2, fitted to the drag with the records' own weights.
    exponents
        Eq. 11 by branch.
    steady_stokes_percent
        How much the steady law underestimates the damping, least and most, per cent.
    checks
        The theories with and without history term and hysteresis, as in comparison.json.
    budget
        Relative error of `theory_factor` by source, the records' own first.
    """

    table: Columns
    theory_factor: SharedEstimate
    history_coefficient: SharedEstimate
    exponents: dict[str, Exponent]
    steady_stokes_percent: tuple[float, float]
    checks: list[dict[str, Any]]
    budget: dict[str, float]


def compare(
    records: Sequence[SeparatedRecord],
    surroundings: dict[str, Surroundings],
    errors: SharedErrors,
) -> Comparison:
    """Compare the records in water with Eq. 16.

    Parameters
    ----------
    records
        After Eq. 17; those without surroundings or moment of inertia are left out.
    surroundings
        Sphere and fluid by record.
    errors
        Of what the records share.

    Raises
    ------
    InputError
        If no record can be compared.
    """
    losses = viscous_losses(records, surroundings)
    ends = shifted(losses, errors, 1.0), shifted(losses, errors, -1.0)
    factor = fit_line(losses, ends, _drag_over_theory)
    variances = [effect**2 for effect in shared_effects(quality_factor_theory, ends).values()]
    table = losses | {
        "quality_factor_theory": quality_factor_theory(losses),
        "quality_factor_theory_sd": np.sqrt(sum(variances)),
        "quality_factor_steady": quality_factor_theory(losses, 0.0),
        "radius_over_depth": radius_over_depth(losses),
        "drag_over_theory": _drag_over_theory(losses).response,
        "quality_factor_limit": np.pi * losses["frequency_hz"] / exponential_rates(losses)[1],
    }
    # Of the drag measured over that of the steady law, less 1.
    excess = 100.0 * _excess_over_steady(losses).response
    return Comparison(
        table=table,
        theory_factor=factor,
        history_coefficient=fit_line(losses, ends, _excess_over_steady),
        exponents=_exponents(losses, errors.inverse_k),
        steady_stokes_percent=(float(np.min(excess)), float(np.max(excess))),
        checks=[
            check_model(losses, ends, history=history, hysteresis=hysteresis)
            for history in (True, False)
            for hysteresis in (True, False)
        ],
        budget={"the records themselves": factor.sd_own / abs(factor.estimate.value)}
        | {
            source: abs(effect / factor.estimate.value)
            for source, effect in factor.shared.items()
            if effect != 0.0
        },
    )


def exponential_rates(
    losses: Columns, history: bool = True, hysteresis: bool = True
) -> tuple[FloatArray, FloatArray]:
    """Return the whole exponential loss b: measured, and of a theory with or without two terms."""
    frequency, viscous, other = _columns(
        losses, "frequency_hz", "rate_per_s", "hysteretic_rate_per_s"
    )
    predicted = np.pi * frequency / quality_factor_theory(losses, float(history))
    return viscous + other, predicted + hysteresis * other


def check_model(losses: Columns, ends: Ends, **theory: bool) -> dict[str, Any]:
    """Compare the measured limits of Q with a theory that has or lacks two of its terms.

    Returns
    -------
    dict
        ``history`` and ``hysteresis``: whether the theory has them; ``ratio`` of its limits over
        the measured ones, above one where it forgets a loss; ``chi2`` of the measured rates about
        it, errors of k included, and ``dof``.
    """
    effects = shared_effects(lambda moved: np.subtract(*exponential_rates(moved, **theory)), ends)
    measured, predicted = exponential_rates(losses, **theory)
    chi2 = chi_square(measured - predicted, drag_sd_per_s(losses), effects)
    return {**theory, "chi2": chi2, "dof": len(measured), "ratio": measured / predicted}


def _drag_over_theory(losses: Columns, history_coefficient: float = 1.0) -> Line:
    """Drag measured over that of Eq. 2: Q_v of Eq. 16 over Q_v measured, ``Q b_v/(pi f)``.

    Made from the rate, since a rate's error is symmetric and its inverse's is not. The line
    through one is its inverse-variance mean.
    """
    frequency, rate = _columns(losses, "frequency_hz", "rate_per_s")
    per_rate = quality_factor_theory(losses, history_coefficient) / (np.pi * frequency)
    return Line(np.ones_like(per_rate), per_rate * rate, per_rate * drag_sd_per_s(losses))


def _excess_over_steady(losses: Columns) -> Line:
    """The measured drag over the steady one, less 1: C_H a/delta, for C_H of Eq. 2.

    That is ``drag = 6 pi eta a (1 + C_H a/delta) v``.
    """
    line = _drag_over_theory(losses, 0.0)
    return line._replace(regressor=radius_over_depth(losses), response=line.response - 1.0)


def theory_curve(
    parts: Sequence[physics.Part],
    fluid: physics.Fluid,
    gravity_m_per_s2: float,
    *,
    plain_added_mass: bool = False,
) -> dict[str, FloatArray] | None:
    """Theory of a pendulum, or of many: the parts' positions may be arrays.

    Parameters
    ----------
    parts
        The pendulum's parts; one of them a submerged sphere, or there is no theory.
    fluid, gravity_m_per_s2, plain_added_mass
        As in `pendpipe.physics.swing`.

    Returns
    -------
    dict
        Columns of shape (n,) under the names of comparison.json, with Eq. 16's Q_v (C_H = 1) and
        the steady Stokes law's (C_H = 0); ``None`` where nothing is submerged.
    """
    sphere = next((part for part in parts if part.wet_radius_m is not None), None)
    if sphere is None:
        return None
    moving = physics.swing(parts, fluid, gravity_m_per_s2, plain_added_mass=plain_added_mass)
    density, viscosity = fluid
    oscillating, steady = (
        physics.viscous_quality_factor(
            moving.moment_of_inertia_kg_m2,
            moving.angular_frequency_per_s,
            sphere.wet_radius_m,
            sphere.position_m,
            viscosity,
            density,
            history,
        )
        for history in (1.0, 0.0)
    )
    depth = physics.penetration_depth(moving.angular_frequency_per_s, viscosity, density)
    longer = physics.period_lengthening(
        parts, fluid, gravity_m_per_s2, plain_added_mass=plain_added_mass
    )
    columns = {
        "frequency_hz": moving.frequency_hz,
        "moment_of_inertia_kg_m2": moving.moment_of_inertia_kg_m2,
        "quality_factor_viscous_theory": oscillating,
        "quality_factor_viscous_steady": steady,
        "a_over_delta": np.asarray(sphere.wet_radius_m) / depth,
        "lengthening_buoyancy": longer.buoyancy,
        "lengthening_added_mass": longer.added_mass,
        "lengthening_both": longer.both,
    }
    return {name: np.atleast_1d(column) for name, column in columns.items()}


FEWEST_IN_A_TAIL, TAILS = 8, 12


def amplitude_misfit(points: TurningPoints) -> dict[str, float]:
    """Fit the amplitudes with and without a and c; the same points, the same weights.

    Returns
    -------
    dict
        As in comparison.json: what Eq. 14 leaves of the amplitudes (a, b and c together), and
        what an exponential does (b alone, the textbook's linear damping), rms in rad (m).
    """

    def left_by(held: dict[str, float]) -> float:
        return float(np.sqrt(np.mean(fit_envelope(points, held).residual ** 2)))

    return {
        "amplitude_rms_rad": left_by({}),
        "linear_damping_rms_rad": left_by({"a": 0.0, "c": 0.0}),
        "half_cycles": len(points),
    }


def tail_fits(points: TurningPoints) -> list[dict[str, Any]]:
    """Fit ever later parts of a record: the first is the whole of it. As in comparison.json.

    The starts are even in the turning points; the last tail keeps eight. A fit to the tail alone
    depends on where it begins, which the paper warns of: its a is hardly told, and what it takes
    from a it gives to b and c.
    """
    last = len(points) - FEWEST_IN_A_TAIL
    if last < 1:
        return []
    starts = np.unique(np.linspace(0, last, TAILS).astype(np.int64))
    return [tail for start in starts.tolist() if (tail := _tail(points, start))]


def _tail(points: TurningPoints, start: int) -> dict[str, Any] | None:
    part = points.chosen(np.arange(len(points)) >= start)
    try:
        found = fit_points(part).parameters
    except InputError:
        return None  # too little is left of it
    return {
        "start_s": float(part.time_s[0] - points.time_s[0]),
        "amplitude_rad": float(abs(part.angle_rad[0])),
        **{letter: found[letter].as_json() for letter in "abc"},
    }
