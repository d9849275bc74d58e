"""Properties of water, and what a sphere loses in it (Eqs. 2 to 4, 16)."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pendpipe.physics import (
    added_mass_coefficient,
    harmonic_drag,
    penetration_depth,
    quadratic_drag_rate,
    sphere_volume,
    stokes_drag,
    viscous_quality_factor,
    water_density,
    water_viscosity,
)


def test_viscosity_at_20_c_is_the_papers() -> None:
    assert round(float(water_viscosity(20.0)) * 1e3, 4) == 1.0016


def test_viscosity_of_the_saturated_liquid_tables() -> None:
    # IAPWS values for the saturated liquid at 290, 300, 320 and 340 K, in uPa s.
    kelvin = np.array([290.0, 300.0, 320.0, 340.0])
    np.testing.assert_allclose(
        water_viscosity(kelvin - 273.15) * 1e6, [1084.0, 853.84, 577.02, 421.97], rtol=1e-3
    )


def test_density_of_the_recommended_table() -> None:
    # Tanaka et al. 2001: largest at 3.983035 C; 998.2067 at 20 C, 997.0470 at 25 C.
    np.testing.assert_allclose(
        water_density([3.983035, 20.0, 25.0]), [999.97495, 998.2067, 997.0470], rtol=5e-8
    )
    assert np.argmax(water_density(np.linspace(0.0, 10.0, 1001))) == 398


def test_outside_the_formulas_range_there_is_no_value() -> None:
    assert np.isnan(water_viscosity([-21.0, 111.0])).all()
    assert np.isnan(water_density([-1.0, 41.0])).all()


def test_a_kelvin_changes_the_viscous_quality_factor_by_about_a_percent() -> None:
    q = viscous_quality_factor(
        0.099, 3.24, 0.01895, 0.452, water_viscosity([20.0, 21.0]), water_density([20.0, 21.0])
    )
    assert 0.010 < q[1] / q[0] - 1.0 < 0.014


VISCOSITY, DENSITY = 1.0016e-3, 1000.0
RADIUS, DISTANCE, INERTIA = 0.01895, 0.452, 0.099
OMEGA = 2.0 * np.pi * 0.516


def decades(low: int, high: int) -> st.SearchStrategy[float]:
    return st.floats(low, high).map(lambda power: 10.0**power)


@pytest.mark.parametrize(("frequency", "ratio"), [(0.516, 24.1), (0.05, 7.5), (1.06, 34.6)])
def test_sphere_is_many_penetration_depths_in_radius(frequency: float, ratio: float) -> None:
    depth = penetration_depth(2.0 * np.pi * frequency, VISCOSITY, DENSITY)
    assert RADIUS / depth == pytest.approx(ratio, abs=0.05)


def test_history_term_at_the_papers_record_is_25_times_steady_stokes() -> None:
    harmonic = harmonic_drag(0.01, 0.019, OMEGA, VISCOSITY, DENSITY)
    assert harmonic / stokes_drag(0.01, 0.019, VISCOSITY) == pytest.approx(25.2, abs=0.05)


def test_eq16_at_the_papers_record() -> None:
    values = viscous_quality_factor(
        INERTIA, OMEGA, np.array([0.019, 0.01895]), DISTANCE, VISCOSITY, DENSITY
    )
    np.testing.assert_allclose(values, [174.0, 174.9], atol=0.05)


def test_eq16_is_the_energy_over_the_loss_of_a_radian() -> None:
    y = 0.01
    phase = 2.0 * np.pi * np.arange(64) / 64
    velocity = DISTANCE * OMEGA * y * np.cos(phase)
    power = harmonic_drag(velocity, RADIUS, OMEGA, VISCOSITY, DENSITY) * velocity
    loss_in_cycle = np.mean(power) * 2.0 * np.pi / OMEGA
    quality = 2.0 * np.pi * 0.5 * INERTIA * (OMEGA * y) ** 2 / loss_in_cycle
    theory = viscous_quality_factor(INERTIA, OMEGA, RADIUS, DISTANCE, VISCOSITY, DENSITY)
    assert theory == pytest.approx(quality, rel=1e-13)


@given(omega=decades(-2, 3), radius=decades(-4, 0), viscosity=decades(-6, 0), rho=decades(0, 4))
def test_drag_and_added_mass_are_the_two_parts_of_the_stokes_solution(
    omega: float, radius: float, viscosity: float, rho: float
) -> None:
    # Force on a sphere moving as exp(-i omega t): 6 pi eta a (1 + z + z^2/9) v with
    # z = sqrt(-i omega rho a^2/eta); its imaginary part is -omega times the added mass.
    z = np.sqrt(-1j * omega * rho / viscosity) * radius
    impedance = 6.0 * np.pi * viscosity * radius * (1.0 + z + z**2 / 9.0)
    displaced = rho * sphere_volume(radius)
    assert harmonic_drag(1.0, radius, omega, viscosity, rho) == pytest.approx(
        impedance.real, rel=1e-12
    )
    assert added_mass_coefficient(radius, omega, viscosity, rho) == pytest.approx(
        -impedance.imag / omega / displaced, rel=1e-12
    )


def test_drag_falls_to_steady_stokes_at_zero_frequency_and_without_history() -> None:
    steady = stokes_drag(1.0, RADIUS, VISCOSITY)
    assert harmonic_drag(1.0, RADIUS, 1e-16, VISCOSITY, DENSITY) == pytest.approx(steady, rel=1e-6)
    assert harmonic_drag(1.0, RADIUS, OMEGA, VISCOSITY, DENSITY, 0.0) == steady


def test_added_mass_at_the_papers_record() -> None:
    assert added_mass_coefficient(RADIUS, OMEGA, VISCOSITY, DENSITY) == pytest.approx(
        0.593, abs=5e-4
    )
    assert added_mass_coefficient(RADIUS, OMEGA, 0.0, DENSITY) == 0.5


def test_quadratic_drag_of_the_papers_record() -> None:
    rate = quadratic_drag_rate(0.62, INERTIA, OMEGA, RADIUS, DISTANCE, DENSITY)
    assert rate == pytest.approx(0.45, abs=0.002)


def test_quadratic_drag_rate_is_the_energy_loss_of_harmonic_motion() -> None:
    y, coefficient = 0.05, 0.62
    phase = 2.0 * np.pi * np.arange(4096) / 4096
    speed = np.abs(DISTANCE * OMEGA * y * np.cos(phase))
    force = 0.5 * DENSITY * coefficient * np.pi * RADIUS**2 * speed**2
    mean_power = np.mean(force * speed)
    # d(I omega^2 y^2/2)/dt = -power, so y' = -power/(I omega^2 y) = -a y^2.
    a = mean_power / (INERTIA * OMEGA**2 * y**3)
    assert quadratic_drag_rate(
        coefficient, INERTIA, OMEGA, RADIUS, DISTANCE, DENSITY
    ) == pytest.approx(a, rel=1e-6)
