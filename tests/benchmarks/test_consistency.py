"""Clean recordings of the law: they are what the engine says, and what is asked of them holds."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from benchmarks.consistency import FEWEST_CYCLES, KINDS, Truth, draw, judge, recorded

from pendpipe.dynamics import Eq8, Release, sample


def truth(kind: str, amplitude: float, *, speed: bool = False) -> Truth:
    """Q of 60, noise far below the integrator's error."""
    drawn, share = draw(0, 1), np.full(4, 0.25) if kind == "all" else np.eye(4)[KINDS.index(kind)]
    a, hysteretic, viscous, c = (0.5 * drawn.omega / 60.0 * share).tolist()
    return replace(
        drawn,
        sine=True,
        speed=speed,
        kind=kind,
        amplitude=amplitude,
        a=a / amplitude,
        hysteretic=hysteretic,
        viscous=viscous,
        c=c * amplitude,
        quality=60.0,
        noise=1e-9 * amplitude,
        per_cycle=40.0,
        cycles=6.0,
    )


@pytest.mark.parametrize("amplitude", [0.1, 1.0, 2.5])
@pytest.mark.parametrize(
    ("kind", "speed"), [*((kind, False) for kind in KINDS), ("a", True), ("all", True)]
)
def test_the_engine_moves_as_an_independent_integrator(
    kind: str, speed: bool, amplitude: float
) -> None:
    one = truth(kind, amplitude, speed=speed)
    time, values = recorded(one, 1)
    drag: Any = "speed" if speed else "energy"
    rates = (one.omega, one.a, one.hysteretic, one.viscous, one.c)
    law = Eq8(*rates, restoring="sine", drag=drag)
    expected = sample(law, Release(0.0, amplitude, one.offset), time)
    assert np.max(np.abs(values - expected)) < 1e-8 * amplitude


def test_what_is_drawn_lies_in_the_ranges_that_are_asked_for() -> None:
    drawn = [draw(number, 7) for number in range(60)]
    assert all(each.quality >= 5.0 and 0.01 <= each.amplitude <= 2.5 for each in drawn)
    assert all(1e-6 <= each.noise / each.amplitude <= 1e-2 for each in drawn)
    assert all(FEWEST_CYCLES <= each.cycles <= 1000.0 for each in drawn)
    assert {each.kind for each in drawn} == set(KINDS)


def test_a_recording_is_judged_by_what_was_hidden() -> None:
    found = judge(truth("b viscous", 0.5), 1, diagnose=False)
    assert (found.light, found.refused, found.restoring) == ("green", "", "sine")
    assert found.decidable


@pytest.mark.parametrize(("number", "seed"), [(71, 1), (130, 1), (145, 2), (185, 2)])
def test_a_perfect_recording_lacks_nothing(number: int, seed: int) -> None:
    """Means across turning points, where friction jumps, or over a third harmonic had names.

    They were glitches, clipping, and a camera's geometry.
    """
    assert judge(draw(number, seed), seed, diagnose=True).names == ()
