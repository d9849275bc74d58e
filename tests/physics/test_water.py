"""Viscosity and density of water against published tables."""

import numpy as np

from pendpipe.physics import viscous_quality_factor, water_density, water_viscosity


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
