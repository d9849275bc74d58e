"""The engine against slow and trusted ways, over the whole range of pendulums."""

import math

import numpy as np
import pytest
from hypothesis import HealthCheck, assume, example, given, settings
from hypothesis import strategies as st
from mpmath import mp, mpf

from pendpipe.dynamics import Eq8, Release, sample, turning_points

from .reference import (
    DIGITS,
    MpmathPendulum,
    heyoka_turning_points,
    samples_in_stretches,
    turning_points_in_stretches,
)

W = 2.0 * math.pi * 0.516
REFERENCE = Eq8(W, quadratic=0.45, hysteretic=0.00596, viscous=0.00596, coulomb=1.4e-6)


def test_the_reference_agrees_with_taylor_series_in_time() -> None:
    with mp.workdps(DIGITS):
        pendulum = MpmathPendulum.of(REFERENCE)
        y, duration = pendulum.half_cycle(mpf("0.068"))
        with mp.workdps(28):
            x, v = pendulum.after(mpf("0.068"), duration)
        assert abs(x + y) < 1e-24
        assert abs(v) < 1e-23


@pytest.mark.slow
def test_the_reference_record_to_a_ten_billionth() -> None:
    with mp.workdps(DIGITS):
        times, angles = MpmathPendulum.of(REFERENCE).turning_points(0.068, 310)
    release = Release(0.0, 0.068)
    points = turning_points(REFERENCE, release, count=310)
    found = (points.time_s, points.angle_rad), turning_points_in_stretches(REFERENCE, release, 310)
    for time_s, angle_rad in found:
        ratios = [float(a / b) for a, b in zip(map(mpf, angle_rad), angles, strict=True)]
        phase = [W * abs(float(a - b)) for a, b in zip(map(mpf, time_s), times, strict=True)]
        assert max(abs(ratio - 1.0) for ratio in ratios) < 1e-11
        assert max(phase) < 1e-11


def test_samples_between_the_turning_points() -> None:
    with mp.workdps(24):
        pendulum = MpmathPendulum.of(REFERENCE)
        times = np.array([0.3, 0.9, 1.4, 2.2, 3.6])
        exact = [float(pendulum.angle_at(0.068, mpf(t))) for t in times]
    # Of a long record the map is tabulated.
    for more in ([], [300.0]):
        angle = sample(REFERENCE, Release(0.0, 0.068), np.append(times, [4.0, *more]))
        np.testing.assert_allclose(angle[: len(exact)], exact, atol=0.068 * 1e-11)


@st.composite
def pendulums(draw: st.DrawFn) -> tuple[Eq8, float]:
    """Draw a pendulum with Q from 5 to 1e6 at its release, and the amplitude of the release.

    The damping is shared out among the four terms at random; some may be missing.
    """
    omega = 10.0 ** draw(st.floats(-1.0, 2.0))
    y = 10.0 ** draw(st.floats(-3.0, 0.3))
    q = 5.0 * 10.0 ** draw(st.floats(0.0, 5.3))
    shares = np.array([draw(st.sampled_from([0.0, 1e-3, 0.1, 1.0])) for _ in range(4)])
    if not shares.any():
        shares[draw(st.integers(0, 3))] = 1.0
    # Eq. 15: Q = omega/2/(a y + b + c/y).
    rates = shares / shares.sum() * omega / (2 * q)
    return Eq8(omega, rates[0] / y, rates[1], rates[2], rates[3] * y), y


def moves(model: Eq8, y: float) -> bool:
    """Say whether the restoring torque at rest exceeds the friction."""
    w = model.angular_frequency
    friction = (
        math.pi / 2 * (w * model.coulomb + model.hysteretic * w * y + model.quadratic * w * y**2)
    )
    return friction < w**2 * y


@given(pendulums())
@settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.too_slow])
def test_forty_half_cycles_of_any_pendulum_agree_with_heyoka(drawn: tuple[Eq8, float]) -> None:
    model, y = drawn
    times, angles = heyoka_turning_points(model, y, 40, lambda angle: moves(model, angle))
    points = turning_points(model, Release(0.0, y), count=40)
    found = (
        (points.time_s, points.angle_rad),
        turning_points_in_stretches(model, Release(0.0, y), 40),
    )
    w = model.angular_frequency
    for time_s, angle_rad in found:
        assert time_s.size == times.size
        np.testing.assert_allclose(time_s * w, times * w, atol=2e-10)
        np.testing.assert_allclose(angle_rad, angles, rtol=1e-10, atol=1e-12 * y)


@given(st.floats(1.001, 45.0), st.floats(0.0, 0.15), st.floats(0.0, 0.15), st.floats(0.0, 0.1))
@example(3.5, 0.0, 0.0, 0.0)
@example(1.001, 0.1, 0.1, 0.1)
@example(21.0, 1e-3, 0.0, 0.0)
@settings(max_examples=150, deadline=None)
def test_to_the_stop(multiple: float, h: float, q: float, g: float) -> None:
    # The release at a multiple of the amplitude of the stop; h, q, g are the friction's
    # strengths per radian of phase, q at the release.
    first = Eq8(W, 0.0, 2 * W * h / math.pi, g * W, 2 * W * 1e-3 / math.pi)
    y = multiple * first.stop_rad
    model = Eq8(W, 2 * W * q / math.pi / y, first.hysteretic, first.viscous, first.coulomb)
    assume(y > 1.0001 * model.stop_rad)
    times, angles = heyoka_turning_points(model, y, 99, lambda angle: moves(model, angle))
    # Whether it moves on from exactly the amplitude of the stop is a matter of rounding.
    assume(np.all(np.abs(np.abs(angles) / model.stop_rad - 1.0) > 1e-8))
    points = turning_points(model, Release(0.0, y))
    assert points.stopped
    assert points.time_s.size == times.size
    np.testing.assert_allclose(points.angle_rad, angles, atol=1e-10 * model.stop_rad)
    np.testing.assert_allclose(points.time_s * W, times * W, rtol=1e-8)


@given(pendulums(), st.integers(200, 5000))
@example((Eq8(1.0, 0.0, 0.0, 0.0, 7.821237238076335e-05), 1.0), 4071)
@example((Eq8(1.0, *[0.005133812566142866] * 4), 1.0), 200)
@settings(max_examples=80, deadline=None)
def test_a_motion_taken_up_anew_at_a_turning_point_goes_on_alike(
    drawn: tuple[Eq8, float], count: int
) -> None:
    """A long motion is tabulated, a short one is not."""
    model, y = drawn
    whole = turning_points(model, Release(0.0, y), count=count)
    times, angles = turning_points_in_stretches(model, Release(0.0, y), count)
    assert whole.time_s.size == times.size
    w = model.angular_frequency
    np.testing.assert_allclose(whole.time_s * w, times * w, atol=1e-9, rtol=1e-14)
    # Each half cycle rounds the amplitude, and a constant loss always the same way: a unit in
    # the last place each (pure Coulomb friction: the table is exact to 1e-15, the others to 2e-13).
    rounding = count * np.finfo(float).eps * y
    np.testing.assert_allclose(whole.angle_rad, angles, rtol=1e-9, atol=rounding)
    time = np.linspace(0.0, times[-1] * 1.01, 3001)
    envelope = np.interp(time, times, np.abs(angles))
    difference = (
        sample(model, Release(0.0, y), time) - samples_in_stretches(model, Release(0.0, y), time)[0]
    )
    # At rest the 2e-13 of the amplitude are left, however small the rest is.
    assert np.all(np.abs(difference) < 1e-9 * (envelope + 2e-4 * y) + rounding)
