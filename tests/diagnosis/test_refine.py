"""Fits of laws and effects: the minimum is found, from anywhere, whatever is held."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from scipy.stats import chi2

from pendpipe.arrays import FloatArray
from pendpipe.diagnosis.data import Data, gather
from pendpipe.diagnosis.detect import Detection, Lead
from pendpipe.diagnosis.instants import with_instants
from pendpipe.diagnosis.noise import white_noise
from pendpipe.diagnosis.projection import finer_shape
from pendpipe.diagnosis.refine import (
    Fit,
    best_fit,
    fit_in_growing_window,
    pulled,
    refine,
)
from pendpipe.diagnosis.released_parameters import ReleasedParameter
from pendpipe.diagnosis.rivals import (
    NEAR,
    NO_SCAN,
    Rival,
    _names_first,
    of_one_class,
    refit_leads,
    side_by_side,
    useful_chi2,
)
from pendpipe.diagnosis.values import effect_parameters
from pendpipe.dynamics.eq8 import OFFSET, OMEGA, SHARE, START, TIME, A, B, C
from pendpipe.dynamics.eq8_model import HYSTERETIC, VISCOUS
from pendpipe.effects.catalogue import by_identifier
from pendpipe.effects.catalogue.restoring import circular_error
from pendpipe.effects.model import Evaluated, Model
from pendpipe.estimate import Estimate

from ..effects.integration import swung
from .records import (
    FREQUENCY_HZ,
    INSTANT_S,
    INTERVAL_S,
    LINEAR,
    NOISE_RAD,
    TIME_S,
    TRUTH,
    beginning_of,
    null_fit,
    other_engine,
    prepared,
    recording,
    stribeck_record,
    white,
)

# Maximum likelihood: from far away, within bounds, with valid errors.


def test_a_fit_of_very_many_readings_computes_again_what_it_no_longer_holds(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    start = beginning_of(recording(Model(TIME_S, INTERVAL_S).reading(TRUTH), 2))
    noise = white_noise(start.data, NOISE_RAD)
    whole = refine(start.model, start.data, noise, start.value)
    monkeypatch.setattr("pendpipe.diagnosis.refine._KEPT", 0)
    fit = refine(start.model, start.data, noise, start.value)
    assert "at" in vars(whole.evaluation)
    assert "at" not in vars(fit.evaluation)
    assert fit.chi2 == pytest.approx(whole.chi2, rel=1e-9)
    assert noise.whiten(start.data.residual(fit.at.reading)) == pytest.approx(
        fit.residual[:-1], abs=1e-4
    )
    errors = np.sqrt(np.diag(whole.covariance()))
    assert np.sqrt(np.diag(fit.covariance())) == pytest.approx(errors, rel=1e-5)


def test_circular_error_of_half_a_radian_is_fitted_from_the_start_of_a_law_with_x() -> None:
    """That law's frequency is off by 1.6 %, more than a turn in the record."""
    effect = by_identifier("circular-error")
    truth = TRUTH.copy()
    truth[START] = 0.5
    readings = Model(TIME_S, INTERVAL_S, (effect,)).reading(np.append(truth, 1.0))
    start = beginning_of(recording(readings, 2), restoring="linear")
    noise = white_noise(start.data, NOISE_RAD)
    turns = abs(start.value[OMEGA] - truth[OMEGA]) * TIME_S[-1] / (2.0 * np.pi)
    assert turns > 0.5
    fit = refine(start.model.adding(effect), start.data, noise, np.append(start.value, 1.0))
    assert fit.converged
    assert fit.chi2 < chi2.isf(1e-3, start.data.used)
    sd = np.sqrt(np.diag(fit.covariance()))
    assert abs(fit.value[OMEGA] - truth[OMEGA]) < 4.0 * sd[OMEGA]
    assert abs(fit.value[OFFSET] - truth[OFFSET]) < 4.0 * sd[OFFSET]


