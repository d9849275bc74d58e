"""Eq. 8's terms, their quality factors, and the two ways to name the losses."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from pendpipe.physics import (
    QualityFactors,
    amplitude,
    decay_rates,
    energy_power_friction,
    energy_power_quality_factor,
    hysteretic_quality_factor,
    net_quality_factor,
    quality_factor,
    quality_factors,
    structural_quality_factor,
    universal_acceleration,
)

OMEGA = 2.0 * np.pi * 0.516
positive = st.floats(-3, 4).map(lambda power: 10.0**power)


def energy_loss_of_a_cycle(losses: tuple[float, float, float, float], y: float) -> float:
    """Work of Eq. 8's friction over one harmonic cycle of amplitude y, per inertia."""
    phase = 2.0 * np.pi * (np.arange(20000) + 0.5) / 20000
    x, v = y * np.cos(phase), -y * OMEGA * np.sin(phase)
    friction = universal_acceleration(x, v, OMEGA, losses, 0.05) + OMEGA**2 * x
    return float(-np.mean(friction * v) * 2.0 * np.pi / OMEGA)


@pytest.mark.parametrize("kind", range(4))
@pytest.mark.parametrize("y", [0.05, 0.02])
def test_each_term_of_eq8_loses_what_its_quality_factor_says(kind: int, y: float) -> None:
    losses = [np.inf] * 4
    losses[kind] = 80.0
    terms = (losses[0], losses[1], losses[2], losses[3])
    net = float(net_quality_factor(terms, y, 0.05))
    energy = 0.5 * (OMEGA * y) ** 2
    assert 2.0 * np.pi * energy / energy_loss_of_a_cycle(terms, y) == pytest.approx(net, rel=1e-7)


def test_coulomb_and_fluid_quality_factors_go_with_and_against_the_amplitude() -> None:
    coulomb = net_quality_factor((80.0, np.inf, np.inf, np.inf), [0.05, 0.025], 0.05)
    fluid = net_quality_factor((np.inf, np.inf, 80.0, np.inf), [0.05, 0.025], 0.05)
    np.testing.assert_allclose(coulomb, [80.0, 40.0])
    np.testing.assert_allclose(fluid, [80.0, 160.0])


@given(qualities=st.tuples(*[positive] * 4), y0=positive, y=positive)
def test_eq9b_and_eq15_are_the_same_quality_factor(
    qualities: tuple[float, float, float, float], y0: float, y: float
) -> None:
    a, hysteretic, viscous, c = decay_rates(qualities, y0, OMEGA)
    by_rates = quality_factor(y, OMEGA / (2.0 * np.pi), a, hysteretic + viscous, c)
    assert float(by_rates) == pytest.approx(float(net_quality_factor(qualities, y, y0)), rel=1e-12)


@given(qualities=st.tuples(*[positive] * 4), y0=positive, omega=positive)
def test_quality_factors_to_rates_and_back(
    qualities: tuple[float, float, float, float], y0: float, omega: float
) -> None:
    a, hysteretic, viscous, c = decay_rates(qualities, y0, omega)
    b = hysteretic + viscous
    back = quality_factors(a, b, c, y0, omega, hysteretic / b)
    np.testing.assert_allclose(back[:3], qualities[:3], rtol=1e-12)
    # 1 - share has lost the digits in which the viscous part is below the hysteretic one.
    slack = 4e-16 * (1.0 + qualities[3] / qualities[1])
    assert float(back.viscous) == pytest.approx(qualities[3], rel=1e-12 + slack)


def test_an_absent_loss_has_an_infinite_quality_factor() -> None:
    assert quality_factors(0.0, 0.01, 0.0, 0.07, OMEGA, 0.0) == QualityFactors(
        *map(np.float64, (np.inf, np.inf, np.inf, OMEGA / 0.02))
    )
    assert decay_rates((np.inf,) * 4, 0.07, OMEGA) == (0.0, 0.0, 0.0, 0.0)


