"""The one solver: certified minima, bounds, priors, covariance and profile intervals."""

import math
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, strategies as st
from hypothesis.extra import numpy as hnp
from scipy.optimize import lsq_linear, minimize
from scipy.stats import chi2 as chi_square

from pendpipe.arrays import FloatArray
from pendpipe.priors import Priors
from pendpipe.solve import (
    CHI2_95,
    Bounds,
    NoStartError,
    Problem,
    Quadratic,
    Search,
    Summed,
    bounded_least_squares,
    bounded_step,
    covariance,
    damping_for,
    intervals95,
    minimise,
    of_normal,
    squares,
)

Law = Callable[[FloatArray, FloatArray], FloatArray]
HALF_95 = 1.959963984540054
ENTRY = st.floats(-2.0, 2.0)


def problem_of(law: Law, x: FloatArray, y: FloatArray, sd: float, **options: object) -> Problem:  # type: ignore[type-arg]
    """A law of p and x, with derivatives by central differences."""

    def derivatives(p: FloatArray) -> FloatArray:
        steps = np.diag(1e-6 * np.maximum(np.abs(p), 1e-3))
        ends = [(law(p + step, x) - law(p - step, x)) / (2.0 * step.sum()) for step in steps]
        return np.stack(ends, axis=1) / sd

    options = {"bounds": Bounds.none(options.pop("size", 2))} | options  # type: ignore[arg-type]
    return squares(lambda p: (y - law(p, x)) / sd, derivatives, **options)  # type: ignore[arg-type]


# Certified minima: NIST, Statistical Reference Datasets, nonlinear regression.


def rising(p: FloatArray, x: FloatArray) -> FloatArray:
    return p[0] * -np.expm1(-p[1] * x)


def power(p: FloatArray, x: FloatArray) -> FloatArray:
    return p[0] * x ** p[1]


def quotient(p: FloatArray, x: FloatArray) -> FloatArray:
    return p[0] * (x**2 + x * p[1]) / (x**2 + x * p[2] + p[3])


MISRA1A = (
    "77.6 114.9 141.1 190.8 239.9 289.0 332.8 378.4 434.8 477.3 536.8 593.1 689.1 760.0",
    "10.07 14.73 17.94 23.93 29.61 35.18 40.02 44.82 50.76 55.05 61.01 66.40 75.47 81.78",
)
BOX_BOD = "1 2 3 5 7 10", "109 149 149 191 213 224"
DAN_WOOD = "1.309 1.471 1.490 1.565 1.611 1.680", "2.138 3.421 3.597 4.340 4.882 5.660"
MGH09 = (
    "4 2 1 .5 .25 .167 .125 .1 .0833 .0714 .0625",
    ".1957 .1947 .1735 .16 .0844 .0627 .0456 .0342 .0323 .0235 .0246",
)
CERTIFIED = [
    (
        rising,
        MISRA1A,
        [500.0, 1e-4],
        [238.94212918, 5.5015643181e-4],
        [2.7070075241, 7.26686884e-6],
    ),
    (
        rising,
        MISRA1A,
        [250.0, 5e-4],
        [238.94212918, 5.5015643181e-4],
        [2.7070075241, 7.26686884e-6],
    ),
    (rising, BOX_BOD, [100.0, 0.75], [213.80940889, 0.54723748542], [12.354515176, 0.10455993237]),
    (power, DAN_WOOD, [1.0, 5.0], [0.76886226176, 3.8604055871], [0.01828197386, 0.051726610913]),
    (power, DAN_WOOD, [0.7, 4.0], [0.76886226176, 3.8604055871], [0.01828197386, 0.051726610913]),
    (
        quotient,
        MGH09,
        [0.25, 0.39, 0.415, 0.39],
        [0.19280693458, 0.19128232873, 0.12305650693, 0.13606233068],
        [0.011435312227, 0.19633220911, 0.080842031232, 0.090025542308],
    ),
]


@pytest.mark.parametrize(("law", "data", "start", "value", "sd"), CERTIFIED)
def test_minimum_and_errors_are_the_certified_ones(
    law: Law, data: tuple[str, str], start: list[float], value: list[float], sd: list[float]
) -> None:
    x, y = (np.array(each.split(), dtype=float) for each in data)
    left = y - law(np.array(value), x)
    noise = math.sqrt(float(left @ left) / (len(x) - len(value)))
    found = minimise(
        problem_of(law, x, y, noise, size=len(value)), np.array(start), tolerance=1e-12
    )
    assert found.converged
    assert found.value == pytest.approx(value, rel=1e-5)
    errors = np.sqrt(covariance(found.point.quadratic.normal).diagonal())
    assert errors == pytest.approx(sd, rel=1e-4)


