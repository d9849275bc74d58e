"""Eq. 8 where theory has closed forms, and the derivative of half an order."""

import math

import numpy as np
import pytest
from hypothesis import given, strategies as st
from scipy.special import fresnel

from pendpipe.dynamics import Eq8, Release, sample, turning_points
from pendpipe.dynamics.any_law import Clock, Motion
from pendpipe.dynamics.half_derivative import half_derivative

# Eq. 8 where theory has closed forms.

W = 2.0 * math.pi * 0.516


def test_without_losses_it_is_a_cosine() -> None:
    time = np.linspace(3.0, 500.0, 10_001)
    angle = sample(Eq8(W), Release(2.5, -0.1, 0.02), time)
    np.testing.assert_allclose(angle, 0.02 - 0.1 * np.cos(W * (time - 2.5)), atol=2e-14)


@pytest.mark.parametrize("q", [0.6, 2.0, 20.0, 136.0, 1e6])
def test_viscous_decay_is_the_textbook_solution(q: float) -> None:
    b = W / (2 * q)
    damped = math.sqrt(W**2 - b**2)
    time = np.linspace(0.0, 40.0 if q < 10 else 200.0, 4001)
    expected = np.exp(-b * time) * (np.cos(damped * time) + b / damped * np.sin(damped * time))
    angle = sample(Eq8(W, viscous=b), Release(0.0, 1.0), time)
    envelope = np.exp(-b * time)
    assert np.max(np.abs(angle - expected) / envelope) < 1e-9
    points = turning_points(Eq8(W, viscous=b), Release(0.0, 1.0), count=20)
    np.testing.assert_allclose(points.time_s, np.arange(20) * math.pi / damped, rtol=1e-11)


def test_coulomb_friction_takes_two_delta_a_half_cycle_and_stops_the_pendulum() -> None:
    c = 2e-3
    delta = math.pi * c / (2 * W)
    y0 = 140.3 * delta
    points = turning_points(Eq8(W, coulomb=c), Release(1.0, y0, 0.5))
    k = np.arange(71)
    expected = (-1.0) ** k * (y0 - 2 * k * delta)
    assert points.stopped
    np.testing.assert_allclose(points.angle_rad - 0.5, expected, atol=1e-14)
    np.testing.assert_allclose(points.time_s - 1.0, k * math.pi / W, rtol=1e-12)
    later = sample(Eq8(W, coulomb=c), Release(1.0, y0, 0.5), points.time_s[-1] + np.arange(9.0))
    np.testing.assert_array_equal(later, points.angle_rad[-1])


@given(st.floats(0.8, 1e5))
def test_hysteretic_decay_has_the_decrement_and_the_shift_of_equation_6(q_h: float) -> None:
    # Q = pi/(4 artanh(pi/(4 Q_h))) from the decrement of a half cycle, whatever the amplitude.
    points = turning_points(Eq8(W, hysteretic=W / (2 * q_h)), Release(0.0, 0.3), count=4)
    ratios = np.log(np.abs(points.angle_rad[:-1] / points.angle_rad[1:]))
    loss = 2 * math.atanh(math.pi / (4 * q_h))
    np.testing.assert_allclose(ratios, loss, rtol=1e-10, atol=3e-16)
    # The period of x'' + x = h R sgn: both half circles slow down by 1/sqrt(1 - h^2).
    h = math.pi / (4 * q_h)
    half_period = math.pi / W / math.sqrt((1 - h) * (1 + h))
    np.testing.assert_allclose(np.diff(points.time_s), half_period, rtol=1e-11)
    if q_h > 10:
        shift = math.pi / W / half_period - 1
        assert shift == pytest.approx(-(math.pi**2) / (32 * q_h**2), rel=0.02, abs=1e-15)


def test_hysteretic_friction_locks_the_pendulum_below_a_quality_of_pi_over_4() -> None:
    model = Eq8(W, hysteretic=W / (2 * 0.999 * math.pi / 4))
    assert model.stop_rad == math.inf
    assert turning_points(model, Release(0.0, 0.3), count=9).angle_rad[-1] == 0.3
    free = turning_points(
        Eq8(W, hysteretic=W / (2 * 1.001 * math.pi / 4)), Release(0.0, 0.3), count=9
    )
    assert not free.stopped
    assert free.angle_rad.size == 9


