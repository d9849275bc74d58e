"""A campaign's viscous losses beside Eq. 16: the drag's factor, C_H, the exponent of Eq. 11.

An estimate made from all records has an error of its own and errors that come in through
what the records share: 1/k of the hysteresis, the sphere, the water. Each of these is
followed by moving it by its standard deviation and making the estimate again.

Fits through all records take those shared errors into their covariance.

Beside them stand what theory says of one pendulum in its fluid (inertia, Eq. 16, the period's
lengthening), and how well a decay's shape is told: Eq. 14 beside a pure exponential, and the trap
of tails.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final, NamedTuple

import numpy as np

from pendpipe import physics
from pendpipe.analysis.fit.by_points import fit_envelope, fit_points
from pendpipe.analysis.separate import SeparatedRecord
from pendpipe.analysis.turning_points import TurningPoints
from pendpipe.arrays import BoolArray, FloatArray
from pendpipe.errors import InputError, refuse_if
from pendpipe.estimate import Estimate, chi_square_p_value


@dataclass(frozen=True)
class Surroundings:
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
    relative_viscosity, relative_density
        Of the fluid's properties at its temperature, relative.
    temperature_k
        Of the water's temperature; it changes viscosity and density together.
    temperature_c
        The temperature about which it does.
    """

    inverse_k: float = 0.0
    radius_m: float = 0.0
    distance_m: float = 0.0
    relative_inertia: float = 0.0
    relative_viscosity: float = 0.0
    relative_density: float = 0.0
    temperature_k: float = 0.0
    temperature_c: float = 20.0


@dataclass(frozen=True)
class ViscousLosses:
    """Records in a fluid, in columns of shape (n,).

    Parameters
    ----------
    records
        Their names.
    frequency_hz, moment_of_inertia_kg_m2
        f and I, with the added mass.
    rate_per_s, rate_sd_per_s
        The viscous part of b and its own error.
    relative_inertia_sd
        Relative error of I, as far as it is the record's own.
    hysteretic_rate_per_s
        The part of b that Eq. 17 took off.
    rate_per_inverse_k
        Change of `rate_per_s` with 1/k.
    radius_m, distance_m, viscosity_pa_s, density_kg_per_m3
        Sphere and fluid.
    """

    records: tuple[str, ...]
    frequency_hz: FloatArray
    moment_of_inertia_kg_m2: FloatArray
    rate_per_s: FloatArray
    rate_sd_per_s: FloatArray
    relative_inertia_sd: FloatArray
    hysteretic_rate_per_s: FloatArray
    rate_per_inverse_k: FloatArray
    radius_m: FloatArray
    distance_m: FloatArray
    viscosity_pa_s: FloatArray
    density_kg_per_m3: FloatArray

    @property
    def angular_frequency_per_s(self) -> FloatArray:
        """Return 2 pi f."""
        return 2.0 * np.pi * self.frequency_hz

    @property
    def drag_sd_per_s(self) -> FloatArray:
        """Own error of the drag, as one of the rate: the drag is 2 I b_v."""
        return np.hypot(self.rate_sd_per_s, self.relative_inertia_sd * self.rate_per_s)

    @property
    def radius_over_depth(self) -> FloatArray:
        """Return a/delta of Eq. 2."""
        return self.radius_m / physics.penetration_depth(
            self.angular_frequency_per_s, self.viscosity_pa_s, self.density_kg_per_m3
        )

    def quality_factor_theory(self, history_coefficient: float = 1.0) -> FloatArray:
        """Eq. 16 with each record's own I and omega; C_H = 0 for the steady Stokes law."""
        return physics.viscous_quality_factor(
            self.moment_of_inertia_kg_m2,
            self.angular_frequency_per_s,
            self.radius_m,
            self.distance_m,
            self.viscosity_pa_s,
            self.density_kg_per_m3,
            history_coefficient,
        )

    def drag_over_theory(self, history_coefficient: float = 1.0) -> FloatArray:
        """Drag measured over that of Eq. 2: Q_v of Eq. 16 over Q_v measured, ``Q b_v/(pi f)``.

        Made from the rate, since a rate's error is symmetric and its inverse's is not.
        """
        theory = self.quality_factor_theory(history_coefficient)
        return theory * self.rate_per_s / (np.pi * self.frequency_hz)


