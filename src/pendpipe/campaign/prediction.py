"""Frequency and linear loss of every record from the campaign's shared parameters."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pendpipe import physics
from pendpipe.arrays import FloatArray
from pendpipe.campaign.design import Design, Inputs


@dataclass(frozen=True)
class Terms:
    """The equation of motion of every record: ``I s^2 + D1 s + D2 s^(3/2) + K = 0``.

    Arrays of shape (..., records), SI units. Solid friction stands beside: it changes the rate
    and not Eq. 8's frequency.

    Parameters
    ----------
    inertia, torque
        I of the solid and of the potential flow, and K.
    steady, history
        D1 and D2 of the sphere.
    screw, screw_history
        The same of the screw's immersed part.
    air
        Drag of the air on rod and weights, N m s.
    displaced
        rho V L^2 of the sphere: an added mass counts in it.
    rate
        What else is added to b, 1/s.
    inputs
        What they were made of.
    """

    inertia: FloatArray
    torque: FloatArray
    steady: FloatArray
    history: FloatArray
    screw: FloatArray
    screw_history: FloatArray
    air: FloatArray
    displaced: FloatArray
    rate: FloatArray
    inputs: Inputs

    @property
    def angular_frequency(self) -> FloatArray:
        """Nearly Eq. 8's omega: without losses, the boundary layer's inertia counted."""
        bare = np.sqrt(self.torque / self.inertia)
        layer = (self.history + self.screw_history) / np.sqrt(2.0 * bare)
        return np.asarray(np.sqrt(self.torque / (self.inertia + layer)))


def terms_of(design: Design, inputs: Inputs) -> Terms:
    """Put the equation of motion of every record together."""
    gravity = design.apparatus.gravity_m_per_s2
    sphere, spheres, wet = design.apparatus.sphere, design.spheres, design.wet
    places, masses = inputs.positions_m, inputs.masses_kg
    sizes = [design.apparatus.weights[name].radius_m for name in design.weights]
    inertia = (masses * (places**2 + 0.4 * np.square(sizes))).sum(axis=-1)
    inertia = inertia + inputs.rod_mass_kg * inputs.rod_length_m**2 / 12.0
    radius, lever = inputs.radius_m, inputs.lever_m
    ball = inputs.sphere_mass_kg * spheres
    inertia = inertia + ball * (0.4 * radius**2 + lever**2)
    density, viscosity = design.fluids(inputs.warmer_k)
    viscosity = viscosity * (1.0 + inputs.thicker)
    displaced = wet * spheres * density * physics.sphere_volume(radius)
    at = sphere.screw_distance_m if sphere else 0.0
    thick = sphere.screw_radius_m if sphere else 0.0
    length = wet * ((sphere.screw_length_m if sphere else 0.0) + inputs.screw_m)
    volume = (sphere.screw_volume_m3 if sphere else 0.0) + np.pi * thick**2 * inputs.screw_m
    screw = wet * density * volume
    moment = (masses * places).sum(axis=-1) + ball * lever
    steady = 6.0 * np.pi * viscosity * radius * lever**2 * wet * spheres
    around = np.sqrt(density * viscosity)
    turning = 1.0 + physics.rotation_of_sphere(radius, lever)
    history = 6.0 * np.pi * radius**2 * around * lever**2 * turning * wet * spheres
    whole = Terms(
        # Across its axis a cylinder carries as much fluid along as it displaces.
        inertia=inertia + 0.5 * displaced * lever**2 + screw * at**2,
        torque=gravity * (moment - displaced * lever - screw * at),
        steady=steady,
        history=history,
        screw=2.0 * np.pi * viscosity * length * at**2,
        screw_history=4.0 * np.pi * thick * around * length * at**2,
        air=np.zeros_like(steady),
        displaced=displaced * lever**2,
        rate=np.zeros_like(steady),
        inputs=inputs,
    )
    return _in_air(design, whole) if design.air is not None else whole


def _in_air(design: Design, terms: Terms) -> Terms:
    """Add what the air does: Eq. 2's drag on weights (spheres of their area) and rod."""
    assert design.air is not None
    omega = terms.angular_frequency[..., None]
    areas = np.array([design.apparatus.weights[name].frontal_area_m2 for name in design.weights])
    drags = physics.harmonic_drag(
        1.0,
        np.sqrt(areas / np.pi),
        omega,
        design.air.viscosity_pa_s,
        design.air.density_kg_per_m3,
    )
    whole = (drags * terms.inputs.positions_m**2 * design.mounted).sum(axis=-1)
    return Terms(**{**vars(terms), "air": whole + design.rod_air_drag})


def solve(design: Design, terms: Terms) -> FloatArray:
    """Return frequency in Hz and b in 1/s of every record, shape (..., records, 2).

    Both are those of Eq. 8: the frequency is |s|/(2 pi), and b holds the loss torque too,
    ``b_h = (pi/(k f)) (I_0/I)^(1 - p)``.
    """
    inputs = terms.inputs
    root = physics.free_decay_root(
        terms.inertia,
        terms.steady + terms.screw + inputs.air_drag * terms.air,
        terms.history + terms.screw_history,
        terms.torque,
    )
    omega = np.abs(root)
    frequency = omega / (2.0 * np.pi)
    relative = terms.torque / omega**2 / design.reference_inertia
    lighter = relative ** (inputs.inertia_exponent - 1.0)
    hysteretic = np.pi / frequency * np.exp(-inputs.log_coefficient) * lighter
    return np.stack(np.broadcast_arrays(frequency, hysteretic + terms.rate - root.real), axis=-1)
