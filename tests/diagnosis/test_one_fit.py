"""Fit, diagnosis and simulation mean one law, and tell one noise: that of a reading."""

import math
from collections.abc import Callable

import numpy as np
import pytest

import pendpipe as pp
from pendpipe.arrays import FloatArray
from pendpipe.dynamics import Eq8, Release, sample
from pendpipe.dynamics.eq8 import Drag, Restoring
from pendpipe.simulation.model import read_model, simulate

HERTZ = 0.87


def simulated(
    rate_hz: float = 50.0,
    seed: int = 1,
    amplitude: float = 1.0,
    restoring: Restoring = "sine",
    drag: Drag = "energy",
    effects: tuple[str, ...] = (),
    **losses: float,
) -> "pp.Recording":
    """160 s of a pendulum with white noise of 100 urad."""
    described = {
        "seed": seed,
        "noise_rad": 1e-4,
        "pendulum": {
            "frequency_hz": HERTZ,
            "release_angle_rad": amplitude,
            "restoring": restoring,
            "drag": drag,
            **(losses or {"quality_factor_hysteretic": 200.0}),
        },
        "sampling": {"sample_rate_hz": rate_hz, "duration_s": 160.0},
        "effects": [{"id": each} for each in effects],
    }
    return simulate(read_model(described))


def judged(recording: "pp.Recording") -> "tuple[pp.FitResult, dict]":  # type: ignore[type-arg]
    return pp.fit(recording), pp.diagnose(recording).to_dict()


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize(("restoring", "effects"), [("sine", ()), ("linear", ("circular-error",))])
def test_nothing_is_missing_from_a_pendulum_with_hysteretic_loss(
    seed: int, restoring: Restoring, effects: tuple[str, ...]
) -> None:
    """By the compiled engine and by the general one: Q 200, 1 rad, as both have it."""
    fit, answer = judged(simulated(seed=seed, restoring=restoring, effects=effects))
    assert fit.light == "green"
    assert answer["verdict"] == "consistent"
    truth = {"a": 0.0, "b": math.pi * HERTZ / 200.0, "c": 0.0}
    for name, value in truth.items():
        low, high = fit[name].bounds95
        assert low - 2.0 * fit[name].sd <= value <= high + 2.0 * fit[name].sd


@pytest.mark.parametrize("rate_hz", [45.0, 60.0, 120.0, 500.0])
def test_the_noise_is_that_of_a_reading_whatever_was_averaged(rate_hz: float) -> None:
    fit, answer = judged(simulated(rate_hz, amplitude=0.1))
    left = answer["baseline"]
    # Of n readings the rms is good to 1 part in the root of 2 n.
    within = 4.0 / math.sqrt(2.0 * 160.0 * rate_hz)
    assert answer["noise_rms_rad"] == pytest.approx(1e-4, rel=within)
    assert answer["noise_rms_rad"] == fit.noise_rms_rad
    assert left["residual_rms_rad"] == pytest.approx(1e-4, rel=within)
    assert left["chi2_per_dof"] == pytest.approx(1.0, abs=2.0 * within)


@pytest.mark.parametrize("rate_hz", [45.0, 120.0])
def test_so_it_is_beside_an_effect(rate_hz: float) -> None:
    plain = simulated(rate_hz, amplitude=0.1)
    angle = plain.values + 0.5 * plain.values**2
    answer = pp.diagnose(pp.Recording(time_s=plain.time_s, angle_rad=angle)).to_dict()
    missing = [each["id"] for each in answer["effects"] if not each["presumed"]]
    assert missing[0] == "sensor-quadratic"
    for number in (answer["noise_rms_rad"], answer["improved"]["residual_rms_rad"]):
        assert number == pytest.approx(1e-4, rel=0.03)


def test_a_drag_that_follows_the_speed_is_fitted_and_presumed() -> None:
    fit, answer = judged(simulated(drag="speed", a=0.02, quality_factor_viscous=400.0))
    assert fit.drag_form == answer["drag_form"] == "speed"
    presumed = [each["id"] for each in answer["effects"] if each["presumed"]]
    assert presumed == ["circular-error", "drag-form"]
    assert answer["verdict"] == "consistent"
    assert abs(fit["a"].value - 0.02) < 4.0 * fit["a"].sd


@pytest.mark.parametrize(
    "spoilt",
    [
        lambda time_s, angle: (time_s + 2e-5 * time_s**2, angle),  # fitted to turning points
        lambda time_s, angle: (time_s, angle + 2e-5 * time_s),  # fitted with a zero that drifts
        lambda time_s, angle: (time_s, np.where(time_s > 80.0, 0.9 * angle, angle)),  # to a part
        lambda time_s, angle: (time_s, np.where(time_s == time_s[900], angle + 0.1, angle)),
    ],
    ids=["clock", "zero", "gain", "glitch"],
)
def test_what_is_found_never_leaves_more_of_the_readings_than_was_left_without_it(
    spoilt: Callable[[FloatArray, FloatArray], tuple[FloatArray, FloatArray]],
) -> None:
    plain = simulated(20.0, amplitude=0.3)
    found = pp.diagnose(pp.Recording(*spoilt(plain.time_s, plain.values), "angle_rad"))
    assert found.improved.residual_rms_rad <= found.baseline.residual_rms_rad


def test_a_position_is_diagnosed_as_l_sin_x() -> None:
    """Read as x it has another torque; the angle of its fit lacks nothing."""
    omega, time_s = 5.0, np.arange(0.0, 60.0, 0.01)
    law = Eq8(omega, 0.02, 0.004, 0.006, 1e-3, restoring="sine")
    noise = 1e-5 * np.random.default_rng(1).standard_normal(len(time_s))
    position = 9.80665 / omega**2 * np.sin(sample(law, Release(-0.2, 0.5), time_s)) + noise
    recording = pp.Recording(time_s, position, "displacement_m")
    found = pp.diagnose(recording, restoring="sine")
    assert (found.verdict, found.restoring) == ("consistent", "sine")
    assert abs(found.baseline.parameters["frequency"].value - 0.5 * omega / math.pi) < 1e-6
