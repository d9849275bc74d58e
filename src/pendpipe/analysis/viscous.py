"""The viscous losses of a campaign as columns, and errors that its records share.

An estimate made from all records has an error of its own and errors that come in through
what the records share: 1/k of the hysteresis, the sphere, the water. Each of these is
followed by moving it by its standard deviation and making the estimate again.

Fits through all records take those shared errors into their covariance.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final, NamedTuple

import numpy as np

from pendpipe import physics
from pendpipe.analysis.separate import SeparatedRecord
from pendpipe.arrays import FloatArray
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


SOURCES: Final = (
    "hysteretic coefficient",
    "sphere's radius",
    "distance to the axis",
    "moment of inertia",
    "viscosity",
    "density",
    "temperature",
)
"""What the records share, in the order of `shifted`."""


def shifted(losses: ViscousLosses, errors: SharedErrors, source: str, sds: float) -> ViscousLosses:
    """Return the losses as they would be, were one shared quantity off by some sds."""
    match source:
        case "hysteretic coefficient":
            moved = sds * errors.inverse_k * losses.rate_per_inverse_k
            return replace(
                losses,
                rate_per_s=losses.rate_per_s + moved,
                hysteretic_rate_per_s=losses.hysteretic_rate_per_s - moved,
            )
        case "sphere's radius":
            return replace(losses, radius_m=losses.radius_m + sds * errors.radius_m)
        case "distance to the axis":
            return replace(losses, distance_m=losses.distance_m + sds * errors.distance_m)
        case "moment of inertia":
            factor = 1.0 + sds * errors.relative_inertia
            return replace(losses, moment_of_inertia_kg_m2=losses.moment_of_inertia_kg_m2 * factor)
        case "viscosity":
            factor = 1.0 + sds * errors.relative_viscosity
            return replace(losses, viscosity_pa_s=losses.viscosity_pa_s * factor)
        case "density":
            factor = 1.0 + sds * errors.relative_density
            return replace(losses, density_kg_per_m3=losses.density_kg_per_m3 * factor)
        case "temperature":
            now, then = errors.temperature_c, errors.temperature_c + sds * errors.temperature_k
            thinner = physics.water_viscosity(then) / physics.water_viscosity(now)
            lighter = physics.water_density(then) / physics.water_density(now)
            return replace(
                losses,
                viscosity_pa_s=losses.viscosity_pa_s * thinner,
                density_kg_per_m3=losses.density_kg_per_m3 * lighter,
            )
    raise ValueError(f"unknown source {source}")


def shared_effects(
    quantity: Callable[[ViscousLosses], FloatArray | float],
    losses: ViscousLosses,
    errors: SharedErrors,
) -> dict[str, FloatArray]:
    """Change of a quantity for one standard deviation of each shared source."""
    return {
        source: np.asarray(
            quantity(shifted(losses, errors, source, 1.0))
            - np.asarray(quantity(shifted(losses, errors, source, -1.0)))
        )
        / 2.0
        for source in SOURCES
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
