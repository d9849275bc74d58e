"""Chances, scores, and the rivals that share the probability of an effect."""

import functools
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import binom, chi2, kstest

from pendpipe.arrays import FloatArray
from pendpipe.diagnosis import projection, weighing
from pendpipe.diagnosis.data import Data
from pendpipe.diagnosis.detect import (
    Bank,
    Lead,
    Scanner,
    build_bank,
    detect,
    draw_chance,
    prepare,
)
from pendpipe.diagnosis.hypothesis import applicable
from pendpipe.diagnosis.noise import Noise
from pendpipe.diagnosis.projection import local_p_values, scores_and_lengths, tangent_basis
from pendpipe.diagnosis.refine import Fit, refine
from pendpipe.diagnosis.result import Diagnosis
from pendpipe.diagnosis.rivals import class_width
from pendpipe.diagnosis.run import diagnose_recording
from pendpipe.dynamics.eq8 import B
from pendpipe.effects.catalogue import CATALOGUE, by_identifier
from pendpipe.effects.model import Model

from .faults import Pendulum, fitted
from .records import (
    FREQUENCY_HZ,
    INSTANT_S,
    INTERVAL_S,
    TIME_S,
    TRUTH,
    diagnosed,
    null_fit,
    other_engine,
    prepared,
    recording,
    white,
    with_effects,
)

# The rivals that share the probability of an effect: those that the final noise allows.

JUMP_RAD = 1e-3
"""Ten times the noise of a reading."""


@functools.cache
def jumped() -> Diagnosis:
    """The equilibrium jumps; the estimate of the noise changes with the model."""
    model = Model(TIME_S, INTERVAL_S, (by_identifier("equilibrium-step"),))
    return diagnose_recording(recording(model.reading(np.append(TRUTH, [JUMP_RAD, INSTANT_S])), 3))


@pytest.mark.slow
def test_a_jump_of_ten_times_the_noise_is_no_red_noise_and_has_no_rival() -> None:
    (effect,) = jumped().effects
    assert effect.identifier == "equilibrium-step"
    # Half the readings on either side of it: chi^2 of the jump itself, about n (10/2)^2.
    assert effect.delta_chi2 == pytest.approx(25.0 * len(TIME_S), rel=0.3)
    assert effect.indistinguishable == ()
    assert effect.probability > 0.9


@pytest.mark.slow
def test_a_winner_is_refitted_from_its_own_values_wherever_it_stands() -> None:
    """The first of two effects, as a rival in its own place: it finds the same fit again."""
    readings = with_effects("equilibrium-step", "tone-pickup")
    found = diagnose_recording(recording(readings, 1), restoring="linear").search
    effects = found.fit.model.effects
    first = next(step for step in found.steps if step.winner.effect is effects[0])
    assert len(effects) == 2
    without = found.without(first)
    rival = replace(first.winner, fit=found.fit)
    again = weighing.refitted(without, found, rival, found.fit.chi2 + 1.0)
    assert again.model.effects[-1] is first.winner.effect
    assert again.chi2 == pytest.approx(found.fit.chi2, abs=0.1)


@pytest.mark.slow
def test_without_one_of_two_jumps_the_other_stays_where_it_is() -> None:
    """Its size, too, fits the readings again only where nothing else takes its place."""
    found = diagnosed("two steps").search
    one, other = (step.winner.effect for step in found.steps)
    fit = weighing._others_in_place(found, one)
    here, there = dict(found.fit.model.places()), dict(fit.model.places())
    assert one not in there
    assert np.array_equal(fit.value[there[other]], found.fit.value[here[other]])
    alone = jumped().search
    assert weighing._others_in_place(alone, alone.steps[0].winner.effect) is None


@pytest.mark.slow
@pytest.mark.parametrize("place", [1, 2])
def test_a_rival_is_compared_by_its_gain_with_the_final_noise(place: int) -> None:
    found = jumped().search
    (step,) = found.steps
    one = step.rivals[place]
    start = np.append(step.before.value, one.fit.value[len(TRUTH) :])
    model = step.before.model.adding(one.effect)
    fit = refine(model, found.data, found.noise, start, held=found.held)
    behind = fit.chi2 - found.fit.chi2
    assert step.winner.gain - one.gain == pytest.approx(behind, rel=1e-3)
    within = behind < class_width(step.winner)
    assert (one.identifier in {mate.identifier for mate in step.mates}) == within