def test_quadratic_friction_locks_large_amplitudes_only() -> None:
    # Friction q y^2 against y: it moves below y = 1/q = 2 omega/(pi a).
    a = 3.0
    lock = 2 * W / (math.pi * a)
    assert turning_points(Eq8(W, quadratic=a), Release(0.0, 1.001 * lock), count=5).stopped
    assert not turning_points(Eq8(W, quadratic=a), Release(0.0, 0.999 * lock), count=5).stopped


@given(
    st.floats(0.0, 0.3),
    st.floats(0.0, 0.3),
    st.floats(0.0, 0.3),
    st.floats(1e-4, 0.3),
    st.floats(1e-3, 2.0),
)
def test_friction_at_rest_decides_about_the_stop(
    a: float, b_h: float, b_v: float, c: float, y: float
) -> None:
    # At rest rho = omega y: it stays if f_c + f_h omega y + f_q omega^2 y^2 >= omega^2 y.
    model = Eq8(W, a, b_h, b_v, c)
    friction = math.pi / 2 * (W * c + b_h * W * y + a / W * (W * y) ** 2)
    if abs(friction / (W**2 * y) - 1.0) < 1e-12:
        return
    turned = turning_points(model, Release(0.0, y), count=2).angle_rad.size
    assert turned == (1 if friction >= W**2 * y else 2)


@given(
    st.floats(0.0, 0.5),
    st.floats(0.0, 0.1),
    st.floats(0.0, 0.1),
    st.floats(0.0, 1e-3),
    st.floats(1e-3, 0.4),
)
def test_the_motion_has_the_symmetries_of_equation_8(
    a: float, b_h: float, b_v: float, c: float, y: float
) -> None:
    model = Eq8(W, a, b_h, b_v, c)
    time = np.linspace(0.0, 60.0, 701)
    angle = sample(model, Release(0.0, y), time)
    # left and right
    np.testing.assert_array_equal(sample(model, Release(0.0, -y), time), -angle)
    # any hour of the day
    later = sample(model, Release(128.0, y), time + 128.0)
    np.testing.assert_allclose(later, angle, rtol=0, atol=1e-10 * y)
    # time in other units: all rates scale
    fast = Eq8(2 * W, 2 * a, 2 * b_h, 2 * b_v, 2 * c)
    np.testing.assert_allclose(
        sample(fast, Release(0.0, y), time / 2), angle, rtol=0, atol=1e-10 * y
    )
    # angle in other units: a as 1/angle, c as angle
    other = Eq8(W, a / 4, b_h, b_v, 4 * c)
    np.testing.assert_allclose(
        sample(other, Release(0.0, 4 * y), time), 4 * angle, rtol=0, atol=1e-10 * y
    )


def test_an_amplitude_beyond_measure_does_no_harm() -> None:
    time = np.linspace(0.0, 3e4, 301)
    angle = sample(Eq8(W, viscous=W / 10), Release(0.0, 0.1), time)
    # At the release it is 0.1 but for the last digit.
    assert angle[0] == pytest.approx(0.1, rel=3e-16)
    assert np.all(np.abs(angle[1:]) <= 0.1 * np.exp(-W / 10.1 * time[1:]) + 1e-119)


def test_an_overdamped_pendulum_is_refused() -> None:
    with pytest.raises(ValueError, match="overdamped"):
        turning_points(Eq8(W, viscous=1.01 * W), Release(0.0, 0.1), count=3)


