"""The derivatives by every parameter, exact through all turning points and the stop."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from mpmath import mp, mpf

from pendpipe.dynamics import (
    JACOBIAN_COLUMNS,
    Eq8,
    Release,
    sample,
    sample_with_jacobian,
    turning_points,
    turning_points_with_jacobian,
)

from .reference import DIGITS, MpmathPendulum, samples_in_stretches

W = 2.0 * math.pi * 0.516
MODEL = Eq8(W, quadratic=0.45, hysteretic=0.02, viscous=0.03, coulomb=2e-4)
Y = 0.068
RATES = ("quadratic", "hysteretic", "viscous", "coulomb", "omega")
STEP = mpf(10) ** -12


def changed(pendulum: MpmathPendulum, y: Any, name: str, step: Any) -> tuple[MpmathPendulum, Any]:
    """Return the pendulum and its release with one of them changed."""
    if name == "angle":
        return pendulum, y + step
    return replace(pendulum, **{name: getattr(pendulum, name) + step}), y


@pytest.mark.slow
@pytest.mark.parametrize(
    "model",
    [MODEL, Eq8(W, 1.0, 0.1, 0.3, 2e-3), Eq8(W, 1e-4, 1e-6, 1e-6, 1e-8)],
    ids=["Q of 40", "Q of 4, near the stop", "Q of a hundred thousand"],
)
def test_turning_points_change_as_forty_digit_differences_say(model: Eq8) -> None:
    count = 8
    columns = [*RATES, "angle"]
    with mp.workdps(DIGITS):
        pendulum = MpmathPendulum.of(model)
        by_time, by_angle = [], []
        for name in columns:
            up, down = (
                moved.turning_points(y, count)
                for moved, y in (changed(pendulum, mpf(Y), name, s) for s in (STEP, -STEP))
            )
            by_time.append(
                [float((a - b) / (2 * STEP)) for a, b in zip(up[0], down[0], strict=True)]
            )
            by_angle.append(
                [float((a - b) / (2 * STEP)) for a, b in zip(up[1], down[1], strict=True)]
            )
    # Of a long motion the map is tabulated, of a short one it is not.
    for long in (count, 40):
        found = turning_points_with_jacobian(model, Release(0.0, Y), long)
        points, times, angles = found[0], found[1][:count], found[2][:count]
        assert points.time_s.size > count - 1
        assert times.shape == angles.shape == (count, len(JACOBIAN_COLUMNS))
        for exact, own in ((by_time, times[:, :6]), (by_angle, angles[:, :6])):
            expected = np.array(exact).T
            scale = np.abs(expected).max(axis=0)
            np.testing.assert_allclose(own / scale, expected / scale, rtol=0, atol=1e-10)
        np.testing.assert_array_equal(times[:, 6:], [[1.0, 0.0]] * count)
        np.testing.assert_array_equal(angles[:, 6:], [[0.0, 1.0]] * count)


@pytest.mark.slow
def test_samples_change_as_forty_digit_differences_say() -> None:
    times = np.array([0.7, 2.3, 4.1])
    step = mpf(10) ** -8
    with mp.workdps(22):
        pendulum = MpmathPendulum.of(MODEL)
        expected = []
        for name in [*RATES, "angle"]:
            (up, y_up), (down, y_down) = (changed(pendulum, mpf(Y), name, s) for s in (step, -step))
            expected.append(
                [
                    float((up.angle_at(y_up, mpf(t)) - down.angle_at(y_down, mpf(t))) / (2 * step))
                    for t in times
                ]
            )
    for more in ([], [200.0]):
        # Of a long record the map is tabulated.
        _, jacobian = sample_with_jacobian(MODEL, Release(0.0, Y), np.append(times, more))
        for column, exact in enumerate(expected):
            np.testing.assert_allclose(
                jacobian[: len(times), column], exact, rtol=0, atol=1e-9 * np.abs(exact).max()
            )


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
