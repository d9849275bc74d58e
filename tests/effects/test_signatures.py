"""Signatures of losses, torques and readings, against closed forms."""

import math
from collections.abc import Callable

import mpmath
import numpy as np
import pytest
from scipy.special import ellipj

from pendpipe.arrays import FloatArray
from pendpipe.effects.catalogue import by_identifier
from pendpipe.effects.catalogue.reading import (
    SoftClipping,
    camera_geometry,
    camera_seen_wide,
)
from pendpipe.effects.catalogue.restoring import CIRCULAR_ERROR_IN
from pendpipe.effects.curves import usual_loss_rate
from pendpipe.effects.effect import STRAIGHT_S, Span
from pendpipe.effects.model import Model, pendulum_of
from pendpipe.physics import STANDARD_GRAVITY_M_PER_S2

from .lock_in import Lines, lock_in, windows
from .pendulums import OMEGA, baseline, evaluated, plain, reading, times

# What frictions do: how the amplitude falls, and the third harmonic in quadrature.

TIME = times(110.0, 0.04)


def fall_rates(
    identifier: str, values: tuple[float, ...], start: float
) -> list[tuple[float, float]]:
    """Amplitude and -dy/dt in windows of eight cycles, of an effect by itself."""
    found = reading(identifier, values, baseline(start=start), TIME)
    return [
        (window.amplitude, window.decay * window.amplitude)
        for window in windows(TIME, found, OMEGA, 8, 9)
    ]


def test_the_usual_loss_is_that_of_the_middle_amplitude() -> None:
    """From 0.4 to 0.1 rad that is 0.2 rad: a y + b + c/y, and 1e-4 of omega for a lossless one."""
    span = Span(0.0, 100.0, 0.05, pendulum_of(baseline(a=0.1, b=0.02, c=1e-3)), 0.4, 0.1)
    expected = 0.1 * 0.2 + 0.02 + 1e-3 / 0.2 + 1e-4 * OMEGA
    assert usual_loss_rate(span.pendulum, span) == pytest.approx(expected, rel=1e-12)


def g(exponent: float) -> float:
    """<|sin|^(n + 1)> by quadrature."""
    return float(
        mpmath.quad(lambda x: mpmath.sin(x) ** (exponent + 1), [0, mpmath.pi / 2]) * 2 / mpmath.pi
    )


def by_power(exponent: float, form: float) -> tuple[object, ...]:
    """dy/dt = -f (w y/v_1)^n g_n/w in either form."""
    size = 0.02 / (OMEGA * 0.2 / 0.1) ** exponent
    rate = size * g(exponent) / OMEGA * (OMEGA / 0.1) ** exponent
    return "power-law-damping", (size, exponent, form), 0.2, lambda y: rate * y**exponent


@pytest.mark.parametrize(
    ("identifier", "values", "start", "rate"),
    [
        *(by_power(exponent, form) for exponent in (0.5, 1.5, 2.5, 4.0) for form in (0.0, 1.0)),
        # v^3 or x^2 v: one envelope.
        *(("cubic-damping", (0.5, form), 0.2, lambda y: 0.5 * y**3 / 8.0) for form in (0, 0.4, 1)),
        ("coulomb-friction", (1e-3,), 0.2, lambda _: 1e-3),
        ("quadratic-drag", (0.05,), 0.2, lambda y: 0.05 * y**2),
        ("vortex-shedding", (0.01, 0.2, 0.5), 0.3, lambda y: 0.01 * max(y - 0.2, 0.0)),
    ],
)
def test_a_loss_lowers_the_amplitude_as_its_law_says(
    identifier: str, values: tuple[float, ...], start: float, rate: Callable[[float], float]
) -> None:
    for amplitude, found in fall_rates(identifier, values, start):
        assert found == pytest.approx(rate(amplitude), rel=0.01, abs=1e-7), amplitude


