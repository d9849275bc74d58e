"""What frictions do: how the amplitude falls, and the third harmonic in quadrature."""

import math

import mpmath
import numpy as np
import pytest

from pendpipe.effects.baseline import pendulum_of
from pendpipe.effects.curves import usual_loss_rate
from pendpipe.effects.effect import Span

from .lock_in import lock_in, windows
from .pendulums import OMEGA, baseline, evaluated, plain, reading, times

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


@pytest.mark.parametrize("exponent", [0.5, 1.5, 2.5, 4.0])
@pytest.mark.parametrize("energy_form", [0.0, 1.0])
def test_a_power_law_lowers_the_amplitude_as_that_power(
    exponent: float, energy_form: float
) -> None:
    """dy/dt = -f (w y/v_1)^n g_n/w in either form."""
    size = 0.02 / (OMEGA * 0.2 / 0.1) ** exponent
    for amplitude, rate in fall_rates("power-law-damping", (size, exponent, energy_form), 0.2):
        expected = size * (OMEGA * amplitude / 0.1) ** exponent * g(exponent) / OMEGA
        assert rate == pytest.approx(expected, rel=0.01)


@pytest.mark.parametrize("form", [0.0, 0.4, 1.0])
def test_cubic_damping_has_one_envelope(form: float) -> None:
    """dy/dt = -d y^3/8, v^3 or x^2 v."""
    for amplitude, rate in fall_rates("cubic-damping", (0.5, form), 0.2):
        assert rate == pytest.approx(0.5 * amplitude**3 / 8.0, rel=0.01)


def test_coulomb_friction_and_quadratic_drag_are_those_of_eq_13() -> None:
    for amplitude, rate in fall_rates("coulomb-friction", (1e-3,), 0.2):
        assert rate == pytest.approx(1e-3, rel=0.01), amplitude
    for amplitude, rate in fall_rates("quadratic-drag", (0.05,), 0.2):
        assert rate == pytest.approx(0.05 * amplitude**2, rel=0.01)


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


def test_vortices_are_shed_above_an_amplitude_only() -> None:
    """dy/dt = -k (y - y_c) above y_c, nothing below."""
    k, y_c = 0.01, 0.2
    for amplitude, rate in fall_rates("vortex-shedding", (k, y_c, 0.5), 0.3):
        assert rate == pytest.approx(k * max(amplitude - y_c, 0.0), rel=0.01, abs=1e-7)
    below = reading("vortex-shedding", (k, 0.2, 0.5), baseline(start=0.15, b=0.01), TIME)
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
