"""Losses, their quality factors, and the decay of Eq. 14."""

import math
from collections.abc import Callable

import mpmath as mp
import numpy as np
import pytest
from hypothesis import assume, given, settings, strategies as st
from scipy.integrate import solve_ivp

from pendpipe.physics import (
    QualityFactors,
    amplitude,
    amplitude_and_gradient,
    amplitude_halfway,
    amplitude_of_largest_quality_factor,
    amplitude_rate,
    damping_coefficient,
    decay_rates,
    driven_pendulum_acceleration,
    energy_power_friction,
    energy_power_quality_factor,
    hysteretic_frequency_shift,
    hysteretic_quality_factor,
    largest_quality_factor,
    logarithmic_decrement,
    net_quality_factor,
    quality_factor,
    quality_factor_limit,
    quality_factors,
    rates_from_energy_constants,
    stopping_time,
    structural_quality_factor,
    time_at,
    time_by_powers,
    universal_acceleration,
    viscous_acceleration,
    viscous_frequency_shift,
    without_hysteresis,
)

# Eq. 14 in every regime, against the paper's printed formula at 200 digits.

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


# The derivatives of Eq. 14 against those of its implicit relation, at many digits.


def solution(t: mp.mpf, y0: mp.mpf, a: mp.mpf, b: mp.mpf, c: mp.mpf) -> mp.mpf:
    """Eq. 14 as the fraction of two solutions of the linear system, in mpmath."""
    r = mp.sqrt(mp.mpc(b * b - 4 * a * c))
    even = mp.cosh(r * t / 2)
    odd = 2 * mp.sinh(r * t / 2) / r if r != 0 else t
    return mp.re((y0 * even - (b * y0 / 2 + c) * odd) / (even + (a * y0 + b / 2) * odd))


def slow_gradient(t: float, arguments: tuple[float, ...]) -> list[float]:
    """Central differences with a step of 1e-50 at 160 digits."""
    gradient = []
    with mp.workdps(160):
        for index, value in enumerate(arguments):
            step = mp.mpf(10) ** -50 * (mp.mpf(value) or mp.mpf(10) ** -6)
            ends = []
            for sign in (1, -1):
                moved = [mp.mpf(argument) for argument in arguments]
                moved[index] += sign * step
                ends.append(solution(mp.mpf(t), *moved))
            gradient.append(float((ends[0] - ends[1]) / (2 * step)))
    return gradient


moderate = st.tuples(*[st.one_of(st.just(0.0), decades(-10, 2))] * 3)


@pytest.mark.slow
@given(y0=decades(-6, 0), abc=moderate, fraction=st.floats(1e-6, 0.999))
@settings(max_examples=200)
def test_gradient_over_many_decades(
    y0: float, abc: tuple[float, float, float], fraction: float
) -> None:
    end = float(stopping_time(y0, *abc))
    t = fraction * (end if np.isfinite(end) else float(time_at(1e-20 * y0, y0, *abc)))
    assume(np.isfinite(t) and 0.0 < t < 1e25)
    y, gradient = amplitude_and_gradient(t, y0, *abc)
    assert y == amplitude(t, y0, *abc)
    np.testing.assert_allclose(gradient, slow_gradient(t, (y0, *abc)), rtol=1e-11)


@pytest.mark.parametrize("nearness", [-1e-3, -1e-9, -1e-15, 0.0, 1e-15, 1e-9, 1e-3])
def test_gradient_is_smooth_through_r_equal_zero(nearness: float) -> None:
    a, b = 0.5, 0.02
    arguments = (0.05, a, b, b * b / (4 * a) * (1.0 + nearness))
    _, gradient = amplitude_and_gradient(40.0, *arguments)
    np.testing.assert_allclose(gradient, slow_gradient(40.0, arguments), rtol=1e-12)


def test_gradient_vanishes_after_the_stop() -> None:
    stop = float(stopping_time(0.068, 0.45, 0.0119, 1.4e-6))
    _, gradient = amplitude_and_gradient([0.9 * stop, 1.1 * stop], 0.068, 0.45, 0.0119, 1.4e-6)
    assert gradient.shape == (2, 4)
    assert gradient[0, 0] > 0.0
    assert np.all(gradient[0, 1:] < 0.0)
    np.testing.assert_array_equal(gradient[1], 0.0)


