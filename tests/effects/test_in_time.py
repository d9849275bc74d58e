"""What changes slowly, suddenly, or periodically."""

import math
from collections.abc import Callable

import numpy as np
import pytest

from pendpipe.effects.baseline import TIME as TIME_S
from pendpipe.effects.baseline import pendulum_of
from pendpipe.effects.catalogue import by_identifier
from pendpipe.effects.effect import STRAIGHT_S, Span
from pendpipe.effects.model import Model

from .lock_in import lock_in
from .pendulums import OMEGA, baseline, evaluated, plain, reading, times

TIME = times(60.0, 0.04)
CYCLE = 2.0 * math.pi / OMEGA


def test_a_drifting_frequency_runs_ahead_with_the_square_of_time() -> None:
    """The phase is w (t + eps t^2/2)."""
    eps = 1e-4
    found = evaluated("frequency-drift", (eps, STRAIGHT_S), baseline(b=0.01), TIME).reading
    for start in (0.0, 20.0, 45.0):
        window = lock_in(TIME, found, OMEGA, start, start + 8.0 * CYCLE)
        assert window.angular_frequency / OMEGA - 1.0 == pytest.approx(
            eps * window.time_s, rel=0.02, abs=2e-5 * eps * 60.0 + 1e-6
        )


def test_a_frequency_jumps() -> None:
    found = reading("frequency-step", (3e-4, 30.0), baseline(b=0.01), TIME)
    before = lock_in(TIME, found, OMEGA, 28.0 - 8.0 * CYCLE, 28.0)
    after = lock_in(TIME, found, OMEGA, 32.0, 32.0 + 8.0 * CYCLE)
    change = after.angular_frequency / before.angular_frequency - 1.0
    assert change == pytest.approx(3e-4, rel=0.01)


@pytest.mark.parametrize("exponential", [0.0, 1.0])
def test_the_equilibrium_creeps(exponential: float) -> None:
    """The level follows s ln(1 + t/tau), or s (1 - e^(-t/tau))."""
    size, tau = 2e-3, 10.0
    found = reading("equilibrium-creep", (size, tau, exponential), baseline(b=0.01), TIME)
    for start in (5.0, 20.0, 45.0):
        window = lock_in(TIME, found, OMEGA, start, start + 4.0 * CYCLE)
        late = window.time_s / tau
        law = 1.0 - math.exp(-late) if exponential else math.log1p(late)
        assert window.level == pytest.approx(size * law, rel=0.01)


@pytest.mark.parametrize("phase", [0.0, 0.7, 1.6, 2.9, 4.4])
@pytest.mark.parametrize(
    ("identifier", "size", "unit", "rise", "change"),
    [
        # The level rises by J; dy = -J cos(psi), y dpsi = J sin(psi).
        ("equilibrium-step", 5e-4, 5e-4, 5e-4, lambda psi: (-math.cos(psi), math.sin(psi))),
        # The level stays; dy = -dv sin(psi)/w, y dpsi = -dv cos(psi)/w.
        ("impulse", 2e-3, 2e-3 / OMEGA, 0.0, lambda psi: (-math.sin(psi), -math.cos(psi))),
    ],
)
def test_a_jump_or_a_knock_changes_amplitude_and_phase(
    identifier: str,
    size: float,
    unit: float,
    rise: float,
    change: Callable[[float], tuple[float, float]],
    phase: float,
) -> None:
    instant, base = 27.0 * CYCLE + phase / OMEGA, baseline()
    found = reading(identifier, (size, instant), base, TIME)
    before = lock_in(TIME, found, OMEGA, instant - 8.0 * CYCLE, instant - 0.05)
    after = lock_in(TIME, found, OMEGA, instant + 0.05, instant + 8.0 * CYCLE)
    advance = after.phase - before.phase - OMEGA * (after.time_s - before.time_s)
    ahead = 0.15 * math.remainder(advance, 2.0 * math.pi)
    assert after.level - before.level == pytest.approx(rise, rel=0.01, abs=1e-6)
    assert (after.amplitude - before.amplitude, ahead) == pytest.approx(
        tuple(unit * each for each in change(phase)), abs=0.02 * unit
    )
    fine = np.linspace(instant - 1e-3, instant + 1e-3, 2001)
    across = reading(identifier, (size, instant), base, fine)
    assert np.max(np.abs(np.diff(across))) < 2e-6


def test_an_amplitude_jumps_and_nothing_else() -> None:
    base = baseline(b=0.01)
    found = reading("amplitude-step", (0.2, 30.0), base, TIME)
    own = plain(base, TIME)
    np.testing.assert_allclose(found[TIME < 30.0], own[TIME < 30.0], 0.0, 1e-9)
    later = TIME > 30.0
    np.testing.assert_allclose(found[later], math.exp(0.2) * own[later], 0.0, 1e-7)


