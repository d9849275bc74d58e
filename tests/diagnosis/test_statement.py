"""What a diagnosis says: its summary, its statement, where it lies, and what is left over."""

import json
import math
import re
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pendpipe.arrays import FloatArray
from pendpipe.diagnosis.data import Data
from pendpipe.diagnosis.detect import Lead
from pendpipe.diagnosis.found import FittedModel, FoundEffect, Location, Mate, verdict_of
from pendpipe.diagnosis.held_out import HeldOut
from pendpipe.diagnosis.location import locate, mains_of
from pendpipe.diagnosis.missing_force import curve_told
from pendpipe.diagnosis.noise import Noise, white_noise
from pendpipe.diagnosis.refine import Fit, Remainder, refine, remainder_of, with_errors
from pendpipe.diagnosis.result import Diagnosis
from pendpipe.diagnosis.rivals import near_harmonic_by_chance
from pendpipe.diagnosis.summary import Change, Summary, numbers_of, test_of as measurement_of
from pendpipe.diagnosis.values import constants_of, curve_values, drawn_of
from pendpipe.dynamics.any_law import Motion
from pendpipe.dynamics.eq8 import OMEGA, TIME, A, B, C
from pendpipe.effects.catalogue import CATALOGUE, by_identifier
from pendpipe.effects.curves import (
    CURVES,
    Curve,
    damping_curve,
    drive_curve,
    friction_curve,
    offset_curve,
    reading_curve,
    restoring_curve,
)
from pendpipe.effects.effect import STRAIGHT_S, Effect, Parameter, Pendulum
from pendpipe.effects.model import Model
from pendpipe.estimate import Z95, Estimate
from pendpipe.quantities import with_error

from .records import (
    FREQUENCY_HZ,
    INSTANT_S,
    INTERVAL_S,
    NOISE_RAD,
    TIME_S,
    TONE_HZ,
    TRUTH,
    diagnosed,
    null_fit,
    other_engine,
    prepared,
    white,
)

# The details of a diagnosis: their lines, names, units and digits.


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


BEFORE = FittedModel("eq8", {"b": Estimate(0.0123, 0.0002, "1/s")}, 2e-4, 4.0, 1e-4)


def searched(unexplained: float, remainder: Remainder | None = None, p_value: float = 0.0) -> Any:
    """What a diagnosis asks of the search behind it."""
    return SimpleNamespace(
        unexplained=unexplained,
        p_value=p_value,
        beginning=SimpleNamespace(fit=None),
        drag_form="energy",
        remainder=remainder,
        data=SimpleNamespace(unit="rad", step=0.0),
        baseline=SimpleNamespace(model=SimpleNamespace(restoring="linear")),
        first=SimpleNamespace(leads=[Lead(each) for each in CATALOGUE]),
        notes={},
    )


def details(effect: FoundEffect) -> list[str]:
    found = Diagnosis(BEFORE, BEFORE, (effect,), None, search=searched(0.5))
    return found.details.splitlines()


def undisturbed(p_value: float) -> str:
    model = FittedModel("eq8", {}, 1e-4, 1.0, 1e-4)
    return Diagnosis(model, model, (), None, search=searched(p_value, p_value=p_value)).details


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
        indistinguishable=(Mate("frequency-drift", 0.67), Mate("unnamed-restoring", 0.002)),
    )
    assert details(fitted)[1].startswith(
        "Drifting frequency 67 %, drifting clock 20 %, a restoring torque of unknown form < 1 %"
        " (not distinguished); of drifting clock: rate = "
    )


@pytest.mark.parametrize(
    ("own", "rival", "p", "says"),
    [
        ("equilibrium-step", "amplitude-step", 0.67, "amplitude-step"),
        ("clock-drift", "frequency-drift", 0.04, "clock-drift"),
        ("clock-drift", "frequency-drift", 0.95, "frequency-drift"),
        ("presliding-friction", "unnamed-damping", 0.55, "unnamed-damping"),
    ],
)
@pytest.mark.structure
def test_the_likeliest_of_a_class_says_what_decides(
    own: str, rival: str, p: float, says: str
) -> None:
    """A name of probability near 0 must send nobody to the bench."""
    tests = {each.identifier: each.discriminating_test for each in (*reversed(CURVES), *CATALOGUE)}
    fitted = replace(named(own), probability=0.2, indistinguishable=(Mate(rival, p),))
    assert details(fitted)[1].removesuffix(".").endswith(f"decide by: {tests[says]}")
    assert diagnosis(fitted).summary.decide_by == tests[says]


@pytest.mark.parametrize(
    ("own", "rival", "says", "measure"),
    [
        ("clock-drift", "frequency-drift", "in the motion or in the sensor", "second sensor"),
        ("cubic-stiffness", "frequency-drift", "with time or with the amplitude", "half the ampl"),
        ("periodic-drive", "parametric-drive", "something periodic", "record the pendulum"),
        ("damping-drift", "frequency-drift", "a force that changes with time", "release it"),
        ("plane-coupling", "parametric-drive", "perhaps a second motion", "second sensor"),
    ],
)
@pytest.mark.structure
def test_what_has_no_name_is_told_by_what_its_candidates_share_and_a_test_of_it(
    own: str, rival: str, says: str, measure: str
) -> None:
    fitted = replace(named(own), probability=0.25, indistinguishable=(Mate(rival, 0.2),))
    summary = diagnosis(replace(fitted, discriminating_test=measurement_of(fitted))).summary
    assert summary.missing == ()
    for text in (summary.headline, summary.sentence):
        assert says in text
        assert rival not in text
    assert measure in summary.decide_by


