"""The pendulums of ``config/config.yaml``, from the paper's equations: the example's truth."""

from typing import Any, NamedTuple

import numpy as np

from pendpipe import physics

HYSTERETIC, DRAG = 3940.0, 1.117


class Truth(NamedTuple):
    """One pendulum's motion and theory."""

    frequency: float
    rates: tuple[float, float, float]
    start_rad: float
    duration_s: float
    inertia: float
    viscous: float
    steady: float
    depth_ratio: float
    lengthening: physics.Lengthening | None


def estimate(value: float, sd: float, unit: str, at_bound: bool = False) -> dict[str, Any]:
    interval = [value - 1.96 * sd, value + 1.96 * sd]
    return {
        "value": value,
        "sd": sd,
        "unit": unit,
        "interval95": interval,
        "at_bound": at_bound,
    }


def parts_of(
    settings: dict[str, Any], weights: dict[str, float], *, sphere: bool
) -> list[physics.Part]:
    apparatus = settings["apparatus"]
    rod, bob = apparatus["rod"], apparatus["sphere"]
    parts: list[physics.Part] = [physics.Rod(rod["mass_kg"], rod["length_m"])]
    for name, position in weights.items():
        parts.append(physics.PointMass(apparatus["weights"][name]["mass_kg"], position))
    if sphere:
        radius = bob["diameter_m"] / 2
        parts.append(physics.Sphere(bob["mass_kg"], radius, bob["distance_m"], submerged=True))
    return parts


def truth_of(settings: dict[str, Any], weights: dict[str, float], fluid_name: str) -> Truth:
    wet = fluid_name == "water"
    parts = parts_of(settings, weights, sphere=wet)
    entry = settings["fluids"][fluid_name]
    fluid = physics.Fluid(entry["density_kg_per_m3"], entry["viscosity_pa_s"])
    moving = physics.swing(parts, fluid if wet else None)
    omega, inertia = moving.angular_frequency_per_s, moving.moment_of_inertia_kg_m2
    frequency = float(moving.frequency_hz)
    hysteretic = HYSTERETIC * frequency**2
    viscous, steady = (
        float(
            physics.viscous_quality_factor(
                inertia, omega, 0.01895, 0.452, fluid[1], fluid[0], history
            )
        )
        for history in (1.0, 0.0)
    )
    loss = 1 / hysteretic + (DRAG / viscous if wet else 0.0)
    reach = (0.01895, 0.452) if wet else (0.023, 0.35)
    quadratic = float(
        physics.quadratic_drag_rate(entry["drag_coefficient"], inertia, omega, *reach, fluid[0])
    )
    coulomb = float(physics.bearing_friction_rate(7.1e-7, inertia, omega))
    return Truth(
        frequency,
        (quadratic, np.pi * frequency * loss, coulomb),
        0.068 if wet else 0.25,
        300.0 if wet else 1500.0,
        float(inertia),
        viscous,
        steady,
        0.01895 / float(physics.penetration_depth(omega, fluid[1], fluid[0])),
        physics.period_lengthening(parts, fluid) if wet else None,
    )
