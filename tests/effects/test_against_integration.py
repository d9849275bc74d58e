"""Motion with an effect against scipy's integrator on the same law, written down anew here."""

# ruff: noqa: ARG005 (a law is given all that it could depend on)

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from .integration import Acceleration, integrate
from .pendulums import OMEGA, baseline, evaluated, plain, times

Floats = NDArray[np.float64]
A, B, C, SHARE, START = 0.02, 0.02, 1e-4, 0.4, 0.15
BASE = baseline(a=A, b=B, c=C, share=SHARE, start=START)
TIME = times(20.0)


def eq8(state: Floats, direction: float) -> float:
    """Eq. 8's x'' by the rates of Eq. 13."""
    x, v = state[0], state[1]
    speed = math.hypot(OMEGA * x, v)
    dry = OMEGA * C + B * SHARE * speed + A / OMEGA * speed**2
    return -(OMEGA**2) * x - 2.0 * B * (1.0 - SHARE) * v - 0.5 * math.pi * dry * direction


def with_extra(extra: Callable[[float, float, float, float, float], float]) -> Acceleration:
    """Eq. 8 and an acceleration of (t, x, v, sign of v, last turning angle)."""

    def law(t: float, state: Floats, direction: float, turn: float) -> float:
        return eq8(state, direction) + extra(t, state[0], state[1], direction, turn)

    return law


def without_sudden(t: float, x: float, v: float, s: float, turn: float) -> float:
    return 0.0


def friction_by_energy(x: float, v: float, s: float) -> float:
    """What Eq. 8's losses are larger where rho^2 = v^2 + 2 omega^2 (1 - cos x)."""
    linear, sine = (
        B * SHARE * speed + A / OMEGA * speed**2
        for speed in (math.hypot(OMEGA * x, v), math.hypot(2.0 * OMEGA * math.sin(0.5 * x), v))
    )
    return 0.5 * math.pi * (sine - linear) * s


CASES: dict[str, tuple[tuple[float, ...], Any, dict[str, Any]]] = {
    "circular-error": (
        (1.0,),
        lambda t, x, v, s, turn: OMEGA**2 * (x - math.sin(x)) - friction_by_energy(x, v, s),
        {},
    ),
    "quadratic-stiffness": ((0.1,), lambda t, x, v, s, turn: -0.1 * OMEGA**2 * x**2, {}),
    "drag-form": (
        (1.0,),
        lambda t, x, v, s, turn: (
            0.5 * math.pi * A / OMEGA * ((OMEGA * x) ** 2 + v**2) * s
            - 0.75 * math.pi * A / OMEGA * v * abs(v)
        ),
        {},
    ),
    "power-law-damping": (
        (5e-3, 1.5, 0.0),
        lambda t, x, v, s, turn: -5e-3 * s * abs(v / 0.1) ** 1.5,
        {},
    ),
    "cubic-damping": ((2.0, 1.0), lambda t, x, v, s, turn: -2.0 * x * x * v, {}),
    "stribeck-friction": (
        (2e-3, 0.1),
        lambda t, x, v, s, turn: -2e-3 * s * math.exp(-((v / 0.1) ** 2)),
        {},
    ),
    "vortex-shedding": (
        (0.05, 0.11, 1.0),
        lambda t, x, v, s, turn: (
            -0.05
            * OMEGA
            * math.pi
            * 2.0
            / (1.0 + math.exp(-math.pi))
            * s
            * max(0.0, abs(turn) - 0.11)
            * math.exp(-math.atan2(abs(v) / OMEGA, math.copysign(x, x * turn)))
        ),
        {},
    ),
    "periodic-drive": (
        (0.02, 0.01, 1.3),
        lambda t, x, v, s, turn: (
            0.02 * math.cos(2.6 * math.pi * t) + 0.01 * math.sin(2.6 * math.pi * t)
        ),
        {},
    ),
    "frequency-drift": (
        (1e-4, 7.0),
        lambda t, x, v, s, turn: 1.4e-3 * OMEGA**2 * math.expm1(-t / 7.0) * x,
        {},
    ),
    "equilibrium-creep": (
        (3e-3, 4.0, 0.0),
        lambda t, x, v, s, turn: 3e-3 * OMEGA**2 * math.log1p(t / 4.0),
        {},
    ),
    "release-transient": (
        (0.03, 3.0),
        lambda t, x, v, s, turn: -0.06 * math.exp(-t / 3.0) * v,
        {},
    ),
    "impulse": ((-0.4, 9.81), without_sudden, {"kicks": ((9.81, 0.0, -0.4),)}),
    "equilibrium-step": ((0.03, 9.81), without_sudden, {"kicks": ((9.81, -0.03, 0.0),)}),
}
"""Effect: its values, the extra acceleration, kicks (instant, of the angle, of the velocity)."""


