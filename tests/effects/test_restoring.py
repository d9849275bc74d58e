"""What a changed restoring torque does: frequency against amplitude, and harmonics in phase."""

import math

import numpy as np
import pytest
from scipy.special import ellipj

from pendpipe.effects.catalogue import by_identifier
from pendpipe.effects.catalogue.restoring import CIRCULAR_ERROR_IN
from pendpipe.effects.model import Model

from .lock_in import Lines, lock_in
from .pendulums import OMEGA, baseline, reading, times

TIME = times(24.0, 0.02)


def lines(identifier: str, values: tuple[float, ...], amplitude: float, order: int = 20) -> Lines:
    """The harmonics of a pendulum that loses nothing."""
    found = reading(identifier, values, baseline(start=amplitude), TIME, order)
    return lock_in(TIME, found, OMEGA, 0.0, 22.0)


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
    model = Model(TIME, 0.02, effects, order=48, seen="rate")
    sn, _, dn, _ = ellipj(OMEGA * TIME, k * k)
    exact = -2.0 * OMEGA * k * math.cos(0.5 * amplitude) * sn / dn
    assert model.reading(values) == pytest.approx(exact, abs=1e-5)


@pytest.mark.parametrize("amplitude", [0.2, 0.6, 1.0])
def test_a_pendulum_seen_from_the_side_is_the_sine_of_its_angle(amplitude: float) -> None:
    """Seen so, x = L sin(theta); viscous friction 2 b theta' is 2 b x'."""
    length = 0.31
    theta = reading("circular-error", (1.0,), baseline(b=0.02, start=amplitude), TIME, 48)
    side = Model(TIME, 0.02, (CIRCULAR_ERROR_IN["m"],), order=48)
    values = np.append(baseline(b=0.02, start=length * math.sin(amplitude)), 1.0 / length**2)
    assert side.reading(values) == pytest.approx(length * np.sin(theta), abs=2e-6)


def test_the_length_of_a_pendulum_in_metres_is_expected_about_g_over_omega_squared() -> None:
    form = CIRCULAR_ERROR_IN["m"]
    span = Model(TIME, 0.02).evaluate(baseline(start=0.1)).span
    length = 9.81 / OMEGA**2
    penalties = [form.prior_penalty(np.array([1.0 / (k * length) ** 2]), span) for k in (1, 1.2, 3)]
    assert penalties[0] == pytest.approx(0.0, abs=1e-12)
    assert penalties[1] < 1.0 < 20.0 < penalties[2]
    assert CIRCULAR_ERROR_IN["pixels"].prior_penalty(np.array([1e-6]), span) == 0.0
