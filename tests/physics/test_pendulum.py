"""The compound pendulum: textbook bodies, the paper's apparatus, and water."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import brentq

from pendpipe.physics import (
    STANDARD_GRAVITY_M_PER_S2,
    Fluid,
    Part,
    PointMass,
    Rod,
    Sphere,
    added_inertia,
    bearing_friction_rate,
    inertia_from_frequency,
    moment_of_inertia,
    period_lengthening,
    restoring_torque,
    sphere_volume,
    static_moment,
    swing,
    viscous_quality_factor,
)

WATER = Fluid(1000.0, 1.0016e-3)
G = STANDARD_GRAVITY_M_PER_S2


def apparatus(lower: object, upper: object = None) -> list[Part]:
    """The paper's rod, weights and wooden sphere; positions of the weights in m."""
    parts: list[Part] = [
        Rod(0.0444, 0.77),
        Sphere(0.0358, 0.01895, 0.452, submerged=True),
        PointMass(0.993, lower),  # type: ignore[arg-type]
    ]
    return parts if upper is None else [*parts, PointMass(0.711, -np.asarray(upper))]


def test_textbook_pendulums() -> None:
    simple = swing([PointMass(1.0, 2.0)])
    assert simple.angular_frequency_per_s == pytest.approx(np.sqrt(G / 2.0), rel=1e-15)
    rod = swing([Rod(0.3, 1.2, centre_m=0.6)])  # hung at its end: l_eff = 2 l/3
    assert rod.angular_frequency_per_s == pytest.approx(np.sqrt(G / 0.8), rel=1e-14)
    ball = swing([Sphere(2.0, 0.1, 1.0)])
    assert ball.angular_frequency_per_s == pytest.approx(np.sqrt(G / 1.004), rel=1e-14)


@given(inertia=st.floats(0.0, 1.0), mass=st.floats(0.1, 10.0), at=st.floats(-1.0, 1.0))
def test_parallel_axes(inertia: float, mass: float, at: float) -> None:
    assert moment_of_inertia([PointMass(mass, at, inertia)]) == pytest.approx(
        inertia + mass * at**2, rel=1e-14, abs=1e-300
    )


def test_a_balanced_pendulum_has_no_frequency() -> None:
    parts = [PointMass(1.0, 0.3), PointMass(1.0, -0.3)]
    assert static_moment(parts) == 0.0
    assert np.isnan(swing(parts).angular_frequency_per_s)
    assert np.isnan(swing([PointMass(1.0, -0.3)]).frequency_hz)


def test_density_of_the_wooden_sphere() -> None:
    assert 0.0358 / sphere_volume(0.01895) == pytest.approx(1256.0, abs=0.5)


def test_the_apparatus_closes_on_the_papers_record() -> None:
    motion = swing(apparatus(0.25, [0.19, 0.20]), WATER)
    assert motion.frequency_hz[0] > 0.516 > motion.frequency_hz[1]
    np.testing.assert_allclose(motion.frequency_hz, 0.52, atol=0.02)
    np.testing.assert_allclose(motion.moment_of_inertia_kg_m2, 0.10, atol=0.004)


def test_the_high_branch_reaches_1_06_hz_and_its_exponent_is_near_the_papers() -> None:
    motion = swing(apparatus(np.linspace(0.11, 0.29, 8)), WATER)
    assert motion.frequency_hz[0] == pytest.approx(1.06, abs=0.005)
    quality = viscous_quality_factor(
        motion.moment_of_inertia_kg_m2,
        motion.angular_frequency_per_s,
        0.01895,
        0.452,
        WATER.viscosity_pa_s,
        WATER.density_kg_per_m3,
    )
    slope = np.polyfit(np.log(motion.frequency_hz), np.log(quality), 1)[0]
    assert -5.8 <= slope <= -5.5