@settings(max_examples=5)
@given(
    st.tuples(st.floats(0.0, 2.0), st.floats(0.5, 1.5), st.floats(0.0, 1.5)),
    st.floats(-1e-3, 1e-3),
    st.floats(0.8, 1.25),
)
def test_the_start_values_do_not_matter(
    losses: tuple[float, float, float], detuning: float, size: float
) -> None:
    fit, data, noise = null_fit()
    start = TRUTH.copy()
    start[[A, B, C]] *= losses
    start[OMEGA] *= 1.0 + detuning
    start[START] *= size
    again = refine(fit.model, data, noise, start)
    assert again.converged
    assert again.chi2 == pytest.approx(fit.chi2, abs=0.1)


@pytest.mark.parametrize("seed", range(5))
def test_losses_are_never_negative(seed: int) -> None:
    """Without quadratic drag and Coulomb friction their estimates lie at zero half the time."""
    data, noise = prepared(other_engine(LINEAR) + white(seed))
    fit = refine(Model(TIME_S, INTERVAL_S), data, noise, TRUTH)
    assert fit.converged
    assert np.all(fit.value[[A, B, C]] >= 0.0)
    assert 0.0 <= fit.value[SHARE] <= 1.0
    assert fit.chi2 < chi2.isf(1e-3, len(data) - 4)


def test_what_is_held_stays() -> None:
    fit, data, noise = null_fit()
    start = TRUTH.copy()
    start[B] *= 1.1
    held = refine(fit.model, data, noise, start, held=(B, SHARE))
    assert held.value[B] == start[B]
    assert held.value[SHARE] == start[SHARE]
    assert {B, SHARE}.isdisjoint(held.free)
    assert np.all(held.covariance()[[B, SHARE]] == 0.0)
    assert held.chi2 > fit.chi2


def test_the_covariance_is_the_scatter_of_repeated_records() -> None:
    """Five free values of 30 records: their squared pulls sum to chi^2 of 150."""
    time_s = TIME_S[:400]
    model, plain = Model(time_s, INTERVAL_S), other_engine(LINEAR, time_s)
    free = [B, OMEGA, START, TIME, OFFSET]
    total, pulls = 0.0, []
    for seed in range(30):
        data, noise = prepared(plain + white(seed, len(time_s)), time_s)
        fit = refine(model, data, noise, LINEAR, held=(A, C, SHARE))
        off = (fit.value - LINEAR)[free]
        part = fit.covariance()[np.ix_(free, free)]
        pulls.append(off / np.sqrt(np.diag(part)))
        scale = np.sqrt(np.diag(part))
        total += float(off / scale @ np.linalg.solve(part / np.outer(scale, scale), off / scale))
    assert chi2.ppf(1e-3, 150) < total < chi2.isf(1e-3, 150)
    scatter = np.mean(np.square(pulls), axis=0)
    assert np.all(scatter > chi2.ppf(2e-4, 30) / 30.0)
    assert np.all(scatter < chi2.isf(2e-4, 30) / 30.0)


@pytest.mark.parametrize("start", [0.7, 1.4, 2.0])
def test_friction_that_another_law_imitates_is_found_from_zero(start: float) -> None:
    """Coulomb and quadratic losses imitate Stribeck's, and all must change at once.

    The exchange leaves the motion as it is, but friction changes the frequency in second
    order, so that no straight step lowers chi^2 by what it promises.
    """
    model, data, noise, truth = stribeck_record()
    from_truth = refine(model, data, noise, truth)
    without = refine(model.bare(), data, noise, truth[:-2])
    assert without.chi2 - from_truth.chi2 > 100.0
    found = refine(model, data, noise, np.append(without.value, [0.0, start * truth[-1]]))
    assert found.chi2 == pytest.approx(from_truth.chi2, abs=1.0)


@pytest.mark.parametrize("above", [1.0, 5.0, 60.0])
@pytest.mark.parametrize(
    ("identifier", "shape"),
    [("damping-drift", [100.0]), ("power-law-damping", [1.5, 0.0]), ("gain-drift", [100.0])],
)
def test_a_limit_of_chi2_changes_no_fit_that_gets_below_it(
    identifier: str, shape: list[float], above: float
) -> None:
    model, data, noise, truth = stribeck_record()
    without = refine(model.bare(), data, noise, truth[:-2])
    other = model.bare().adding(by_identifier(identifier))
    start = np.concatenate([without.value, [0.0], shape])
    whole = refine(other, data, noise, start)
    limited = refine(other, data, noise, start, useful=whole.chi2 + above)
    # The motion is followed from the last one that was asked, to 1e-9.
    assert limited.chi2 == pytest.approx(whole.chi2)


