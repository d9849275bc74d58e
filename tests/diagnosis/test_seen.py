"""What is seen of a misfit, whatever its cause: its part, its place and its size."""

import json
import math

import numpy as np
import pytest

from pendpipe.arrays import FloatArray
from pendpipe.diagnosis.refine import Fit, refine
from pendpipe.diagnosis.seen import Seen, seen_of
from pendpipe.effects.catalogue import by_identifier
from pendpipe.effects.model import Model
from pendpipe.estimate import Estimate

from .records import (
    FREQUENCY_HZ,
    INSTANT_S,
    INTERVAL_S,
    TIME_S,
    TRUTH,
    diagnosed,
    other_engine,
    prepared,
    white,
)


def compared(readings: FloatArray, fitted: Model, start: FloatArray) -> tuple[Fit, Fit, tuple]:
    """Eq. 8, a model that stays in step, and the readings with their noise."""
    data, noise = prepared(readings + white(3))
    bare = refine(Model(TIME_S, INTERVAL_S), data, noise, TRUTH)
    return bare, refine(fitted, data, noise, start), (data, noise)


def seen(
    identifier: str, values: tuple[float, ...], *, instant_s: float | None = None
) -> tuple[Seen, ...]:
    model = Model(TIME_S, INTERVAL_S, (by_identifier(identifier),))
    truth = np.append(TRUTH, values)
    before, after, readings = compared(model.reading(truth), model, truth)
    at = None if instant_s is None else (instant_s - 0.1, instant_s + 0.1)
    return seen_of(before, after, *readings, instant_s=at)


@pytest.mark.parametrize("kappa", [0.1, -0.3])
def test_a_cubic_torque_changes_the_frequency_by_three_eighths_of_its_share(kappa: float) -> None:
    """X + kappa x^3: df/f = 3/8 kappa (y2^2 - y1^2), to 3 % (means over windows)."""
    (found, *_) = seen("cubic-stiffness", (kappa,))
    first, last = found.amplitude_rad
    assert first > last
    expected = 3.0 / 8.0 * kappa * (last**2 - first**2)
    assert found.part == "frequency"
    assert found.size.value == pytest.approx(expected, abs=0.05 * abs(expected) + 3 * found.size.sd)
    assert f"the frequency {'falls' if kappa > 0.0 else 'rises'} by " in found.clause
    assert "° to " in found.clause


@pytest.mark.parametrize(
    ("identifier", "rate", "part", "within"),
    [
        ("clock-drift", 3e-5, "frequency", 0.05),
        ("clock-drift", -2e-4, "frequency", 0.05),
        ("offset-drift", 1e-5, "offset", 0.0),
    ],
)
def test_a_clock_or_an_offset_that_drifts_shows_the_change_by_its_rate(
    identifier: str, rate: float, part: str, within: float
) -> None:
    """Kappa tau (1 - e^(-t/tau)), straight: kappa (t2 - t1) on the recording's own stamps."""
    (found, *_) = seen(identifier, (rate, 1e6))
    assert found.part == part
    change = rate * float(np.diff(found.time_s)[0])
    error = within * abs(change) or 3.0 * found.size.sd
    assert found.size.value == pytest.approx(change, abs=error)


def test_a_loss_is_compared_with_that_of_the_fitted_law_in_the_same_window() -> None:
    model = Model(TIME_S, INTERVAL_S, (by_identifier("damping-drift"),))
    truth = np.append(TRUTH, [1e-4, 1e6])
    before, after, readings = compared(model.reading(truth), model, truth)
    (found, *_) = seen_of(before, after, *readings)
    lost = [
        -float(np.diff(np.log(np.interp(found.time_s, TIME_S, fit.at.sampled.amplitude)))[0])
        for fit in (after, before)
    ]
    expected = lost[0] / lost[1] - 1.0
    assert found.part == "loss"
    assert abs(expected) > 5.0 * found.size.sd
    assert found.size.value == pytest.approx(expected, abs=4.0 * found.size.sd)
    assert ("larger" if expected > 0.0 else "smaller") in found.clause


def test_a_bent_sensor_makes_a_harmonic_of_its_size() -> None:
    """s_3 x^3 makes s_3 y^3/4 of the third harmonic, which falls with the amplitude."""
    (found, *_) = seen("sensor-cubic", (0.5,))
    high, low = found.amplitude_rad
    assert found.part == "waveform"
    assert 0.125 * low**3 < found.size.value + 2.0 * found.size.sd
    assert found.size.value - 2.0 * found.size.sd < 0.125 * high**3
    assert found.clause.startswith("harmonic 3 is off by ")


def test_a_line_is_seen_at_its_frequency_and_the_fifth_harmonic_as_such() -> None:
    for hertz, says in ((6.1, "a line of 300"), (5.0 * FREQUENCY_HZ, "harmonic 5 is off by 300")):
        tone = 3e-4 * np.cos(2.0 * math.pi * hertz * TIME_S)
        model = Model(TIME_S, INTERVAL_S, (by_identifier("tone-pickup"),))
        start = np.append(TRUTH, [3e-4, 0.0, hertz])
        before, after, readings = compared(other_engine(TRUTH) + tone, model, start)
        (found, *_) = seen_of(before, after, *readings)
        assert found.part == "between"
        assert found.size.value == pytest.approx(3e-4, rel=0.1)
        assert found.clause.startswith(says[:-3])
        # Between two harmonics that are near a cycle takes it for both.
        known = Estimate(hertz, 1e-4, "Hz")
        (line,) = seen_of(before, after, *readings, line_hz=known)
        assert line.size.value == pytest.approx(3e-4, abs=3.0 * line.size.sd)


@pytest.mark.parametrize(
    ("identifier", "values", "part", "size"),
    [
        ("amplitude-step", (0.02, INSTANT_S), "amplitude", 0.02),
        ("offset-step", (6e-4, INSTANT_S), "offset", 6e-4),
        ("dropped-samples", (0.01, INSTANT_S), "phase", 0.01 * 2.0 * math.pi * FREQUENCY_HZ),
    ],
)
def test_what_happens_at_once_is_a_jump_of_its_size(
    identifier: str, values: tuple[float, ...], part: str, size: float
) -> None:
    (found,) = seen(identifier, values, instant_s=INSTANT_S)
    assert found.part == part
    assert found.size.value == pytest.approx(size, abs=3.0 * found.size.sd + 0.05 * size)
    assert found.clause.startswith(f"at {INSTANT_S}")


def test_noise_shows_nothing() -> None:
    """Over ten recordings of Eq. 8 the level of 1 % for each part lets one through at most."""
    told = 0
    for seed in range(10):
        data, noise = prepared(other_engine(TRUTH) + white(seed))
        fit = refine(Model(TIME_S, INTERVAL_S), data, noise, TRUTH)
        told += bool([each for each in seen_of(fit, fit, data, noise) if each.part != "between"])
    assert told <= 1


def test_the_answer_begins_with_what_is_seen() -> None:
    outcome = diagnosed("sensor-cubic")
    content = json.loads(json.dumps(outcome.to_dict()))
    (first, *_) = content["seen"]
    assert first["part"] == "waveform"
    assert content["summary"]["headline"].startswith(first["clause"])
    assert content["summary"]["sentence"][1:].lower().startswith(first["clause"].lower())
    assert content["left"] == []


def test_a_pendulum_that_lacks_nothing_shows_nothing() -> None:
    outcome = diagnosed("null")
    assert (outcome.seen, outcome.left) == ((), ())
