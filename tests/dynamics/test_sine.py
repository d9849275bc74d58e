"""Eq. 8 with the torque omega^2 sin x, against heyoka, elliptic functions and its energy law."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st
from scipy.special import ellipe, ellipj, ellipk

from pendpipe.dynamics import (
    JACOBIAN_COLUMNS,
    Eq8,
    Release,
    sample,
    sample_with_jacobian,
    turning_points,
    turning_points_with_jacobian,
)

from .reference import heyoka_samples, heyoka_turning_points, samples_in_stretches

W = 2.0 * math.pi * 0.516
MODEL = Eq8(W, quadratic=0.02, hysteretic=0.004, viscous=0.006, coulomb=1e-4, restoring="sine")
STENCIL = {2: -1.0, 1: 8.0, -1: -8.0, -2: 1.0}
"""Weights of a derivative to fourth order, over 12 steps."""


def moves(model: Eq8, y: float) -> bool:
    """Say whether the restoring torque at rest exceeds the friction."""
    w, s = model.angular_frequency, 2.0 * math.sin(0.5 * y)
    friction = (
        math.pi / 2 * (w * model.coulomb + model.hysteretic * w * s + model.quadratic * w * s**2)
    )
    return friction < w**2 * math.sin(y)


@pytest.mark.parametrize("y", [0.01, 0.29, 0.31, 1.0, 2.0, 2.9, 3.1])
def test_without_losses_it_is_jacobis_elliptic_function(y: float) -> None:
    k = math.sin(0.5 * y)
    time = np.linspace(0.0, 100.0, 5001)
    sn, _, dn, _ = ellipj(W * time + ellipk(k * k), k * k)
    assert np.all(dn > 0.0)
    angle = sample(Eq8(W, restoring="sine"), Release(0.0, y), time)
    np.testing.assert_allclose(angle, 2.0 * np.arcsin(k * sn), rtol=0, atol=1e-9 * y)


@st.composite
def pendulums(draw: st.DrawFn) -> tuple[Eq8, float]:
    """Draw a pendulum with Q from 10 to 1e5, and the amplitude of the release up to 2.9 rad."""
    omega = 10.0 ** draw(st.floats(-1.0, 2.0))
    y = draw(st.floats(0.01, 2.9))
    rate = omega / 20.0 * 10.0 ** -draw(st.floats(0.0, 4.0))
    shares = np.array([draw(st.sampled_from([0.0, 0.1, 1.0])) for _ in range(4)]) + 1e-6
    rates = rate * shares / shares.sum()
    return Eq8(omega, rates[0] / y, rates[1], rates[2], rates[3] * y, restoring="sine"), y


@given(pendulums())
@example((replace(MODEL, coulomb=0.0), 2.9))
@example((MODEL, 0.3))
@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.too_slow])
def test_turning_points_agree_with_heyoka(drawn: tuple[Eq8, float]) -> None:
    model, y = drawn
    times, angles = heyoka_turning_points(model, y, 60, lambda angle: moves(model, angle))
    points = turning_points(model, Release(0.0, y), count=60)
    assert points.time_s.size == times.size
    np.testing.assert_allclose(points.angle_rad, angles, rtol=0, atol=1e-10 * y)
    # How long it takes from near the top hangs on the last digit of the amplitude.
    late = np.abs(points.time_s - times) * model.angular_frequency
    assert np.max(late) < 1e-9


@pytest.mark.parametrize("y", [0.3, 1.0, 2.0, 2.9])
def test_samples_agree_with_heyoka_to_a_billionth_of_the_amplitude(y: float) -> None:
    time = np.linspace(0.0, 200.0, 997)
    expected = heyoka_samples(MODEL, y, time)
    angle = sample(MODEL, Release(0.0, y), time)
    np.testing.assert_allclose(angle, expected, rtol=0, atol=1e-9 * y)


def test_to_the_stop_from_any_amplitude() -> None:
    model = replace(MODEL, coulomb=0.03)
    for y in (0.2, 1.5, 2.8):
        times, angles = heyoka_turning_points(model, y, 999, lambda angle: moves(model, angle))
        points = turning_points(model, Release(0.0, y))
        assert points.stopped
        assert points.time_s.size == times.size
        assert abs(points.angle_rad[-1]) < model.stop_rad
        np.testing.assert_allclose(points.angle_rad, angles, rtol=0, atol=1e-11)
        np.testing.assert_allclose(points.time_s, times, rtol=1e-9)


def test_friction_holds_it_where_it_exceeds_the_torque_also_near_the_top() -> None:
    model = replace(MODEL, coulomb=0.03)
    for y in np.linspace(0.001, 3.14, 400):
        turned = turning_points(model, Release(0.0, float(y)), count=2).time_s.size
        assert turned == (2 if moves(model, float(y)) else 1)
    assert moves(model, 1.0)
    assert not moves(model, model.stop_rad * (1.0 - 1e-9))
    assert moves(model, model.stop_rad * (1.0 + 1e-9))
    assert Eq8(W, coulomb=0.7 * W, restoring="sine").stop_rad == math.inf


def test_small_amplitudes_are_the_linear_pendulum() -> None:
    time = np.linspace(0.0, 60.0, 501)
    linear = sample(replace(MODEL, restoring="linear", coulomb=1e-9), Release(0.0, 1e-5), time)
    sine = sample(replace(MODEL, coulomb=1e-9), Release(0.0, 1e-5), time)
    np.testing.assert_allclose(sine, linear, rtol=0, atol=1e-5 * 1e-9)


@pytest.mark.parametrize("y", [0.05, 1.0, 2.0, 2.9])
@pytest.mark.parametrize("name", JACOBIAN_COLUMNS[:4])
def test_each_loss_takes_from_the_amplitude_what_its_documentation_states(
    name: str, y: float
) -> None:
    rate = 1e-7
    model = replace(Eq8(W, restoring="sine"), **{name: rate})
    points = turning_points(model, Release(0.0, y), count=3)
    loss = (y - points.angle_rad[2]) / points.time_s[2]
    k = math.sin(0.5 * y)
    big_k, big_e = ellipk(k * k), ellipe(k * k)
    work = {
        "quadratic": math.pi * y * 4.0 * k * k,
        "hysteretic": math.pi * y * 2.0 * k,
        "viscous": 16.0 * (big_e - (1.0 - k * k) * big_k),
        "coulomb": math.pi * y,
    }[name]
    assert loss == pytest.approx(rate * work / (2.0 * big_k * math.sin(y)), rel=1e-4)
    if y < 0.1:  # Eq. 13
        power = {"quadratic": 2, "hysteretic": 1, "viscous": 1, "coulomb": 0}[name]
        assert loss == pytest.approx(rate * y**power, rel=1e-3)


@pytest.mark.parametrize("y", [0.4, 1.5, 2.9])
def test_turning_points_change_as_differences_of_heyokas_do(y: float) -> None:
    model, count = replace(MODEL, coulomb=1e-3), 12
    values = {name: getattr(model, name) for name in JACOBIAN_COLUMNS[:5]} | {"angle": y}
    _, times, angles = turning_points_with_jacobian(model, Release(0.0, y), count)
    for column, (name, value) in enumerate(values.items()):
        step = 2e-4 * value * (0.1 if name == "angle" else 1.0)
        moved = [
            weight
            * np.array(
                heyoka_turning_points(model, y + s * step, count)
                if name == "angle"
                else heyoka_turning_points(replace(model, **{name: value + s * step}), y, count)
            )
            for s, weight in STENCIL.items()
        ]
        by_time, by_angle = sum(moved) / (12.0 * step)
        for own, other in ((times[:, column], by_time), (angles[:, column], by_angle)):
            np.testing.assert_allclose(own, other, rtol=0, atol=2e-6 * np.abs(other).max())


@pytest.mark.parametrize("y", [0.31, 1.0, 2.9])
def test_samples_change_as_their_differences_do(y: float) -> None:
    model, release = replace(MODEL, coulomb=1e-3), Release(0.5, -y, 0.02)
    time = np.linspace(1.0, 120.0, 2001)
    angle, jacobian = sample_with_jacobian(model, release, time)
    anew = samples_in_stretches(model, release, time)[1]
    scale = np.abs(anew).max(axis=0)
    np.testing.assert_allclose(jacobian / scale, anew / scale, rtol=0, atol=1e-8)
    np.testing.assert_allclose(angle, sample(model, release, time), rtol=0, atol=1e-10)
    for column, name in enumerate(JACOBIAN_COLUMNS[:7]):
        rate = name in JACOBIAN_COLUMNS[:5]
        step = 1e-3 * getattr(model, name) if rate else 1e-4
        if name == "angular_frequency":
            step *= 0.01
        where = {"angle": "angle_rad", "time": "time_s"}.get(name, name)
        moved = [
            weight
            * (
                sample(replace(model, **{name: getattr(model, name) + s * step}), release, time)
                if rate
                else sample(
                    model, replace(release, **{where: getattr(release, where) + s * step}), time
                )
            )
            for s, weight in STENCIL.items()
        ]
        error = np.abs(sum(moved) / (12.0 * step) - jacobian[:, column]) / scale[column]
        # Where a turning point lies between the differences, these are off by its kink.
        assert np.quantile(error, 0.9) < 1e-6
        assert error.max() < 1e-3


def test_a_release_beyond_the_top_and_an_unknown_torque_are_refused() -> None:
    with pytest.raises(ValueError, match="within pi"):
        sample(MODEL, Release(0.0, 3.15), np.arange(3.0))
    with pytest.raises(ValueError, match="restoring"):
        Eq8(W, restoring="cubic")  # type: ignore[arg-type]