# A line through points: what is linear has a closed form.

LINE_X, LINE_Y = np.arange(6.0), np.array([1.1, 2.9, 5.2, 6.8, 9.1, 10.9])


def line(p: FloatArray, x: FloatArray) -> FloatArray:
    return p[0] + p[1] * x


def test_a_linear_problem_has_its_closed_form() -> None:
    found = minimise(problem_of(line, LINE_X, LINE_Y, 0.1), np.zeros(2))
    design = np.stack([np.ones(6), LINE_X], axis=1)
    assert found.value == pytest.approx(np.linalg.lstsq(design, LINE_Y, rcond=None)[0])
    expected = 0.01 * np.linalg.inv(design.T @ design)
    assert covariance(found.point.quadratic.normal) == pytest.approx(expected)


def test_a_prior_is_one_more_datum() -> None:
    """A slope of 1.5 +- 0.2 known beforehand, or read once."""
    prior = Priors(np.array([1]), np.array([1.5]), np.array([0.2]))
    known = minimise(problem_of(line, LINE_X, LINE_Y, 1.0, priors=prior), np.zeros(2))
    design = np.vstack([np.stack([np.ones(6), LINE_X], axis=1), [0.0, 1.0 / 0.2]])
    read = np.append(LINE_Y, 1.5 / 0.2)
    assert known.value == pytest.approx(np.linalg.lstsq(design, read, rcond=None)[0])
    assert known.chi2 == pytest.approx(float(np.sum((read - design @ known.value) ** 2)))


def test_at_an_active_bound_the_others_are_at_their_best() -> None:
    """No slope beyond 1.5: the height is the mean of what is left."""
    bounds = Bounds(np.array([-np.inf, 0.0]), np.array([np.inf, 1.5]))
    found = minimise(problem_of(line, LINE_X, LINE_Y, 0.1, bounds=bounds), np.array([0.0, 1.0]))
    assert found.value == pytest.approx([np.mean(LINE_Y - 1.5 * LINE_X), 1.5])
    assert found.converged


def test_what_is_held_stays() -> None:
    found = minimise(problem_of(line, LINE_X, LINE_Y, 0.1), np.array([0.0, 2.1]), held=[1])
    assert found.value == pytest.approx([np.mean(LINE_Y - 2.1 * LINE_X), 2.1])


def test_the_likelihood_of_counts_has_its_minimum_at_their_mean() -> None:
    """Minus twice that of Poisson's law, with the information in the place of the curvature."""
    counts = np.array([3.0, 7.0, 4.0, 6.0])

    def at(p: FloatArray) -> Summed:
        return Summed(p, 2.0 * float(np.sum(np.exp(p) - counts * p)), derivatives)

    def derivatives(p: FloatArray) -> Quadratic:
        pull = np.sum(counts - np.exp(p), keepdims=True)
        return Quadratic(math.nan, pull, len(counts) * np.exp(p)[:, None])

    found = minimise(Problem(at, Bounds.none(1)), np.array([0.0]), tolerance=1e-10)
    assert math.exp(found.value[0]) == pytest.approx(5.0, rel=1e-4)


def test_a_model_without_a_value_at_the_start_has_no_search() -> None:
    problem = problem_of(power, np.array([-1.0, 1.0]), np.ones(2), 1.0)
    with np.errstate(invalid="ignore"), pytest.raises(NoStartError):
        minimise(problem, np.array([1.0, 0.5]))


def test_a_search_that_is_interrupted_ends_where_one_that_is_not_does() -> None:
    x, y = (np.array(each.split(), dtype=float) for each in MISRA1A)
    problem, start = problem_of(rising, x, y, 0.1), np.array([500.0, 1e-4])
    search: Search[Summed] = Search(problem, start)
    for _ in range(20):
        search.go(1)
    assert search.converged
    assert np.array_equal(search.here.value, minimise(problem, start).value)


