"""What may stand in a campaign's configuration, key by key.

The JSON schema in ``workflow/schemas`` and the table in ``config/README.md`` are made
from these models, so a key is described once: here. Lengths are metres, masses
kilograms, angles radians; distances are counted from the axis along the rod.
"""

from typing import Annotated, Final, Literal

from pydantic import BaseModel, ConfigDict, Field

Positive = Annotated[float, Field(gt=0)]
NotNegative = Annotated[float, Field(ge=0)]
Length = Annotated[float, Field(gt=0, le=10.0)]
"""Metres, of an apparatus in a room; what is larger was meant in another unit."""
LengthOrNone = Annotated[float, Field(ge=0, le=10.0)]
Distance = Annotated[float, Field(ge=-10.0, le=10.0)]
Size = Annotated[float, Field(gt=0, le=1.0)]
"""Metres, of a body on the pendulum's rod."""
SizeOrNone = Annotated[float, Field(ge=0, le=1.0)]
Mass = Annotated[float, Field(gt=0, le=50.0)]
"""Kilograms, of what a person clamps to a rod."""
MassError = Annotated[float, Field(ge=0, le=50.0)]
Area = Annotated[float, Field(ge=0, le=1.0)]
Volume = Annotated[float, Field(ge=0, le=1.0)]
Viscosity = Annotated[float, Field(gt=0, le=0.5)]
"""Pascal seconds. Oils have 0.1 and less; in glycerol, 1.4, the paper's sphere rests in a swing."""
Gravity = Annotated[float, Field(gt=0, le=30.0)]
"""m/s²: Jupiter's is 25."""
Angle = Annotated[float, Field(gt=0, le=3.15)]
"""Radians, of a release: the top is at pi."""
Celsius = Annotated[float, Field(gt=-273.15)]
WATER_C: Final = (0.0, 40.0)
"""Where the formulas of `pendpipe.physics` for water's density and viscosity hold, in Celsius."""


