"""The dozen lines that a diagnosis prints, and the same as fields."""

import json
from dataclasses import replace
from typing import Any

import pytest

from pendpipe.diagnosis.held_out import HeldOut
from pendpipe.diagnosis.remainder import Remainder
from pendpipe.diagnosis.result import Diagnosis, FittedModel, FoundEffect
from pendpipe.effects.catalogue import CATALOGUE
from pendpipe.estimate import Estimate

from .records import diagnosed
from .test_statement import named

REST = Remainder(1e4, 6.0, 40.0, {"phase": 0.8, "offset": 0.2})


def parameters(frequency_hz: float) -> dict[str, Estimate]:
    return {
        "b": Estimate(0.0123, 0.0002, "1/s"),
        "frequency": Estimate(frequency_hz, 2.3e-5, "Hz"),
        "phase": Estimate(0.1, 0.001, "rad"),
    }


def diagnosis(*effects: FoundEffect, **more: Any) -> Diagnosis:
    before = FittedModel(parameters(0.9), 2e-4, 4.0)
    after = FittedModel(parameters(0.91), 1e-4, 1.0)
    verdict = "missing-physics" if effects else "consistent"
    held = HeldOut(1000.0, 1050.0, 5.0, 2e-4, 1.1e-4, 12, 11)
    scanned = tuple((each.identifier, 0.5) for each in CATALOGUE)
    return Diagnosis(
        "eq8",
        before,
        after,
        1e-4,
        verdict,
        0.0 if effects else 0.9,
        effects,
        held,
        1e-4,
        0.9,
        "details",
        scanned=scanned,
        **more,
    )


def likely(identifier: str, probability: float, *rivals: tuple[str, float]) -> FoundEffect:
    return replace(named(identifier), probability=probability, indistinguishable=rivals)


def test_a_healthy_pendulum_takes_one_line() -> None:
    healthy = diagnosis()
    assert healthy.statement == "nothing is missing (p = 0.9)"
    assert healthy.to_dict()["summary"]["missing"] == []


def test_what_is_presumed_is_fitted_and_not_missing() -> None:
    presumed = replace(named("circular-error"), presumed=True)
    assert replace(diagnosis(), effects=(presumed,)).statement == (
        "nothing is missing beyond sin x, which is fitted (p = 0.9)"
    )


@pytest.mark.parametrize(
    ("effect", "headline", "candidates"),
    [
        (likely("impulse", 0.9), "missing: impulse", ""),
        # A class counts together.
        (
            likely("clock-drift", 0.3, ("frequency-drift", 0.4)),
            "missing: drifting frequency or drifting clock (70 % together)",
            "",
        ),
        (
            likely("clock-drift", 0.22, ("frequency-drift", 0.08)),
            "something is missing, its cause is NOT known",
            "drifting clock (22 %)",
        ),
        (
            likely("impulse", 0.08, ("backlash", 0.08)),
            "something is missing, its cause is NOT known",
            "none above 20 %",
        ),
    ],
)
def test_a_name_is_given_from_one_half_on(
    effect: FoundEffect, headline: str, candidates: str
) -> None:
    found = diagnosis(effect)
    assert found.summary.headline == headline
    assert found.summary.candidates == candidates
    assert found.statement.splitlines()[0] == headline
    below = [f"{p:.0%}" for p in (0.08,)]
    assert not any(percent in found.statement for percent in below)


def test_the_answer_has_a_dozen_lines_in_the_order_of_the_questions() -> None:
    found = diagnosis(likely("impulse", 0.9, ("backlash", 0.06)), remainder=REST, name="a.csv")
    lines = str(found).splitlines()
    assert len(lines) <= 12
    order = [
        "a.csv: missing: impulse, and a rest of unknown cause",
        "  how much it matters   the fit misses the readings by 200 µrad (noise 100 µrad): T0",
        "  where                 throughout the record; what is left lies in the phase (80 %)",
        "  sure                  impulse 90 %; cycles left out of the fit are predicted better in",
        "  looked for and not it second mode, ",
        "  decide by ",
        "  quote                 T0 1.098901(28) s",
    ]
    for line, start in zip(lines, order, strict=False):
        assert line.startswith(start)
    assert lines[-1].startswith("Copy: “Eq. 8 does not describe this recording (p < 1e-12)")


def test_the_table_shows_the_numbers_as_fitted_and_with_what_is_missing() -> None:
    found = diagnosis(likely("impulse", 0.9))
    (period, b) = found.to_dict()["summary"]["consequence"]
    assert (period["quantity"], b["quantity"]) == ("period", "b")
    assert period["fitted"]["value"] == pytest.approx(1.0 / 0.9)
    assert period["with_missing"]["value"] == pytest.approx(1.0 / 0.91)
    assert period["moved_sd"] > 100.0
    assert b["moved_sd"] == 0.0
    old, new = found.summary.table().splitlines()[1:]
    assert "1.111111(28) s" in old
    assert "1.098901(28) s" in new


def test_parameters_have_words_and_units_and_differ_from_zero() -> None:
    effect = replace(
        likely("second-mode", 0.9),
        parameters={
            "q_cosine": Estimate(3e-3, 1e-4, "rad"),
            "q_sine": Estimate(4e-3, 1e-4, "rad"),
            "f_2": Estimate(1.5, 0.01, "Hz"),
            "tau_2": Estimate(0.0, 970000.0, "s"),
        },
    )
    assert diagnosis(effect).summary.missing == (
        "second mode (frequency 1.500(10) Hz, amplitude 0.00500(10) rad)",
    )


def test_a_diagnosis_prints_as_its_answer() -> None:
    outcome = diagnosed("circular-error")
    assert str(outcome) == repr(outcome)
    content = json.loads(json.dumps(outcome.to_dict()))
    assert str(outcome).endswith(content["statement"])
    assert content["summary"]["headline"] in outcome._repr_html_()
    assert content["details"].startswith("Eq. 8 does not describe this recording")
