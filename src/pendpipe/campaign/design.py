"""A campaign's records: what is uncertain of them beforehand, and what their equation predicts.

Every uncertain input is a `Nuisance` with a Gaussian prior: each distance by itself as often as
a weight is clamped, the zero that they share, masses, sphere, thermometer, screw, loss torque.
The fit counts them in standard deviations from their configured values.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Final, NamedTuple

import numpy as np

from pendpipe import physics
from pendpipe.arrays import BoolArray, FloatArray, IntArray
from pendpipe.campaign.tank import DEPTHS, confined, height_sd, room_m
from pendpipe.configuration.apparatus import fluid_at
from pendpipe.configuration.load import Campaign, Record
from pendpipe.configuration.models import WATER_C, Apparatus, Fluid, Tank

AIR_DRAG_RELATIVE_SD = 0.1
"""Of the drag that weights and rod meet in air: each weight counts as the sphere of its area."""


_FILM_SD: Final = 0.5
"""Of a surface that is clean (0) or under a film (1), which are equally probable."""


class Nuisance(NamedTuple):
    """An uncertain input; `sd` is infinite where nothing is known beforehand.

    One that was `measured` may have been measured wrong; a cause of the catalogue frees the others.
    """

    name: str
    unit: str
    sd: float
    measured: bool = False


@dataclass(frozen=True)
class Run:
    """The conditions of one record, or of one that might be taken.

    Parameters
    ----------
    record, branch
        Its name and group.
    weights_m
        Where each weight is clamped.
    fluid
        What the sphere swings in; None where nothing acts on it.
    temperature_c
        Of that fluid; None where its values hold as they stand.
    sphere
        Whether the sphere is fitted. With a fluid and no sphere the bare screw is immersed.
    order
        When it was taken, from -1/2 to 1/2 of the day.
    release_rad
        Amplitude at the start.
    tank, open_surface
        Whether the walls are near; whether the fluid's surface can move.
    assembly
        Records of one assembly share a loss torque.
    """

    record: str
    branch: str
    weights_m: Mapping[str, float]
    fluid: Fluid | None
    temperature_c: float | None
    sphere: bool
    order: float
    release_rad: float
    tank: bool = True
    open_surface: bool = True
    assembly: str = "air"


@dataclass(frozen=True)
class Inputs:
    """The uncertain inputs as they enter: arrays of shape (..., records) or (..., 1).

    `positions_m` and `masses_kg` have a last axis for the weights.
    """

    positions_m: FloatArray
    masses_kg: FloatArray
    rod_mass_kg: FloatArray
    rod_length_m: FloatArray
    sphere_mass_kg: FloatArray
    radius_m: FloatArray
    lever_m: FloatArray
    warmer_k: FloatArray
    thicker: FloatArray
    """Relative excess of the viscosity over that of its temperature."""
    screw_m: FloatArray
    air_drag: FloatArray
    log_coefficient: FloatArray
    inertia_exponent: FloatArray
    higher: FloatArray
    """Of the sphere in the tank, in depths of the fluid."""
    deeper_m: FloatArray
    """Of the fluid in the tank."""
    closer: FloatArray
    """Closeness of the walls beyond that of the tank that is told."""
    film: FloatArray
    """0 under a clean surface, 1 under a film; in between for a share of both."""
    gravity: FloatArray
    fast_clock: FloatArray
    """Relative excess of the recorded frequencies and rates over the true ones."""
    rate_exponent: FloatArray
    """Of the loss torque in omega: 0 for internal friction that doesn't depend on the rate."""


