"""Maximum likelihood: from far away, within bounds, with valid errors."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import chi2

from pendpipe.arrays import FloatArray
from pendpipe.diagnosis.noise import white_noise
from pendpipe.diagnosis.refine import best_fit, damping_for, refine
from pendpipe.effects.baseline import OFFSET, OMEGA, SHARE, START, TIME, A, B, C
from pendpipe.effects.catalogue import by_identifier
from pendpipe.effects.model import Evaluated, Model

from .records import (
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
    # Trial models overflow, as in `diagnose_decay`.
    with np.errstate(over="ignore", invalid="ignore"):
        assert best_fit(fit.model, data, noise, [beyond]) is None
        found = best_fit(fit.model, data, noise, [beyond, fit.value])
    assert found.chi2 == pytest.approx(fit.chi2, rel=1e-6)


def test_a_step_without_a_limit_is_not_damped_however_long_it_is() -> None:
    """Where its length overflows, too: an imitation that leaves 1e152 of itself."""
    pull, squares = np.array([-1e152, 1e142]), np.array([5.9, 1e-9])
    with np.errstate(over="ignore"):
        assert damping_for(pull, squares, np.inf) == 0.0
    assert damping_for(np.array([3.0]), np.array([1.0]), 1.0) == pytest.approx(2.0, rel=1e-2)
