"""The truth behind a simulated record: from the apparatus to the volts at the converter."""

import zlib
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from pendpipe import physics
from pendpipe.arrays import FloatArray
from pendpipe.configuration.apparatus import in_tank, pendulum, quadratic_rate
from pendpipe.configuration.load import Campaign, Record
from pendpipe.configuration.models import Sensor
from pendpipe.dynamics import Eq8, Release, sample

STEP_V = {"di154": 20.0 / 2**12, "di2108": 20.0 / 2**16}
"""The step of each simulated converter; both span -10 V to +10 V."""

FEWEST_PERIODS = 8.0
"""Of a record: fewer show no decay."""


def generator(campaign: Campaign, name: str) -> np.random.Generator:
    """Random numbers of one record: the same whatever other records there are."""
    return np.random.default_rng([campaign.configuration.seed, zlib.crc32(name.encode())])


def equation_of_motion(campaign: Campaign, record: Record) -> Eq8:
    """Eq. 8 of a simulated record, from geometry and the configured truth.

    a from C_d, c from the bearing's torque; frequency and b from the free decay in a fluid that
    remembers, with Stokes' drag on sphere and screw within the walls of the tank as it really is
    (under a level, clean surface), times the drag factor, and with the loss torque of k.
    """
    settings = campaign.configuration
    truth, built = settings.simulated, pendulum(campaign, record)
    assert truth is not None
    apparatus = built.apparatus
    ball = apparatus.sphere if built.geometry.sphere else None
    moving = physics.swing(
        built.parts,
        built.fluid if ball else None,
        apparatus.gravity_m_per_s2,
        plain_added_mass=True,
    )
    steady = history = carried = 0.0
    if ball and settings.fluids[record.fluid].boundary_layer:
        radius, lever = ball.diameter_m / 2, ball.distance_m
        density, viscosity = (float(np.asarray(each)) for each in built.fluid)
        layer = float(physics.penetration_depth(moving.angular_frequency_per_s, viscosity, density))
        walls = in_tank(truth.tank or apparatus.tank, radius, layer)
        memory = float(np.sqrt(density / viscosity))
        steady = 6.0 * np.pi * viscosity * radius * lever**2 * truth.drag_factor * walls.drag_factor
        turning = 1.0 + float(physics.rotation_of_sphere(radius, lever))
        history = steady * turning * truth.history_coefficient * radius * memory
        # The memory carries its own fluid along; the rest is the potential flow's.
        potential = walls.added_mass_coefficient - 2.25 * layer / radius * walls.drag_factor
        displaced = density * float(physics.sphere_volume(radius)) * lever**2
        carried = (potential - physics.POTENTIAL_FLOW_ADDED_MASS) * displaced
        along = 2.0 * np.pi * viscosity * ball.screw_length_m * ball.screw_distance_m**2
        steady += along
        history += 2.0 * along * ball.screw_radius_m * memory
    torque = float(moving.restoring_torque_n_m_per_rad)
    stiff = apparatus.hysteresis
    loss = float(
        physics.hysteretic_loss_torque(
            truth.hysteretic_coefficient_s2,
            torque,
            stiff.reference_inertia_kg_m2,
            stiff.inertia_exponent,
        )
    )
    solid = float(moving.moment_of_inertia_kg_m2) + carried, steady, history, torque
    root = complex(physics.free_decay_root(*solid, loss, -2.0 * stiff.inertia_exponent))
    viscous, omega = -complex(physics.free_decay_root(*solid)).real, abs(root)
    friction = physics.bearing_friction_rate(apparatus.bearing_torque_n_m, torque / omega**2, omega)
    return Eq8(
        angular_frequency=omega,
        quadratic=quadratic_rate(campaign, record, built),
        hysteretic=-root.real - viscous,
        viscous=viscous,
        coulomb=float(friction),
        restoring="sine",
    )


class SensorVolts:
    """The volts at the converter at given times: motion, sensor, noise.

    The noise is drawn sample by sample in the order of the calls, so a record does not
    depend on the size of the pieces in which the device asks for it.
    """

    def __init__(
        self,
        angle: Callable[[FloatArray], FloatArray],
        sensor: Sensor,
        random: np.random.Generator,
    ) -> None:
        self.angle, self.sensor, self.random = angle, sensor, random

    def __call__(self, time_s: FloatArray) -> FloatArray:
        """Return volts at ascending times since the record's start; shape (n,)."""
        noise = self.sensor.noise_volts * self.random.standard_normal(len(time_s))
        return self.sensor.offset_volts + self.sensor.volts_per_radian * self.angle(time_s) + noise


def simulated_record(campaign: Campaign, record: Record) -> tuple[SensorVolts, dict[str, Any]]:
    """Describe one simulated record: what its sensor gives, and how that is recorded.

    Returns
    -------
    signal
        Times to volts. Its `angle` is Eq. 8 with the apparatus's own numbers, from the turning
        point before the first sample.
    setting
        The device, its clock, rate and length: arguments of `recorder.acquire_simulated`.
    """
    truth = campaign.configuration.simulated
    assert truth is not None
    plan = truth.release.get(record.record) or truth.release[record.fluid]
    model = equation_of_motion(campaign, record)
    period = 2.0 * np.pi / model.angular_frequency
    # As long as the amplitude stays above the noise, eight periods at least.
    noise = float(np.hypot(truth.sensor.noise_volts, STEP_V[truth.device.kind] / np.sqrt(12.0)))
    lasts = physics.time_at(
        noise / truth.sensor.volts_per_radian,
        plan.angle_rad,
        model.quadratic,
        model.hysteretic + model.viscous,
        model.coulomb,
    )
    duration = min(max(float(lasts), FEWEST_PERIODS * period), plan.duration_s or np.inf)
    # The first sample comes at any phase: the release lies up to a period before it.
    before = float(generator(campaign, record.record + " release").uniform(0.0, period))
    angle = partial(sample, model, Release(time_s=-before, angle_rad=plan.angle_rad))
    return SensorVolts(angle, truth.sensor, generator(campaign, record.record)), {
        "device_kind": truth.device.kind,
        "clock_scale": truth.device.clock_scale,
        "rate_hz": plan.samples / duration,
        "duration_s": duration,
    }
