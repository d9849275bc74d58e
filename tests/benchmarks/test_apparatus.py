"""The apparatus obeys the laws of its books, and its truths are what the files hold."""

from __future__ import annotations

import numpy as np
import pytest
from benchmarks.apparatus import scores
from benchmarks.apparatus.causes import CATALOGUE, OUTSIDE
from benchmarks.apparatus.draw import _events, draw
from benchmarks.apparatus.motion import PARAMETERS, TIMES, Array, Law, P, T, integrate
from benchmarks.apparatus.world import Cause, Scene, evidence
from scipy.special import ellipk

OMEGA = 4.0
H = 2 * np.pi / OMEGA / 400


def swing(
    law: Law = Law.NONE, amplitude: float = 1.2, cycles: float = 20, **values: float
) -> tuple[Array, Array]:
    """States after a release, and the turning point before each."""
    n = int(400 * cycles)
    k, times = np.zeros(PARAMETERS), np.zeros((2 * n + 1, TIMES))
    k[P.OMEGA], k[P.SINE] = OMEGA, 1.0
    for name, value in values.items():
        k[P[name]] = value
    times[:, [T.STIFF, T.LOSS]] = 1.0
    return integrate(np.array([amplitude, 0, 0, 0, 0.0]), H, k, law, times, np.zeros(n + 1))


def scene(**other: object) -> Scene:
    """A rod with an encoder."""
    given = {
        "apparatus": "encoder",
        "frequency_hz": 0.7,
        "rates": (0.02, 0.004, 0.0, 1e-3),
        "amplitude": 0.6,
        "lead_s": 0.3,
        "offset": 0.0,
        "noise_rms": 1e-3,
        "memory": 0.0,
        "step": 0.0,
        "event_driven": False,
        "time_s": np.arange(3000) / 50,
    }
    return Scene(**(given | other))


CONSERVATIVE: dict[Law, tuple[float, float]] = {
    Law.NONE: (0.0, 0.0),
    Law.WINDING_STRING: (0.1, 0.0),
    Law.ROLLING_EDGE: (0.2, 0.0),
    Law.MAGNET_BELOW: (0.1, 0.4),
    Law.BUMPER: (0.5, 0.7),
    Law.ELASTIC: (1.0, 3.1),
    Law.SLOSHING: (0.02, 1.3),
    Law.COGGING: (0.3, 8.0),
    Law.VIBRATED: (0.2, 0.0),
}
"""Laws that lose nothing, with a size and a shape."""


def energy(law: Law, states: Array) -> Array:
    """Energy over the moment of inertia."""
    s, d = CONSERVATIVE[law]
    x, v, p, q, _ = states.T
    inertia, height = np.ones_like(x), -np.cos(x)
    if law is Law.WINDING_STRING:
        inertia, height = (1 + s * x) ** 2, s * np.sin(x) - (1 + s * x) * np.cos(x)
    elif law is Law.ROLLING_EDGE:
        inertia = 1 + 2 * s * (1 - np.cos(x))
    elif law is Law.MAGNET_BELOW:
        height -= s * d**2 / 3 * (1 + (x / d) ** 2) ** -1.5
    elif law is Law.BUMPER:
        height += s * np.maximum(0, x - d) ** 2 / 2
    elif law is Law.ELASTIC:
        inertia = (1 + p) ** 2
        height = p - (1 + p) * np.cos(x) + (q / OMEGA) ** 2 / 2 + (d * p) ** 2 / 2
    elif law is Law.SLOSHING:
        height += s * ((q / OMEGA) ** 2 + (d * p) ** 2) / 2 - s * x * p
    elif law is Law.COGGING:
        height -= s / d / OMEGA**2 * np.cos(d * x)
    elif law is Law.VIBRATED:
        height -= s * np.cos(2 * x) / 4
    return inertia * v**2 / 2 + OMEGA**2 * height


@pytest.mark.parametrize("law", CONSERVATIVE)
def test_laws_without_loss_keep_their_energy(law: Law) -> None:
    size, shape = CONSERVATIVE[law]
    states, _ = swing(law, SIZE=size, SHAPE=shape)
    # Runge and Kutta lose (omega h)^6/144 a step, of a mode at 3.1 omega 900 times as much; a
    # cushion's kink lies within a step.
    allowed = {Law.BUMPER: 1e-4, Law.ELASTIC: 1e-6}.get(law, 1e-7)
    assert np.ptp(energy(law, states)) < allowed * OMEGA**2


@pytest.mark.parametrize(
    ("law", "size", "shape"),
    [
        (Law.EDDY_PEAK, 0.05, 1.0),
        (Law.LOCAL_BRAKE, 0.05, 0.3),
        (Law.ONE_WAY, 0.05, 0.0),
        (Law.AGEING, 0.05, 0.2),
        (Law.BOUC_WEN, 0.02, 0.4),
        (Law.SQUEEZE_FILM, 0.01, 1.5),
    ],
)
def test_laws_with_loss_lose_energy_in_each_cycle(law: Law, size: float, shape: float) -> None:
    states, _ = swing(law, SIZE=size, SHAPE=shape)
    swings = np.abs(states[:8000, 0]).reshape(20, 400).max(axis=1)
    assert (np.diff(swings) < 0).all()


