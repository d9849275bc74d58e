"""Eq. 8 in all its forms by the compiled engine, the general one, and an integrator of neither.

What is integrated is written down here from the paper: f_c, f_h, f_q and b_v, the energy of a
pendulum or of a spring, and v|v| in the place of the energy where the drag follows the speed.
"""

import math
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from pendpipe.diagnosis.begin import order_for
from pendpipe.dynamics import Eq8, Release, sample, sample_with_jacobian
from pendpipe.dynamics.eq8 import BASELINE, RATES, Drag, Restoring
from pendpipe.effects.model import Model, jacobian

from ..effects.integration import integrate

Floats = NDArray[np.float64]
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
ENGINE, GENERAL = 2e-9, 1e-6
"""Errors over the amplitude: of the compiled engine, where the integrator has 1e-9 itself; and of
the general one, whose readings come from six nodes."""


def pendulum(losses: str, restoring: Restoring, drag: Drag, amplitude: float) -> Eq8:
    """A pendulum that loses some per cent in a cycle, by one loss or by all."""
    law = Eq8(OMEGA, 0.02 / amplitude, 0.015, 0.01, 1e-3 * amplitude, restoring, drag)
    others = [] if losses == "all" else [name for name in RATES if name != losses]
    return replace(law, **dict.fromkeys(others, 0.0))


def integrated(law: Eq8, start_rad: float, time_s: Floats) -> Floats:
    """The paper's equation, by DOP853 from turning point to turning point."""
    w = law.angular_frequency
    f_c, f_h = 0.5 * math.pi * w * law.coulomb, 0.5 * math.pi * law.hysteretic
    f_q, b_v = 0.5 * math.pi * law.quadratic / w, law.viscous

    def acceleration(_t: float, state: Floats, sign: float, _turn: float) -> float:
        x, v = float(state[0]), float(state[1])
        potential = 2.0 * (1.0 - math.cos(x)) if law.restoring == "sine" else x * x
        square = w * w * potential + v * v
        drag = 1.5 * v * v if law.drag == "speed" else square
        torque = math.sin(x) if law.restoring == "sine" else x
        friction = f_c + f_h * math.sqrt(square) + f_q * drag
        return -w * w * torque - 2.0 * b_v * v - friction * sign

    return integrate(acceleration, start_rad, 0.0, time_s)


def general(law: Eq8, start_rad: float) -> tuple[Model, Floats]:
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
    truth = integrated(law, amplitude, TIME)
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
    found = jacobian(model, value, model.evaluate(value))
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
def derivatives(restoring: Restoring, drag: Drag, amplitude: float) -> Floats:
    """The paper's equation by every parameter, by differences of two integrations."""
    law = pendulum("all", restoring, drag, amplitude)
    columns = []
    for name in (*RATES, "angular_frequency"):
        value = getattr(law, name)
        step = 1e-4 if name == "angular_frequency" else 3e-3
        low, high = (replace(law, **{name: value * (1.0 + e)}) for e in (-step, step))
        difference = integrated(high, amplitude, TIME) - integrated(low, amplitude, TIME)
        columns.append(difference / (2.0 * step * value))
    low, high = (amplitude * (1.0 + e) for e in (-1e-4, 1e-4))
    difference = integrated(law, high, TIME) - integrated(law, low, TIME)
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


def gyroscope(time_s: Floats, **more: Any) -> Model:
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
    found = jacobian(model, RATE_BASE, model.evaluate(RATE_BASE))[:, index]
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
