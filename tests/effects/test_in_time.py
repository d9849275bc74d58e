"""What happens in the course of a record; two modes; parts of the loss that are held."""

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import norm

from pendpipe.analysis.free_decay import measure_recording
from pendpipe.diagnosis.data import Data
from pendpipe.diagnosis.noise import white_noise
from pendpipe.diagnosis.refine import refine
from pendpipe.dynamics import Eq8, Release, sample
from pendpipe.dynamics.any_law import NoMotionError
from pendpipe.dynamics.eq8 import SHARE, TIME as TIME_S, B
from pendpipe.dynamics.eq8_model import HYSTERETIC, VISCOUS
from pendpipe.effects.catalogue import by_identifier
from pendpipe.effects.effect import STRAIGHT_S, Span
from pendpipe.effects.model import Model, pendulum_of
from pendpipe.effects.two_modes import two_modes
from pendpipe.recording import Recording

from ..recordings import white
from .lock_in import Lines, lock_in
from .pendulums import OMEGA, baseline, evaluated, plain, reading, times

# What changes slowly, suddenly, or periodically.

TIME = times(60.0, 0.04)
CYCLE = 2.0 * math.pi / OMEGA
Law = Callable[[float], float]


def crept(tau: float, exponential: float) -> Law:
    """The level follows s ln(1 + t/tau), or s (1 - e^(-t/tau))."""
    return lambda t: 1.0 - math.exp(-t / tau) if exponential else math.log1p(t / tau)


@pytest.mark.parametrize(
    ("identifier", "values", "b", "cycles", "seen", "law", "within"),
    [
        # The phase is w (t + eps t^2/2).
        (
            *("frequency-drift", (1e-4, STRAIGHT_S), 0.01, 8),
            *(lambda seen: seen.angular_frequency / OMEGA - 1.0, lambda t: 1e-4 * t),
            {"rel": 0.02, "abs": 1.12e-6},
        ),
        *(
            (
                *("equilibrium-creep", (2e-3, 10.0, kind), 0.01, 4),
                *(lambda seen: seen.level / 2e-3, crept(10.0, kind), {"rel": 0.01}),
            )
            for kind in (0.0, 1.0)
        ),
        # The lock-in's amplitude swings by q about r at the detuning.
        (
            *("plane-coupling", (2e-3, 0.0, 1.0 / 30.0), 0.0, 4),
            *(lambda seen: seen.amplitude - 0.15, lambda t: 2e-3 * math.cos(math.tau * t / 30.0)),
            {"abs": 0.06 * 2e-3},
        ),
        # By x'' + w^2 (1 + h sin 2wt) x = 0 it grows as exp(h w t/4), or falls (Mathieu).
        *(
            (
                *("parametric-drive", (0.0, pump, OMEGA / math.pi), 0.0, 8),
                lambda seen: math.log(seen.amplitude / 0.15),
                *(lambda t, pump=pump: 0.25 * pump * OMEGA * t, {"rel": 0.03}),
            )
            for pump in (2e-3, -2e-3)
        ),
    ],
)
def test_what_changes_slowly_is_seen_window_by_window(
    identifier: str,
    values: tuple[float, ...],
    b: float,
    cycles: int,
    seen: Callable[[Lines], float],
    law: Law,
    within: dict[str, float],
) -> None:
    found = reading(identifier, values, baseline(b=b), TIME)
    for start in np.arange(5.0, 50.0, 5.0):
        window = lock_in(TIME, found, OMEGA, start, start + cycles * CYCLE)
        assert seen(window) == pytest.approx(law(window.time_s), **within)


def test_a_motion_that_starts_after_the_first_readings_has_none_for_them() -> None:
    """It goes on for half a cycle before its first turning point, and no further."""
    model, value = Model(TIME, 0.04), baseline(b=0.01)
    value[TIME_S] = 0.2 * CYCLE
    assert np.all(np.diff(model.evaluate(value).sampled.phase) > 0.0)
    value[TIME_S] = 2.5 * CYCLE
    with pytest.raises(NoMotionError, match="the start is out of reach"):
        model.evaluate(value)


def test_a_frequency_jumps() -> None:
    found = reading("frequency-step", (3e-4, 30.0), baseline(b=0.01), TIME)
    before = lock_in(TIME, found, OMEGA, 28.0 - 8.0 * CYCLE, 28.0)
    after = lock_in(TIME, found, OMEGA, 32.0, 32.0 + 8.0 * CYCLE)
    change = after.angular_frequency / before.angular_frequency - 1.0
    assert change == pytest.approx(3e-4, rel=0.01)


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


