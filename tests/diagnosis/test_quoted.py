"""What a diagnosis quotes is what the descriptions that share the probability say of it."""

import functools
import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pendpipe as pp
import pendpipe.diagnosis.quoted
from pendpipe.arrays import FloatArray
from pendpipe.diagnosis.data import Data
from pendpipe.diagnosis.noise import Noise
from pendpipe.diagnosis.quoted import LISTED, averages, descriptions_of, printed_by, quoted
from pendpipe.diagnosis.refine import Fit, refine
from pendpipe.diagnosis.result import Diagnosis
from pendpipe.diagnosis.run import diagnose_recording
from pendpipe.diagnosis.values import constants_of, quality_factors_of, small_periods
from pendpipe.dynamics.eq8 import OMEGA
from pendpipe.effects import Effect
from pendpipe.effects.catalogue import by_identifier
from pendpipe.effects.curves import restoring_curve
from pendpipe.effects.model import Model
from pendpipe.estimate import NAMED, Estimate
from pendpipe.formats import read

from .records import (
    FREQUENCY_HZ,
    INTERVAL_S,
    OMEGA_RAD_S,
    TIME_S,
    TRUTH,
    diagnosed,
    null_fit,
    other_engine,
    prepared,
    pulled,
    recording,
    with_effects,
)

T0_S = 1.0 / FREQUENCY_HZ
ANGLE = 5
"""Place of the angle of the release among the values of `TRUTH`."""
INPUTS = Path("../shared/inputs4")
END_S = float(TIME_S[-1])


# The period of small swings is that of the description.


def with_effect(effect: Effect, values: tuple[float, ...]) -> Fit:
    """The truth with an effect, as if it had been fitted."""
    model = Model(TIME_S, INTERVAL_S, (effect,))
    value = np.append(TRUTH, values)
    data, noise = prepared(model.reading(value))
    return refine(model, data, noise, value, rounds=0)


def relaxing(rate: float, tau_s: float) -> float:
    """The mean over the recording of rate tau (1 - e^(-t/tau))."""
    return rate * tau_s * (1.0 + tau_s / END_S * math.expm1(-END_S / tau_s))


@pytest.mark.parametrize(
    ("identifier", "values", "change"),
    [
        ("cubic-stiffness", (0.5,), 0.0),
        ("amplitude-linear-stiffness", (-0.3,), 0.0),
        ("sensor-cubic", (0.2,), 0.0),
        ("stribeck-friction", (1e-3, 0.1), 0.0),
        ("damping-drift", (1e-5, 40.0), 0.0),
        ("equilibrium-creep", (1e-3, 10.0, 0.5), 0.0),
        ("periodic-drive", (5e-4, 3e-4, 1.2), 0.0),
        ("dropped-samples", (1e-2, 50.0), 0.0),
        ("frequency-drift", (6e-6, 40.0), -relaxing(6e-6, 40.0)),
        ("clock-drift", (6e-6, 40.0), -relaxing(6e-6, 40.0)),
        ("frequency-step", (1e-3, 0.25 * END_S), -0.75e-3),
        ("damping-step", (0.25, 0.4 * END_S), 0.0),
    ],
)
def test_the_period_of_small_swings_is_what_an_effect_leaves_it_in_the_mean(
    identifier: str, values: tuple[float, ...], change: float
) -> None:
    """A torque of higher order leaves it; a drift moves its mean, by the clock that drifts."""
    fit = with_effect(by_identifier(identifier), values)
    found = 1.0 / constants_of(fit, "rad")["frequency"].value
    assert found / T0_S - 1.0 == pytest.approx(change, abs=2e-6 + 0.02 * abs(change))


def test_a_curve_of_the_torque_moves_the_period_by_its_slope_at_rest() -> None:
    """A tenth of the swing more torque at the second knot: k = 0.1/0.04 over its unit."""
    null, _, _ = null_fit()
    curve = restoring_curve(null.at.span, np.eye(15))
    heights = np.where(curve.knots == 0.0, 0.0, 1e-3 * np.sign(curve.knots))
    fit = with_effect(curve, tuple(heights))
    inner = np.min(curve.knots[curve.knots > 0.0])
    stiffer = curve.scale(null.at.span.pendulum) * 1e-3 / inner
    assert small_periods(fit, fit.value).mean() == pytest.approx(
        T0_S / math.sqrt(1.0 + stiffer), rel=1e-6
    )