def test_uneven_times_give_the_same_as_even_ones() -> None:
    model, release = Eq8(W, 0.45, 0.006, 0.006, 1e-4), Release(0.0, 0.07)
    time = np.linspace(0.0, 400.0, 8001)
    chosen = np.sort(np.random.default_rng(5).choice(time.size, 700, replace=False))
    whole = sample(model, release, time)
    np.testing.assert_allclose(
        sample(model, release, time[chosen]), whole[chosen], rtol=1e-13, atol=1e-17
    )
    # Also when several samples share an instant, and for none or one.
    twice = np.repeat(time[:50], 2)
    np.testing.assert_allclose(
        sample(model, release, twice),
        np.repeat(whole[:50], 2),
        atol=0.07 * 1e-11,  # another stretch of time has another table
    )
    assert sample(model, release, np.empty(0)).size == 0
    assert sample(model, release, np.array([0.0])) == pytest.approx(0.07, rel=1e-13)


def test_turning_points_end_where_they_are_asked_to() -> None:
    model, release = Eq8(W, viscous=0.01), Release(0.0, 0.1)
    points = turning_points(model, release, until_s=10.0)
    following = turning_points(model, release, count=points.time_s.size + 1)
    assert points.time_s[-1] <= 10.0 < following.time_s[-1]
    assert not points.stopped
    exact = turning_points(model, release, until_s=float(points.time_s[3]))
    assert exact.time_s.size == 4


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: turning_points(Eq8(W, viscous=0.1), Release(0.0, 0.1)), "no end"),
        (lambda: turning_points(Eq8(W), Release(0.0, 0.1), count=0), "at least 1"),
        (lambda: turning_points(Eq8(W), Release(5.0, 0.1), until_s=4.0), "before the release"),
        (lambda: sample(Eq8(W), Release(5.0, 0.1), np.array([4.0])), "before the release"),
        (lambda: sample(Eq8(W), Release(0.0, 0.1), np.array([4.0, 3.0])), "ascend"),
        (lambda: sample(Eq8(W), Release(0.0, 0.1), np.array([1.0, np.nan, 3.0])), "ascend"),
        (lambda: sample(Eq8(W), Release(0.0, 0.1), np.array([1.0, np.inf])), "finite"),
        (lambda: Eq8(0.0), "angular_frequency"),
        (lambda: Eq8(W, viscous=-1.0), "viscous"),
        (lambda: Eq8(W, coulomb=math.nan), "coulomb"),
        (lambda: Release(math.nan, 0.1), "time_s"),
    ],
)
def test_what_makes_no_sense_is_refused(call: object, message: str) -> None:
    assert callable(call)
    with pytest.raises(ValueError, match=message):
        call()


# The half derivative of a sine that begins at rest is made of Fresnel's integrals.

OMEGA = 5.0


def steady(half_cycles: int) -> Motion:
    """cos(omega t)."""
    clock = Clock(half_cycles, 24)
    return Motion(clock, OMEGA, np.zeros_like(clock.psi), clock.psi / OMEGA)


@pytest.mark.parametrize(("half_cycles", "first"), [(1, 0), (2, 1), (3, 0), (40, 7), (2001, 0)])
def test_a_sine_from_rest(half_cycles: int, first: int) -> None:
    """D^(1/2) sin(w t) = sqrt(2 w) [cos(w t) C(z) + sin(w t) S(z)], z = sqrt(2 w t/pi)."""
    motion = steady(half_cycles)
    phase = motion.clock.psi[first:] - math.pi * first
    s, c = fresnel(np.sqrt(2.0 * phase / math.pi))
    sign = -1.0 if first % 2 else 1.0
    exact = -sign * OMEGA * math.sqrt(2.0 * OMEGA) * (np.cos(phase) * c + np.sin(phase) * s)
    found = half_derivative(motion, first)
    assert np.all(found[:first] == 0.0)
    assert found[first:] == pytest.approx(exact, abs=1e-5 * OMEGA**1.5)


def test_long_after_the_release_friction_and_added_mass_remain() -> None:
    """D^(1/2) e^(i w t) is sqrt(i w) e^(i w t): a half derivative leads by an eighth of a turn."""
    motion = steady(4001)
    expected = -(OMEGA**1.5) * np.sin(motion.clock.psi[-1] + 0.25 * math.pi)
    # The release fades with 1/t^(3/2).
    assert half_derivative(motion)[-1] == pytest.approx(expected, abs=1e-5 * OMEGA**1.5)
