"""Readings that stand for lost ones are marked, and no true reading is."""

import numpy as np
import pytest

from pendpipe.arrays import FloatArray
from pendpipe.formats.table import without_marks


def decay(cycle: float, quality: float, middle: float = 0.0, count: int = 1200) -> FloatArray:
    """A free decay of amplitude 1, with a thousandth of noise; `cycle` readings a cycle."""
    turn = 2.0 * np.pi * np.arange(count) / cycle
    noise = 1e-3 * np.random.default_rng(int(10 * cycle + quality)).standard_normal(count)
    return np.asarray(middle + np.exp(-0.5 * turn / quality) * np.cos(turn + 0.3) + noise)


def lost(values: FloatArray) -> list[int]:
    return np.flatnonzero(np.isnan(without_marks(values))).tolist()


ROWS = [40, 41, 110, 231, 305]
"""Two on end, the others alone; all at amplitudes above a third of the first."""


@pytest.mark.parametrize("mark", [0.0, -1.0, -999.0, 9999.0, 1e6, 1e300])
@pytest.mark.parametrize("middle", [5.3, 42.0])
def test_a_number_that_comes_back_far_from_the_swing_is_no_reading(
    mark: float, middle: float
) -> None:
    values = decay(20.0, 100.0, middle)
    values[ROWS] = mark
    assert lost(values) == ROWS


def test_zeros_in_a_swing_about_zero_are_seen_by_those_far_from_it() -> None:
    values = np.round(decay(40.0, 100.0), 3)
    rows = [18, 50, 78, 98, 131, 218]
    assert np.sum(np.abs(values[rows]) > 0.8) == 4
    values[rows] = 0.0
    assert lost(values) == rows
    passed = np.round(decay(40.0, 100.0), 1)
    assert np.sum(passed == 0.0) == 60
    assert lost(passed) == []


def test_two_numbers_that_stand_for_no_echo_are_both_seen() -> None:
    """Too near and too far, side by side: 0 cm and 357.1 cm from a spring at 42 cm."""
    values = np.round(42.3 + 8.0 * decay(22.0, 140.0), 1)
    values[ROWS] = [0.0, 357.1, 357.1, 0.0, 357.1]
    assert lost(values) == ROWS


def test_wild_readings_need_not_be_equal_to_be_lost() -> None:
    values = decay(20.0, 100.0)
    values[[40, 200, 500]] = [1e6, -3e5, 40.0]
    assert lost(values) == [40, 200, 500]


def test_every_second_reading_may_be_lost_for_a_while() -> None:
    values = decay(40.0, 100.0)
    rows = [95, 97, 99, 300, 302, 700]
    values[rows] = -999.0
    assert lost(values) == rows


def test_a_reading_that_stands_out_once_by_less_than_all_others_span_stays() -> None:
    """The diagnosis names it: a glitch, or a knock."""
    values = decay(40.0, 100.0)
    values[200] += 1.5
    assert lost(values) == []


def test_a_release_and_an_end_that_stand_apart_stay() -> None:
    values = 1e-3 * decay(40.0, 100.0)
    values[0], values[-1] = 1.0, -1.0
    assert lost(values) == []


@pytest.mark.parametrize("cycle", [3.3, 8.0, 13.0, 40.0, 200.0])
@pytest.mark.parametrize("quality", [1.5, 3.0, 10.0, 3000.0])
@pytest.mark.parametrize("step", [0.0, 0.002, 0.03, 0.25])
def test_no_reading_of_a_decay_is_lost(cycle: float, quality: float, step: float) -> None:
    """Rounded, held by a slow sensor, clipped, or counted on a circle that it swings across."""
    values = decay(cycle, quality, middle=0.37)
    if step:
        values = step * np.round(values / step)
    assert lost(values) == []
    assert lost(np.repeat(values, 4)) == []
    assert lost(np.clip(values, -step * 3, step * 2) if step else np.clip(values, 0.0, 0.7)) == []
    for circle in (360, 4096):
        turned = np.round(decay(cycle, quality) * circle / 6.0)
        assert lost(np.mod(turned, circle)) == []
        assert lost(np.mod(turned + circle / 2 - 3, circle)) == []
