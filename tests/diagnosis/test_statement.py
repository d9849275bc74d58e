"""The details of a diagnosis: their lines, names, units and digits."""

from dataclasses import replace

import pytest

from pendpipe.diagnosis.result import FittedModel, FoundEffect, Location
from pendpipe.diagnosis.summary import statement
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


BEFORE = FittedModel({"b": Estimate(0.0123, 0.0002, "1/s")}, 2e-4, 4.0)


def details(effect: FoundEffect) -> list[str]:
    return statement("eq8", BEFORE, [effect], 1e-4, 0.0, 0.5, 0.01).splitlines()


def test_a_line_says_whether_the_law_holds_one_each_effect_and_one_what_is_left() -> None:
    parameter = Estimate(1.7573525e-05, 1.4961e-05, "rad/s")
    law, effect, rest = details(named("impulse", dv=parameter))
    assert law.startswith("Eq. 8 does not describe this recording (p < 1e-12)")
    assert law.endswith("200 µrad rms, 2 times the noise of 100 µrad.")
    assert effect.startswith(
        "Impulse 90 %; dv = (1.8 ± 1.5) × 10⁻⁵ rad/s; throughout the record; decide by: "
    )
    assert rest == "The remaining residual is consistent with noise (p = 0.5)."


def test_a_class_is_listed_with_the_likeliest_first() -> None:
    fitted = replace(
        named("clock-drift", rate=Estimate(1.66e-4, 1.1e-5, "1/s")),
        probability=0.2,
        indistinguishable=(("frequency-drift", 0.67), ("unnamed-restoring", 0.002)),
    )
    assert details(fitted)[1].startswith(
        "Drifting frequency 67 %, drifting clock 20 %, a restoring torque of unknown form < 1 %"
        " (not told apart); rate = "
    )


def test_what_eq_8_describes_needs_no_effect() -> None:
    text = statement("eq8", FittedModel({}, 1e-4, 1.0), [], 1e-4, 0.4, 0.4, 0.01)
    assert text.startswith("Eq. 8 describes this recording")
    assert "p = 0.4" in text


def test_a_question_ends_as_one() -> None:
    """What decides may be asked: "what touched it?"."""
    step = named("amplitude-step")
    assert step.discriminating_test.endswith("?")
    assert details(step)[1].endswith(f"decide by: {step.discriminating_test}")


def test_a_pure_number_has_no_unit() -> None:
    """As in every other result: "" in JSON, and nothing behind the number in print."""
    numbers = [p for effect in CATALOGUE for p in effect.parameters if p.unit == "1"]
    assert numbers
    for parameter in numbers:
        assert parameter.unit_in("rad") == ""
    unit = by_identifier("amplitude-step").parameters[0].unit_in("m")
    step = named("amplitude-step", s=Estimate(0.01, 0.001, unit))
    assert "s = 0.0100 ± 0.0010; " in details(step)[1]


def test_lost_samples_are_reported_as_the_delay_of_later_readings() -> None:
    """Three readings are missing: what follows was read three intervals later."""
    (effect,) = diagnosed("dropped-samples").effects
    late = effect.parameters["d"]
    assert late.value == pytest.approx(3.0 * INTERVAL_S)
    assert late.unit == "s"
    assert effect.parameters["samples"].value == 3.0


def test_what_a_test_has_counted_is_said_in_words_alone() -> None:
    codes = named(
        "missing-codes",
        number=Estimate(0.0, 0.0, ""),
        found=Estimate(0.0, 1.0, ""),
        bit=Estimate(0.0, 0.0, ""),
    )
    assert details(codes)[1].startswith("Missing codes 90 %; throughout the record")
