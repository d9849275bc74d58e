"""The apparatus obeys the laws of its books, and its truths are what the files hold."""

import numpy as np
import pytest
from benchmarks.apparatus import scores
from benchmarks.apparatus.causes import CATALOGUE, OUTSIDE
from benchmarks.apparatus.draw import _events, draw
from benchmarks.apparatus.world import Cause, Scene, evidence
from scipy.interpolate import CubicSpline
from scipy.special import ellipk

from pendpipe.arrays import FloatArray
from pendpipe_challenge.motion import Motion
from pendpipe_challenge.torques import BOOK

OMEGA = 4.0
H = 2 * np.pi / OMEGA / 400


def swing(
    law: str = "", size: float = 0.0, shape: float = 1.0, *, cycles: float = 20, **other: float
) -> tuple[FloatArray, ...]:
    """Angle and rate after a release from 1.2 rad; the second coordinate and its rate."""
    book = {"book": float(BOOK.get(law, 0)), "book_size": size, "book_shape": shape}
    book |= {"book_shape_2": 0.0}
    amplitude = other.pop("amplitude", 1.2)
    motion = Motion({"omega": OMEGA, "sine": 1.0, **book, **other}, amplitude)
    track = motion.run(H * np.arange(int(400 * cycles) + 1))
    second = CubicSpline(track.time_s, track.second_rad)
    return track.angle_rad, track.rate_rad_s, track.second_rad, second(track.time_s, 1)


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


CONSERVATIVE: dict[str, tuple[float, float]] = {
    "": (0.0, 1.0),
    "winding-string": (0.1, 1.0),
    "rolling-edge": (0.2, 1.0),
    "magnet-below": (0.1, 0.4),
    "bumper": (0.5, 0.7),
    "elastic-string": (1.0, 3.1),
    "sloshing-bob": (0.02, 1.3),
    "cogging": (0.3, 8.0),
    "vibrated-pivot": (0.2, 1.0),
}
"""Laws that lose nothing, with a size and a shape."""


def energy(law: str, x: FloatArray, v: FloatArray, p: FloatArray, q: FloatArray) -> FloatArray:
    """Energy over the moment of inertia."""
    s, d = CONSERVATIVE[law]
    inertia = {
        "winding-string": (1 + s * x) ** 2,
        "rolling-edge": 1 + 2 * s * (1 - np.cos(x)),
        "elastic-string": (1 + p) ** 2,
    }.get(law, np.ones_like(x))
    height = {
        "winding-string": s * np.sin(x) - (1 + s * x) * np.cos(x),
        "magnet-below": -np.cos(x) - s * d**2 / 3 * (1 + (x / d) ** 2) ** -1.5,
        "bumper": -np.cos(x) + s * np.maximum(0, x - d) ** 2 / 2,
        "elastic-string": p - (1 + p) * np.cos(x) + (q / OMEGA) ** 2 / 2 + (d * p) ** 2 / 2,
        "sloshing-bob": -np.cos(x) + s * ((q / OMEGA) ** 2 + (d * p) ** 2) / 2 - s * x * p,
        "cogging": -np.cos(x) - s / d / OMEGA**2 * np.cos(d * x),
        "vibrated-pivot": -np.cos(x) - s * np.cos(2 * x) / 4,
    }.get(law, -np.cos(x))
    return np.asarray(inertia * v**2 / 2 + OMEGA**2 * height)


@pytest.mark.parametrize("law", CONSERVATIVE)
def test_laws_without_loss_keep_their_energy(law: str) -> None:
    found = energy(law, *swing(law, *CONSERVATIVE[law]))
    # A cushion's kink lies within a step; the second coordinate's rate is a spline's.
    allowed = {"bumper": 1e-4, "elastic-string": 1e-6}.get(law, 1e-7)
    assert np.ptp(found[5:-5]) < allowed * OMEGA**2


@pytest.mark.parametrize(
    ("law", "size", "shape"),
    [
        ("eddy-peak", 0.05, 1.0),
        ("local-brake", 0.05, 0.3),
        ("one-way-drag", 0.05, 1.0),
        ("ageing-friction", 0.05, 0.2),
        ("cable-hysteresis", 0.02, 0.4),
        ("squeeze-film", 0.01, 1.5),
    ],
)
def test_laws_with_loss_lose_energy_in_each_cycle(law: str, size: float, shape: float) -> None:
    swings = np.abs(swing(law, size, shape)[0][:8000]).reshape(20, 400).max(axis=1)
    assert (np.diff(swings) < 0).all()


def test_a_large_swing_has_the_period_of_the_elliptic_integral() -> None:
    x, v, *_ = swing(amplitude=2.6, cycles=10)
    crossings = np.flatnonzero(np.diff(np.sign(x)) > 0)
    times = crossings * H - x[crossings] / v[crossings]
    expected = 4 * ellipk(np.sin(1.3) ** 2) / OMEGA
    assert np.diff(times) == pytest.approx(expected, rel=1e-4)


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
