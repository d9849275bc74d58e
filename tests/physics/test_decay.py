"""Eq. 14 in every regime, against the paper's printed formula at 200 digits."""

import mpmath as mp
import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from pendpipe.physics import amplitude, amplitude_rate, stopping_time, time_at

DIGITS = 200


def printed_eq14(t: float, y0: float, a: float, b: float, c: float) -> mp.mpf:
    """Eq. 14 as the paper prints it, r complex where need be, limits by a nudge of 1e-90."""
    with mp.workdps(DIGITS):
        nudge = mp.mpf(10) ** -90
        qa, qb, qc = (mp.mpf(rate) * (1 + k * nudge) + nudge for k, rate in enumerate((a, b, c)))
        time, start = mp.mpf(t), mp.mpf(y0)
        r = mp.sqrt(mp.mpc(qb**2 - 4 * qa * qc))
        p = (2 * qa * start + qb - r) / (2 * qa * start + qb + r) * mp.exp(-r * time)
        return mp.re((qb * (p - 1) + r * (p + 1)) / (2 * qa * (1 - p)))


def decades(low: int, high: int) -> st.SearchStrategy[float]:
    return st.floats(low, high).map(lambda power: 10.0**power)


rates = st.tuples(*[st.one_of(st.just(0.0), decades(-12, 3))] * 3)
starts = decades(-6, 0)
fractions = st.one_of(st.floats(0.0, 1.0), decades(-9, 0).map(lambda rest: 1.0 - rest))


def moment_in_decay(y0: float, abc: tuple[float, float, float], fraction: float) -> float:
    """A time before the stop; without one, up to where the amplitude is 1e-20 of y0."""
    end = float(stopping_time(y0, *abc))
    return fraction * (end if np.isfinite(end) else float(time_at(1e-20 * y0, y0, *abc)))


def assert_agrees(t: float, y0: float, abc: tuple[float, float, float]) -> None:
    """1e-12 of y, and no less than four last digits of t, which is what t itself is worth."""
    truth = printed_eq14(t, y0, *abc)
    last_digit = np.spacing(t) * float(abs(amplitude_rate(max(float(truth), 1e-300), *abc)))
    assert abs(float(amplitude(t, y0, *abc) - truth)) <= 1e-12 * float(truth) + 4.0 * last_digit


@given(y0=starts, abc=rates, fraction=fractions)
@settings(max_examples=200)
def test_amplitude_is_the_printed_equation_over_many_decades(
    y0: float, abc: tuple[float, float, float], fraction: float
) -> None:
    t = moment_in_decay(y0, abc, fraction)
    assume(np.isfinite(t) and t < 1e30)
    assert_agrees(t, y0, abc)


@given(y0=starts, a=decades(-6, 2), b=decades(-6, 1), nearness=decades(-16, -1), fraction=fractions)
@settings(max_examples=100)
@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_branches_join_where_r_vanishes(
    side: float, y0: float, a: float, b: float, nearness: float, fraction: float
) -> None:
    abc = (a, b, b * b / (4.0 * a) * (1.0 + side * nearness))
    assert_agrees(moment_in_decay(y0, abc, fraction), y0, abc)


@pytest.mark.parametrize(
    ("abc", "closed"),
    [
        ((0.0, 0.0, 0.0), lambda t, y: y + 0.0 * t),
        ((0.0, 0.0, 2e-3), lambda t, y: y - 2e-3 * t),
        ((0.0, 0.3, 0.0), lambda t, y: y * np.exp(-0.3 * t)),
        ((0.5, 0.0, 0.0), lambda t, y: y / (1.0 + 0.5 * y * t)),
        ((0.0, 0.3, 0.006), lambda t, y: (y + 0.02) * np.exp(-0.3 * t) - 0.02),
        ((0.5, 0.3, 0.0), lambda t, y: y / (np.exp(0.3 * t) + 0.5 * y * np.expm1(0.3 * t) / 0.3)),
        (
            (0.5, 0.0, 2e-3),
            lambda t, y: (
                0.0632455532033675866
                * np.tan(np.arctan(y / 0.0632455532033675866) - 0.0316227766016837933 * t)
            ),
        ),
        ((0.5, 0.2, 0.02), lambda t, y: 1.0 / (0.5 * t + 1.0 / (y + 0.2)) - 0.2),
    ],
    ids=["none", "c", "b", "a", "b c", "a b", "a c", "r = 0"],
)
def test_each_loss_alone_has_its_textbook_decay(abc: tuple[float, float, float], closed) -> None:  # type: ignore[no-untyped-def]
    t = np.linspace(0.0, 2.0, 7)
    np.testing.assert_allclose(amplitude(t, 0.1, *abc), closed(t, 0.1), rtol=2e-14)