def test_coulomb_friction_and_quadratic_drag_are_the_baselines_own() -> None:
    base = baseline(b=0.002, start=0.2)
    both = (("coulomb-friction", {"c": 1e-3}, 1e-3), ("quadratic-drag", {"a": 0.05}, 0.05))
    for identifier, within, size in both:
        own = plain(baseline(b=0.002, start=0.2, **within), TIME)
        np.testing.assert_allclose(reading(identifier, (size,), base, TIME), own, 0.0, 1e-8)


def test_stribeck_friction_acts_where_it_is_slow() -> None:
    """dy/dt = -<f_s e^(-(w y sin)^2/v_s^2) |sin|>/w."""
    f_s, v_s = 2e-3, 0.3
    for amplitude, rate in fall_rates("stribeck-friction", (f_s, v_s), 0.08):
        peak = OMEGA * amplitude / v_s
        mean = mpmath.quad(
            lambda x, p=peak: mpmath.exp(-((p * mpmath.sin(x)) ** 2)) * mpmath.sin(x),
            [0, mpmath.pi / 2],
        )
        assert rate == pytest.approx(float(mean * 2 / mpmath.pi) * f_s / OMEGA, rel=0.02)


def test_presliding_is_coulomb_friction_far_above_its_breakaway_angle() -> None:
    """dy/dt = -2 w k_d z_c/pi but for what the reversals save: y >> z_c."""
    k_d, z_c = 0.1, 1e-3
    for amplitude, rate in fall_rates("presliding-friction", (k_d, z_c), 0.2)[:4]:
        # The friction's work in a half cycle: f (2 y - 2 z_c), the way 2 y less the reversal.
        expected = 2.0 * OMEGA * k_d * z_c / math.pi * (1.0 - z_c / amplitude)
        assert rate == pytest.approx(expected, rel=0.01)


def test_presliding_loses_in_a_cycle_what_its_loop_encloses() -> None:
    """At y = z_c, by Dahl's own equation cycled by hand until it closes."""
    k_d, z_c, amplitude = 1e-3, 0.1, 0.1
    z, work = 0.0, 0.0
    angle = amplitude * np.cos(np.linspace(0.0, 2.0 * math.pi, 20001))
    for cycle in range(6):
        work = 0.0
        for step in np.diff(angle):
            before = z
            z += step - abs(step) * z / z_c
            work += 0.5 * (z + before) * step if cycle == 5 else 0.0
    found = reading("presliding-friction", (k_d, z_c), baseline(start=amplitude), TIME)
    window = lock_in(TIME, found, OMEGA, 0.0, 9.0)
    scaled = k_d * work / (2.0 * math.pi * window.amplitude)
    assert window.decay * window.amplitude == pytest.approx(OMEGA * scaled, rel=0.02)


def test_no_vortices_are_shed_below_their_amplitude() -> None:
    below = reading("vortex-shedding", (0.01, 0.2, 0.5), baseline(start=0.15, b=0.01), TIME)
    np.testing.assert_allclose(below, plain(baseline(start=0.15, b=0.01), TIME), 0.0, 1e-9)


@pytest.mark.parametrize("phi", [0.3, 0.8, 2.0])
def test_a_burst_after_the_reversal_slows_the_pendulum(phi: float) -> None:
    """The frequency falls by k (1 - y_c/y)/phi: the shorter the burst, the more it is a spring."""
    k, y_c, amplitude = 1e-4, 0.1, 0.3
    found = reading("vortex-shedding", (k, y_c, phi), baseline(start=amplitude), TIME)
    window = lock_in(TIME, found, OMEGA, 0.0, 9.0)
    expected = -k * (1.0 - y_c / amplitude) / phi
    assert window.angular_frequency - OMEGA == pytest.approx(expected, rel=0.01)


