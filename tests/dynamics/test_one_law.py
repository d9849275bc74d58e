"""One law by two engines, and any other law by the general one."""

import math
from dataclasses import replace
from functools import cache
from typing import Any

import mpmath
import numpy as np
import pytest
from hypothesis import Phase, given, settings, strategies as st

from pendpipe.arrays import FloatArray
from pendpipe.diagnosis.begin import order_for
from pendpipe.dynamics import Eq8, Release, sample, sample_with_jacobian, turning_points
from pendpipe.dynamics.any_law import (
    Clock,
    Law,
    Motion,
    NoMotionError,
    StopsError,
    Tangent,
    follow,
    sample_motion,
)
from pendpipe.dynamics.eq8 import BASELINE, RATES, Drag, Restoring
from pendpipe.effects import Pendulum
from pendpipe.effects.catalogue import by_identifier
from pendpipe.effects.model import Model

from .reference import integrated

# Eq. 8 in all its forms by the compiled engine, the general one, and an integrator of neither.
#
# What the challenge integrates is written down from the paper in tests/challenge/test_world.py: the
# energy is that of a pendulum or of a spring, and v|v| where the drag follows the speed.

OMEGA = 2.0 * math.pi * 0.87
TIME = np.arange(0.0, 9.0, 0.031)
AMPLITUDES = (0.1, 0.3, 1.0, 2.0, 2.5)
FORMS: list[tuple[Restoring, Drag]] = [
    ("linear", "energy"),
    ("linear", "speed"),
    ("sine", "energy"),
    ("sine", "speed"),
]
EACH = [
    (losses, *form)
    for losses in (*RATES, "all")
    for form in FORMS
    if form[1] == "energy" or losses in ("quadratic", "all")
]
ENGINE, GENERAL = 1e-10, 1e-6
"""Errors over the amplitude: of the compiled engine; and of the general one, whose readings come
from six nodes."""


def pendulum(losses: str, restoring: Restoring, drag: Drag, amplitude: float) -> Eq8:
    """A pendulum that loses some per cent in a cycle, by one loss or by all."""
    law = Eq8(OMEGA, 0.02 / amplitude, 0.015, 0.01, 1e-3 * amplitude, restoring, drag)
    others = [] if losses == "all" else [name for name in RATES if name != losses]
    return replace(law, **dict.fromkeys(others, 0.0))


def by_steps(law: Eq8, start_rad: float) -> FloatArray:
    """The same angles by the challenge's integrator, which goes in time."""
    return integrated(law, start_rad).run(TIME).angle_rad


def general(law: Eq8, start_rad: float) -> tuple[Model, FloatArray]:
    """The general engine's model and its values."""
    b = law.hysteretic + law.viscous
    share = law.hysteretic / b if b else 0.0
    order = order_for(start_rad, "rad")
    model = Model(TIME, TIME[1], order=order, restoring=law.restoring, drag=law.drag)
    value = [law.quadratic, b, law.coulomb, share, OMEGA, start_rad, 0.0, 0.0]
    return model, np.array(value)


@pytest.mark.parametrize("amplitude", AMPLITUDES)
@pytest.mark.parametrize(("losses", "restoring", "drag"), EACH)
def test_three_ways_to_one_motion(
    losses: str, restoring: Restoring, drag: Drag, amplitude: float
) -> None:
    law = pendulum(losses, restoring, drag, amplitude)
    truth = by_steps(law, amplitude)
    compiled = sample(law, Release(0.0, amplitude), TIME)
    model, value = general(law, amplitude)
    assert np.max(np.abs(compiled - truth)) < ENGINE * amplitude
    assert np.max(np.abs(model.reading(value) - truth)) < GENERAL * amplitude


@pytest.mark.parametrize("amplitude", AMPLITUDES)
@pytest.mark.parametrize(("restoring", "drag"), FORMS)
def test_both_engines_have_the_same_derivatives(
    restoring: Restoring, drag: Drag, amplitude: float
) -> None:
    law = pendulum("all", restoring, drag, amplitude)
    _, compiled = sample_with_jacobian(law, Release(0.0, amplitude), TIME)
    model, value = general(law, amplitude)
    found = model.evaluate(value).jacobian
    # Of a, the two parts of b, c and the rest by a, b, c, share and the rest.
    change = np.zeros((8, 8))
    b, share = value[1], value[3]
    for column, name in enumerate(BASELINE):
        rows = {"a": [(0, 1.0)], "b": [(1, share), (2, 1.0 - share)], "c": [(3, 1.0)]}
        rows["share"] = [(1, b), (2, -b)]
        for row, weight in rows.get(name, [(column, 1.0)]):
            change[row, column] = weight
    expected = compiled @ change
    error = np.linalg.norm(found - expected, axis=0) / np.linalg.norm(expected, axis=0)
    assert np.max(error) < 1e-4, dict(zip(BASELINE, error, strict=True))


