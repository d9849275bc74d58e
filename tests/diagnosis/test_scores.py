"""Scores: unit columns orthogonal to the derivatives by the baseline's parameters."""

import functools

import numpy as np
import pytest
from scipy.stats import chi2, kstest

from pendpipe.arrays import FloatArray
from pendpipe.diagnosis import blocks
from pendpipe.diagnosis.data import Data
from pendpipe.diagnosis.detect import (
    Bank,
    build_bank,
    detect,
    prepare,
)
from pendpipe.diagnosis.hypothesis import applicable
from pendpipe.diagnosis.noise import Noise
from pendpipe.diagnosis.projection import local_p_values, scores_and_lengths, tangent_basis
from pendpipe.diagnosis.refine import Fit, refine
from pendpipe.effects.catalogue import CATALOGUE, by_identifier
from pendpipe.effects.model import Model

from .decays import Pendulum, fitted
from .records import INTERVAL_S, TIME_S, TRUTH, other_engine, prepared


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
    for candidate in bank.candidates:
        own = columns[:, candidate.first : candidate.first + candidate.width]
        np.testing.assert_allclose(own.T @ own, np.eye(candidate.width), atol=1e-5)


def test_of_a_long_record_blocks_of_cycles_tell_all(monkeypatch: pytest.MonkeyPatch) -> None:
    """A third of the numbers keeps 97 % of what a kick among 1,300 cycles lowers chi^2 by."""
    long = Pendulum(quality_factor=1500.0, quadratic=0.0, coulomb=0.0, count=30_000)
    kicked = Model(long.times(), 1.0 / long.rate_hz, effects=(by_identifier("impulse"),))
    values = np.append(long.values(), [2e-3, 700.0])
    noise = 1e-3 * np.random.default_rng(18).standard_normal(long.count)
    record = fitted(long, kicked.reading(values) + noise)
    effects = [e for e in applicable(CATALOGUE, record.fit, "eq8", "rad") if not e.spectral]
    found = {}
    for name, most in (("part", 16_000), ("whole", 10**9)):
        monkeypatch.setattr(blocks, "_MANY", most)
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
    assert bank.columns[:, candidate.first] @ left == pytest.approx(worth, rel=0.03)
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
    several = [row for row, c in enumerate(bank.candidates) if c.width > 1]
    assert several
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
