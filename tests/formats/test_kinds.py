"""Kinds of files that strangers have: three of each, drawn here, read and answered right."""

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pendpipe as pp
from pendpipe.arrays import FloatArray
from pendpipe.errors import InputError
from pendpipe.formats import read

from .cases import text


def free(
    time: FloatArray, period: float, quality: float, size: float = 0.1, phase: float = 0.7
) -> FloatArray:
    """One mode, with its loss: frequency pi/Q a period below that without any."""
    turns = time / period
    return np.asarray(size * np.exp(-np.pi * turns / quality) * np.cos(2 * np.pi * turns + phase))


def noisy(values: FloatArray, part: float, seed: int) -> FloatArray:
    """The same with noise of a part of its size."""
    noise = np.random.default_rng(seed).standard_normal(len(values))
    return np.asarray(values + part * np.abs(values).max() * noise)


def written(folder: Path, content: str | bytes, name: str = "a.txt") -> Path:
    path = folder / name
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path


@pytest.mark.parametrize(
    ("every_s", "rows", "period", "quality"),
    [(40.0, 25, 2.0, 300.0), (90.0, 15, 1.1, 1200.0), (20.0, 60, 3.2, 150.0)],
)
def test_amplitudes_over_ten_minutes_are_against_seconds(
    tmp_path: Path, every_s: float, rows: int, period: float, quality: float
) -> None:
    """K41: a list has no period that would be a thousandth of it."""
    time = every_s * np.arange(rows)
    sizes = 30.0 * np.exp(-np.pi * time / period / quality)
    path = written(
        tmp_path, text(time, noisy(sizes, 1e-3, rows), digits=3, head="time,amplitude\n")
    )
    found = pp.fit(path, period=period)
    assert found.quality_factors[0].quality_factor.value == pytest.approx(quality, rel=0.03)


@pytest.mark.parametrize("head", ["number of swings", "Anzahl Schwingungen", "n (oscillations)"])
def test_amplitudes_against_the_number_of_swings(tmp_path: Path, head: str) -> None:
    """K52: each lasts a period."""
    number = 10.0 * np.arange(25)
    sizes = 12.0 * np.exp(-np.pi * number / 250.0)
    rows = text(number, noisy(sizes, 1e-3, 52), digits=3, head=f"{head},amplitude (cm)\n")
    found = pp.fit(written(tmp_path, rows), period=1.3)
    assert found.quality_factors[0].quality_factor.value == pytest.approx(250.0, rel=0.03)


@pytest.mark.parametrize(
    ("mark", "bytes_each", "order", "form"),
    [
        (":WFMP:", 1, "MSB", "RI"),
        ("WFMPRE:", 2, "LSB", "RI"),
        (":WFMO:", 2, "MSB", "RP"),
    ],
)
def test_a_curve_of_an_oscilloscope(
    tmp_path: Path, mark: str, bytes_each: int, order: str, form: str
) -> None:
    """K51: .ISF of one byte a reading or two, either first, with a sign or without."""
    time = np.arange(600) * 0.01 - 1.5
    volts = free(time + 1.5, 0.9, 40.0, size=1.2)
    step, zero = 2.7 / 2 ** (8 * bytes_each), 2 ** (8 * bytes_each - 1) * (form == "RP")
    counts = np.rint(volts / step).astype(np.int64) + zero
    kind = f"{'<' if order == 'LSB' else '>'}{'u' if form == 'RP' else 'i'}{bytes_each}"
    data = counts.astype(kind).tobytes()
    head = (
        f"{mark}BYT_NR {bytes_each};BIT_NR {8 * bytes_each};ENCDG BIN;BN_FMT {form};"
        f'BYT_OR {order};WFID "Ch2, DC";PT_FMT Y;XUNIT "s";XINCR 1.0E-2;XZERO -1.5E0;YUNIT "V";'
        f"YMULT {step!r};YOFF {zero}.0E0;YZERO 0.0E0;:CURVE #{len(str(len(data)))}{len(data)}"
    )
    recording = read(written(tmp_path, head.encode() + data, "a.isf"))
    assert recording.quantity == "volts"
    np.testing.assert_allclose(recording.time_s, time, atol=1e-9)
    np.testing.assert_allclose(recording.values, volts, atol=0.51 * step)