@pytest.mark.parametrize(
    ("identifier", "values", "r3"),
    [
        ("quadratic-drag", (0.03,), -1 / 3),
        ("power-law-damping", (1e-4, 2.0, 0.0), 1 / 5),
        ("power-law-damping", (3e-4, 1.5, 0.0), 0.5 / 4.5),
        ("power-law-damping", (3e-4, 1.5, 1.0), -1 / 3),
        ("cubic-damping", (1.0, 0.0), 1 / 3),
        ("cubic-damping", (1.0, 1.0), -1.0),
        ("coulomb-friction", (2e-3,), -1 / 3),
    ],
)
def test_the_third_harmonic_in_quadrature_tells_the_law(
    identifier: str, values: tuple[float, ...], r3: float
) -> None:
    """x_3 = r_3 y/(8 Q) times sin(3 phase): its sign and size belong to the law."""
    time = times(16.0, 0.01)
    found = reading(identifier, values, baseline(start=0.3), time, 28)
    window = lock_in(time, found, OMEGA, 2.0, 2.0 + 4.0 * 2.0 * math.pi / OMEGA)
    loss = 2.0 * window.decay / OMEGA
    expected = -r3 * window.amplitude * loss / 8.0
    assert window.lines[3].imag == pytest.approx(expected, rel=0.05)


def test_drag_form_keeps_the_envelope_and_turns_the_third_harmonic_round() -> None:
    """r_3 goes from -1/3 to +1/5, y(t) stays."""
    time = times(16.0, 0.01)
    base = baseline(a=0.03, start=0.3)
    energy, form = (reading("drag-form", (size,), base, time, 28) for size in (0.0, 1.0))
    stop = 2.0 + 4.0 * 2.0 * math.pi / OMEGA
    first, second = (lock_in(time, found, OMEGA, 2.0, stop) for found in (energy, form))
    assert second.amplitude == pytest.approx(first.amplitude, rel=2e-3)
    assert second.decay == pytest.approx(first.decay, rel=0.01)
    assert second.lines[3].imag / first.lines[3].imag == pytest.approx(-3.0 / 5.0, rel=0.05)


def test_the_release_transient_takes_its_share_and_is_gone() -> None:
    """The logarithm of y falls by gamma tau in all."""
    gamma, tau = 0.02, 4.0
    base = baseline(b=0.005)
    found = evaluated("release-transient", (gamma, tau), base, TIME)
    ratio = plain(base, TIME)[-200:] / found.reading[-200:]
    assert np.median(ratio) == pytest.approx(math.exp(gamma * tau), rel=1e-3)


def test_damping_that_drifts_and_damping_that_jumps() -> None:
    """The logarithm of y is -b t less the drift's integral, and -b (t + eps (t - t_k)).

    The integral of rate tau (1 - e^(-t/tau)) is rate t^2/2 where tau is long.
    """
    b, rate = 0.01, 1e-4
    straight = evaluated("damping-drift", (rate, 1e5), baseline(b=b), TIME)
    logs = np.log(straight.sampled.amplitude / 0.15)
    np.testing.assert_allclose(logs, -b * TIME - 0.5 * rate * TIME**2, 0.0, 5e-3)
    tau = 20.0
    relaxing = evaluated("damping-drift", (rate, tau), baseline(b=b), TIME)
    logs = np.log(relaxing.sampled.amplitude / 0.15)
    lost = rate * tau * (TIME + tau * np.expm1(-TIME / tau))
    np.testing.assert_allclose(logs, -b * TIME - lost, 0.0, 5e-3)
    stepped = evaluated("damping-step", (1.5, 40.0), baseline(b=b), TIME)
    logs = np.log(stepped.sampled.amplitude / 0.15)
    late = np.maximum(TIME - 40.0, 0.0)
    np.testing.assert_allclose(logs, -b * (TIME + 1.5 * late), 0.0, 5e-3)


# What a changed restoring torque does: frequency against amplitude, and harmonics in phase.

SHORT_TIME = times(24.0, 0.02)


