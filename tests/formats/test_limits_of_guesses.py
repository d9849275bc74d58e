"""What a column of numbers shows by itself, by exact swings on both sides of each limit."""

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from scipy.special import ellipk

from pendpipe.formats import circle, lists, times, units
from pendpipe.formats import columns as guess
from pendpipe.formats.table import (
    Column,
    clipped_samples,
    derivative_slope,
    evenness,
    find_gaps,
    follows_sine,
    is_uniform,
    periods,
    sample_rate,
    swing_of,
)
from pendpipe.formats.words import Role

TIME = np.arange(4000) * 0.01


def column(values: np.ndarray, name: str = "", unit: str = "", role: Role = "unknown") -> Column:
    return Column(name, unit, np.asarray(values, dtype=float), 1, role=role)


def decay(power: float, first: float = 1.5, rate: float = 0.02) -> np.ndarray:
    """A swing whose period goes as a power of the pendulum's elliptic integral."""
    amplitude = first * np.exp(-rate * TIME)
    period = (ellipk(np.sin(amplitude / 2) ** 2) / (np.pi / 2)) ** power
    return amplitude * np.cos(2 * np.pi * np.cumsum(0.01 / period))


@given(
    amplitude=st.floats(1e-6, 1e6),
    cycles=st.integers(5, 200),
    trend=st.floats(-3.0, 3.0),
    phase=st.floats(0.0, 6.0),
)
def test_a_steady_swing_has_its_own_size_and_period(
    amplitude: float, cycles: int, trend: float, phase: float
) -> None:
    angle = 2 * np.pi * cycles * np.arange(4000) / 4000 + phase
    ramp = trend * amplitude * np.linspace(-1, 1, 4000)
    found = swing_of(amplitude * np.sin(angle) + ramp)
    assert found.amplitude == pytest.approx(amplitude / np.sqrt(2), rel=0.06)
    assert found.samples_per_cycle == pytest.approx(4000 / cycles)
    assert found.clear
    assert found.graded == 0.0


def test_of_a_long_column_the_period_is_counted_in_its_own_samples() -> None:
    found = swing_of(np.sin(2 * np.pi * np.arange(100_000) / 1000))
    assert found.samples_per_cycle == pytest.approx(1000, rel=0.01)


def test_noise_is_no_swing_and_neither_is_a_clock() -> None:
    dice = np.random.default_rng(3)
    assert not any(swing_of(dice.standard_normal(n)).clear for n in (30, 100, 1000, 10_000))
    assert swing_of(np.round(TIME, 1)).samples_per_cycle == 0.0


@given(period=st.floats(0.3, 5.0), level=st.floats(-10.0, 10.0), size=st.floats(1e-3, 1e3))
def test_periods_and_amplitudes_of_a_steady_swing(period: float, level: float, size: float) -> None:
    lasted, amplitude = periods(TIME, size * (level + np.sin(2 * np.pi * TIME / period + 0.3)))
    # A crossing is interpolated on a straight line.
    assert lasted == pytest.approx(np.full(len(lasted), period), rel=0.01)
    assert np.median(amplitude) == pytest.approx(size, rel=0.01)
    # Every half period one ends, but for the first two and what the ends cut.
    assert abs(len(lasted) - (2 * 39.99 / period - 2)) <= 1.5


@given(power=st.floats(-1.0, 2.0), radians=st.sampled_from([1.0, np.pi / 180]))
def test_the_slope_is_the_power_with_which_the_period_goes_as_k(
    power: float, radians: float
) -> None:
    slope = follows_sine(TIME, decay(power) / radians, radians)
    assert slope == pytest.approx(power, abs=0.05)


def test_small_swings_and_loud_ones_leave_the_slope_open() -> None:
    noise = np.random.default_rng(5).standard_normal(len(TIME))
    assert follows_sine(TIME, decay(1.0, 0.05) + 1e-2 * noise, 1.0) is None
    assert follows_sine(TIME[:700], decay(1.0)[:700], 1.0) is not None
    assert follows_sine(TIME[:400], decay(1.0)[:400], 1.0) is None


@given(ratio=st.floats(1e-3, 1e3), upwards=st.booleans())
def test_a_derivative_is_known_by_its_ratio(ratio: float, upwards: bool) -> None:
    ratio = ratio if upwards else -ratio
    rate = -2 * np.pi * np.sin(2 * np.pi * TIME)
    assert derivative_slope(TIME, np.cos(2 * np.pi * TIME), ratio * rate) == pytest.approx(
        ratio, rel=2e-3
    )