def test_a_drive_answers_as_an_undamped_oscillator_far_from_resonance() -> None:
    """The tone is d/|w^2 - w_d^2|; a pendulum without loss keeps what rang at the start."""
    drive, frequency = 2e-3, 1.3 * 0.9
    base = baseline()
    found = reading("periodic-drive", (drive, 0.0, frequency), base, TIME)
    turn = 2.0 * math.pi * frequency
    tone = drive / (OMEGA**2 - turn**2)
    expected = tone * (np.cos(turn * TIME) - np.cos(OMEGA * TIME))
    np.testing.assert_allclose(found - plain(base, TIME), expected, 0.0, 0.02 * abs(tone))


def test_a_second_mode_rings_down_on_top() -> None:
    base = baseline(b=0.01)
    found = reading("second-mode", (1e-3, 5e-4, 4.3, 6.0), base, TIME)
    turn = 2.0 * math.pi * 4.3 * TIME
    expected = (1e-3 * np.cos(turn) + 5e-4 * np.sin(turn)) * np.exp(-TIME / 6.0)
    np.testing.assert_allclose(found - plain(base, TIME), expected, 0.0, 1e-12)


def test_a_second_plane_beats() -> None:
    """The lock-in's amplitude swings by q about r at the detuning."""
    q, detuning = 2e-3, 1.0 / 30.0
    found = reading("plane-coupling", (q, 0.0, detuning), baseline(), TIME)
    for start in np.arange(0.0, 50.0, 5.0):
        window = lock_in(TIME, found, OMEGA, start, start + 4.0 * CYCLE)
        beat = math.cos(2.0 * math.pi * detuning * window.time_s)
        assert window.amplitude - 0.15 == pytest.approx(q * beat, abs=0.06 * q)


@pytest.mark.parametrize("pump", [2e-3, -2e-3])
def test_a_parametric_drive_at_twice_the_frequency_pumps(pump: float) -> None:
    """By x'' + w^2 (1 + h sin 2wt) x = 0 it grows as exp(h w t/4), or falls (Mathieu)."""
    twice = 2.0 * OMEGA / (2.0 * math.pi)
    found = reading("parametric-drive", (0.0, pump, twice), baseline(), TIME)
    for start in (0.0, 20.0, 45.0):
        window = lock_in(TIME, found, OMEGA, start, start + 8.0 * CYCLE)
        growth = math.log(window.amplitude / 0.15)
        assert growth == pytest.approx(0.25 * pump * OMEGA * window.time_s, rel=0.03)


def test_history_starts_from_rest() -> None:
    """The law x'' + h D^(1/2) x' + w^2 x = 0 from rest, by inversion of its Laplace transform."""
    mpmath = pytest.importorskip("mpmath")
    h, start = 0.05, 0.15

    def transform(s: object) -> object:
        root = s ** mpmath.mpf(0.5)  # type: ignore[operator]
        return start * (s + h * root) / (s**2 + h * s * root + OMEGA**2)  # type: ignore[operator]

    time = times(4.0, 0.25)[1:]
    model_time = times(6.0, 0.05)
    found = np.interp(time, model_time, reading("history-force", (h,), baseline(), model_time))
    exact = evaluated("history-force", (h,), baseline(), time).reading
    with mpmath.workdps(30):
        expected = [float(mpmath.invertlaplace(transform, t, method="talbot")) for t in time]
    effect = np.max(np.abs(np.array(expected) - plain(baseline(), time)))
    assert effect > 0.05 * start
    assert np.max(np.abs(exact - expected)) < 1e-4 * effect
    assert np.max(np.abs(found - expected)) < 0.1 * effect


@pytest.mark.parametrize(
    ("identifier", "values"),
    [
        ("history-force", (0.05,)),
        ("equilibrium-creep", (1e-3, 0.5, 0.0)),
        ("frequency-drift", (1e-4, 5.0)),
    ],
)
def test_what_begins_with_the_release_knows_when_that_was(
    identifier: str, values: tuple[float, ...]
) -> None:
    """The clock of a fit starts at a virtual turning point half a cycle before."""
    time = times(20.0, 0.03)
    effect = (by_identifier(identifier),)
    let_go = Model(time, 0.03, effect).evaluate(np.append(baseline(), values)).reading
    earlier = baseline(start=-0.15)
    earlier[TIME_S] = -math.pi / OMEGA
    for late in (-1e-3, 1e-3):
        first_s = late / OMEGA
        found = Model(time, 0.03, effect, first_s=first_s).evaluate(np.append(earlier, values))
        error = np.max(np.abs(found.reading - let_go))
        assert error < 0.06 * np.max(np.abs(let_go - plain(baseline(), time)))


@pytest.mark.parametrize("amplitude", [0.3, 2.0])
@pytest.mark.parametrize("share", [0.3, 0.7, 0.88])
def test_a_first_reading_in_mid_swing_came_after_the_turning_point_before_it(
    amplitude: float, share: float
) -> None:
    """Wide swings take longer than pi/omega, small ones do not: the drift is the same."""
    effects = (by_identifier("circular-error"), by_identifier("frequency-drift"))
    value = np.array([*baseline(start=amplitude), 1.0, 1e-3, 5.0])
    time = times(8.0, 0.03)
    motion = Model(time, 0.03, effects).evaluate(value).tangent.motion
    half_s = float(motion.time_s[0, -1] - motion.time_s[0, 0])
    first_s = float(motion.time_s[0, 0]) + share * half_s
    let_go = Model(time, 0.03, effects).evaluate(value).reading
    found = Model(time, 0.03, effects, first_s=first_s).evaluate(value).reading
    np.testing.assert_allclose(found, let_go, rtol=0.0, atol=1e-9)