def lines(identifier: str, values: tuple[float, ...], amplitude: float, order: int = 20) -> Lines:
    """The harmonics of a pendulum that loses nothing."""
    found = reading(identifier, values, baseline(start=amplitude), SHORT_TIME, order)
    return lock_in(SHORT_TIME, found, OMEGA, 0.0, 22.0)


@pytest.mark.parametrize("amplitude", [0.1, 0.2, 0.4, 0.7])
def test_circular_error_is_the_series_of_the_period(amplitude: float) -> None:
    """T/T0 = 1 + y^2/16 + 11 y^4/3072 + 173 y^6/737280."""
    found = lines("circular-error", (1.0,), amplitude)
    series = amplitude**2 / 16 + 11 * amplitude**4 / 3072 + 173 * amplitude**6 / 737280
    assert OMEGA / found.angular_frequency - 1.0 == pytest.approx(series, rel=1e-3)
    assert found.lines[3].real == pytest.approx(-(amplitude**3) / 192, rel=0.5 * amplitude)
    assert abs(found.lines[2]) < 1e-7
    assert abs(found.lines[3].imag) < 1e-6


def test_a_quadratic_torque_shifts_the_mean_against_its_second_harmonic() -> None:
    """-k_2 y^2/2, k_2 y^2/6 and dw/w = -5 k_2^2 y^2/12."""
    k2, amplitude = 0.2, 0.1
    found = lines("quadratic-stiffness", (k2,), amplitude)
    y = found.amplitude
    assert found.level == pytest.approx(-k2 * y**2 / 2.0, rel=0.01)
    assert found.lines[2].real == pytest.approx(k2 * y**2 / 6.0, rel=0.01)
    shift = found.angular_frequency / OMEGA - 1.0
    assert shift == pytest.approx(-5.0 * k2**2 * y**2 / 12.0, rel=0.02)


@pytest.mark.parametrize(
    ("identifier", "values", "amplitude", "shift", "third", "within"),
    [
        # 3 k_3 y^2/8, and twelve times less of the amplitude in the third harmonic.
        *(
            ("cubic-stiffness", (k3,), 0.12, 0.375 * k3 * 0.12**2, k3 * 0.12**3 / 32.0, 0.01)
            for k3 in (0.3, -0.2)
        ),
        # Play b: -b/(pi y), and b/(12 pi) whatever the amplitude.
        *(
            ("backlash", (5e-4,), y, -5e-4 / (math.pi * y), 5e-4 / (12.0 * math.pi), 0.03)
            for y in (0.05, 0.1, 0.2)
        ),
        # x |x|: 4 kappa y/(3 pi).
        *(
            ("amplitude-linear-stiffness", (0.02,), y, 0.08 * y / (3.0 * math.pi), None, 0.02)
            for y in (0.1, 0.4)
        ),
        # Presliding far below the breakaway angle z_c: k_d/2.
        ("presliding-friction", (1e-3, 1.0), 0.002, 0.5e-3, None, 0.01),
    ],
)
def test_a_torque_shifts_the_frequency_and_makes_a_third_harmonic(
    identifier: str,
    values: tuple[float, ...],
    amplitude: float,
    shift: float,
    third: float | None,
    within: float,
) -> None:
    found = lines(identifier, values, amplitude)
    assert found.angular_frequency / OMEGA - 1.0 == pytest.approx(shift, rel=within)
    assert abs(found.lines[2]) < 1e-7
    if third is not None:
        assert found.lines[3].real == pytest.approx(
            third, rel=0.1 if identifier == "backlash" else within
        )


def test_added_mass_and_friction_are_what_remains_of_the_history_force() -> None:
    """Long after the release: b = h sqrt(w/2)/2 and dw/w = -h/(2 sqrt(2 w))."""
    h = 2e-3
    time = times(60.0, 0.05)
    found = lock_in(time, reading("history-force", (h,), baseline(), time), OMEGA, 38.0, 60.0)
    assert found.decay == pytest.approx(0.5 * h * math.sqrt(0.5 * OMEGA), rel=0.01)
    shift = found.angular_frequency / OMEGA - 1.0
    assert shift == pytest.approx(-0.5 * h / math.sqrt(2.0 * OMEGA), rel=0.01)


