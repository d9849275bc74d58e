"""A record down to small amplitudes, whose first swings the baseline cannot follow."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from pendpipe.arrays import FloatArray
from pendpipe.diagnosis.data import Data
from pendpipe.diagnosis.large_first import large_first
from pendpipe.diagnosis.progressive_window import progressive_start
from pendpipe.diagnosis.refine import refine
from pendpipe.diagnosis.state import State, first_noise, is_gross
from pendpipe.dynamics.any_law import NoMotionError
from pendpipe.effects.baseline import OMEGA, B
from pendpipe.effects.catalogue import by_identifier
from pendpipe.effects.catalogue.restoring import circular_error
from pendpipe.effects.model import Model
from pendpipe.recording import Recording

from .records import TRUTH, beginning_of, other_engine, recording

RATE_HZ, NOISE_RAD, LINEAR, OMEGA_TRUE, RELEASE_RAD = 15.0, 1e-3, 0.03, 6.1, 1.3
TIME_S = np.arange(1500) / RATE_HZ


def wide_swings() -> FloatArray:
    """Solve x'' + omega^2 sin x + 2 b x' = 0 from 1.3 rad down to a twentieth of it."""

    def rate(_: float, state: FloatArray) -> list[float]:
        x, v = state
        return [v, -(OMEGA_TRUE**2) * math.sin(x) - 2.0 * LINEAR * v]

    begin = [RELEASE_RAD, 0.0]
    solved = solve_ivp(rate, (0.0, TIME_S[-1]), begin, "DOP853", t_eval=TIME_S, rtol=1e-10)
    return np.asarray(solved.y[0] + NOISE_RAD * np.random.default_rng(4).standard_normal(1500))


def searching(record: Recording, guess: float = 1.0) -> tuple[State, list[int]]:
    """Search with circular error alone; and over how many readings it was asked for.

    The noise is guessed too large by a factor, as lost samples make it.
    """
    beginning = beginning_of(record)
    beginning = replace(beginning, noise_rms=guess * beginning.noise_rms)
    noise = first_noise(beginning)
    fit = refine(beginning.model, beginning.data, noise, beginning.value)
    state = State(fit, beginning.data, noise, [], beginning.value, fit.value)
    asked: list[int] = []

    def add_circular_error(part: State) -> bool:
        asked.append(len(part.data))
        if part.fit.model.effects:
            return False
        model = part.fit.model.adding(circular_error)
        start = np.append(beginning.value, 1.0)
        try:
            value = progressive_start(model, part.data, part.noise.white_rms, start)
        except NoMotionError:
            return False
        part.settle(refine(model, part.data, part.noise, value))
        return True

    large_first(beginning, state, add_circular_error)
    return state, asked


@pytest.mark.parametrize("guess", [1.0, 2.5])
def test_the_noise_is_what_the_model_leaves_and_not_what_was_guessed(guess: float) -> None:
    state, _ = searching(Recording(TIME_S, wide_swings(), "angle_rad"), guess)
    sd = NOISE_RAD / math.sqrt(2.0 * len(TIME_S))
    assert state.noise.white_rms == pytest.approx(NOISE_RAD, abs=4.0 * sd)
    assert state.fit.chi2 / state.data.used == pytest.approx(1.0, abs=0.15)


def test_what_rules_the_large_amplitudes_is_found_there_and_followed_to_the_end() -> None:
    state, asked = searching(Recording(TIME_S, wide_swings(), "angle_rad"))
    assert asked[0] < 0.8 * len(TIME_S)
    assert [effect.identifier for effect in state.fit.model.effects] == ["circular-error"]
    assert len(state.data) > 0.9 * len(TIME_S)
    assert state.fit.chi2 / state.data.used == pytest.approx(1.0, abs=0.15)
    covariance = state.fit.covariance()
    for index, truth in ((OMEGA, OMEGA_TRUE), (B, LINEAR)):
        assert abs(state.fit.value[index] - truth) < 5.0 * math.sqrt(covariance[index, index])


def test_a_record_that_the_baseline_explains_is_searched_as_a_whole() -> None:
    state, asked = searching(recording(other_engine(TRUTH), 2))
    assert not is_gross(state.fit, state.data)
    assert asked == []


def test_a_record_of_large_amplitudes_alone_is_searched_as_a_whole() -> None:
    """A quarter of it, over which the swing falls to half."""
    quarter = slice(0, len(TIME_S) // 4)
    state, asked = searching(Recording(TIME_S[quarter], wide_swings()[quarter], "angle_rad"))
    assert is_gross(state.fit, state.data)
    assert asked == []


def test_readings_that_were_cut_off_since_do_not_disturb_the_baseline() -> None:
    """What lies behind a stop may be left out for good: the baseline goes as far as the model."""
    from pendpipe.diagnosis.search import _baseline_alone

    begun = beginning_of(recording(other_engine(TRUTH), 4))
    data = begun.data.first(1200)
    model = begun.model.at_times(data.time_s)
    noise = first_noise(replace(begun, data=data, model=model))
    drift = by_identifier("frequency-drift")
    start = np.append(begun.value, [0.0, 1e7])
    fit = refine(model.adding(drift), data, noise, start, held=begun.held)
    state = State(fit, data, noise, list(begun.held), begun.value, begun.value)
    baseline = _baseline_alone(state, begun)
    assert len(baseline.at.reading) == 1200
    assert baseline.chi2 == pytest.approx(fit.chi2, abs=12.0)


@pytest.mark.parametrize("found", [False, True])
def test_a_search_that_is_not_taken_leaves_the_record_whole(
    found: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The end can't be followed, and nothing is found, or nothing better over the rest."""
    beginning = beginning_of(Recording(TIME_S, wide_swings(), "angle_rad"))
    noise = first_noise(beginning)
    fit = refine(beginning.model, beginning.data, noise, beginning.value)
    only_the_end = np.where(np.arange(len(fit.residual)) > 0.99 * len(fit.residual), 1e3, 0.0)
    fit = replace(fit, evaluation=replace(fit.evaluation, residual=only_the_end))
    state = State(fit, beginning.data, noise, [], beginning.value, fit.value)
    followed: list[int] = []

    def not_to_the_end(model: Model, data: Data, *given: Any, **named: Any) -> FloatArray:
        if len(data) == len(beginning.data) or followed:
            followed.append(len(data))
        if len(data) == len(beginning.data):
            raise NoMotionError("it stops")
        return progressive_start(model, data, *given, **named)

    def add_circular_error(part: State) -> bool:
        if not found or part.fit.model.effects:
            return False
        model = part.fit.model.adding(circular_error)
        start = np.append(beginning.value, 1.0)
        part.settle(
            refine(
                model, part.data, part.noise, progressive_start(model, part.data, NOISE_RAD, start)
            )
        )
        return True

    monkeypatch.setattr("pendpipe.diagnosis.large_first.progressive_start", not_to_the_end)
    large_first(beginning, state, add_circular_error)
    assert followed[1] < followed[0] == len(beginning.data)
    assert len(state.data) == len(state.noise.weight) == len(beginning.data)
    assert state.fit is fit
