"""The peers of the diagnosis judge: what is plain they find, and some shout at nothing."""

from __future__ import annotations

import numpy as np
import pytest
from benchmarks import peers_diagnosis as peers

from pendpipe.challenge.motion import Motion

NOISE = 1e-4


def swung(more: str = "", size: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """A free decay of Eq. 8 with white noise, and with one torque more."""
    losses = {"omega": 5.6, "gamma": 0.009, "hysteretic": 0.004, "quadratic": 2e-3,
              "coulomb": 1e-3}  # fmt: skip
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
