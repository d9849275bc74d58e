"""The loops of the turning points: kept as machine code, and right."""

import os
import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pendpipe.analysis.half_cycles import find_extremes
from pendpipe.analysis.turning_points.find import count_half_cycles, smooth_times
from pendpipe.analysis.turning_points.measure import (
    BLOCK,
    HARMONICS,
    ROWS,
    _solved,
    half_cycle_sums,
)

FIT = """
import sys
import numpy as np
from pendpipe.analysis.fit import fit_recording
from pendpipe.recording import Recording
time_s = np.arange(4000) / 100.0
angle = 0.1 * np.exp(-0.02 * time_s) * np.cos(3.0 * time_s)
noise = 1e-5 * np.random.default_rng(5).standard_normal(len(time_s))
fit = fit_recording(Recording(time_s, angle + noise, "angle_rad"))
print(abs(fit.value("b") - 0.02) < 1e-3, "numba" in sys.modules, "scipy" in sys.modules)
"""
MEASURE = """
import sys
import numpy as np
from pendpipe.analysis.turning_points import find_turning_points
from pendpipe.recording import Recording
time_s = np.arange(4000) / 100.0
angle = 0.1 * np.exp(-0.02 * time_s) * np.cos(3.0 * time_s)
noise = 1e-5 * np.random.default_rng(5).standard_normal(len(time_s))
points = find_turning_points(Recording(time_s, angle + noise, "angle_rad"))
print(len(points) > 30, "numba" in sys.modules, "scipy" in sys.modules)
"""


@pytest.mark.parametrize("code", [MEASURE, FIT], ids=["turning points", "waveform"])
def test_a_new_process_measures_and_fits_without_numba(code: str) -> None:
    exec(code, {})  # what it needs is compiled and kept
    run = subprocess.run(
        [sys.executable, "-c", code],
        env=os.environ | {"OPENBLAS_NUM_THREADS": "1"},
        capture_output=True,
        text=True,
        check=True,
    )
    assert run.stdout.split() == ["True", "False", "False"]


@given(
    st.integers(1, 12),
    st.integers(0, HARMONICS),
    st.booleans(),
    st.integers(1, 3),
    st.sampled_from([7, BLOCK]),
    st.integers(0, 2**32 - 1),
)
def test_sums_and_solutions_are_those_of_least_squares(
    half_cycles: int, free: int, shaped: bool, stride: int, block_size: int, seed: int
) -> None:
    """Each half cycle's amplitude and sine are those of numpy's least squares."""
    random = np.random.default_rng(seed)
    time_s = np.sort(random.uniform(-0.5, half_cycles - 0.5, 60 * half_cycles))
    centre_s, rate = np.arange(half_cycles, dtype=float), np.full(half_cycles, np.pi)
    values = random.normal(0.0, 1.0, len(time_s))
    shape = np.zeros((half_cycles, 4 + HARMONICS))
    if shaped:
        shape[:] = random.uniform(-0.05, 0.05, shape.shape)
        shape[:, 0] = np.abs(shape[:, 0])  # friction never drives
    bounds = np.searchsorted(time_s, np.arange(half_cycles + 1) - 0.5)
    edges = np.stack([bounds[:-1], bounds[1:]], axis=1)
    level = 0.2
    gram, right = np.zeros((half_cycles, 3 + free, 3 + free)), np.zeros((half_cycles, 3 + free))
    square, block = np.zeros(half_cycles), np.ones((ROWS, block_size))
    harmonics = HARMONICS if shaped else free
    half_cycle_sums(
        time_s,
        values,
        stride,
        edges,
        centre_s,
        rate,
        level,
        shape,
        harmonics,
        gram,
        right,
        square,
        block,
    )
    solution, _ = _solved(gram, right, np.zeros(half_cycles))
    for k in range(half_cycles):
        used = slice(edges[k, 0], edges[k, 1], stride)
        phase = rate[k] * (time_s[used] - centre_s[k])
        friction, viscous, friction2, viscous2 = shape[k, :4]
        cosine, sine = np.cos(phase), np.sin(phase)
        odd = [np.cos((2 * m + 3) * phase) for m in range(HARMONICS)]
        form = cosine + (np.sign(phase) * friction - friction2) * (1.0 - cosine)
        form += viscous * (sine - phase * cosine)
        form += viscous2 * phase * (0.5 * phase * cosine - sine)
        form += sum(share * wave for share, wave in zip(shape[k, 4:], odd, strict=True))
        basis = np.stack([np.ones_like(phase), form, sine, *odd[:free]])
        reading = values[used] - level
        np.testing.assert_allclose(gram[k], basis @ basis.T, atol=1e-6)
        np.testing.assert_allclose(right[k], basis @ reading, atol=1e-6)
        assert square[k] == pytest.approx(reading @ reading)
        if len(reading) > 3 * len(basis):
            expected, *_ = np.linalg.lstsq(basis[1:].T, reading, rcond=None)
            np.testing.assert_allclose(solution[k, :, 0], expected, rtol=1e-4, atol=1e-4)