def drifting(own: float, rival: str, p: float) -> FoundEffect:
    """A clock that drifts by a known rate, and its rival."""
    drift = named("clock-drift", rate=Estimate(1.66e-4, 1.1e-5, "1/s"))
    return replace(drift, probability=own, indistinguishable=(Mate(rival, p),))


STRAIGHT = Estimate(STRAIGHT_S, 0.0, "s")
SECOND_MODE = {
    "q_cosine": Estimate(3e-3, 1e-4, "rad"),
    "q_sine": Estimate(4e-3, 1e-4, "rad"),
    "f_2": Estimate(1.5, 0.01, "Hz"),
    "tau_2": Estimate(0.0, 970000.0, "s"),
}


@pytest.mark.parametrize(
    ("effect", "missing"),
    [
        (drifting(0.8, "frequency-drift", 0.1), "drifting clock (rate 1.66(11) × 10⁻⁴ s⁻¹; 80 %)"),
        # Where a rival leads the class, what was fitted says nothing.
        (drifting(0.1, "frequency-drift", 0.85), "drifting frequency (85 %)"),
        (
            drifting(0.5, "frequency-drift", 0.4),
            "drifting clock or drifting frequency (90 % together)",
        ),
        (drifting(0.1, "unnamed-restoring", 0.8), "a restoring torque of unknown form (80 %)"),
        (
            drifting(0.6, "frequency-drift", 0.04),
            "probably drifting clock (rate 1.66(11) × 10⁻⁴ s⁻¹; 60 %)",
        ),
        # They have words and units and differ from zero; a drift that is straight has no time.
        (
            named("second-mode", **SECOND_MODE),
            "second mode (amplitude 0.00500(10) rad, frequency 1.500(10) Hz; 90 %)",
        ),
        (
            named("offset-drift", rate=Estimate(1e-5, 1e-7, "rad/s"), tau=STRAIGHT),
            "drifting offset (rate 1.000(10) × 10⁻⁵ rad/s; 90 %)",
        ),
    ],
)
@pytest.mark.structure
def test_numbers_are_those_of_what_is_named(effect: FoundEffect, missing: str) -> None:
    assert diagnosis(effect).summary.missing == (missing,)


@pytest.mark.structure
def test_no_sentence_has_four_names_and_its_probabilities_are_those_of_the_json() -> None:
    """Two classes of two would be four; of five equal ones three have 60 % together."""
    pairs = (
        likely("impulse", 0.5, ("amplitude-step", 0.3)),
        likely("clock-drift", 0.3, ("frequency-drift", 0.4)),
    )
    five = likely("impulse", 0.2, *((each, 0.2) for each in list(ORDER)[:4]))
    six = likely("impulse", 0.16, *((each, 0.16) for each in ORDER))
    for effects, told in ((pairs, 1), ((five,), 1), ((six,), 0)):
        content = diagnosis(*effects).to_dict()
        sentence, missing = content["summary"]["sentence"], content["summary"]["missing"]
        assert len(missing) == told
        assert sum(each.name in sentence for each in CATALOGUE) <= 3
        by_name = {
            by_identifier(name).name: p
            for each in content["effects"]
            for name, p in (
                (each["id"], each["probability"]),
                *((mate["id"], mate["probability"]) for mate in each["indistinguishable_from"]),
            )
        }
        for cause in missing:
            names, p = re.fullmatch(r"(?:probably )?(.*) \((\d+) % together\)", cause).groups()
            total = sum(by_name[name] for name in names.split(" or "))
            assert round(100.0 * total) == int(p)
            assert cause in sentence


@pytest.mark.structure
def test_curves_are_no_names_and_what_decides_is_of_what_is_spoken_of() -> None:
    """Three curves that share 70 % have the family alone; a name of 60 % needs no curve beside."""
    three = ("unnamed-restoring", 0.4), ("unnamed-drive", 0.2), ("unnamed-damping", 0.1)
    curves = likely("cubic-stiffness", 0.1, *three)
    told = diagnosis(curves, likely("second-mode", 0.3)).summary
    assert told.missing == ()
    assert "with time or with the amplitude" in told.headline
    assert "half the amplitude" in told.decide_by
    named = likely("cubic-stiffness", 0.6, ("unnamed-drive", 0.3))
    assert diagnosis(named).summary.missing == ("probably cubic restoring torque (60 %)",)


@pytest.mark.structure
def test_another_mode_is_quoted_where_it_has_a_name() -> None:
    for p, quoted in ((0.9, True), (0.007, False)):
        mode = replace(named("second-mode", **SECOND_MODE), probability=p)
        assert ("other mode" in diagnosis(mode).summary.quote) == quoted


