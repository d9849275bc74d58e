"""The rivals that share the probability of an effect: those that the final noise allows."""

import functools
import math
from dataclasses import replace

import numpy as np
import pytest

from pendpipe.diagnosis.detect import Chance, Lead, Trials
from pendpipe.diagnosis.refine import refine
from pendpipe.diagnosis.result import Diagnosis, Finding
from pendpipe.diagnosis.rivals import Rival, Scale, class_width, evidence, probabilities
from pendpipe.diagnosis.run import diagnose_recording
from pendpipe.diagnosis.weighing import fault_named, law_of, weigh
from pendpipe.effects import Effect
from pendpipe.effects.catalogue import by_identifier
from pendpipe.effects.curves import CURVES
from pendpipe.effects.model import Model

from .records import (
    FREQUENCY_HZ,
    INSTANT_S,
    INTERVAL_S,
    TIME_S,
    TRUTH,
    Magnet,
    null_fit,
    pulled,
    recording,
)

JUMP_RAD = 1e-3
"""Ten times the noise of a reading."""


@functools.cache
def jumped() -> Diagnosis:
    """The equilibrium jumps; the estimate of the noise changes with the model."""
    model = Model(TIME_S, INTERVAL_S, (by_identifier("equilibrium-step"),))
    return diagnose_recording(recording(model.reading(np.append(TRUTH, [JUMP_RAD, INSTANT_S])), 3))


def rival(effect: Effect, worth: float) -> Rival:
    """An effect that gains so much, its scan not counted."""
    return Rival(Lead(effect, (), 0.0, 0.0), null_fit()[0], worth, worth, worth)


def test_a_jump_of_ten_times_the_noise_is_no_red_noise_and_has_no_rival() -> None:
    (effect,) = jumped().effects
    assert effect.identifier == "equilibrium-step"
    # Half the readings on either side of it: chi^2 of the jump itself, about n (10/2)^2.
    assert effect.delta_chi2 == pytest.approx(25.0 * len(TIME_S), rel=0.3)
    assert effect.indistinguishable == ()
    assert effect.probability > 0.9


@pytest.mark.parametrize("place", range(1, 4))
def test_a_rival_is_compared_by_its_gain_with_the_final_noise(
    place: int,
) -> None:
    found = jumped().search
    (step,) = found.steps
    weighed = weigh(found, step)
    one = step.rivals[place]
    start = np.append(weighed.without.value, one.fit.value[len(TRUTH) :])
    model = weighed.without.model.adding(one.lead.effect)
    fit = refine(model, found.data, found.noise, start, held=found.held)
    behind = fit.chi2 - found.fit.chi2
    assert behind > step.winner.gain - one.gain
    width = class_width(replace(step.winner, gain=weighed.gain))
    assert (one.identifier in {mate.identifier for mate in weighed.mates}) == (behind < width)


@pytest.mark.parametrize("loss", [1.0, 30.0, 3e4])
def test_a_negative_gain_stays_negative(loss: float) -> None:
    """Later, under a smaller noise, it must not be credited with what it had lost."""
    fit, _, _ = null_fit()
    lead = Lead(by_identifier("circular-error"), (), 0.0, 0.0)
    worth = evidence(lead, fit, -loss, Chance(Trials(1.0, 0.0), {}))
    assert worth == pytest.approx(-loss)
    later = Rival(lead, fit, -loss, -loss, worth).again(fit, fit.chi2 - 0.5 * loss, Scale(fit.chi2))
    assert later.evidence == pytest.approx(-0.5 * loss)


@pytest.mark.parametrize("gain", [1e4, 1e5, 1e6])
def test_a_prior_raises_no_effect_that_the_readings_reject(gain: float) -> None:
    """Circular error has a higher prior than a cubic torque; but not if it is far behind."""
    cubic = rival(by_identifier("cubic-stiffness"), gain)
    near, far = (rival(by_identifier("circular-error"), gain - behind) for behind in (0.0, 101.0))
    own, other, _ = probabilities([cubic, near], gain - 5.0)
    assert other > 2.0 * own
    own, other, _ = probabilities([cubic, far], gain - 5.0)
    assert other <= own


def test_a_pendulum_is_one_though_its_torque_is_off_by_less_than_a_hundredth() -> None:
    """At a gain of 10^8 anything else that is small, an encoder's eccentricity say, weighs more."""
    cubic = rival(by_identifier("cubic-stiffness"), 1e8)
    near, far = (rival(by_identifier("circular-error"), 1e8 - behind) for behind in (5e3, 2e4))
    own, other, _ = probabilities([cubic, near], 1e8 - 5.0)
    assert other > 2.0 * own
    own, other, _ = probabilities([cubic, far], 1e8 - 5.0)
    assert other <= own