def viscous_losses(
    records: Sequence[SeparatedRecord], surroundings: Mapping[str, Surroundings]
) -> ViscousLosses:
    """Collect the records whose surroundings and moment of inertia are known, by frequency."""
    rows = []
    for split in records:
        around, inertia = (
            surroundings.get(split.measured.record),
            split.measured.moment_of_inertia,
        )
        if around is None or inertia is None:
            continue
        rows.append(
            (
                split.measured.frequency.value,
                inertia.value,
                split.viscous_rate.value,
                split.viscous_rate_sd_own,
                inertia.sd / inertia.value,
                split.measured.linear.value - split.viscous_rate.value,
                split.viscous_rate_per_inverse_k,
                around.radius_m,
                around.distance_m,
                around.viscosity_pa_s,
                around.density_kg_per_m3,
                split.measured.record,
            )
        )
    rows.sort(key=lambda row: row[0])
    columns = np.array([row[:-1] for row in rows], dtype=np.float64).reshape(len(rows), 11).T
    return ViscousLosses(tuple(row[-1] for row in rows), *columns)


def shifts(losses: ViscousLosses, errors: SharedErrors, sds: float) -> dict[str, ViscousLosses]:
    """Return the losses as they would be, were each shared quantity in turn off by some sds."""
    moved = sds * errors.inverse_k * losses.rate_per_inverse_k
    now, then = errors.temperature_c, errors.temperature_c + sds * errors.temperature_k
    thinner = physics.water_viscosity(then) / physics.water_viscosity(now)
    lighter = physics.water_density(then) / physics.water_density(now)
    inertia, viscosity = losses.moment_of_inertia_kg_m2, losses.viscosity_pa_s
    density = losses.density_kg_per_m3
    changed: dict[str, dict[str, Any]] = {
        HYSTERESIS: {
            "rate_per_s": losses.rate_per_s + moved,
            "hysteretic_rate_per_s": losses.hysteretic_rate_per_s - moved,
        },
        "sphere's radius": {"radius_m": losses.radius_m + sds * errors.radius_m},
        "distance to the axis": {"distance_m": losses.distance_m + sds * errors.distance_m},
        "moment of inertia": {
            "moment_of_inertia_kg_m2": inertia * (1.0 + sds * errors.relative_inertia)
        },
        "viscosity": {"viscosity_pa_s": viscosity * (1.0 + sds * errors.relative_viscosity)},
        "density": {"density_kg_per_m3": density * (1.0 + sds * errors.relative_density)},
        "temperature": {
            "viscosity_pa_s": viscosity * thinner,
            "density_kg_per_m3": density * lighter,
        },
    }
    return {source: replace(losses, **columns) for source, columns in changed.items()}


HYSTERESIS: Final = "hysteretic coefficient"