@pytest.mark.structure
def test_a_fault_of_the_readings_is_seen() -> None:
    fault = named("glitches", number=Estimate(1.0, 0.0, ""))
    where = replace(fault.location, summary="one reading is wrong by 3 mrad")
    summary = diagnosis(replace(fault, location=where)).summary
    assert summary.headline.startswith("one reading is wrong by 3 mrad; missing: glitches")
    assert summary.sentence.startswith("“One reading is wrong by 3 mrad, which Eq. 8")


@pytest.mark.structure
def test_one_curve_of_unknown_form_that_stands_for_several_effects_is_said_once() -> None:
    one = likely("clock-drift", 0.1, ("unnamed-drive", 0.81))
    other = likely("parametric-drive", 0.1, ("unnamed-drive", 0.56), ("clock-drift", 0.3))
    summary = diagnosis(other, one).summary
    assert summary.missing == ("a torque that depends on the time in an unknown way (81 %)",)
    assert summary.certainty.count("a torque that depends on the time") == 1
    assert not summary.candidates


def test_what_eq_8_describes_needs_no_effect() -> None:
    text = undisturbed(0.4)
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


@pytest.mark.slow
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


# The dozen lines that a diagnosis prints, and the same as fields.

ORDER = ("amplitude-step", "equilibrium-step", "frequency-step", "damping-step", "offset-step")

REST = Remainder(1e4, 6.0, 40.0, {"phase": 0.8, "offset": 0.2})


def parameters(frequency_hz: float) -> dict[str, Estimate]:
    return {
        "b": Estimate(0.0123, 0.0002, "1/s"),
        "frequency": Estimate(frequency_hz, 2.3e-5, "Hz"),
        "phase": Estimate(0.1, 0.001, "rad"),
    }


def diagnosis(*effects: FoundEffect, left: Remainder | None = None, **more: Any) -> Diagnosis:
    before = FittedModel("eq8", parameters(0.9), 2e-4, 4.0)
    after = FittedModel("eq8", parameters(0.91), 1e-4, 1.0, 1e-4)
    held = HeldOut(1000.0, 1050.0, 5.0, 2e-4, 1.1e-4, 12, 11)
    return Diagnosis(
        before,
        after,
        effects,
        held,
        search=searched(0.9, left, 0.0 if effects else 0.9),
        **more,
    )


def likely(identifier: str, probability: float, *rivals: tuple[str, float]) -> FoundEffect:
    return replace(
        named(identifier),
        probability=probability,
        indistinguishable=tuple(Mate(*rival) for rival in rivals),
    )


@pytest.mark.structure
def test_a_healthy_pendulum_takes_one_line() -> None:
    healthy = diagnosis()
    assert healthy.statement == "nothing is missing (p = 0.9)"
    assert healthy.to_dict()["summary"]["missing"] == []


@pytest.mark.structure
def test_a_misfit_that_chance_does_not_explain_is_not_nothing() -> None:
    left = replace(diagnosis(), search=searched(0.9, p_value=5e-10))
    headline, copied = left.statement.splitlines()
    assert headline == "a small misfit is left, its cause is NOT known (p = 5e-10)"
    assert copied.endswith("(p = 5e-10). The cause is not known.”")
    colour = [named("coloured-noise")]
    for p, level, lacks, says in (
        (5e-10, 0.01, [], "missing-physics"),
        (5e-10, 1e-10, [], "consistent"),
        (0.4, 0.01, colour, "consistent"),
        (0.4, 0.01, [*colour, named("impulse")], "missing-physics"),
    ):
        assert verdict_of(lacks, p, level) == says
    for p, chance in ((0.4, " more than chance would"), (5e-10, ", but more than by chance")):
        assert f"no effect of the catalogue improves the fit{chance}" in undisturbed(p)


@pytest.mark.structure
def test_what_is_presumed_is_fitted_and_not_missing() -> None:
    presumed = replace(named("circular-error"), presumed=True)
    assert replace(diagnosis(), effects=(presumed,)).statement == (
        "nothing is missing beyond sin x, which is fitted (p = 0.9)"
    )


@pytest.mark.parametrize(
    ("effect", "headline", "candidates"),
    [
        (likely("impulse", 0.9), "missing: impulse (90 %)", ""),
        # A class counts together.
        (
            likely("clock-drift", 0.3, ("frequency-drift", 0.4)),
            "missing: probably drifting frequency or drifting clock (70 % together)",
            "",
        ),
        (
            likely("clock-drift", 0.22, ("frequency-drift", 0.08)),
            "something is missing, its cause is NOT known: something in the motion or in the"
            " sensor: one recording can't tell which",
            "drifting clock (22 %)",
        ),
        (
            likely("impulse", 0.08, ("backlash", 0.08)),
            "something is missing, its cause is NOT known",
            "none above 20 %",
        ),
    ],
)
@pytest.mark.structure
def test_a_name_is_given_from_one_half_on(
    effect: FoundEffect, headline: str, candidates: str
) -> None:
    found = diagnosis(effect)
    assert found.summary.headline == headline
    assert found.summary.candidates == candidates
    assert found.statement.splitlines()[0] == headline
    below = [f"{p:.0%}" for p in (0.08,)]
    assert not any(percent in found.statement for percent in below)


