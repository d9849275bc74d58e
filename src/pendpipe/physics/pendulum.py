"""A compound pendulum from its parts: inertia, restoring torque, frequency, in any fluid.

Positions are measured along the rod from the axis, positive below it. A position may be
an array (a weight moved from record to record); everything broadcasts.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from pendpipe.arrays import FloatArray, Numbers, equation
from pendpipe.physics.fluid import POTENTIAL_FLOW_ADDED_MASS, added_mass_coefficient

STANDARD_GRAVITY_M_PER_S2 = 9.80665
"""As the third General Conference on Weights and Measures defined it in 1901."""


@dataclass(frozen=True)
class Part:
    """A part of the pendulum; by itself, a weight that is small beside its distance from the axis.

    Parameters
    ----------
    mass_kg, position_m
        Mass in kg; position of its centre below the axis in m (negative above).
    own_inertia_kg_m2
        Its moment of inertia about its own centre in kg m^2, if that counts.
    displaced_m3
        The volume of fluid that it displaces in m^3 (a screw under water).
    wet_radius_m
        Radius in m of a sphere with which fluid swings along; None for anything else.
    """

    mass_kg: Numbers
    position_m: Numbers
    own_inertia_kg_m2: Numbers = 0.0
    displaced_m3: Numbers = 0.0
    wet_radius_m: Numbers | None = None


PointMass = Part


def Rod(mass_kg: Numbers, length_m: Numbers, centre_m: Numbers = 0.0) -> Part:  # noqa: N802 - a kind of part
    """A thin uniform rod: ``I = m (l^2/12 + z^2)``.

    Parameters
    ----------
    mass_kg, length_m
        Mass in kg and length in m.
    centre_m
        Position of its centre below the axis in m.
    """
    return Part(mass_kg, centre_m, np.multiply(mass_kg, np.square(length_m) / 12.0))


def Sphere(  # noqa: N802 - a kind of part
    mass_kg: Numbers, radius_m: Numbers, centre_m: Numbers, submerged: bool = False
) -> Part:
    """A solid sphere, ``I = m (2 a^2/5 + L^2)``; under water where `submerged`.

    Parameters
    ----------
    mass_kg, radius_m, centre_m
        Mass in kg, radius a in m, distance L of its centre below the axis in m.
    submerged
        Whether the fluid buoys it and swings along with it.
    """
    ball = Part(mass_kg, centre_m, 0.4 * np.multiply(mass_kg, np.square(radius_m)))
    if not submerged:
        return ball
    return replace(ball, displaced_m3=sphere_volume(radius_m), wet_radius_m=radius_m)


class Fluid(NamedTuple):
    """What a part is submerged in."""

    density_kg_per_m3: Numbers
    viscosity_pa_s: Numbers


@equation
def sphere_volume(radius_m: Numbers) -> FloatArray:
    """Volume of a sphere in m^3: ``4 pi a^3/3``."""
    return 4.0 / 3.0 * np.pi * radius_m**3


def moment_of_inertia(parts: Sequence[Part]) -> FloatArray:
    """Moment of inertia of the parts about the axis in kg m^2, without any fluid."""
    own = (np.asarray(part.own_inertia_kg_m2) for part in parts)
    of_mass = (np.multiply(part.mass_kg, np.square(part.position_m)) for part in parts)
    return sum((*own, *of_mass), start=np.zeros(()))


def static_moment(parts: Sequence[Part]) -> FloatArray:
    """Return the sum of mass times position, M Delta of Eq. 7, in kg m."""
    return sum(np.multiply(part.mass_kg, part.position_m) for part in parts)


def displaced_moment(parts: Sequence[Part]) -> FloatArray:
    """Return the sum of displaced volume times position in m^4."""
    return sum(np.multiply(part.displaced_m3, part.position_m) for part in parts)


def restoring_torque(
    parts: Sequence[Part],
    fluid: Fluid | None = None,
    gravity_m_per_s2: Numbers = STANDARD_GRAVITY_M_PER_S2,
) -> FloatArray:
    """Restoring torque per angle, ``g (sum m z - rho sum V z)``, in N m/rad.

    The second sum is the buoyancy of what is submerged. Negative where the pendulum
    would turn over.
    """
    moment = static_moment(parts)
    if fluid is not None:
        moment = moment - np.multiply(fluid.density_kg_per_m3, displaced_moment(parts))
    return np.multiply(gravity_m_per_s2, moment)


def added_inertia(
    parts: Sequence[Part],
    fluid: Fluid | None,
    angular_frequency_per_s: Numbers,
    *,
    plain_added_mass: bool = False,
) -> FloatArray:
    """Moment of inertia of the fluid that swings with the submerged spheres, in kg m^2.

    ``(1/2 + 9 delta/(4 a)) rho V L^2`` for each.

    Parameters
    ----------
    parts, fluid
        The pendulum's parts and the fluid; ``None`` for none.
    angular_frequency_per_s
        omega in rad/s; it sets the penetration depth delta.
    plain_added_mass
        Leave the part with delta out (a fluid without viscosity).
    """
    total: Numbers = np.float64(0.0)
    if fluid is None:
        return total
    density, viscosity = fluid
    for part in (part for part in parts if part.wet_radius_m is not None):
        coefficient = (
            np.float64(POTENTIAL_FLOW_ADDED_MASS)
            if plain_added_mass
            else added_mass_coefficient(
                part.wet_radius_m, angular_frequency_per_s, viscosity, density
            )
        )
        total = total + coefficient * density * part.displaced_m3 * np.square(part.position_m)
    return total


_ROUNDS = 60
"""The fixed point for omega gains at least a digit a round; it never needs half of these."""


class Swing(NamedTuple):
    """A pendulum's small undamped motion."""

    angular_frequency_per_s: FloatArray
    moment_of_inertia_kg_m2: FloatArray
    """With the added mass: the I of Eq. 16 and of the equation of motion."""
    restoring_torque_n_m_per_rad: FloatArray

    @property
    def frequency_hz(self) -> FloatArray:
        """Return omega/(2 pi)."""
        return self.angular_frequency_per_s / (2.0 * np.pi)


