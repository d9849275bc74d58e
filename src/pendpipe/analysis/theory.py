"""What theory says of one pendulum in its fluid: inertia, Eq. 16, and the period's lengthening."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from pendpipe import physics
from pendpipe.arrays import FloatArray
from pendpipe.physics import Fluid, Part, Sphere


class TheoryCurve(NamedTuple):
    """Theory along a branch; each an array of shape (n,)."""

    frequency_hz: FloatArray
    moment_of_inertia_kg_m2: FloatArray
    quality_factor_viscous: FloatArray
    quality_factor_steady: FloatArray
    radius_over_depth: FloatArray
    lengthening: physics.Lengthening


def submerged_sphere(parts: Sequence[Part]) -> Sphere | None:
    """The sphere that swings in the fluid, where there is one."""
    for part in parts:
        if isinstance(part, Sphere) and part.submerged:
            return part
    return None


def theory_curve(
    parts: Sequence[Part], fluid: Fluid, gravity_m_per_s2: float, *, plain_added_mass: bool = False
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
