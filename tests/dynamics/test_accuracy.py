"""The engine and its derivatives against slow and trusted ways, for pendulums of all kinds."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import HealthCheck, assume, example, given, settings, strategies as st
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
from pendpipe.dynamics.eq8 import TurningPoints

from .reference import (
    assert_turns,
    integrated,
    samples_in_stretches,
    turning_points_in_stretches,
)

# The engine against slow and trusted ways, over the whole range of pendulums.

W = 2.0 * math.pi * 0.516
REFERENCE = Eq8(W, quadratic=0.45, hysteretic=0.00596, viscous=0.00596, coulomb=1.4e-6)


def test_the_reference_record_to_a_ten_billionth() -> None:
    release = Release(0.0, 0.068)
    points = turning_points(REFERENCE, release, count=310)
    found = (points.time_s, points.angle_rad), turning_points_in_stretches(REFERENCE, release, 310)
    for time_s, angle_rad in found:
        assert_turns(REFERENCE, 0.068, time_s, angle_rad, within=1e-11, floor=0.0)


def test_samples_between_the_turning_points() -> None:
    times = np.array([0.0, 0.3, 0.9, 1.4, 2.2, 3.6])
    exact = integrated(REFERENCE, 0.068).run(times).angle_rad
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


def after(model: Eq8, points: TurningPoints) -> tuple[np.ndarray, np.ndarray]:
    """The turning points and, where the pendulum has come to rest, three radians later."""
    if not points.stopped:
        return points.time_s, points.angle_rad
    rest_s = points.time_s[-1] + 3.0 / model.angular_frequency
    return np.append(points.time_s, rest_s), np.append(points.angle_rad, points.angle_rad[-1])


@given(pendulums())
@settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.too_slow])
def test_forty_half_cycles_of_any_pendulum_are_those_of_the_integrator(
    drawn: tuple[Eq8, float],
) -> None:
    model, y = drawn
    points = turning_points(model, Release(0.0, y), count=40)
    assert points.stopped or points.time_s.size == 40
    assert_turns(model, y, *after(model, points), within=1e-10, floor=1e-12 * y)
    anew = turning_points_in_stretches(model, Release(0.0, y), 40)
    assert_turns(model, y, *anew, within=1e-10, floor=1e-12 * y)


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
    points = turning_points(model, Release(0.0, y))
    # Whether it moves on from exactly the amplitude of the stop is a matter of rounding.
    assume(np.all(np.abs(np.abs(points.angle_rad) / model.stop_rad - 1.0) > 1e-8))
    assert points.stopped
    floor = 1e-9 * model.stop_rad
    assert_turns(model, y, *after(model, points), within=1e-8, floor=floor, late=100.0)


@pytest.mark.slow
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


# The derivatives by every parameter, exact through all turning points and the stop.

MODEL = Eq8(W, quadratic=0.45, hysteretic=0.02, viscous=0.03, coulomb=2e-4)
Y = 0.068
RATES = ("quadratic", "hysteretic", "viscous", "coulomb", "omega")


def test_the_columns_of_release_and_offset() -> None:
    time = np.linspace(2.0, 90.0, 1001)
    release = Release(1.0, -Y, 0.3)
    angle, jacobian = sample_with_jacobian(MODEL, release, time)
    np.testing.assert_array_equal(jacobian[:, 7], 1.0)
    np.testing.assert_allclose(angle, sample(MODEL, release, time), rtol=1e-12)
    # A later release is the same motion later: minus the velocity.
    step = 1e-3
    later, earlier = (sample(MODEL, replace(release, time_s=1.0 + s), time) for s in (step, -step))
    twice = [sample(MODEL, replace(release, time_s=1.0 + 2 * s), time) for s in (step, -step)]
    slope = (8 * (later - earlier) - (twice[0] - twice[1])) / (12 * step)
    quiet = np.abs(jacobian[:, 6]) > 0.2 * np.abs(jacobian[:, 6]).max()  # far from the kinks
    np.testing.assert_allclose(jacobian[quiet, 6], slope[quiet], rtol=1e-6)


@given(
    st.floats(0.0, 0.5),
    st.floats(0.0, 0.1),
    st.floats(0.0, 0.1),
    st.floats(0.0, 3e-4),
    st.floats(0.01, 0.4),
    st.integers(10, 400),
)
@example(0.0, 0.0, 1e-16, 0.0, 0.015625, 23)  # hardly any change: ln y at the mercy of rounding
@settings(max_examples=60, deadline=None)
def test_every_column_goes_on_alike_where_the_motion_is_taken_up_anew(
    a: float, b_h: float, b_v: float, c: float, y: float, half_cycles: int
) -> None:
    model, release = Eq8(W, a, b_h, b_v, c), Release(0.0, y)
    time = np.linspace(0.0, half_cycles * math.pi / W, 997)
    angle, jacobian = sample_with_jacobian(model, release, time)
    anew, columns = samples_in_stretches(model, release, time)
    np.testing.assert_allclose(angle, anew, rtol=0, atol=1e-10 * y)
    scale = np.abs(columns).max(axis=0) + 1e-300
    np.testing.assert_allclose(jacobian / scale, columns / scale, rtol=0, atol=1e-9)


def test_the_rest_level_changes_as_the_last_turning_point() -> None:
    model = Eq8(W, 0.1, 0.01, 0.01, 3e-3)
    release = Release(0.0, Y, 0.01)
    stop = turning_points(model, release)
    time = np.append(np.linspace(0.0, stop.time_s[-1], 50), stop.time_s[-1] + np.array([0.1, 9.0]))
    angle, jacobian = sample_with_jacobian(model, release, time)
    points, _, angles = turning_points_with_jacobian(model, release, 99)
    assert points.stopped
    assert angle[-1] == angle[-2] == pytest.approx(points.angle_rad[-1], abs=1e-14)
    np.testing.assert_allclose(jacobian[-1], angles[-1], rtol=1e-9, atol=1e-12)
    np.testing.assert_array_equal(jacobian[-1], jacobian[-2])
    for column, name in enumerate(JACOBIAN_COLUMNS[:4]):
        value = getattr(model, name)
        up, down = (
            turning_points(replace(model, **{name: value * (1 + s)}), release).angle_rad[-1]
            for s in (1e-5, -1e-5)
        )
        assert jacobian[-1, column] == pytest.approx((up - down) / (2e-5 * value), rel=1e-6)


def test_the_sign_of_the_friction_makes_no_jump_to_miss() -> None:
    # Through 200 turning points the change with omega is that of differences; automatic
    # differentiation through sgn(v) gets it wrong several times over.
    time = np.linspace(0.0, 200.0, 4001)
    release = Release(0.0, Y)
    model = Eq8(W, 0.45, 0.00596, 0.00596, 1.4e-6)
    _, jacobian = sample_with_jacobian(model, release, time)
    step = 1e-5
    up, down, up2, down2 = (
        sample(replace(model, angular_frequency=W + s), release, time)
        for s in (step, -step, 2 * step, -2 * step)
    )
    difference = (8 * (up - down) - (up2 - down2)) / (12 * step)
    error = np.abs(difference - jacobian[:, 4]) / np.abs(difference).max()
    # Where a turning point lies between the differences, these are off by its kink.
    assert np.quantile(error, 0.9) < 1e-8
    assert error.max() < 1e-6


# Eq. 8 with the torque omega^2 sin x, against heyoka, elliptic functions and its energy law.

SWINGS_FAR = Eq8(W, quadratic=0.02, hysteretic=0.004, viscous=0.006, coulomb=1e-4, restoring="sine")
STENCIL = {2: -1.0, 1: 8.0, -1: -8.0, -2: 1.0}
"""Weights of a derivative to fourth order, over 12 steps."""


def moves_by_sine(model: Eq8, y: float) -> bool:
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
def far_pendulums(draw: st.DrawFn) -> tuple[Eq8, float]:
    """Draw a pendulum with Q from 10 to 1e5, and the amplitude of the release up to 2.9 rad."""
    omega = 10.0 ** draw(st.floats(-1.0, 2.0))
    y = draw(st.floats(0.01, 2.9))
    rate = omega / 20.0 * 10.0 ** -draw(st.floats(0.0, 4.0))
    shares = np.array([draw(st.sampled_from([0.0, 0.1, 1.0])) for _ in range(4)]) + 1e-6
    rates = rate * shares / shares.sum()
    return Eq8(omega, rates[0] / y, rates[1], rates[2], rates[3] * y, restoring="sine"), y


@given(far_pendulums())
@example((replace(SWINGS_FAR, coulomb=0.0), 2.9))
@example((SWINGS_FAR, 0.3))
@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.too_slow])
def test_turning_points_far_out_are_those_of_the_integrator(drawn: tuple[Eq8, float]) -> None:
    """How long it takes from near the top hangs on the last digit of the amplitude."""
    model, y = drawn
    points = turning_points(model, Release(0.0, y), count=60)
    assert_turns(model, y, *after(model, points), within=1e-9, floor=1e-10 * y)


@pytest.mark.parametrize("y", [0.3, 1.0, 2.0, 2.9])
def test_samples_are_the_integrators_to_a_billionth_of_the_amplitude(y: float) -> None:
    time = np.linspace(0.0, 200.0, 997)
    angle = sample(SWINGS_FAR, Release(0.0, y), time)
    expected = integrated(SWINGS_FAR, y).run(time).angle_rad
    np.testing.assert_allclose(angle, expected, rtol=0, atol=1e-9 * y)


def test_to_the_stop_from_any_amplitude() -> None:
    model = replace(SWINGS_FAR, coulomb=0.03)
    for y in (0.2, 1.5, 2.8):
        points = turning_points(model, Release(0.0, y))
        assert points.stopped
        assert abs(points.angle_rad[-1]) < model.stop_rad
        assert_turns(model, y, *after(model, points), within=1e-9, floor=1e-11)


def test_friction_holds_it_where_it_exceeds_the_torque_also_near_the_top() -> None:
    model = replace(SWINGS_FAR, coulomb=0.03)
    for y in np.linspace(0.001, 3.14, 400):
        turned = turning_points(model, Release(0.0, float(y)), count=2).time_s.size
        assert turned == (2 if moves_by_sine(model, float(y)) else 1)
    assert moves_by_sine(model, 1.0)
    assert not moves_by_sine(model, model.stop_rad * (1.0 - 1e-9))
    assert moves_by_sine(model, model.stop_rad * (1.0 + 1e-9))
    assert Eq8(W, coulomb=0.7 * W, restoring="sine").stop_rad == math.inf


def test_small_amplitudes_are_the_linear_pendulum() -> None:
    time = np.linspace(0.0, 60.0, 501)
    linear = sample(replace(SWINGS_FAR, restoring="linear", coulomb=1e-9), Release(0.0, 1e-5), time)
    sine = sample(replace(SWINGS_FAR, coulomb=1e-9), Release(0.0, 1e-5), time)
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


EACH = [
    (MODEL, Y, 1e-3),
    (Eq8(W, 1.0, 0.1, 0.3, 2e-3), Y, 1e-3),  # Q of 4, near the stop
    (Eq8(W, 1e-3, 1e-5, 1e-5, 1e-6), Y, 0.1),  # Q of sixteen thousand
    *((replace(SWINGS_FAR, coulomb=1e-3), y, 1e-3) for y in (0.31, 1.0, 2.9)),
]
"""Pendulum, amplitude, and the share of a loss by which it is changed."""


@pytest.mark.parametrize(("model", "y", "share"), EACH)
@pytest.mark.parametrize("last_s", [120.0, 6.0])
def test_samples_change_as_the_integrators_differences_do(
    model: Eq8, y: float, share: float, last_s: float
) -> None:
    """Of a long record the map is tabulated, of a short one it is not."""
    release, time = Release(0.5, -y, 0.02), np.linspace(1.0, last_s, 2001)
    angle, jacobian = sample_with_jacobian(model, release, time)
    anew = samples_in_stretches(model, release, time)[1]
    scale = np.abs(anew).max(axis=0)
    np.testing.assert_allclose(jacobian / scale, anew / scale, rtol=0, atol=1e-8)
    np.testing.assert_allclose(angle, sample(model, release, time), rtol=0, atol=1e-10)
    since = np.append(0.0, time - release.time_s)
    for column, name in enumerate(JACOBIAN_COLUMNS[:7]):
        if name in JACOBIAN_COLUMNS[:5]:
            value = getattr(model, name)
            step = value * (1e-5 if name == "angular_frequency" else share)
            moved = [
                integrated(replace(model, **{name: value + s * step}), -y).run(since)
                for s in STENCIL
            ]
        elif name == "angle":
            step = 1e-4 * y
            moved = [integrated(model, s * step - y).run(since) for s in STENCIL]
        else:
            step = 1e-4
            moved = [
                integrated(model, -y).run(np.append(0.0, since[1:] - s * step)) for s in STENCIL
            ]
        slope = sum(
            weight * track.angle_rad[1:]
            for weight, track in zip(STENCIL.values(), moved, strict=True)
        ) / (12.0 * step)
        error = np.abs(slope - jacobian[:, column]) / scale[column]
        # Where a turning point lies between the differences, these are off by its kink.
        assert np.quantile(error, 0.9) < 1e-8
        assert error.max() < 1e-3


def test_a_release_beyond_the_top_and_an_unknown_torque_are_refused() -> None:
    with pytest.raises(ValueError, match="within pi"):
        sample(SWINGS_FAR, Release(0.0, 3.15), np.arange(3.0))
    with pytest.raises(ValueError, match="restoring"):
        Eq8(W, restoring="cubic")  # type: ignore[arg-type]