def test_of_a_contact_the_smallest_swings_that_were_seen_are_the_small_ones() -> None:
    """Within its play a pendulum has no period at all."""
    fit = with_effect(by_identifier("backlash"), (1e-3,))
    turned_s = fit.at.tangent.motion.time_s[:, 0]
    last = np.flatnonzero(turned_s < END_S)[-1]
    found = small_periods(fit, fit.value).mean()
    assert found == pytest.approx(turned_s[last] - turned_s[last - 2], rel=3e-4)
    assert found > 1.003 * T0_S


@pytest.mark.slow
def test_a_period_that_jumps_is_quoted_in_the_mean_with_its_span() -> None:
    jump = by_identifier("frequency-step")
    readings = Model(TIME_S, INTERVAL_S, (jump,)).reading(np.append(TRUTH, [2e-4, 0.4 * END_S]))
    outcome = diagnose_recording(recording(readings, 3), restoring="linear")
    quotes, span = outcome.improved.parameters["frequency"], outcome.improved.period_span_s
    assert abs(quotes.value - FREQUENCY_HZ * (1.0 + 0.6 * 2e-4)) < 3.0 * quotes.sd
    # A curve stands for the fit, which knows it badly: the mean variance has its share of that.
    shared = dict(outcome.effects[0].indistinguishable)["unnamed-measurement"]
    assert quotes.sd < 1.1 * math.sqrt(shared) * outcome.fit.parameters["frequency"].sd  # type: ignore[union-attr]
    assert span == pytest.approx((T0_S / 1.0002, T0_S), abs=0.2e-4)
    assert outcome.to_dict()["improved"]["period_span_s"] == list(span)
    assert "s in the mean, drifting by 2" in outcome.summary.quote


@pytest.mark.slow
@pytest.mark.parametrize(
    ("file", "stop_s", "restoring", "period_s"),
    [
        # The first swings of a ship that softens take 4 % longer.
        ("n01_softening.csv", None, "linear", 0.8),
        # An ellipse of 27° seen by one camera: its second plane moves every period.
        ("n02_ellipse.csv", 8.0, "auto", 0.839017),
    ],
)
def test_small_swings_are_quoted_within_errors_of_two_percent_whatever_the_law_lacks(
    file: str, stop_s: float | None, restoring: Any, period_s: float
) -> None:
    path = INPUTS / file
    if not path.exists():
        pytest.skip(f"{path} is not here")
    outcome = pp.diagnose(read(path).between(None, stop_s), restoring=restoring)
    found = 1.0 / outcome.improved.parameters["frequency"].value
    error = outcome.improved.parameters["frequency"].sd * found**2
    fitted = outcome.fit.period
    for value, sd in ((found, error), (fitted.value, fitted.sd)):
        assert abs(value - period_s) < 2.0 * sd < 0.02 * period_s


@pytest.mark.parametrize(
    ("identifier", "values"),
    [
        ("equilibrium-step", (4e-3, 41.3)),
        ("impulse", (2e-3, 41.3)),
        ("amplitude-step", (0.01, 41.3)),
        ("equilibrium-creep", (3e-3, 10.0, 0.5)),
        ("quadratic-stiffness", (0.05,)),
    ],
)
def test_q_of_a_description_is_that_of_its_losses(
    identifier: str, values: tuple[float, ...]
) -> None:
    """What shifts, knocks or bends a swing takes no energy from it."""
    fit = with_effect(by_identifier(identifier), values)
    a, b, c = TRUTH[:3]
    for amplitude, found in quality_factors_of(fit, [0.149, 0.12, 0.1, 0.08]).items():
        by_losses = math.pi * FREQUENCY_HZ / (a * amplitude + b + c / amplitude)
        # Near the first turning point half of what is asked for is extrapolated.
        within = 0.012 if amplitude > 0.14 else 6e-4
        assert found.value == pytest.approx(by_losses, rel=within)


@pytest.mark.parametrize(("readings", "amplitudes"), [(200, [0.1, 0.05, 0.02]), (300, [0.1])])
def test_q_is_with_the_period_that_losses_do_not_lengthen(
    readings: int, amplitudes: list[float]
) -> None:
    """A viscous pendulum of Q = omega/(2 b) = 14 loses exp(-b t), 1/(8 Q^2) slower.

    Also where the motion from other values turns more often: a curve of the loss lets the last
    swings fade later or earlier than the fit's own.
    """
    b, (longer, model) = 0.2, (Model(TIME_S[:count], INTERVAL_S) for count in (readings, 200))
    value = np.array([0.0, b, 0.0, 0.0, OMEGA_RAD_S, 0.15, -0.3, 0.0])
    data, noise = prepared(model.reading(value), TIME_S[:200])
    fit = refine(model, data, noise, value, rounds=0)
    fit = replace(fit, evaluation=replace(fit.evaluation, model=longer))
    for found in quality_factors_of(fit, amplitudes).values():
        assert found.value == pytest.approx(0.5 * OMEGA_RAD_S / b, rel=1e-5)


