"""What a campaign's records have in common, and how well it is known beforehand.

Every uncertain input is a `Nuisance` with a Gaussian prior: each distance by itself as often as
a weight is clamped, the zero that they share, masses, sphere, thermometer, screw, loss torque.
The fit counts them in standard deviations from their configured values.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from pendpipe import physics
from pendpipe.arrays import BoolArray, FloatArray
from pendpipe.campaign.walls import height_sd
from pendpipe.configuration.apparatus import fluid_at
from pendpipe.configuration.load import Campaign, Record
from pendpipe.configuration.models import Apparatus, Fluid

AIR_DRAG_RELATIVE_SD = 0.1
"""Of the drag that weights and rod meet in air: each weight counts as the sphere of its area."""


class Nuisance(NamedTuple):
    """An uncertain input; `sd` is infinite where nothing is known beforehand."""

    name: str
    unit: str
    sd: float


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


@dataclass(frozen=True)
class Design:
    """Apparatus and runs, as arrays. Build one with `design_of`."""

    apparatus: Apparatus
    runs: tuple[Run, ...]
    air: Fluid | None
    coefficient_s2: float = 3940.0
    """k about which the fit counts."""
    reference_inertia: float = 0.1
    """I_0 of Q_h = k f^2 (I/I_0)^(1 - p), kg m^2: the k of a campaign is that of this inertia."""

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
    def nuisances(self) -> tuple[Nuisance, ...]:
        """All uncertain inputs; those with sd 0 are exact and are left out."""
        own, sphere, law = self.apparatus, self.apparatus.sphere, self.apparatus.hysteresis
        wet = [run.fluid for run in self.runs if run.fluid is not None]
        found = [Nuisance("hysteretic coefficient", "", math.inf)]
        found += [
            Nuisance(f"distance of {name} at {place:g} m", "m", own.position_sd_m)
            for name, place in self.clamps
        ]
        found += [
            Nuisance("zero of the scale", "m", own.scale_zero_sd_m),
            *(
                Nuisance(f"mass of {name}", "kg", own.weights[name].mass_sd_kg)
                for name in self.weights
            ),
            Nuisance("mass of the rod", "kg", own.rod.mass_sd_kg),
            Nuisance("length of the rod", "m", own.rod.length_sd_m),
            Nuisance("exponent of the loss torque", "", law.inertia_exponent_sd),
        ]
        if sphere is not None and any(run.sphere for run in self.runs):
            found += [
                Nuisance("mass of the sphere", "kg", sphere.mass_sd_kg),
                Nuisance("radius of the sphere", "m", sphere.diameter_sd_m / 2),
                Nuisance("lever of the sphere", "m", sphere.distance_sd_m),
            ]
            if own.tank is not None and any(run.tank for run in self.runs):
                found.append(Nuisance("height in the tank", "depths", height_sd(own.tank)))
        if wet:
            found.append(Nuisance("thermometer", "K", max(f.temperature_sd_k for f in wet)))
            found.append(
                Nuisance("immersed screw", "m", sphere.screw_length_sd_m if sphere else 0.0)
            )
        if self.air is not None and self.air.boundary_layer:
            found.append(Nuisance("air drag", "", AIR_DRAG_RELATIVE_SD))
        found += [
            Nuisance(f"loss torque in {name}", "", law.assembly_relative_sd)
            for name in self.assemblies[1:]
        ]
        return tuple(each for each in found if each.sd > 0.0)

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
        index = {each.name: number for number, each in enumerate(self.nuisances)}

        def deviation(name: str) -> FloatArray:
            if name not in index:
                return np.zeros((*moved.shape[:-1], 1))
            return np.asarray(deviations[..., index[name], None])

        places = np.array([place for _, place in self.clamps])
        if self.apparatus.position_sd_m > 0.0:
            start = 1  # behind the one that is free
            places = places + deviations[..., start : start + len(places)]
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
        )

    def fluids(self, warmer_k: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Density and viscosity around each record's lower end; shape (..., records).

        They follow water's formulas, where the fluid's temperature is given; a mixture is
        taken to change with temperature as water does.
        """
        columns = []
        for run in self.runs:
            if run.fluid is None:
                columns.append((0.0, 1.0, 20.0, 0.0))
                continue
            density, viscosity = fluid_at(run.fluid, run.temperature_c)
            known = run.fluid.temperature_c
            about = run.temperature_c if run.temperature_c is not None else known
            columns.append(
                (density, viscosity, 20.0 if about is None else about, known is not None)
            )
        density, viscosity, about, follows = np.array(columns).T
        then = np.clip(about + follows * warmer_k, 0.0, 40.0)
        lighter = physics.water_density(then) / physics.water_density(about)
        thinner = physics.water_viscosity(then) / physics.water_viscosity(about)
        return density * lighter, viscosity * thinner

    @cached_property
    def rod_air_drag(self) -> FloatArray:
        """Drag of the air on the rod at the configured geometry, N m s; shape (records,)."""
        from pendpipe.campaign.prediction import terms_of

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
    runs, gases = [], []
    for record, number in zip(records, numbers, strict=True):
        geometry = campaign.geometry(record)
        assert geometry is not None
        fluid = settings.fluids[record.fluid]
        if not geometry.sphere:
            gases.append(fluid)
        plans = settings.simulated.release if settings.simulated else {}
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
