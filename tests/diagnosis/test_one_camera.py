"""What string pendulums, cameras and slow clocks give: the class holds the cause."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline

from pendpipe.arrays import FloatArray
from pendpipe.diagnosis.run import diagnose_recording
from pendpipe.recording import Quantity, Recording

from ..effects.integration import integrate, swung
from ..effects.test_two_planes import TIME, spherical


def first(
    time_s: FloatArray, values: FloatArray, quantity: Quantity = "angle_rad"
) -> tuple[str, float]:
    """The name beside circular error that is likeliest, and its probability."""
    found = diagnose_recording(Recording(time_s, values, quantity))
    named = [each for each in found.missing if each.identifier != "circular-error"]
    best = max(named, key=lambda each: each.probability)
    return best.identifier, best.probability


def noise(seed: int, count: int, rms: float) -> FloatArray:
    return np.asarray(rms * np.random.default_rng(seed).standard_normal(count))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("along", "across", "stiffer", "axis_rad"),
    [
        pytest.param(0.3, 0.1, 0.0, 0.0, id="an ellipse that turns"),
        pytest.param(0.25, 0.0, 0.02, 0.6, id="two hooks"),
    ],
)
def test_a_string_pendulum_has_a_second_plane(
    along: float, across: float, stiffer: float, axis_rad: float
) -> None:
    readings = spherical(along, across, stiffer, axis_rad)
    name, probability = first(TIME, readings + noise(1, len(TIME), 1e-3))
    assert name == "plane-coupling"
    assert probability > 0.5


@pytest.mark.slow
@pytest.mark.parametrize("jump_s", [2e-3, -3e-3])
def test_a_clock_that_jumps_between_slow_readings_is_no_knock(jump_s: float) -> None:
    """A reading each 361 ms; a knock would have to come just at a turning point."""
    time_s = np.arange(0.0, 180.0, 0.361)
    taken = time_s + jump_s * (time_s > 90.3)
    readings = swung(taken, 0.15, math.pi, 0.004)[0] + noise(2, len(time_s), 5e-5)
    name, probability = first(time_s, readings)
    assert name == "dropped-samples"
    assert probability > 0.8


@pytest.mark.slow
def test_a_rolling_shutter_reads_positions_too() -> None:
    time_s, fine = np.arange(0.0, 60.0, 1.0 / 30.0), np.arange(0.0, 60.2, 1.0 / 300.0)
    length_m, kappa = 9.81 / 3.1**2, 0.05
    place = CubicSpline(fine, length_m * np.sin(swung(fine, 0.25, 3.1, 0.006)[0]))
    seen = place(time_s + kappa * place(time_s)) + noise(3, len(time_s), 3e-4)
    found = diagnose_recording(Recording(time_s, seen, "displacement_m"))
    shutter = next(each for each in found.missing if each.identifier == "rolling-shutter")
    value = shutter.parameters["kappa"]
    assert abs(value.value - kappa) < 4.0 * value.sd


@pytest.mark.slow
@pytest.mark.parametrize(
    ("effect", "frequency_hz"),
    [
        pytest.param("periodic-drive", 0.2121, id="a drive 3 % above resonance"),
        pytest.param("parametric-drive", 0.031, id="a slow change of the stiffness"),
    ],
)
def test_one_force_is_one_cause(effect: str, frequency_hz: float) -> None:
    """Its lines beside the pendulum's own, 0.2053 Hz, are no second plane and no further tones."""
    square, driven = (2.0 * math.pi * 0.2053) ** 2, effect == "periodic-drive"

    def slopes(time: float, state: FloatArray) -> list[float]:
        wave = math.cos(2.0 * math.pi * frequency_hz * time + 0.7)
        stiffness = square * (1.0 + (0.0 if driven else 5e-4 * wave))
        force = 4e-5 * wave if driven else 0.0
        return [state[1], force - stiffness * math.sin(state[0]) - 0.012 * state[1]]

    time_s = np.arange(0.0, 240.0, 0.05)
    solved = solve_ivp(
        slopes, (0.0, 240.0), [0.2, 0.0], "DOP853", t_eval=time_s, rtol=1e-9, atol=1e-11
    )
    readings = solved.y[0] + noise(4, len(time_s), 1.5e-4)
    found = diagnose_recording(Recording(time_s, readings, "angle_rad")).missing
    assert [each.identifier for each in found] == [effect]
    assert found[0].parameters["f_d" if driven else "f_h"].value == pytest.approx(
        frequency_hz, abs=4e-4
    )


@pytest.mark.slow
@pytest.mark.parametrize("family", ["kicks", "hum near the motion", "gain"])
def test_lines_of_one_family_are_one_cause(family: str) -> None:
    """A comb, a fold of 50 Hz within half a beat of the swing, and two side bands."""
    time_s = np.arange(0.0, 240.0, 240.0 / round(240.0 * (50.0 - 0.803) / 2.0))
    kicks = tuple((5.1 + 8.3 * k, 0.0, -0.008) for k in range(29))
    readings = integrate(
        lambda _t, y, _s, _x0: -((2.0 * math.pi * 0.8) ** 2) * math.sin(y[0]) - 0.016 * y[1],
        *(0.18, 0.0, time_s),
        kicks=kicks if family == "kicks" else (),
    )
    if family == "gain":
        readings *= 1.0 + 4e-3 * np.cos(2.0 * math.pi * 0.1 * time_s)
    elif family != "kicks":
        readings += 1.5e-3 * np.cos(2.0 * math.pi * 50.0 * time_s)
    readings += noise(6, len(time_s), 1e-4)
    found = diagnose_recording(Recording(time_s, readings, "angle_rad"))
    assert [each.identifier for each in found.missing] == [
        {"kicks": "periodic-drive", "gain": "gain-drift"}.get(family, "tone-pickup")
    ]
    assert found.missing[0].probability > 0.5
    if family == "kicks":
        assert found.missing[0].parameters["period"].value == pytest.approx(8.3, abs=1e-3)


@pytest.mark.slow
def test_positions_on_an_image_have_a_perspective_and_a_lens() -> None:
    """A camera turned by 0.2 rad at five lengths, with 2 % of distortion at the ends."""
    time_s = np.arange(0.0, 120.0, 1.0 / 30.0)
    place = 9.81 / 4.0**2 * np.sin(swung(time_s, 0.25, 4.0, 0.006)[0])
    seen = place * math.cos(0.2) / (1.0 + place * math.sin(0.2) / 3.0)
    seen *= 1.0 + 0.02 * (seen / 0.15) ** 2
    readings = seen + noise(7, len(time_s), 3e-4)
    assert first(time_s, readings, "displacement_m")[0] == "camera-geometry"


@pytest.mark.slow
def test_an_image_below_a_quarter_turn_is_one_cause() -> None:
    """A pivot beside the pendulum's, seen obliquely about two axes, at 1.2 rad."""
    time_s = np.arange(0.0, 120.0, 0.035)
    x = swung(time_s, 1.2, 2.94, 0.01)[0]
    seen = x + 0.004 * np.cos(x) + 0.004 * np.sin(2.0 * x) - 0.003 * np.cos(2.0 * x)
    recording = Recording(time_s, seen + noise(8, len(x), 5e-4), "angle_rad")
    named = {each.identifier for each in diagnose_recording(recording).missing}
    assert named == {"camera-geometry"}