@pytest.mark.structure
def test_the_answer_has_a_dozen_lines_in_the_order_of_the_questions() -> None:
    found = diagnosis(likely("impulse", 0.9, ("backlash", 0.06)), left=REST, name="a.csv")
    lines = str(found).splitlines()
    assert len(lines) <= 12
    order = [
        "a.csv: missing: impulse (90 %), and a misfit of unknown cause",
        "  how much it matters   the fit misses the readings by 200 µrad (noise 100 µrad): T0",
        "  where                 throughout the record; what is left lies in the phase (80 %)",
        "  how sure              impulse 90 %; cycles left out of the fit are predicted better in",
        "  looked for, not found second mode, ",
        "  decide by ",
        "  quote                 T0 1.098901(28) s",
    ]
    for line, start in zip(lines, order, strict=False):
        assert line.startswith(start)
    assert lines[-1].startswith("Copy: “Eq. 8 does not describe this recording (p < 1e-12)")


@pytest.mark.structure
def test_a_line_is_as_wide_as_a_terminal_and_the_whole_is_in_the_details() -> None:
    law = named(
        "vortex-shedding",
        k=Estimate(0.0123, 0.0012, "1/s"),
        y_c=Estimate(0.123, 0.012, "rad"),
        phi=Estimate(0.61, 0.01, ""),
    )
    knock = named("impulse", dv=Estimate(5e-3, 5e-4, "rad/s"), time=Estimate(21.0, 0.1, "s"))
    place = Location(summary="; ".join(["throughout the record, mostly at the turning points"] * 3))
    summary = diagnosis(replace(law, location=place), knock).summary
    first, *lines, copied = summary.answer.lines("a-long-name-of-a-file.csv")
    assert first.endswith("csv: missing: vortex shedding above an amplitude; impulse")
    assert all(len(line) <= 120 for line in (first, *lines))
    assert "loss rate 0.0123(12) s⁻¹" in copied
    assert max(map(len, summary.answer.lines(width=math.inf)[:-1])) > 120


def test_a_wide_table_leaves_out_the_middle_q() -> None:
    q = Estimate(157.123, 0.011, "")
    ends = [Change("Q", q, q, amplitude) for amplitude in (0.5, 0.2, 0.1)]
    period = Change("period", *(Estimate(1.0 / 3.0, 1e-7, "s"),) * 2)
    summary = Summary("missing: impulse", consequence=(period, *ends))
    lines = ["\n".join(summary.answer.lines(width=width)) for width in (120, 60)]
    titles = [re.findall(r"Q at [^ ]*", text) for text in lines]
    assert [len(each) for each in titles] == [3, 2]
    assert titles[1] == [titles[0][0], titles[0][-1]]


@pytest.mark.parametrize(
    "effect", [each for each in CATALOGUE if each.parameters], ids=lambda each: each.identifier
)
def test_every_number_of_an_effect_is_printed_in_words_with_error_and_unit(effect: Effect) -> None:
    values = effect.example[-len(effect.parameters) :] or (3.0,) * len(effect.parameters)
    found = {
        each.name: Estimate(1.1 * value, 0.1 * value, each.unit_in("rad"))
        for each, value in zip(effect.parameters, values, strict=True)
    }
    printed = numbers_of(named(effect.identifier, **found))
    for each in effect.parameters:
        assert re.fullmatch("[a-z0-9|²]+( [a-z0-9|²]+)*", each.word), each.word
        if not each.name.endswith(("_cosine", "_sine")):
            one = found[each.name]
            assert f"{each.word} {with_error(one.value, one.sd, one.unit, short=True)}" in printed
    words = [each.word for each in effect.parameters if not each.name.endswith("_sine")]
    assert len(set(words)) == len(words)
    assert printed.count(", ") == len(words) - 1


@pytest.mark.slow
def test_a_diagnosis_prints_as_its_answer() -> None:
    outcome = diagnosed("circular-error")
    assert str(outcome) == repr(outcome)
    content = json.loads(json.dumps(outcome.to_dict()))
    assert str(outcome).endswith(content["statement"])
    assert content["summary"]["headline"] in outcome._repr_html_()
    assert content["details"].startswith("Eq. 8 does not describe this recording")


# The curve of an effect without a name: its values, band and local exponent.

AT_20_HZ_S = np.arange(3000) / 20.0
FAINT_RAD = 1e-5
LINEAR, CUBIC = 0.01, 0.8


class LossByCube(Effect):
    """-dy/dt = k y^3 beside Eq. 14."""

    identifier, name, kind, equation = "cube", "a loss", "dynamics", ""
    parameters = (Parameter("k", "1/s", 0.0, 10.0),)
    discriminating_test = ""

    def acceleration(self, motion: Motion, _: Pendulum, values: FloatArray) -> FloatArray:
        return np.asarray(-2.0 * values[0] * motion.amplitude**2 * motion.velocity)


