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


def marked(values: FloatArray, rows: list[int], marks: float | list[float]) -> FloatArray:
    """Readings of which some are replaced."""
    values[rows] = marks
    return values


FAR = [18, 50, 78, 98, 131, 218]
"""Four of them at amplitudes above 0.8."""
IN_TURN = [95, 97, 99, 300, 302, 700]
SWING = 42.3 + 8.0 * decay(22.0, 140.0)
CASES: dict[str, tuple[FloatArray, list[int]]] = {
    # A number that comes back far from the swing is no reading.
    **{
        f"{mark:g} beside a swing about {middle:g}": (
            marked(decay(20.0, 100.0, middle), ROWS, mark),
            ROWS,
        )
        for mark in (0.0, -1.0, -999.0, 9999.0, 1e6, 1e300)
        for middle in (5.3, 42.0)
    },
    # Zeros in a swing about zero are seen by those far from it.
    "zeros far from it": (marked(np.round(decay(40.0, 100.0), 3), FAR, 0.0), FAR),
    "zeros that it passes": (np.round(decay(40.0, 100.0), 1), []),
    "no echo, too near and too far": (
        marked(np.round(SWING, 1), ROWS, [0.0, 357.1, 357.1, 0.0, 357.1]),
        ROWS,
    ),
    "wild readings that differ": (
        marked(decay(20.0, 100.0), [40, 200, 500], [1e6, -3e5, 40.0]),
        [40, 200, 500],
    ),
    "every second reading for a while": (marked(decay(40.0, 100.0), IN_TURN, -999.0), IN_TURN),
    # The diagnosis names it: a glitch, or a knock.
    "one that stands out by less than all span": (
        marked(decay(40.0, 100.0), [200], decay(40.0, 100.0)[200] + 1.5),
        [],
    ),
    "a release and an end that stand apart": (
        marked(1e-3 * decay(40.0, 100.0), [0, -1], [1.0, -1.0]),
        [],
    ),
}


@pytest.mark.parametrize("case", CASES)
def test_readings_that_stand_for_lost_ones_are_marked(case: str) -> None:
    values, rows = CASES[case]
    assert lost(values) == rows


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