def test_a_half_cycle_without_readings_has_no_solution() -> None:
    solution, inverse = _solved(np.zeros((1, 3, 3)), np.zeros((1, 3)), np.zeros(1))
    assert np.isnan(solution).all()
    assert np.isnan(inverse).all()


@given(st.integers(3, 40), st.booleans())
def test_extremes_of_a_cosine_are_where_it_turns(turns: int, upside: bool) -> None:
    """The first reading, where the motion begins, counts as one of them, and so does the last."""
    readings = 240
    phase = np.arange(turns * readings + 1) * np.pi / readings
    values = np.cos(phase) if upside else -np.cos(phase)
    index = find_extremes(values, 0.01)
    assert index.tolist() == (np.arange(turns + 1) * readings).tolist()


@given(st.lists(st.integers(1, 3), min_size=6, max_size=30), st.floats(0.1, 10.0))
def test_half_cycles_lost_in_gaps_are_counted(steps: list[int], period: float) -> None:
    """An interval with a gap counts as many half cycles as fit and as its sides ask for."""
    steps[:5] = [1] * 5
    number = np.concatenate([[0], np.cumsum(steps)])
    sign = 1 - 2 * (number % 2)
    gap = np.concatenate([[0], (np.array(steps) > 1).astype(int)])
    counted = np.zeros(len(number), dtype=np.int64)
    assert count_half_cycles(period * number, sign, gap, period, counted) == len(number)
    assert counted.tolist() == number.tolist()


@given(st.integers(8, 100), st.floats(0.1, 10.0), st.floats(-1e-4, 1e-4))
def test_smoothing_leaves_a_parabola_alone(count: int, period: float, drift: float) -> None:
    """Times that are a parabola of their number are their own local parabola."""
    number = np.arange(count)
    time_s = period * (number + drift * number**2)
    centre, half_period = smooth_times(number, time_s, np.ones(count), 9.0, number)
    np.testing.assert_allclose(centre, time_s, rtol=1e-9, atol=1e-9 * period)
    np.testing.assert_allclose(half_period, period * (1.0 + 2.0 * drift * number), rtol=1e-7)


@given(st.lists(st.integers(-6, 6), min_size=2, max_size=60))
def test_extremes_by_a_fixed_threshold_are_those_of_the_definition(steps: list[int]) -> None:
    """Between neighbours the readings go from one to the other, and no return exceeds it."""
    values, least = np.cumsum(np.array(steps, dtype=float)), 3.0
    index = find_extremes(values, least)
    if len(index) == 0:
        assert np.ptp(values) <= least
        return
    assert np.all(np.diff(index) > 0)
    first = np.sign(values[index[0]] - values[index[1]])
    side = first * (1.0 - 2.0 * (np.arange(len(index)) % 2))
    swing = -np.diff(values[index]) * side[:-1]
    assert np.all(swing > least)
    for start, stop, sign in zip(index[:-1], index[1:], -side[:-1], strict=True):
        path = sign * values[start : stop + 1]
        assert path.min() == path[0]
        assert path.max() == path[-1]
        assert np.max(np.maximum.accumulate(path) - path) <= least
