"""The nulls obey Eq. 8, and each has the noise that its family promises."""

import json
from argparse import Namespace
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from benchmarks import journal
from benchmarks import null_families as nulls

LAW = nulls.Law(0.7, quadratic=0.3, viscous=0.02, hysteretic=0.03, coulomb=2e-4)


def noise_of(family: str, readings: int = 40_000) -> nulls.Array:
    """Noise of one family on a pendulum at rest, its rms in units of the rms asked for."""
    time_s = np.arange(readings) / 20.0
    level = np.linspace(1.0, 0.1, readings)
    swing = nulls.Swing(time_s, np.zeros(readings), level, 1.0)
    return nulls.FAMILIES[family](np.random.default_rng(1), swing)


def test_the_motion_is_that_of_an_integration_of_eq_8_in_time() -> None:
    omega = 2 * np.pi * LAW.frequency_hz

    def slope(_: float, state: nulls.Array, side: float) -> list[float]:
        x, v = state
        square = (omega * x) ** 2 + v**2
        dry = LAW.coulomb * omega + LAW.hysteretic * square**0.5 + LAW.quadratic / omega * square
        return [v, -(omega**2) * x - 2 * LAW.viscous * v - np.pi / 2 * side * dry]

    def turns(_: float, state: nulls.Array, side: float) -> float:
        return side * state[1]

    turns.terminal, turns.direction = True, -1  # type: ignore[attr-defined]
    start, state, side = 0.0, [0.25, 0.0], -1.0
    for _ in range(30):
        half = solve_ivp(
            slope,
            (start, start + 1),
            state,
            "DOP853",
            events=turns,
            dense_output=True,
            args=(side,),
            rtol=1e-12,
            atol=1e-15,
        )
        times = np.linspace(start, half.t[-1], 7)
        found, _ = nulls.motion(LAW, 0.25, times)
        assert found == pytest.approx(half.sol(times)[0], abs=1e-10)
        start, state, side = half.t[-1], [half.y[0, -1], 0.0], -side


def test_without_loss_the_motion_is_a_cosine() -> None:
    time_s = np.linspace(0, 50, 999)
    angle, level = nulls.motion(nulls.Law(0.7, 0, 0, 0, 0), 0.2, time_s)
    assert angle == pytest.approx(0.2 * np.cos(2 * np.pi * 0.7 * time_s), abs=1e-11)
    assert level == pytest.approx(0.2)


def test_the_level_falls_as_eq_13_says_where_the_loss_is_small() -> None:
    law = nulls.Law(1.0, quadratic=2e-3, viscous=2e-4, hysteretic=1e-4, coulomb=1e-5)
    _, level = nulls.motion(law, 0.2, np.array([0.0, 100.0]))
    fall = solve_ivp(
        lambda _, y: -(2e-3 * y**2 + 3e-4 * y + 1e-5), (0, 100), [0.2], rtol=1e-10, atol=1e-12
    )
    assert level[1] == pytest.approx(fall.y[0, -1], rel=1e-5)


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
