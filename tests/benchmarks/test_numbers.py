"""The judge of quoted numbers knows truths of closed form, and what is wrong."""

import math
from typing import Any

import numpy as np
import pytest
from benchmarks.numbers import Count, Decay, pull, quoted_by_diagnosis, truths

from pendpipe_challenge.motion import Motion
from pendpipe_challenge.torques import BOOK
from pendpipe_challenge.world import Cause, Scene

OMEGA = 5.0


def scene(a: float = 0.0, viscous: float = 0.0, hysteretic: float = 0.0, c: float = 0.0) -> Scene:
    """Sixty seconds from half a second after the release at 0.5 rad."""
    return Scene(
        apparatus="wheel",
        frequency_hz=OMEGA / (2 * math.pi),
        rates=(a, viscous, hysteretic, c),
        amplitude=0.5,
        lead_s=0.5,
        offset=0.0,
        noise_rms=1e-3,
        step=0.0,
        time_s=np.linspace(0.0, 60.0, 3001),
    )


def acting(**parameters: float) -> list[Cause]:
    """A cause that sets parameters of the motion."""
    return [Cause("some", lambda world, size: world.add("omega", 0.0 * size, **parameters), 1.0)]


def true(quantity: str, at: Scene, causes: list[Cause], amplitude: float = 0.2) -> float:
    return float(truths(at, causes, [(quantity, amplitude)])[0])


@pytest.mark.parametrize(
    ("quantity", "closed"),
    [
        ("T0", 2 * math.pi / OMEGA),
        ("Q", OMEGA / (2 * 0.04)),
        ("1/2", math.log(2) / 0.04),
        ("1/e", 1 / 0.04),
        ("a", 0.0),
        ("b", 0.04),
        ("c", 0.0),
    ],
)
def test_a_harmonic_oscillator_with_viscous_loss(quantity: str, closed: float) -> None:
    assert true(quantity, scene(viscous=0.04), []) == pytest.approx(closed, rel=2e-5, abs=1e-12)


@pytest.mark.parametrize("amplitude", [0.5, 0.49, 0.01])
def test_a_decay_is_known_from_its_first_turning_point_on(amplitude: float) -> None:
    at = scene(viscous=0.04)
    assert true("Q", at, [], amplitude) == pytest.approx(62.5, rel=2e-5)
    assert true("1/2", at, [], amplitude) == pytest.approx(math.log(2) / 0.04, rel=2e-5)


def test_dry_friction_takes_as_much_of_each_half_swing() -> None:
    at = scene(c=0.002)
    assert true("c", at, []) == pytest.approx(0.002, rel=1e-9)
    assert true("1/2", at, []) == pytest.approx(0.1 / 0.002, rel=1e-4)
    # ln of a straight line's fall over a cycle, in whose middle is 0.2 rad.
    fall = 0.002 * math.pi / OMEGA
    assert true("Q", at, []) == pytest.approx(
        math.pi / math.log((0.2 + fall) / (0.2 - fall)), rel=2e-5
    )


@pytest.mark.parametrize(
    ("what", "factor"),
    [
        ({"sine": 1.0}, 1.0),
        ({"cubic": 0.5}, 1.0),
        ({"sided": 0.2}, 1.0),
        ({"book": BOOK["magnet-below"], "book_size": 0.1, "book_shape": 0.1}, 1.1**-0.5),
        ({"book": BOOK["cogging"], "book_size": 1.0, "book_shape": 10.0}, 1.4**-0.5),
        # The mean over the recording.
        ({"omega_drift": 1e-4}, 1 / 1.003),
        ({"omega_jump": 4e-3, "omega_jump_at": 30.0}, 1 / 1.002),
        # What pushes and what brakes is no spring.
        ({"drive": 0.5, "drive_omega": 6.0}, 1.0),
        ({"rayleigh": 0.1, "stribeck": 0.1, "parametric": 0.02}, 1.0),
    ],
)
def test_the_period_is_that_of_small_swings_by_the_whole_torque(
    what: dict[str, float], factor: float
) -> None:
    found = true("T0", scene(viscous=0.04), acting(**what), 0.0)
    assert found == pytest.approx(2 * math.pi / OMEGA * factor, rel=1e-6 if factor == 1 else 2e-5)


def test_a_clock_that_drifts_is_a_period_that_drifts() -> None:
    causes = [Cause("clock-drift", lambda w, size: w.clock.append(lambda t: size * t), 0.01)]
    assert true("T0", scene(), causes, 0.0) == pytest.approx(2 * math.pi / OMEGA / 1.01, rel=1e-6)


@pytest.mark.parametrize("what", [{"play": 0.01}, {"dahl": 0.01}, {"coupling": 0.1, "second": 1.0}])
def test_small_swings_of_another_spring_have_no_period(what: dict[str, float]) -> None:
    assert math.isnan(true("T0", scene(viscous=0.04), acting(**what), 0.0))


def test_a_loss_that_drifts_tells_no_time_beyond_the_recording() -> None:
    drifting = Motion({"omega": OMEGA, "gamma": 0.02, "gamma_drift": 1e-4}, 0.5)
    decay = Decay(drifting, 0.0, 60.0, 0.01)
    assert math.isfinite(decay.time_to(0.8, 0.4))
    assert math.isnan(decay.time_to(0.1, 0.4))


def number(value: float, **more: Any) -> dict[str, Any]:
    """Of an error of 1 about 10, which is true."""
    ends = {"value": value, "low": value - 1.96, "high": value + 1.96, "truth": 10.0}
    return ends | {"withheld": False, "bound": False, "oracle": 0.5, "sure": True} | more


def test_a_wrong_number_counts_as_wrong() -> None:
    found = Count([number(9.0), number(13.0), number(16.0), number(4.0)])
    assert found.held == found.far * 0.5 == 0.25
    assert found.width == pytest.approx(2.0)
    assert pull(number(16.0)) == pytest.approx(-6.0)


def test_an_error_is_that_of_the_interval_on_the_side_of_the_truth() -> None:
    assert pull(number(0.0, low=0.0, high=4.9, truth=10.0)) == pytest.approx(4.0)
    assert pull(number(0.0, low=0.0, high=4.9, truth=0.0)) == 0.0


def test_what_is_withheld_and_what_has_no_truth_are_counted_apart() -> None:
    found = Count([number(10.0), number(90.0, withheld=True), number(1.0, truth=math.nan)])
    assert (found.n, found.held, found.withheld, found.left_out) == (1, 1.0, 0.5, 1)


def test_a_diagnosis_withholds_what_it_says_is_not_to_be_quoted() -> None:
    estimate = {"value": 1.0, "sd": 0.1, "interval95": [0.8, 1.2], "at_bound": False}
    changes = [
        {"quantity": each, "amplitude_rad": None, "fitted": estimate, "with_missing": estimate}
        for each in ("period", "a", "b", "c")
    ]
    summary = {"quote": "T0 1.0(1) s; Q 30(1) at 20°; not a, c", "consequence": changes}
    withheld = {
        each["quantity"]: each["withheld"] for each in quoted_by_diagnosis({"summary": summary})
    }
    assert withheld == {"T0": False, "a": True, "b": False, "c": True}