@pytest.mark.parametrize(("late", "is_one"), [(0.40, True), (0.50, False)])
def test_a_derivative_is_within_a_ninth_of_a_turn_of_its_phase(late: float, is_one: bool) -> None:
    # The correlation of two sines is the cosine of their phase.
    other = np.sin(2 * np.pi * TIME + late)
    assert (derivative_slope(TIME, np.cos(2 * np.pi * TIME), other) is not None) == is_one


def with_steps(count: int, places: slice | list[int], step: float) -> np.ndarray:
    """Times at even steps but for some."""
    steps = np.ones(count)
    steps[places] = step
    return np.cumsum(steps)


@pytest.mark.parametrize(
    ("times", "even"),
    [
        # Within an eighth; one in a hundred may be anything.
        (with_steps(1000, slice(None, None, 10), 1.14), True),
        (with_steps(1000, slice(None, None, 10), 1.16), False),
        (with_steps(1000, slice(8), 1.5), True),
        # Gaps of whole intervals are none, but not where a fifth of the intervals are gaps.
        (with_steps(50, [10, 20, 30], 3.08), True),
        (with_steps(50, [10, 20, 30], 3.12), False),
        (with_steps(60, slice(5, None, 6), 2.0), True),
        (with_steps(40, slice(3, None, 4), 2.0), False),
    ],
)
def test_intervals_are_even_within_limits(times: np.ndarray, even: bool) -> None:
    assert is_uniform(times) == even


@given(rate=st.floats(1e-3, 1e6), missing=st.integers(1, 50), at=st.integers(0, 97))
def test_a_gap_is_where_and_as_long_as_rows_are_missing(rate: float, missing: int, at: int) -> None:
    count = np.arange(100.0)
    count[at + 1 :] += missing
    (gap,) = find_gaps(count / rate)
    assert gap.after_sample == at
    assert gap.missing_s == pytest.approx(missing / rate)
    assert sample_rate(count / rate) == pytest.approx(rate)


def test_an_encoder_s_silence_is_no_gap_until_it_is_fifty_times_as_long() -> None:
    steps = np.random.default_rng(2).uniform(0.5, 1.5, 1000)
    usual = float(np.percentile(steps, 99))
    for length, gaps in ((48.0, 0), (52.0, 1)):
        some = steps.copy()
        some[500] = length * usual
        assert len(find_gaps(np.cumsum(some))) == gaps


@given(top=st.floats(0.2, 0.7), cycles=st.integers(8, 20))
def test_flat_tops_are_counted_sample_by_sample(top: float, cycles: int) -> None:
    swing = np.cos(2 * np.pi * cycles * (np.arange(2000) + 0.25) / 2000)
    low = np.minimum(swing, top)
    assert clipped_samples(low, None) == np.count_nonzero(swing >= top)
    assert clipped_samples(-low, None) == np.count_nonzero(swing >= top)
    assert clipped_samples(swing, None) == 0
    # A known limit is met to half a step.
    both = np.clip(swing, -0.5, 0.5)
    assert clipped_samples(both, 0.01, (-0.5, 0.5)) == np.count_nonzero(np.abs(swing) >= 0.495)


@given(
    st.lists(st.text("abc", min_size=1, max_size=80), max_size=30, unique=True), st.integers(1, 20)
)
def test_names_are_listed_up_to_a_number_and_a_length(names: list[str], most: int) -> None:
    text = guess.listing(names, most)
    assert len(text) <= most * 62 + 20
    shown = text.split(" and ")[0].split(", ")
    assert len(shown) == max(1, min(most, len(names)))
    for name, said in zip(names, shown, strict=False):
        assert said == name or (len(name) > 60 and len(said) == 60 and said[:57] == name[:57])
    assert (" and " in text) == (len(names) > most)
    assert len(names) <= most or text.endswith(f"and {len(names) - most} more")


@given(st.floats(-1e3, 1e3), st.floats(0.02, 0.98), st.booleans())
def test_one_way_is_the_share_of_steps_that_go_along(
    start: float, share: float, down: bool
) -> None:
    steps = np.where(np.arange(1000) < 1000 * share, 1.0, -1e-4)
    way = np.cumsum(np.append(start, steps)) * (-1.0 if down else 1.0)
    assert lists.one_way(way) == pytest.approx(np.mean(steps > 0))
    assert lists.one_way(np.full(20, start)) == 0.0


