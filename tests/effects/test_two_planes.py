"""A second plane against the equations of a spherical pendulum, which scipy integrates."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from pendpipe.arrays import FloatArray
from pendpipe.diagnosis.data import Data
from pendpipe.diagnosis.noise import white_noise
from pendpipe.diagnosis.refine import refine
from pendpipe.dynamics.eq8 import OMEGA, SHARE, START, TIME as TIME_OF_START, A, B, C
from pendpipe.dynamics.eq8_model import values_of
from pendpipe.effects.catalogue import by_identifier
from pendpipe.effects.catalogue.in_time import string_planes
from pendpipe.effects.effect import Pendulum
from pendpipe.effects.model import Model
from pendpipe.effects.two_planes import planes, two_planes

PLANES = by_identifier("plane-coupling")
TIME = np.arange(0.0, 60.0, 1.0 / 30.0)
SQUARE, LOSS = 8.0, 0.008


def spherical(
    along: float,
    across: float,
    stiffer: float,
    axis_rad: float,
    camera_rad: float = 0.0,
    drag_per_m: float = 0.0,
) -> FloatArray:
    """The angle that a camera sees of a mass on a string of length 1.

    Let go at `along` with a velocity that would carry it to `across`; the suspension is stiffer
    along one axis, as a string on two hooks is. Drag is `drag_per_m` |v| v.
    """
    axis = np.array([math.cos(axis_rad), math.sin(axis_rad), 0.0])

    def slopes(_: float, state: FloatArray) -> FloatArray:
        place, velocity = state[:3], state[3:]
        force = np.array([0.0, 0.0, -SQUARE]) - 2.0 * LOSS * velocity
        force -= drag_per_m * np.linalg.norm(velocity) * velocity
        force -= SQUARE * stiffer * (place @ axis) * axis
        pull = -(velocity @ velocity) - place @ force
        return np.concatenate([velocity, force + pull * place])

    start = [along, 0.0, -math.sqrt(1.0 - along**2), 0.0, math.sqrt(SQUARE) * across, 0.0]
    solved = solve_ivp(
        slopes, (0.0, TIME[-1]), start, method="DOP853", t_eval=TIME, rtol=1e-9, atol=1e-11
    )
    x, y, z = solved.y[:3]
    return np.asarray(np.arctan2(math.cos(camera_rad) * x + math.sin(camera_rad) * y, -z))


def started(readings: FloatArray) -> tuple[Model, Data, FloatArray]:
    """The model of two planes, and where a fit of it begins."""
    begun = PLANES.restart(TIME, readings, Pendulum(math.sqrt(SQUARE), restoring="sine"), 0.0)
    assert begun is not None
    value = np.concatenate([values_of(begun.law, begun.release), begun.values])
    data = Data(TIME, readings, 1.0 / 30.0, True, np.ones(len(TIME)))
    return Model(TIME, 1.0 / 30.0, (begun.effect,), restoring="sine"), data, value


@pytest.mark.parametrize(
    ("along", "across", "stiffer", "axis_rad", "camera_rad"),
    [
        pytest.param(0.1, 0.03, 0.0, 0.0, 0.0, id="an ellipse"),
        pytest.param(0.25, 0.06, 0.0, 0.0, 0.0, id="one that turns"),
        pytest.param(0.25, -0.05, 0.0, 0.0, 0.8, id="seen obliquely"),
        pytest.param(0.1, 0.0, 0.02, 0.6, 0.0, id="two hooks"),
        pytest.param(0.25, 0.0, 0.02, 1.1, 0.0, id="apart by a hundredth"),
        pytest.param(0.47, 0.05, 0.0, 0.0, 0.1, id="as large as a protractor"),
        pytest.param(0.47, 0.14, 0.0, 0.0, 0.5, id="large and oblique"),
    ],
)
def test_a_string_pendulum_seen_by_one_camera(
    along: float, across: float, stiffer: float, axis_rad: float, camera_rad: float
) -> None:
    """The slow flow leaves the next odd power of the amplitude; one plane far more."""
    both, data, value = started(spherical(along, across, stiffer, axis_rad, camera_rad))
    noise = white_noise(data, 1e-4)
    fit = refine(both, data, noise, value, held=[C, SHARE])
    alone = refine(both.bare(), data, noise, value[: both.first], held=[C, SHARE])
    left, one = data.rms_left(fit.at.reading), data.rms_left(alone.at.reading)
    assert left < max(along**5 / 30.0, 3e-5)
    assert left < 0.25 * one
    assert fit.value[OMEGA] == pytest.approx(math.sqrt(SQUARE), rel=max(stiffer, 1e-3))


@pytest.mark.slow
@pytest.mark.parametrize("stiffer", [-0.1, 0.004, 0.02])
def test_a_small_swing_across_is_held_by_the_string_that_the_large_one_pulls(
    stiffer: float,
) -> None:
    """At 28 degrees it grows where the turn of the planes takes up the detuning.

    Its waveform's third harmonic, of the square of the large swing, is left.
    """
    scene = (0.47, 0.002, stiffer, 0.5 * math.pi)
    along, across = (np.tan(spherical(*scene, camera_rad)) for camera_rad in (0.0, 0.5 * math.pi))
    readings = np.arctan(along) + across / np.sqrt(1.0 + along**2 + across**2)
    data = Data(TIME, readings, 1.0 / 30.0, True, np.ones(len(TIME)))
    model = Model(TIME, 1.0 / 30.0, (PLANES,), restoring="sine")
    omega = math.sqrt(SQUARE)
    value = np.array([0.0, LOSS, 0.0, 0.0, omega, 0.485, 0.0, 0.0, 0.0, 0.0, 0.0])
    value[-1] = 0.25 / math.pi * omega * stiffer
    fit = refine(model, data, white_noise(data, 1e-4), value, held=[A, C, SHARE])
    alone = refine(model.bare(), data, white_noise(data, 1e-4), value[:8], held=[A, C, SHARE])
    assert data.rms_left(fit.at.reading) < 0.25 * 0.47**2 * data.rms_left(alone.at.reading)
    assert fit.value[-1] == pytest.approx(value[-1], rel=0.1)


@pytest.mark.parametrize("camera_rad", [0.1, 0.5])
def test_a_drag_of_the_speed_in_both_planes_needs_no_detuning(camera_rad: float) -> None:
    """The smaller half axis loses less, and the loss of one plane is 4/(3 pi) of v|v| a length."""
    both, data, value = started(spherical(0.4, 0.06, 0.0, 0.0, camera_rad, drag_per_m=0.03))
    value[[B, -1]] = LOSS, 0.0
    fit = refine(both, data, white_noise(data, 1e-4), value, held=[B, C, SHARE, len(value) - 1])
    assert data.rms_left(fit.at.reading) < 0.4**5 / 30.0
    law = 4.0 / (3.0 * math.pi) * 0.03 * math.sqrt(SQUARE)
    assert fit.value[A] == pytest.approx(law, rel=0.05)


@pytest.mark.parametrize("index", [A, B, OMEGA, START, TIME_OF_START])
def test_what_the_pendulum_carries_follows_its_values(index: int) -> None:
    """A second plane as large as the first, by differences of two whole evaluations."""
    both = Model(TIME, 1.0 / 30.0, (string_planes,), restoring="sine")
    value = np.array([1e-3, LOSS, 0.0, 0.5, math.sqrt(SQUARE), 0.3, 0.0, 0.0, 0.2, 0.1, 1e-3])
    step = 1e-6 * np.eye(len(value))[index]
    change = (both.reading(value + step) - both.reading(value - step)) / 2e-6
    off = both.evaluate(value).jacobian[:, index] - change
    assert np.linalg.norm(off) < 0.02 * np.linalg.norm(change)


def test_an_ellipse_turns_by_three_eighths_of_the_product_of_its_half_axes() -> None:
    """And the sum of squares stays; at 45 degrees to both axes, one a quarter turn ahead."""
    reached = np.linspace(0.0, 40.0, 300)
    # Half axes 2 cos(0.1) and 2 sin(0.1) of the first mode's part of what is seen, 1.
    u, w = planes(reached, reached, 0.0 * reached, complex(np.exp(0.2j)), 0.0)
    np.testing.assert_allclose(np.abs(u) ** 2 + np.abs(w) ** 2, 4.0, rtol=1e-6)
    area = 4.0 * math.cos(0.1) * math.sin(0.1)
    np.testing.assert_allclose(np.abs((np.conj(u) * w).imag), area, rtol=1e-6)
    turned = 0.5 * np.unwrap(
        np.arctan2(2.0 * (u * np.conj(w)).real, np.abs(u) ** 2 - np.abs(w) ** 2)
    )
    rate = np.polyfit(reached, turned, 1)[0]
    assert abs(rate) == pytest.approx(0.375 * area, rel=1e-3)


def test_of_a_few_cycles_two_planes_are_not_told() -> None:
    assert two_planes(TIME[:100], np.cos(math.sqrt(SQUARE) * TIME[:100]), math.sqrt(SQUARE)) is None