def fitted(kind: type[Curve], cubic: float) -> tuple[Fit, Curve, Noise]:
    """Readings with a loss of the third power, fitted by b and a curve."""
    omega = 2.0 * math.pi * 0.9
    truth = np.array([0.0, LINEAR, 0.0, 0.0, omega, 0.15, -0.3, 0.0, cubic])
    noise_free = Model(AT_20_HZ_S, 0.05, (LossByCube(),)).evaluate(truth)
    values = noise_free.reading + FAINT_RAD * np.random.default_rng(2).standard_normal(
        len(AT_20_HZ_S)
    )
    data = Data(AT_20_HZ_S, values, 0.05, True, np.ones(len(AT_20_HZ_S)))
    whole = kind(noise_free.span)
    # What is smooth is seen: three of its combinations.
    smooth = np.vander(np.linspace(-1.0, 1.0, whole.basis_size), 6)
    effect = whole.reduced(np.linalg.qr(whole.coefficients.T @ smooth)[0][:, :6])
    noise = white_noise(data, FAINT_RAD)
    start = np.concatenate([truth[:-1], np.zeros(effect.sizes)])
    model = Model(AT_20_HZ_S, 0.05, (effect,))
    return refine(model, data, noise, start, held=(3,)), effect, noise


def test_a_loss_curve_is_the_missing_loss() -> None:
    """A loss rate of k y^2, beyond the a y + b + c/y that Eq. 14 takes of it."""
    fit, effect, noise = fitted(damping_curve, CUBIC)
    found = curve_values(fit, effect, drawn_of(fit, effect, noise))
    at = found["at"]
    law = np.column_stack([at, np.ones_like(at), 1.0 / at])
    expected = CUBIC * at**2
    expected = expected - law @ np.linalg.lstsq(law, expected, rcond=None)[0]
    assert np.mean(np.abs(found["value"] - expected) < 1.96 * found["sd"]) > 0.9
    assert np.median(found["sd"]) < 0.2 * np.max(np.abs(expected))
    assert found["argument"].startswith("amplitude")
    # The whole loss is b + k y^2: n = 1 + 2 k y^2/(b + k y^2), between 1 (linear) and 3 (cubic).
    exponent = 1.0 + 2.0 * CUBIC * at**2 / (LINEAR + CUBIC * at**2)
    inside = slice(5, -5)
    assert found["local_exponent"][inside] == pytest.approx(exponent[inside], abs=0.15)
    assert np.all(found["local_exponent_sd"] > 0.0)


@pytest.mark.parametrize(
    ("kind", "height", "unit", "says"),
    [
        (
            restoring_curve,
            0.05,
            "rad",
            "the torque is stiffer by 6.3 % within 0.873° of the low",
        ),
        (restoring_curve, -0.05, "m", "the torque is softer by 6.3 % within 15.2 mm of the lowest"),
        (friction_curve, 0.5, "rad", "the friction is larger by 3.67 mrad/s² within 0.873° of the"),
        (reading_curve, -0.05, "rad/s", "the reading is lower by 289 µrad/s from -20.3 mrad/s to"),
        (damping_curve, 0.3, "rad", "the loss is larger by 0.00212 s⁻¹ from 2.95° to 3.65° (ampl"),
        (offset_curve, 0.02, "rad", "the offset is higher by 107 µrad from 13.3 s to 33.3 s (time"),
        (drive_curve, 0.0, "rad", "the 95 % band of a torque that depends on the time in an unk"),
    ],
)
def test_a_curve_says_where_and_how_large_it_is(
    kind: type[Curve], height: float, unit: str, says: str
) -> None:
    """Beside the lowest point, or between the second knot and the sixth, the middle three alike.

    Beyond what Eq. 8 and a sensor have: a torque as the angle, dry friction, an offset, a gain.
    """
    model = Model(TIME_S, INTERVAL_S)
    whole = kind(model.evaluate(TRUTH).span)
    shape, middle = np.zeros((whole.basis_size, 1)), len(whole.knots) // 2
    near = slice(middle - 2, middle + 3) if "angle" in whole.argument else slice(2, 5)
    shape[near, 0] = whole.knots[near] / whole.knots[near][-1] if whole.is_torque else 1.0
    curve, faint = kind(whole.span, shape), 1e-6
    start = np.append(TRUTH, height)
    readings = model.adding(curve).reading(start) + white(3, rms=faint)
    data, noise = prepared(readings, rms=faint)
    fit = refine(model.adding(curve), data, noise, start)
    told = curve_told(fit, curve, drawn_of(fit, curve, noise), unit)
    assert told["summary"].startswith(says)
    assert told["stands_out"] == bool(height)
    at = told["at"]
    powers = {restoring_curve: (0, 1), reading_curve: (0, 1), damping_curve: (-1, 0, 1)}
    columns = np.column_stack([at**power for power in powers.get(kind, (0,))])
    there = curve.scale(fit.model.pendulum(fit.value)) * curve.curves(np.array([height]), at)[0]
    there = there - columns @ np.linalg.lstsq(columns, there, rcond=None)[0]
    # Its corners are rounded.
    assert np.mean(np.abs(told["value"] - there) <= 0.2 * np.ptp(there) + faint) > 0.8