def test_a_large_swing_has_the_period_of_the_elliptic_integral() -> None:
    states, _ = swing(amplitude=2.6, cycles=10)
    crossings = np.flatnonzero(np.diff(np.sign(states[:, 0])) > 0)
    x, step = states[:, 0], H
    times = (crossings - x[crossings] / (x[crossings + 1] - x[crossings])) * step
    expected = 4 * ellipk(np.sin(1.3) ** 2) / OMEGA
    assert np.diff(times) == pytest.approx(expected, rel=1e-4)


def test_dry_friction_stops_the_pendulum_where_it_can_hold_it() -> None:
    c = 0.05
    states, _ = swing(amplitude=0.3, cycles=30, C=c, SINE=0.0)
    assert states[-500:, 1] == pytest.approx(0.0)
    assert abs(states[-1, 0]) <= np.pi / 2 * c / OMEGA


def test_a_tone_is_worth_its_power_over_that_of_the_noise() -> None:
    there = scene()
    cause = Cause("tone", CATALOGUE["tone-pickup"].draw(np.random.default_rng(2), there), 1e-3)
    (worth,) = evidence(there, [cause])
    expected = 3000 * (1e-3 * there.amplitude) ** 2 / 2 / there.noise_rms**2
    assert worth == pytest.approx(expected, rel=0.02)


@pytest.mark.parametrize("name", sorted(CATALOGUE.keys() | OUTSIDE.keys()))
def test_an_effect_is_absent_at_size_nought_and_changes_the_reading_otherwise(name: str) -> None:
    there = scene(step=2e-3)
    kind = (CATALOGUE | OUTSIDE)[name]
    apply = kind.draw(np.random.default_rng(4), there)
    plain, _ = there.reading([])
    without, _ = there.reading([Cause(name, apply, 0.0)])
    changed, _ = there.reading([Cause(name, apply, kind.size)])
    assert without == pytest.approx(plain, abs=1e-9)
    assert np.abs(changed - plain).max() > 1e-6


def test_a_row_is_written_where_the_count_changes() -> None:
    there = scene(step=5e-3, event_driven=True)
    columns = _events(np.random.default_rng(1), there, [])
    y, seen = there.reading([], time_s=columns["time_s"])
    assert set(np.abs(np.round(np.diff(columns["angle_rad"]) / 5e-3))) <= {0.0, 1.0}
    # An edge that is passed upwards gives the count above it, and downwards the count below.
    ahead = (columns["angle_rad"] - y) / 5e-3
    fast = np.abs(seen.v) > 0.3 * there.omega * np.abs(seen.turn)
    upwards, downwards = (ahead[fast & (side * seen.v > 0)] for side in (1, -1))
    assert upwards.mean() - downwards.mean() == pytest.approx(1.0, abs=0.05)
    assert max(upwards.std(), downwards.std()) < 0.1


def test_an_item_is_a_function_of_its_set_and_its_number(tmp_path) -> None:
    one, same, other = draw("a", 5), draw("a", 5), draw("b", 5)
    one.write(tmp_path / "one.csv")
    same.write(tmp_path / "same.csv")
    assert (tmp_path / "one.csv").read_bytes() == (tmp_path / "same.csv").read_bytes()
    assert one.present != other.present


def kept(effects: list[tuple[str, float, list[str]]], **truth: object) -> dict[str, object]:
    """An answer beside its truth."""
    plain = {"part": "one", "hidden": ["jitter"], "present": {"jitter": 200.0}, "outside": ""}
    plain |= {"near": [], "allowed": [], **truth}
    return {"truth": plain, "effects": effects, "verdict": "missing-physics"}


def test_a_class_that_holds_the_truth_is_right_whichever_of_its_names_leads() -> None:
    names = scores.catalogue()
    judged = scores.judge(kept([("glitches", 0.6, ["jitter"])]), names)
    assert judged["held"]
    assert not judged["false"]
    assert judged["leads"] is False
    wrong = scores.judge(kept([("glitches", 0.6, ["clipping"])]), names)
    assert (wrong["likely"], wrong["confident"]) == (["glitches"], [])


def test_confident_means_the_same_in_both_proofs() -> None:
    measures = pytest.importorskip("pendpipe_challenge.score")
    assert measures.CONFIDENT == scores.CONFIDENT
    names = scores.catalogue()
    at_limit, above = (
        scores.judge(kept([("glitches", chance, [])]), names)["confident"]
        for chance in (scores.CONFIDENT, scores.CONFIDENT + 1e-9)
    )
    assert (at_limit, above) == ([], ["glitches"])


def test_on_a_null_every_name_is_false_and_near_names_are_no_error_outside() -> None:
    names = scores.catalogue()
    null = kept([("second-mode", 0.3, [])], part="null", hidden=[], present={})
    assert scores.judge(null, names)["false"] == ["second-mode"]
    outside = kept(
        [("drag-form", 0.9, [])],
        part="outside",
        hidden=["wind"],
        present={},
        outside="wind",
        near=["drag-form"],
    )
    assert not scores.judge(outside, names)["likely"]