@pytest.mark.parametrize("places", [[1], []])
def test_a_place_stays_if_a_step_overshoots_and_the_others_gain_as_much(
    places: list[int],
) -> None:
    """A step of a cube root ends as far beyond zero twice over."""

    def law(p: FloatArray, x: FloatArray) -> FloatArray:
        return np.array([p[0], np.cbrt(p[1])])

    problem = problem_of(law, np.zeros(2), np.array([0.67, 0.0]), 1.0)
    search: Search[Summed] = Search(
        Problem(problem.at, problem.bounds, places=places), np.array([0.0, 1.0])
    )
    search.go(1)
    assert search.here.chi2 < 1.0 + 0.67**2
    assert (search.here.value[1] == 1.0) == bool(places)


@pytest.mark.parametrize("radius", [1.0, 0.1])
def test_a_damped_step_has_the_length_of_the_radius(radius: float) -> None:
    pull, squared = np.array([3.0, 1.0]), np.array([1.0, 0.1])
    step = pull / (squared + damping_for(pull, squared, radius))
    assert np.linalg.norm(step) == pytest.approx(radius, rel=0.011)


def test_a_step_without_a_limit_is_not_damped_however_long_it_is() -> None:
    """Where its length overflows, too: an imitation that leaves 1e152 of itself."""
    pull, squared = np.array([-1e152, 1e142]), np.array([5.9, 1e-9])
    with np.errstate(over="ignore"):
        assert damping_for(pull, squared, np.inf) == 0.0
    assert damping_for(np.array([3.0]), np.array([1.0]), 1.0) == pytest.approx(2.0, rel=2e-2)


def test_a_likelihood_that_is_known_has_its_profile_interval() -> None:
    """A mean of 9 readings of sd 3, of which nothing is below zero: a half of a normal law."""
    for mean, ends in ((4.0, (4.0 - HALF_95, 4.0 + HALF_95)), (0.5, (0.0, 0.5 + HALF_95))):
        normal = np.array([[9.0 / 9.0]])
        bounds = Bounds(np.zeros(1), np.full(1, np.inf))
        assert intervals95(np.array([mean]), normal, np.zeros(1), bounds, [0]) == [
            pytest.approx(ends)
        ]
    assert pytest.approx(chi_square.ppf(0.95, 1)) == CHI2_95


# Small bounded problems: steps and intervals against the plain way of finding them.


@pytest.mark.slow
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


@given(st.integers(2, 9), st.integers(0, 2**32 - 1), st.floats(1e-3, 1.0))
def test_a_step_within_bounds_is_no_longer_than_the_radius(
    count: int, seed: int, shorter: float
) -> None:
    """What a bound stops no longer makes up for the others, which may be long by themselves."""
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(count, count)) * 10.0 ** rng.uniform(-4.0, 0.0, count)
    normal, gradient = root.T @ root, root.T @ rng.normal(size=count)
    problem, room = of_normal(normal, gradient), rng.exponential(size=count)
    room[0] *= 1e-3
    bounds = Bounds(-room, room)
    whole, length = problem.step(bounds)
    step, limited = problem.step(bounds, shorter * length)
    # What meets its bound ends there, to the last digit.
    assert np.all((np.abs(step) == room) | (np.abs(step) < (1.0 - 1e-12) * room))
    assert limited <= (1.0 + 0.02 + 1e-9) * shorter * length
    assert 0.0 <= problem.falls(step) <= (1.0 + 1e-6) * problem.falls(whole) + 1e-9


def test_far_from_bounds_the_interval_is_symmetric() -> None:
    normal = np.array([[4.0, 1.0], [1.0, 2.0]])
    value = np.array([100.0, 80.0])
    bounds = Bounds(np.zeros(2), np.full(2, np.inf))
    sd = math.sqrt(np.linalg.inv(normal)[0, 0])
    low, high = intervals95(value, normal, np.zeros(2), bounds, [0])[0]
    assert (low, high) == pytest.approx((100.0 - HALF_95 * sd, 100.0 + HALF_95 * sd))


@pytest.mark.slow
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
    ends = intervals95(np.zeros(3), normal, np.zeros(3), bounds, range(3))
    assert ends == [
        (-0.1, 0.1),
        pytest.approx((-0.2 - HALF_95 / 2, 0.2 + HALF_95 / 2)),
        (-0.1, 0.1),
    ]


@pytest.mark.slow
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