def test_a_pendulum_over_a_magnet_is_a_pendulum_beside_the_curve() -> None:
    """Without the curve of the magnet's torque others would seem likelier than sin x."""
    values = np.append(np.where(TRUTH == 0.15, 0.3, TRUTH), [1.0, -0.5, 0.05])
    effects = by_identifier("circular-error"), Magnet()
    readings = Model(TIME_S, INTERVAL_S, effects, order=20).reading(values)
    found = diagnose_recording(recording(readings, 3))
    assert found.effects[0].identifier == "circular-error"
    assert found.effects[0].presumed
    assert [each.identifier for each in found.missing] == ["unnamed-restoring"]


def test_a_curve_that_fits_better_does_not_lower_a_name() -> None:
    """A real law differs from the catalogue's form by more than that at a gain of 10^5."""
    curve = rival(CURVES[0](null_fit()[0].at.span), 1e5)
    name = rival(by_identifier("cubic-stiffness"), 1e5 - 101.0)
    drawn, named, _ = probabilities([curve, name], 1e5 - 5.0)
    assert named > drawn


def test_a_curve_without_a_name_takes_nothing_from_the_law() -> None:
    """A pull that no entry of the catalogue describes: a, b, c and f are those of Eq. 8 alone."""
    outcome = diagnose_recording(recording(pulled(0.5, 0.03), 3), restoring="linear")
    found, diagnosis = outcome.search, outcome
    assert [step.winner.drawn for step in found.steps] == [True]
    weighed = [weigh(found, step) for step in found.steps]
    law = law_of(found, weighed)
    assert law.model.effects == ()
    assert law.chi2 > 2.0 * found.fit.chi2
    assert law.error_scale > 1.0
    for name in ("a", "b", "c", "frequency"):
        alone, given = diagnosis.baseline.parameters[name], diagnosis.improved.parameters[name]
        assert abs(given.value - alone.value) < 0.1 * given.sd


def test_each_of_several_names_is_less_certain_than_one() -> None:
    """The same effect with the same gain, where one name, and where three, leave only noise."""
    found = jumped().search
    (step,) = found.steps
    alone = weigh(found, step).weights
    others = [
        replace(step, rivals=(rival(by_identifier(name), 50.0),))
        for name in ("impulse", "second-mode")
    ]
    # The comparison of one step does not look at what the others explain.
    doubted = weigh(replace(found, steps=(step, *others)), step).weights
    assert doubted[-1] / doubted[0] == pytest.approx(np.exp(2.2) * alone[-1] / alone[0], rel=1e-2)


@pytest.mark.parametrize(("order", "off"), [(2.0, 0.3), (3.0, 0.02)])
def test_a_line_near_a_harmonic_is_doubted_by_the_chance_that_it_is_so_near(
    order: float, off: float
) -> None:
    """A law that nobody knows makes lines at the harmonics, and others anywhere.

    Half the sampling rate lies a third of the frequency above a harmonic: an error of every second
    reading makes lines there, and of three combs one is three times as often so near.
    """
    second = by_identifier("second-mode")
    tone = [1e-3, 0.0, (order + off) * FREQUENCY_HZ, 30.0]
    readings = Model(TIME_S, INTERVAL_S, (second,)).reading(np.append(TRUTH, tone))
    (effect,) = diagnose_recording(recording(readings, 5)).effects
    assert effect.identifier == "second-mode"
    by_chance = min(2.0 * off, 6.0 * (1.0 / 3.0 - off))
    named = 1.0 / (1.0 + np.exp(-2.5) / by_chance)
    assert effect.probability == pytest.approx(named, abs=0.02)


@pytest.mark.parametrize("none", [0.0, 0.3, 0.9])
@pytest.mark.parametrize("name", ["broadband-drive", "missing-codes"])
def test_a_random_cause_is_no_more_probable_than_the_names_beside_it(
    name: str, none: float
) -> None:
    """It takes what a wrong name leaves; what the codes show it does not touch."""
    found, probable = jumped().search, np.array([1.0 - none, none])
    fault = Finding(name, 1e-7, delta_chi2=100.0)
    given = [weigh(found, step)._replace(weights=probable) for step in found.steps]
    sure = [each._replace(weights=np.array([1.0, 0.0])) for each in given]
    ratio = (
        fault_named(found, fault, given).probability / fault_named(found, fault, sure).probability
    )
    assert ratio == pytest.approx(1.0 - none if name == "broadband-drive" else 1.0)


def test_a_random_torque_that_explains_no_more_than_a_smooth_misfit_is_not_confident() -> None:
    """What a law lacks changes amplitude and phase too."""
    found = jumped().search
    margins = (math.inf, 10.0, 0.0, -10.0)
    findings = [Finding("broadband-drive", 1e-7, 100.0, margin=margin) for margin in margins]
    sure = [weigh(found, step)._replace(weights=np.array([1.0, 0.0])) for step in found.steps]
    chances = [fault_named(found, each, sure).probability for each in findings]
    assert chances == sorted(chances, reverse=True)
    assert chances[1] > 0.98 * chances[0]
    assert chances[2] < 0.5
    assert chances[3] < 0.01
