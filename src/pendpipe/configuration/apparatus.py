"""From the configuration's words to the physics: parts, fluid, and how they swing."""

from collections.abc import Mapping
from typing import Final, Literal, NamedTuple

import numpy as np

from pendpipe import physics
from pendpipe.arrays import FloatArray
from pendpipe.configuration.load import Campaign, Record
from pendpipe.configuration.models import Apparatus, Fluid, Geometry, Tank
from pendpipe.errors import InputError, refuse_if

_ORDER: Final = 10
"""Of the multipoles: 1e-5 of the force at the closest walls."""


class Pendulum(NamedTuple):
    """One record's pendulum, from distances and masses alone."""

    apparatus: Apparatus
    geometry: Geometry
    parts: list[physics.Part]
    fluid: physics.Fluid
    """It acts on the sphere; where the geometry has none, on the weights."""
    swing: physics.Swing


def pendulum(campaign: Campaign, record: Record) -> Pendulum:
    """Build the pendulum of a record.

    Raises
    ------
    InputError
        If the record has no geometry or fluid, or the pendulum would turn over.
    """
    settings = campaign.configuration
    geometry = campaign.geometry(record)
    where = f"{settings.records}, record {record.record}"
    if settings.apparatus is None or geometry is None or not record.fluid:
        raise InputError(where, "no apparatus, geometry or fluid is given", "fill the cells")
    parts = pendulum_parts(settings.apparatus, geometry.weights_m, sphere=geometry.sphere)
    fluid = fluid_at(settings.fluids[record.fluid], record.temperature_c)
    moving = physics.swing(
        parts,
        fluid if geometry.sphere else None,
        settings.apparatus.gravity_m_per_s2,
        plain_added_mass=settings.apparatus.added_mass == "plain",
    )
    refuse_if(
        not np.isfinite(moving.angular_frequency_per_s),
        f"geometry {record.geometry}",
        "the pendulum turns over",
        "move a weight down",
    )
    return Pendulum(settings.apparatus, geometry, parts, fluid, moving)


def pendulum_parts(
    apparatus: Apparatus, weights_m: Mapping[str, float | FloatArray], *, sphere: bool
) -> list[physics.Part]:
    """List the parts of the pendulum; the weights' places below the axis may be arrays."""
    rod, weights = apparatus.rod, apparatus.weights
    parts: list[physics.Part] = [
        physics.Rod(rod.mass_kg, rod.length_m),
        *(
            physics.Sphere(weights[name].mass_kg, weights[name].radius_m, position)
            for name, position in weights_m.items()
        ),
    ]
    if sphere and (ball := apparatus.sphere):
        parts += [
            physics.Sphere(ball.mass_kg, ball.diameter_m / 2, ball.distance_m, submerged=True),
            # The screw's mass is counted with the sphere; under water it displaces some more.
            physics.PointMass(0.0, ball.screw_distance_m, displaced_m3=ball.screw_volume_m3),
        ]
    return parts


def fluid_at(fluid: Fluid, temperature_c: float | FloatArray | None) -> physics.Fluid:
    """Density and viscosity of a fluid at a record's temperature, or at several.

    Water's change between the temperature where the configured values hold and that of
    the record is taken from the published formulas of `pendpipe.physics.fluid`.
    """
    if temperature_c is None or fluid.temperature_c is None:
        return physics.Fluid(fluid.density_kg_per_m3, fluid.viscosity_pa_s)
    density, viscosity = (
        of_water(temperature_c) / of_water(fluid.temperature_c)
        for of_water in (physics.water_density, physics.water_viscosity)
    )
    return physics.Fluid(fluid.density_kg_per_m3 * density, fluid.viscosity_pa_s * viscosity)


def in_tank(
    tank: Tank | None,
    radius_m: float,
    penetration_m: float,
    surface: Literal["slip", "film"] = "slip",
    deeper_m: float = 0.0,
    higher_m: float = 0.0,
) -> physics.Confined:
    """`physics.sphere_in_tank` for a tank, with more fluid in it and the sphere higher up."""
    if tank is None:
        free = physics.POTENTIAL_FLOW_ADDED_MASS + 2.25 * penetration_m / radius_m
        return physics.Confined(1.0, 1.0, free)
    depth = tank.depth_m + deeper_m
    height = (0.5 * depth if tank.height_m is None else tank.height_m) + higher_m
    return physics.sphere_in_tank(
        radius_m,
        height,
        penetration_m,
        surface_m=depth - height,
        length_m=tank.length_m,
        width_m=tank.width_m,
        off_centre_m=tank.off_centre_m,
        surface=surface,
        order=_ORDER,
    )


def quadratic_rate(campaign: Campaign, record: Record, built: Pendulum) -> float:
    """Eq. 13's a from the drag coefficient: of the sphere, without one of the weights."""
    apparatus = built.apparatus
    if built.geometry.sphere and apparatus.sphere:
        bodies = [(apparatus.sphere.diameter_m / 2, apparatus.sphere.distance_m)]
    else:
        # A body of any shape counts as the disc of its frontal area.
        bodies = [
            (float(np.sqrt(apparatus.weights[name].frontal_area_m2 / np.pi)), abs(position))
            for name, position in built.geometry.weights_m.items()
        ]
    radii, distances = np.array(bodies).T
    rates = physics.quadratic_drag_rate(
        campaign.configuration.fluids[record.fluid].drag_coefficient,
        built.swing.moment_of_inertia_kg_m2,
        built.swing.angular_frequency_per_s,
        radii,
        distances,
        built.fluid.density_kg_per_m3,
    )
    return float(np.sum(rates))
