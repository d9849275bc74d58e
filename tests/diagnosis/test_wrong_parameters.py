"""A wrong prediction, missing physics, or both: distinguished from each other."""

import numpy as np
import pytest

from pendpipe.diagnosis.result import Diagnosis
from pendpipe.diagnosis.run import diagnose_recording
from pendpipe.effects.baseline import A, B, C
from pendpipe.effects.catalogue import by_identifier
from pendpipe.effects.model import Model

from .records import (
    FREQUENCY_HZ,
    INTERVAL_S,
    TIME_S,
    TRUTH,
    other_engine,
    recording,
    with_effects,
)


def names(outcome: Diagnosis) -> set[str]:
    return {effect.identifier for effect in outcome.effects}


@pytest.mark.parametrize("factor", [0.6, 1.25])
def test_a_wrong_loss_is_no_drift_and_comes_out_right(factor: float) -> None:
    """Of whatever size: to first order a drift or a curve may look the better."""
    given = {"b": factor * float(TRUTH[B])}
    outcome = diagnose_recording(recording(other_engine(TRUTH), 6), fixed=given)
    assert names(outcome) == {"parameter-b"}
    assert outcome.effects[0].kind == "parameter"
    assert outcome.effects[0].probability > 0.9
    found = outcome.improved.parameters["b"]
    assert abs(found.value - TRUTH[B]) < 4.0 * found.sd


def test_two_wrong_losses_are_not_an_unnamed_third() -> None:
    given = {"a": 0.5 * float(TRUTH[A]), "c": 2.0 * float(TRUTH[C])}
    outcome = diagnose_recording(recording(other_engine(TRUTH), 6), fixed=given)
    assert names(outcome) == {"parameter-a", "parameter-c"}
    for name, index in (("a", A), ("c", C)):
        found = outcome.improved.parameters[name]
        assert abs(found.value - TRUTH[index]) < 4.0 * found.sd


def test_of_several_predictions_the_wrong_one_is_reported() -> None:
    given = {"a": 1.5 * float(TRUTH[A]), "b": float(TRUTH[B]), "c": float(TRUTH[C])}
    outcome = diagnose_recording(recording(other_engine(TRUTH), 6), fixed=given)
    assert names(outcome) == {"parameter-a"}


@pytest.mark.parametrize("excess", [5.5e-4, 5e-3])
def test_a_wrong_frequency_and_circular_error_are_both_reported(excess: float) -> None:
    """The one shifts the frequency throughout, the other with the amplitude's square."""
    given = {"frequency": (1.0 + excess) * FREQUENCY_HZ}
    outcome = diagnose_recording(recording(with_effects("circular-error"), 3), fixed=given)
    assert names(outcome) == {"parameter-frequency", "circular-error"}
    found = outcome.improved.parameters["frequency"]
    assert abs(found.value - FREQUENCY_HZ) < 4.0 * found.sd


def test_right_predictions_are_not_blamed_for_missing_physics() -> None:
    """All losses given and true, and one that nobody knew: a free a and b would do as well."""
    effect = by_identifier("cubic-damping")
    readings = Model(TIME_S, INTERVAL_S, (effect,)).reading(np.append(TRUTH, [0.05, 1.0]))
    given = {"a": float(TRUTH[A]), "b": float(TRUTH[B]), "c": float(TRUTH[C])}
    (found,) = diagnose_recording(recording(readings, 3), fixed=given).effects
    assert not found.identifier.startswith("parameter")
    suspected = dict(found.indistinguishable)
    assert "cubic-damping" in {found.identifier, *suspected}
    assert sum(odds for name, odds in suspected.items() if name.startswith("parameter")) < 0.1