def test_a_mean_of_readings_is_followed_in_all_harmonics() -> None:
    """At 2.2 rad sin x bends the motion: the mean of neighbours is x + h^2 (x'')/24, not less."""
    values = np.append(baseline(b=0.01, c=0.002, start=2.2), 1.0)
    fine = times(24.0, 0.005)
    effects = (by_identifier("circular-error"),)
    every = Model(fine, 0.005, effects, order=48).reading(values)
    means = Model(fine.reshape(-1, 4).mean(axis=1), 0.02, effects, order=48, fold=4).reading(values)
    assert means == pytest.approx(every.reshape(-1, 4).mean(axis=1), abs=3e-6)


@pytest.mark.parametrize("amplitude", [0.3, 0.8, 1.4])
def test_the_angular_velocity_of_a_pendulum_is_a_jacobi_sd(amplitude: float) -> None:
    """From rest at y it is -2 omega k k' sd(omega t, k), k = sin(y/2), k' = cos(y/2)."""
    k = math.sin(0.5 * amplitude)
    values = np.append(baseline(start=amplitude), 1.0)
    effects = (by_identifier("circular-error"),)
    model = Model(SHORT_TIME, 0.02, effects, order=48, seen="rate")
    sn, _, dn, _ = ellipj(OMEGA * SHORT_TIME, k * k)
    exact = -2.0 * OMEGA * k * math.cos(0.5 * amplitude) * sn / dn
    assert model.reading(values) == pytest.approx(exact, abs=1e-5)


@pytest.mark.parametrize("amplitude", [0.2, 0.6, 1.0])
def test_a_pendulum_seen_from_the_side_is_the_sine_of_its_angle(amplitude: float) -> None:
    """Seen so, x = L sin(theta); viscous friction 2 b theta' is 2 b x'."""
    length = 0.31
    theta = reading("circular-error", (1.0,), baseline(b=0.02, start=amplitude), SHORT_TIME, 48)
    side = Model(SHORT_TIME, 0.02, (CIRCULAR_ERROR_IN["m"],), order=48)
    values = np.append(baseline(b=0.02, start=length * math.sin(amplitude)), 1.0 / length**2)
    assert side.reading(values) == pytest.approx(length * np.sin(theta), abs=2e-6)


def test_the_length_of_a_pendulum_in_metres_is_expected_about_g_over_omega_squared() -> None:
    form = CIRCULAR_ERROR_IN["m"]
    span = Model(SHORT_TIME, 0.02).evaluate(baseline(start=0.1)).span
    length = STANDARD_GRAVITY_M_PER_S2 / OMEGA**2
    penalties = [form.prior_penalty(np.array([1.0 / (k * length) ** 2]), span) for k in (1, 1.2, 3)]
    assert penalties[0] == pytest.approx(0.0, abs=1e-12)
    assert penalties[1] < 1.0 < 20.0 < penalties[2]
    assert CIRCULAR_ERROR_IN["pixels"].prior_penalty(np.array([1e-6]), span) == 0.0


# What changes the readings and not the motion.

MIDDLE_TIME = times(40.0, 0.02)
CYCLE = 2.0 * math.pi / OMEGA
BASE = baseline(b=0.005)
OWN = plain(BASE, MIDDLE_TIME)


