"""What changes the readings and not the motion."""

import math

import numpy as np
import pytest

from pendpipe.effects.catalogue import by_identifier
from pendpipe.effects.effect import STRAIGHT_S

from .lock_in import lock_in
from .pendulums import OMEGA, Floats, baseline, evaluated, plain, reading, times

TIME = times(40.0, 0.02)
CYCLE = 2.0 * math.pi / OMEGA
BASE = baseline(b=0.005)
OWN = plain(BASE, TIME)


def test_a_quadratic_sensor_shifts_the_mean_with_its_second_harmonic() -> None:
    """Both s_2 y^2/2, and no change of the frequency."""
    found = lock_in(TIME, reading("sensor-quadratic", (0.1,), baseline(), TIME), OMEGA, 0.0, 22.0)
    assert found.level == pytest.approx(0.1 * 0.15**2 / 2.0, rel=1e-3)
    assert found.lines[2].real == pytest.approx(0.1 * 0.15**2 / 2.0, rel=1e-3)
    assert found.angular_frequency == pytest.approx(OMEGA, rel=1e-8)


def test_a_cubic_sensor_has_a_third_harmonic_and_no_frequency_shift() -> None:
    """s_3 y^3/4 in phase; the first grows by 3 s_3 y^2/4 of itself."""
    found = lock_in(TIME, reading("sensor-cubic", (0.5,), baseline(), TIME), OMEGA, 0.0, 22.0)
    assert found.lines[3].real == pytest.approx(0.5 * 0.15**3 / 4.0, rel=1e-3)
    assert found.amplitude == pytest.approx(0.15 * (1.0 + 0.75 * 0.5 * 0.15**2), rel=1e-5)
    assert found.angular_frequency == pytest.approx(OMEGA, rel=1e-8)


def test_a_rolling_shutter_reads_the_motion_later_on_one_side() -> None:
    """y(t) = x(t + kappa x(t)), looked up on a fine grid."""
    kappa, base = -0.01, baseline(b=0.005, start=0.6)
    fine = times(41.0, 0.001)
    own = plain(base, TIME)
    expected = np.interp(TIME + kappa * own, fine, plain(base, fine))
    found = reading("rolling-shutter", (kappa,), base, TIME)
    # Half of the angular acceleration times (kappa x)^2 b/omega is left.
    np.testing.assert_allclose(found[1:-1], expected[1:-1], 0.0, 2e-5)
    assert np.max(np.abs(found - own)) > 5e-3


def test_a_camera_sees_the_angle_of_a_turned_plane_and_a_misplaced_pivot() -> None:
    """By projection: the plane turned by beta about the vertical, and e_1 of a length across."""
    beta, across = 0.2, 0.004
    own = plain(baseline(start=0.6), TIME)
    x = np.cos(beta) * np.sin(own)
    seen = np.arctan2(x, np.cos(own)) + across * (np.cos(own) - 1.0)
    found = reading("camera-geometry", (across, -(beta**2) / 4.0), baseline(start=0.6), TIME)
    # To the next order in beta^2.
    np.testing.assert_allclose(found, seen, 0.0, beta**4 / 8.0)


def test_play_in_the_sensor_is_the_play_operator() -> None:
    """Against the operator followed step by step on a fine grid."""
    width = 2e-3
    fine = times(8.0, 0.0005)
    angle = plain(BASE, fine)
    followed = np.empty_like(angle)
    place = angle[0] - 0.5 * width
    # Before the release the pendulum was brought up to its first angle.
    for index, x in enumerate(angle):
        place = min(max(place, x - 0.5 * width), x + 0.5 * width)
        followed[index] = place
    found = reading("sensor-backlash", (width,), BASE, fine)
    np.testing.assert_allclose(found, followed, 0.0, 2e-6)
    lines = lock_in(fine, found, OMEGA, 0.0, 6.0 * CYCLE)
    # A square wave of b/2 in phase with the velocity, its corners rounded at the reversals.
    assert lines.lines[3].imag == pytest.approx(-2.0 * width / (3.0 * math.pi), rel=0.1)