class Section(BaseModel):
    """A part of the configuration; a key that is not listed is refused."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class Rod(Section):
    """The rod, pivoted at its middle."""

    mass_kg: Mass = Field(description="mass of the rod with what is glued to it")
    mass_sd_kg: MassError = Field(0.0, description="standard uncertainty of that mass")
    length_m: Length = Field(description="its whole length")
    length_sd_m: LengthOrNone = Field(0.0, description="standard uncertainty of that length")
    radius_m: SizeOrNone = Field(0.0, description="radius, for the drag of the air; 0 for none")


class Weight(Section):
    """A weight that can be clamped anywhere on the rod."""

    mass_kg: Mass = Field(description="mass")
    mass_sd_kg: MassError = Field(0.0, description="standard uncertainty of the mass")
    radius_m: SizeOrNone = Field(
        0.0, description="radius of a solid sphere of that mass; 0 for a point"
    )
    frontal_area_m2: Area = Field(
        0.0, description="area that meets the air, for the quadratic drag; 0 for none"
    )


class Sphere(Section):
    """The sphere at the lower end, which swings in the fluid."""

    mass_kg: Mass = Field(description="mass with its screw")
    mass_sd_kg: MassError = Field(0.0, description="standard uncertainty of that mass")
    diameter_m: Size = Field(description="diameter")
    diameter_sd_m: SizeOrNone = Field(0.0, description="standard uncertainty of the diameter")
    distance_m: Length = Field(description="from the axis to the centre of the sphere (L)")
    distance_sd_m: LengthOrNone = Field(0.0, description="standard uncertainty of that distance")
    screw_volume_m3: Volume = Field(0.0, description="volume of the immersed part of the screw")
    screw_distance_m: LengthOrNone = Field(
        0.0, description="from the axis to the middle of the immersed part of the screw"
    )
    screw_radius_m: SizeOrNone = Field(0.0024, description="radius of the screw, for its drag")
    screw_length_m: LengthOrNone = Field(
        0.0, description="immersed length of the screw that drags; its volume stands above"
    )
    screw_length_sd_m: LengthOrNone = Field(
        0.0, description="standard uncertainty of the immersed length"
    )


class Tank(Section):
    """The tank in which the sphere swings, along its length."""

    length_m: Length = Field(description="inner length, along the motion")
    width_m: Length = Field(description="inner width, across it")
    depth_m: Length = Field(description="depth of the fluid")
    depth_sd_m: LengthOrNone = Field(
        0.0, description="standard uncertainty of the depth, which counts where a height is given"
    )
    height_m: Length | None = Field(
        None, description="of the sphere's centre above the floor; blank: half the depth"
    )
    height_sd_m: LengthOrNone = Field(0.0, description="standard uncertainty of that height")
    off_centre_m: LengthOrNone = Field(0.0, description="of the sphere, across the tank")


class Hysteresis(Section):
    """What is assumed of the loss torque: ``Q_h = k f^2 (I/I_0)^(1 - exponent)``."""

    inertia_exponent: float = Field(
        0.0,
        description="of the loss torque per angle: 0 for a constant one (Q_h = I omega^2 over"
        " it), 1 for the paper's k f^2 whatever the moment of inertia",
    )
    reference_inertia_kg_m2: Positive = Field(
        0.1, description="I_0, the moment of inertia to which k belongs"
    )
    inertia_exponent_sd: NotNegative = Field(
        0.0, description="standard uncertainty of that exponent"
    )
    assembly_relative_sd: NotNegative = Field(
        0.05,
        description="relative standard uncertainty of the ratio of the loss torques in water and"
        " in air, between which the pendulum is assembled anew",
    )


class Apparatus(Section):
    """The compound pendulum, before the weights are clamped."""

    gravity_m_per_s2: Gravity = Field(9.80665, description="local acceleration of free fall")
    gravity_sd_m_per_s2: NotNegative = Field(
        0.01,
        description="its standard uncertainty; 0.01 where only the standard value is known, which"
        " latitude changes by 0.5 % from the equator to the poles",
    )
    clock_relative_sd: NotNegative = Field(
        1.0e-4, description="relative standard uncertainty of the recorder's clock"
    )
    rod: Rod = Field(description="the rod")
    weights: dict[str, Weight] = Field(description="the weights, by name")
    sphere: Sphere | None = Field(None, description="the sphere that swings in the fluid")
    bearing_torque_n_m: LengthOrNone = Field(0.0, description="friction torque of the bearings")
    added_mass: Literal["boundary-layer", "plain"] = Field(
        "boundary-layer",
        description="on the paper's route, of the displaced fluid: 1/2 + 9 delta/(4 radius), or the"
        " plain 1/2; the fit of all records together has the whole memory of the layer",
    )
    position_sd_m: LengthOrNone = Field(
        1.0e-4, description="standard uncertainty of a weight's distance, each time it is clamped"
    )
    scale_zero_sd_m: LengthOrNone = Field(
        3.0e-4, description="standard uncertainty of the zero that all these distances share"
    )
    hysteresis: Hysteresis = Field(
        default_factory=Hysteresis, description="the loss torque of the solid parts"
    )
    tank: Tank | None = Field(None, description="the tank; none: its walls are far away")


class Geometry(Section):
    """Where the weights are clamped for a record."""

    weights_m: dict[str, Distance] = Field(
        description="name of a weight to its distance from the axis; negative above it"
    )
    sphere: bool = Field(True, description="whether the sphere is fitted")


class Fluid(Section):
    """What the pendulum swings in; it acts on the sphere, without one on the weights."""

    density_kg_per_m3: Positive = Field(description="density")
    viscosity_pa_s: Viscosity = Field(description="dynamic viscosity")
    drag_coefficient: NotNegative = Field(
        0.0, description="C_d of the drag that grows with the square of the velocity"
    )
    boundary_layer: bool = Field(
        True, description="whether Stokes' drag with its history term acts (Eq. 2)"
    )
    temperature_c: Annotated[float, Field(ge=WATER_C[0], le=WATER_C[1])] | None = Field(
        None,
        description="water only: where density and viscosity hold; a record's own temperature"
        " then scales them; blank: they hold for every record",
    )
    temperature_sd_k: NotNegative = Field(
        0.5, description="standard uncertainty of the thermometer, common to all records"
    )


class Sensor(Section):
    """The angle sensor of the simulated instrument."""

    volts_per_radian: Positive = Field(3.85, description="its constant")
    offset_volts: float = Field(0.0, description="its reading at rest")
    noise_volts: NotNegative = Field(0.0, description="rms of its white noise")


class Device(Section):
    """The converter of the simulated instrument."""

    kind: Literal["di154", "di2108"] = Field(
        "di2108", description="di154: 12 bit on a slow line; di2108: 16 bit"
    )
    clock_scale: Positive = Field(
        1000.0, description="seconds of the device for each second of the wall clock"
    )


class Release(Section):
    """How a simulated record begins and ends."""

    angle_rad: Angle = Field(description="amplitude at the release")
    samples: Annotated[int, Field(ge=64, le=10_000_000)] = Field(
        32768, description="number of samples kept"
    )
    duration_s: Positive | None = Field(
        None, description="length of the record; blank: until the amplitude meets the noise"
    )


class Simulated(Section):
    """The truth that the simulated instrument hides."""

    hysteretic_coefficient_s2: Positive = Field(3940.0, description="k of Q_hys = k f^2")
    drag_factor: Positive = Field(
        1.0, description="drag in the fluid over that of Eq. 2 within the tank's walls"
    )
    history_coefficient: NotNegative = Field(1.0, description="C_H of Eq. 2")
    tank: Tank | None = Field(
        None, description="the tank as it really is; none: as the apparatus tells it"
    )
    sensor: Sensor = Field(default_factory=Sensor, description="the angle sensor")
    device: Device = Field(default_factory=Device, description="the converter")
    release: dict[str, Release] = Field(
        description="how a record begins, by fluid, or by record where one differs"
    )


class CaliperRun(Section):
    """The calibration of the sensor against a caliper."""

    source: str = Field(
        "simulated", description="`simulated`, or a CSV with displacement_m or angle and volts"
    )
    arm_m: Length = Field(description="from the axis to where the caliper touches")
    travel_m: Length = Field(description="largest displacement to each side")
    points: Annotated[int, Field(ge=5)] = Field(description="number of positions")
    displacement_sd_m: LengthOrNone = Field(description="standard uncertainty of the caliper")
    samples: Annotated[int, Field(ge=1)] = Field(64, description="samples averaged at a position")


class Fit(Section):
    """How a, b and c are found."""

    method: Literal["auto", "waveform", "turning-points"] = Field(
        "auto",
        description="Eq. 8 on all samples, Eq. 14 on the turning points, or (auto) the former"
        " unless it contradicts the decay",
    )


class Diagnose(Section):
    """What is asked about physics that was left out, record by record."""

    enabled: bool = Field(True, description="whether the records are diagnosed")
    baseline: Literal["eq8", "viscous"] = Field(
        "eq8", description="the null model: Eq. 8, or Eq. 3 (linear damping alone)"
    )
    level: Annotated[float, Field(gt=0, lt=1)] = Field(
        0.01, description="false-alarm probability for a record that lacks nothing"
    )
    figures: Literal["all", "found", "none"] = Field(
        "found", description="draw them for all records, or where something is missing, or never"
    )


class Configuration(Section):
    """A campaign."""

    title: str = Field(description="heading of the report")
    records: str = Field("config/records.tsv", description="table of the records, a row each")
    results: str = Field("results", description="folder of the results")
    seed: Annotated[int, Field(ge=0)] = Field(
        0, description="seed of everything that is drawn at random"
    )
    only: list[str] = Field(
        [], description="records whose own stages are run, and nothing else; none: all"
    )
    batch: Annotated[int, Field(ge=1)] | None = Field(
        None, description="most records in a job of a stage; blank: some four jobs, of 16 to 128"
    )
    strict: bool = Field(
        False, description="whether a record that can't be used stops the campaign"
    )
    fit: Fit = Field(default_factory=Fit, description="how a, b and c are found")
    diagnose: Diagnose = Field(
        default_factory=Diagnose, description="the search for physics that was left out"
    )
    apparatus: Apparatus | None = Field(None, description="the compound pendulum; none: no theory")
    geometries: dict[str, Geometry] = Field(
        {}, description="where the weights are clamped, by name"
    )
    fluids: dict[str, Fluid] = Field({}, description="the fluids, by name")
    calibration: CaliperRun | None = Field(None, description="the sensor's calibration")
    simulated: Simulated | None = Field(None, description="the truth of simulated records")
    typical_record: str | None = Field(
        None, description="the record of figures 7 and 8; none: the first in a fluid with a sphere"
    )