@cache
def derivatives(restoring: Restoring, drag: Drag, amplitude: float) -> FloatArray:
    """The paper's equation by every parameter, by differences of two integrations."""
    law = pendulum("all", restoring, drag, amplitude)
    columns = []
    for name in (*RATES, "angular_frequency"):
        value = getattr(law, name)
        step = 1e-4 if name == "angular_frequency" else 3e-3
        low, high = (replace(law, **{name: value * (1.0 + e)}) for e in (-step, step))
        difference = by_steps(high, amplitude) - by_steps(low, amplitude)
        columns.append(difference / (2.0 * step * value))
    low, high = (amplitude * (1.0 + e) for e in (-1e-4, 1e-4))
    difference = by_steps(law, high) - by_steps(law, low)
    return np.stack([*columns, difference / (2e-4 * amplitude)], axis=1)


@pytest.mark.parametrize("amplitude", [0.3, 2.0])
@pytest.mark.parametrize(("restoring", "drag"), FORMS)
def test_the_compiled_derivatives_are_those_of_the_integrated_equation(
    restoring: Restoring, drag: Drag, amplitude: float
) -> None:
    law = pendulum("all", restoring, drag, amplitude)
    _, found = sample_with_jacobian(law, Release(0.0, amplitude), TIME)
    expected = derivatives(restoring, drag, amplitude)
    error = np.linalg.norm(found[:, :6] - expected, axis=0) / np.linalg.norm(expected, axis=0)
    assert np.max(error) < 1e-5, error


RATE_BASE = np.array([0.02, 0.02, 1e-3, 0.4, OMEGA, 1.2, 0.0, 0.05])


def gyroscope(time_s: FloatArray, **more: Any) -> Model:
    interval = float(time_s[1] - time_s[0])
    return Model(time_s, interval, order=20, restoring="sine", drag="speed", seen="rate", **more)


def test_a_gyroscope_reads_the_rate_of_the_angle() -> None:
    a, b, c, share, omega, start, _, offset = RATE_BASE
    law = Eq8(omega, a, share * b, (1.0 - share) * b, c, "sine", "speed")
    # A motion that begins later is behind by its rate.
    _, columns = sample_with_jacobian(law, Release(0.0, start), TIME)
    found = gyroscope(TIME).reading(RATE_BASE) - offset
    assert np.max(np.abs(found + columns[:, 6])) < 1e-6 * omega * start


@pytest.mark.parametrize("index", range(8))
def test_derivatives_of_a_gyroscopes_readings(index: int) -> None:
    model, step = gyroscope(TIME), (1e-4, 1e-4, 1e-5, 1e-2, 5e-4, 1e-4, 1e-4, 1e-2)[index]
    low, high = RATE_BASE.copy(), RATE_BASE.copy()
    low[index] -= step
    high[index] += step
    expected = (model.reading(high) - model.reading(low)) / (2.0 * step)
    found = model.evaluate(RATE_BASE).jacobian[:, index]
    assert np.linalg.norm(found - expected) < 1e-4 * np.linalg.norm(expected)