@pytest.mark.parametrize("identifier", CASES)
def test_motion_is_that_of_the_law(identifier: str) -> None:
    """To 1e-5 of the amplitude, and to a thousandth of what the effect does."""
    values, extra, more = CASES[identifier]
    expected = integrate(with_extra(extra), START, 0.0, TIME, **more)
    found = evaluated(identifier, values, BASE, TIME).sampled.angle
    error = float(np.max(np.abs(found - expected)))
    effect = float(np.max(np.abs(expected - plain(BASE, TIME))))
    assert error < 1e-5 * START
    assert error < (1e-3 if effect > 1e-3 else 1e-2) * effect


@pytest.mark.parametrize(
    ("identifier", "values", "extra", "within"),
    [
        # The corners of play lie between the nodes of the clock, and enter by their harmonics.
        *(
            (
                "backlash",
                (gap,),
                lambda t, x, v, s, turn, half=gap / 2: OMEGA**2 * min(max(x, -half), half),
                1e-4,
            )
            for gap in (1e-4, 2e-2)
        ),
        # Near twice the frequency, where it beats.
        (
            "parametric-drive",
            (1e-3, 0.0, 1.85),
            lambda t, x, v, s, turn: -1e-3 * OMEGA**2 * x * math.cos(3.7 * math.pi * t),
            1e-4,
        ),
        # Its curvature jumps at x = 0, between the nodes.
        (
            "amplitude-linear-stiffness",
            (0.1,),
            lambda t, x, v, s, turn: -0.1 * OMEGA**2 * x * abs(x),
            1e-3,
        ),
    ],
)
def test_the_change_of_the_motion_is_that_of_the_law(
    identifier: str, values: tuple[float, ...], extra: Any, within: float
) -> None:
    expected = integrate(with_extra(extra), START, 0.0, TIME)
    found = evaluated(identifier, values, BASE, TIME).sampled.angle
    effect = np.max(np.abs(expected - plain(BASE, TIME)))
    assert np.max(np.abs(found - expected)) < within * effect


def test_presliding_friction_is_dahls() -> None:
    """With Dahl's own equation integrated beside the motion, from the same contact."""
    k_d, z_c = 1e-2, 0.02
    found = evaluated("presliding-friction", (k_d, z_c), BASE, TIME)
    motion = found.sampled.motion
    swing = math.exp(-abs(float(motion.angle[0, 0] - motion.angle[0, -1])) / z_c)
    contact = z_c * (1.0 - swing) / (1.0 + swing)

    def law(t: float, state: Floats, direction: float, turn: float) -> float:
        return eq8(state, direction) - OMEGA**2 * k_d * state[2]

    expected = integrate(
        law,
        START,
        0.0,
        TIME,
        more=(contact,),
        more_rates=lambda t, state: [state[1] - abs(state[1]) * state[2] / z_c],
    )
    assert np.max(np.abs(found.sampled.angle - expected)) < 1e-5 * START
