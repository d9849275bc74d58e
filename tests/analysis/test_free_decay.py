"""The free decay is found in whatever was recorded, and measured over its gaps."""

import contextlib
from collections.abc import Iterable
from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from numpy.typing import NDArray

import pendpipe
from pendpipe.analysis.free_decay import (
    FreeDecay,
    _falls,
    _stop,
    best_runs,
    find_free_decay,
    stretches,
)
from pendpipe.analysis.half_cycles import HalfCycles, running_median
from pendpipe.api import fit
from pendpipe.errors import NotAnalysableError
from pendpipe.recording import Recording

from ..recordings import white
from ..refusals import refused

# A free decay is found where the pendulum swings by itself, and nowhere else.

Floats = NDArray[np.float64]
RATE = 100.0
PERIOD = 1.25
OMEGA = 2 * np.pi / PERIOD


def oscillation(amplitude: float, decrement: float, coulomb: float, most: float) -> Floats:
    """Swing from rest at `amplitude`, half cycle by half cycle about the friction's centre.

    Each half cycle loses the share `decrement` and the constant 2 `coulomb`; it stops where
    the friction holds it.
    """
    half = int(RATE * PERIOD / 2)
    phase = np.pi * np.arange(half) / half
    out: list[Floats] = []
    turn = amplitude
    while abs(turn) > coulomb and len(out) * half < most * RATE:
        after = -np.sign(turn) * max(abs(turn) * (1 - decrement) - 2 * coulomb, 0.0)
        out.append(0.5 * (turn + after) + 0.5 * (turn - after) * np.cos(phase))
        turn = after
    return np.concatenate(out)[: int(most * RATE)]


def ramp(low: float, high: float, seconds: float) -> Floats:
    """Move smoothly by hand."""
    phase = np.linspace(0, np.pi, int(seconds * RATE))
    return low + (high - low) * 0.5 * (1 - np.cos(phase))


def still(level: float, seconds: float) -> Floats:
    return np.full(int(seconds * RATE), level)


def recording(parts: Iterable[Floats], *, noise: float = 0.0, step: float = 0.0) -> Recording:
    values = np.concatenate(list(parts))
    values = values + noise * np.random.default_rng(7).standard_normal(len(values))
    if step:
        values = np.rint(values / step) * step
    return Recording(
        time_s=np.arange(len(values)) / RATE,
        values=values,
        quantity="angle_rad",
        resolution=step or None,
    )


def reasons(found: FreeDecay) -> list[str]:
    return [cut.reason for cut in found.cuts]


@pytest.mark.parametrize(("noise", "step"), [(0.0, 0.0), (2e-3, 0.0), (0.0, 0.01), (1e-3, 2e-3)])
@pytest.mark.parametrize("amplitude", [0.4, 2.6])
def test_rest_pull_hold_and_stop_are_cut(amplitude: float, noise: float, step: float) -> None:
    swing = oscillation(amplitude, 0.03, 5e-3, 60.0)
    before = [still(0.0, 6.0), ramp(0.0, amplitude, 1.7), still(amplitude, 2.0)]
    rest = still(float(swing[-1]), 8.0)
    found = find_free_decay(recording([*before, swing, rest], noise=noise, step=step))
    released = sum(map(len, before)) / RATE
    assert released - 0.1 <= found.start_s <= released + 0.5 * PERIOD
    stopped = released + len(swing) / RATE
    # The last turning points hide in noise and step.
    hidden = np.searchsorted(-np.abs(oscillation(amplitude, 0.03, 5e-3, 60.0)[::62]), -3e-2)
    assert found.stop_s <= stopped + PERIOD
    assert found.stop_s >= released + 0.62 * float(hidden) - PERIOD
    assert reasons(found)[:2] == ["rest before release", "held or moved by hand before release"]
    assert reasons(found)[-1] == "at rest after the decay"
    assert found.half_period_s == pytest.approx(PERIOD / 2, rel=0.02)


@pytest.mark.parametrize(
    "what", ["seen by an encoder, one row per count", "with a hole", "at 7 Hz"]
)
def test_uneven_and_sparse_samples_change_nothing(what: str) -> None:
    swing = oscillation(0.5, 0.02, 2e-3, 80.0)
    parts = [still(0.0, 5.0), ramp(0.0, 0.5, 1.5), swing, still(float(swing[-1]), 5.0)]
    even = recording(parts, step=0.004)
    keep = np.ones(len(even), dtype=bool)
    if what == "seen by an encoder, one row per count":
        keep[1:] = np.diff(even.values) != 0
    elif what == "with a hole":
        keep[1500:1540] = False
    else:
        keep[:] = np.arange(len(even)) % 14 == 0
    part = Recording(even.time_s[keep], even.values[keep], "angle_rad", resolution=0.004)
    whole, found = find_free_decay(even), find_free_decay(part)
    assert found.start_s == pytest.approx(whole.start_s, abs=0.25 * PERIOD)
    assert found.stop_s == pytest.approx(whole.stop_s, abs=1.5 * PERIOD)