@dataclass(frozen=True)
class Design:
    """Apparatus and runs, as arrays. Build one with `design_of`."""

    apparatus: Apparatus
    runs: tuple[Run, ...]
    air: Fluid | None
    coefficient_s2: float = 3940.0
    """k about which the fit counts."""
    walls: bool = True
    """Whether Eq. 16 is that within the walls of the tank that is told."""

    @property
    def reference_inertia(self) -> float:
        """I_0 of Q_h = k f^2 (I/I_0)^(1 - p), kg m^2: k is that of this inertia."""
        return self.apparatus.hysteresis.reference_inertia_kg_m2

    @cached_property
    def weights(self) -> tuple[str, ...]:
        """The weights that occur."""
        return tuple(sorted({name for run in self.runs for name in run.weights_m}))

    @cached_property
    def clamps(self) -> tuple[tuple[str, float], ...]:
        """Weight and place, each once: a weight that stays where it is keeps its error."""
        return tuple(sorted({item for run in self.runs for item in run.weights_m.items()}))

    @cached_property
    def assemblies(self) -> tuple[str, ...]:
        """The assemblies; k is that of the first, one without a fluid where there is one."""
        order = sorted(self.runs, key=lambda run: run.fluid is not None)
        return tuple(dict.fromkeys(run.assembly for run in order))

    @cached_property
    def tank(self) -> Tank | None:
        """The tank that is told; None where none is, or none that holds the sphere."""
        tank, sphere = self.apparatus.tank, self.apparatus.sphere
        held = tank and sphere and room_m(tank, 0.5 * sphere.diameter_m) > 0.0
        return tank if held else None

    @cached_property
    def nuisances(self) -> tuple[Nuisance, ...]:
        """All uncertain inputs; those with sd 0 are exact and are left out."""
        own, sphere, law = self.apparatus, self.apparatus.sphere, self.apparatus.hysteresis
        fluids = [run.fluid for run in self.runs if run.fluid is not None]
        fitted = sphere if any(run.sphere for run in self.runs) else None
        tank = self.tank if fitted and any(run.tank for run in self.runs) else None
        told = tank if self.walls else None
        drags_in_air = self.air is not None and self.air.boundary_layer
        radius_sd = 0.5 * fitted.diameter_sd_m if fitted else 0.0
        found = (
            Nuisance("hysteretic coefficient", "", math.inf),
            *(
                Nuisance(
                    f"distance of {name} at {place:g} m",
                    "m",
                    own.position_sd_m,
                    # A clamp of one record alone is that record.
                    sum(run.weights_m.get(name) == place for run in self.runs) > 1,
                )
                for name, place in self.clamps
            ),
            Nuisance("zero of the scale", "m", own.scale_zero_sd_m, True),
            *(
                Nuisance(f"mass of {name}", "kg", own.weights[name].mass_sd_kg, True)
                for name in self.weights
            ),
            Nuisance("mass of the rod", "kg", own.rod.mass_sd_kg, True),
            Nuisance("length of the rod", "m", own.rod.length_sd_m, True),
            Nuisance("exponent of the loss torque", "", law.inertia_exponent_sd),
            Nuisance("mass of the sphere", "kg", fitted.mass_sd_kg if fitted else 0.0, True),
            Nuisance("radius of the sphere", "m", radius_sd, True),
            Nuisance("lever of the sphere", "m", fitted.distance_sd_m if fitted else 0.0, True),
            Nuisance("height in the tank", "depths", height_sd(tank) if tank else 0.0),
            Nuisance("depth of the fluid", "m", told.depth_sd_m if told else 0.0),
            Nuisance("film on the surface", "", _FILM_SD if told else 0.0),
            Nuisance("thermometer", "K", max((f.temperature_sd_k for f in fluids), default=0.0)),
            Nuisance("immersed screw", "m", sphere.screw_length_sd_m if fluids and sphere else 0.0),
            Nuisance("gravity", "m/s^2", own.gravity_sd_m_per_s2, True),
            Nuisance("clock", "", own.clock_relative_sd, True),
            Nuisance("air drag", "", AIR_DRAG_RELATIVE_SD if drags_in_air else 0.0),
            *(
                Nuisance(f"loss torque in {name}", "", law.assembly_relative_sd)
                for name in self.assemblies[1:]
            ),
        )
        return tuple(each for each in found if each.sd > 0.0)

    @cached_property
    def index(self) -> dict[str, int]:
        """Where each nuisance stands, by its name."""
        return {each.name: number for number, each in enumerate(self.nuisances)}

    @cached_property
    def has_prior(self) -> BoolArray:
        """Which nuisances have a prior; shape (nuisances,), boolean."""
        return np.array([math.isfinite(each.sd) for each in self.nuisances])

    @cached_property
    def sds(self) -> FloatArray:
        """What one unit of each nuisance means: its sd, or 1 where it is free."""
        return np.array([each.sd if math.isfinite(each.sd) else 1.0 for each in self.nuisances])

    @cached_property
    def wet(self) -> FloatArray:
        """1 where a fluid acts on what is at the lower end; shape (records,)."""
        return np.array([float(run.fluid is not None) for run in self.runs])

    @cached_property
    def spheres(self) -> FloatArray:
        """1 where the sphere is fitted; shape (records,)."""
        return np.array([float(run.sphere) for run in self.runs])

    @cached_property
    def _clamp_index(self) -> Any:
        index = {clamp: number for number, clamp in enumerate(self.clamps)}
        return np.array(
            [
                [index.get((name, run.weights_m.get(name, math.nan)), -1) for name in self.weights]
                for run in self.runs
            ]
        )

    @cached_property
    def mounted(self) -> FloatArray:
        """1 where a weight is on the rod; shape (records, weights)."""
        return np.asarray(self._clamp_index >= 0, dtype=np.float64)

    def inputs(self, moved: FloatArray) -> Inputs:
        """Return the inputs for nuisances in standard deviations, shape (..., nuisances)."""
        deviations = moved * self.sds

        def deviation(name: str) -> FloatArray:
            if name not in self.index:
                return np.zeros((*moved.shape[:-1], 1))
            return np.asarray(deviations[..., self.index[name], None])

        places = np.array([place for _, place in self.clamps])
        if self.apparatus.position_sd_m > 0.0:  # they stand behind the one that is free
            places = places + deviations[..., 1 : 1 + len(places)]
        places = places + deviation("zero of the scale")
        own, sphere = self.apparatus, self.apparatus.sphere
        masses = [own.weights[name].mass_kg + deviation(f"mass of {name}") for name in self.weights]
        ratio = sum(
            np.array([run.assembly == name for run in self.runs])
            * deviation(f"loss torque in {name}")
            for name in self.assemblies
        )
        drags_in_air = float(self.air is not None and self.air.boundary_layer)
        return Inputs(
            positions_m=places[..., self._clamp_index] * self.mounted,
            masses_kg=np.stack(masses, axis=-1) * self.mounted,
            rod_mass_kg=own.rod.mass_kg + deviation("mass of the rod"),
            rod_length_m=own.rod.length_m + deviation("length of the rod"),
            sphere_mass_kg=(sphere.mass_kg if sphere else 0.0) + deviation("mass of the sphere"),
            radius_m=(sphere.diameter_m / 2 if sphere else 1.0) + deviation("radius of the sphere"),
            lever_m=(sphere.distance_m if sphere else 1.0) + deviation("lever of the sphere"),
            warmer_k=deviation("thermometer"),
            thicker=np.zeros((*moved.shape[:-1], 1)),
            screw_m=deviation("immersed screw"),
            air_drag=drags_in_air * (1.0 + deviation("air drag")),
            log_coefficient=math.log(self.coefficient_s2)
            + deviation("hysteretic coefficient")
            - ratio,
            inertia_exponent=own.hysteresis.inertia_exponent
            + deviation("exponent of the loss torque"),
            higher=deviation("height in the tank"),
            deeper_m=deviation("depth of the fluid"),
            closer=np.zeros((*moved.shape[:-1], 1)),
            film=0.5 + deviation("film on the surface"),
            gravity=own.gravity_m_per_s2 + deviation("gravity"),
            fast_clock=deviation("clock"),
            rate_exponent=np.zeros((*moved.shape[:-1], 1)),
        )

    def fluids(self, warmer_k: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Density and viscosity around each record's lower end; shape (..., records).

        They follow water's formulas, where the fluid's temperature is given; a mixture is
        taken to change with temperature as water does.
        """
        warmer_k = np.broadcast_to(warmer_k, (*warmer_k.shape[:-1], len(self.runs)))
        density, viscosity = np.zeros_like(warmer_k), np.ones_like(warmer_k)
        for fluid, chosen, about in self._baths:
            then = np.clip(about + warmer_k[..., chosen], *WATER_C)
            density[..., chosen], viscosity[..., chosen] = fluid_at(fluid, then)
        return density, viscosity

    @cached_property
    def _baths(self) -> list[tuple[Fluid, IntArray, FloatArray]]:
        """Each fluid, the indices of its records, and their temperatures in Celsius."""
        found = []
        for fluid in dict.fromkeys(run.fluid for run in self.runs if run.fluid is not None):
            chosen = [number for number, run in enumerate(self.runs) if run.fluid == fluid]
            given = [self.runs[number].temperature_c for number in chosen]
            about = [fluid.temperature_c if each is None else each for each in given]
            found.append((fluid, np.array(chosen), np.array(about, dtype=np.float64)))
        return found

    @cached_property
    def rod_air_drag(self) -> FloatArray:
        """Drag of the air on the rod at the configured geometry, N m s; shape (records,)."""
        radius, length = self.apparatus.rod.radius_m, self.apparatus.rod.length_m
        if self.air is None or radius == 0.0:
            return np.zeros(len(self.runs))
        bare = replace(self, air=None)
        omega = terms_of(bare, bare.inputs(np.zeros(len(bare.nuisances)))).angular_frequency
        around = self.air.viscosity_pa_s, self.air.density_kg_per_m3
        return physics.cylinder_drag(radius, omega, *around) * length**3 / 12.0


def design_of(campaign: Campaign, records: Sequence[Record]) -> Design:
    """Build the design of a campaign's records.

    Parameters
    ----------
    campaign
        With an apparatus; every record with a geometry and a fluid.
    records
        Those that are used.
    """
    settings = campaign.configuration
    apparatus = settings.apparatus
    assert apparatus is not None
    numbers = [
        float(row) if record.order is None else record.order for row, record in enumerate(records)
    ]
    first, span = min(numbers), max(numbers) - min(numbers)
    plans = settings.simulated.release if settings.simulated else {}
    runs, gases = [], []
    for record, number in zip(records, numbers, strict=True):
        geometry = campaign.geometry(record)
        assert geometry is not None
        fluid = settings.fluids[record.fluid]
        if not geometry.sphere:
            gases.append(fluid)
        plan = plans.get(record.record) or plans.get(record.fluid)
        runs.append(
            Run(
                record.record,
                record.branch,
                geometry.weights_m,
                fluid if geometry.sphere else None,
                record.temperature_c,
                geometry.sphere,
                (number - first) / span - 0.5 if span else 0.0,
                plan.angle_rad if plan else math.nan,
                assembly=record.fluid,
            )
        )
    return Design(apparatus, tuple(runs), gases[0] if gases else None)


@dataclass(frozen=True)
class Terms:
    """The equation of motion of every record, as `physics.free_decay_root` has it.

    Arrays of shape (..., records), SI units.

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
    inputs: Inputs

    @property
    def angular_frequency(self) -> FloatArray:
        """Nearly Eq. 8's omega: without losses, the boundary layer's inertia counted."""
        bare = np.sqrt(self.torque / self.inertia)
        layer = (self.history + self.screw_history) / np.sqrt(2.0 * bare)
        return np.asarray(np.sqrt(self.torque / (self.inertia + layer)))


def terms_of(design: Design, inputs: Inputs) -> Terms:
    """Put the equation of motion of every record together."""
    gravity = inputs.gravity
    sphere, spheres, wet = design.apparatus.sphere, design.spheres, design.wet
    places, masses = inputs.positions_m, inputs.masses_kg
    sizes = [design.apparatus.weights[name].radius_m for name in design.weights]
    radius, lever = inputs.radius_m, inputs.lever_m
    ball = inputs.sphere_mass_kg * spheres
    inertia = (
        (masses * (places**2 + 0.4 * np.square(sizes))).sum(axis=-1)
        + inputs.rod_mass_kg * inputs.rod_length_m**2 / 12.0
        + ball * (0.4 * radius**2 + lever**2)
    )
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
        inputs=inputs,
    )
    if design.tank is not None:
        whole = _within_walls(design, design.tank, whole, (viscosity, density))
    if design.air is None:
        return whole
    # What the air does: Eq. 2's drag on weights (spheres of their area) and rod.
    areas = np.array([design.apparatus.weights[name].frontal_area_m2 for name in design.weights])
    drags = physics.harmonic_drag(
        1.0,
        np.sqrt(areas / np.pi),
        whole.angular_frequency[..., None],
        design.air.viscosity_pa_s,
        design.air.density_kg_per_m3,
    )
    on_weights = (drags * places**2 * design.mounted).sum(axis=-1)
    return replace(whole, air=on_weights + design.rod_air_drag)