@pytest.mark.slow
@pytest.mark.parametrize(("order", "off"), [(2.0, 0.3), (3.0, 0.02)])
def test_a_line_near_a_harmonic_is_doubted_by_the_chance_that_it_is_so_near(
    order: float, off: float
) -> None:
    """A law that nobody knows makes lines at the harmonics, and others anywhere.

    Half the sampling rate lies a third of the frequency above a harmonic: an error of every second
    reading makes lines there, and of three combs one is three times as often so near.
    """
    second = by_identifier("second-mode")
    tone = [1e-3, 0.0, (order + off) * FREQUENCY_HZ, 30.0]
    readings = Model(TIME_S, INTERVAL_S, (second,)).reading(np.append(TRUTH, tone))
    (effect,) = diagnose_recording(recording(readings, 5)).effects
    assert effect.identifier == "second-mode"
    by_chance = min(2.0 * off, 6.0 * (1.0 / 3.0 - off))
    named = 1.0 / (1.0 + np.exp(-2.5) / by_chance)
    assert effect.probability == pytest.approx(named, abs=0.02)


@pytest.mark.slow
def test_a_parameter_that_is_held_wrongly_is_named_and_comes_out_right() -> None:
    """A prediction with a wrong b: nothing is missing."""
    given = {"b": 1.1 * float(TRUTH[B])}
    outcome = diagnose_recording(recording(other_engine(TRUTH), 6), fixed=given)
    found, (effect,) = outcome.search, outcome.missing
    assert effect.identifier == "parameter-b"
    assert B not in found.held
    sd = float(found.fit.covariance()[B, B]) ** 0.5
    assert abs(found.fit.value[B] - TRUTH[B]) < 4.0 * sd


# How often chance alone does as well somewhere in a scan.

WHITE = Noise(np.ones(60), np.ones(60))
NOTHING = np.zeros((60, 0))


def bank_of(columns: FloatArray) -> Bank:
    """One effect of as many shapes as there are columns, with nothing fitted."""
    effect, count = by_identifier("offset-drift"), columns.shape[1]
    shapes = tuple(Lead(effect, (float(k),)) for k in range(count))
    freedom = np.ones(count, dtype=np.intp)
    return Bank(NOTHING, columns.astype(np.float32), shapes, freedom, np.zeros(count))


def scanner_of(bank: Bank) -> Scanner:
    """A scan of it without tones."""
    return Scanner(bank, WHITE, NOTHING)


@pytest.mark.parametrize("shapes", [3, 12, 48])
def test_independent_shapes_are_counted(shapes: int) -> None:
    """The p-values of fresh noise are uniform then."""
    bank = bank_of(np.eye(60)[:, :shapes])
    chance = draw_chance(scanner_of(bank), seed=1, draws=2000)
    fresh = np.random.default_rng(99).standard_normal((60, 600))
    smallest = local_p_values(bank.scores(fresh), bank.freedom).min(axis=0)
    found = [chance.everywhere.global_p_value(float(local)) for local in smallest]
    assert kstest(found, "uniform").pvalue > 1e-3


def test_more_shapes_are_more_trials_but_the_same_shape_again_is_none() -> None:
    found = []
    for shapes in (2, 8, 32):
        chance = draw_chance(scanner_of(bank_of(np.eye(60)[:, :shapes])), seed=2)
        found.append(chance.own["offset-drift"].global_p_value(1e-4))
    assert found[0] < found[1] < found[2]
    same = draw_chance(scanner_of(bank_of(np.repeat(np.eye(60)[:, :1], 32, axis=1))), seed=2)
    assert same.own["offset-drift"].global_p_value(1e-4) < found[0]


def test_the_draws_follow_their_seed() -> None:
    bank = bank_of(np.eye(60)[:, :5])
    assert draw_chance(scanner_of(bank), seed=3) == draw_chance(scanner_of(bank), seed=3)
    assert draw_chance(scanner_of(bank), seed=3) != draw_chance(scanner_of(bank), seed=4)


