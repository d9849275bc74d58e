"""What looked like a fault before the physics was known is tested again with it."""

import functools
from dataclasses import replace

import numpy as np
import pytest

from pendpipe.analysis.turning_points.measure import prepare
from pendpipe.arrays import FloatArray
from pendpipe.diagnosis.detect import Detection
from pendpipe.diagnosis.faults import correct
from pendpipe.diagnosis.forensics import Finder
from pendpipe.diagnosis.hypothesis import Hypothesis, Task, is_gross
from pendpipe.diagnosis.instants import with_better_instants
from pendpipe.diagnosis.noise import white_noise
from pendpipe.diagnosis.refine import refine
from pendpipe.diagnosis.result import Finding
from pendpipe.diagnosis.rivals import NO_SCAN
from pendpipe.diagnosis.run import diagnose_recording
from pendpipe.effects.baseline import OMEGA
from pendpipe.effects.catalogue import by_identifier
from pendpipe.effects.model import Model
from pendpipe.recording import Recording

from .records import (
    INTERVAL_S,
    NOISE_RAD,
    TIME_S,
    TRUTH,
    hypothesis_of,
    other_engine,
    prepared,
    task_of,
    white,
)

LEVEL, ODD = 0.01, 812
NOTHING = Detection((), 1.0, NO_SCAN)


def blamed(error: float, odd: int = ODD) -> tuple[Task, Hypothesis]:
    """A search with the right model, and one reading that was masked as a glitch."""
    readings = other_engine(TRUTH) + white(21)
    # Its own noise taken off: it is wrong by just so much.
    readings[odd] = other_engine(TRUTH)[odd] + error * NOISE_RAD
    data, _ = prepared(readings)
    mask = np.arange(len(readings)) == odd
    data = data.masked(mask)
    noise = white_noise(data, NOISE_RAD)
    fit = refine(Model(TIME_S, INTERVAL_S), data, noise, TRUTH)
    faults = (Finding("glitches", 1e-7, mask=mask),)
    samples = prepare(Recording(TIME_S, readings, "angle_rad"), "the test")
    state = hypothesis_of(fit, data, noise, (), fit, samples, faults=faults, first=NOTHING)
    return task_of(samples), state


@pytest.mark.parametrize("error", [0.5, 3.0, -3.5])
def test_a_reading_that_noise_explains_in_the_end_returns(error: float) -> None:
    task, before = blamed(error)
    state = correct(before, task)
    assert state.faults == ()
    assert state.data.used == len(TIME_S)
    assert np.array_equal(state.noise.weight, state.data.weight)
    # It counts again; and the record is no more suspicious than its tests say now.
    assert state.fit.chi2 > before.fit.chi2 or abs(error) < 1.0
    assert state.p_value > LEVEL


@pytest.mark.parametrize("error", [12.0, -30.0])
def test_a_reading_that_nothing_explains_stays_out_and_is_measured_anew(error: float) -> None:
    task, state = blamed(error)
    state = correct(state, task)
    (fault,) = state.faults
    assert state.data.weight[ODD] == 0.0
    assert state.data.used == len(TIME_S) - 1
    assert fault.p_value < LEVEL
    assert state.p_value == fault.p_value
    largest = fault.parameters["largest"].value
    assert largest == pytest.approx(error * NOISE_RAD, abs=2.0 * NOISE_RAD)