# Each description is fitted as it is named.


@functools.cache
def softening() -> Diagnosis:
    """A torque that softens by x|x|: others take its place, and differ in the small swings."""
    effect = by_identifier("amplitude-linear-stiffness")
    readings = Model(TIME_S, INTERVAL_S, (effect,)).reading(np.append(TRUTH, [-0.5]))
    return diagnose_recording(recording(readings, 2), restoring="linear")


@pytest.mark.slow
def test_each_description_has_the_effects_of_its_name_and_its_probability() -> None:
    outcome = diagnosed("frequency-drift")
    found = outcome.search
    described = descriptions_of(found)
    (step,) = found.steps
    rivals = [step.winner.effect, *(mate.effect for mate in step.mates)]
    wanted = {
        effect.key: weight
        for effect, weight in zip(rivals, step.weights[:-1], strict=True)
        if weight >= LISTED
    }
    given = {one.fit.model.effects[0].key: one.probability for one in described}
    assert len(given) > 3
    assert given == pytest.approx(wanted)
    for one in described:
        again = refine(one.fit.model, found.data, found.noise, one.fit.value, held=found.held)
        assert one.fit.chi2 < again.chi2 + 1.0


@pytest.mark.slow
def test_a_set_of_effects_whose_fit_is_stuck_is_no_description(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Worse than the law without them, it says nothing of how probable they are."""
    readings = with_effects("frequency-drift", "tone-pickup")
    outcome = diagnose_recording(recording(readings, 1), restoring="linear")
    found = outcome.search
    # The drift's last mate or nothing, without the tone: the first was never fitted so.
    odds = [[0.5, 0.5], [0.0, 1.0]]
    steps = [
        replace(step, weights=(*[0.0] * (len(step.weights) - 2), *chances))
        for step, chances in zip(found.steps, odds, strict=True)
    ]
    found = replace(found, steps=tuple(steps))

    def stuck(model: Model, data: Data, noise: Noise, starts: Any, **_: Any) -> Fit:
        far = starts[0] * np.where(np.arange(model.size) == ANGLE, 1.5, 1.0)
        return refine(model, data, noise, far, rounds=0)

    fitted = descriptions_of(found)
    monkeypatch.setattr(pendpipe.diagnosis.quoted, "best_fit", stuck)
    described = descriptions_of(found)
    assert len(fitted) == 2
    assert [each.fit.value is found.baseline.value for each in described] == [True]


@pytest.mark.slow
@pytest.mark.parametrize("none", [0.1, 0.6])
def test_what_chance_excludes_is_a_description_only_where_none_is_likely(none: float) -> None:
    """By "none of these" the bare law lies many errors of the descriptions away."""
    outcome = softening()
    (step,) = outcome.search.steps
    share = (1.0 - none) / sum(step.weights[:-1])
    doubted = replace(step, weights=(*(share * each for each in step.weights[:-1]), none))
    found = replace(outcome.search, steps=(doubted,))
    assert all(each.fit.model.effects for each in descriptions_of(found)) == (none < NAMED)
    bare, given = found.baseline.value[OMEGA], outcome.improved.parameters["frequency"]
    assert abs(given.value - FREQUENCY_HZ) < 2.0 * given.sd
    assert abs(bare / (2.0 * math.pi) - FREQUENCY_HZ) > 5.0 * given.sd


@pytest.mark.slow
def test_where_no_description_has_a_motion_the_search_s_own_is_quoted(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Five effects beside a gross misfit may share so much that each set has less than 5 %."""
    found = diagnosed("frequency-drift").search
    monkeypatch.setattr("pendpipe.diagnosis.quoted._known", lambda _: {})
    monkeypatch.setattr("pendpipe.diagnosis.quoted._fitted", lambda *_: None)
    (alone,) = descriptions_of(found)
    assert alone.probability == 1.0
    assert alone.fit.value == pytest.approx(found.fit.value)


@pytest.mark.slow
def test_a_number_is_the_mean_of_the_descriptions_and_its_variance_holds_their_spread() -> None:
    outcome = diagnosed("frequency-drift")
    numbers = [
        (each.probability, constants_of(each.fit, "rad"))
        for each in descriptions_of(outcome.search)
    ]
    p = np.array([probability for probability, _ in numbers])
    for name in ("frequency", "a", "b", "c"):
        values, sds = (
            np.array([getattr(own[name], what) for _, own in numbers]) for what in ("value", "sd")
        )
        mean, given = p @ values / p.sum(), outcome.improved.parameters[name]
        assert given.value == pytest.approx(mean, rel=1e-9)
        assert given.sd**2 == pytest.approx(p @ (sds**2 + (values - mean) ** 2) / p.sum())


@pytest.mark.slow
def test_a_fault_of_the_measurement_alone_leaves_one_description_without_it() -> None:
    """Beside lost samples the fit is as wrong as its times."""
    outcome = diagnosed("dropped-samples")
    (only,) = descriptions_of(outcome.search)
    assert only.fit.value is outcome.search.fit.value
    given, alone = (each.parameters["frequency"] for each in (outcome.improved, outcome.baseline))
    assert abs(given.value - FREQUENCY_HZ) < 3.0 * given.sd
    assert given.sd < 0.3 * alone.sd


CHIRP = 2e-5
"""By how much a clock is slower at the end than at the beginning."""


def braked() -> tuple[FloatArray, float]:
    """A viscous brake is switched on half way, and the clock slows down; the mean period."""
    time_s = TIME_S - 0.5 * CHIRP * TIME_S**2 / END_S
    late_s = np.maximum(time_s - 0.5 * END_S, 0.0)
    free, held = (complex(-rate, math.sqrt(OMEGA_RAD_S**2 - rate**2)) for rate in (0.008, 0.024))
    # Angle and velocity go on where it begins.
    then = 0.15 * np.exp(free * 0.5 * END_S)
    part = ((free * then).real - held.conjugate() * then.real) / (2j * held.imag)
    before, after = 0.15 * np.exp(free * time_s), 2.0 * part * np.exp(held * late_s)
    angle_rad = np.where(late_s > 0.0, after.real, before.real)
    return angle_rad, 2.0 * math.pi / free.imag * (1.0 + 0.5 * CHIRP)


def humming() -> tuple[FloatArray, float]:
    """Hum of the mains that the sampling folds onto the swing, within its resolution."""
    hum = 4e-4 * np.cos(2.0 * math.pi * (FREQUENCY_HZ + 0.005) * TIME_S + 1.0)
    return other_engine(TRUTH) + hum, T0_S


@pytest.mark.slow
@pytest.mark.parametrize("make", [braked, humming])
def test_a_cause_that_cannot_be_named_moves_no_period_beyond_its_error(
    make: Callable[[], tuple[FloatArray, float]],
) -> None:
    """Nor is the diagnosis surer of it than the fit, but where a curve describes the cause."""
    readings, period_s = make()
    outcome = diagnose_recording(recording(readings, 1), restoring="linear")
    before, after = outcome.baseline, outcome.improved or outcome.baseline
    for found in (before.parameters["frequency"], after.parameters["frequency"]):
        assert abs(1.0 / found.value - period_s) < 4.0 * found.sd / found.value**2
    shrunk = after.parameters["frequency"].sd / before.parameters["frequency"].sd
    assert make is humming or shrunk > 0.99


# What explains nothing shrinks no error.


@pytest.mark.slow
def test_what_leaves_more_than_noise_is_no_surer_than_the_fit() -> None:
    """The same answer, once as if chance did not explain what is left."""
    outcome = softening()
    found, told = outcome.search, printed_by(outcome.fit)
    clean, rest = (quoted(found, outcome.fit, level).numbers for level in (0.0, 1.0))
    for name, least in told.items():
        assert rest[name].sd > 0.999 * least.sd
    # Nor is a curve, whatever it leaves.
    pull = diagnose_recording(recording(pulled(0.5, 0.03), 3), restoring="linear")
    assert [each.kind for each in pull.missing] == ["unnamed"]
    for name, least in printed_by(pull.fit).items():
        known = {**pull.improved.parameters, **pull.improved.quality_factors}
        assert known[name].sd > 0.999 * least.sd
    assert clean["frequency"].sd < 0.5 * told["frequency"].sd


@pytest.mark.slow
def test_what_leaves_more_than_noise_is_no_less_sure_than_what_is_seen() -> None:
    """A second plane that leaves most of an ellipse said 0.83(41) s; turning points, 0.83(3) s."""
    found = softening().search
    (first, *_) = descriptions_of(found)
    seen, lost = Estimate(1.204, 0.03, "Hz"), Estimate(1.3, 0.6, "Hz")
    for level, sd in ((1.0, seen.sd), (0.0, lost.sd)):
        quotes = averages(found, [first], lambda _: {"f": lost}, {"f": seen}, level)
        assert quotes.constants["f"].sd == pytest.approx(sd)
