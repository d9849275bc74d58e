"""Readings that stand for lost ones are named and left out; a clean swing loses none."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from pendpipe.arrays import FloatArray
from pendpipe.formats import read
from pendpipe.formats.lost import without_marks, without_spikes

from .cases import SHARED

TIME = np.arange(3000) / 30.0
KINDS = SHARED.parent / "inputs4"


def swing(rng: np.random.Generator, level: float, noise: float) -> FloatArray:
    period, loss = rng.uniform(0.8, 2.5), rng.uniform(0.005, 0.03)
    turning = np.cos(2.0 * np.pi * TIME / period + rng.uniform(0.0, 6.0))
    moved = level + 0.4 * np.exp(-loss * TIME) * turning
    return np.asarray(moved + noise * rng.standard_normal(len(TIME)))


def put(rng: np.random.Generator, number: int, rows: int) -> FloatArray:
    """Rows of a few stretches, well apart."""
    starts = 10 + 100 * rng.choice(29, number, replace=False) + rng.integers(0, 60, number)
    return np.asarray((starts[:, None] + np.arange(rows)).ravel())


@pytest.mark.parametrize(
    ("number", "rows", "lost"),
    [
        (1, 1, lambda _: 1e6),
        (4, 1, lambda _: -999.0),
        (1, 1, lambda _: 9999.0),
        (5, 1, lambda _: 65535.0),
        (5, 7, lambda _: -999.0),
        (6, 12, lambda _: 9.9e37),
        (2, 1, lambda _: -9.91e37),
        (10, 1, lambda _: 0.0),
        (1, 1, lambda x: x + 0.4),
        (8, 4, lambda x: x - 0.5),
        (8, 2, lambda x: x + 0.3),
    ],
)
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_what_stands_for_a_lost_reading_is_left_out(
    number: int, rows: int, lost: Callable[[FloatArray], FloatArray | float], seed: int
) -> None:
    """Sentinels, overloads, lost echoes of a few rows; no other reading is."""
    rng = np.random.default_rng(seed)
    values = swing(rng, 1.5, 1e-3)
    at = put(rng, number, rows)
    values[at] = lost(values[at])
    assert np.flatnonzero(np.isnan(without_spikes(without_marks(values)))).tolist() == sorted(
        at.tolist()
    )


@pytest.mark.parametrize("noise", [0.0, 1e-4, 2e-3, 2e-2])
@pytest.mark.parametrize("digits", [1, 2, 3, 6])
@pytest.mark.parametrize("step", [1, 3, 7])
def test_a_clean_swing_loses_no_reading(noise: float, digits: int, step: int) -> None:
    """Nor does one that wraps, is held for three rows, or jumps to another level for good."""
    rng = np.random.default_rng(int(1e5 * noise) + digits)
    values = np.round(swing(rng, 0.0, noise)[::step], digits)
    late = values + 0.3 * (np.arange(len(values)) > 500)
    wrapped = np.mod(np.degrees(values), 360.0)
    for each in (values, np.repeat(values, 3), late, wrapped):
        assert not np.flatnonzero(np.isnan(without_spikes(without_marks(each)))).tolist()


@pytest.mark.skipif(not KINDS.is_dir(), reason="no ../shared/inputs4 here")
@pytest.mark.parametrize(
    ("name", "rows", "value"),
    [("k43_lost_echoes.txt", 180, "25"), ("k54_overload.csv", 143, "9.9e+37")],
)
def test_lost_echoes_and_overloads_are_named(name: str, rows: int, value: str) -> None:
    recording = read(Path(KINDS / name))
    named = next(each for each in recording.facts if each.kind == "lost readings")
    assert value in named.value
    assert np.sum(~recording.usable) == pytest.approx(rows, rel=0.3)