def test_gradient_broadcasts_like_the_amplitude() -> None:
    arguments = np.arange(1.0, 4.0)[:, None], [0.1, 0.2], [0.0, 1.0], 0.0, [0.01, 0.03]
    y, gradient = amplitude_and_gradient(*arguments)
    assert gradient.shape == (3, 2, 4)
    np.testing.assert_allclose(y, amplitude(*arguments), rtol=1e-15)
    alone, single = amplitude_and_gradient(3.0, 0.2, 1.0, 0.0, 0.03)
    assert y[2, 1] == pytest.approx(alone, rel=1e-15)
    np.testing.assert_allclose(gradient[2, 1], single, rtol=1e-15)


# Eq. 8's terms, their quality factors, and the two ways to name the losses.

OMEGA = 2.0 * np.pi * 0.516
positive = decades(-3, 4)


def energy_loss_of_a_cycle(losses: tuple[float, float, float, float], y: float) -> float:
    """Work of Eq. 8's friction over one harmonic cycle of amplitude y, per inertia."""
    phase = 2.0 * np.pi * (np.arange(20000) + 0.5) / 20000
    x, v = y * np.cos(phase), -y * OMEGA * np.sin(phase)
    friction = universal_acceleration(x, v, OMEGA, losses, 0.05) + OMEGA**2 * x
    return float(-np.mean(friction * v) * 2.0 * np.pi / OMEGA)


@pytest.mark.parametrize("kind", range(4))
@pytest.mark.parametrize("y", [0.05, 0.02])
def test_each_term_of_eq8_loses_what_its_quality_factor_says(kind: int, y: float) -> None:
    losses = [np.inf] * 4
    losses[kind] = 80.0
    terms = (losses[0], losses[1], losses[2], losses[3])
    net = float(net_quality_factor(terms, y, 0.05))
    energy = 0.5 * (OMEGA * y) ** 2
    assert 2.0 * np.pi * energy / energy_loss_of_a_cycle(terms, y) == pytest.approx(net, rel=1e-7)


def test_coulomb_and_fluid_quality_factors_go_with_and_against_the_amplitude() -> None:
    coulomb = net_quality_factor((80.0, np.inf, np.inf, np.inf), [0.05, 0.025], 0.05)
    fluid = net_quality_factor((np.inf, np.inf, 80.0, np.inf), [0.05, 0.025], 0.05)
    np.testing.assert_allclose(coulomb, [80.0, 40.0])
    np.testing.assert_allclose(fluid, [80.0, 160.0])


@given(qualities=st.tuples(*[positive] * 4), y0=positive, y=positive)
def test_eq9b_and_eq15_are_the_same_quality_factor(
    qualities: tuple[float, float, float, float], y0: float, y: float
) -> None:
    a, hysteretic, viscous, c = decay_rates(qualities, y0, OMEGA)
    by_rates = quality_factor(y, OMEGA / (2.0 * np.pi), a, hysteretic + viscous, c)
    assert float(by_rates) == pytest.approx(float(net_quality_factor(qualities, y, y0)), rel=1e-12)


@given(qualities=st.tuples(*[positive] * 4), y0=positive, omega=positive)
def test_quality_factors_to_rates_and_back(
    qualities: tuple[float, float, float, float], y0: float, omega: float
) -> None:
    a, hysteretic, viscous, c = decay_rates(qualities, y0, omega)
    b = hysteretic + viscous
    back = quality_factors(a, b, c, y0, omega, hysteretic / b)
    np.testing.assert_allclose(back[:3], qualities[:3], rtol=1e-12)
    # 1 - share has lost the digits in which the viscous part is below the hysteretic one.
    slack = 4e-16 * (1.0 + qualities[3] / qualities[1])
    assert float(back.viscous) == pytest.approx(qualities[3], rel=1e-12 + slack)