@pytest.mark.parametrize(
    ("kind", "unit", "axes"),
    [
        (
            restoring_curve,
            "rad/s",
            ("angle, rad", "restoring torque over omega^2 beyond the law's, rad"),
        ),
        (reading_curve, "rad/s", ("rate, rad/s", "reading minus rate, rad/s")),
        (damping_curve, "rad/s", ("amplitude, rad", "extra loss rate, 1/s")),
        (restoring_curve, "m", ("angle, m", "restoring torque over omega^2 beyond the law's, m")),
    ],
)
def test_a_gyroscope_reads_rates_of_a_motion_in_rad(
    kind: type[Curve], unit: str, axes: tuple[str, str]
) -> None:
    assert kind(null_fit()[0].at.span).axes(unit) == axes


def test_what_acts_on_the_motion_of_a_gyroscope_has_the_units_of_an_angle() -> None:
    units = {
        name: [each.unit_in(effect.acts_on("rad/s")) for each in effect.parameters]
        for name in ("cubic-stiffness", "sensor-cubic", "offset-drift", "impulse", "tone-pickup")
        for effect in [by_identifier(name)]
    }
    assert units == {
        "cubic-stiffness": ["1/rad^2"],
        "sensor-cubic": ["s^2/rad^2"],
        "offset-drift": ["rad/s^2", "s"],
        "impulse": ["rad/s", "s"],
        "tone-pickup": ["rad/s", "rad/s", "Hz"],
    }


def test_a_drive_has_two_curves() -> None:
    fit, effect, noise = fitted(drive_curve, 0.0)
    found = curve_values(fit, effect, drawn_of(fit, effect, noise), "m")
    assert len(found["value"]) == len(found["quadrature"]) == len(found["at"])
    # Nothing was driven: nothing is seen.
    assert np.all(np.abs(found["value"]) <= 4.0 * found["sd"] + 1e-12)


# Where an effect shows: time, frequency, harmonic.

LARGE = np.where(TRUTH == 0.15, 0.4, TRUTH)
"""The same pendulum released at 0.4 rad, where sin x is far from x."""


def location_of(name: str) -> Location:
    return diagnosed(name).effects[0].location


@pytest.mark.slow
def test_a_step_lies_at_its_instant() -> None:
    """Within two 95 % intervals, each less than the record's fiftieth."""
    found = location_of("equilibrium-step")
    assert found.time_s is not None
    low, high = found.time_s
    assert 0.0 < high - low < 0.02 * TIME_S[-1]
    assert abs(0.5 * (low + high) - INSTANT_S) < high - low
    assert "s" in found.summary


@pytest.mark.slow
def test_a_tone_lies_at_its_frequency() -> None:
    found = location_of("tone-pickup")
    assert found.frequency_hz == pytest.approx((TONE_HZ,), abs=0.05 / TIME_S[-1])
    assert found.harmonics == ()
    assert "Hz" in found.summary


@pytest.mark.parametrize(
    ("tone_hz", "says"),
    [(5.0, "50 Hz folded at 15 readings a second"), (3.3, ""), (5.2, "")],
)
def test_a_tone_of_the_mains_is_known_behind_its_alias(tone_hz: float, says: str) -> None:
    """At 15 readings a second 50 Hz (and 100 Hz) are seen at 5 Hz."""
    hum = 3e-4 * np.cos(2.0 * math.pi * tone_hz * TIME_S)
    data, noise = prepared(other_engine(TRUTH) + hum + white(3))
    tone = by_identifier("tone-pickup")
    bare = refine(Model(TIME_S, INTERVAL_S), data, noise, TRUTH)
    start = np.append(bare.value, [3e-4, 0.0, tone_hz])
    found = locate(bare, refine(bare.model.adding(tone), data, noise, start), data, tone)
    assert found.mains == says
    twice = replace(data, fold=2)  # means of two readings, of 30 a second
    assert mains_of(Estimate(tone_hz, 1e-4, "Hz"), twice) == says.replace("15", "30")
    assert found.summary.endswith(says)
    assert ("50 Hz" in numbers_of(replace(named("tone-pickup"), location=found))) == bool(says)


@pytest.mark.slow
def test_a_square_in_the_sensor_lies_in_the_second_harmonic_and_a_cube_in_the_third() -> None:
    """Amplitude and losses absorb its effect on the fundamental."""
    for name, harmonic in (("sensor-quadratic", 2), ("sensor-cubic", 3)):
        found = location_of(name)
        assert harmonic in found.harmonics
        assert harmonic * FREQUENCY_HZ == pytest.approx(max(found.frequency_hz), rel=1e-3)
        assert max(found.harmonics) == harmonic


@pytest.mark.slow
def test_a_curved_sensor_shows_at_large_amplitudes_that_is_early() -> None:
    found = location_of("sensor-cubic")
    amplitude = diagnosed("sensor-cubic").search.fit.at.sampled.amplitude
    assert found.amplitude_rad[1] > 0.97 * amplitude.max()
    assert found.amplitude_rad[0] > 1.2 * amplitude.min()
    assert found.time_s[0] < 5.0


