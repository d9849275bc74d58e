"""The curve of an effect without a name: its values, band and local exponent."""

import math

import numpy as np
import pytest

from pendpipe.diagnosis.data import Data
from pendpipe.diagnosis.noise import white_noise
from pendpipe.diagnosis.refine import Fit, refine
from pendpipe.diagnosis.values import curve_values
from pendpipe.effects.curves import Curve, damping_curve, drive_curve
from pendpipe.effects.model import Model

TIME_S = np.arange(3000) / 20.0
NOISE_RAD = 1e-5
LINEAR, QUADRATIC = 0.01, 0.08


def fitted(kind: type[Curve], quadratic: float) -> tuple[Fit, Curve]:
    """Readings with a quadratic loss, fitted by b and a curve, a and c held at zero."""
    omega = 2.0 * math.pi * 0.9
    truth = np.array([quadratic, LINEAR, 0.0, 0.0, omega, 0.15, -0.3, 0.0])
    model = Model(TIME_S, 0.05)
    noise_free = model.evaluate(truth)
    values = noise_free.reading + NOISE_RAD * np.random.default_rng(2).standard_normal(len(TIME_S))
    data = Data(TIME_S, values, 0.05, True, np.ones(len(TIME_S)))
    effect = kind(noise_free.span)
    if kind is drive_curve:
        effect = kind(noise_free.span, np.eye(effect.basis_size)[:, :3])
    start = np.concatenate([truth, np.zeros(effect.sizes)])
    start[0] = 0.0
    fit = refine(model.adding(effect), data, white_noise(data, NOISE_RAD), start, held=(0, 1, 2, 3))
    return fit, effect


def test_a_loss_curve_is_the_missing_loss() -> None:
    """Quadratic drag takes -dy/dt = a y^2: a loss rate of a y (Eq. 13)."""
    fit, effect = fitted(damping_curve, QUADRATIC)
    found = curve_values(fit, effect)
    expected = QUADRATIC * found["at"]
    inside = slice(5, -5)
    assert found["value"][inside] == pytest.approx(expected[inside], rel=0.06)
    assert np.all(found["sd"][inside] < 0.05 * expected[inside])
    assert found["argument"].startswith("amplitude")
    # The whole loss is b + a y: n = 1 + a y/(b + a y), between 1 (linear) and 2 (quadratic).
    exponent = 1.0 + expected / (LINEAR + expected)
    assert found["local_exponent"][inside] == pytest.approx(exponent[inside], abs=0.15)
    assert np.all(found["local_exponent_sd"] > 0.0)


def test_a_drive_has_two_curves() -> None:
    fit, effect = fitted(drive_curve, 0.0)
    found = curve_values(fit, effect, "m")
    assert len(found["value"]) == len(found["quadrature"]) == len(found["at"])
    # Nothing was driven: nothing is seen.
    assert np.all(np.abs(found["value"]) <= 4.0 * found["sd"] + 1e-12)