def test_an_absent_loss_has_an_infinite_quality_factor() -> None:
    assert quality_factors(0.0, 0.01, 0.0, 0.07, OMEGA, 0.0) == QualityFactors(
        *map(np.float64, (np.inf, np.inf, np.inf, OMEGA / 0.02))
    )
    assert decay_rates((np.inf,) * 4, 0.07, OMEGA) == (0.0, 0.0, 0.0, 0.0)


@pytest.mark.parametrize(("exponent", "slope"), [(0.0, 1.0), (0.5, 0.0), (1.0, -1.0), (0.75, -0.5)])
def test_eq9a_gives_coulomb_hysteretic_and_fluid_losses(exponent: float, slope: float) -> None:
    y = np.array([0.01, 0.02])
    quality = energy_power_quality_factor(y, 0.3, exponent, OMEGA)
    assert np.log2(quality[1] / quality[0]) == pytest.approx(slope, abs=1e-12)
    # The square wave's fundamental, 4/pi of it, is omega v/Q at the largest velocity.
    square_wave = energy_power_friction(y, 0.3, exponent)
    np.testing.assert_allclose(4.0 / np.pi * square_wave, OMEGA**2 * y / quality, rtol=1e-14)


def test_eq9a_is_eq8s_bracket() -> None:
    y0, q = 0.05, 80.0
    for kind, exponent, coefficient in (
        (0, 0.0, np.pi * OMEGA**2 * y0 / (4.0 * q)),
        (1, 0.5, np.pi * OMEGA**2 / (4.0 * q)),
        (2, 1.0, np.pi * OMEGA**2 / (4.0 * y0 * q)),
    ):
        losses = [np.inf] * 4
        losses[kind] = q
        y = 0.03
        # At the centre the energy is all kinetic: x = 0, v = omega y.
        force = -universal_acceleration(0.0, OMEGA * y, OMEGA, tuple(losses), y0)  # type: ignore[arg-type]
        assert float(force) == pytest.approx(
            float(energy_power_friction(y, coefficient, exponent)), rel=1e-13
        )


@pytest.mark.parametrize(
    "losses",
    [
        (2e4, np.inf, np.inf, np.inf),
        (np.inf, 900.0, np.inf, np.inf),
        (np.inf, np.inf, 700.0, np.inf),
        (np.inf, np.inf, np.inf, 800.0),
        (3e4, 1049.0, 2000.0, 3000.0),
    ],
    ids=["coulomb", "hysteretic", "fluid", "viscous", "all"],
)
def test_turning_points_of_eq8_follow_eq14(losses: tuple[float, float, float, float]) -> None:
    y0 = 0.05
    turning, time = y0, 0.0
    for half_cycle in range(40):
        going = -1.0 if half_cycle % 2 == 0 else 1.0

        def motion(_: float, state: np.ndarray, going: float = going) -> list[float]:
            # At rest the friction already acts against the coming motion.
            velocity = state[1] if going * state[1] > 0.0 else going * 1e-300
            return [state[1], float(universal_acceleration(state[0], velocity, OMEGA, losses, y0))]

        def rest(t: float, state: np.ndarray, going: float = going) -> float:
            return state[1] if t > 0.1 else going

        rest.terminal = True  # type: ignore[attr-defined]
        run = solve_ivp(
            motion,
            (0.0, 4.0 / OMEGA),
            [turning, 0.0],
            "DOP853",
            events=rest,
            rtol=1e-11,
            atol=1e-15,
        )
        turning, time = float(run.y_events[0][0][0]), time + float(run.t_events[0][0])
    a, hysteretic, viscous, c = decay_rates(losses, y0, OMEGA)
    law = amplitude(time, y0, a, hysteretic + viscous, c)
    # First order: what remains is second order in 1/Q, 1e-6 here.
    assert np.log(y0 / abs(turning)) == pytest.approx(np.log(y0 / float(law)), rel=2e-5)


def test_friction_opposes_the_velocity_and_eq8_is_odd() -> None:
    losses = (50.0, 60.0, 70.0, 80.0)
    x, v = np.meshgrid(np.linspace(-0.1, 0.1, 9), np.linspace(-0.3, 0.3, 9))
    acceleration = universal_acceleration(x, v, OMEGA, losses, 0.1)
    assert np.all((acceleration + OMEGA**2 * x) * v <= 0.0)
    np.testing.assert_allclose(
        universal_acceleration(-x, -v, OMEGA, losses, 0.1), -acceleration, rtol=1e-14
    )


