"""The peers of the diagnosis judge: what is plain they find, and some shout at nothing."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from benchmarks import peers_diagnosis as peers
from pendpipe_challenge import peers as judges
from pendpipe_challenge.answers import read_items
from pendpipe_challenge.motion import Motion
from pendpipe_challenge.recordings import intervals_s, plain_text

from .test_scores import answer, opened, truth

NOISE = 1e-4


def swung(more: str = "", size: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """A free decay of Eq. 8 with white noise, and with one torque more."""
    losses = {"omega": 5.6, "gamma": 0.009, "hysteretic": 0.004, "quadratic": 2e-3, "coulomb": 1e-3}
    time = np.arange(2500) / 20.0
    motion = Motion({**losses, **({more: size} if more else {})}, 0.15)
    noise = NOISE * np.random.default_rng(3).standard_normal(len(time))
    return time, motion.run(time).angle_rad + noise


def test_eq_8_alone_leaves_white_noise() -> None:
    base = peers.fit_eq8(*swung(), NOISE)
    assert np.mean((base.residual_rad / NOISE) ** 2) == pytest.approx(1.0, abs=0.1)
    assert not peers.by_whiteness(base).missing
    assert base.omega == pytest.approx(5.6, rel=1e-4)


def test_a_curved_sensor_is_named_by_both_criteria() -> None:
    time, angle = swung()
    base = peers.fit_eq8(time, angle + 0.03 * angle**2, NOISE)
    assert peers.by_whiteness(base).missing
    for criterion in ("aic", "bic"):
        for white in (True, False):
            found = peers.by_criterion(base, NOISE, white=white, criterion=criterion)
            assert found == peers.Judgement(missing=True, name="sensor-quadratic")


def test_a_hardening_spring_shows_to_the_criteria() -> None:
    base = peers.fit_eq8(*swung("cubic", 0.3), NOISE)
    assert peers.by_criterion(base, NOISE, white=True, criterion="bic").name == "cubic-stiffness"


def test_sindy_names_a_cubic_spring_and_shouts_at_nothing_too() -> None:
    pytest.importorskip("pysindy", reason="pysindy is not installed (the bench extra)")
    cubic = peers.Judgement(missing=True, name="cubic-stiffness")
    assert peers.by_sindy(*swung("cubic", 3.0), 5.6) == cubic
    # What the proof compares with: derivatives of noise have no place for small terms.
    assert peers.by_sindy(*swung(), 5.6).missing


def kept_set(folder: Path) -> Any:
    """Two nulls, a cubic spring, and a single that only a viscous baseline lacks."""
    cubic, viscous = truth("single", "cubic-stiffness"), truth("single", "quadratic-drag")
    viscous["baseline"] = "viscous"
    content = opened(*[(made, answer()) for made in (truth("null"), truth("null"), cubic, viscous)])
    (folder / "recordings").mkdir()
    for name, entry in content["items"].items():
        known = entry["truth"]["nuisances"]
        known |= {"judged_until_s": 100.0, "frequency_hz": 5.6 / 2.0 / np.pi}
        more = ("cubic", 3.0) if entry["truth"]["effects"] else ()
        text = plain_text(*swung(*more), {"volts_per_radian": "1"})
        (folder / "recordings" / f"{name}.csv").write_text(text)
    return content


def test_the_peer_judges_the_first_nulls_and_singles_of_a_set(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("pysindy", reason="pysindy is not installed (the bench extra)")
    items = read_items(kept_set(tmp_path))
    found = judges.sindy_scores(items, tmp_path)
    assert (found["false_alarms"]["of"], found["detected"]["of"]) == (2, 1)
    assert found["top1"]["hits"] == 1
    monkeypatch.setattr(judges, "FIRST", 1)
    assert judges.sindy_scores(items, tmp_path)["false_alarms"]["of"] == 1
    monkeypatch.setattr(judges, "PATIENCE_S", -1.0)
    assert judges.sindy_scores(items, tmp_path)["false_alarms"]["of"] == 0


def test_a_peer_that_is_not_installed_is_told_of(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(importlib.util, "find_spec", lambda _: None)
    assert "pendpipe[bench]" in judges.sindy_scores([], tmp_path)["install"]


def test_the_sampling_is_read_off_the_recordings(tmp_path: Path) -> None:
    content = kept_set(tmp_path)
    found = intervals_s(tmp_path, [*content["items"], "item-9"])
    assert found == pytest.approx(dict.fromkeys(content["items"], 0.05))