@pytest.mark.parametrize("error", [0.01, 0.1])
def test_a_knock_is_seldom_just_where_it_leaves_the_amplitude_alone(error: float) -> None:
    """At a turning point, within its error; of a quarter turn's instants each is as likely."""
    knock = by_identifier("impulse")
    span = evaluated("impulse", (0.0, 30.0), baseline(), TIME).span
    span = span._replace(instant_sd_s=error * 0.25 * CYCLE)
    costs = [
        knock.prior_penalty(np.array([1e-3, (20.0 + part) * 0.25 * CYCLE]), span)
        for part in (0.0, error, 5.0 * error)
    ]
    least = 2.0 * math.log(2.0 * norm.pdf(0.0, scale=error))
    np.testing.assert_allclose(costs, [least, least - 1.0, 0.0], atol=1e-3)


@pytest.mark.parametrize("samples", [1.0, -1.0, 3.0])
def test_samples_are_lost_whole(samples: float) -> None:
    """A tenth of one is lost where ten are read for each that is reported, as rarely as that."""
    effect = by_identifier("dropped-samples")
    time_s = times(60.0, 0.01)
    span = evaluated("dropped-samples", (0.0, 30.0), baseline(b=0.01), time_s).span

    def cost(part: float) -> float:
        return effect.prior_penalty(np.array([part * samples * 0.01, 30.0]), span)

    # A computer's clock ticks 64 times a second: between slow readings it jumps by less than one.
    slow = span._replace(interval_s=0.361)
    assert effect.prior_penalty(np.array([samples / 64.0, 30.0]), slow) == 0.0

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


# Two damped modes are told apart by their readings.

MODES_TIME = np.arange(0.0, 80.0, 0.01)
TRUTH = ((0.80, 0.02, 0.5), (0.86, 0.03, 0.3))


def motion(time: np.ndarray) -> np.ndarray:
    return sum(
        size * np.exp(-loss * time) * np.cos(2.0 * np.pi * hertz * time)
        for hertz, loss, size in TRUTH
    )


def test_frequencies_losses_and_amplitudes_are_within_their_errors() -> None:
    pulls = []
    keep = (MODES_TIME < 30.0) | (MODES_TIME > 33.0)
    for seed in range(20):
        modes = two_modes(
            MODES_TIME[keep],
            (0.1 + motion(MODES_TIME) + white(seed, len(MODES_TIME), 0.02))[keep],
            0.61,
        )
        assert modes is not None
        for mode, truth in zip(modes, TRUTH, strict=True):
            found = (mode.frequency, mode.loss, mode.amplitude)
            pulls += [
                (each.value - true) / each.sd for each, true in zip(found, truth, strict=True)
            ]
            assert not mode.driven
    assert np.std(pulls) == pytest.approx(1.0, abs=0.25)


def test_one_pendulum_is_not_two_modes() -> None:
    # sin x slows it at first; Coulomb friction bends its envelope: no two modes explain that.
    values = sample(Eq8(5.0, 0.05, 0.0, 0.0, 0.02, "sine"), Release(-0.1, 2.5), MODES_TIME)
    assert two_modes(MODES_TIME, values, 0.65) is None
    noise = np.random.default_rng(1).standard_normal(len(MODES_TIME))
    assert two_modes(MODES_TIME, noise, 0.6) is None


def test_a_mode_without_loss_is_driven() -> None:
    free = 0.3 * np.exp(-0.05 * MODES_TIME) * np.cos(5.0 * MODES_TIME)
    modes = two_modes(
        MODES_TIME, free + 0.2 * np.cos(5.3 * MODES_TIME) + white(2, len(MODES_TIME), 1e-3), 0.62
    )
    assert modes is not None
    assert [mode.driven for mode in modes] == [False, True]


def test_a_knock_is_not_two_modes_where_one_decay_may_do() -> None:
    # Half of the amplitude is regained at once: one mode explains most of it, and so do two.
    one = 0.3 * np.exp(-0.05 * MODES_TIME) * np.cos(5.0 * MODES_TIME)
    later = np.maximum(MODES_TIME - 30.0, 0.0)
    knocked = one + 0.05 * (MODES_TIME > 30.0) * np.exp(-0.05 * later) * np.sin(5.0 * later)
    noise = 1e-3 * np.random.default_rng(2).standard_normal(len(MODES_TIME))
    assert two_modes(MODES_TIME, knocked + noise, 0.62, may_be_one=True) is None
    beat = motion(MODES_TIME) + noise
    assert two_modes(MODES_TIME, beat, 0.61, may_be_one=True) is not None