@pytest.mark.slow
def test_false_alarms_of_the_whole_catalogue_are_as_frequent_as_the_p_value() -> None:
    """Of 80 fresh residuals a tenth have p < 0.1, and three tenths p < 0.3."""
    fit, data, noise = null_fit()
    scanner = prepare(fit, data, noise, applicable(CATALOGUE, fit, "eq8", "rad"))
    known = detect(scanner, fit, seed=5)
    generator, count = np.random.default_rng(6), 80

    def p_value() -> float:
        noise_alone = generator.standard_normal(len(fit.residual))
        evaluation = replace(fit.evaluation, residual=noise_alone)
        return detect(scanner, replace(fit, evaluation=evaluation), seed=5, known=known).p_value

    found = np.array([p_value() for _ in range(count)])
    for level in (0.1, 0.3):
        below = int(np.count_nonzero(found < level))
        # The number of trials is itself drawn, to a tenth.
        assert binom.ppf(1e-3, count, 0.9 * level) <= below <= binom.isf(1e-3, count, 1.1 * level)


# Scores: unit columns orthogonal to the derivatives by the baseline's parameters.


@functools.cache
def perfect() -> tuple[Fit, Data, Noise, Bank]:
    """Readings without noise, to isolate the effect."""
    data, noise = prepared(Model(TIME_S, INTERVAL_S).reading(TRUTH))
    fit = refine(Model(TIME_S, INTERVAL_S), data, noise, TRUTH, held=(3,))
    effects = [e for e in applicable(CATALOGUE, fit, "eq8", "rad") if not e.spectral]
    return fit, data, noise, build_bank(fit, noise, effects)


def white_residuals(draws: int) -> tuple[Bank, FloatArray]:
    """The residual of white noise: nothing in the tangent space of the fit."""
    _, _, _, bank = perfect()
    drawn = np.random.default_rng(17).standard_normal((len(bank.basis), draws))
    return bank, drawn - bank.basis @ (bank.basis.T @ drawn)


def test_columns_are_of_unit_length_and_beside_the_models_tangent_space() -> None:
    """To single precision, in which they are kept."""
    fit, _, _, bank = perfect()
    basis = tangent_basis(fit)
    np.testing.assert_allclose(basis.T @ basis, np.eye(basis.shape[1]), atol=1e-12)
    columns = bank.columns.astype(float)
    np.testing.assert_allclose(np.linalg.norm(columns, axis=0), 1.0, atol=1e-6)
    assert np.abs(basis.T @ columns).max() < 1e-6
    for first, width in zip(bank.first, bank.freedom, strict=True):
        own = columns[:, first : first + width]
        np.testing.assert_allclose(own.T @ own, np.eye(width), atol=1e-5)


@pytest.mark.slow
def test_of_a_long_record_blocks_of_cycles_tell_all(monkeypatch: pytest.MonkeyPatch) -> None:
    """A third of the numbers keeps 97 % of what a kick among 1,300 cycles lowers chi^2 by."""
    long = Pendulum(quality_factor=1500.0, quadratic=0.0, coulomb=0.0, count=30_000)
    kicked = Model(long.times(), 1.0 / long.rate_hz, effects=(by_identifier("impulse"),))
    values = np.append(long.values(), [2e-3, 700.0])
    record = fitted(long, kicked.reading(values) + white(18, long.count, 1e-3))
    effects = [e for e in applicable(CATALOGUE, record.fit, "eq8", "rad") if not e.spectral]
    found = {}
    for name, most in (("part", 16_000), ("whole", 10**9)):
        monkeypatch.setattr(projection, "_MANY", most)
        bank = build_bank(record.fit, record.noise, effects)
        each = bank.scores(bank.compared(record.fit.residual))
        found[name] = {key: each[rows].max() for key, rows in bank.rows().items()}
        found[name]["numbers"] = len(bank.columns)
    assert found["part"]["numbers"] < found["whole"]["numbers"] / 3.0
    loud = {key: score for key, score in found["whole"].items() if 50.0 < score < 1e4}
    assert "impulse" in loud
    for key, score in loud.items():
        assert found["part"][key] == pytest.approx(score, rel=0.03)


WORTH = {
    "frequency-drift": 8.0,
    "equilibrium-step": 8.0,
    "amplitude-step": 8.0,
    "frequency-step": 8.0,
    "impulse": 8.0,
    "sensor-quadratic": 8.0,
    "sensor-cubic": 8.0,
    "cubic-stiffness": 8.0,
    "offset-drift": 8.0,
    "release-transient": 8.0,
    "damping-drift": 0.1,
    "stribeck-friction": 0.1,
}
"""Standard deviations. More of the last two would move a and c by as much as they are."""