def test_a_hopeless_fit_stops_after_a_few_steps(monkeypatch: pytest.MonkeyPatch) -> None:
    """A slow change of the damping does not describe Stribeck's friction: its fit creeps."""
    model, data, noise, truth = stribeck_record()
    without = refine(model.bare(), data, noise, truth[:-2])
    drift = model.bare().adding(by_identifier("damping-drift"))
    start = np.append(without.value, [0.0, 100.0])
    asked: list[float] = []
    evaluate = Model.evaluate

    def counted(self: Model, value: FloatArray) -> Evaluated:
        asked.append(float(value[START]))
        return evaluate(self, value)

    monkeypatch.setattr(Model, "evaluate", counted)
    whole = refine(drift, data, noise, start)
    spent = len(asked)
    useful = whole.chi2 - 30.0
    limited = refine(drift, data, noise, start, useful=useful)
    assert useful < limited.chi2 < without.chi2 - 70.0
    assert len(asked) - spent < 0.7 * spent


def test_a_start_beyond_all_numbers_is_none() -> None:
    """Its squares are infinite: the fit begins elsewhere, or there is none."""
    fit, data, noise = null_fit()
    beyond = fit.value.copy()
    beyond[OFFSET] = 1e200
    # Trial models overflow, as in `diagnose_recording`.
    with np.errstate(over="ignore", invalid="ignore"):
        assert best_fit(fit.model, data, noise, [beyond]) is None
        found = best_fit(fit.model, data, noise, [beyond, fit.value])
    assert found.chi2 == pytest.approx(fit.chi2, rel=1e-6)


# Which effects are refitted, and which refits are carried to the end.


@pytest.mark.parametrize("gain", [0.0, 20.0, 100.0, 400.0, 1e4])
@pytest.mark.structure
def test_effects_of_the_best_ones_class_are_useful(gain: float) -> None:
    fit, _, _ = null_fit()
    best = Rival(by_identifier("cubic-stiffness"), fit, gain, gain, gain)
    at_the_limit = gain - useful_chi2(0.0, gain, drawn=False)
    behind = replace(best, gain=at_the_limit, worth=at_the_limit, evidence=at_the_limit)
    assert not of_one_class(best, behind)


@pytest.mark.parametrize("gain", [20.0, 400.0, 1e4])
def test_a_name_may_end_farther_behind_a_curve_than_behind_a_name(gain: float) -> None:
    """It has fewer values; but what explains a third of what a curve does is of no use."""
    behind_a_curve, behind_a_name = (useful_chi2(0.0, gain, drawn=each) for each in (True, False))
    assert behind_a_name < behind_a_curve < 2.0 / 3.0 * gain + NEAR


@pytest.mark.structure
def test_in_a_gross_misfit_every_refit_ends_at_its_minimum() -> None:
    """Otherwise only those that come near the best: here the true friction."""
    model, data, noise, truth = stribeck_record()
    base = refine(model.bare(), data, noise, truth[:-2])
    names = {"stribeck-friction": (float(truth[-1]),), "damping-drift": (100.0,)}
    leads = [Lead(by_identifier(name), shape) for name, shape in names.items()]
    whole = side_by_side(base, data, noise, leads, (), phase_lost=True)
    near = side_by_side(base, data, noise, leads, (), phase_lost=False)
    for effect, fit in whole:
        start = np.concatenate([base.value, [0.0], names[effect.identifier]])
        alone = refine(base.model.adding(effect), data, noise, start)
        assert fit.chi2 == pytest.approx(alone.chi2, abs=0.1)
    (_, best), (_, rival) = near
    assert best.chi2 == pytest.approx(whole[0][1].chi2, abs=1.0)
    assert rival.chi2 > best.chi2 + 50.0
    assert not rival.converged


def _detection(scores: dict[str, tuple[float, tuple[float, ...]]]) -> Detection:
    """The result of a scan, with negligible p-values."""
    leads = [
        Lead(by_identifier(name), shape, score, 0.0) for name, (score, shape) in scores.items()
    ]
    return Detection(tuple(leads), 0.0, NO_SCAN)