def _within_walls(
    design: Design, tank: Tank, terms: Terms, fluid: tuple[FloatArray, FloatArray]
) -> Terms:
    """Walls, floor and surface: the fluid goes faster past the sphere.

    Drag and added mass grow together, as `confined` says of tanks of the told one's proportions.
    """
    inputs, runs = terms.inputs, design.runs
    told = (2.0 * inputs.radius_m / (tank.depth_m + inputs.deeper_m)) ** 3 if design.walls else 0.0
    inside = np.flatnonzero([run.tank and run.fluid is not None for run in runs])
    near = np.broadcast_to(np.maximum(told + inputs.closer, 0.0), terms.inertia.shape)[..., inside]
    if not np.any(near):
        return terms
    around = (each[..., inside] for each in fluid)
    omega = terms.angular_frequency[..., inside]
    depth = physics.penetration_depth(omega, *around) / inputs.radius_m
    film = np.where([runs[number].open_surface for number in inside], inputs.film, 1.0)
    drag, mass = confined(tank, film, near, np.minimum(depth, DEPTHS[-1]), inputs.higher)
    factor, carried = np.ones_like(terms.inertia), np.zeros_like(terms.inertia)
    factor[..., inside] = drag
    # The memory's own inertia grows with its drag; the rest is the potential flow's.
    carried[..., inside] = mass - 2.25 * depth * (drag - 1.0)
    return replace(
        terms,
        steady=terms.steady * factor,
        history=terms.history * factor,
        inertia=terms.inertia + carried * terms.displaced,
    )


def solve(design: Design, terms: Terms) -> FloatArray:
    """Return frequency in Hz and b in 1/s of every record, shape (..., records, 2).

    Both are those of Eq. 8, by the recorder's clock: the frequency is |s|/(2 pi), and b holds the
    loss torque too.
    """
    inputs = terms.inputs
    root = physics.free_decay_root(
        terms.inertia,
        terms.steady + terms.screw + inputs.air_drag * terms.air,
        terms.history + terms.screw_history,
        terms.torque,
        *loss_torque(design, terms),
    )
    read = np.stack(np.broadcast_arrays(np.abs(root) / (2.0 * np.pi), -root.real), axis=-1)
    return np.asarray(read * (1.0 + inputs.fast_clock[..., None]))


def loss_torque(design: Design, terms: Terms) -> tuple[FloatArray, FloatArray]:
    """Loss torque of every record at 1 rad/s, and its exponent in the angular frequency."""
    inputs, exponent = terms.inputs, terms.inputs.inertia_exponent
    k = np.exp(inputs.log_coefficient)
    return (
        physics.hysteretic_loss_torque(k, terms.torque, design.reference_inertia, exponent),
        inputs.rate_exponent - 2.0 * exponent,
    )