@pytest.mark.parametrize(
    ("identifier", "size", "level", "harmonic", "line", "first"),
    [
        # Both s_2 y^2/2.
        ("sensor-quadratic", 0.1, 0.1 * 0.15**2 / 2.0, 2, 0.1 * 0.15**2 / 2.0, 0.15),
        # s_3 y^3/4 in phase; the first grows by 3 s_3 y^2/4 of itself.
        ("sensor-cubic", 0.5, 0.0, 3, 0.5 * 0.15**3 / 4.0, 0.15 * (1.0 + 0.375 * 0.15**2)),
    ],
)
def test_a_bent_sensor_has_a_harmonic_and_no_frequency_shift(
    identifier: str, size: float, level: float, harmonic: int, line: float, first: float
) -> None:
    seen = reading(identifier, (size,), baseline(), MIDDLE_TIME)
    found = lock_in(MIDDLE_TIME, seen, OMEGA, 0.0, 22.0)
    assert found.level == pytest.approx(level, rel=1e-3, abs=1e-9)
    assert found.lines[harmonic].real == pytest.approx(line, rel=1e-3)
    assert found.amplitude == pytest.approx(first, rel=1e-5)
    assert found.angular_frequency == pytest.approx(OMEGA, rel=1e-8)


def test_a_rolling_shutter_reads_the_motion_later_on_one_side() -> None:
    """y(t) = x(t + kappa y(t)), looked up on a fine grid."""
    kappa, base = -0.01, baseline(b=0.005, start=0.6)
    fine = times(41.0, 0.001)
    own = plain(base, MIDDLE_TIME)
    moving, expected = plain(base, fine), own
    for _ in range(9):
        expected = np.interp(MIDDLE_TIME + kappa * expected, fine, moving)
    found = reading("rolling-shutter", (kappa,), base, MIDDLE_TIME)
    # Half of the angular acceleration times (kappa x)^2 b/omega is left.
    np.testing.assert_allclose(found[1:-1], expected[1:-1], 0.0, 2e-5)
    assert np.max(np.abs(found - own)) > 5e-3