def test_hysteretic_quality_factor_goes_with_the_square_of_the_frequency() -> None:
    q = structural_quality_factor(0.1, np.array([1.0, 2.0]), 1e-3)
    np.testing.assert_allclose(q, [100.0, 400.0])
    # The paper's k = 3940 s^2 at I = 0.1 kg m^2 is a loss torque of 1e-3 N m/rad.
    loss = 0.1 * (2.0 * np.pi) ** 2 / 3940.0
    assert float(structural_quality_factor(0.1, OMEGA, loss)) == pytest.approx(
        float(hysteretic_quality_factor(0.516, 3940.0)), rel=1e-13
    )


# Eqs. 3-7, and the frequency shifts, against integration of the equations of motion.

HALF_HERTZ = 2.0 * np.pi * 0.5


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
    return lambda x, v: float(universal_acceleration(x, v, HALF_HERTZ, losses, 1.0))


def viscous(quality: float) -> Callable[[float, float], float]:
    return lambda x, v: float(viscous_acceleration(x, v, HALF_HERTZ, quality))


@pytest.mark.parametrize("quality", [2.0, 10.0, 50.0])
@pytest.mark.parametrize("loss", [viscous, hysteretic])
def test_a_half_cycle_by_integration(
    loss: Callable[[float], Callable[[float, float], float]], quality: float
) -> None:
    duration, ratio = half_cycle(loss(quality))
    if loss is viscous:
        frequency = viscous_frequency_ratio(quality)
        decrement = damping_coefficient(HALF_HERTZ, quality) * duration
    else:
        frequency = hysteretic_frequency_ratio(quality)
        decrement = logarithmic_decrement(hysteretic_decrement_quality(quality)) / 2.0
    assert np.pi / (HALF_HERTZ * duration) == pytest.approx(float(frequency), rel=1e-10)
    assert -np.log(ratio) == pytest.approx(float(decrement), rel=1e-9)


def test_frequency_shifts_at_the_smallest_q_met() -> None:
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
        restoring_moment_n_m=inertia * HALF_HERTZ**2,
        quality_factor=quality,
        angular_frequency_per_s=HALF_HERTZ,
    )
    linear = viscous_acceleration(angle, velocity, HALF_HERTZ, quality)
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


# Eqs. 12, 13, 15 and 17 at the paper's numbers.

F, A, C = 0.516, 0.45, 1.4e-6
B = np.pi * F / 136.0
any_positive = decades(-6, 3)


@pytest.mark.parametrize(
    ("found", "printed"),
    [
        (B, pytest.approx(0.01192, abs=5e-6)),
        (quality_factor(0.068, F, A, B, C), pytest.approx(38.1, abs=0.1)),
        (largest_quality_factor(F, A, B, C), pytest.approx(120.0, abs=0.2)),
        (amplitude_of_largest_quality_factor(A, C), pytest.approx(1.8e-3, abs=5e-5)),
        (quality_factor_limit(F, B), pytest.approx(136.0, rel=1e-14)),
        (quality_factor(0.0, F, A, B, 0.0), pytest.approx(136.0)),
        # An a above 0.42 meets a Q below 40.
        (quality_factor(0.068, F, 0.43, B, C) < 40.0, True),
        (quality_factor(0.068, F, 0.41, B, C) > 40.0, True),
        # The product of a and c, from the largest Q.
        (((np.pi * F / 120.0 - B) / 2.0) ** 2, pytest.approx(6.3e-7, abs=0.05e-7)),
        (hysteretic_quality_factor(F, 3940.0), pytest.approx(1049.0, abs=0.1)),
        (hysteretic_quality_factor(1 / 15.0, 3940.0), pytest.approx(17.5, rel=1e-3)),
        (hysteretic_quality_factor(0.5, 3940.0), pytest.approx(985.0, rel=1e-3)),
        (
            without_hysteresis(136.0, hysteretic_quality_factor(F, 3940.0)),
            pytest.approx(156.3, abs=0.05),
        ),
        (viscous_frequency_shift(10.0), pytest.approx(-0.00125, rel=1e-12)),
        (hysteretic_frequency_shift(10.0), pytest.approx(-(np.pi**2) / 3200.0, rel=1e-12)),
        # Without losses, and at rest.
        (quality_factor(0.1, F, 0.0, 0.0, 0.0), np.inf),
        (quality_factor(0.0, F, A, B, C), 0.0),
        (amplitude_rate(0.0, A, B, C), 0.0),
    ],
)
def test_eqs_7_12_15_and_17_give_the_papers_numbers(found: object, printed: object) -> None:
    assert found == printed