@pytest.mark.slow
@pytest.mark.parametrize("name", ["circular-error", "frequency-drift", "sensor-quadratic"])
def test_intervals_lie_within_the_record(name: str) -> None:
    found = location_of(name)
    for interval, lowest, highest in (
        (found.time_s, TIME_S[0], TIME_S[-1]),
        (found.amplitude_rad, 0.0, 0.16),
    ):
        assert lowest <= interval[0] < interval[1] <= highest
    assert np.all(np.isfinite(found.frequency_hz))


def located(
    identifier: str,
    values: tuple[float, ...],
    base: FloatArray = TRUTH,
    time_s: FloatArray = TIME_S,
) -> tuple[Location, float]:
    """Where an effect shows that Eq. 8 lacks; and Eq. 8's phase error, rad."""
    effect = by_identifier(identifier)
    bare, extended = Model(time_s, INTERVAL_S), Model(time_s, INTERVAL_S, (effect,))
    truth = np.append(base, values)
    readings = extended.reading(truth) + white(2, len(time_s))
    even = len(time_s) == len(TIME_S)
    data = Data(time_s, readings, INTERVAL_S, even, np.ones(len(time_s)))
    noise = white_noise(data, NOISE_RAD)
    before, after = refine(bare, data, noise, base), refine(extended, data, noise, truth)
    return locate(before, after, data, effect), before.max_phase_error_rad


SLIPPING = {
    "circular-error": ((1.0,), LARGE),
    "clock-drift": ((1e-4, 1e3), TRUTH),
    "frequency-drift": ((3e-4, 40.0), TRUTH),
}


@pytest.mark.parametrize("name", SLIPPING)
def test_a_phase_error_of_a_radian_is_a_misfit_of_the_fundamental(name: str) -> None:
    """However large: the pendulum is early or late, and its offset unchanged."""
    found, slip = located(name, *SLIPPING[name])
    assert slip > 0.5
    assert found.harmonics == (1,)
    assert found.frequency_hz == pytest.approx((FREQUENCY_HZ,), rel=1e-2)
    assert "level" not in found.summary


def test_a_phase_error_shows_at_the_same_amplitudes_whether_it_is_small_or_large() -> None:
    """Its effect is linear along the motion, if not in the readings."""
    small, slip = located("clock-drift", (2e-6, 1e3))
    large, slipped = located("clock-drift", (1e-4, 1e3))
    assert slip < 0.02
    assert slipped > 0.5
    assert large.amplitude_rad == pytest.approx(small.amplitude_rad, rel=0.01)


def test_a_phase_misfit_shows_at_the_zero_crossings_and_a_loss_at_the_turning_points() -> None:
    """Twice a cycle: no single arc of less than half a circle holds most of it."""
    early, _ = located("clock-drift", (1e-5, 1e3))
    assert early.phase_rad is None
    assert "zero crossings" in early.summary
    lossy, _ = located("damping-drift", (3e-4, 1e3))
    assert lossy.phase_rad is None
    assert "turning points" in lossy.summary


def test_a_step_of_the_offset_prefers_no_part_of_the_cycle() -> None:
    summary = located("equilibrium-step", (4e-4, INSTANT_S))[0].summary
    assert "crossings" not in summary
    assert "turning points" not in summary


def test_what_fades_after_the_release_lies_at_the_beginning_and_not_at_its_time_constant() -> None:
    found, _ = located("release-transient", (0.02, 4.8))
    assert found.time_s[0] == TIME_S[0]
    assert 4.8 < found.time_s[1] < 0.5 * TIME_S[-1]


def test_an_encoder_that_records_its_counts_makes_no_harmonics_of_a_phase_error() -> None:
    """Its readings are dense at the crossings: |sin| of the phase, which has a second harmonic."""
    finer = np.arange(0.0, 60.0, INTERVAL_S / 4.0)
    speed = np.abs(np.sin(TRUTH[4] * (finer - TRUTH[6])))
    written = finer[np.random.default_rng(4).uniform(size=len(finer)) < speed]
    found, slip = located("frequency-drift", (1e-3, 40.0), time_s=written)
    assert slip > 0.5
    assert found.harmonics == (1,)


@pytest.mark.parametrize(
    ("frequency_hz", "by_chance"),
    [
        (3.5 * FREQUENCY_HZ, 0.9),
        (3.0 * FREQUENCY_HZ, 0.05),
        (0.5 / INTERVAL_S - FREQUENCY_HZ, 0.15),
        (1.0 / INTERVAL_S - 11.0 * FREQUENCY_HZ, 0.15),
    ],
)
def test_a_line_of_every_second_reading_or_an_alias_is_seldom_there_by_chance(
    frequency_hz: float, by_chance: float
) -> None:
    """Lines at a harmonic, about half the sampling rate, and the alias of the eleventh harmonic."""
    tone = by_identifier("tone-pickup")
    model = Model(TIME_S, INTERVAL_S, (tone,))
    truth = np.append(TRUTH, [3e-4, 2e-4, frequency_hz])
    data, noise = prepared(model.reading(truth) + white(3))
    found = near_harmonic_by_chance(refine(model, data, noise, truth), tone)
    assert found > by_chance if by_chance == 0.9 else found < by_chance