@pytest.mark.parametrize(
    "abc", [(0.45, 0.0119, 1.4e-6), (0.45, 0.0, 1.4e-3), (0.0, 0.01, 1e-4), (3.0, 1e-3, 0.02)]
)
def test_time_is_the_integral_of_the_inverse_rate(abc: tuple[float, float, float]) -> None:
    y0, y = 0.068, 0.0031
    a, b, c = abc
    integral = mp.quad(lambda u: 1 / (a * u**2 + b * u + c), [y, 0.01, 0.03, y0])
    t = time_at(y, y0, *abc)
    assert float(t) == pytest.approx(float(integral), rel=1e-13)
    assert float(amplitude(t, y0, *abc)) == pytest.approx(y, rel=1e-12)


@given(y0=starts, abc=rates, part=st.floats(1e-6, 1.0))
def test_time_at_inverts_the_amplitude(
    y0: float, abc: tuple[float, float, float], part: float
) -> None:
    assume(any(abc))
    t = time_at(part * y0, y0, *abc)
    # A last digit of y is worth more time the slower y falls; time_at of neighbours tells.
    back = time_at(amplitude(t, y0, *abc), y0, *abc)
    slack = 4.0 * np.spacing(part * y0) / abs(amplitude_rate(part * y0, *abc))
    assert float(back) == pytest.approx(float(t), rel=1e-12, abs=float(slack))


@given(y0=starts, abc=rates)
def test_amplitude_and_so_the_energy_never_rises(
    y0: float, abc: tuple[float, float, float]
) -> None:
    end = moment_in_decay(y0, abc, 1.0)
    assume(np.isfinite(end) and end < 1e30)
    y = amplitude(np.linspace(0.0, 1.3 * end, 201), y0, *abc)
    # Two values that differ by less than their last digits may come out in either order.
    assert np.all(np.diff(y) <= 4e-16 * y[:-1])
    assert y[0] == y0
    assert np.all(y >= 0.0)


@pytest.mark.parametrize("abc", [(0.45, 0.0119, 1.4e-6), (0.45, 1e-4, 1.4e-3), (0.0, 0.0, 1e-3)])
def test_coulomb_friction_stops_the_pendulum_in_finite_time(
    abc: tuple[float, float, float],
) -> None:
    stop = float(stopping_time(0.068, *abc))
    assert amplitude(stop * (1.0 - 1e-9), 0.068, *abc) == pytest.approx(
        abc[2] * stop * 1e-9, rel=1e-5
    )
    after = amplitude(stop * np.array([1.0 + 1e-12, 1.5, 1e3, 1e9]), 0.068, *abc)
    np.testing.assert_array_equal(after, 0.0)


def test_nothing_stops_without_coulomb_friction() -> None:
    assert np.isinf(stopping_time(0.1, [0.0, 1.0, 0.0, 1.0], [0.0, 0.0, 1.0, 1.0], 0.0)).all()
    assert amplitude(1e6, 0.1, 0.4, 0.01, 0.0) == 0.0  # below the smallest double
    assert amplitude(5e4, 0.1, 0.4, 0.01, 0.0) > 0.0


def test_a_pendulum_at_rest_stays_there() -> None:
    np.testing.assert_array_equal(amplitude([0.0, 1.0], 0.0, 0.4, 0.01, [[0.0], [1e-5]]), 0.0)


def test_going_back_in_time_undoes_the_decay_until_it_has_no_past() -> None:
    abc = (0.45, 0.0119, 1.4e-6)
    later = amplitude(50.0, 0.068, *abc)
    assert float(amplitude(-50.0, later, *abc)) == pytest.approx(0.068, rel=1e-12)
    birth = -float(time_at(0.068, 1e12, *abc))
    assert amplitude(1.001 * birth, 0.068, *abc) == np.inf


def test_arguments_broadcast() -> None:
    y = amplitude(np.arange(3.0)[:, None], [0.1, 0.2], [0.0, 1.0], 0.0, [0.1, 0.03])
    assert y.shape == (3, 2)
    assert y[2, 1] == amplitude(2.0, 0.2, 1.0, 0.0, 0.03)