@pytest.mark.parametrize(("others", "at_a_bound"), [(LINEAR, True), (TRUTH, False)])
@pytest.mark.structure
def test_an_effect_whose_score_a_bound_halves_is_refitted(
    others: FloatArray, at_a_bound: bool
) -> None:
    """A loss between b and a needs a negative c, which the score keeps at zero."""
    power = by_identifier("power-law-damping")
    truth = np.concatenate([others, [5e-4, 1.4, 1.0]])
    readings = Model(TIME_S, INTERVAL_S, (power,)).reading(truth)
    data, noise = prepared(readings + white(3))
    base = refine(Model(TIME_S, INTERVAL_S), data, noise, others)
    assert ({A, C} & set(pulled(base)) != set()) == at_a_bound
    rivals = refit_leads(
        base,
        data,
        noise,
        _detection({"damping-drift": (100.0, (40.0,)), "power-law-damping": (50.0, (1.5, 0.0))}),
        held=(),
        phase_lost=False,
    )
    asked = {rival.identifier for rival in rivals}
    assert ("power-law-damping" in asked) == at_a_bound


@pytest.mark.parametrize(
    ("behind", "first"), [(1.0, "presliding-friction"), (30.0, "frequency-step")]
)
@pytest.mark.structure
def test_in_a_misfit_a_law_that_acts_throughout_comes_before_an_event(
    behind: float, first: str
) -> None:
    """A step takes a part of any misfit; one that explains it far better leads."""
    fit, _, _ = null_fit()
    rivals = [
        Rival(by_identifier(name), fit, gain, worth, worth)
        for name, gain, worth in (
            ("frequency-step", 1000.0, 60.0),
            ("presliding-friction", 900.0, 60.0 - behind),
        )
    ]
    assert _names_first(rivals)[0].identifier == first


# A held part of b that is released moves the readings as that part alone does.

RATES = {HYSTERETIC: 6e-3, VISCOUS: 4e-3}
"""The parts of b, in 1/s."""
NAMES = {HYSTERETIC: "quality_factor_hysteretic", VISCOUS: "quality_factor_viscous"}


def values(rates: dict[str, float]) -> FloatArray:
    found = TRUTH.copy()
    found[B] = sum(rates.values())
    found[SHARE] = rates[HYSTERETIC] / found[B]
    return found


def held(rates: dict[str, float], parts: list[str], *indices: int) -> Fit:
    """A fit that holds parts of b at what they are."""
    data, noise = prepared(other_engine(values(rates)) + white(4))
    model = Model(TIME_S, INTERVAL_S, parts={part: rates[part] for part in parts})
    return refine(model, data, noise, values(rates), held=indices)


def by_part(fit: Fit, part: str) -> FloatArray:
    """By differences: what the readings do when a part alone changes, over the noise."""
    rates = {HYSTERETIC: fit.value[B] * fit.value[SHARE]}
    rates[VISCOUS] = fit.value[B] - rates[HYSTERETIC]
    model, change = Model(TIME_S, INTERVAL_S), 1e-6
    ends = []
    for sign in (-1.0, 1.0):
        moved = fit.value.copy()
        there = rates | {part: rates[part] + sign * change}
        moved[B] = sum(there.values())
        moved[SHARE] = there[HYSTERETIC] / moved[B]
        ends.append(model.reading(moved))
    return (ends[1] - ends[0]) / (2.0 * change * NOISE_RAD)


@pytest.mark.parametrize("part", [HYSTERETIC, VISCOUS])
@pytest.mark.parametrize("alone", [False, True])
def test_beside_a_held_other_part_it_is_that_part_s_derivative(part: str, alone: bool) -> None:
    """Where the other part is nothing, it is all of b."""
    nothing = dict.fromkeys(RATES, 0.0) | {part: 1e-2}
    fit = held(nothing, [part], B) if alone else held(RATES, [HYSTERETIC, VISCOUS])
    expected = by_part(fit, part)
    found = ReleasedParameter(NAMES[part]).sensitivity(fit)[:-1]
    assert found == pytest.approx(expected, abs=1e-4 * np.abs(expected).max())


