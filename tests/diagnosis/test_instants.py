"""Intervals of instants hold the truth, in whichever half cycle chi^2 has its minimum."""

import numpy as np
import pytest

from pendpipe.arrays import FloatArray
from pendpipe.diagnosis.instants import with_instants
from pendpipe.diagnosis.projection import finer_shape
from pendpipe.diagnosis.refine import refine
from pendpipe.diagnosis.values import effect_parameters
from pendpipe.effects.catalogue import by_identifier
from pendpipe.effects.model import Model
from pendpipe.estimate import Estimate

from .records import FREQUENCY_HZ, INTERVAL_S, NOISE_RAD, TIME_S, TRUTH, other_engine, prepared
from .records import white as noise_of

INSTANT_S = 41.3


def told(
    identifier: str, size: float, seed: int
) -> tuple[dict[str, Estimate], dict[str, Estimate], FloatArray]:
    """Estimates of a size and an instant, by the fit and over half cycles; and the truth."""
    effect = by_identifier(identifier)
    model = Model(TIME_S, INTERVAL_S)
    truth = np.array([size, INSTANT_S])
    clean = model.adding(effect).reading(np.append(TRUTH, truth))
    data, noise = prepared(clean + noise_of(seed))
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


@pytest.mark.parametrize(("identifier", "size"), [("equilibrium-step", 4e-5), ("impulse", 2.5e-4)])
def test_weak_steps_and_knocks_lie_within_their_intervals(identifier: str, size: float) -> None:
    """At Delta chi^2 of some 40, chi^2 has minima in several half cycles."""
    narrow: list[bool] = []
    wide: list[bool] = []
    for seed in range(30):
        by_fit, over_cycles, truth = told(identifier, size, seed)
        narrow += holds(by_fit, truth)
        wide += holds(over_cycles, truth)
    # 95 % of 60, and three standard deviations below it.
    assert np.mean(wide) > 0.95 - 3.0 * np.sqrt(0.95 * 0.05 / len(wide))
    assert np.mean(wide) > np.mean(narrow)


def test_a_hard_knock_is_known_to_a_part_of_a_cycle() -> None:
    _, estimates, truth = told("impulse", 50.0 * NOISE_RAD, 1)
    assert all(holds(estimates, truth))
    assert 1.96 * estimates["time"].sd < 0.25 / FREQUENCY_HZ


def test_an_effect_without_an_instant_is_unchanged() -> None:
    effect = by_identifier("frequency-drift")
    data, noise = prepared(other_engine(TRUTH) + noise_of(2))
    fit = refine(Model(TIME_S, INTERVAL_S), data, noise, TRUTH)
    known = {"rate": Estimate(1.0, 0.1, "1/s")}
    assert with_instants(known, effect, fit, noise) is known