def test_the_memory_of_the_release_fades_though_dry_friction_stops_the_pendulum() -> None:
    """Half the derivative, from the readings themselves: (1/sqrt pi) int a(s)/sqrt(t - s) ds."""
    base = baseline(c=2e-3, b=0.01)
    step = 2e-3
    time = times(35.0, step)
    motion = evaluated("history-force", (1e-9,), base, time)
    nodes = motion.tangent.motion
    found = by_identifier("history-force").acceleration(nodes, pendulum_of(base), np.ones(1))
    velocity = motion.sampled.velocity
    ago = np.sqrt(np.arange(len(time) + 1) * step)
    for row in (1, 12, 40):
        for node in (3, 8, 12):
            last = int(nodes.time_s[row, node] / step)
            gained = np.diff(velocity[: last + 1]) / step
            exact = 2.0 / math.sqrt(math.pi) * gained[::-1] @ np.diff(ago[: last + 1])
            size = math.sqrt(OMEGA) * OMEGA * float(nodes.amplitude[row, node])
            # The readings end up to a step before the node.
            assert abs(-found[row, node] - exact) < OMEGA * step * size


def test_broadband_drive_has_no_template() -> None:
    assert not by_identifier("broadband-drive").has_signature


@pytest.mark.parametrize("name", ["clock-drift", "frequency-drift"])
def test_a_drift_is_the_less_likely_the_larger_beyond_a_thousandth(name: str) -> None:
    """Twice the logarithm of a density that falls with the square of the change."""
    effect = by_identifier(name)
    span = evaluated(name, (0.0, STRAIGHT_S), baseline(b=0.01), TIME).span
    usual = np.array([1e-3 / span.duration_s, 1e7])
    assert effect.prior_penalty(0.9 * usual, span) == 0.0
    double = effect.prior_penalty(2.0 * usual, span) - effect.prior_penalty(usual, span)
    assert double == pytest.approx(2.0 * math.log(2.0), rel=1e-3)
    # One that has long relaxed has changed by rate tau, however long the record.
    relaxed = np.array([-1e-2, 1.0])
    assert effect.prior_penalty(relaxed, span) == pytest.approx(2.0 * math.log(10.0), rel=1e-3)


@pytest.mark.parametrize(
    ("identifier", "values"),
    [
        ("ac-coupling", (-4.0, 1e6)),
        ("equilibrium-creep", (10.0, 2.5e6, 0.0)),
        ("equilibrium-creep", (1e-3, 60.0, 1.0)),
    ],
)
def test_a_slow_creep_has_hardly_begun(identifier: str, values: tuple[float, ...]) -> None:
    """However far it would go in the end, what counts is how far it went within the record."""
    moved = reading(identifier, values, baseline(), TIME) - plain(baseline(), TIME)
    went = abs(float(np.mean(moved[-28:]) - np.mean(moved[:28])))
    displaced = by_identifier(identifier).displacement(np.array(values), float(TIME[-1]))
    assert displaced == pytest.approx(went, rel=0.05)


@pytest.mark.parametrize("samples", [1.0, -1.0, 3.0])
def test_samples_are_lost_whole(samples: float) -> None:
    """A tenth of one is lost where ten are read for each that is reported, as rarely as that."""
    effect = by_identifier("dropped-samples")
    span = evaluated("dropped-samples", (0.0, 30.0), baseline(b=0.01), TIME).span

    def cost(part: float) -> float:
        return effect.prior_penalty(np.array([part * samples * 0.04, 30.0]), span)

    assert cost(1.0) == 0.0
    assert cost(0.1 / abs(samples)) == pytest.approx(2.0 * math.log(10.0))
    # One of the ten readings of a mean is a whole one.
    span = span._replace(fold=10)
    assert cost(0.1) == pytest.approx(0.0, abs=1e-12)


def test_a_drive_that_keeps_in_step_is_a_loss() -> None:
    """It is as likely as any from a quarter of a turn over the record on."""
    drive, span = (
        by_identifier("parametric-drive"),
        Span(0.0, 60.0, 0.04, pendulum_of(baseline(b=0.02)), 0.4, 0.1),
    )
    slips = np.array([1e-4, 1e-2, 0.25, 1.0, 10.0]) / span.duration_s
    unlikely = [
        drive.prior_penalty(np.array([1e-3, 0.0, 2.0 / span.period_s + d]), span) for d in slips
    ]
    assert unlikely == sorted(unlikely, reverse=True)
    assert unlikely[0] == pytest.approx(2.0 * math.log(2500.0), rel=0.01)
    assert unlikely[2:] == pytest.approx([0.0] * 3, abs=1e-6)