@pytest.mark.parametrize("part", [HYSTERETIC, VISCOUS])
def test_beside_a_fitted_other_part_it_adds_what_that_one_lacks(part: str) -> None:
    """With b's own derivative it spans what both parts do."""
    fit = held(RATES, [part])
    both = np.column_stack([by_part(fit, each) for each in (HYSTERETIC, VISCOUS)])
    own = ReleasedParameter(NAMES[part]).sensitivity(fit)[:-1]
    spanned = np.column_stack([fit.jacobian[:-1, B], own])
    left = both - spanned @ np.linalg.lstsq(spanned, both, rcond=None)[0]
    assert np.abs(left).max() < 1e-4 * np.abs(both).max()


# Between the instants of a scan: the fit must end where one from the truth does.

LONG_S = np.arange(0.0, 200.0, 0.05)


@pytest.mark.parametrize(
    ("identifier", "size"),
    [
        ("impulse", 1e-3),
        ("equilibrium-step", 5e-5),
        ("amplitude-step", 3e-3),
        ("dropped-samples", 4e-4),
    ],
)
@pytest.mark.parametrize("instant", [41.3, 120.6])
def test_an_instant_is_found_from_the_nearest_row(
    identifier: str, size: float, instant: float
) -> None:
    effect = by_identifier(identifier)
    truth = np.append(TRUTH, [size, instant])
    model = Model(LONG_S, 0.05)
    readings = model.adding(effect).reading(truth) + white(4, len(LONG_S), NOISE_RAD)
    data = gather(
        LONG_S, readings, step=None, unit="rad", counts=False, period_s=1.1, noise_rms=NOISE_RAD
    )
    noise = white_noise(data, NOISE_RAD)
    base = refine(model, data, noise, TRUTH)
    rows = np.unique([row[0] for row in effect.shapes(base.at.span)])
    nearest = float(rows[np.argmin(np.abs(rows - instant))])
    shape = finer_shape(base, noise, effect, (nearest,))
    start = np.concatenate([base.value, [0.0], shape])
    found = refine(model.adding(effect), data, noise, start)
    best = refine(model.adding(effect), data, noise, truth)
    assert base.chi2 - best.chi2 > 60.0
    assert found.chi2 < best.chi2 + 3.0


def test_effects_that_vary_slowly_need_no_closer_look() -> None:
    model = Model(LONG_S, 0.05)
    data = gather(
        LONG_S,
        model.reading(TRUTH),
        step=None,
        unit="rad",
        counts=False,
        period_s=1.1,
        noise_rms=NOISE_RAD,
    )
    noise = white_noise(data, NOISE_RAD)
    base = refine(model, data, noise, TRUTH)
    assert finer_shape(base, noise, by_identifier("frequency-step"), (70.0,)) == (70.0,)


# A progressive window finds the motion where a start over the whole record is turns away.


def test_circular_error_at_1_4_rad_is_found_from_a_frequency_that_is_12_percent_off() -> None:
    """The first cycles' own frequency is omega (1 - A^2/16): over 120 s that is 11 turns off."""
    rate_hz, noise_rad, linear, omega = 20.0, 1e-3, 0.012, 6.1
    time_s = np.arange(2400) / rate_hz
    angle = swung(time_s, 1.4, omega, linear)[0]
    values = angle + noise_rad * np.random.default_rng(4).standard_normal(len(time_s))
    data = Data(time_s, values, 1.0 / rate_hz, True, np.ones(len(time_s)))
    model = Model(time_s, 1.0 / rate_hz, (circular_error,), order=20)
    slow = omega * (1.0 - 1.4**2 / 16.0)
    start = np.array([0.0, linear, 0.0, 0.5, slow, 1.4, 0.0, 0.0, 1.0])
    fit = fit_in_growing_window(model, data, white_noise(data, noise_rad), start)
    assert fit.chi2 / len(time_s) == pytest.approx(1.0, abs=0.1)
    sd = math.sqrt(fit.covariance()[OMEGA, OMEGA])
    assert abs(fit.value[OMEGA] - omega) < 5.0 * sd