@given(lower=st.floats(0.1, 0.35), upper=st.floats(0.0, 0.05))
def test_frequency_and_added_mass_agree_with_each_other(lower: float, upper: float) -> None:
    parts = apparatus(lower, upper)
    torque = float(restoring_torque(parts, WATER))

    def imbalance(omega: float) -> float:
        inertia = moment_of_inertia(parts) + added_inertia(parts, WATER, omega)
        return float(inertia * omega**2 - torque)

    found = swing(parts, WATER)
    expected = brentq(imbalance, 0.1, 20.0, xtol=1e-15, rtol=1e-14)
    assert float(found.angular_frequency_per_s) == pytest.approx(expected, rel=1e-12)
    assert float(
        inertia_from_frequency(found.frequency_hz, found.restoring_torque_n_m_per_rad)
    ) == pytest.approx(float(found.moment_of_inertia_kg_m2), rel=1e-12)


def test_buoyancy_weighs_the_sphere_less_its_water() -> None:
    parts: list[Part] = [Sphere(0.0358, 0.01895, 0.452, submerged=True)]
    net = (0.0358 - 1000.0 * sphere_volume(0.01895)) * G * 0.452
    assert restoring_torque(parts, WATER) == pytest.approx(net, rel=1e-13)
    assert restoring_torque(parts) == pytest.approx(0.0358 * G * 0.452, rel=1e-13)


def test_a_submerged_screw_is_buoyed_too() -> None:
    parts: list[Part] = [PointMass(0.004, 0.43, displaced_m3=5e-7)]
    assert restoring_torque(parts, WATER) == pytest.approx((0.004 - 5e-4) * G * 0.43, rel=1e-13)


def test_plain_added_mass_is_half_the_displaced_water() -> None:
    parts = apparatus(0.25)
    half = 0.5 * 1000.0 * sphere_volume(0.01895) * 0.452**2
    assert added_inertia(parts, WATER, 3.0, plain_added_mass=True) == pytest.approx(half, rel=1e-14)
    assert added_inertia(parts, WATER, 3.0) > half
    assert added_inertia(parts, None, 3.0) == 0.0


def test_water_lengthens_the_period_and_more_so_where_it_is_long() -> None:
    longer = period_lengthening(apparatus(0.25, [0.15, 0.19, 0.22]), WATER)
    assert np.all(longer.buoyancy > 0.0)
    assert np.all(longer.added_mass > 0.0)
    assert np.all(np.diff(longer.buoyancy) > 0.0)
    # The two factors multiply, up to the added mass's dependence on the frequency.
    product = (1.0 + longer.buoyancy) * (1.0 + longer.added_mass) - 1.0
    np.testing.assert_allclose(longer.both, product, rtol=0.01)


def test_a_thin_fluid_changes_nothing() -> None:
    longer = period_lengthening(apparatus(0.25), Fluid(1e-9, 1e-15))
    assert max(map(float, longer)) < 1e-10


def test_buoyancy_may_leave_no_restoring_torque() -> None:
    parts = apparatus(0.25, 0.3665)
    assert swing(parts).frequency_hz > 0.0
    assert np.isnan(swing(parts, WATER).frequency_hz)


def test_bearing_friction_of_the_papers_record() -> None:
    c = bearing_friction_rate(7.1e-7, 0.099, 2.0 * np.pi * 0.516)
    assert c == pytest.approx(1.4e-6, abs=0.01e-6)


@given(torque=st.floats(1e-8, 1e-3), y=st.floats(1e-3, 0.1))
def test_bearing_friction_takes_four_torques_times_amplitude_a_cycle(
    torque: float, y: float
) -> None:
    inertia, omega = 0.099, 3.24
    c = float(bearing_friction_rate(torque, inertia, omega))
    energy_loss = inertia * omega**2 * y * c * 2.0 * np.pi / omega
    assert energy_loss == pytest.approx(4.0 * torque * y, rel=1e-12)


def test_units_scale_out_of_the_frequency() -> None:
    # Lengths twice as long at the same g: the period grows by sqrt(2), whatever the masses.
    small = swing([Rod(0.1, 0.5, 0.1), PointMass(0.7, 0.3)])
    large = swing([Rod(0.3, 1.0, 0.2), PointMass(2.1, 0.6)])
    assert large.frequency_hz * np.sqrt(2.0) == pytest.approx(small.frequency_hz, rel=1e-14)
