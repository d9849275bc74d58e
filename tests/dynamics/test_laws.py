"""Other laws than Eq. 8: large amplitudes, other frictions, explicit time, own states."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.special import ellipk, gamma

from pendpipe.dynamics import (
    Autonomous,
    EnergyFriction,
    Eq8,
    Eq8Friction,
    FrictionOf,
    Gravity,
    Method,
    PolynomialTorque,
    PowerFriction,
    Release,
    StribeckFriction,
    follow_driven,
    linear,
    sample,
    turning_points,
)

METHODS: tuple[Method, ...] = ("map", "clock")
W = 2.0 * math.pi * 0.516


@given(
    st.floats(0.0, 0.5), st.floats(0.0, 0.1), st.floats(0.0, 0.1), st.floats(0.0, 1e-3),
    st.floats(1e-3, 0.4),
)  # fmt: skip
@settings(max_examples=25, deadline=None)
def test_equation_8_as_a_general_law_is_equation_8(
    a: float, b_h: float, b_v: float, c: float, y: float
) -> None:
    model, release = Eq8(W, a, b_h, b_v, c), Release(2.0, -y, 0.1)
    law = Autonomous(linear(W), (Eq8Friction(model),))
    expected = turning_points(model, release, count=50)
    for method in METHODS:
        points = turning_points(law, release, count=50, method=method)
        assert points.time_s.size == expected.time_s.size
        assert points.stopped == expected.stopped
        np.testing.assert_allclose(points.angle_rad, expected.angle_rad, rtol=0, atol=1e-10 * y)
        np.testing.assert_allclose(points.time_s * W, expected.time_s * W, rtol=0, atol=1e-8)
    time = np.linspace(2.0, expected.time_s[-1], 300)
    np.testing.assert_allclose(
        sample(law, release, time), sample(model, release, time), rtol=0, atol=1e-9 * y
    )


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("y", [1e-3, 0.5, 2.6, 3.1])
def test_the_plain_pendulum_has_the_period_of_the_elliptic_integral(
    method: Method, y: float
) -> None:
    points = turning_points(Autonomous(Gravity(W)), Release(0.0, y), count=30, method=method)
    half_period = 2.0 * ellipk(math.sin(0.5 * y) ** 2) / W
    np.testing.assert_allclose(np.diff(points.time_s), half_period, rtol=1e-10)
    np.testing.assert_allclose(np.abs(points.angle_rad), y, rtol=1e-10)


@pytest.mark.parametrize(
    ("exponent", "name"), [(0.0, "coulomb"), (0.5, "hysteretic"), (1.0, "quadratic")]
)
def test_equation_9a_holds_the_three_frictions_of_equation_8(exponent: float, name: str) -> None:
    # c (2 E/(m omega^2))^lambda with the paper's c: f_c = c, f_h = c/omega, f_q = c/omega^2.
    strength = 0.05
    # And f_c = pi omega c/2, f_h = pi b/2, f_q = pi a/(2 omega): all the same rate.
    rate = 2 * strength / (math.pi * W)
    law = Autonomous(linear(W), (EnergyFriction(strength, exponent, linear(W)),))
    expected = turning_points(Eq8(W, **{name: rate}), Release(0.0, 0.3), count=9)
    points = turning_points(law, Release(0.0, 0.3), count=9)
    np.testing.assert_allclose(points.angle_rad, expected.angle_rad, rtol=1e-10)
    np.testing.assert_allclose(points.time_s, expected.time_s, rtol=1e-10)


@pytest.mark.parametrize("exponent", [0.0, 0.3, 0.5, 1.0, 1.5, 2.0, 3.0])
def test_weak_friction_takes_off_what_its_work_says(exponent: float) -> None:
    # Work of c |v|^n in a half cycle over omega^2 y: c omega^(n-2) y^n sqrt(pi)
    # Gamma(n/2 + 1)/Gamma(n/2 + 3/2), to first order in c.
    strength, y = 1e-6, 0.3
    law = Autonomous(linear(W), (PowerFriction(strength, exponent),))
    points = turning_points(law, Release(0.0, y), count=2)
    shape = math.sqrt(math.pi) * gamma(exponent / 2 + 1) / gamma(exponent / 2 + 1.5)
    loss = strength * W ** (exponent - 2) * y**exponent * shape
    assert y - abs(points.angle_rad[1]) == pytest.approx(loss, rel=1e-5)


@pytest.mark.parametrize("exponent", [0.0, 0.25, 0.5, 0.75, 1.0])
def test_the_amplitude_falls_with_twice_the_exponent_of_the_energy(exponent: float) -> None:
    # Equation 9a on any restoring torque; here dE = -f |dx| over a nearly constant energy.
    law = Autonomous(linear(W), (EnergyFriction(1e-7, exponent, linear(W)),))
    loss = [y - abs(turning_points(law, Release(0.0, y), count=2).angle_rad[1]) for y in (0.1, 0.2)]
    assert math.log2(loss[1] / loss[0]) == pytest.approx(2 * exponent, abs=1e-6)


@dataclass(frozen=True)
class Slow:
    """An autonomous law for the general integrator."""

    law: Autonomous
    extra_start: tuple[float, ...] = ()

    def acceleration(self, _t: float, x: float, v: float, side: float, _e: np.ndarray) -> float:
        return float(self.law.acceleration(np.array([x]), np.array([v]), side)[0])

    def extra_rates(self, _t: float, _x: float, _v: float, _e: np.ndarray) -> np.ndarray:
        return np.empty(0)


LAWS = {
    "sin x, Eq. 8, 2.6 rad": (
        Autonomous(Gravity(W), (Eq8Friction(Eq8(W, 0.05, 0.01, 0.01, 1e-3)),)), 2.6,
    ),
    "|v|^1.5": (Autonomous(linear(W), (PowerFriction(0.02, 1.5),)), 0.3),
    "|v|^0.5": (Autonomous(linear(W), (PowerFriction(0.02, 0.5),)), 0.3),
    "energy^0.7": (Autonomous(Gravity(W), (EnergyFriction(0.02, 0.7, Gravity(W)),)), 0.9),
    "Stribeck": (
        Autonomous(linear(W), (StribeckFriction(1e-2, 2e-2, 5e-2), PowerFriction(0.02, 1.0))), 0.3,
    ),
    "friction by place": (
        Autonomous(linear(W), (FrictionOf(lambda x, v: 1e-2 * (1 + x / 0.5) + 0.0 * v),)), 0.3,
    ),
    "skew spring": (
        Autonomous(PolynomialTorque((W * W, 1.0, 3.0)), (PowerFriction(0.02, 1.0),)), 0.3,
    ),
}  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("name", LAWS)
@pytest.mark.parametrize("side", [1.0, -1.0])
def test_every_law_agrees_with_a_general_integrator(name: str, side: float) -> None:
    law, y = LAWS[name]
    release = Release(1.0, side * y, 0.2)
    count = 12
    reference = follow_driven(Slow(law), release, np.linspace(1.0, 1.0 + 13 * math.pi / W, 400))
    for method in METHODS:
        points = turning_points(law, release, count=count, method=method)
        size = min(count, reference.turning.time_s.size)
        assert size > 5
        np.testing.assert_allclose(
            points.angle_rad[:size], reference.turning.angle_rad[:size], rtol=0, atol=3e-9 * y
        )
        np.testing.assert_allclose(
            points.time_s[:size], reference.turning.time_s[:size], rtol=0, atol=3e-8
        )
    long = np.linspace(1.0, 1.0 + 13 * math.pi / W, 400)
    np.testing.assert_allclose(
        sample(law, release, np.append(long, 60.0))[:-1],
        reference.angle_rad,
        rtol=0,
        atol=3e-8 * y,
    )


@pytest.mark.parametrize("name", LAWS)
def test_map_and_clock_agree_for_every_law(name: str) -> None:
    law, y = LAWS[name]
    by_map, by_clock = (
        turning_points(law, Release(0.0, y), count=40, method=method) for method in METHODS
    )
    assert by_map.time_s.size == by_clock.time_s.size
    np.testing.assert_allclose(by_map.angle_rad, by_clock.angle_rad, rtol=0, atol=1e-10 * y)
    np.testing.assert_allclose(by_map.time_s * W, by_clock.time_s * W, rtol=0, atol=1e-9)


def test_friction_that_depends_on_the_side_stops_where_it_balances_the_torque() -> None:
    # 0.1 (1 + x): at rest it holds where 0.1 (1 + x) >= W^2 |x|.
    law = Autonomous(linear(W), (FrictionOf(lambda x, v: 0.1 * (1.0 + x) + 0.0 * v),))
    left, right = -0.1 / (W**2 + 0.1), 0.1 / (W**2 - 0.1)
    assert law.sticks(0.999 * right)
    assert law.sticks(0.999 * left)
    assert not law.sticks(1.001 * right)
    assert not law.sticks(1.001 * left)
    points = turning_points(law, Release(0.0, 0.3))
    assert points.stopped
    assert left <= points.rest_rad <= right
    assert not any(law.sticks(angle) for angle in points.angle_rad[:-1])
    later = sample(law, Release(0.0, 0.3), points.time_s[-1] + np.array([0.0, 1.0, 99.0]))
    np.testing.assert_array_equal(later, points.rest_rad)


def test_beyond_the_unstable_equilibrium_there_is_no_swing() -> None:
    with pytest.raises(ValueError, match="does not swing"):
        turning_points(Autonomous(Gravity(W)), Release(0.0, 3.3), count=3)


@dataclass(frozen=True)
class Shaken:
    """A viscous pendulum under a periodic torque, with Coulomb friction."""

    drive: float
    frequency: float
    viscous: float
    coulomb: float = 0.0
    extra_start: tuple[float, ...] = ()

    def acceleration(self, t: float, x: float, v: float, side: float, _e: np.ndarray) -> float:
        torque = self.drive * math.sin(self.frequency * t)
        return torque - W**2 * x - 2 * self.viscous * v - self.coulomb * side

    def extra_rates(self, _t: float, _x: float, _v: float, _e: np.ndarray) -> np.ndarray:
        return np.empty(0)


def test_a_driven_pendulum_reaches_the_amplitude_and_phase_of_theory() -> None:
    law = Shaken(0.05, 1.3 * W, 0.3)
    time = np.linspace(100.0, 110.0, 101)
    motion = follow_driven(law, Release(0.0, 0.01), time)
    response = 0.05 / (W**2 - law.frequency**2 + 2j * law.viscous * law.frequency)
    expected = np.imag(response * np.exp(1j * law.frequency * time))
    np.testing.assert_allclose(motion.angle_rad, expected, rtol=0, atol=1e-8 * abs(response))


def test_friction_holds_the_pendulum_until_the_torque_overcomes_it() -> None:
    law = Shaken(1.0, 0.2, 0.3, coulomb=0.4)
    leaves = math.asin(0.4) / 0.2
    time = np.array([0.5 * leaves, 0.999 * leaves, 1.2 * leaves])
    motion = follow_driven(law, Release(0.0, 0.0, 0.02), time)
    np.testing.assert_array_equal(motion.angle_rad[:2], 0.02)
    assert motion.angle_rad[2] > 0.02
    assert not motion.turning.stopped
    held = follow_driven(Shaken(0.3, 0.2, 0.3, coulomb=0.4), Release(0.0, 0.0), time)
    assert held.turning.stopped
    np.testing.assert_array_equal(held.angle_rad, 0.0)


@dataclass(frozen=True)
class OnASoftSupport:
    """A pendulum tied to a second oscillator by a spring: x'' = -W^2 x + k (z - x), z alike."""

    coupling: float
    extra_start: tuple[float, ...] = (0.0, 0.0)

    def acceleration(self, _t: float, x: float, _v: float, _s: float, e: np.ndarray) -> float:
        return float(-(W**2) * x + self.coupling * (e[0] - x))

    def extra_rates(self, _t: float, x: float, _v: float, e: np.ndarray) -> np.ndarray:
        return np.array([e[1], -(W**2) * e[0] + self.coupling * (x - e[0])])


def test_states_of_their_own_beat_as_two_normal_modes() -> None:
    law = OnASoftSupport(0.8)
    time = np.linspace(0.0, 60.0, 601)
    motion = follow_driven(law, Release(0.0, 0.1), time)
    slow, fast = W, math.sqrt(W**2 + 2 * law.coupling)
    both = 0.05 * (np.cos(slow * time) + np.cos(fast * time))
    np.testing.assert_allclose(motion.angle_rad, both, rtol=0, atol=1e-8)
    other = 0.05 * (np.cos(slow * time) - np.cos(fast * time))
    np.testing.assert_allclose(motion.extra[:, 0], other, rtol=0, atol=1e-8)


def test_a_friction_that_outlasts_the_torque_ends_in_creep_and_says_so() -> None:
    # |v|^(1/2) falls more slowly than the restoring torque: in the end nothing swings.
    law = Autonomous(linear(W), (PowerFriction(0.02, 0.5),))
    with pytest.raises(ValueError, match="does not swing"):
        turning_points(law, Release(0.0, 0.3), count=400)
