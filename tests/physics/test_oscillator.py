"""Eqs. 3-7, and the frequency shifts, against integration of the equations of motion."""

import math
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from pendpipe.physics import (
    damping_coefficient,
    driven_pendulum_acceleration,
    hysteretic_frequency_shift,
    logarithmic_decrement,
    universal_acceleration,
    viscous_acceleration,
    viscous_frequency_shift,
)

OMEGA = 2.0 * np.pi * 0.5


def viscous_frequency_ratio(quality_factor: float) -> float:
    """Frequency of Eq. 3's free decay over the undamped one: ``sqrt(1 - 1/(4 Q^2))``."""
    squared = 1.0 - 0.25 / quality_factor**2
    return math.sqrt(squared)


def hysteretic_frequency_ratio(quality_factor: float) -> float:
    """Frequency of Eq. 8's hysteretic decay over omega/(2 pi): ``sqrt(1 - (pi/(4 Q_h))^2)``.

    In polar coordinates ``omega x = R cos(phi)``, ``x' = -R sin(phi)`` a half cycle of
    ``x'' + h R sgn(x') + omega^2 x = 0``, with h = pi omega/(4 Q_h), is
    ``phi' = omega - h cos(phi)``, so it takes ``pi/sqrt(omega^2 - h^2)``.
    """
    squared = 1.0 - (np.pi / (4.0 * quality_factor)) ** 2
    return math.sqrt(squared)


def hysteretic_decrement_quality(quality_factor: float) -> float:
    """Q from the decrement of a half cycle of Eq. 8's hysteretic term.

    ``Q = pi / (4 artanh(pi/(4 Q_h)))``, exactly: in the coordinates of
    `hysteretic_frequency_ratio`, ``R' = -h R sin(phi)``, so R falls by
    ``(omega - h)/(omega + h)``, and a half cycle's logarithmic decrement is pi/(2 Q).
    """
    return float(np.pi / (4.0 * np.arctanh(np.pi / (4.0 * quality_factor))))


def half_cycle(acceleration: Callable[[float, float], float]) -> tuple[float, float]:
    """Duration and ratio of amplitudes of the half cycle that starts at x = 1, going down."""

    def motion(_: float, state: np.ndarray) -> list[float]:
        # Before the first step v = 0: friction already acts against the coming motion.
        return [state[1], float(acceleration(state[0], min(state[1], -1e-300)))]

    def turning(t: float, state: np.ndarray) -> float:
        return state[1] if t > 1e-3 else -1.0

    turning.terminal, turning.direction = True, 1.0  # type: ignore[attr-defined]
    run = solve_ivp(
        motion, (0.0, 4.0), [1.0, 0.0], "DOP853", events=turning, rtol=1e-13, atol=1e-14
    )
    return float(run.t_events[0][0]), float(-run.y_events[0][0][0])


def hysteretic(quality: float) -> Callable[[float, float], float]:
    losses = (np.inf, quality, np.inf, np.inf)
    return lambda x, v: float(universal_acceleration(x, v, OMEGA, losses, 1.0))


@pytest.mark.parametrize("quality", [2.0, 10.0, 50.0])
def test_viscous_half_cycle(quality: float) -> None:
    duration, ratio = half_cycle(lambda x, v: float(viscous_acceleration(x, v, OMEGA, quality)))
    frequency = float(viscous_frequency_ratio(quality))
    assert np.pi / (OMEGA * duration) == pytest.approx(frequency, rel=1e-10)
    beta = float(damping_coefficient(OMEGA, quality))
    assert -np.log(ratio) == pytest.approx(beta * duration, rel=1e-9)


@pytest.mark.parametrize("quality", [2.0, 10.0, 50.0])
def test_hysteretic_half_cycle(quality: float) -> None:
    duration, ratio = half_cycle(hysteretic(quality))
    assert np.pi / (OMEGA * duration) == pytest.approx(
        float(hysteretic_frequency_ratio(quality)), rel=1e-10
    )
    decrement = float(logarithmic_decrement(hysteretic_decrement_quality(quality))) / 2.0
    assert -np.log(ratio) == pytest.approx(decrement, rel=1e-10)


def test_frequency_shifts_at_the_smallest_q_met() -> None:
    assert viscous_frequency_shift(10.0) == pytest.approx(-0.00125, rel=1e-12)
    assert hysteretic_frequency_shift(10.0) == pytest.approx(-(np.pi**2) / 3200.0, rel=1e-12)
    assert hysteretic_frequency_shift(10.0) / viscous_frequency_shift(10.0) == pytest.approx(
        2.467, abs=5e-4
    )
    # The leading order is 0.15 % off the exact shift of Eq. 8's own hysteretic term.
    exact = float(hysteretic_frequency_ratio(10.0)) - 1.0
    assert exact / float(hysteretic_frequency_shift(10.0)) - 1.0 == pytest.approx(0.0015, abs=1e-4)


@given(quality=st.floats(5.0, 1e5))
def test_shifts_are_the_leading_order_of_the_exact_ratios(quality: float) -> None:
    for ratio, shift in (
        (viscous_frequency_ratio, viscous_frequency_shift),
        (hysteretic_frequency_ratio, hysteretic_frequency_shift),
    ):
        leading = float(shift(quality))
        # 1 + e is (1 + 2 e)^(1/2) up to e^2/2, and a last digit of 1 is lost.
        assert float(ratio(quality)) - 1.0 == pytest.approx(leading, abs=leading**2 + 3e-16)


def test_driven_pendulum_is_the_linear_oscillator_at_small_angle() -> None:
    inertia, quality, angle, velocity = 0.1, 7.0, 1e-5, 3e-5
    driven = driven_pendulum_acceleration(
        angle,
        velocity,
        0.0,
        moment_of_inertia_kg_m2=inertia,
        restoring_moment_n_m=inertia * OMEGA**2,
        quality_factor=quality,
        angular_frequency_per_s=OMEGA,
    )
    linear = viscous_acceleration(angle, velocity, OMEGA, quality)
    assert float(driven) == pytest.approx(float(linear), rel=1e-10)


def test_undriven_pendulum_keeps_its_energy_and_the_drive_adds_its_torque() -> None:
    inertia, moment = 0.1, 1.3

    def motion(t: float, state: np.ndarray) -> list[float]:
        acceleration = driven_pendulum_acceleration(
            state[0],
            state[1],
            t,
            moment_of_inertia_kg_m2=inertia,
            restoring_moment_n_m=moment,
            quality_factor=np.inf,
            angular_frequency_per_s=1.0,
        )
        return [state[1], float(acceleration)]

    run = solve_ivp(motion, (0.0, 10.0), [2.5, 0.0], "DOP853", rtol=1e-12, atol=1e-12)
    energy = 0.5 * inertia * run.y[1] ** 2 - moment * np.cos(run.y[0])
    np.testing.assert_allclose(energy, energy[0], rtol=1e-9)
    pushed = driven_pendulum_acceleration(
        0.0,
        0.0,
        0.25,
        moment_of_inertia_kg_m2=inertia,
        restoring_moment_n_m=moment,
        quality_factor=3.0,
        angular_frequency_per_s=1.0,
        drive_torque_n_m=0.2,
        drive_angular_frequency_per_s=2.0 * np.pi,
    )
    assert float(pushed) == pytest.approx(2.0, rel=1e-14)