def shared_effects(
    quantity: Callable[[ViscousLosses], FloatArray | float],
    losses: ViscousLosses,
    errors: SharedErrors,
) -> dict[str, FloatArray]:
    """Change of a quantity for one standard deviation of each shared source."""
    below = shifts(losses, errors, -1.0)
    return {
        source: np.asarray(quantity(above) - np.asarray(quantity(below[source]))) / 2.0
        for source, above in shifts(losses, errors, 1.0).items()
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


class Line(NamedTuple):
    """Points through which a line from the origin is drawn, each of shape (n,)."""

    regressor: FloatArray
    response: FloatArray
    sd: FloatArray

    def slope(self) -> float:
        """The slope of weighted least squares."""
        x, y = self.regressor / self.sd, self.response / self.sd
        return float(np.sum(x * y) / np.sum(x * x))


def fit_line(
    losses: ViscousLosses, errors: SharedErrors, line_of: Callable[[ViscousLosses], Line]
) -> SharedEstimate:
    """Fit the slope with the records' own weights; follow the shared errors into it."""
    line = line_of(losses)
    value = line.slope()
    effects = shared_effects(lambda moved: line_of(moved).slope(), losses, errors)
    shared = {source: float(effect) for source, effect in effects.items()}
    sd_own = float(np.sum((line.regressor / line.sd) ** 2) ** -0.5)
    sd_common = float(np.sqrt(sum(effect**2 for effect in shared.values())))

    def residual(moved: ViscousLosses) -> FloatArray:
        return line_of(moved).response - value * line_of(moved).regressor

    spread = shared_effects(residual, losses, errors)
    # The records are judged about their own best line, found with the same covariance.
    chi2 = chi_square(residual(losses), line.sd, spread, line.regressor)
    dof = len(line.sd) - 1
    return SharedEstimate(
        estimate=Estimate(value, float(np.hypot(sd_own, sd_common)), ""),
        sd_own=sd_own,
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


FEWEST_IN_A_RANGE = 4
MOST_LEFT_OUT = 2
"""At either end of the branch, when the dependence on the range is looked at."""


@dataclass(frozen=True)
class RangeSlope:
    """The exponent over a part of the branch, and the records where it begins and ends."""

    first: str
    last: str
    exponent: float
    sd: float


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
    ranges
        The slope over parts of the branch, with up to two records left out at each end.
    records
        The branch in the order of its frequencies.
    """

    exponent: Estimate
    sd_own: float
    sd_common: float
    curvature: Estimate
    local_slopes: tuple[float, ...]
    ranges: tuple[RangeSlope, ...]
    records: tuple[str, ...]


def fit_exponent(branch: ViscousLosses, errors: SharedErrors) -> Exponent | None:
    """Fit Eq. 11's exponent to a branch.

    Returns
    -------
    Exponent
        ``None`` with fewer than two records, with a single frequency, or where a viscous
        rate is not positive (there is no logarithm).
    """
    count = len(branch.records)
    if count < 2 or np.any(branch.rate_per_s <= 0.0) or np.ptp(branch.frequency_hz) <= 0.0:
        return None
    slope, own, common = _derivative(branch, errors, 1)
    nan = float("nan")
    bend, bend_own, bend_common = _derivative(branch, errors, 2) if count > 2 else (nan, nan, nan)
    logs = np.log(branch.frequency_hz)
    steps = np.diff(logs)
    local = np.diff(_log_quality(branch)) / np.where(steps > 0.0, steps, nan)
    return Exponent(
        exponent=Estimate(slope, float(np.hypot(own, common)), ""),
        sd_own=own,
        sd_common=common,
        curvature=Estimate(bend, float(np.hypot(bend_own, bend_common)), ""),
        local_slopes=tuple(local.tolist()),
        ranges=_ranges(branch, errors),
        records=branch.records,
    )


def _ranges(branch: ViscousLosses, errors: SharedErrors) -> tuple[RangeSlope, ...]:
    """The slope with up to two records left out at each end; none at a single frequency."""
    count = len(branch.records)
    parts = []
    for low in range(MOST_LEFT_OUT + 1):
        for high in range(count - MOST_LEFT_OUT, count + 1):
            part = _part(branch, low, high)
            if high - low < min(FEWEST_IN_A_RANGE, count) or np.ptp(part.frequency_hz) <= 0.0:
                continue
            slope, own, common = _derivative(part, errors, 1)
            parts.append(
                RangeSlope(
                    branch.records[low],
                    branch.records[high - 1],
                    slope,
                    float(np.hypot(own, common)),
                )
            )
    return tuple(parts)


def _derivative(
    branch: ViscousLosses, errors: SharedErrors, order: int
) -> tuple[float, float, float]:
    """Derivative of ln Q_v by ln f from a least-squares polynomial: value, own sd, common sd."""
    logs = np.log(branch.frequency_hz)
    powers = np.vander(logs - np.mean(logs), order + 1, increasing=True)
    # The derivative is a sum of the ln Q_v with these weights; 2 for the parabola's u^2.
    weights = order * np.linalg.pinv(powers)[order]
    value = float(weights @ _log_quality(branch))
    own = float(np.sqrt(np.sum((weights * branch.rate_sd_per_s / branch.rate_per_s) ** 2)))
    ends = [_log_quality(shifts(branch, errors, sds)[HYSTERESIS]) for sds in (1.0, -1.0)]
    return value, own, float(abs(weights @ (ends[0] - ends[1])) / 2.0)


def _log_quality(branch: ViscousLosses) -> FloatArray:
    """Return ln Q_v; where an error of k leaves no loss at all, the smallest that counts."""
    rate = np.maximum(branch.rate_per_s, 1e-3 * branch.rate_sd_per_s + 1e-300)
    return np.asarray(np.log(np.pi * branch.frequency_hz / rate))


def _part(branch: ViscousLosses, low: int, high: int) -> ViscousLosses:
    """The records from `low` up to and without `high`."""
    return ViscousLosses(
        **{name: column[low:high] for name, column in vars(branch).items()},
    )


@dataclass(frozen=True)
class ModelCheck:
    """What one theory says of the limiting Q of every record, beside what was measured.

    Parameters
    ----------
    history, hysteresis
        Whether the theory has Eq. 2's history term, and the internal friction.
    quality_factor_limit
        Its limits, shape (n,).
    ratio
        Those over the measured ones, shape (n,): above one where theory forgets a loss.
    chi2, degrees_of_freedom
        Of the measured rates about it, errors of k included.
    """

    history: bool
    hysteresis: bool
    quality_factor_limit: FloatArray
    ratio: FloatArray
    chi2: float
    degrees_of_freedom: int


@dataclass(frozen=True)
class Comparison:
    """All that `compare` finds.

    Parameters
    ----------
    losses
        The records that were compared, by frequency; the arrays below follow their order.
    quality_factor_theory, quality_factor_theory_sd
        Eq. 16 for each record, and its error from what is shared (k has no part in it).
    quality_factor_steady, radius_over_depth
        The steady Stokes law's Q, and a/delta.
    drag_over_theory
        Q_v of Eq. 16 over Q_v measured.
    theory_factor
        Inverse-variance mean of that (weights from the records' own errors).
    history_coefficient
        C_H of Eq. 2, fitted to the drag with the records' own weights.
    exponents
        Eq. 11 by branch.
    steady_stokes_percent
        How much the steady law underestimates the damping, least and most, per cent.
    checks
        The theories with and without history term and hysteresis.
    budget
        Relative error of `theory_factor` by source, the records' own first.
    """

    losses: ViscousLosses
    quality_factor_theory: FloatArray
    quality_factor_theory_sd: FloatArray
    quality_factor_steady: FloatArray
    radius_over_depth: FloatArray
    drag_over_theory: FloatArray
    theory_factor: SharedEstimate
    history_coefficient: SharedEstimate
    exponents: dict[str, Exponent]
    steady_stokes_percent: tuple[float, float]
    checks: tuple[ModelCheck, ...]
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
    refuse_if(
        not losses.records,
        "comparison",
        "no record swings in a fluid with a known sphere",
        "add a geometry",
    )
    factor = theory_factor(losses, errors)
    steady = losses.drag_over_theory(0.0)
    theory = losses.quality_factor_theory()
    effects = shared_effects(ViscousLosses.quality_factor_theory, losses, errors)
    return Comparison(
        losses=losses,
        quality_factor_theory=theory,
        quality_factor_theory_sd=np.sqrt(sum(effect**2 for effect in effects.values())),
        quality_factor_steady=losses.quality_factor_theory(0.0),
        radius_over_depth=losses.radius_over_depth,
        drag_over_theory=losses.drag_over_theory(),
        theory_factor=factor,
        history_coefficient=history_coefficient(losses, errors),
        exponents=_exponents(records, surroundings, errors),
        steady_stokes_percent=(
            100.0 * float(np.min(steady) - 1.0),
            100.0 * float(np.max(steady) - 1.0),
        ),
        checks=tuple(
            check_model(losses, errors, history=history, hysteresis=hysteresis)
            for history in (True, False)
            for hysteresis in (True, False)
        ),
        budget={"the records themselves": factor.sd_own / abs(factor.estimate.value)}
        | {
            source: abs(effect / factor.estimate.value)
            for source, effect in factor.shared.items()
            if effect != 0.0
        },
    )


def theory_factor(losses: ViscousLosses, errors: SharedErrors) -> SharedEstimate:
    """Drag measured over Eq. 2: the inverse-variance mean of Q_v(Eq. 16)/Q_v measured."""
    return fit_line(losses, errors, _drag_over_theory)


def history_coefficient(losses: ViscousLosses, errors: SharedErrors) -> SharedEstimate:
    """Fit C_H of ``drag = 6 pi eta a (1 + C_H a/delta) v`` by weighted least squares.

    The measured drag over the steady one, less 1, is C_H a/delta.
    """
    return fit_line(losses, errors, _excess_over_steady)


def check_model(
    losses: ViscousLosses, errors: SharedErrors, *, history: bool, hysteresis: bool
) -> ModelCheck:
    """Compare the measured limits of Q with a theory that has or lacks two of its terms."""

    def predicted(moved: ViscousLosses) -> FloatArray:
        viscous = np.pi * moved.frequency_hz / moved.quality_factor_theory(float(history))
        return viscous + hysteresis * moved.hysteretic_rate_per_s

    def excess(moved: ViscousLosses) -> FloatArray:
        return moved.rate_per_s + moved.hysteretic_rate_per_s - predicted(moved)

    effects = shared_effects(excess, losses, errors)
    rate = predicted(losses)
    return ModelCheck(
        history=history,
        hysteresis=hysteresis,
        quality_factor_limit=np.pi * losses.frequency_hz / rate,
        ratio=(losses.rate_per_s + losses.hysteretic_rate_per_s) / rate,
        chi2=chi_square(excess(losses), losses.drag_sd_per_s, effects),
        degrees_of_freedom=len(rate),
    )


def _drag_over_theory(losses: ViscousLosses) -> Line:
    per_rate = losses.quality_factor_theory() / (np.pi * losses.frequency_hz)
    return Line(
        np.ones_like(per_rate), per_rate * losses.rate_per_s, per_rate * losses.drag_sd_per_s
    )


def _excess_over_steady(losses: ViscousLosses) -> Line:
    per_rate = losses.quality_factor_theory(0.0) / (np.pi * losses.frequency_hz)
    return Line(
        losses.radius_over_depth,
        per_rate * losses.rate_per_s - 1.0,
        per_rate * losses.drag_sd_per_s,
    )


def _exponents(
    records: Sequence[SeparatedRecord],
    surroundings: dict[str, Surroundings],
    errors: SharedErrors,
) -> dict[str, Exponent]:
    """Eq. 11 for each branch of two or more records."""
    found = {}
    for branch in sorted({split.measured.branch for split in records} - {""}):
        members = [split for split in records if split.measured.branch == branch]
        exponent = fit_exponent(viscous_losses(members, surroundings), errors)
        if exponent is not None:
            found[branch] = exponent
    return found


class TheoryCurve(NamedTuple):
    """Theory along a branch; each an array of shape (n,)."""

    frequency_hz: FloatArray
    moment_of_inertia_kg_m2: FloatArray
    quality_factor_viscous: FloatArray
    quality_factor_steady: FloatArray
    radius_over_depth: FloatArray
    lengthening: physics.Lengthening


def submerged_sphere(parts: Sequence[physics.Part]) -> physics.Sphere | None:
    """The sphere that swings in the fluid, where there is one."""
    for part in parts:
        if isinstance(part, physics.Sphere) and part.submerged:
            return part
    return None


def theory_curve(
    parts: Sequence[physics.Part],
    fluid: physics.Fluid,
    gravity_m_per_s2: float,
    *,
    plain_added_mass: bool = False,
) -> TheoryCurve | None:
    """Theory of a pendulum, or of many: the parts' positions may be arrays.

    Parameters
    ----------
    parts
        The pendulum's parts; one of them a submerged sphere, or there is no theory.
    fluid, gravity_m_per_s2, plain_added_mass
        As in `pendpipe.physics.swing`.

    Returns
    -------
    TheoryCurve
        With Eq. 16's Q_v (C_H = 1) and the steady Stokes law's (C_H = 0); ``None`` where
        nothing is submerged.
    """
    sphere = submerged_sphere(parts)
    if sphere is None:
        return None
    moving = physics.swing(parts, fluid, gravity_m_per_s2, plain_added_mass=plain_added_mass)
    density, viscosity = fluid
    oscillating, steady = (
        physics.viscous_quality_factor(
            moving.moment_of_inertia_kg_m2,
            moving.angular_frequency_per_s,
            sphere.radius_m,
            sphere.centre_m,
            viscosity,
            density,
            history,
        )
        for history in (1.0, 0.0)
    )
    depth = physics.penetration_depth(moving.angular_frequency_per_s, viscosity, density)
    return TheoryCurve(
        frequency_hz=np.atleast_1d(moving.frequency_hz),
        moment_of_inertia_kg_m2=np.atleast_1d(moving.moment_of_inertia_kg_m2),
        quality_factor_viscous=np.atleast_1d(oscillating),
        quality_factor_steady=np.atleast_1d(steady),
        radius_over_depth=np.atleast_1d(np.divide(sphere.radius_m, depth)),
        lengthening=physics.period_lengthening(
            parts,
            fluid,
            gravity_m_per_s2,
            plain_added_mass=plain_added_mass,
        ),
    )


FEWEST_IN_A_TAIL = 8


@dataclass(frozen=True)
class Misfit:
    """What two laws leave of the amplitudes, rms in rad (m)."""

    amplitude_rms_rad: float
    """By Eq. 14: a, b and c together."""
    linear_damping_rms_rad: float
    """By an exponential: b alone, the textbook's linear damping."""
    half_cycles: int


@dataclass(frozen=True)
class Tail:
    """a, b, c from the part of a record after `start_s`."""

    start_s: float
    amplitude_rad: float
    a: Estimate
    b: Estimate
    c: Estimate


def amplitude_misfit(points: TurningPoints) -> Misfit:
    """Fit the amplitudes with and without a and c; the same points, the same weights."""

    def left_by(held: dict[str, float]) -> float:
        return float(np.sqrt(np.mean(fit_envelope(points, held).residual ** 2)))

    return Misfit(left_by({}), left_by({"a": 0.0, "c": 0.0}), len(points))


def tail_fits(points: TurningPoints, count: int = 12) -> list[Tail]:
    """Fit ever later parts of a record: the first is the whole of it.

    The starts are even in the logarithm of the amplitude; the last tail keeps eight
    turning points. A fit to the tail alone depends on where it begins, which the paper
    warns of: its a is hardly told, and what it takes from a it gives to b and c.
    """
    amplitude = np.abs(points.angle_rad)
    last = len(points) - FEWEST_IN_A_TAIL
    if last < 1:
        return []
    levels = np.geomspace(amplitude[0], max(amplitude[last], 1e-3 * amplitude[0]), count)
    place = np.arange(len(points))
    starts = np.unique(np.searchsorted(-amplitude[: last + 1], -levels))
    return [tail for start in starts if (tail := _tail(points, place >= start))]


def _tail(points: TurningPoints, kept: BoolArray) -> Tail | None:
    part = points.chosen(kept)
    try:
        found = fit_points(part).parameters
    except InputError:
        return None  # too little is left of it
    return Tail(
        start_s=float(part.time_s[0] - points.time_s[0]),
        amplitude_rad=float(abs(part.angle_rad[0])),
        a=found["a"],
        b=found["b"],
        c=found["c"],
    )
