"""A name is kept where it explains most of a misfit, or stands apart from what is left."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pendpipe.arrays import FloatArray
from pendpipe.diagnosis import silent
from pendpipe.diagnosis.detect import Lead, detect, prepare
from pendpipe.diagnosis.naming import Rival
from pendpipe.diagnosis.refine import Fit, refine
from pendpipe.diagnosis.remainder import Remainder, remainder_of
from pendpipe.diagnosis.review import (
    credibility,
    credible,
    describe_rest,
    stands_apart,
    withdraw_doubtful,
)
from pendpipe.diagnosis.state import State, Step
from pendpipe.effects.catalogue import by_identifier
from pendpipe.effects.curves import CURVES
from pendpipe.effects.model import Model

from .records import (
    FREQUENCY_HZ,
    INTERVAL_S,
    TIME_S,
    TRUTH,
    VALUES,
    null_fit,
    other_engine,
    prepared,
    white,
    with_effects,
)

LEVEL = 0.01
CHIRP = 1e-3 * np.sin(2.0 * np.pi * (1e-3 * TIME_S) * TIME_S)
"""What no entry explains: a line whose frequency rises from 0 to 0.2 Hz."""


def state_with(readings: FloatArray, name: str) -> State:
    """A search that has come to one name, fitted from near its true values."""
    data, noise = prepared(readings)
    bare = refine(Model(TIME_S, INTERVAL_S), data, noise, TRUTH)
    effect = by_identifier(name)
    start = np.concatenate([bare.value, VALUES[name]])
    fit = refine(Model(TIME_S, INTERVAL_S, (effect,)), data, noise, start)
    gain = bare.chi2 - fit.chi2
    rival = Rival(Lead(effect, (), gain, 1e-12), fit, gain, gain)
    state = State(fit, data, noise, [], TRUTH, bare.value)
    state.steps = [Step((rival,), 1e-9, bare)]
    return state


def tone_at(frequency_hz: float) -> tuple[Fit, State]:
    wave = 4e-4 * np.cos(2.0 * np.pi * frequency_hz * TIME_S)
    data, noise = prepared(other_engine(TRUTH) + wave + white(5))
    model = Model(TIME_S, INTERVAL_S, (by_identifier("tone-pickup"),))
    fit = refine(model, data, noise, np.append(TRUTH, [4e-4, 0.0, frequency_hz]))
    return fit, State(fit, data, noise, [], TRUTH, TRUTH)


@pytest.mark.parametrize(("order", "apart"), [(3.4, True), (2.6, True), (2.0, False), (3.0, False)])
def test_a_line_between_the_harmonics_stands_apart(order: float, apart: bool) -> None:
    """At a harmonic it may be a part of the motion that the model lacks."""
    fit, _ = tone_at(order * FREQUENCY_HZ)
    assert stands_apart(by_identifier("tone-pickup"), fit) == apart


def test_a_drift_does_not_stand_apart() -> None:
    state = state_with(with_effects("frequency-drift") + white(5), "frequency-drift")
    assert not stands_apart(by_identifier("frequency-drift"), state.fit)


@given(gain=st.floats(1.0, 1e5), excess=st.floats(1.0, 1e5), numbers=st.floats(2.0, 300.0))
def test_a_name_that_explains_less_than_most_of_a_misfit_is_not_believed(
    gain: float, excess: float, numbers: float
) -> None:
    step = some_step()
    p_value = credibility(step, Remainder(excess, 2.0, numbers), gain)
    assert 0.0 <= p_value <= 1.0
    if gain < 0.74 * (gain + excess):
        assert p_value == 1.0
    # The more independent numbers it takes off, the rarer by chance.
    assert credibility(step, Remainder(excess, 2.0, 2.0 * numbers), gain) <= p_value


def test_a_name_that_leaves_noise_is_believed() -> None:
    state = state_with(with_effects("sensor-quadratic") + white(5), "sensor-quadratic")
    assert credible(state.steps[0], state, LEVEL)
    before = state.fit
    withdraw_doubtful(state, LEVEL, silent)
    assert state.fit is before
    assert len(state.steps) == 1


def test_a_name_for_a_small_part_of_a_misfit_is_withdrawn() -> None:
    readings = with_effects("frequency-drift") + CHIRP + white(5)
    state = state_with(readings, "frequency-drift")
    assert not credible(state.steps[0], state, LEVEL)
    withdraw_doubtful(state, LEVEL, silent)
    assert state.steps == []
    assert state.fit.model.effects == ()


def test_a_pickup_between_the_harmonics_is_kept_beside_a_misfit() -> None:
    state = state_with(with_effects("tone-pickup") + CHIRP + white(5), "tone-pickup")
    assert remainder_of(state.fit, state.data, state.noise).systematic
    withdraw_doubtful(state, LEVEL, silent)
    assert [step.winner.identifier for step in state.steps] == ["tone-pickup"]


def test_what_is_left_is_drawn_by_the_curve_that_takes_most_of_it() -> None:
    """A sensor whose reading is bent where no polynomial of two terms would bend it."""
    angle = other_engine(TRUTH) - TRUTH[7]
    bent = 4e-4 * np.tanh(angle / 0.02)
    data, noise = prepared(other_engine(TRUTH) + bent + white(6))
    fit = refine(Model(TIME_S, INTERVAL_S), data, noise, TRUTH)
    state = State(fit, data, noise, [], TRUTH, fit.value)
    curves = [curve(fit.at.span) for curve in CURVES]
    detection = detect(prepare(fit, data, noise, curves), fit, seed=1)
    before = remainder_of(fit, data, noise)
    assert describe_rest(state, detection, detection.p_value)
    assert state.steps[-1].winner.lead.effect.kind == "unnamed"
    after = remainder_of(state.fit, state.data, state.noise)
    assert after.excess < 0.2 * before.excess


def some_step() -> Step:
    fit, _, _ = null_fit()
    effect = by_identifier("sensor-quadratic")
    return Step((Rival(Lead(effect, (), 50.0, 1e-9), fit, 50.0, 50.0),), 1e-9, fit)


def test_a_gain_that_is_all_of_the_misfit_is_believed_as_far_as_chance_allows() -> None:
    """Beside two unknown numbers a gain is worth 2 ln(1 + gain/excess) of chi^2, no more."""
    one = credibility(some_step(), Remainder(1.0, 2.0, 2.0), 1e4)
    worth = 2.0 * math.log1p(1e4)
    assert one == pytest.approx(math.erfc(math.sqrt(0.5 * worth)), rel=1e-6)


def test_curves_that_make_it_worse_are_not_drawn(monkeypatch: pytest.MonkeyPatch) -> None:
    """A fit that ends above where it began takes less than nothing off chi^2."""
    from pendpipe.diagnosis import review

    fit, data, noise = null_fit()
    state = State(fit, data, noise, [], TRUTH, fit.value)
    curves = [curve(fit.at.span) for curve in CURVES[:2]]
    worse = [Rival(Lead(curve, (), 0.0, 1.0), fit, -5.0, 0.0) for curve in curves]
    monkeypatch.setattr(review, "refit_leads", lambda *_, **__: worse)
    found = detect(prepare(fit, data, noise, curves), fit, seed=1)
    assert not describe_rest(state, found, 1e-9)
    assert state.fit is fit
