"""Small bounded problems: steps and intervals against the plain way of finding them."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from scipy.optimize import lsq_linear, minimize

from pendpipe.analysis.fit.least_squares import (
    CHI2_95,
    Bounds,
    bounded_least_squares,
    bounded_step,
    covariance,
    intervals95,
)

HALF_95 = 1.959963984540054
ENTRY = st.floats(-2.0, 2.0)


@given(
    root=hnp.arrays(np.float64, (4, 4), elements=ENTRY),
    gradient=hnp.arrays(np.float64, 4, elements=st.floats(-5.0, 5.0)),
)
def test_a_bounded_step_is_the_lowest_allowed_point(root, gradient) -> None:  # type: ignore[no-untyped-def]
    normal = root @ root.T + 0.1 * np.eye(4)
    bounds = Bounds(np.array([-0.3, -0.1, 0.0, -np.inf]), np.array([np.inf, 0.2, np.inf, np.inf]))
    step = bounded_step(normal, gradient, bounds)
    found = minimize(
        lambda d: 0.5 * d @ normal @ d - gradient @ d,
        np.array([0.0, 0.0, 0.0, 0.0]),
        jac=lambda d: normal @ d - gradient,
        bounds=list(zip(*bounds, strict=True)),
        method="L-BFGS-B",
        options={"ftol": 1e-15, "gtol": 1e-9},
    )
    assert np.all((bounds.lower <= step) & (step <= bounds.upper))
    assert 0.5 * step @ normal @ step - gradient @ step <= found.fun + 1e-7


@given(st.integers(1, 9), st.integers(0, 2**32 - 1))
def test_least_squares_within_bounds(count: int, seed: int) -> None:
    generator = np.random.default_rng(seed)
    matrix = generator.normal(size=(count + 2, count))
    right = 10.0 * generator.normal(size=count + 2)
    floor = np.where(generator.random(count) < 0.4, -np.inf, -generator.integers(0, 2, count))
    ceiling = np.where(generator.random(count) < 0.4, np.inf, 3.0 * generator.random(count) + 0.1)
    found = bounded_least_squares(matrix, right, floor, ceiling)
    best = lsq_linear(matrix, right, (floor - 1e-9, ceiling + 1e-9), method="bvls").x
    assert np.all((found >= floor) & (found <= ceiling))
    cost, least = (float(np.sum((matrix @ x - right) ** 2)) for x in (found, best))
    assert cost == pytest.approx(least, rel=1e-5, abs=1e-6)


def test_far_from_bounds_the_interval_is_symmetric() -> None:
    normal = np.array([[4.0, 1.0], [1.0, 2.0]])
    value = np.array([100.0, 80.0])
    bounds = Bounds(np.zeros(2), np.full(2, np.inf))
    sd = math.sqrt(np.linalg.inv(normal)[0, 0])
    low, high = intervals95(value, normal, np.zeros(2), bounds, [0])[0]
    assert (low, high) == pytest.approx((100.0 - HALF_95 * sd, 100.0 + HALF_95 * sd))


def test_one_parameter_near_its_bound_keeps_the_upper_end() -> None:
    """At 0.5 sd the lower end is the bound, the upper that of the free estimate."""
    bounds = Bounds(np.zeros(1), np.full(1, np.inf))
    ends = intervals95(np.array([0.5]), np.eye(1), np.zeros(1), bounds, [0])
    assert ends[0] == pytest.approx((0.0, 0.5 + HALF_95))


def test_at_the_bound_the_slope_shortens_the_interval() -> None:
    """Minimum at -1 outside: chi^2 = (x + 1)^2 - 1 rises by 3.84 at sqrt(4.84) - 1."""
    bounds = Bounds(np.zeros(1), np.full(1, np.inf))
    ends = intervals95(np.zeros(1), np.eye(1), np.array([-1.0]), bounds, [0])
    assert ends[0] == pytest.approx((0.0, math.sqrt(1.0 + HALF_95**2) - 1.0), abs=1e-3)


def test_intervals_cover_the_truth_on_the_bound() -> None:
    """In truth c = 0, correlated with b: at least 95 % of the intervals hold both."""
    rng = np.random.default_rng(5)
    normal = np.array([[1.0, 0.8], [0.8, 1.0]])
    root = np.linalg.cholesky(normal)
    bounds = Bounds(np.array([0.0, 0.0]), np.full(2, np.inf))
    truth = np.array([1.0, 0.0])
    held = np.zeros(2)
    for _ in range(1000):
        score = root @ rng.standard_normal(2)
        start = bounded_step(normal, score, bounds.about(truth))
        value, gradient = truth + start, score - normal @ start
        for j, (low, high) in enumerate(intervals95(value, normal, gradient, bounds, [0, 1])):
            held[j] += low <= truth[j] <= high
    assert np.all(held > 1000 * 0.95 - 3.0 * math.sqrt(1000 * 0.95 * 0.05))


def test_what_readings_do_not_tell_apart_stays_within_its_bounds() -> None:
    """Rounding makes such a matrix indefinite by a little: it is no error of the user."""
    column = np.array([1.0, 2.0, 3.0])
    normal = np.outer(column, column) - 1e-9 * np.diag([1.0, -1.0, 1.0])
    bounds = Bounds(np.array([-0.1, -np.inf, -0.1]), np.array([0.1, np.inf, 0.1]))
    step = bounded_step(normal, 5.0 * column, bounds)
    assert np.all((step >= bounds.lower) & (step <= bounds.upper))
    assert column @ step == pytest.approx(5.0, rel=1e-4)


@given(
    root=hnp.arrays(np.float64, (3, 3), elements=ENTRY),
    score=hnp.arrays(np.float64, 3, elements=st.floats(-5.0, 5.0)),
    room=hnp.arrays(np.float64, 3, elements=st.floats(0.0, 2.0)),
)
def test_at_its_ends_chi2_has_risen_by_3_84_however_the_others_follow(root, score, room) -> None:  # type: ignore[no-untyped-def]
    normal = root @ root.T + 0.1 * np.eye(3)
    bounds = Bounds(np.zeros(3), np.array([np.inf, np.inf, 2.5]))
    start = bounded_step(normal, score, bounds.about(room))
    value, gradient = room + start, score - normal @ start
    for j, ends in enumerate(intervals95(value, normal, gradient, bounds, range(3))):
        for end in ends:
            moved = np.zeros(3)
            moved[j] = end - value[j]
            left = bounded_step(normal, gradient - normal @ moved, bounds.about(value), (j,))
            step = moved + left
            risen = float(step @ normal @ step - 2.0 * gradient @ step)
            at_wall = min(abs(end - bounds.lower[j]), abs(end - bounds.upper[j])) < 1e-9
            assert risen <= HALF_95**2 + 1e-4 if at_wall else abs(risen - HALF_95**2) < 1e-4


def test_what_is_held_has_no_variance() -> None:
    normal = np.array([[4.0, 1.0], [1.0, 2.0]])
    assert np.array_equal(covariance(normal, [1]), np.array([[0.25, 0.0], [0.0, 0.0]]))


def test_an_interval_is_right_where_the_others_are_not_quite_at_their_best() -> None:
    """What follows is pulled from the beginning on."""
    normal, gradient = np.array([[1.0, 0.5], [0.5, 1.0]]), np.array([-1.0, 0.4])
    value, bounds = np.array([0.0, 5.0]), Bounds(np.zeros(2), np.full(2, np.inf))
    ((_, high),) = intervals95(value, normal, gradient, bounds, [0])
    moved = np.array([high, 0.0])
    step = moved + bounded_step(normal, gradient - normal @ moved, bounds.about(value), (0,))
    assert step @ normal @ step - 2.0 * gradient @ step == pytest.approx(CHI2_95)