@pytest.mark.parametrize("name", tuple(WORTH))
def test_an_effect_scores_its_size_times_its_columns_length(name: str) -> None:
    """Moved nonlinearly and refitted, to 3 %."""
    fit, data, noise, bank = perfect()
    rows, worth = bank.rows()[name], WORTH[name]
    row = rows[len(rows) // 2]
    candidate = bank.candidates[row]
    _, (length,) = scores_and_lengths(fit, noise, candidate.effect, [candidate.shape])
    size = worth / length
    truth = np.concatenate([TRUTH, [size], candidate.shape])
    readings = fit.model.adding(candidate.effect).reading(truth)
    moved = Data(data.time_s, readings, INTERVAL_S, True, data.weight)
    left = refine(fit.model, moved, noise, TRUTH, held=(3,)).residual
    assert bank.columns[:, bank.first[row]] @ left == pytest.approx(worth, rel=0.03)
    assert bank.scores(left)[row] == pytest.approx(worth**2, rel=0.06)


@pytest.mark.parametrize("name", ["sensor-cubic", "frequency-drift", "equilibrium-step"])
def test_a_score_of_noise_is_chi_squared_of_one_degree_of_freedom(name: str) -> None:
    bank, drawn = white_residuals(1500)
    assert kstest(bank.scores(drawn)[bank.rows()[name][0]], chi2(1).cdf).pvalue > 1e-3


def test_a_size_that_cannot_be_negative_scores_with_its_own_sign_alone() -> None:
    bank, drawn = white_residuals(1500)
    sided = [row for row, c in enumerate(bank.candidates) if c.effect.one_sided]
    assert sided
    scores = bank.scores(drawn)[sided[0]]
    assert abs(np.count_nonzero(scores == 0.0) - 750) < 4.0 * np.sqrt(1500 / 4)
    assert kstest(scores[scores > 0.0], chi2(1).cdf).pvalue > 1e-3


def test_local_p_values_of_noise_are_uniform_whatever_the_columns() -> None:
    """Two-sided candidates of one column and of several alike."""
    bank, drawn = white_residuals(600)
    local = local_p_values(bank.scores(drawn), bank.freedom)
    several = np.flatnonzero(bank.freedom > 1)
    assert len(several)
    for row in (several[0], several[-1], bank.rows()["sensor-quadratic"][0]):
        assert kstest(local[row], "uniform").pvalue > 1e-3


def test_the_strongest_tone_leads_where_no_p_value_is_above_zero() -> None:
    """Two tones so strong that chance has no number for either: the larger one is the lead."""
    data, noise = prepared(
        other_engine(TRUTH)
        + 8e-3 * np.cos(2.0 * np.pi * 2.3 * TIME_S)
        + 2e-3 * np.cos(2.0 * np.pi * 0.2 * TIME_S)
    )
    fit = refine(Model(TIME_S, INTERVAL_S), data, noise, TRUTH)
    tone = by_identifier("tone-pickup")
    (lead,) = detect(prepare(fit, data, noise, [tone]), fit, seed=1).leads
    assert lead.shape[0] == pytest.approx(2.3, abs=0.01)


# What is left beside a name speaks for it.


@pytest.mark.structure
@pytest.mark.parametrize("part", [0.002, 0.004, 0.008])
def test_none_of_these_is_charged_by_how_seldom_chance_leaves_so_little(part: float) -> None:
    """Of forty wrong laws each leaves any part of an amplitude; drawn, the least of them."""
    least = np.random.default_rng(1).random((20_000, 40)).min(axis=1)
    search = SimpleNamespace(
        unexplained=0.0,
        first=SimpleNamespace(leads=[None] * 40),
        steps=(),
        remainder=SimpleNamespace(excess=1e6 * part**2, systematic=True),
    )
    charge = weighing._little_left(search, by_identifier("impulse"), 1e6 * (1.0 - part**2))
    drawn = np.mean(least < part)
    assert np.exp(-0.5 * charge) == pytest.approx(drawn, rel=0.2)
