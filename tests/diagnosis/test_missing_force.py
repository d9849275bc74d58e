"""The missing force as a curve: a named effect as such a curve, and its share of the loss."""

import re
from typing import Any

import numpy as np
import pytest

from pendpipe.arrays import FloatArray
from pendpipe.diagnosis.missing_force import (
    curve_told,
    polynomial_of,
    seen_as,
    share_of_loss,
)
from pendpipe.diagnosis.refine import refine
from pendpipe.diagnosis.values import drawn_of
from pendpipe.dynamics.any_law import Motion
from pendpipe.effects.catalogue import by_identifier
from pendpipe.effects.curves import (
    Curve,
    damping_curve,
    fifth_curve,
    reading_curve,
    restoring_curve,
    second_curve,
)
from pendpipe.effects.effect import Effect, Parameter, Pendulum
from pendpipe.effects.model import Model

from .records import (
    INTERVAL_S,
    LINEAR,
    NOISE_RAD,
    TIME_S,
    TRUTH,
    diagnosed,
    null_fit,
    prepared,
    white,
)


def test_a_loss_that_is_everywhere_has_its_part_of_the_work() -> None:
    """Beta beside b: beta/(b + beta) of the loss, at any amplitude."""
    whole = damping_curve(Model(TIME_S, INTERVAL_S).evaluate(LINEAR).span)
    flat = damping_curve(whole.span, np.ones((whole.basis_size, 1)))
    data, noise = prepared(Model(TIME_S, INTERVAL_S).reading(LINEAR) + white(2))
    model = Model(TIME_S, INTERVAL_S, (flat,))
    fit = refine(model, data, noise, np.append(LINEAR, 0.3), held=range(len(LINEAR) + 1), rounds=0)
    beta = 0.3 * flat.scale(fit.model.pendulum(fit.value))
    for low, high in ((0.06, 0.1), (0.0, 1.0)):
        at = np.geomspace(flat.knots[0], flat.knots[-1], 9)
        assert share_of_loss(fit, flat, at, np.full(9, beta), low, high) == pytest.approx(
            beta / (LINEAR[1] + beta), rel=1e-3
        )


def test_a_named_effect_is_drawn_as_the_curve_that_its_readings_would_give() -> None:
    """A sensor's s x^3 is itself up to what the motion takes of it: a gain, here 3/4 s y^2."""
    cubic, size = by_identifier("sensor-cubic"), 0.5
    named = Model(TIME_S, INTERVAL_S, (cubic,))
    truth = np.append(TRUTH, size)
    data, noise = prepared(named.reading(truth) + white(3))
    fit = refine(named, data, noise, truth)
    curve = reading_curve(fit.at.span)
    drawn = Model(TIME_S, INTERVAL_S, (curve,))
    best = refine(drawn, data, noise, np.append(TRUTH, np.zeros(curve.sizes)))
    told = drawn_of(best, curve, noise)
    found = seen_as(fit, best, told)
    assert found is not None
    # A gain and an offset are the motion's: the curve is what is beside a straight line.
    there = size * told.at**3
    there = there - np.polyval(np.polyfit(told.at, there, 1), told.at)
    # The last knots lie beyond the swing.
    inside = np.abs(told.at) < fit.at.span.first_amplitude
    assert found[inside] == pytest.approx(there[inside], abs=0.15 * np.max(np.abs(there)))