@pytest.mark.parametrize("axis_rad", [0.0, 0.25 * math.pi, -0.4])
def test_a_camera_sees_the_angle_of_a_turned_plane_and_a_misplaced_pivot(axis_rad: float) -> None:
    """By projection: the plane turned by beta about an axis, and e_1 of a length across."""
    beta, across = 0.2, 0.004
    at = evaluated("camera-geometry", (0.0, 0.0), baseline(start=2.0), MIDDLE_TIME)
    own = at.sampled.angle
    late = np.append(own, 0.0) - axis_rad
    seen = np.arctan2(np.cos(beta) * np.sin(late), np.cos(late)) + axis_rad
    turned = np.unwrap(seen[:-1] - own) - seen[-1] + across * (np.cos(own) - 1.0)
    sizes = beta**2 / 4.0 * np.array([-math.cos(2.0 * axis_rad), math.sin(2.0 * axis_rad)])
    values = np.array([across, *sizes])
    wide = camera_seen_wide.reading(at.sampled, at.span.pendulum, values)
    # To the next order in beta^2.
    np.testing.assert_allclose(wide, turned, 0.0, beta**4 / 6.0)
    if not axis_rad:
        usual = camera_geometry.reading(at.sampled, at.span.pendulum, values[:2])
        np.testing.assert_array_equal(usual, wide)


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
    [(12.0, 12.0 * (1.0 - np.exp(-MIDDLE_TIME / 12.0)), 1e-12), (STRAIGHT_S, MIDDLE_TIME, 1e-7)],
)
def test_drifts_of_offset_and_gain_relax_or_are_straight(
    tau: float, gained: FloatArray, within: float
) -> None:
    offset, gain = (
        reading(f"{name}-drift", (rate, tau), BASE, MIDDLE_TIME)
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
        early = reading(identifier, values, BASE, MIDDLE_TIME)
        late_base = BASE.copy()
        late_base[6] += 1000.0
        late = reading(identifier, values, late_base, MIDDLE_TIME + 1000.0)
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
    found = reading("tone-pickup", (2e-4, -1e-4, 3.3), BASE, MIDDLE_TIME) - OWN
    turn = 2.0 * math.pi * 3.3 * MIDDLE_TIME
    np.testing.assert_allclose(found, 2e-4 * np.cos(turn) - 1e-4 * np.sin(turn), 0.0, 1e-12)


def test_a_drifting_clock_reads_later_and_later() -> None:
    rate = 1e-5
    late = plain(BASE, MIDDLE_TIME + 0.5 * rate * MIDDLE_TIME**2)
    straight = reading("clock-drift", (rate, STRAIGHT_S), BASE, MIDDLE_TIME)
    np.testing.assert_allclose(straight, late, 0.0, 1e-7)


def test_the_rate_of_a_clock_that_warms_up_is_the_relaxed_drift() -> None:
    """Its delay, differentiated over the readings."""
    rate, tau = 1e-3, 8.0
    delay = by_identifier("clock-drift").delay(MIDDLE_TIME, np.array([rate, tau]))
    assert delay is not None
    gained = np.diff(delay) / np.diff(MIDDLE_TIME)
    middle = 0.5 * (MIDDLE_TIME[1:] + MIDDLE_TIME[:-1])
    np.testing.assert_allclose(gained, rate * tau * (1.0 - np.exp(-middle / tau)), 1e-5, 1e-8)


@pytest.mark.parametrize(
    ("identifier", "size", "later", "more", "within"),
    [
        # Seven samples lost after the hundredth: from there on, the readings seven later.
        ("dropped-samples", 7 * 0.02, 7, 0.0, 1e-7),
        # A jump of the equilibrium changes amplitude and phase as well; one of the reading not.
        ("offset-step", 1e-3, 0, 1e-3, 1e-12),
    ],
)
def test_lost_samples_and_a_jump_of_the_reading_leave_the_motion_as_it_is(
    identifier: str, size: float, later: int, more: float, within: float
) -> None:
    instant = float(0.5 * (MIDDLE_TIME[100] + MIDDLE_TIME[101]))
    found = reading(identifier, (size, instant), BASE, MIDDLE_TIME)
    np.testing.assert_allclose(found[:101], OWN[:101], 0.0, 1e-9)
    np.testing.assert_allclose(
        found[101 : len(OWN) - later], OWN[101 + later :] + more, 0.0, within
    )


# Readings that fall behind at the ends of the range.

COARSE_TIME = times(60.0, 0.04)
VISCOUS = baseline(b=0.01)
VISCOUS_OWN = plain(VISCOUS, COARSE_TIME)


def clipped(upper: float, lower: float, width: float) -> FloatArray:
    model = Model(COARSE_TIME, 0.04, (SoftClipping(),))
    return model.reading(np.concatenate([VISCOUS, [upper, lower, width]]))


@pytest.mark.parametrize("width", [2e-4, 2e-3, 1.5e-2])
def test_it_is_a_range_that_ends_smoothly(width: float) -> None:
    """Its law is y = L - w ln(1 + e^((L - x)/w)), with L where the largest angle loses d."""
    depth, top = 2e-3, VISCOUS_OWN.max()
    level = top - width * np.log(np.expm1(depth / width))
    expected = level - width * np.logaddexp(0.0, (level - VISCOUS_OWN) / width)
    np.testing.assert_allclose(clipped(depth, 0.0, width), expected, 0.0, 1e-9)


def test_narrow_it_is_a_flat_top() -> None:
    found = clipped(3e-3, 5e-3, 1e-7)
    np.testing.assert_allclose(
        found, np.clip(VISCOUS_OWN, VISCOUS_OWN.min() + 5e-3, VISCOUS_OWN.max() - 3e-3), 0.0, 1e-6
    )


def test_the_largest_angle_loses_its_depth_and_the_middle_nothing() -> None:
    lost = VISCOUS_OWN - clipped(1e-3, 0.0, 4e-3)
    assert lost[np.argmax(VISCOUS_OWN)] == pytest.approx(1e-3, rel=1e-9)
    assert np.all(lost >= 0.0)
    assert np.all(lost[np.abs(VISCOUS_OWN) < 0.05] < 1e-11)