@given(a=any_positive, b=any_positive, c=any_positive, factor=st.floats(0.1, 10.0))
def test_q_is_largest_at_the_square_root_of_c_over_a(
    a: float, b: float, c: float, factor: float
) -> None:
    best = float(amplitude_of_largest_quality_factor(a, c))
    peak = float(largest_quality_factor(F, a, b, c))
    assert float(quality_factor(best, F, a, b, c)) == pytest.approx(peak, rel=1e-12)
    assert float(quality_factor(factor * best, F, a, b, c)) <= peak * (1.0 + 1e-12)


@given(y=any_positive, a=any_positive, b=any_positive, c=any_positive)
def test_eq15_is_two_pi_times_the_energy_over_its_loss_in_a_cycle(
    y: float, a: float, b: float, c: float
) -> None:
    relative_energy_rate = 2.0 * float(amplitude_rate(y, a, b, c)) / y
    expected = 2.0 * np.pi / (-relative_energy_rate / F)
    assert float(quality_factor(y, F, a, b, c)) == pytest.approx(expected, rel=1e-12)


@given(c=st.tuples(any_positive, any_positive, any_positive), inertia=any_positive, y=any_positive)
def test_energy_of_eq12_falls_as_the_amplitude_of_eq13(
    c: tuple[float, float, float], inertia: float, y: float
) -> None:
    scale = 0.5 * inertia * (2.0 * np.pi * F) ** 2
    root = np.sqrt(scale) * y
    energy_rate = -(c[0] + c[1] * root + c[2] * root**2) * root
    abc = rates_from_energy_constants(*c, scale)
    # E = s y^2, so E' = 2 s y y'.
    assert 2.0 * scale * y * float(amplitude_rate(y, *abc)) == pytest.approx(energy_rate, rel=1e-12)


@given(viscous=any_positive, hysteretic=any_positive)
def test_eq17_undoes_the_sum_of_losses(viscous: float, hysteretic: float) -> None:
    measured = 1.0 / (1.0 / viscous + 1.0 / hysteretic)
    slack = 1e-12 + 1e-15 * viscous / hysteretic
    assert float(without_hysteresis(measured, hysteretic)) == pytest.approx(viscous, rel=slack)


def test_no_hysteresis_and_nothing_else() -> None:
    assert without_hysteresis(136.0, np.inf) == pytest.approx(136.0, rel=1e-14)
    assert without_hysteresis(136.0, 136.0) == np.inf
    assert without_hysteresis(136.0, 130.0) < 0.0


@given(
    a=st.floats(0.0, 1.0), b=st.floats(0.01, 1.0), c=st.floats(0.0, 1.0), fall=st.floats(1e-3, 0.99)
)
def test_powers_0_1_and_2_are_eq_13(a: float, b: float, c: float, fall: float) -> None:
    found = time_by_powers(fall, 1.0, {0.0: c, 1.0: b, 2.0: a})
    assert found == pytest.approx(float(time_at(fall, 1.0, a, b, c)), rel=1e-6)


@given(power=st.floats(0.0, 3.0), fall=st.floats(0.1, 0.99))
def test_of_one_power_y_to_one_less_it_changes_steadily(power: float, fall: float) -> None:
    assume(abs(power - 1.0) > 1e-2)
    middle = amplitude_halfway(fall, 1.0, {power: 0.3})
    expected = (0.5 * (1.0 + fall ** (1.0 - power))) ** (1.0 / (1.0 - power))
    assert middle == pytest.approx(expected, rel=1e-9)