@pytest.mark.parametrize(("jitter", "even"), [(0.09, 1.0), (0.11, 0.75)])
def test_steps_within_a_tenth_of_the_usual_are_even(jitter: float, even: float) -> None:
    steps = np.tile([1.0, 1.0, 1.0, 1.0 + jitter], 25)
    assert evenness(np.cumsum(np.append(0.0, steps))) == pytest.approx(even)
    assert evenness(-np.cumsum(np.append(0.0, steps))) == pytest.approx(even)


def test_a_swing_does_not_count_on_however_few_its_readings() -> None:
    """It falls through half the range within one reading, but it comes down more slowly too."""
    swing = 32_768 + np.rint(32_000 * np.sin(2 * np.pi * np.arange(4000) / 4.4))
    assert np.diff(swing).min() < -(2.0**15)
    assert np.array_equal(guess._counted_on(swing), swing)


@pytest.mark.parametrize(("least", "lasts"), [(0.4, True), (0.2, False)])
def test_durations_are_times_of_which_none_is_near_zero(least: float, lasts: bool) -> None:
    values = np.array([1.0, 1.1, 0.9, 1.05, least, 1.0, 1.1])
    assert lists._lasts(column(values, role="time")) == lasts
    assert not lists._lasts(column(values))
    assert not lists._lasts(column(np.arange(1.0, 9.0), role="time"))


@given(place=st.integers(0, 5), scale=st.sampled_from([1.0, 180 / np.pi]))
def test_the_printed_digit_is_the_one_that_was_printed(place: int, scale: float) -> None:
    whole = np.random.default_rng(place).integers(-9000, 9000, 500)
    assert units._printed_digit(whole * 10.0**-place / scale, scale) == 10.0**-place
    assert units._printed_digit(decay(1.0) * np.pi, scale) is None


@given(bits=st.integers(8, 20), zero=st.floats(-0.2, 0.2))
def test_an_encoder_s_counts_go_on_over_its_zero(bits: int, zero: float) -> None:
    turn = 2.0**bits
    true = np.rint(turn * (zero + 0.3 * np.cos(2 * np.pi * TIME)))
    seen = true % turn
    # So many bits are known by their use alone.
    seen[:2] = [0.0, turn - 1.0]
    found, notes = units._over_the_turn(seen.copy())
    assert np.diff(found)[2:] == pytest.approx(np.diff(true)[2:])
    assert notes
    slow = 1000.0 + np.rint(100 * np.cos(TIME))
    assert np.array_equal(units._over_the_turn(slow.copy())[0], slow)


@given(
    x=st.floats(-3.0, 3.0),
    y=st.floats(0.5, 3.0),
    arm=st.floats(0.3, 2.0),
    wide=st.floats(0.15, 1.2),
)
@example(x=0.5, y=0.5, arm=0.5, wide=0.15)
def test_the_pivot_is_the_centre_of_the_circle(x: float, y: float, arm: float, wide: float) -> None:
    angle = wide * np.exp(-0.02 * TIME) * np.cos(2 * np.pi * TIME)
    found = circle.pivot_of(x + arm * np.sin(angle), y - arm * np.cos(angle))
    assert found == pytest.approx([x, y], abs=1e-6)
    # About (0, 0) nothing has to be found.
    assert circle.pivot_of(arm * np.sin(angle), -arm * np.cos(angle)) is None


def test_a_wild_place_moves_no_pivot() -> None:
    angle = np.exp(-0.02 * TIME) * np.cos(2 * np.pi * TIME)
    x, y = 2.0 + np.sin(angle), 3.0 - np.cos(angle)
    x[100], y[200] = 3.5, 1.2
    assert circle.pivot_of(x, y) == pytest.approx([2.0, 3.0], abs=1e-6)


@pytest.mark.parametrize("start", [0.0, 1e16])
def test_blocks_under_one_stamp_are_counted_where_the_clock_has_digits_left(start: float) -> None:
    stamps = times.TimeBase(start + np.repeat(2.0 * np.arange(40), 5), np.arange(200))
    times._count_rows(guess.Choice(None, False, (), ()), stamps)
    even = np.ptp(np.diff(stamps.time_s)) < 1e-9
    assert even == (start == 0.0)