@pytest.mark.parametrize(
    ("kind", "terms", "unit"),
    [
        (fifth_curve, {"x³": -0.4, "x⁵": 5.0}, "rad"),
        (second_curve, {"x|x|": -0.02, "x³": 0.3}, "m"),
    ],
)
def test_a_torque_of_two_terms_is_told_by_its_coefficients(
    kind: type[Curve], terms: dict[str, float], unit: str
) -> None:
    """Made by an effect that has the law itself: 95 % of intervals hold the truth; here 3 sd."""

    class Law(Effect):
        identifier, name, kind, equation = "law", "a law", "dynamics", ""
        parameters = (Parameter("k", "1", -1.0, 1.0),)
        discriminating_test = ""

        def acceleration(self, motion: Motion, pendulum: Pendulum, values: FloatArray) -> Any:
            x = motion.angle
            torque = sum(
                size * x * np.abs(x) ** (power - 1)
                for size, power in zip(terms.values(), kind.powers.values(), strict=True)
            )
            return -values[0] * pendulum.angular_frequency**2 * torque

    data, noise = prepared(
        Model(TIME_S, INTERVAL_S, (Law(),)).reading(np.append(TRUTH, 1.0)) + white(3)
    )
    curve = kind(Model(TIME_S, INTERVAL_S).evaluate(TRUTH).span)
    fit = refine(Model(TIME_S, INTERVAL_S, (curve,)), data, noise, np.append(TRUTH, [0.0, 0.0]))
    told = curve_told(fit, curve, drawn_of(fit, curve, noise), unit)
    for name, truth in terms.items():
        found = told["polynomial"][name]
        assert abs(found.value - truth) < 3.0 * found.sd
        assert found.unit == f"1/{unit}^{kind.powers[name] - 1}".removesuffix("^1")
        sign = "−" if truth < 0.0 else "[+]"
        assert re.search(f" {sign} [^+−]*[(][^+]* {re.escape(name)}", told["summary"])
    largest = curve.span.first_amplitude
    relative = sum(
        size * largest ** (power - 1)
        for size, power in zip(terms.values(), kind.powers.values(), strict=True)
    )
    assert ("stiffer" if relative > 0.0 else "softer") in told["summary"]


def test_the_polynomial_is_that_of_the_whole_torque_or_none() -> None:
    """A curve of one combination has x|x| beside a torque that has x^3, and can't alone."""
    cubic, combination = by_identifier("cubic-stiffness"), np.array([[0.8], [0.6]])
    curve = second_curve(Model(TIME_S, INTERVAL_S).evaluate(TRUTH).span, combination)
    model, sizes = Model(TIME_S, INTERVAL_S, (cubic, curve)), [-0.2, -0.02]
    data, noise = prepared(model.reading(np.append(TRUTH, sizes)) + white(3))
    fit = refine(model, data, noise, np.append(TRUTH, sizes))
    found, largest = polynomial_of(fit, "rad"), curve.span.first_amplitude
    # A tenth of the swing is a curve's unit.
    own = 0.1 * largest * sizes[1] * combination[:, 0]
    truth = {"x|x|": own[0] / largest**2, "x³": sizes[0] + own[1] / largest**3}
    for name, each in truth.items():
        assert abs(found[name].value - each) < 3.0 * found[name].sd
    bare = refine(Model(TIME_S, INTERVAL_S, (curve,)), data, noise, np.append(TRUTH, sizes[1]))
    assert polynomial_of(bare, "rad") == {}


def test_what_is_only_noise_is_told_nowhere() -> None:
    fit, data, noise = null_fit()
    curve = restoring_curve(fit.at.span)
    model = fit.model.adding(curve)
    found = refine(model, data, noise, np.append(fit.value, np.zeros(curve.sizes)))
    told = curve_told(found, curve, drawn_of(found, curve, noise), "rad")
    assert told["summary"].endswith(("holds zero everywhere", ", or by chance"))
    assert not told["stands_out"]


@pytest.mark.slow
@pytest.mark.parametrize(("name", "drawn"), [("sensor-cubic", True), ("tone-pickup", False)])
def test_every_effect_but_a_line_has_its_curve(name: str, drawn: bool) -> None:
    (effect,) = diagnosed(name).effects
    assert (effect.curve is not None) == drawn
    if effect.curve is not None:
        band = 3.0 * effect.curve["sd"] + 0.1 * NOISE_RAD
        assert effect.curve["named_as"] == effect.name
        assert np.all(np.abs(effect.curve["named"] - effect.curve["value"]) < band)