@given(
    before=st.floats(0.0, 40.0),
    after=st.floats(0.0, 40.0),
    amplitude=st.floats(0.1, 2.0),
    decrement=st.floats(0.0, 0.1),
)
@settings(max_examples=40, deadline=None)
def test_more_rest_before_or_after_moves_nothing(
    before: float, after: float, amplitude: float, decrement: float
) -> None:
    swing = oscillation(amplitude, decrement, 0.01 * amplitude, 60.0)
    core = [still(0.0, 3.0), ramp(0.0, amplitude, 1.5), swing, still(float(swing[-1]), 3.0)]
    step = amplitude / 200
    short = recording(core, step=step)
    long = recording([still(0.0, before), *core, still(float(swing[-1]), after)], step=step)
    shift = int(before * RATE) / RATE
    first, second = find_free_decay(short), find_free_decay(long)
    assert second.start_s - shift == pytest.approx(first.start_s, abs=0.05 * PERIOD)
    assert second.stop_s - shift == pytest.approx(first.stop_s, abs=0.1 * PERIOD)


def test_of_two_decays_the_more_telling_is_taken_and_the_other_told() -> None:
    small, large = oscillation(0.2, 0.05, 2e-3, 30.0), oscillation(0.8, 0.03, 2e-3, 60.0)
    parts = [small, still(float(small[-1]), 3.0), ramp(float(small[-1]), 0.8, 1.3), large]
    found = find_free_decay(recording(parts, step=1e-3))
    begin = (len(small) + 430) / RATE
    assert begin - 0.1 <= found.start_s <= begin + 0.5 * PERIOD
    assert any("another decay" in note and "is not used" in note for note in found.notes)


def test_a_driven_front_is_cut() -> None:
    time = np.arange(int(30 * RATE)) / RATE
    driven = 0.4 * np.cos(OMEGA * time)
    free = oscillation(0.4, 0.04, 1e-3, 60.0)
    found = find_free_decay(recording([driven, free], noise=1e-3))
    assert found.start_s == pytest.approx(30.0, abs=2.5 * PERIOD)
    assert "driven: the amplitude is held up" in reasons(found)


def test_the_scatter_of_the_last_half_cycles_is_no_drive() -> None:
    """250 cycles of high Q, 12.05 readings in each, so that the largest come and go: all stay."""
    time = np.arange(3000) / 7.4
    amplitude = 0.064 * np.exp(-8e-4 * time) / (1.0 + 0.05 * (1.0 - np.exp(-8e-4 * time)))
    for seed in range(40):
        values = amplitude * np.cos(3.857 * time + 0.157 * seed) + white(seed, len(time), 4e-4)
        found = find_free_decay(Recording(time, values, "angle_rad"))
        assert found.start_s < 3.3
        assert "driven: the amplitude is held up" not in reasons(found)


@pytest.mark.parametrize("kick", [1.15, 0.7])
def test_a_small_knock_and_a_wild_reading_stay(kick: float) -> None:
    swing = oscillation(0.5, 0.02, 1e-3, 60.0)
    swing[2000:] *= kick
    swing[1234] = 3.0
    swing[3100:3103] = -2.0
    found = find_free_decay(recording([swing], noise=1e-3))
    assert found.start_s == 0.0
    assert found.stop_s > len(swing) / RATE - PERIOD


@pytest.mark.parametrize(("hum_hz", "lost_s"), [(50.0, 0.0), (50.0, 0.4), (50.0, 6.0), (60.0, 6.0)])
def test_mains_hum_hides_no_decay(hum_hz: float, lost_s: float) -> None:
    """A photodiode in room light, read a thousand times a second; a while of it may be lost."""
    every = np.arange(0.0, 40.0, 1e-3)
    time_s = every[2.0 * np.abs(every - 20.0) >= lost_s]
    swing = np.exp(-0.02 * time_s) * np.cos(2.0 * np.pi * 1.37 * time_s)
    hum = 0.2 * np.sin(2.0 * np.pi * hum_hz * time_s)
    fitted = pendpipe.fit(Recording(time_s, swing + hum + white(3, len(time_s), 0.005), "volts"))
    assert not fitted.cuts
    # The hum spoils each half cycle; what the gap leaves of two says nothing of the others.
    assert fitted["frequency"].value == pytest.approx(1.37, rel=1e-4)
    assert fitted["frequency"].sd < 3e-5
    low, high = fitted["b"].bounds95
    assert low < 0.02 < high < 0.022


def holed(swing: Floats, first: float, last: float) -> Recording:
    whole = recording([swing], noise=1e-3)
    keep = (whole.time_s < first) | (whole.time_s > last)
    return Recording(whole.time_s[keep], whole.values[keep], "angle_rad")


@pytest.mark.parametrize("last", [20.9, 23.4, 33.0])
def test_a_decay_goes_on_behind_a_gap_whose_half_cycles_can_be_counted(last: float) -> None:
    found = find_free_decay(holed(oscillation(0.5, 0.02, 1e-3, 60.0), 20.0, last))
    assert found.start_s == 0.0
    assert found.stop_s > 50.0
    assert not [note for note in found.notes if "not used" in note]


def test_a_gap_in_which_something_else_happened_parts_the_record() -> None:
    swing = oscillation(0.5, 0.02, 1e-3, 60.0)
    # Half a half cycle is lost, as where the clock stops with the recorder; or it is released anew.
    late = np.concatenate([swing[:2400], swing[2431:]])
    anew = np.concatenate([swing[:2400], 2.0 * swing[2400:]])
    for values in (late, anew):
        found = find_free_decay(holed(values, 20.0, 33.0))
        assert found.stop_s <= 20.0 or found.start_s >= 33.0
        assert any("is not used" in note for note in found.notes)


