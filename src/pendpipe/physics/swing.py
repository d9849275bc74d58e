"""How fast a compound pendulum swings, what water changes in it, and its bearing's friction."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from pendpipe.physics._floats import FloatArray, Numbers, equation, plain
from pendpipe.physics.pendulum import (
    STANDARD_GRAVITY_M_PER_S2,
    Fluid,
    Part,
    added_inertia,
    moment_of_inertia,
    restoring_torque,
)

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
        return plain(self.angular_frequency_per_s / (2.0 * np.pi))


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
        return Swing(plain(omega), plain(inertia), torque)
    for _ in range(_ROUNDS):
        inertia = dry + added_inertia(parts, fluid, omega, plain_added_mass=plain_added_mass)
        previous, omega = omega, np.sqrt(stable / inertia)
        if np.all((np.abs(omega - previous) <= 1e-15 * omega) | np.isnan(omega)):
            break
    return Swing(plain(omega), plain(inertia), torque)


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

    def longer(*, buoyancy: bool, added_mass: bool) -> FloatArray:
        wet = swing(
            parts,
            fluid,
            gravity_m_per_s2,
            plain_added_mass=plain_added_mass,
            buoyancy=buoyancy,
            added_mass=added_mass,
        )
        return plain(bare / wet.angular_frequency_per_s - 1.0)

    return Lengthening(
        longer(buoyancy=True, added_mass=False),
        longer(buoyancy=False, added_mass=True),
        longer(buoyancy=True, added_mass=True),
    )


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