# The misfit beyond the noise, and its consequences for names and errors.


def left_by(extra: FloatArray) -> tuple[Fit, Remainder]:
    """Eq. 8 fitted to itself, noise, and something more."""
    data, noise = prepared(other_engine(TRUTH) + white(4) + extra)
    fit = refine(Model(TIME_S, INTERVAL_S), data, noise, TRUTH)
    return fit, remainder_of(fit, data, noise)


def test_noise_alone_leaves_nothing_and_enlarges_no_error() -> None:
    found = remainder_of(*null_fit())
    assert not found.systematic
    assert found.error_scale == 1.0
    assert found.over_noise == pytest.approx(1.0, abs=4.0 / math.sqrt(2 * len(TIME_S)))


@pytest.mark.parametrize(
    ("where", "extra"),
    [
        ("harmonics", 4e-4 * np.cos(3.0 * 2.0 * np.pi * 0.9 * TIME_S)),
        ("offset", 6e-4 * np.sin(2.0 * np.pi * 0.02 * TIME_S)),
        ("between", 4e-4 * np.cos(2.0 * np.pi * 6.1 * TIME_S)),
    ],
)
def test_the_misfit_is_located_where_it_was_put(where: str, extra: FloatArray) -> None:
    """Its mean square adds to the noise's, and nine tenths of it are there."""
    _, found = left_by(extra)
    expected = math.sqrt(1.0 + np.mean(extra**2) / NOISE_RAD**2)
    assert found.systematic
    assert found.over_noise == pytest.approx(expected, rel=0.05)
    assert found.shares[where] > 0.9
    assert sum(found.shares.values()) == pytest.approx(1.0)


def test_errors_grow_with_what_is_left_and_one_line_is_few_numbers() -> None:
    _, small = left_by(4e-4 * np.cos(2.0 * np.pi * 6.1 * TIME_S))
    _, large = left_by(8e-4 * np.cos(2.0 * np.pi * 6.1 * TIME_S))
    assert large.error_scale == pytest.approx(2.0 * small.error_scale, rel=0.2)
    assert small.error_scale > small.over_noise
    assert large.numbers < 30.0


def of_a_cycle(wave: FloatArray, rng: np.random.Generator) -> FloatArray:
    """A smooth random function of eight numbers, times a wave."""
    x = (np.arange(len(wave)) + 0.5) / len(wave)
    modes = np.cos(np.pi * np.arange(8)[:, None] * x)
    return np.asarray(3.0 * NOISE_RAD * (rng.standard_normal(8) @ modes) * wave)


@pytest.mark.parametrize(
    ("part", "moved", "still"),
    [
        ("amplitude", (A, B, C), (OMEGA, TIME)),
        ("phase", (OMEGA, TIME), (A, B, C)),
        ("harmonics", (), (A, B, C)),
    ],
)
def test_errors_are_those_that_a_random_misfit_of_one_part_makes(
    part: str, moved: tuple[int, ...], still: tuple[int, ...]
) -> None:
    """To first order the values move by J^+ r: against the errors stated for each draw."""
    fit, data, noise = null_fit()
    turned = fit.at.sampled.phase
    wave = {"amplitude": np.cos(turned), "phase": np.sin(turned), "harmonics": np.cos(3 * turned)}
    solve = np.linalg.pinv(fit.jacobian[:, fit.free])
    rng, pulls, widened = np.random.default_rng(7), [], []
    for seed in range(80):
        more = of_a_cycle(wave[part], rng) + white(seed)
        residual = np.append(noise.whiten(more), 0.0)
        here = replace(fit, evaluation=replace(fit.evaluation, residual=residual))
        found = with_errors(here, replace(data, values=fit.at.reading + more), noise)
        widened.append(np.sqrt(np.diag(found.covariance())[list(fit.free)]))
        pulls.append(solve @ residual / widened[-1])
    scatter = dict(zip(fit.free, np.std(pulls, axis=0), strict=True))

    assert max(scatter.values()) < 1.35
    assert all(scatter[index] > 0.6 for index in moved)
    noise_alone = np.sqrt(np.diag(fit.covariance())[list(fit.free)])
    wider = dict(zip(fit.free, np.median(widened, axis=0) / noise_alone, strict=True))
    assert all(wider[index] > 10.0 for index in moved)
    assert all(wider[index] < 5.0 for index in still)


@pytest.mark.parametrize("harmonic_rad", [2e-4, 4e-4])
def test_intervals_far_from_a_bound_are_those_of_the_errors(harmonic_rad: float) -> None:
    """Derivatives by the frequency are 1e8 times those by the share: no direction is lost."""
    extra = harmonic_rad * np.cos(3.0 * 2.0 * np.pi * 0.9 * TIME_S)
    data, noise = prepared(other_engine(TRUTH) + white(4) + extra)
    fit = with_errors(refine(Model(TIME_S, INTERVAL_S), data, noise, TRUTH), data, noise)
    for estimate in constants_of(fit, "rad").values():
        assert np.ptp(estimate.bounds95) == pytest.approx(2.0 * Z95 * estimate.sd, rel=0.01)