@pytest.mark.parametrize(
    ("tau", "gained", "within"),
    [(12.0, 12.0 * (1.0 - np.exp(-TIME / 12.0)), 1e-12), (STRAIGHT_S, TIME, 1e-7)],
)
def test_drifts_of_offset_and_gain_relax_or_are_straight(
    tau: float, gained: Floats, within: float
) -> None:
    offset, gain = (
        reading(f"{name}-drift", (rate, tau), BASE, TIME)
        for name, rate in (("offset", 1e-4), ("gain", 1e-3))
    )
    np.testing.assert_allclose(offset, OWN + 1e-4 * gained, 0.0, within)
    np.testing.assert_allclose(gain, OWN * (1.0 + 1e-3 * gained), 0.0, within)


@pytest.mark.parametrize(
    "identifier", ["frequency-drift", "damping-drift", "clock-drift", "offset-drift", "gain-drift"]
)
def test_a_drift_is_straight_unless_its_relaxation_is_given(identifier: str) -> None:
    assert by_identifier(identifier).parameters[1].default == STRAIGHT_S


def test_drifts_count_from_the_first_reading() -> None:
    """And so do not depend on when the clock of the record was set."""
    for identifier, values in (("offset-drift", (1e-4, 9.0)), ("gain-drift", (1e-3, 9.0))):
        early = reading(identifier, values, BASE, TIME)
        late_base = BASE.copy()
        late_base[6] += 1000.0
        late = reading(identifier, values, late_base, TIME + 1000.0)
        np.testing.assert_allclose(late, early, 0.0, 1e-9)


def test_a_capacitor_lets_the_level_go() -> None:
    """Against a first-order high-pass worked out reading by reading, lead and gain apart."""
    tau, level = 5.0, 0.02
    fine = times(20.0, 0.001)
    angle = plain(BASE, fine)
    held = -level
    passed = np.empty_like(angle)
    for index, x in enumerate(angle):
        passed[index] = x - held
        held += (x - held) * 0.001 / tau
    # What is left of the motion itself: a lead and a gain, constant to a thousandth.
    lead = 1.0 / (1.0 + 1.0 / (1j * OMEGA * tau))
    sampled = evaluated("ac-coupling", (0.0, tau), BASE, fine).sampled
    motion = np.real(lead * sampled.amplitude * np.exp(1j * sampled.phase))
    start_up = passed[0] - motion[0]
    found = reading("ac-coupling", (start_up, tau), BASE, fine) - angle
    np.testing.assert_allclose(found, passed - motion, 0.0, 0.01 * level)


def test_a_tone_is_a_line() -> None:
    found = reading("tone-pickup", (2e-4, -1e-4, 3.3), BASE, TIME) - OWN
    turn = 2.0 * math.pi * 3.3 * TIME
    np.testing.assert_allclose(found, 2e-4 * np.cos(turn) - 1e-4 * np.sin(turn), 0.0, 1e-12)


def test_a_drifting_clock_reads_later_and_later() -> None:
    rate = 1e-5
    late = plain(BASE, TIME + 0.5 * rate * TIME**2)
    straight = reading("clock-drift", (rate, STRAIGHT_S), BASE, TIME)
    np.testing.assert_allclose(straight, late, 0.0, 1e-7)


def test_the_rate_of_a_clock_that_warms_up_is_the_relaxed_drift() -> None:
    """Its delay, differentiated over the readings."""
    rate, tau = 1e-3, 8.0
    delay = by_identifier("clock-drift").delay(TIME, np.array([rate, tau]))
    assert delay is not None
    gained = np.diff(delay) / np.diff(TIME)
    middle = 0.5 * (TIME[1:] + TIME[:-1])
    np.testing.assert_allclose(gained, rate * tau * (1.0 - np.exp(-middle / tau)), 1e-5, 1e-8)


def test_dropped_samples_are_the_readings_that_follow() -> None:
    """Seven samples lost after the hundredth: from there on, the readings seven later."""
    instant = float(0.5 * (TIME[100] + TIME[101]))
    found = reading("dropped-samples", (7 * 0.02, instant), BASE, TIME)
    np.testing.assert_allclose(found[:101], OWN[:101], 0.0, 1e-9)
    np.testing.assert_allclose(found[101:-7], OWN[108:], 0.0, 1e-7)


def test_a_jump_of_the_reading_leaves_the_motion_as_it_is() -> None:
    """A jump of the equilibrium changes amplitude and phase as well."""
    instant = float(0.5 * (TIME[100] + TIME[101]))
    found = reading("offset-step", (1e-3, instant), BASE, TIME)
    np.testing.assert_allclose(found[:101], OWN[:101], 0.0, 1e-12)
    np.testing.assert_allclose(found[101:], OWN[101:] + 1e-3, 0.0, 1e-12)