@pytest.mark.parametrize("scale", [1.0, 100.0])
def test_an_interval_holds_its_value_whatever_the_unit_of_the_readings(scale: float) -> None:
    """A play of 0.02 rad is 2 where 1 rad reads 100: the bounds of a size are scaled with it."""
    effect = by_identifier("sensor-backlash")
    powers = np.array([-1.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 1.0])  # of a, b, c, ... in amplitudes
    model = Model(TIME_S, INTERVAL_S, scale=scale).adding(effect)
    truth = np.append(TRUTH * scale**powers, 0.02 * scale)
    data, noise = prepared(model.reading(truth) + scale * white(5), rms=scale * NOISE_RAD)
    (play,) = effect_parameters(refine(model, data, noise, truth), effect).values()
    low, high = play.bounds95
    assert low < play.value < high


# Intervals of instants hold the truth, in whichever half cycle chi^2 has its minimum.


def told(
    identifier: str, size: float, seed: int
) -> tuple[dict[str, Estimate], dict[str, Estimate], FloatArray]:
    """Estimates of a size and an instant, by the fit and over half cycles; and the truth."""
    effect = by_identifier(identifier)
    model = Model(TIME_S, INTERVAL_S)
    truth = np.array([size, INSTANT_S])
    clean = model.adding(effect).reading(np.append(TRUTH, truth))
    data, noise = prepared(clean + white(seed))
    without = refine(model, data, noise, TRUTH)
    rows = effect.shapes(without.at.span)
    nearest = min(rows, key=lambda row: abs(row[0] - INSTANT_S))
    shape = finer_shape(without, noise, effect, tuple(nearest))
    start = np.concatenate([without.value, [0.0], shape])
    found = effect_parameters(refine(model.adding(effect), data, noise, start), effect)
    return found, with_instants(found, effect, without, noise), truth


def holds(estimates: dict[str, Estimate], truth: FloatArray) -> list[bool]:
    inside = []
    for estimate, true in zip(estimates.values(), truth, strict=True):
        inside.append(bool(estimate.interval95[0] <= true <= estimate.interval95[1]))
    return inside


@pytest.mark.slow
@pytest.mark.parametrize(("identifier", "size"), [("equilibrium-step", 4e-5), ("impulse", 2.5e-4)])
def test_weak_steps_and_knocks_lie_within_their_intervals(identifier: str, size: float) -> None:
    """At Delta chi^2 of some 40, chi^2 has minima in several half cycles."""
    narrow: list[bool] = []
    wide: list[bool] = []
    for seed in range(15):
        by_fit, over_cycles, truth = told(identifier, size, seed)
        narrow += holds(by_fit, truth)
        wide += holds(over_cycles, truth)
    # 95 % of 30, and three standard deviations below it.
    assert np.mean(wide) > 0.95 - 3.0 * np.sqrt(0.95 * 0.05 / len(wide))
    assert np.mean(wide) > np.mean(narrow)


def test_a_hard_knock_is_known_to_a_part_of_a_cycle() -> None:
    _, estimates, truth = told("impulse", 50.0 * NOISE_RAD, 1)
    assert all(holds(estimates, truth))
    assert 1.96 * estimates["time"].sd < 0.25 / FREQUENCY_HZ


@pytest.mark.parametrize(("identifier", "size"), [("amplitude-step", 0.1), ("impulse", 0.02)])
def test_a_strong_jump_is_no_surer_than_its_fit(identifier: str, size: float) -> None:
    """To first order in the size the scan over instants is off by more than its own width."""
    by_fit, over_cycles, truth = told(identifier, size, 3)
    assert all(holds(over_cycles, truth))
    for name, estimate in by_fit.items():
        low, high = over_cycles[name].bounds95
        assert low <= estimate.bounds95[0]
        assert estimate.bounds95[1] <= high


def test_an_effect_without_an_instant_is_unchanged() -> None:
    effect = by_identifier("frequency-drift")
    data, noise = prepared(other_engine(TRUTH) + white(2))
    fit = refine(Model(TIME_S, INTERVAL_S), data, noise, TRUTH)
    known = {"rate": Estimate(1.0, 0.1, "1/s")}
    assert with_instants(known, effect, fit, noise) is known