class Lengthening(NamedTuple):
    """Relative lengthening of the period by a fluid, cause by cause (Fig. 5)."""

    buoyancy: FloatArray
    added_mass: FloatArray
    both: FloatArray


def swing(
    parts: Sequence[Part],
    fluid: Fluid | None = None,
    gravity_m_per_s2: Numbers = STANDARD_GRAVITY_M_PER_S2,
    *,
    plain_added_mass: bool = False,
    buoyancy: bool = True,
    added_mass: bool = True,
) -> Swing:
    """Angular frequency, moment of inertia and restoring torque of a pendulum.

    ``omega^2 = g (sum m z - rho sum V z)/(I + I_added(omega))``, solved by iteration since
    the added mass depends on omega through the penetration depth.

    Parameters
    ----------
    parts, fluid, gravity_m_per_s2
        The pendulum, what it hangs in (``None``: nothing) and g in m/s^2.
    plain_added_mass
        Use 1/2 of the displaced fluid for a sphere, whatever the frequency.
    buoyancy, added_mass
        Whether each of the two is counted; both are, except to compare them.

    Returns
    -------
    Swing
        NaN as frequency where the restoring torque is not positive.
    """
    dry = moment_of_inertia(parts)
    torque = restoring_torque(parts, fluid if buoyancy else None, gravity_m_per_s2)
    stable = np.where(torque > 0.0, torque, np.nan)
    omega = np.sqrt(stable / dry)
    inertia = dry + 0.0 * omega
    if fluid is None or not added_mass:
        return Swing(omega, inertia, torque)
    for _ in range(_ROUNDS):
        inertia = dry + added_inertia(parts, fluid, omega, plain_added_mass=plain_added_mass)
        previous, omega = omega, np.sqrt(stable / inertia)
        if np.all((np.abs(omega - previous) <= 1e-15 * omega) | np.isnan(omega)):
            break
    return Swing(omega, inertia, torque)


@equation
def inertia_from_frequency(
    frequency_hz: Numbers, restoring_torque_n_m_per_rad: Numbers
) -> FloatArray:
    """Moment of inertia from a measured frequency: ``I = K/(2 pi f)^2``.

    With the torque in the fluid, this is the inertia with the added mass; take
    `pendpipe.physics.pendulum.added_inertia` off for that of the parts alone.

    Parameters
    ----------
    frequency_hz, restoring_torque_n_m_per_rad
        f in Hz (undamped) and K in N m/rad; broadcast.

    Returns
    -------
    FloatArray
        I in kg m^2.
    """
    return restoring_torque_n_m_per_rad / (2.0 * np.pi * frequency_hz) ** 2


def period_lengthening(
    parts: Sequence[Part],
    fluid: Fluid,
    gravity_m_per_s2: Numbers = STANDARD_GRAVITY_M_PER_S2,
    *,
    plain_added_mass: bool = False,
) -> Lengthening:
    """Relative lengthening of the period by buoyancy alone, added mass alone and both.

    ``T_fluid/T_nothing - 1``, the theory of Fig. 5; NaN where buoyancy leaves no restoring
    torque. Parameters as in `swing`.
    """
    bare = swing(parts, None, gravity_m_per_s2).angular_frequency_per_s
    wet = (
        swing(
            parts,
            fluid,
            gravity_m_per_s2,
            plain_added_mass=plain_added_mass,
            buoyancy=buoyancy,
            added_mass=added_mass,
        )
        for buoyancy, added_mass in ((True, False), (False, True), (True, True))
    )
    return Lengthening(*(bare / each.angular_frequency_per_s - 1.0 for each in wet))


@equation
def bearing_friction_rate(
    friction_torque_n_m: Numbers,
    moment_of_inertia_kg_m2: Numbers,
    angular_frequency_per_s: Numbers,
) -> FloatArray:
    """Eq. 13's c of a bearing's dry friction: ``c = 2 tau_c/(pi I omega)``.

    A torque of constant size takes 4 tau_c y from the energy I omega^2 y^2/2 in a cycle.

    Parameters
    ----------
    friction_torque_n_m, moment_of_inertia_kg_m2, angular_frequency_per_s
        tau_c in N m, I in kg m^2, omega in rad/s; broadcast.

    Returns
    -------
    FloatArray
        c in rad/s.
    """
    return 2.0 * friction_torque_n_m / (np.pi * moment_of_inertia_kg_m2 * angular_frequency_per_s)
