"""A guess never makes green, and what no pendulum gives is asked about."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import pendpipe as pp
from pendpipe.arrays import FloatArray
from pendpipe.facts import KINDS, Fact

from ..recordings import white

TIME = np.arange(3000) / 50.0
RECORDING = pp.Recording(
    time_s=TIME, displacement_m=0.1 * np.exp(-0.02 * TIME) * np.cos(2 * np.pi * TIME / 1.3) + 1e-7
)


def amplitudes(path: Path, head: str, at: FloatArray, sizes: FloatArray) -> Path:
    rows = "".join(f"{t:.6g},{size:.4f}\n" for t, size in zip(at, sizes, strict=True))
    path.write_text(f"{head}\n{rows}")
    return path


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("how", ["stated", "shown", "guessed"])
def test_only_a_guess_that_changes_an_answer_takes_its_green(kind: str, how: str) -> None:
    rng = np.random.default_rng(1)
    values = RECORDING.values + 1e-4 * rng.standard_normal(len(TIME))
    recording = replace(RECORDING, values=values, facts=(Fact(kind, "x", how, "it is x"),))  # type: ignore[arg-type]
    fit = pp.fit(recording)
    doubted = how == "guessed" and bool(KINDS[kind].changes)
    assert fit.light == ("amber" if doubted else "green")
    assert (f"it is x ({KINDS[kind].option})" in fit.light_reason) == doubted
    assert ("period" in fit.quotable) == ("period" not in KINDS[kind].changes or how != "guessed")


@pytest.mark.parametrize("apart_s", [0.5, 2.0, 8.0])
def test_amplitudes_without_a_unit_of_time_are_in_seconds(tmp_path: Path, apart_s: float) -> None:
    """A list shows no period: its steps are a swing apart or more."""
    at = apart_s * np.arange(310)
    sizes = np.exp(-at / (64.0 * apart_s)) * (
        1.0 + 5e-3 * np.random.default_rng(2).standard_normal(310)
    )
    fit = pp.fit(amplitudes(tmp_path / "a.csv", "peak_time,peak", at, sizes), period=apart_s)
    assert fit["Q"].value == pytest.approx(64.0 * np.pi, rel=0.02)
    assert fit.light == "green"


@pytest.mark.parametrize(
    "name", ["Number of swings", "oscillations", "n (cycles)", "Schwingung Nr."]
)
def test_a_number_of_swings_is_no_time(tmp_path: Path, name: str) -> None:
    number = np.arange(0.0, 160.0, 10.0)
    sizes = 15.1 * np.exp(-0.012 * number)
    path = amplitudes(tmp_path / "a.csv", f"{name},Amplitude (cm)", number, sizes)
    assert pp.fit(path, period=1.3)["Q"].value == pytest.approx(np.pi / 0.012, rel=0.02)
    with pytest.raises(pp.InputError, match=r"counts swings.*--period"):
        pp.fit(path)


@pytest.mark.parametrize("per_cycle", [2.0005, 1.9996, 2.002])
def test_two_readings_a_cycle_are_never_green(tmp_path: Path, per_cycle: float) -> None:
    n = np.arange(400)
    x = np.exp(-0.003 * n) * np.cos(2.0 * np.pi * n / per_cycle + 0.3)
    path = amplitudes(tmp_path / "a.csv", "time (s),theta (rad)", 0.5 * n, x)
    assert pp.fit(path, period=1.0).light != "green"


@pytest.mark.parametrize(
    ("given", "said"),
    [({"length_m": 42.0}, "length in m"), ({"length_m": 0.42}, None), ({"gravity": 9.81}, None)],
)
def test_a_length_in_the_wrong_unit_is_asked_about(given: dict[str, float], said: str) -> None:
    angle = 0.1 * np.exp(-0.02 * TIME) * np.cos(2 * np.pi * TIME / 1.3) + white(1, len(TIME), 1e-4)
    fit = pp.fit(pp.Recording(time_s=TIME, angle_rad=angle), restoring="linear", **given)  # type: ignore[arg-type]
    assert fit.light == ("amber" if said else "green")
    assert (said or "green") in (fit.light_reason if said else fit.light)
