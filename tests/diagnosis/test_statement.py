"""The details of a diagnosis: their order, words, names, units and digits."""

from __future__ import annotations

from dataclasses import replace

import pytest

from pendpipe.diagnosis.held_out import HeldOut
from pendpipe.diagnosis.result import FittedModel, FoundEffect, Location
from pendpipe.diagnosis.statement import statement
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


def paragraph(effect: FoundEffect, gain: float = 50.0) -> str:
    before, after = (
        FittedModel(parameters(0.9), 2e-4, 4.0),
        FittedModel(parameters(0.91), 1e-4, 1.0),
    )
    held = HeldOut(1000.0, 1000.0 + gain, 5.0, 2e-4, 1.1e-4, 12, 11 if gain > 0.0 else 3)
    return statement("eq8", before, after, [effect], held, 1e-4, 0.0, 0.5, 0.01)


def parameters(frequency_hz: float) -> dict[str, Estimate]:
    return {
        "b": Estimate(0.0123, 0.0002, "1/s"),
        "frequency": Estimate(frequency_hz, 2.3e-5, "Hz"),
        "phase": Estimate(0.1, 0.001, "rad"),
    }


def test_it_answers_in_the_order_in_which_a_student_asks() -> None:
    """Does Eq. 8 hold, what is missing, how sure, how much does it explain, what changes, rest."""
    text = paragraph(named("circular-error"))
    order = [
        "Eq. 8 does not describe this recording (p < 1e-12)",
        "200 µrad rms, 2 times the noise of 100 µrad",
        "Missing from the model of the pendulum: circular error",
        "sin x",
        "probability 90 %",
        "What to measure next: release it again with half the amplitude",
        "from 200 µrad to 100 µrad rms, by a factor of 2",
        "small-angle period from 1.111111 to (1.098901 ± 0.000028) s",
        "The remaining residual is consistent with noise (p = 0.5)",
    ]
    places = [text.find(part) for part in order]
    assert -1 not in places
    assert places == sorted(places)


def test_numbers_are_rounded_to_their_errors() -> None:
    """Two digits of the error: 1/0.91 Hz is known to 28 us, Q = pi f/b to 2 %."""
    text = paragraph(named("impulse", dv=Estimate(1.7573525e-05, 1.4961e-05, "rad/s")))
    assert "dv = (1.8 ± 1.5) × 10⁻⁵ rad/s" in text
    assert "from 1.111111 to (1.098901 ± 0.000028) s" in text
    assert "leaves the Q limit (pi f/b) at 232.4 ± 3.8, within its error" in text


def test_a_doubtful_name_is_only_possibly_missing() -> None:
    doubtful = replace(
        named("tone-pickup"),
        probability=0.35,
        indistinguishable=(("periodic-drive", 0.3), ("unnamed-drive", 0.004)),
    )
    text = paragraph(doubtful)
    assert "Possibly missing from the model of the measurement: tone in the reading" in text
    assert "cannot distinguish it from periodic drive (30 %)." in text
    assert "An unknown drive would fit almost as well, but is less probable than 1 %." in text


def test_a_name_that_is_not_sure_leads_no_sentence() -> None:
    """What only describes the misfit is no finding: it is said to have no certain cause."""
    text = paragraph(replace(named("impulse"), probability=0.01))
    assert "issing from" not in text
    assert "The misfit has no certain cause; it is described best by impulse." in text


def test_what_eq_8_describes_needs_no_effect() -> None:
    model = FittedModel(parameters(0.9), 1e-4, 1.0)
    text = statement("eq8", model, model, [], None, 1e-4, 0.4, 0.4, 0.01)
    assert text.startswith("Eq. 8 describes this recording")
    assert "p = 0.4" in text


def test_a_model_that_predicts_worse_fails_this_test() -> None:
    """A gain below zero is a loss: the effect failed on cycles left out of the fit."""
    step = named("equilibrium-step", J=Estimate(1e-3, 1e-5, "rad"))
    better, worse = paragraph(step, 50.0), paragraph(step, -50.0)
    assert "predicted better in 11 of 12 parts of the record (from 200 µrad to 110 µrad" in better
    assert "fails this test" not in better
    assert "predicted worse in 9 of 12 parts of the record" in worse
    assert "fails this test" in worse
    assert "better" not in worse


def test_a_question_ends_as_one() -> None:
    """What decides may be asked: "what touched it?"."""
    rival = replace(named("amplitude-step"), indistinguishable=(("impulse", 0.2),))
    assert rival.discriminating_test.endswith("?")
    assert (
        f"impulse (20 %). What to measure next: {rival.discriminating_test} Including"
        in paragraph(rival)
    )


def test_a_pure_number_has_no_unit() -> None:
    """As in every other result: "" in JSON, and nothing behind the number in the paragraph."""
    numbers = [p for effect in CATALOGUE for p in effect.parameters if p.unit == "1"]
    assert numbers
    for parameter in numbers:
        assert parameter.unit_in("rad") == ""
    unit = by_identifier("amplitude-step").parameters[0].unit_in("m")
    assert "s = 0.0100 ± 0.0010)" in paragraph(
        named("amplitude-step", s=Estimate(0.01, 0.001, unit))
    )


def test_lost_samples_are_reported_as_the_delay_of_later_readings() -> None:
    """Three readings are missing: what follows was read three intervals later."""
    (effect,) = diagnosed("dropped-samples").effects
    late = effect.parameters["d"]
    assert late.value == pytest.approx(3.0 * INTERVAL_S)
    assert late.unit == "s"
    assert effect.parameters["samples"].value == 3.0


def test_the_likelier_cause_is_named_first() -> None:
    """Where a rival is more probable than what was fitted, no name stands for itself."""
    fitted = replace(
        named("clock-drift", rate=Estimate(1.66e-4, 1.1e-5, "1/s")),
        probability=0.2,
        indistinguishable=(("frequency-drift", 0.67), ("unnamed-restoring", 0.002)),
    )
    text = paragraph(fitted)
    assert (
        "Missing from the model: drifting frequency (67 %) or drifting clock (20 %), which this"
        " recording alone cannot distinguish. Throughout the record." in text
    )
    assert text.count("drifting frequency") == 1


def test_of_curves_that_describe_a_misfit_none_is_the_best_where_another_is_likelier() -> None:
    curve = replace(
        named("impulse"), probability=0.004, indistinguishable=(("unnamed-drive", 0.99),)
    )
    assert "any of these describes it: an unknown drive or impulse." in paragraph(curve)


def test_what_a_test_has_counted_is_said_in_words_alone() -> None:
    codes = named(
        "missing-codes",
        number=Estimate(0.0, 0.0, ""),
        found=Estimate(0.0, 1.0, ""),
        bit=Estimate(0.0, 0.0, ""),
    )
    assert "missing codes (probability 90 %)." in paragraph(codes)