@pytest.mark.parametrize(
    ("cycle", "period", "quality"), [(4.4, 1.67, 60.0), (5.6, 0.8, 90.0), (7.3, 2.9, 45.0)]
)
def test_points_clicked_by_hand(
    tmp_path: Path, cycle: float, period: float, quality: float
) -> None:
    """K47: a few uneven readings a cycle show period and loss without turning points."""
    rng = np.random.default_rng(47)
    time = np.cumsum(period / cycle * rng.uniform(0.5, 1.5, 160))
    rows = text(time, 5.0 + noisy(free(time, period, quality, 40.0), 0.01, 47), digits=3)
    found = pp.fit(written(tmp_path, "t (s),x (mm)\n" + rows))
    assert found.period.value == pytest.approx(period, rel=3e-3)
    assert found.quality_factors[0].quality_factor.value == pytest.approx(quality, rel=0.1)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("period", "quality", "size"), [(1.3, 120.0, 0.01), (0.7, 40.0, 0.03), (2.2, 500.0, 0.005)]
)
def test_numbers_without_noise(tmp_path: Path, period: float, quality: float, size: float) -> None:
    """K55: of twelve digits, by the formula of the textbook."""
    time = np.arange(3000) * period / 60.0
    rows = text(time, free(time, period, quality, size), digits=12, head="t (s),theta (rad)\n")
    found = pp.fit(written(tmp_path, rows), restoring="linear")
    assert found.light == "green"
    assert found.quality_factors[0].quality_factor.value == pytest.approx(quality, rel=1e-3)


BEATS = [
    (0.7082, 0.7351, 95.0, 98.0, 0.9),
    (1.10, 1.135, 150.0, 120.0, 0.7),
    (0.52, 0.5405, 80.0, 80.0, 1.0),
]


def beat(one: float, other: float, q: float, q2: float, part: float, turned: float) -> Any:
    """Two modes; turned by pi their sum begins small."""
    time = np.arange(0.0, 1.7 / (other - one), 0.02)
    x = free(time, 1 / one, q) + free(time, 1 / other, q2, 0.1 * part, 0.7 + turned)
    return text(time, noisy(x, 3e-3, 56), digits=5, head="t (s),theta (rad)\n")


@pytest.mark.slow
@pytest.mark.parametrize("turned", [0.0, np.pi])
@pytest.mark.parametrize(("one", "other", "q", "q2", "part"), BEATS)
def test_two_modes_that_beat(
    tmp_path: Path, one: float, other: float, q: float, q2: float, part: float, turned: float
) -> None:
    """K44 and K56: both frequencies, whether the beat falls or grows first; nobody drove it."""
    path = written(tmp_path, beat(one, other, q, q2, part, turned))
    found = pp.fit(path)
    said = [float(number) for number in re.findall(r"\d+\.\d+", found.light_reason)]
    assert found.light == "red"
    for frequency in (one, other):
        assert any(number == pytest.approx(frequency, rel=2e-3) for number in said)
    assert "driven" not in str(found)


@pytest.mark.slow
@pytest.mark.parametrize(("one", "other", "q", "q2", "part"), BEATS)
def test_a_beat_loses_no_rows(
    tmp_path: Path, one: float, other: float, q: float, q2: float, part: float
) -> None:
    """K56: where stamps are even, the turn of the phase at a node is no lost row."""
    path = written(tmp_path, beat(one, other, q, q2, part, 0.0))
    answer = str(pp.diagnose(path))
    assert not re.search("lost", answer)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("seed", "period", "quality", "cycles"),
    [(8, 0.8, 60.0, 3.5), (5, 1.5, 25.0, 2.9), (7, 1.1, 90.0, 3.4)],
)
def test_of_a_few_swings_behind_a_minute_of_handling_nothing_is_quoted(
    seed: int, period: float, quality: float, cycles: float
) -> None:
    """K57: fit and diagnosis say the same of what is left, and that most was cut."""
    rng = np.random.default_rng(seed)
    hand = np.convolve(rng.standard_normal(2400), np.hanning(30), "same")
    hand *= 0.1 / np.std(hand)
    swings = free(np.arange(int(40 * cycles)) * period / 40.0, period, quality, 0.25, 0.0)
    x = np.concatenate([hand, np.linspace(hand[-1], 0.25, 30), swings, np.zeros(800)])
    x += 2e-3 * rng.standard_normal(len(x))
    recording = pp.Recording(time_s=np.arange(len(x)) * period / 40.0, angle_rad=x)
    found = pp.fit(recording)
    assert found.light_reason.startswith("most of it was cut")
    assert "nothing of this fit can be quoted" in str(found)
    with pytest.raises(InputError, match=r"most of it was cut.* nothing is said"):
        pp.diagnose(recording)
