"""How often chance alone does as well somewhere in a scan."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import binom, kstest

from pendpipe.arrays import FloatArray
from pendpipe.diagnosis.detect import (
    Bank,
    Candidate,
    Chance,
    Lead,
    Scanner,
    Trials,
    detect,
    draw_chance,
    prepare,
)
from pendpipe.diagnosis.hypothesis import applicable
from pendpipe.diagnosis.noise import Noise
from pendpipe.diagnosis.projection import local_p_values
from pendpipe.diagnosis.rivals import Rival, Scale, evidence
from pendpipe.effects.catalogue import CATALOGUE, by_identifier

from .records import null_fit

WHITE = Noise(np.ones(60), np.ones(60))


NOTHING = np.zeros((60, 0))


def bank_of(columns: FloatArray) -> Bank:
    """One effect of as many shapes as there are columns, with nothing fitted."""
    effect, count = by_identifier("offset-drift"), columns.shape[1]
    candidates = tuple(Candidate(effect, (float(k),), k, 1) for k in range(count))
    return Bank(NOTHING, columns.astype(np.float32), candidates, np.zeros(count))


def scanner_of(bank: Bank) -> Scanner:
    """A scan of it without tones."""
    return Scanner(bank, WHITE, NOTHING)


@pytest.mark.parametrize("number", [1, 7, 100])
def test_the_global_p_value_of_the_smallest_of_independent_ones_is_uniform(number: int) -> None:
    smallest = np.random.default_rng(number).random((2000, number)).min(axis=1)
    found = [Trials(float(number), 0.0).global_p_value(float(local)) for local in smallest]
    assert kstest(found, "uniform").pvalue > 1e-3


@given(st.floats(1e-300, 1.0), st.floats(1.0, 1e5), st.floats(0.0, 0.1))
def test_looking_at_more_makes_nothing_rarer(local: float, trials: float, growth: float) -> None:
    found = Trials(trials, growth).global_p_value(local)
    assert local * (1.0 - 1e-9) <= found <= 1.0
    assert found <= Trials(2.0 * trials, growth).global_p_value(local)
    assert found <= Trials(trials, growth).global_p_value(min(2.0 * local, 1.0)) * (1.0 + 1e-9)
    assert Trials(trials, growth).global_p_value(0.0) == 0.0


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


@pytest.mark.parametrize("name", ["equilibrium-step", "offset-drift"])
def test_a_gain_too_large_for_p_values_is_worth_as_much_more_as_it_is_larger(name: str) -> None:
    """P-values underflow at a chi^2 of 1331; the rarer, the more trials are charged beyond it."""
    fit, _, _ = null_fit()
    chance = Chance(Trials(1.0, 0.0), {name: Trials(60.0, 0.5)})
    lead = Lead(by_identifier(name), (), 0.0, 0.0)
    below, above = (evidence(lead, fit, gain, chance) for gain in (1325.0, 1345.0))
    assert above - below == pytest.approx(20.0, abs=0.3)


def test_who_is_behind_stays_as_far_behind_whatever_else_was_left_at_first() -> None:
    """Found while fifty times the noise was left, both are refitted where none of that is."""
    fit, _, _ = null_fit()
    lead = Lead(by_identifier("circular-error"), (), 0.0, 0.0)
    best, other = (Rival(lead, fit, gain, gain / 50.0, gain / 50.0 - 8.0) for gain in (9e5, 6e5))
    scale = Scale(fit.chi2)
    better = best.again(fit, fit.chi2 + 400.0, scale)
    worse = other.again(fit, fit.chi2 + 350.0, scale)
    assert better.evidence == pytest.approx(400.0 - 8.0)
    assert better.evidence - worse.evidence == pytest.approx(50.0)
