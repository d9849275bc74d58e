"""The nulls obey Eq. 8, and each has the noise that its family promises."""

import json
from argparse import Namespace
from pathlib import Path

import numpy as np
import pytest

from benchmarks import journal
from benchmarks import null_families as nulls


def noise_of(family: str, readings: int = 40_000) -> nulls.Array:
    """Noise of one family on a pendulum at rest, its rms in units of the rms asked for."""
    time_s = np.arange(readings) / 20.0
    level = np.linspace(1.0, 0.1, readings)
    swing = nulls.Swing(time_s, np.zeros(readings), level, 1.0)
    return nulls.FAMILIES[family](np.random.default_rng(1), swing)


@pytest.mark.parametrize("family", nulls.FAMILIES)
def test_a_recording_is_a_function_of_its_family_and_its_number(family: str) -> None:
    one, same, other = (nulls.draw(family, number) for number in (3, 3, 4))
    assert np.array_equal(one.angle_rad, same.angle_rad)
    assert len(one.angle_rad) != len(other.angle_rad)
    assert 1000 <= len(one.angle_rad) <= 6000


@pytest.mark.parametrize("family", [name for name in nulls.FAMILIES if name != "rounded"])
def test_a_family_has_the_rms_that_is_asked_for(family: str) -> None:
    assert noise_of(family).std() == pytest.approx(1.0, rel=0.05)


def test_noise_with_a_memory_resembles_its_neighbour_and_white_noise_does_not() -> None:
    def likeness(noise: nulls.Array) -> float:
        return float(np.corrcoef(noise[1:], noise[:-1])[0, 1])

    assert abs(likeness(noise_of("white"))) < 0.02
    assert all(
        likeness(noise_of(family)) > 0.1 for family in ("memory", "red", "smoothed", "popcorn")
    )


def test_a_stand_has_one_resonance() -> None:
    power = np.abs(np.fft.rfft(noise_of("stand"))) ** 2
    coarse = power[1:20_001].reshape(100, 200).mean(axis=1)
    assert coarse.max() > 5 * np.median(coarse)
    near = np.flatnonzero(coarse > 0.5 * coarse.max())
    assert np.ptp(near) == len(near) - 1


def test_an_answer_of_other_code_is_asked_again_and_a_torn_line_is_none(tmp_path: Path) -> None:
    path, mark = tmp_path / "journal.jsonl", journal.code(("benchmarks/journal.py",))
    lines = [json.dumps({"key": n, "answer": -n, "code": c}) for n, c in ((1, mark), (2, "other"))]
    path.write_text("\n".join([*lines, lines[0][:20], ""]), encoding="utf-8")
    told = Namespace(journal=path, processes=1)
    assert list(journal.answers(told, [1, 2, 3], abs, ("benchmarks/journal.py",))) == [-1, 2, 3]
    assert list(journal.answers(told, [3, 2], float, ("benchmarks/journal.py",))) == [3, 2]