@pytest.mark.parametrize(("exponent", "slope"), [(0.0, 1.0), (0.5, 0.0), (1.0, -1.0), (0.75, -0.5)])
def test_eq9a_gives_coulomb_hysteretic_and_fluid_losses(exponent: float, slope: float) -> None:
    y = np.array([0.01, 0.02])
    quality = energy_power_quality_factor(y, 0.3, exponent, OMEGA)
    assert np.log2(quality[1] / quality[0]) == pytest.approx(slope, abs=1e-12)
    # The square wave's fundamental, 4/pi of it, is omega v/Q at the largest velocity.
    square_wave = energy_power_friction(y, 0.3, exponent)
    np.testing.assert_allclose(4.0 / np.pi * square_wave, OMEGA**2 * y / quality, rtol=1e-14)


def test_eq9a_is_eq8s_bracket() -> None:
    y0, q = 0.05, 80.0
    for kind, exponent, coefficient in (
        (0, 0.0, np.pi * OMEGA**2 * y0 / (4.0 * q)),
        (1, 0.5, np.pi * OMEGA**2 / (4.0 * q)),
        (2, 1.0, np.pi * OMEGA**2 / (4.0 * y0 * q)),
    ):
        losses = [np.inf] * 4
        losses[kind] = q
        y = 0.03
        # At the centre the energy is all kinetic: x = 0, v = omega y.
        force = -universal_acceleration(0.0, OMEGA * y, OMEGA, tuple(losses), y0)  # type: ignore[arg-type]
        assert float(force) == pytest.approx(
            float(energy_power_friction(y, coefficient, exponent)), rel=1e-13
        )


@pytest.mark.parametrize(
    "losses",
    [
        (2e4, np.inf, np.inf, np.inf),
        (np.inf, 900.0, np.inf, np.inf),
        (np.inf, np.inf, 700.0, np.inf),
        (np.inf, np.inf, np.inf, 800.0),
        (3e4, 1049.0, 2000.0, 3000.0),
    ],
    ids=["coulomb", "hysteretic", "fluid", "viscous", "all"],
)
def test_turning_points_of_eq8_follow_eq14(losses: tuple[float, float, float, float]) -> None:
    y0 = 0.05
    turning, time = y0, 0.0
    for half_cycle in range(40):
        going = -1.0 if half_cycle % 2 == 0 else 1.0

        def motion(_: float, state: np.ndarray, going: float = going) -> list[float]:
            # At rest the friction already acts against the coming motion.
            velocity = state[1] if going * state[1] > 0.0 else going * 1e-300
            return [state[1], float(universal_acceleration(state[0], velocity, OMEGA, losses, y0))]

        def rest(t: float, state: np.ndarray, going: float = going) -> float:
            return state[1] if t > 0.1 else going

        rest.terminal = True  # type: ignore[attr-defined]
        run = solve_ivp(
            motion,
            (0.0, 4.0 / OMEGA),
            [turning, 0.0],
            "DOP853",
            events=rest,
            rtol=1e-11,
            atol=1e-15,
        )
        turning, time = float(run.y_events[0][0][0]), time + float(run.t_events[0][0])
    a, hysteretic, viscous, c = decay_rates(losses, y0, OMEGA)
    law = amplitude(time, y0, a, hysteretic + viscous, c)
    # First order: what remains is second order in 1/Q, 1e-6 here.
    assert np.log(y0 / abs(turning)) == pytest.approx(np.log(y0 / float(law)), rel=2e-5)


def test_friction_opposes_the_velocity_and_eq8_is_odd() -> None:
    losses = (50.0, 60.0, 70.0, 80.0)
    x, v = np.meshgrid(np.linspace(-0.1, 0.1, 9), np.linspace(-0.3, 0.3, 9))
    acceleration = universal_acceleration(x, v, OMEGA, losses, 0.1)
    assert np.all((acceleration + OMEGA**2 * x) * v <= 0.0)
    np.testing.assert_allclose(
        universal_acceleration(-x, -v, OMEGA, losses, 0.1), -acceleration, rtol=1e-14
    )


def test_hysteretic_quality_factor_goes_with_the_square_of_the_frequency() -> None:
    q = structural_quality_factor(0.1, np.array([1.0, 2.0]), 1e-3)
    np.testing.assert_allclose(q, [100.0, 400.0])
    # The paper's k = 3940 s^2 at I = 0.1 kg m^2 is a loss torque of 1e-3 N m/rad.
    loss = 0.1 * (2.0 * np.pi) ** 2 / 3940.0
    assert float(structural_quality_factor(0.1, OMEGA, loss)) == pytest.approx(
        float(hysteretic_quality_factor(0.516, 3940.0)), rel=1e-13
    )