@pytest.mark.parametrize("gains", [(30.0, 300.0), (300.0, 30.0)])
def test_the_finding_that_pays_most_is_applied_first_and_one_that_does_not_pay_never(
    gains: tuple[float, float], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The order in which the tests are declared does not matter."""
    task, begun = blamed(0.0)
    said: list[str] = []
    masks = [np.arange(len(TIME_S)) == row for row in (100, 200)]
    names = ("clipping", "glitches")
    found = [
        Finding(name, 1e-9, gain, mask=mask)
        for name, gain, mask in zip(names, gains, masks, strict=True)
    ]
    found.append(Finding("clock-slips", 1e-9, time_s=TIME_S + 1e-5 * TIME_S, price=1e3))
    finders = tuple(
        Finder(each.identifier, lambda *_, each=each: each, repeats=True) for each in found
    )
    monkeypatch.setattr("pendpipe.diagnosis.faults.FINDERS", finders)
    state = correct(replace(begun, faults=()), replace(task, progress=said.append))
    order = sorted(names, key=lambda name: -gains[names.index(name)])
    assert [fault.identifier for fault in state.faults] == order
    assert [line.split(":")[0] for line in said] == order
    assert np.flatnonzero(state.data.weight == 0.0).tolist() == [100, 200, ODD]


def test_a_test_that_reports_nothing_counts_by_its_chance() -> None:
    """The farther off one reading, the less likely the record, before it is called a glitch."""
    chances = []
    for error in (4.6, 4.8, 5.0):
        task, state = blamed(error)
        data = replace(state.data, weight=np.ones(len(TIME_S)))
        noise = white_noise(data, NOISE_RAD)
        state = correct(replace(state, faults=(), data=data, noise=noise), task)
        assert state.faults == ()
        chances.append(state.p_value)
    assert LEVEL < chances[2] < chances[1] < chances[0] < 1.0
    # As the tail of a normal distribution falls: by six.
    assert chances[2] < 0.25 * chances[0]


def test_glitches_are_masked_before_a_model_that_is_far_off_is_mended() -> None:
    """No other test can judge by such a model; readings apart from their neighbours can."""
    task, right = blamed(0.0)
    readings = right.data.values.copy()
    wild = [300, 801, 1200]
    readings[wild] += 40.0 * NOISE_RAD
    data, _ = prepared(readings)
    noise, off = white_noise(data, NOISE_RAD), TRUTH.copy()
    off[OMEGA] *= 1.01
    fit = refine(right.fit.model, data, noise, off, held=(OMEGA,))
    assert is_gross(fit, data)
    state = correct(hypothesis_of(fit, data, noise, (OMEGA,), fit, right.samples), task)
    (fault,) = state.faults
    assert fault.identifier == "glitches"
    assert np.flatnonzero(state.data.weight == 0.0).tolist() == wild


@functools.cache
def clipped_at(level_rad: float) -> FloatArray:
    return np.minimum(other_engine(TRUTH) + white(5), level_rad)


def test_clipping_is_reported_once() -> None:
    """A nonlinear sensor is tried first; with the clipped readings masked it is not needed."""
    level = 0.9 * float(other_engine(TRUTH).max())
    found = diagnose_recording(Recording(TIME_S, clipped_at(level), "angle_rad"))
    (effect,) = found.effects
    assert effect.identifier == "clipping"
    assert effect.parameters["upper_level"].value == pytest.approx(level, rel=1e-6)
    assert effect.parameters["number"].value == np.count_nonzero(clipped_at(level) == level)
    assert effect.delta_chi2 > 1e3
    assert found.p_value < 1e-6


@pytest.mark.parametrize("off", [-1.2, -0.6, 0.0, 0.7, 1.2])
def test_lost_samples_are_placed_between_the_right_readings(off: float) -> None:
    """A quarter of a cycle lost; the fit is begun `off` intervals from the instant."""
    lost, instant = 0.27, TIME_S[700] + 0.5 * INTERVAL_S
    model = Model(TIME_S, INTERVAL_S, (by_identifier("dropped-samples"),))
    truth = np.concatenate([TRUTH, [lost, instant]])
    data, noise = prepared(model.reading(truth) + white(8))
    start = truth + np.array([*np.zeros(len(TRUTH)), 0.0, off * INTERVAL_S])
    found = with_better_instants(refine(model, data, noise, start), data, noise, ())
    assert found.chi2 / data.used == pytest.approx(1.0, abs=4.0 * np.sqrt(2.0 / data.used))
    assert found.value[-2] == pytest.approx(lost, abs=5e-4)
    # A reading within the jump is the same on both sides of a turning point.
    assert abs(found.value[-1] - instant) < INTERVAL_S
