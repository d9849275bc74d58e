"""Motions that real apparatus makes, from the recording to the fit, by another integrator."""

import math
import re

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import pendpipe
from pendpipe.arrays import FloatArray
from pendpipe.recording import Recording

from .test_decrement import OMEGA, pendulum, recorded

TIME = np.arange(0.0, 80.0, 0.01)
LOSSES = {"quadratic": 0.02, "viscous": 0.02, "coulomb": 0.004}


def fitted(values: FloatArray, rms: float = 1e-3, time: FloatArray = TIME) -> "pendpipe.FitResult":
    return pendpipe.fit(recorded(values, time, rms))


def viscous(angle: float, speed: float, loss: float, linear: bool = False) -> FloatArray:
    """A viscous pendulum, x'' = -omega^2 sin x - 2 loss x', or a wheel with x for sin x."""

    def motion(_: float, state: FloatArray) -> list[float]:
        x, v = state
        return [v, -(OMEGA**2) * (x if linear else math.sin(x)) - 2.0 * loss * v]

    found = solve_ivp(motion, (0.0, TIME[-1]), [angle, speed], t_eval=TIME, rtol=1e-10, atol=1e-12)
    return np.asarray(found.y[0])


def holds(result: "pendpipe.FitResult", name: str, value: float) -> bool:
    return abs(result[name].value - value) < 4.0 * result[name].sd


def test_a_pendulum_thrown_over_the_top_is_fitted_where_it_swings() -> None:
    values = viscous(0.1, 13.0, 0.04)
    assert values[-1] > 2.0 * math.pi - 0.5
    result = fitted(values)
    assert result.cuts[0]["reason"] == "it went over the top before it settled"
    assert (result.restoring, result.light) == ("sine", "green")
    assert holds(result, "b", 0.04)
    assert holds(result, "frequency", 0.5 * OMEGA / math.pi)


@pytest.mark.parametrize("wound", [1.0, 4.0, 40.0])
def test_a_torsion_wheel_has_no_sine_however_far_it_turns(wound: float) -> None:
    result = fitted(viscous(wound, 0.0, 0.03, linear=True), rms=2e-3)
    assert (result.restoring, result.light) == ("linear", "green")
    assert holds(result, "b", 0.03)


@pytest.mark.parametrize("quality", [1.8, 2.2, 3.0, 4.0])
@pytest.mark.parametrize("torque", ["linear", "sine"])
def test_a_brake_leaves_few_half_cycles_and_they_tell_law_and_loss(
    quality: float, torque: str
) -> None:
    """The wheel of every teaching laboratory, and a vane in oil: some six half cycles."""
    loss = 0.5 * OMEGA / quality
    result = fitted(viscous(1.5, 0.0, loss, linear=torque == "linear"), rms=2e-3)
    # Too few turning points may be left to check the numbers by: amber, with right numbers.
    assert result.restoring == torque
    assert result.light != "red"
    assert holds(result, "b", loss)
    assert holds(result, "frequency", 0.5 * OMEGA / math.pi)


def test_sin_x_is_refused_beyond_pi() -> None:
    wheel = recorded(viscous(4.0, 0.0, 0.03, linear=True), TIME, 2e-3)
    for method in ("waveform", "turning-points"):
        with pytest.raises(pendpipe.InputError, match="below pi rad"):
            pendpipe.fit(wheel, restoring="sine", method=method)  # type: ignore[arg-type]


@pytest.mark.parametrize("stop", [11.0, 14.3])
def test_a_gap_in_a_decay_loses_nothing_but_its_readings(stop: float) -> None:
    values = pendulum(1.2, TIME, **LOSSES)
    keep = np.abs(TIME - 0.5 * (10.0 + stop)) > 0.5 * (stop - 10.0)
    result = fitted(values[keep], time=TIME[keep])
    assert (result.restoring, result.light) == ("sine", "green")
    assert result["amplitude"].value == pytest.approx(1.2, abs=2e-3)
    assert result["frequency"].value == pytest.approx(0.5 * OMEGA / math.pi, rel=1e-4)


def test_sides_that_differ_are_analysed_and_not_refused() -> None:
    """It swings against a cushion: stiffer by 1.8 on one side, half periods of 0.63 and 0.47 s."""

    def motion(_: float, state: FloatArray) -> list[float]:
        x, v = state
        return [v, -(OMEGA**2) * x * (1.0 if x > 0.0 else 1.8) - 0.06 * v]

    found = solve_ivp(motion, (0.0, 80.0), [0.3, 0.0], t_eval=TIME, rtol=1e-9, atol=1e-11)
    result = fitted(found.y[0])
    # No law here swings so, and yet period and loss are right.
    assert result.light != "red"
    assert result.fit_p_value < 1e-3
    assert result["b"].value == pytest.approx(0.03, rel=0.1)
    period = math.pi / OMEGA * (1.0 + math.sqrt(1.0 / 1.8))
    assert result["frequency"].value == pytest.approx(1.0 / period, rel=1e-3)


def test_two_coupled_pendulums_are_named_with_their_modes() -> None:
    one, other = (viscous(0.05, 0.0, loss, linear=True) for loss in (0.02, 0.02))
    time = TIME * 1.07  # the second is 7 % slower
    other = np.interp(TIME, time, other)
    result = fitted(one - other)
    assert result.light == "red"
    assert result.light_reason.startswith("two modes beat: ")
    found = sorted(map(float, re.findall(r"([0-9.]+) Hz", result.light_reason)))
    truth = 0.5 * OMEGA / math.pi
    assert found == pytest.approx([truth / 1.07, truth], rel=1e-4)


def test_a_decay_that_is_slow_and_loud_is_measured() -> None:
    # 8 % in 64 cycles, the amplitude 7.8 times the noise of a reading.
    loss = -math.log(0.92) / TIME[-1]
    result = fitted(0.1 * np.exp(-loss * TIME) * np.cos(OMEGA * TIME), rms=0.1 / 7.8)
    assert result.light == "amber"
    y = result["amplitude"].value
    rates = [result[name].value for name in "abc"] @ np.array([y, 1.0, 1.0 / y])
    assert rates == pytest.approx(loss, rel=0.25)


def test_readings_of_noise_and_of_a_motor_are_refused_each_for_its_reason() -> None:
    steady = 0.1 * np.cos(OMEGA * TIME)
    beats = steady + viscous(0.1, 0.0, 0.05, linear=True) * np.cos(0.3 * TIME)
    for values, said in ((steady, "too slow to be resolved"), (beats, "a drive holds")):
        with pytest.raises(pendpipe.InputError, match=said):
            pendpipe.fit(Recording(TIME, values + 1e-3 * np.sin(1e4 * TIME**2), "angle_rad"))
