"""The paper's equations as pure functions on arrays, in SI units and radians; and walls.

Every function takes numbers or arrays that broadcast and returns a number or an array.
The equations are used in their corrected forms; each docstring names its number.
"""

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from pendpipe.physics.confinement import (
        Confined,
        sphere_between_planes,
        sphere_in_tank,
    )
    from pendpipe.physics.decay import (
        amplitude,
        amplitude_and_gradient,
        amplitude_halfway,
        stopping_time,
        time_at,
        time_by_powers,
    )
    from pendpipe.physics.fluid import (
        POTENTIAL_FLOW_ADDED_MASS,
        added_mass_coefficient,
        cylinder_added_mass_coefficient,
        cylinder_drag,
        disc_drag,
        free_decay_root,
        harmonic_drag,
        penetration_depth,
        quadratic_drag_rate,
        rotation_of_sphere,
        stokes_drag,
        viscous_quality_factor,
        water_density,
        water_viscosity,
    )
    from pendpipe.physics.pendulum import (
        STANDARD_GRAVITY_M_PER_S2,
        Fluid,
        Lengthening,
        Part,
        PointMass,
        Rod,
        Sphere,
        Swing,
        added_inertia,
        bearing_friction_rate,
        displaced_moment,
        inertia_from_frequency,
        moment_of_inertia,
        period_lengthening,
        restoring_torque,
        sphere_volume,
        static_moment,
        swing,
    )
    from pendpipe.physics.quality import (
        QualityFactors,
        amplitude_of_largest_quality_factor,
        amplitude_rate,
        damping_coefficient,
        decay_rates,
        driven_pendulum_acceleration,
        energy_power_friction,
        energy_power_quality_factor,
        hysteretic_frequency_shift,
        hysteretic_loss_torque,
        hysteretic_quality_factor,
        largest_quality_factor,
        logarithmic_decrement,
        net_quality_factor,
        quality_factor,
        quality_factor_limit,
        quality_factors,
        rates_from_energy_constants,
        structural_quality_factor,
        universal_acceleration,
        viscous_acceleration,
        viscous_frequency_shift,
        without_hysteresis,
    )

__all__ = [
    "POTENTIAL_FLOW_ADDED_MASS",
    "STANDARD_GRAVITY_M_PER_S2",
    "Confined",
    "Fluid",
    "Lengthening",
    "Part",
    "PointMass",
    "QualityFactors",
    "Rod",
    "Sphere",
    "Swing",
    "added_inertia",
    "added_mass_coefficient",
    "amplitude",
    "amplitude_and_gradient",
    "amplitude_halfway",
    "amplitude_of_largest_quality_factor",
    "amplitude_rate",
    "bearing_friction_rate",
    "cylinder_added_mass_coefficient",
    "cylinder_drag",
    "damping_coefficient",
    "decay_rates",
    "disc_drag",
    "displaced_moment",
    "driven_pendulum_acceleration",
    "energy_power_friction",
    "energy_power_quality_factor",
    "free_decay_root",
    "harmonic_drag",
    "hysteretic_frequency_shift",
    "hysteretic_loss_torque",
    "hysteretic_quality_factor",
    "inertia_from_frequency",
    "largest_quality_factor",
    "logarithmic_decrement",
    "moment_of_inertia",
    "net_quality_factor",
    "penetration_depth",
    "period_lengthening",
    "quadratic_drag_rate",
    "quality_factor",
    "quality_factor_limit",
    "quality_factors",
    "rates_from_energy_constants",
    "restoring_torque",
    "rotation_of_sphere",
    "sphere_between_planes",
    "sphere_in_tank",
    "sphere_volume",
    "static_moment",
    "stokes_drag",
    "stopping_time",
    "structural_quality_factor",
    "swing",
    "time_at",
    "time_by_powers",
    "universal_acceleration",
    "viscous_acceleration",
    "viscous_frequency_shift",
    "viscous_quality_factor",
    "water_density",
    "water_viscosity",
    "without_hysteresis",
]

_MODULES = ("confinement", "decay", "fluid", "pendulum", "quality")


def __getattr__(name: str) -> Any:
    """Import an equation when it is first used: most programs need a few of them."""
    if name not in __all__:
        raise AttributeError(f"module 'pendpipe.physics' has no attribute {name!r}")
    modules = (importlib.import_module(f"{__name__}.{module}") for module in _MODULES)
    found = next(vars(module)[name] for module in modules if name in vars(module))
    globals()[name] = found  # it is asked for once
    return found


def __dir__() -> list[str]:
    """List the public names, imported or not."""
    return sorted({*__all__, *globals()})