@pytest.mark.parametrize("phase", [0.0, 2.8, np.pi])
def test_a_beat_may_begin_at_its_node_or_at_its_top(phase: float) -> None:
    time = np.arange(700) * 0.0507
    first = 0.1 * np.exp(-0.018 * time) * np.cos(2.0 * np.pi * 0.7075 * time)
    second = 0.09 * np.exp(-0.018 * time) * np.cos(2.0 * np.pi * 0.7345 * time + phase)
    points, _ = measure_recording(
        Recording(time, first + second + white(3, len(time), 8e-4), "angle_rad"), "the test"
    )
    assert any(note.startswith("two modes beat: 0.707") for note in points.notes)


# b = b_h + b_v with a part held: what is left of b, and what it does to the readings.

HELD_TIME_S = np.arange(600) / 15.0
VALUE = np.array([7.2e-3, 9.6e-3, 1.3e-4, 0.4, 2.0 * np.pi * 0.9, 0.15, -0.3, 0.01])
RATE = {HYSTERETIC: 0.4 * 9.6e-3, VISCOUS: 0.6 * 9.6e-3}


@pytest.mark.parametrize("exponential", [0.0, 1.0])
@pytest.mark.parametrize("amplitude", [0.2, 1.0, 2.0])
def test_a_support_that_tilts_slowly_is_an_offset_that_drifts(
    amplitude: float, exponential: float
) -> None:
    """Gravity turns with it, whatever the swing: but for what the start of the creep excites."""
    size, tau = 0.02, 30.0
    swing = Model(TIME, float(TIME[1]), order=32, restoring="sine")
    creeping = replace(swing, effects=(by_identifier("equilibrium-creep"),))
    base = baseline(b=0.01, start=amplitude)
    found = creeping.reading(np.append(base, (size, tau, exponential)))
    level = size * np.vectorize(crept(tau, exponential))(TIME)
    rate = size / tau / OMEGA
    assert np.max(np.abs(found - level - swing.reading(base))) < 5.0 * rate


def model_with(*parts: str) -> Model:
    return Model(HELD_TIME_S, 1.0 / 15.0, parts={part: RATE[part] for part in parts})


@pytest.mark.parametrize("parts", [[HYSTERETIC], [VISCOUS], [HYSTERETIC, VISCOUS]])
@pytest.mark.parametrize("factor", [1.0, 1.5, 4.0])
def test_a_held_part_stays_whatever_the_whole_is_and_two_make_the_whole(
    parts: list[str], factor: float
) -> None:
    value = VALUE.copy()
    value[B] *= factor
    pendulum = pendulum_of(model_with(*parts).settled(value))
    for part in parts:
        assert getattr(pendulum, part) == pytest.approx(RATE[part], rel=1e-12)
    whole = value[B] if len(parts) == 1 else sum(RATE.values())
    assert pendulum.linear == pytest.approx(whole, rel=1e-12)


@pytest.mark.parametrize("part", [HYSTERETIC, VISCOUS])
def test_b_acts_on_the_readings_as_its_other_part_does(part: str) -> None:
    """The fit's derivative by b is that of readings with the held part kept."""
    model, rms = model_with(part), 1e-4
    data = Data(HELD_TIME_S, model.reading(VALUE), 1.0 / 15.0, True, np.ones(len(HELD_TIME_S)))
    fit = refine(model, data, white_noise(data, rms), VALUE, rounds=0)
    assert SHARE not in fit.free
    step = 1e-6
    low, high = VALUE.copy(), VALUE.copy()
    low[B] -= step
    high[B] += step
    change = model.reading(model.settled(high)) - model.reading(model.settled(low))
    slope = change / (2.0 * step)
    by_other = slope - rms * fit.jacobian[:-1, B]
    assert np.linalg.norm(by_other) < 1e-4 * np.linalg.norm(slope)
    # The share's part of it is small, but seen.
    alone = (
        rms * refine(model_with(), data, white_noise(data, rms), VALUE, rounds=0).jacobian[:-1, B]
    )
    assert np.linalg.norm(slope - alone) > 3.0 * np.linalg.norm(by_other)
