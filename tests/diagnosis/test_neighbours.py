"""Names beside each other: rivals, neighbours, and cycles that were left out."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, strategies as st

from pendpipe.arrays import FloatArray
from pendpipe.diagnosis.held_out import completed, held_out, predicted_worse
from pendpipe.diagnosis.hypothesis import Hypothesis, Step, price
from pendpipe.diagnosis.noise import Noise
from pendpipe.diagnosis.refine import Fit, refine, remainder_of
from pendpipe.diagnosis.rivals import NO_SCAN, Rival, Scale, off_harmonics
from pendpipe.diagnosis.run import diagnose_recording
from pendpipe.diagnosis.search import describing, run_search, shares_a_misfit, simpler
from pendpipe.effects.catalogue import CATALOGUE, by_identifier
from pendpipe.effects.model import Model
from pendpipe.recording import Recording
from pendpipe.score import CHOICE, FURTHER

from ..effects.integration import swung
from .records import (
    FREQUENCY_HZ,
    INTERVAL_S,
    NOISE_RAD,
    TIME_S,
    TRUTH,
    VALUES,
    classes_found,
    diagnosed,
    hypothesis_of,
    null_fit,
    other_engine,
    prepared,
    pulled,
    recording,
    task_of,
    white,
    with_effects,
)

# Of two sets of effects the one with the smaller score is the answer.

CHIRP = 1e-3 * np.sin(2.0 * np.pi * (1e-3 * TIME_S) * TIME_S)
"""What no entry explains: a line whose frequency rises from 0 to 0.2 Hz."""
SCALES = st.builds(
    Scale, st.floats(0.0, 1e6), st.floats(1.0, 1e6), st.just(np.inf) | st.floats(2.0, 1e3)
)


def state_with(readings: FloatArray, *names: str) -> Hypothesis:
    """A search that has added several effects, each from near its true values."""
    data, noise = prepared(readings)
    effects = tuple(by_identifier(name) for name in names)
    bare = refine(Model(TIME_S, INTERVAL_S), data, noise, TRUTH)
    shapes = [
        VALUES.get(each.identifier, np.append(np.zeros(each.sizes), each.shapes(bare.at.span)[0]))
        for each in effects
    ]
    start = np.concatenate([bare.value, *shapes])
    fit = refine(Model(TIME_S, INTERVAL_S, effects), data, noise, start)
    steps = []
    for effect in effects:
        rival = Rival.of(effect, fit, bare.chi2, Scale(fit.chi2), NO_SCAN)
        steps.append(Step((rival,), 1e-9, bare))
    return hypothesis_of(fit, data, noise, (), bare, steps=tuple(steps))


def simplified(state: Hypothesis) -> Hypothesis:
    """Make the best of the moves that lower the score, until none does."""
    while better := [each for each in simpler(state, task_of()) if each.lower > 0.0]:
        best = max(better, key=lambda each: each.lower)
        state = best.settle(best.fit)
    return state


@given(scale=SCALES, behind=st.floats(0.0, 1e6))
def test_what_a_model_loses_grows_with_chi2_and_never_exceeds_it(
    scale: Scale, behind: float
) -> None:
    lost = scale.lost(scale.least + behind)
    assert scale.lost(scale.least) == 0.0
    assert 0.0 <= lost <= behind / scale.unit + 1e-6
    assert scale.lost(scale.least + 2.0 * behind) >= lost
    assert scale.within(lost) == pytest.approx(scale.least + behind, rel=1e-6, abs=1e-6)


@pytest.mark.slow
def test_a_magnet_may_be_a_restoring_torque_without_a_name() -> None:
    """A name that imitates it is never confident, and the curve is of its class."""
    (effect,) = diagnose_recording(recording(pulled(), 5)).effects
    assert "unnamed-restoring" in {
        effect.identifier,
        *(name for name, _ in effect.indistinguishable),
    }
    assert effect.probability < 0.5 or effect.identifier == "unnamed-restoring"


@pytest.mark.parametrize(("a", "told"), [(0.2, True), (0.05, False)])
def test_the_drag_that_a_fit_has_chosen_is_chosen_again(a: float, told: bool) -> None:
    """Of two forms without a value the other is taken where the readings tell them apart."""
    rng, truth = np.random.default_rng(2), TRUTH.copy()
    truth[0] = a
    energy = Model(TIME_S, INTERVAL_S)
    data, noise = prepared(energy.reading(truth) + NOISE_RAD * rng.standard_normal(len(TIME_S)))
    speed = refine(replace(energy, drag="speed"), data, noise, truth)
    state = simplified(hypothesis_of(speed, data, noise, (), speed))
    assert (state.fit.model.drag == "energy") is told
    assert state.drag_form == ("energy" if told else "undecided")


@pytest.mark.structure
def test_two_names_for_one_law_give_way_to_a_curve() -> None:
    state = state_with(pulled() + white(6), "frequency-drift", "cubic-stiffness")
    before = state.fit.chi2
    state = simplified(state)
    assert [step.winner.identifier for step in state.steps] == ["unnamed-restoring"]
    assert state.fit.chi2 < before + FURTHER + 18.0


@pytest.mark.structure
def test_each_further_name_has_its_price_and_sin_x_has_none() -> None:
    fit, _, _ = null_fit()

    def steps(*names: str) -> list[Step]:
        rivals = [Rival(by_identifier(name), fit, 9.0, 9.0, 9.0) for name in names]
        return [Step((rival,), 0.0, fit) for rival in rivals]

    one = price(steps("impulse"))
    assert price(steps("circular-error", "coulomb-friction")) == 0.0 < one
    assert price(steps("impulse", "circular-error")) == one
    assert price(steps("impulse", "sensor-cubic", "gain-drift")) == one + 2.0 * FURTHER


@pytest.mark.slow
def test_no_name_for_a_part_of_a_misfit_is_confident() -> None:
    found = diagnose_recording(recording(with_effects("frequency-drift") + CHIRP, 5))
    named = [effect for effect in found.effects if effect.kind != "unnamed"]
    others = [effect for effect in named if effect.identifier != "coloured-noise"]
    assert all(effect.probability < 0.5 for effect in others)


@pytest.mark.slow
def test_what_chance_does_not_explain_is_never_called_consistent() -> None:
    """A line that sweeps by the fundamental, and is in no catalogue."""
    sweep = 1e-3 * np.sin(2.0 * np.pi * (0.86 + 4e-4 * TIME_S) * TIME_S)
    found = diagnose_recording(recording(other_engine(TRUTH) + sweep, 5))
    assert found.p_value < 0.01
    assert found.verdict == "missing-physics"
    assert found.effects
    assert all(effect.probability <= 0.5 for effect in found.effects)


@pytest.mark.structure
def test_a_second_name_that_the_readings_do_not_need_is_dropped() -> None:
    readings = with_effects("sensor-quadratic") + white(5)
    state = state_with(readings, "sensor-quadratic", "tone-pickup")
    state = simplified(state)
    assert [step.winner.identifier for step in state.steps] == ["sensor-quadratic"]


def tone_at(frequency_hz: float, size: float = 4e-4) -> Fit:
    wave = size * np.cos(2.0 * np.pi * frequency_hz * TIME_S)
    data, noise = prepared(other_engine(TRUTH) + wave + white(5))
    model = Model(TIME_S, INTERVAL_S, (by_identifier("tone-pickup"),))
    return refine(model, data, noise, np.append(TRUTH, [size, 0.0, frequency_hz]))


@pytest.mark.parametrize(("order", "apart"), [(3.4, True), (2.6, True), (2.0, False), (3.0, False)])
def test_a_line_between_the_harmonics_stands_apart(order: float, apart: bool) -> None:
    """At a harmonic it may be a part of the motion that the model lacks."""
    fit = tone_at(order * FREQUENCY_HZ)
    assert off_harmonics(fit, by_identifier("tone-pickup")) == apart


def test_what_is_left_is_drawn_by_the_curve_that_takes_most_of_it() -> None:
    """A sensor whose reading is bent where no polynomial of two terms would bend it."""
    angle = other_engine(TRUTH) - TRUTH[7]
    bent = 4e-4 * np.tanh(angle / 0.02)
    data, noise = prepared(other_engine(TRUTH) + bent + white(6))
    fit = refine(Model(TIME_S, INTERVAL_S), data, noise, TRUTH)
    before = remainder_of(fit, data, noise)
    state = task_of().scanned(hypothesis_of(fit, data, noise, (), fit))
    (drawn,) = describing(state, task_of())
    assert drawn.lower > 0.0
    assert drawn.steps[-1].winner.effect.kind == "unnamed"
    assert remainder_of(drawn.fit, drawn.data, drawn.noise).excess < 0.2 * before.excess


def test_noise_is_not_described() -> None:
    fit, data, noise = null_fit()
    state = run_search(hypothesis_of(fit, data, noise, (), fit), task_of())
    assert state.steps == ()


@pytest.mark.slow
def test_a_torque_with_the_square_of_the_swing_is_no_second_plane() -> None:
    time_s, kappa = np.arange(0.0, 40.0, 0.025), -0.0191
    angle = swung(time_s, 0.68, 4.54, 0.009, torque=lambda x: math.sin(x) + kappa * x * abs(x))[0]
    outcome = diagnose_recording(
        Recording(time_s, angle + white(1, len(time_s), 5e-4), "angle_rad")
    )
    names = [each.identifier for each in outcome.effects]
    assert names == ["circular-error", "amplitude-linear-stiffness"]
    found = outcome.effects[1].parameters["kappa"]
    assert abs(found.value - kappa) < 4.0 * found.sd


@pytest.mark.slow
def test_a_misplaced_pivot_is_a_rival_of_the_quadratic_sensor_that_it_looks_like() -> None:
    """At 0.3 rad cos x - 1 is -x^2/2 but for 3e-4 rad of x^4: either may be the name."""
    for hidden in ("sensor-quadratic", "camera-geometry"):
        (found,) = classes_found(diagnosed(hidden))
        assert {"sensor-quadratic", "camera-geometry"} <= found


@pytest.mark.slow
def test_a_rare_name_that_looks_like_nothing_that_was_found_is_no_rival() -> None:
    outcome = diagnosed("equilibrium-step")
    rare = {effect.identifier for effect in CATALOGUE if effect.rare}
    assert not rare & set.union(*classes_found(outcome))


@pytest.mark.slow
def test_two_laws_that_share_a_misfit_are_both_found() -> None:
    """Each takes half of it, which is not worth the price of a name before the other is there."""
    step, sensor = VALUES["equilibrium-step"], VALUES["sensor-quadratic"]
    effects = tuple(map(by_identifier, ("equilibrium-step", "sensor-quadratic")))
    value = np.append(TRUTH, [3.0 * step[0], step[1], 3.0 * sensor[0]])
    found = diagnose_recording(
        recording(Model(TIME_S, INTERVAL_S, effects).reading(value), 5)
    ).effects
    assert {effect.identifier for effect in found} == {"equilibrium-step", "sensor-quadratic"}
    assert all(effect.probability > 0.5 for effect in found)


@pytest.mark.parametrize(("part", "worth", "tried"), [(0.5, 5.0, True), (0.1, 5.0, False)])
@pytest.mark.structure
def test_a_name_is_tried_on_credit_if_it_takes_a_good_part_of_the_misfit(
    part: float, worth: float, tried: bool
) -> None:
    state = state_with(pulled() + white(6))
    excess = remainder_of(state.fit, state.data, state.noise).excess
    effect = by_identifier("impulse")
    step = Step((Rival(effect, state.fit, part * excess, worth, worth),), 0.0, state.fit)
    assert worth < CHOICE
    assert shares_a_misfit(step, state) == tried


# Prediction of blocks that a model was not fitted to.


@pytest.mark.slow
@pytest.mark.parametrize("name", tuple(VALUES))
def test_the_right_effect_predicts_better(name: str) -> None:
    found = diagnosed(name).held_out
    assert found.gain > 0.0
    assert found.gain > found.gain_sd > 0.0
    assert found.gain == found.after - found.before


def test_a_model_gains_nothing_over_itself() -> None:
    fit, data, noise = null_fit()
    found = held_out(fit, fit, data, noise, (), ())
    assert abs(found.gain) < 1e-6
    assert found.gain_sd < 1e-6


def test_the_density_of_noise_is_that_of_its_distribution() -> None:
    """-n/2 (1 + ln 2 pi s^2), with the scatter of a sum of n squares and of the fit."""
    fit, data, noise = null_fit()
    found = held_out(fit, fit, data, noise, (), ())
    count = len(data)
    expected = -0.5 * count * (1.0 + math.log(2.0 * math.pi * NOISE_RAD**2))
    assert abs(found.before - expected) < 4.0 * math.sqrt(0.5 * count) + 2.0 * len(fit.free)


@pytest.mark.parametrize("name", ["sensor-cubic", "frequency-drift", "offset-drift"])
def test_an_effect_that_is_not_there_predicts_no_better(name: str) -> None:
    """One free value more loses half a unit of ln p, give or take a few."""
    fit, data, noise = null_fit()
    effect = by_identifier(name)
    model = fit.model.adding(effect)
    shape = [parameter.default for parameter in effect.parameters[effect.sizes :]]
    more = refine(model, data, noise, np.concatenate([fit.value, [0.0], shape]))
    found = held_out(fit, more, data, noise, (), ())
    assert found.gain < 6.0
    assert found.gain < 3.0 * found.gain_sd + 1.0


@pytest.mark.slow
def test_a_law_that_only_noise_asked_for_predicted_worse_and_a_right_one_does_not() -> None:
    """A line fitted to noise loses about a unit of ln p for its two sizes."""
    fit, data, noise = null_fit()
    model = fit.model.adding(by_identifier("tone-pickup"))
    more = refine(model, data, noise, np.concatenate([fit.value, [1e-4, 1e-4, 3.3]]))
    assert predicted_worse(fit, more, data, noise, (), (), drawn=False) > 0.0
    found = diagnosed("sensor-cubic").search
    fits = (found.baseline, found.fit, found.data, found.noise)
    assert predicted_worse(*fits, (), found.held, drawn=False) == 0.0


def test_coloured_noise_is_predicted_from_what_is_known() -> None:
    """Noise with a memory: the error of the first missing reading is smaller than the noise."""
    count = 400
    walk = np.cumsum(np.random.default_rng(1).standard_normal(count))
    walk -= walk.mean()
    order = np.maximum(np.arange(count), 0.5)
    spectrum = 1.0 / (2.0 - 2.0 * np.cos(np.pi * order / count))
    noise = Noise(spectrum, np.ones(count))
    out = np.zeros(count, dtype=bool)
    out[150:160] = True
    filled = completed(walk, noise, out)
    straight = np.interp(np.arange(count)[out], np.arange(count)[~out], walk[~out])
    # The mean of a random walk between known readings is a straight line.
    np.testing.assert_allclose(filled[out], straight, atol=0.05 * np.std(walk))
    np.testing.assert_allclose(filled[~out], walk[~out])


@pytest.mark.slow
def test_several_jumps_of_the_zero_are_found_each_and_are_no_glitches() -> None:
    """One of several leaves red noise, and a wandering offset gains more than each of them."""
    sizes, instants_s = (14.0, -10.0, 12.0), (14.3, 33.0, 61.2)
    noise_rad, time_s = 1e-3, np.arange(2400) / 30.0
    angle = 0.35 * np.exp(-0.012 * time_s) * np.cos(4.2 * time_s)
    for size, instant_s in zip(sizes, instants_s, strict=False):
        angle += noise_rad * size * (time_s > instant_s)
    angle += noise_rad * np.random.default_rng(3).standard_normal(len(time_s))
    found = diagnose_recording(Recording(time_s, angle, "angle_rad"), restoring="linear").missing
    assert {each.identifier for each in found} == {"offset-step"}
    jumps = sorted((dict(each.parameters) for each in found), key=lambda own: own["time"].value)
    for own, size, instant_s in zip(jumps, sizes, instants_s, strict=False):
        jump, when = next(each for each in own.values() if each.unit == "rad"), own["time"]
        assert abs(jump.value - noise_rad * size) < 4.0 * jump.sd
        assert when.value == pytest.approx(instant_s, abs=0.05)
    assert len(jumps) == len(sizes)
