"""Lines that come in families: harmonics and folds, side bands, combs; what an image does."""

import math

import numpy as np
import pytest

from pendpipe.arrays import FloatArray
from pendpipe.effects.catalogue.in_time import (
    damping_modulation,
    repeated_kicks,
    resonant_drive,
    slow_modulation,
)
from pendpipe.effects.catalogue.reading import (
    PERSPECTIVE,
    gain_modulation,
    hum_near_the_motion,
    tone_with_harmonics,
)
from pendpipe.effects.effect import Effect, Span
from pendpipe.effects.kicks import repeated_kick
from pendpipe.effects.model import Evaluated, Model, pendulum_of

from .integration import integrate
from .pendulums import OMEGA, baseline, plain, times

TIME = times(60.0, 0.047)


def with_effect(effect: Effect, values: tuple[float, ...], base: FloatArray) -> Evaluated:
    return Model(TIME, 0.047, (effect,)).evaluate(np.append(base, values))


def test_harmonics_of_a_folded_hum_are_the_folds_of_its_harmonics() -> None:
    """50, 100 and 150 Hz at 21.28 readings a second; the first is seen at 50 - 2 x 21.28 Hz."""
    base = baseline(b=0.01)
    values = (1e-3, 5e-4, -3e-4, 2e-4, 1e-4, -2e-4, 50.0 - 2.0 / 0.047)
    added = with_effect(tone_with_harmonics, values, base).reading - plain(base, TIME)
    expected = sum(
        values[2 * k - 2] * np.cos(2.0 * math.pi * 50.0 * k * TIME)
        + values[2 * k - 1] * np.sin(2.0 * math.pi * 50.0 * k * TIME)
        for k in (1, 2, 3)
    )
    np.testing.assert_allclose(added, expected, 0.0, 1e-9)


@pytest.mark.parametrize(("line_hz", "seen"), [(50.0, True), (120.0, True), (70.0, False)])
def test_hum_is_looked_for_near_the_motion_where_sampling_folds_it_there(
    line_hz: float, seen: bool
) -> None:
    rate = (line_hz - 0.9) / 2.0
    span = Span(0.0, 200.0, 1.0 / rate, pendulum_of(baseline()), 0.15, 0.05)
    tried = np.ravel(hum_near_the_motion.shapes(span))
    assert seen == (len(tried) > 0 and np.abs(tried - 0.9).min() < 0.2 / 200.0)


def test_a_gain_that_changes_has_two_side_bands_and_either_tells_its_rate() -> None:
    base = baseline(b=0.01)
    at = with_effect(gain_modulation, (2e-3, 1e-3, 0.07), base)
    own, turn = plain(base, TIME), 2.0 * math.pi * 0.07 * TIME
    factor = 1.0 + 2e-3 * np.cos(turn) + 1e-3 * np.sin(turn)
    np.testing.assert_allclose(at.reading, factor * own, 0.0, 1e-9)
    for effect in (gain_modulation, slow_modulation, damping_modulation):
        for line_hz in (0.83, 0.97):
            assert effect.tone(line_hz, math.inf, at.span) == pytest.approx((0.07,))
        assert effect.tone(0.97, 20.0, at.span) is None
        assert effect.tone(2.5, math.inf, at.span) is None
    assert gain_modulation.bounds(60.0)[-1] == (3.0 / 60.0, 1e6)


def test_a_loss_that_goes_up_and_down_is_a_gain_that_does_a_quarter_turn_later() -> None:
    """exp(-integral of gamma) of a small gamma: no single sensor tells the two apart."""
    base, gamma = baseline(b=0.01), 3e-3
    own, pace = plain(base, TIME), 2.0 * math.pi * 0.07
    at = with_effect(damping_modulation, (gamma, 0.0, 0.07), base)
    factor = np.exp(-gamma / pace * np.sin(pace * TIME))
    assert np.max(np.abs(at.reading - factor * own)) < 0.1 * gamma / pace * np.max(np.abs(own))


@pytest.mark.parametrize("turned_rad", [0.2, -0.3])
def test_a_camera_that_looks_askew_sees_what_comes_nearer_larger(turned_rad: float) -> None:
    """Projection from 2 m; scale and place of the image are the offset's and the fit's."""
    at = with_effect(PERSPECTIVE[0], (math.sin(turned_rad) / 2.0,), baseline(b=0.01))
    x = at.sampled.angle
    across, towards = x * math.cos(turned_rad), x * math.sin(turned_rad)
    seen = across * 2.0 / (2.0 + towards) / math.cos(turned_rad)
    np.testing.assert_allclose(at.reading, seen, 0.0, 1e-12)
    lens = PERSPECTIVE[1].reading(at.sampled, at.span.pendulum, np.array([0.0, 0.1]))
    np.testing.assert_allclose(lens, 0.1 * x**3, 0.0, 1e-12)


EVERY_S = tuple(4.3 + 5.7 * k for k in range(10))


def kicked(at_s: tuple[float, ...] = EVERY_S) -> FloatArray:
    """Kicks of 12 mrad/s, by scipy's integration."""
    kicks = tuple((each, 0.0, 0.012) for each in at_s)
    return integrate(
        lambda _t, y, _s, _x0: -(OMEGA**2) * y[0] - 0.02 * y[1], 0.15, 0.0, TIME, kicks=kicks
    )


def test_a_kick_that_is_repeated_is_sharp_in_the_readings() -> None:
    found = with_effect(repeated_kicks, (0.012, 5.7, 4.3), baseline(b=0.01))
    # The motion has half of the loss's square, and nodes of a smooth kick.
    np.testing.assert_allclose(found.reading, kicked(), 0.0, 3e-5)


def test_kicks_are_found_in_readings_and_no_others() -> None:
    rng = np.random.default_rng(5)
    readings = kicked() + 1e-4 * rng.standard_normal(len(TIME))
    found = repeated_kick(TIME, readings, 1.001 * OMEGA, sine=False)
    assert found is not None
    assert found.period_s == pytest.approx(5.7, abs=0.02)
    assert found.first_s == pytest.approx(4.3, abs=0.1)
    assert found.kick == pytest.approx(0.012, rel=0.15)
    assert found.omega == pytest.approx(OMEGA, rel=3e-4)
    assert found.loss == pytest.approx(0.01, rel=0.1)
    span = Span(0.0, 60.0, 0.047, pendulum_of(baseline()), 0.15, 0.05)
    begun = resonant_drive.restart(TIME, readings, span.pendulum, 0.05)
    assert begun is not None
    assert begun.effect is repeated_kicks
    assert begun.release.time_s == pytest.approx(0.0, abs=0.01)
    assert begun.release.angle_rad == pytest.approx(0.15, rel=0.01)
    # No kick, a gain that goes up and down, and knocks that keep no time.
    own = plain(baseline(b=0.01), TIME)
    gain = 1.0 + 8e-3 * np.cos(2.0 * math.pi * 0.18 * TIME)
    for other in (own, gain * own, kicked((9.1, 23.4, 31.0))):
        noisy = other + 1e-4 * rng.standard_normal(len(TIME))
        assert repeated_kick(TIME, noisy, OMEGA, sine=False) is None
    assert repeated_kick(TIME[:300], readings[:300], OMEGA, sine=False) is None