def test_a_clamp_ends_the_decay_at_once() -> None:
    swing = oscillation(0.5, 0.02, 1e-3, 20.3)
    parts = [swing, ramp(float(swing[-1]), 0.9, 0.8), still(0.9, 10.0)]
    found = find_free_decay(recording(parts, noise=1e-3))
    assert found.start_s == 0.0
    assert found.stop_s == pytest.approx(20.3, abs=0.6 * PERIOD)


LONG = np.arange(6000) / RATE


def cosine(size: Floats | float, phase: float = 0.0) -> Floats:
    return size * np.cos(OMEGA * LONG + phase)


def wavering(beats: float) -> Floats:
    """Higher in one third than in another, however still each half cycle is."""
    return cosine(0.1 + 0.002 * np.cos(2.0 * np.pi * beats * LONG / LONG[-1] + 0.4))


@pytest.mark.parametrize(
    "values",
    [
        *(cosine(0.3 * np.exp(-0.03 * LONG), phase) for phase in (0.0, 0.7, 2.0, 4.0)),
        # Two modes that exchange energy: the amplitude is flat at first, and rises again.
        cosine(0.3 * (1 + 0.1 * np.cos(2 * np.pi * LONG / 20.0)) * np.exp(-0.02 * LONG)),
    ],
)
def test_a_recording_of_nothing_else_is_kept_whole(values: Floats) -> None:
    found = find_free_decay(recording([values]))
    assert (found.start_s, found.stop_s, found.cuts) == (LONG[0], LONG[-1], [])


@pytest.mark.parametrize(
    ("parts", "noise", "said"),
    [
        ([still(0.3, 20.0)], 0.0, "the reading never changes"),
        ([still(0.3, 20.0)], 1e-3, "no"),
        ([ramp(0.0, 1.0, 3.0), still(1.0, 5.0), ramp(1.0, -0.4, 4.0)], 1e-3, "does not swing"),
        ([ramp(0, 1, 1.0), ramp(1, 0.9, 3.0), ramp(0.9, 1.4, 0.4), ramp(1.4, 0, 2.0)], 1e-3, "no"),
        ([oscillation(0.5, 0.5, 0.02, 2.0)[:110], still(0.0, 9.0)], 1e-3, "no"),
        ([0.0 * LONG], 0.02, "its noise and step hide"),
        ([cosine(0.4)], 1e-3, "the amplitude does not fall"),
        *(([wavering(beats)], 0.0, "the amplitude does not fall") for beats in (1.5, 3.2, 5.7)),
        ([cosine(0.01 * np.exp(0.05 * LONG))], 0.0, "no"),
        # One that can't be seen is slow, and not driven.
        ([cosine(0.1 * np.exp(-1e-3 * LONG / LONG[-1]))[:3000]], 0.01, "too slow to be resolved"),
    ],
)
def test_what_is_no_decay_is_refused_in_one_line(
    parts: list[Floats], noise: float, said: str
) -> None:
    with refused(said):
        find_free_decay(recording(parts, noise=noise))


