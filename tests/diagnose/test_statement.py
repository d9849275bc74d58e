"""What the paragraph says, and by which names and in which units its numbers are told."""

from __future__ import annotations

from dataclasses import replace

import pytest

from pendpipe.diagnose.held_out import HeldOut
from pendpipe.diagnose.result import FittedModel, FoundEffect, Location
from pendpipe.diagnose.statement import statement
from pendpipe.effects.catalogue import CATALOGUE, by_identifier
from pendpipe.estimate import Estimate

from .records import INTERVAL_S, diagnosed


def named(identifier: str, **parameters: Estimate) -> FoundEffect:
    effect = by_identifier(identifier)
    return FoundEffect(
        effect.identifier,
        effect.name,
        effect.kind,
        effect.equation,
        parameters,
        500.0,
        1e-9,
        0.9,
        (),
        effect.discriminating_test,
        Location(summary="throughout the record"),
    )


def said(effect: FoundEffect, gain: float = 50.0) -> str:
    before, after = FittedModel({}, 2e-4, 4.0), FittedModel({}, 1e-4, 1.0)
    held = HeldOut(1000.0, 1000.0 + gain, 5.0)
    return statement("eq8", before, after, [effect], held, 1e-4, 0.5, 0.01)


def test_a_model_that_predicts_worse_is_said_to() -> None:
    """A gain below zero is a loss: what was named has failed the test on readings it never saw."""
    step = named("equilibrium-step", J=Estimate(1e-3, 1e-5, "rad"))
    better, worse = said(step, 50.0), said(step, -50.0)
    assert "predicted better by 50 +- 5" in better
    assert "does not stand" not in better
    assert "predicted worse by 50 +- 5" in worse
    assert "does not stand this test" in worse
    assert "better" not in worse


def test_a_question_ends_as_one() -> None:
    """What decides may be asked: "what touched it?"."""
    rival = replace(named("amplitude-step"), indistinguishable=(("impulse", 0.2),))
    assert rival.discriminating_test.endswith("?")
    assert f"impulse: {rival.discriminating_test} With it" in said(rival)


def test_a_pure_number_has_no_unit() -> None:
    """As in every other result: "" in JSON, and nothing behind the number in the paragraph."""
    numbers = [p for effect in CATALOGUE for p in effect.parameters if p.unit == "1"]
    assert numbers
    for parameter in numbers:
        assert parameter.unit_in("rad") == ""
    unit = by_identifier("amplitude-step").parameters[0].unit_in("m")
    assert "s = 0.01 +- 0.001)" in said(named("amplitude-step", s=Estimate(0.01, 0.001, unit)))


def test_lost_samples_are_told_by_the_time_by_which_later_readings_are_late() -> None:
    """Three readings are missing: what follows was read three intervals later."""
    (effect,) = diagnosed("dropped-samples").diagnosis.effects
    late = effect.parameters["d"]
    assert late.value == pytest.approx(3.0 * INTERVAL_S)
    assert late.unit == "s"
    assert effect.parameters["samples"].value == 3.0