def test_means_of_a_gyroscopes_readings() -> None:
    fine = np.arange(0.0, 9.0, 0.008)
    means = gyroscope(fine).reading(RATE_BASE)[: len(fine) // 5 * 5].reshape(-1, 5).mean(axis=1)
    middle = fine[: len(fine) // 5 * 5].reshape(-1, 5).mean(axis=1)
    found = gyroscope(middle, fold=5).reading(RATE_BASE)
    single = gyroscope(middle).reading(RATE_BASE)
    # Turning points, where friction jumps, apart.
    error = np.sort(np.abs(found - means))[: int(0.9 * len(means))]
    assert np.max(error) < 0.02 * np.max(np.abs(single - means))


# Any law on the phase clock: against the Eq. 8 engine, elliptic integrals, and its own order.

OMEGA_RAD_S = 2.0 * math.pi * 0.9


def undamped(clock: Clock, start: float = 1.0, omega: float = OMEGA_RAD_S) -> Motion:
    """A motion to begin the iteration with."""
    return Motion(clock, omega, np.full_like(clock.psi, math.log(abs(start))), clock.psi / omega)


def eq8_motion(pendulum: Pendulum, start: float, count: int, order: int = 14) -> Motion:
    guess = undamped(Clock(count, order), start, pendulum.angular_frequency)
    return follow(pendulum.along, pendulum.angular_frequency, start, 0.0, guess)


def sine_law(motion: Motion) -> FloatArray:
    return OMEGA_RAD_S**2 * (motion.angle - np.sin(motion.angle))


@settings(deadline=None, max_examples=40, phases=[Phase.explicit, Phase.generate])
@given(
    quadratic=st.floats(0.0, 0.3),
    hysteretic=st.floats(0.0, 0.1),
    viscous=st.floats(0.0, 0.1),
    friction=st.floats(0.0, 0.2),
    start=st.floats(0.02, 0.5),
    side=st.sampled_from([-1.0, 1.0]),
)
def test_eq8_as_the_engine_has_it(
    quadratic: float,
    hysteretic: float,
    viscous: float,
    friction: float,
    start: float,
    side: float,
) -> None:
    """The readings' error is 3e-4 of what a radian of phase loses (2e-7 at Q = 700)."""
    # c such that Coulomb friction alone would take half of that part in the record.
    duration = 8.0
    coulomb = friction * start / (2.0 * duration)
    pendulum = Pendulum(OMEGA_RAD_S, quadratic, hysteretic, viscous, coulomb)
    motion = eq8_motion(pendulum, side * start, 16)
    time = np.arange(0.0, duration, 0.037)
    engine = Eq8(OMEGA_RAD_S, quadratic, hysteretic, viscous, coulomb)
    expected = sample(engine, Release(0.0, side * start), time)
    found = sample_motion(motion, time).angle
    loss = (quadratic * start + hysteretic + viscous + coulomb / start) / OMEGA_RAD_S
    assert np.max(np.abs(found - expected)) < (3e-4 * loss + 1e-8) * start


def test_turning_points_of_eq8_over_a_long_record() -> None:
    """The clock's ends of half cycles are the engine's turning points."""
    motion = eq8_motion(Pendulum(OMEGA_RAD_S, 7.2e-3, 3.1e-3, 4.7e-3, 1.3e-4), 0.15, 340)
    engine = Eq8(OMEGA_RAD_S, 7.2e-3, 3.1e-3, 4.7e-3, 1.3e-4)
    points = turning_points(engine, Release(0.0, 0.15), count=340)
    count = min(len(points.angle_rad), 340)
    assert count > 300
    np.testing.assert_allclose(
        motion.angle[:count, 0], points.angle_rad[:count], rtol=0.0, atol=1e-10
    )
    np.testing.assert_allclose(motion.time_s[:count, 0], points.time_s[:count], rtol=0.0, atol=1e-8)


@pytest.mark.parametrize(
    ("amplitude", "order", "within"),
    [
        (0.1, 14, 1e-11),
        (0.5, 14, 1e-8),
        (1.0, 14, 3e-8),
        (1.5, 20, 1e-8),
        (2.0, 28, 1e-9),
        (2.5, 48, 1e-9),
        (2.8, 80, 1e-9),
    ],
)
def test_the_period_of_sin_x_is_the_elliptic_integral(
    amplitude: float, order: int, within: float
) -> None:
    """T = 4 K(sin^2(y/2))/omega, as far over as the clock goes, given nodes enough."""
    motion = follow(sine_law, OMEGA_RAD_S, amplitude, 0.0, undamped(Clock(12, order), amplitude))
    period = float(4 * mpmath.ellipk(mpmath.sin(amplitude / 2) ** 2)) / OMEGA_RAD_S
    assert (motion.time_s[10, 0] / 5.0) / period == pytest.approx(1.0, abs=within)
    assert np.abs(motion.turning_angle) == pytest.approx(amplitude, rel=100 * within)


def test_readings_are_as_exact_as_the_solution_with_few_nodes() -> None:
    """Against the compiled engine of Eq. 8."""
    pendulum = Pendulum(OMEGA_RAD_S, 0.05, 0.01, 0.01, 1e-4)
    time = np.arange(0.0, 20.0, 0.037)
    expected = sample(Eq8(OMEGA_RAD_S, 0.05, 0.01, 0.01, 1e-4), Release(0.0, 0.3), time)
    errors = [
        np.max(np.abs(sample_motion(eq8_motion(pendulum, 0.3, 40, order), time).angle - expected))
        for order in (10, 20)
    ]
    assert errors[0] < 1e-8
    assert errors[1] < 1e-10


def test_upside_down_it_does_not_turn() -> None:
    with pytest.raises(NoMotionError):
        follow(sine_law, OMEGA_RAD_S, 3.12, 0.0, undamped(Clock(12, 40), 3.12))


@pytest.mark.parametrize("rest", [0.1, 0.3, 0.4])
def test_about_a_displaced_rest_it_swings_as_about_nought(rest: float) -> None:
    """It goes as rest + (1 - rest) cos(omega t), however near to nought it turns beyond."""
    clock = Clock(12, 60)
    motion = follow(
        lambda motion: np.full_like(motion.angle, OMEGA_RAD_S**2 * rest),
        OMEGA_RAD_S,
        1.0,
        0.0,
        undamped(clock),
    )
    assert motion.time_s[:, 0] == pytest.approx(np.arange(12) * math.pi / OMEGA_RAD_S, abs=1e-6)
    far = 2.0 * rest - 1.0
    assert motion.turning_angle[:, 0] == pytest.approx([1.0, far] * 6, abs=1e-6)


def test_about_a_rest_at_which_it_turns_short_of_nought_there_is_no_phase() -> None:
    with pytest.raises(NoMotionError):
        follow(
            lambda motion: np.full_like(motion.angle, OMEGA_RAD_S**2 * 0.55),
            OMEGA_RAD_S,
            1.0,
            0.0,
            undamped(Clock(12, 40)),
        )


def test_beyond_the_stop_there_is_no_motion() -> None:
    """Coulomb friction of a third of the amplitude stops the pendulum in two half cycles."""
    pendulum = Pendulum(OMEGA_RAD_S, coulomb=0.01 * OMEGA_RAD_S / 3.0)
    with pytest.raises(NoMotionError):
        eq8_motion(pendulum, 0.01, 8)


def test_the_tangent_is_what_a_small_force_does() -> None:
    """of_force and of_start against motions followed with a little more of each."""
    pendulum = Pendulum(OMEGA_RAD_S, 0.05, 0.01, 0.01, 1e-4)
    base = eq8_motion(pendulum, 0.2, 40)
    tangent = Tangent(pendulum.along, base)
    time = np.arange(0.0, 20.0, 0.05)
    sampled = sample_motion(base, time)

    def changed(law: Law, start: float = 0.2, late: float = 0.0) -> FloatArray:
        return (
            sample_motion(follow(law, OMEGA_RAD_S, start, late, base), time).angle - sampled.angle
        )

    small = 1e-5
    pushed = changed(lambda m: pendulum.along(m) + small * m.angle**2)
    by_force = small * sampled.change(*tangent.of_force(base.angle**2))
    assert np.linalg.norm(by_force - pushed) < 1e-3 * np.linalg.norm(pushed)
    grown = changed(pendulum.along, start=0.2 * math.exp(small))
    by_start = small * sampled.change(*tangent.of_start())
    assert np.linalg.norm(by_start - grown) < 1e-3 * np.linalg.norm(grown)


def test_nodes_integrate_polynomials_of_the_phase_exactly() -> None:
    clock = Clock(5, 12)
    for power in range(12):
        found = clock.integral(clock.psi**power)
        exact = clock.psi ** (power + 1) / (power + 1)
        np.testing.assert_allclose(found, exact, 0.0, 1e-13 * exact.max())


def test_what_comes_after_the_last_reading_is_of_no_consequence() -> None:
    """Friction stops it after 30 half cycles: a clock of 60 has the first 20 of one of 20."""
    start, count = 0.15, 30
    coulomb = start / (count * math.pi / OMEGA_RAD_S)
    pendulum = Pendulum(OMEGA_RAD_S, 0.0, 0.0, 0.0, coulomb)
    short = eq8_motion(pendulum, start, 20)
    until = float(short.time_s[-1, -1])
    whole = follow(
        pendulum.along, OMEGA_RAD_S, start, 0.0, undamped(Clock(60), start), until_s=until
    )
    time = np.arange(0.0, until, 0.037)
    one, other = (sample_motion(motion, time).angle for motion in (short, whole))
    assert np.max(np.abs(one - other)) < 1e-6 * start


@pytest.mark.parametrize("half_cycles", [1.2, 1.6, 2.2, 2.7])
@pytest.mark.parametrize("amplitude", AMPLITUDES)
def test_near_its_stop_a_motion_is_the_same_wherever_the_search_begins(
    amplitude: float, half_cycles: float
) -> None:
    """What is tried for the half cycles that friction forbids is in no order."""
    law = replace(pendulum("coulomb", "sine", "energy", amplitude), coulomb=0.009 * amplitude)
    release = Release(0.0, amplitude)
    stop_s = float(turning_points(law, release).time_s[-1])
    time_s = np.arange(0.0, stop_s - half_cycles * math.pi / OMEGA, 0.01)
    model, value = general(law, amplitude)
    model = replace(model, time_s=time_s, interval_s=0.01)
    exact = sample(law, release, time_s)
    for rate in (1.0, 1.001, 0.999, 1.0):
        found = model.reading(
            value * np.where(np.arange(len(value)) == BASELINE.index("c"), rate, 1.0)
        )
    assert np.max(np.abs(found - exact)) < 10.0 * GENERAL * amplitude


def test_a_pendulum_that_stops_before_the_last_reading_is_refused() -> None:
    """Friction stops it after 30 half cycles, and 50 are read."""
    pendulum = Pendulum(OMEGA_RAD_S, 0.0, 0.0, 0.0, 0.15 / (30.0 * math.pi / OMEGA_RAD_S))
    clock, until = Clock(60), 50.0 * math.pi / OMEGA_RAD_S
    with pytest.raises(StopsError):
        follow(pendulum.along, OMEGA_RAD_S, 0.15, 0.0, undamped(clock, 0.15), until_s=until)


@pytest.mark.parametrize("amplitude", [0.3, 0.75, 1.15, 1.5, 1.9, 2.3, 2.55])
def test_sin_x_is_read_between_the_nodes_as_exactly_as_it_is_solved(amplitude: float) -> None:
    """Against twice the nodes and more, where its half cycles differ most from a cosine's."""
    time_s = np.arange(0.0, 30.0, 0.013)
    value = np.array([5e-3, 8e-3, 1e-3, 0.4, 5.6, amplitude, -0.3, 0.01, 1.0])
    effects = (by_identifier("circular-error"),)
    few, many = (
        Model(time_s, 0.013, effects, order=order).evaluate(value).reading
        for order in (order_for(amplitude, "rad"), 64)
    )
    np.testing.assert_allclose(few, many, rtol=0.0, atol=3e-7 * amplitude)


@pytest.mark.parametrize("amplitude", [0.3, 1.5, 2.3])
@pytest.mark.parametrize("early_s", [0.003, 0.01])
def test_just_before_it_starts_a_motion_is_as_just_after(amplitude: float, early_s: float) -> None:
    """About a turning point it is even but for the loss, which is small."""
    time_s = np.array([-early_s, early_s, 1.0, 5.0])
    value = np.array([5e-3, 8e-3, 1e-3, 0.4, 5.6, amplitude, 0.0, 0.0, 1.0])
    model = Model(time_s, 0.02, (by_identifier("circular-error"),), order=24)
    before, after = model.evaluate(value).reading[:2]
    assert before == pytest.approx(after, rel=1e-6)


@pytest.mark.parametrize("every", [3, 11])
def test_one_cycle_of_several_stands_for_all(every: int) -> None:
    """What grows slowly along the phase is summed over the cycles between, to 1e-4."""
    whole = Clock(4000)
    motion = Motion(whole, 1.0, -1e-4 * whole.psi, whole.psi)
    part = motion.thinned(every)
    for rate in (lambda m: m.amplitude**2 * m.clock.sine**2, lambda m: m.time_s * m.clock.cosine):
        complete = whole.integral(rate(motion))
        there = complete[part.clock.half_cycles]
        scale = np.abs(complete).max()
        assert part.clock.integral(rate(part)) == pytest.approx(there, abs=1e-4 * scale)