@pytest.mark.parametrize("wild", [False, True])
def test_dense_readings_change_nothing(wild: bool) -> None:
    """Half cycles of two thousand readings are those of sixty; a wild reading is none of them."""

    def decay(rate: float) -> FreeDecay:
        time = np.arange(int(30.0 * rate)) / rate - 2.0
        values = 0.3 * np.exp(-0.03 * time) * np.cos(OMEGA * time) + white(5, len(time), 1e-3)
        values[len(time) // 3] += 50.0 * wild
        return find_free_decay(Recording(time, values, "angle_rad"))

    sparse, dense = decay(100.0), decay(3200.0)
    assert dense.half_cycles == sparse.half_cycles > 45
    assert dense.half_period_s == pytest.approx(0.5 * PERIOD, rel=1e-3)
    assert (dense.start_s, dense.stop_s) == pytest.approx((sparse.start_s, sparse.stop_s), abs=0.02)


def test_a_wiggle_within_a_swing_makes_no_half_cycles() -> None:
    """It is small beside the swings before and after it, as no half cycle of a decay is."""
    time = np.arange(3000) / RATE
    values = 0.3 * np.exp(-0.03 * time) * np.cos(OMEGA * time)
    wiggle = 0.06 * np.exp(-(((time - 8.25 * PERIOD) / 0.03) ** 2))
    smooth, other = (
        find_free_decay(Recording(time, motion, "angle_rad"))
        for motion in (values, values + wiggle)
    )
    assert other.half_cycles == smooth.half_cycles
    assert other.notes == []


@given(st.lists(st.floats(0.1, 10.0), min_size=3, max_size=12))
def test_the_usual_half_period_is_the_median_of_five_neighbours(values: list[float]) -> None:
    expected = [np.median(values[max(0, i - 2) : i + 3]) for i in range(len(values))]
    np.testing.assert_array_equal(running_median(np.array(values), 2), expected)


def test_of_random_walks_few_pass_for_a_decay() -> None:
    """Three half cycles that follow one another by chance are not told from a decay."""
    taken = 0
    for seed in range(40):
        walk = np.cumsum(np.random.default_rng(seed).standard_normal(3000)) * 1e-2
        with contextlib.suppress(NotAnalysableError):
            taken += find_free_decay(recording([walk])).half_cycles >= 3
    assert taken <= 40 * 0.2


def test_metres_are_as_good_as_radians() -> None:
    swing = oscillation(0.07, 0.02, 1e-4, 60.0) + 0.417
    moved = Recording(np.arange(len(swing)) / RATE, swing, "displacement_m")
    found = find_free_decay(moved)
    assert found.start_s == 0.0
    assert len(found.of(moved)) >= 0.9 * len(moved)


@pytest.mark.parametrize(
    ("frequency_hz", "phase"), [(0.6305, -2.0), (0.722, -1.0), (0.8257, 1.0), (0.8379, 2.0)]
)
@pytest.mark.parametrize("wild", [False, True])
def test_few_samples_a_cycle_hold_no_amplitude_up(
    frequency_hz: float, phase: float, wild: bool
) -> None:
    """With 12 to 16 samples a cycle the turning points lie between samples, now more, now less.

    That beats slowly, and must not pass for a driven beginning; a wild reading is none either.
    """
    time = 0.1 * np.arange(3000)
    angle = 0.06 * np.exp(-0.0055 * time) * np.cos(2.0 * np.pi * frequency_hz * time + phase)
    angle += 2e-5 * np.random.default_rng(3).standard_normal(len(time))
    if wild:
        angle[[40, 2500]] += 0.1
    found = find_free_decay(Recording(time, angle, "angle_rad"))
    assert found.start_s == 0.0
    assert found.stop_s == time[-1]
    assert not found.cuts


@pytest.mark.parametrize("stiffer", [1.8, 4.0])
def test_sides_that_differ_make_half_periods_alternate_and_stay(stiffer: float) -> None:
    """A pendulum against a cushion: it is quicker on one side, by the root of its stiffness."""
    time = np.arange(6000) / RATE
    short = PERIOD / (1.0 + np.sqrt(stiffer))
    long = PERIOD - short
    cycle = time % PERIOD
    above = cycle < long
    phase = np.where(above, np.pi * cycle / long, np.pi * (cycle - long) / short)
    values = np.where(above, np.sin(phase), -np.sin(phase) / np.sqrt(stiffer))
    values = 0.3 * np.exp(-0.03 * time) * values
    found = find_free_decay(recording([values], noise=1e-4))
    assert found.start_s < PERIOD
    assert found.half_cycles > 80


def test_a_pendulum_that_goes_over_the_top_is_cut_there_and_so_it_is_said() -> None:
    free = oscillation(2.5, 0.05, 5e-3, 40.0)
    turning = np.linspace(-7.5 * np.pi, 0.0, 400)
    hanging = np.linspace(0.0, 2.5, 40)
    found = find_free_decay(recording([turning, hanging, free], noise=1e-3))
    assert 4.0 <= found.start_s <= 4.4 + PERIOD
    assert reasons(found)[0] == "it went over the top before it settled"
    # A wheel that is wound up as far swings back as far: nothing was over the top.
    wheel = [ramp(0.0, 9.0, 3.0), oscillation(9.0, 0.05, 5e-3, 40.0)]
    assert reasons(find_free_decay(recording(wheel, noise=1e-3)))[0] == (
        "held or moved by hand before release"
    )


@pytest.mark.parametrize(
    ("count", "rate", "over_noise", "wander", "seen"),
    [
        # 8 % at Q = 1650.
        (12000, 0.08 / 119.99, 7.8, 0.0, 180),
        # As those of a cheap accelerometer, each of which hardly stands out.
        (2000, 0.03, 4.5, 0.0, 25),
        (2000, 0.03, 4.5, 0.3, 25),
    ],
)
def test_a_decay_in_loud_noise_is_seen_by_all_its_readings(
    count: int, rate: float, over_noise: float, wander: float, seen: int
) -> None:
    time = np.arange(count) / RATE
    values = 0.1 * np.exp(-rate * time) * np.cos(OMEGA * time) + wander * time / time[-1]
    found = find_free_decay(recording([values], noise=0.1 / over_noise))
    assert found.half_cycles > seen


def beat(losses: tuple[float, float], *, rest: bool) -> Recording:
    time = np.arange(8000) / RATE
    one, other = (
        np.exp(-loss * time) * np.cos(omega * time)
        for loss, omega in zip(losses, (OMEGA, 1.08 * OMEGA), strict=True)
    )
    return recording([0.3 * (one - other if rest else one + other)], noise=1e-3)


@pytest.mark.parametrize("rest", [False, True])
def test_two_modes_that_beat_are_a_decay_with_two_frequencies_and_losses(rest: bool) -> None:
    found = find_free_decay(beat((0.02, 0.03), rest=rest))
    assert found.half_cycles > 100
    note = next(note for note in found.notes if note.startswith("two modes beat"))
    assert "0.8000" in note or "0.79999" in note
    assert "0.8640" in note or "0.86399" in note


@pytest.mark.slow
@pytest.mark.parametrize("phase", [1.2, 3.0])
def test_a_beat_that_first_grows_is_not_held_up_by_a_drive(phase: float) -> None:
    """Of modes of 107 and 64, read to 1: the amplitude grows for 7 s, falls, and wavers."""
    time = np.arange(2050) * 0.0507
    early = np.cos(2.0 * np.pi * 0.70823 * time)
    late = np.cos(2.0 * np.pi * 0.7351 * time - phase)
    values = np.exp(-0.0235 * time) * (107.0 * early + 64.0 * late)
    read = np.round(500.0 + values + white(1, len(time), 0.3))
    motion = Recording(time, read, "reading", metadata={"unit": "1"}, resolution=1.0)
    fit = pendpipe.fit(motion)
    assert fit.light_reason.startswith("two modes beat: 0.7082")
    assert "0.7351" in fit.light_reason
    assert "(Q = 94." in fit.light_reason
    assert "(Q = 98." in fit.light_reason
    # Nothing is cut, and no third period is given beside those two.
    assert fit.cuts == ()
    assert not ({"period", "Q"} & set(fit.quotable))
    assert " s\n" not in str(fit).partition("Copy")[0].partition("\n")[2]


def test_of_a_piece_of_two_swings_nothing_is_said() -> None:
    """Moved by hand for 40 s, let go, and caught: the numbers of what is left say nothing."""
    hand = 0.2 * np.cumsum(np.random.default_rng(2).standard_normal(60))
    moved = np.interp(np.arange(4000) / RATE, np.linspace(0.0, 40.0, 60), hand)
    swings = oscillation(0.3, 0.05, 0.0, most=4.0)
    caught = swings[-1] + np.cumsum(np.random.default_rng(3).standard_normal(30))
    moved_again = np.interp(np.arange(2000) / RATE, np.linspace(0.0, 20.0, 30), caught)
    motion = recording([moved - moved[-1] + swings[0], swings, moved_again], noise=1e-3)
    fit = pendpipe.fit(motion)
    assert fit.light != "green"
    assert "most of it was cut" in fit.light_reason
    assert "Copy: nothing of this fit can be quoted" in str(fit)
    with pytest.raises(
        NotAnalysableError, match=r"most of it was cut: .* of which nothing is said"
    ):
        pendpipe.diagnose(motion)


@pytest.mark.parametrize("seed", range(8))
def test_a_decay_that_is_caught_is_cut_before_the_catch(seed: int) -> None:
    """It then hangs still for eight cycles, and its period is known as well as without them."""
    draw = np.random.default_rng(100 + seed)
    time = np.arange(6000) / RATE
    caught_s = draw.uniform(30.0, 45.0)
    free = 0.4 * np.exp(-0.02 * time) * np.cos(OMEGA * time)
    since = np.maximum(time - caught_s, 0.0)
    held = np.interp(caught_s, time, free) * np.exp(-since / draw.uniform(0.01, 0.2))
    noise = 4e-4 * draw.standard_normal(len(time))
    swung = time <= caught_s
    alone, fit = (
        pendpipe.fit(Recording(time[keep], (values + noise)[keep], "angle_rad"), restoring="linear")
        for values, keep in (
            (free, swung),
            (np.where(swung, free, held), time < caught_s + 8.0 * PERIOD),
        )
    )
    assert fit["period"].sd < 1.5 * alone["period"].sd
    assert abs(fit["period"].value - alone["period"].value) < 4.0 * fit["period"].sd
    assert fit.cuts[0]["start_s"] < caught_s + 0.02 * PERIOD


def test_a_mode_that_does_not_decay_is_a_drive() -> None:
    with pytest.raises(NotAnalysableError, match="a drive holds the amplitude up"):
        find_free_decay(beat((0.03, 0.0), rest=True))


@pytest.mark.parametrize("detuning", [0.98, 1.03])
def test_a_pohl_wheel_whose_drive_is_switched_off_has_one_mode_and_no_beat(
    detuning: float,
) -> None:
    """Two modes with losses of their own imitate it, but for a tenth of its amplitude."""
    time = np.arange(8000) / RATE
    drive = np.where(time < 20.0, np.sin(detuning * OMEGA * time), 0.0)
    response = np.exp(-0.03 * time) * np.sin(OMEGA * time) / (RATE * OMEGA)
    found = find_free_decay(recording([np.convolve(drive, response)[: len(time)]], noise=5e-3))
    assert 19.0 < found.start_s < 22.5
    assert found.stop_s == time[-1]
    assert not found.notes


@pytest.mark.parametrize("quality", [2.0, 3.0, 4.0, 10.0])
def test_a_strongly_damped_decay_is_found(quality: float) -> None:
    time = np.arange(800) / RATE
    values = np.exp(-OMEGA / (2.0 * quality) * time) * np.cos(OMEGA * time)
    found = find_free_decay(recording([values], noise=1e-4))
    assert found.start_s == 0.0
    assert found.half_cycles >= min(3.0 * quality, 11.0) - 1.0


@pytest.mark.parametrize("amplitude", [0.8, 1.0])
def test_a_decay_that_dry_friction_ends_after_four_half_cycles_is_found(amplitude: float) -> None:
    swings = oscillation(amplitude, 0.0, 0.1, most=60.0)
    decay = find_free_decay(
        recording([still(amplitude, 2.0), swings, still(swings[-1], 3.0)], step=0.0015)
    )
    assert decay.half_cycles >= 3
    assert decay.half_period_s == pytest.approx(PERIOD / 2, rel=0.01)


def test_a_decay_on_a_zero_that_relaxes_by_more_than_the_swing_is_found() -> None:
    """Four and a half cycles, whose zero falls by 1.2 while they swing by 1."""
    time = np.arange(700) * 0.002
    zero = 1.6 + 0.9 * np.exp(-time / 0.8)
    swing = 0.55 * np.exp(-time / 1.2) * np.cos(2.0 * np.pi * time / 0.31)
    found = find_free_decay(Recording(time, zero + swing + white(2, len(time), 5e-3), "angle_rad"))
    assert found.half_cycles >= 7
    assert found.half_period_s == pytest.approx(0.155, rel=0.03)


def test_swings_that_a_sensor_cuts_on_one_side_are_left_out() -> None:
    """The dead zone of a sonic ranger: no reading below -0.08 m."""
    time = np.arange(2400) / 30.0
    values = 0.12 * np.exp(-time / 42.0) * np.cos(2.0 * np.pi * time / 0.83)
    values = np.maximum(values, -0.08) + 1e-3 * np.random.default_rng(4).standard_normal(2400)
    found = find_free_decay(Recording(time, values, "displacement_m"))
    clear = 42.0 * np.log(0.12 / 0.08)
    assert clear - 1.0 < found.start_s < clear + 6.0
    assert "no further on one side" in found.cuts[0].reason


@pytest.mark.parametrize("factor", [1.0, 180.0 / np.pi, 0.5 / np.pi])
def test_a_period_that_lengthens_as_a_pendulum_s_tells_the_unit(factor: float) -> None:
    from pendpipe import fit
    from pendpipe.dynamics import Eq8, Release, sample

    time = np.arange(3000) * 0.01
    angle = sample(Eq8(8.0, viscous=0.03, restoring="sine"), Release(-0.2, 2.0), time)
    angle += 1e-3 * np.random.default_rng(1).standard_normal(len(time))
    result = fit(Recording(time, factor * angle, "reading"))
    assert (result.restoring, result["amplitude"].unit) == ("sine", "rad")
    assert result["frequency"].value == pytest.approx(4.0 / np.pi, rel=1e-4)
    # What has the same period at any amplitude has no known unit.
    spring = 2.0 * np.exp(-0.03 * time) * np.cos(8.0 * time)
    spring += 1e-3 * np.random.default_rng(1).standard_normal(len(time))
    assert fit(Recording(time, factor * spring, "reading"))["amplitude"].unit == "1"


# What may follow a half cycle freely, to within a few percent of each limit.

HALF = 0.7


def half_cycles(
    swing: np.ndarray, half: np.ndarray | float = HALF, step: float = 0.0, ending: float = 0.0
) -> HalfCycles:
    """Half cycles of given swings and half periods, about a centre that stays."""
    middle = np.concatenate(([0.0], np.cumsum(np.broadcast_to(half, len(swing) - 1))))
    turn = np.concatenate(([swing[0] / 2], swing[0] / 2 - np.cumsum(swing * side(len(swing)))))
    time = np.append(middle, middle[-1] + HALF) - HALF / 2
    return HalfCycles(time, turn, swing, middle, step, ending)


def side(count: int) -> np.ndarray:
    return np.where(np.arange(count) % 2 == 0, 1.0, -1.0)


def decay(count: int = 30, share: float = 0.02) -> np.ndarray:
    return (1.0 - share) ** np.arange(count)


def ends(cycles: HalfCycles) -> list[tuple[int, int]]:
    """First and last half cycle of each run, in the order of time."""
    return sorted((run.first, run.last) for run in best_runs(cycles))


def kicked(factor: float, at: int = 15) -> np.ndarray:
    """A decay whose half cycles are larger by a factor from one of them on."""
    return decay() * np.where(np.arange(30) < at, 1.0, factor)


def halves(pause: float, after: float = 1.0) -> np.ndarray:
    """Half periods, the fifteenth of them longer by a factor, and those after it by another."""
    return HALF * np.concatenate((np.ones(14), [pause], np.full(14, after)))


def first(factor: float) -> np.ndarray:
    """A decay whose first half cycle is so much of the second."""
    return np.concatenate(([factor * 0.98], decay()[1:]))


STEP = 0.2 * decay()[14]
ONE, TWO = [(0, 29)], [(0, 14), (15, 29)]
WITHOUT_FIRST = [(1, 29)]
UP_AND_DOWN = np.where(np.arange(30) // 2 % 2 == 0, 1.0, -1.0)
PULL = np.concatenate(([0.2, 0.4, 0.6, 0.8], decay()))
RUNS = {
    # A kick by more than a third begins anew, unless a step of the converter makes the difference.
    "small kick": (kicked(1.25), HALF, 0.0, ONE),
    "kick": (kicked(1.45), HALF, 0.0, TWO),
    "kick of a step": (kicked(1.4), HALF, STEP, ONE),
    "kick of more than a step": (kicked(1.6), HALF, STEP, TWO),
    # A stop to less than three tenths ends a run.
    "loss of two thirds": (kicked(0.33), HALF, 0.0, ONE),
    "stop": (kicked(0.27), HALF, 0.0, TWO),
    # A half period may differ from those beside it by three tenths.
    # Two parts would be joined again, were they of one amplitude.
    "longer": (kicked(0.45), halves(1.32), 0.0, ONE),
    "too long": (kicked(0.45), halves(1.40), 0.0, TWO),
    "shorter": (kicked(0.45), halves(0.76), 0.0, ONE),
    "too short": (kicked(0.45), halves(0.71), 0.0, TWO),
    # A decay goes on behind a disturbance of four half periods, from half its amplitude on.
    "disturbance": (kicked(0.55), halves(4.2), 0.0, ONE),
    "disturbance, then larger": (kicked(1.1), halves(4.2), 0.0, ONE),
    "disturbance, then far smaller": (kicked(0.45), halves(4.2), 0.0, TWO),
    "long disturbance": (kicked(0.55), halves(4.8), 0.0, TWO),
    "long disturbance, then larger": (kicked(1.1), halves(4.8), 0.0, TWO),
    # What swings much slower behind a pause is another motion.
    "pause, then slower": (decay(), halves(3.0, 1.25), 0.0, ONE),
    "pause, then much slower": (decay(), halves(3.0, 1.35), 0.0, TWO),
    # What hardly stands out of the step continues nothing.
    "pause, then above the step": (decay(), halves(3.0), decay()[15] / 3.3, ONE),
    "pause, then in the step": (decay(), halves(3.0), decay()[15] / 2.7, TWO),
    # A first swing smaller than the next is a pull, unless half a step makes the difference.
    "nearly as large": (first(0.95), HALF, 0.0, ONE),
    "pull": (first(0.90), HALF, 0.0, WITHOUT_FIRST),
    "pull of less than half a step": (first(0.90), HALF, 0.098, ONE),
    "pull of more than half a step": (first(0.86), HALF, 0.098, WITHOUT_FIRST),
    # All of a pull is cut, at the head of each run, wherever that begins.
    "long pull": (PULL, HALF, 0.0, [(4, 33)]),
    # Half periods, or amplitudes, that waver by an eighth are no pendulum's.
    "wavering periods": (decay(), HALF * (1.0 + 0.05 * UP_AND_DOWN[:29]), 0.0, ONE),
    "periods too uneven": (decay(), HALF * (1.0 + 0.07 * UP_AND_DOWN[:29]), 0.0, []),
    "wavering amplitudes": (decay() * np.exp(0.05 * UP_AND_DOWN), HALF, 0.0, ONE),
    "amplitudes too uneven": (decay() * np.exp(0.07 * UP_AND_DOWN), HALF, 0.0, []),
    "uneven by the step": (decay() * np.exp(0.07 * UP_AND_DOWN), HALF, 0.5 * decay()[15], ONE),
    # Sides that differ, or a drifting zero, make them alternate, and that is one.
    "periods by sides": (decay(), HALF * (1.0 + 0.07 * side(29)), 0.0, ONE),
    "amplitudes by sides": (decay() * np.exp(0.1 * side(30)), HALF, 0.0, ONE),
    # The last half cycles of Coulomb friction belong to the decay; a single one continues nothing.
    "Coulomb friction": (
        np.append(np.arange(30, 1, -1) / 30.0 - 0.025, 0.2 * (2 / 30.0 - 0.025)), HALF, 0.0, ONE
    ),
    "wild half cycle": (np.append(decay(18), [3.0, decay()[19]]), HALF, 0.0, [(0, 17)]),
}  # fmt: skip


@pytest.mark.parametrize("case", RUNS)
def test_half_cycles_follow_one_another_within_limits(case: str) -> None:
    swing, half, step, expected = RUNS[case]
    assert ends(half_cycles(swing, half, step)) == expected


def test_a_pull_is_cut_at_the_head_of_a_later_run_too() -> None:
    later = np.concatenate((0.1 * decay(10), PULL[2:]))
    assert ends(half_cycles(later))[-1] == (12, 41)


FALLING = np.arange(41.0)


def front(of_free: float) -> np.ndarray:
    """Twenty half cycles that lose a part of what those behind them lose."""
    bent = 1.0 - of_free * 0.2 - 0.01 * (FALLING - 20)
    return np.where(FALLING <= 20, 1.0 - of_free * 0.01 * FALLING, bent)


def held_up(count: int, after: int = 40) -> np.ndarray:
    return np.concatenate((np.ones(count), decay(after)))


@pytest.mark.parametrize(
    ("swing", "step", "begins"),
    [
        # A median of seven begins to fall when its middle does.
        (held_up(20, 60), 0.0, 20),
        (held_up(3, 60), 0.0, None),
        # It loses less than a tenth of what a free one would.
        (front(0.08), 0.0, 20),
        (front(0.13), 0.0, None),
        # Its end is lost in the step.
        (held_up(20), 0.002, 20),
        (held_up(20), 0.2, None),
    ],
)
def test_a_front_held_up_is_cut_where_the_fall_begins(
    swing: np.ndarray, step: float, begins: int | None
) -> None:
    (run,) = best_runs(half_cycles(swing, step=step))
    assert run.before.startswith("driven") == (begins is not None)
    assert run.first == pytest.approx(begins or 0, abs=3 if begins else 0)


LAST = decay()[-1]


@pytest.mark.parametrize(
    ("step", "ending", "fades"),
    [
        (0.0, 1.25 * LAST, True),
        (0.0, 1.35 * LAST, False),
        # A pull at the end stands out of the step.
        (0.3 * LAST, 1.57 * LAST, True),
        (0.3 * LAST, 1.63 * LAST, False),
    ],
)
def test_a_decay_fades_unless_the_record_ends_in_a_pull(
    step: float, ending: float, fades: bool
) -> None:
    (run,) = best_runs(half_cycles(decay(), step=step, ending=ending))
    # It swings on for the half cycle after its last.
    assert (_stop(run.middle_s[-1] + 1.9 * HALF, run) > run.middle_s[-1] + HALF) == fades


def test_a_ring_that_is_repeated_is_a_decay() -> None:
    """Each of sixty pushes rings for seven half cycles."""
    time, pushes = np.arange(6000) / RATE, np.random.default_rng(2).uniform(0.5, 1.5, 59)
    late = np.maximum(time[:, None] - np.arange(1, 60), 0.0)
    rings = np.exp(-6.0 * late) * np.sin(8.0 * np.pi * late) @ pushes
    found = find_free_decay(recording([rings], noise=1e-3))
    assert found.half_cycles > 5
    assert found.notes[-1].endswith("more decays are not used")


def test_a_fall_by_chance_is_no_decay() -> None:
    """Of sixty swings of any size three fall in turn in most records, five in few."""
    taken = 0
    for seed in range(40):
        sizes = np.random.default_rng(seed).uniform(0.3, 1.0, 60)
        levels = np.append(0.0, np.cumsum(sizes * (-1.0) ** np.arange(60)))
        with contextlib.suppress(NotAnalysableError):
            parts = [ramp(low, high, 0.6) for low, high in pairwise(levels.tolist())]
            taken += find_free_decay(recording(parts, noise=1e-3)).half_cycles >= 3
    assert taken <= 8


@pytest.mark.parametrize(("rest_s", "rests"), [(9.0, 1), (7.0, 0)])
def test_a_rest_between_two_motions_counts_from_eight_half_periods(
    rest_s: float, rests: int
) -> None:
    time = np.arange(0.0, 40.0, 0.01)
    moves = np.sin(2.0 * np.pi * time)
    begin = 10.0
    still = (time > begin) & (time < begin + rest_s)
    moves[still] = 0.0
    cuts = stretches(time, moves, 30.0, 40.0, quiet=0.1, window_s=1.0, before="by hand")
    assert [cut.reason for cut in cuts].count("rest before release") == rests
    assert (cuts[0].start_s, cuts[-1].stop_s) == (0.0, 30.0)
    assert all(one.stop_s == other.start_s for one, other in pairwise(cuts))


def test_wild_half_cycles_are_bridged_and_counted() -> None:
    swing = decay(40)
    swing[[10, 11, 12]] = [0.05, 1.5, 0.05]
    swing[[25, 26]] = [1.5, 0.05]
    (run,) = best_runs(half_cycles(swing))
    assert (run.first, run.last, run.bridged) == (0, 39, 5)


@pytest.mark.parametrize(("pause", "fades"), [(1.6, True), (1.4, False)])
def test_a_run_before_a_rest_fades_and_before_a_knock_does_not(pause: float, fades: bool) -> None:
    swing, half = np.concatenate((decay(20), 3.0 * decay(20))), np.full(39, HALF)
    half[19] *= pause
    (run,) = (run for run in best_runs(half_cycles(swing, half)) if run.first == 0)
    assert (_stop(run.middle_s[-1] + 1.9 * HALF, run) > run.middle_s[-1] + HALF) == fades


@pytest.mark.parametrize(("last", "falls"), [(0.8, True), (0.92, False)])
def test_of_three_half_cycles_the_first_and_the_last_tell_the_fall(
    last: float, falls: bool
) -> None:
    """It must exceed three tenths of the least swing, here 0.15; means of two would halve it."""
    swing = np.linspace(1.0, last, 3)
    assert _falls(SimpleNamespace(swing=swing), 0.5) is falls  # type: ignore[arg-type]


@pytest.mark.parametrize("lost", [0.0, 1.3, 3.0])
@pytest.mark.parametrize("seed", range(4))
def test_few_readings_clicked_by_hand_show_period_and_loss(seed: int, lost: float) -> None:
    """At uneven times, 4.5 to 9 in a cycle, some cycles lost: none lies at a turning point."""
    rng = np.random.default_rng(seed)
    period, quality, count = rng.uniform(0.8, 2.5), rng.uniform(20.0, 150.0), 150
    time = np.cumsum(period / rng.uniform(4.5, 9.0) * rng.choice([0.7, 0.9, 1.0, 1.4], count))
    values = 0.3 * np.exp(-np.pi * time / (period * quality)) * np.cos(2.0 * np.pi * time / period)
    values, kept = values + 3e-3 * rng.standard_normal(count), abs(time / period - 7.0) >= lost / 2
    found = fit(Recording(time_s=time[kept], angle_rad=values[kept]), restoring="linear")
    assert abs(found["period"].value - period) < 4.0 * found["period"].sd
    assert found["Q"].value == pytest.approx(quality, rel=0.15)
