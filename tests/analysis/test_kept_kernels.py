"""The kernels of the turning points: kept as machine code, and the same as plain Python's."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pendpipe.analysis.turning_points import compiled, plain
from pendpipe.analysis.turning_points.shape import HARMONICS

FOLDER = Path(compiled.__file__).parent

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
    compiled.count_half_cycles(np.arange(3.0), np.array([1, -1, 1]), np.zeros(3, dtype=np.int64))
    run = subprocess.run(
        [sys.executable, "-c", code], env=os.environ | {"OPENBLAS_NUM_THREADS": "1"},
        capture_output=True, text=True, check=True,
    )  # fmt: skip
    assert run.stdout.split() == ["True", "False", "False"]


def test_every_kept_source_is_watched() -> None:
    """A source left out would keep its old code after a change."""
    made_from = {
        path.name
        for path in FOLDER.glob("*.py")
        if "@kernel" in path.read_text(encoding="utf-8") or path.name == "entries.py"
    }
    assert made_from <= set(compiled.SOURCES)
    assert all((FOLDER / name).is_file() for name in compiled.SOURCES)


@given(
    st.integers(1, 12), st.integers(0, HARMONICS), st.booleans(), st.integers(1, 3),
    st.integers(0, 2**32 - 1),
)  # fmt: skip
def test_sums_and_solutions_are_those_of_least_squares(
    half_cycles: int, free: int, shaped: bool, stride: int, seed: int
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
    gram, right, square = compiled.half_cycle_sums(
        time_s, values, stride, edges, centre_s, rate, level, shape, free
    )
    solution, _ = compiled.solve_half_cycles(gram, right, np.zeros(half_cycles))
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
    gram, right = np.zeros((1, 3, 3)), np.zeros((1, 3))
    solution, inverse = compiled.solve_half_cycles(gram, right, np.zeros(1))
    assert np.isnan(solution).all()
    assert np.isnan(inverse).all()


@given(st.integers(3, 40), st.integers(1, 4), st.booleans())
def test_extremes_of_a_cosine_are_where_it_turns(turns: int, stride: int, upside: bool) -> None:
    """The first reading, where the motion begins, counts as one of them."""
    readings = 240
    phase = np.arange(turns * readings) * np.pi / readings
    values = np.cos(phase) if upside else -np.cos(phase)
    index, first = compiled.extremes(values, stride, 0.3, 0.01)
    assert first == (1 if upside else -1)
    turning = np.arange(len(index)) * readings
    assert len(index) == turns
    assert np.all(np.abs(index - turning) <= stride + 1)


@given(st.lists(st.integers(1, 3), min_size=6, max_size=30), st.floats(0.1, 10.0))
def test_half_cycles_lost_in_gaps_are_counted(steps: list[int], period: float) -> None:
    """An interval with a gap counts as many half cycles as fit and as its sides ask for."""
    steps[:5] = [1] * 5
    number = np.concatenate([[0], np.cumsum(steps)])
    sign = 1 - 2 * (number % 2)
    gap = np.concatenate([[0], (np.array(steps) > 1).astype(int)])
    counted, good = compiled.count_half_cycles(period * number, sign, gap)
    assert good == len(number)
    assert counted.tolist() == number.tolist()


@given(st.integers(8, 100), st.floats(0.1, 10.0), st.floats(-1e-4, 1e-4))
def test_smoothing_leaves_a_parabola_alone(count: int, period: float, drift: float) -> None:
    """Times that are a parabola of their number are their own local parabola."""
    number = np.arange(count, dtype=float)
    time_s = period * (number + drift * number**2)
    centre, half_period = compiled.smooth_times(number, time_s, np.ones(count), 9.0, number)
    np.testing.assert_allclose(centre, time_s, rtol=1e-9, atol=1e-9 * period)
    np.testing.assert_allclose(half_period, period * (1.0 + 2.0 * drift * number), rtol=1e-7)


def test_what_is_said_of_readings_is_what_numpy_says() -> None:
    values = np.random.default_rng(3).standard_normal(5000)
    assert plain.fourth_square(values) == pytest.approx(np.sum(np.diff(values, n=4) ** 2))
    blocks = plain.block_squares(values, 7, 100)
    starts = (len(values) - 100) * np.arange(7) // 6
    expected = [np.mean(np.diff(values[s : s + 100], n=4) ** 2) for s in starts]
    np.testing.assert_allclose(blocks, np.sort(expected))
    assert plain.extent(values) == (True, values.min(), values.max())
    for bad in (np.nan, np.inf, -np.inf):
        assert plain.extent(np.append(values, bad)) == (False, values.min(), values.max())
    clipped = np.clip(np.sin(np.arange(1000) * 0.05), -0.9, 0.9)
    high = clipped == 0.9
    runs = np.count_nonzero(np.diff(high.astype(int)) == 1) + int(high[0])
    assert plain.stays(clipped, 0.9) == (np.count_nonzero(high), runs)


def test_half_cycles_of_white_noise_scatter_as_it() -> None:
    time_s = np.arange(60_000) * 0.01
    noise = 0.3 * np.random.default_rng(4).standard_normal(len(time_s))
    ratio, count = plain.half_cycle_scatter(np.arange(1.0, 599.0), time_s, noise)
    assert count == 597
    assert ratio == pytest.approx(0.3**2, rel=4.0 * np.sqrt(2.0 / 597))
    assert plain.half_cycle_scatter(np.array([1.0, 2.0, 2.01, 3.0]), time_s, noise)[1] == 0
