"""How often what docs/found.md tells of public recordings is claimed where it is not so.

    python -m benchmarks.found [--decoys N] [--effect ID] [--recordings]

Facts of four kinds: an encoder loses counts, a clock loses time or slips by whole samples, a
tracked mark wanders. Decoys look alike: steps of the time that are no whole samples, several knocks
or offsets; a level that steps by any amount (0.6 to 2.6 counts) at a quarter of the reversals, or
wanders as a random walk, of encoders that are read at each edge, or at fixed times; a knock, an
offset, a clock that wanders; errors of both coordinates of a mark that have nothing to do with
each other, a camera that looks obliquely and a pivot that is misplaced, a string that stretches.
A claim is made where the test that uses no model, and the diagnosis, both find it: the former
first, since it costs little. True ones are made too, a third as many, so that a small rate says
something. `--recordings` prints the tests without a model for the public recordings.
"""

from __future__ import annotations

import argparse
import math
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

import pendpipe as pp
from benchmarks import journal
from benchmarks.known_physics import RECORDINGS
from benchmarks.null_families import wilson
from pendpipe.analysis.free_decay import measure_recording
from pendpipe.analysis.turning_points.measure import prepare
from pendpipe.diagnosis.forensics import corrections
from pendpipe.diagnosis.result import Confirmation
from pendpipe.recording import Recording

Array = NDArray[np.float64]
LASTS_S: Final = 120.0
CONFIRMED: Final = 0.01
PROBABLE: Final = 0.5
SOURCES: Final = ("pendpipe.diagnosis.run", "benchmarks/found.py")


class Swing:
    """A pendulum under sin x with viscous damping, by scipy's integrator."""

    def __init__(self, random: np.random.Generator) -> None:
        self.random = random
        self.omega = random.uniform(4.0, 7.0)
        self.loss, self.start = random.uniform(0.002, 0.012), random.uniform(0.4, 0.9)
        self.time_s = np.arange(0.0, LASTS_S + 2.0, 1e-3)
        self.angle = self.from_state(self.start, 0.0)

    @property
    def period_s(self) -> float:
        """At small amplitudes."""
        return 2.0 * math.pi / self.omega

    def from_state(self, angle: float, velocity: float, since_s: float = 0.0) -> Array:
        """The motion on the grid from a state at some instant; before it, zero."""
        law = lambda _, y: [y[1], -(self.omega**2) * math.sin(y[0]) - 2.0 * self.loss * y[1]]
        late = self.time_s[self.time_s >= since_s]
        lasts = (float(late[0]), float(late[-1]))
        found = solve_ivp(
            law, lasts, [angle, velocity], "DOP853", t_eval=late, rtol=1e-8, atol=1e-10
        ).y[0]
        return np.concatenate([np.zeros(len(self.time_s) - len(late)), found])

    def knocked(self, at_s: float) -> Array:
        """The motion with a blow at an instant, of a tenth to a half of the largest velocity."""
        row = int(np.searchsorted(self.time_s, at_s))
        velocity = (self.angle[row + 1] - self.angle[row - 1]) / 2e-3
        blow = self.random.choice([-1.0, 1.0]) * self.random.uniform(0.1, 0.5)
        after = self.from_state(
            self.angle[row], velocity + blow * self.omega * self.start, self.time_s[row]
        )
        return np.where(np.arange(len(after)) < row, self.angle, after)

    def edges(self, level: Array, count: float) -> Recording:
        """An encoder with a row at each edge that it passes, on a shaft that slips by `level`."""
        angle = self.angle + level
        steps = np.floor(angle / count).astype(np.int64)
        at = np.flatnonzero(np.diff(steps)) + 1
        edge = count * np.maximum(steps[at], steps[at - 1])
        late = (edge - angle[at - 1]) / (angle[at] - angle[at - 1])
        return Recording(self.time_s[at - 1] + 1e-3 * late, count * steps[at], "angle_rad")

    def fixed(self, level: Array, count: float) -> Recording:
        """An encoder that is read a hundred times a second."""
        rows = slice(0, None, 10)
        counts = np.round((self.angle + level)[rows] / count)
        return Recording(self.time_s[rows], count * counts, "angle_rad", resolution=count)

    def sampled(self, angle: Array, late_s: Array | float = 0.0) -> Recording:
        """Read two hundred times a second by a clock that is behind."""
        stamps = np.arange(0.0, LASTS_S, 5e-3)
        read = np.interp(stamps + late_s, self.time_s, angle)
        return Recording(
            stamps, read + 2e-4 * self.random.standard_normal(len(stamps)), "angle_rad"
        )


class Kind(NamedTuple):
    """A kind of fact: its effect, the test without a model, and who makes true ones and decoys.

    Where nothing happens at one instant, the diagnosis comes first, and the test where it says.
    """

    effect: str
    test: Callable[[Recording, float, float], Confirmation | None]
    makers: dict[str, Callable[[Swing, float], Recording]]
    nowhere: tuple[str, ...] = ()


def walk(count: int, end: float, random: np.random.Generator) -> Array:
    """A random walk with this standard deviation at its end."""
    return np.asarray(np.cumsum(random.standard_normal(count)) * end / math.sqrt(count))


# ---------------------------------------------------------------- lost counts


def counting(*, whole: bool, wanders: bool, at_edges: bool) -> Callable[[Swing, float], Recording]:
    """An encoder whose level steps at a quarter of the reversals, or wanders."""

    def make(swing: Swing, _: float) -> Recording:
        random, size = swing.random, len(swing.time_s)
        count = random.uniform(2e-3, 1.1e-2)
        turns = np.flatnonzero(np.diff(np.sign(np.diff(swing.angle))))[3:-3] + 30
        number = len(turns) // 4
        steps = np.ones(number) if whole else random.uniform(0.6, 2.6, number)
        steps = steps * random.choice([-1.0, 1.0], number)
        chosen = random.choice(turns, number, replace=False)
        level = np.cumsum(np.bincount(chosen, steps, size))
        if wanders:
            level = walk(size, 3.0, random)
        return swing.edges(count * level, count) if at_edges else swing.fixed(count * level, count)

    return make


def level_test(recording: Recording, _: float, __: float) -> Confirmation | None:
    """Whether steps of the level between half swings are whole counts."""
    samples = prepare(recording, "found")
    count = corrections.count_of(samples)
    return corrections.steps_of_the_level(samples, count) if count else None


COUNTS: Final = Kind(
    "count-slips",
    level_test,
    {
        "whole counts, read at each edge": counting(whole=True, wanders=False, at_edges=True),
        "whole counts, read at fixed times": counting(whole=True, wanders=False, at_edges=False),
        "decoy: any size, at each edge": counting(whole=False, wanders=False, at_edges=True),
        "decoy: any size, at fixed times": counting(whole=False, wanders=False, at_edges=False),
        "decoy: random walk, at each edge": counting(whole=False, wanders=True, at_edges=True),
        "decoy: random walk, at fixed times": counting(whole=False, wanders=True, at_edges=False),
    },
)


# ---------------------------------------------------------------- lost time


def jumped(swing: Swing, at_s: float) -> Recording:
    """A clock that loses 10 to 50 ms."""
    stamps = np.arange(0.0, LASTS_S, 5e-3)
    return swing.sampled(swing.angle, (stamps >= at_s) * swing.random.integers(2, 11) * 5e-3)


def offset(swing: Swing, at_s: float) -> Recording:
    """A reading that is off from an instant on."""
    size = swing.random.choice([-1.0, 1.0]) * swing.random.uniform(0.01, 0.05)
    return swing.sampled(swing.angle + size * (swing.time_s >= at_s))


def drifting(swing: Swing, _: float) -> Recording:
    """A clock that wanders, read fifty times a second."""
    late = 0.5 + walk(int(LASTS_S / 5e-3), 0.02, swing.random)
    whole = swing.sampled(swing.angle, late)
    return Recording(whole.time_s[::4], whole.values[::4], "angle_rad")


def time_test(recording: Recording, at_s: float, period_s: float) -> Confirmation:
    """Whether angle and velocity step by one and the same time."""
    return corrections.loss_confirmed(prepare(recording, "found"), at_s, period_s)


TIME: Final = Kind(
    "dropped-samples",
    time_test,
    {
        "10 to 50 ms lost": jumped,
        "decoy: a knock": lambda swing, at_s: swing.sampled(swing.knocked(at_s)),
        "decoy: an offset": offset,
        "decoy: a clock that wanders": drifting,
    },
    ("decoy: a clock that wanders",),
)


# ---------------------------------------------------------------- slips of a clock

STAMP_S: Final = 5e-3


def slipping(*, whole: bool) -> Callable[[Swing, float], Recording]:
    """A clock that misses or repeats samples 12 to 30 times, or jumps by parts of them."""

    def make(swing: Swing, _: float) -> Recording:
        random, size = swing.random, int(LASTS_S / STAMP_S)
        number = int(random.integers(12, 31))
        steps = np.ones(number) if whole else random.uniform(0.6, 2.4, number)
        rows = random.choice(np.arange(400, size - 400), number, replace=False)
        late = np.cumsum(np.bincount(rows, steps * random.choice([-1.0, 1.0], number), size))
        return swing.sampled(swing.angle, 0.5 + STAMP_S * late)

    return make


def shaken(swing: Swing, _: float) -> Recording:
    """A reading that is off by another amount from each of a dozen instants on."""
    rows = swing.random.choice(len(swing.time_s), 12, replace=False)
    steps = swing.random.choice([-1.0, 1.0], 12) * swing.random.uniform(0.005, 0.03, 12)
    return swing.sampled(swing.angle + np.cumsum(np.bincount(rows, steps, len(swing.time_s))))


SLIPS: Final = {
    "whole samples missed or repeated": slipping(whole=True),
    "decoy: parts of samples": slipping(whole=False),
    "decoy: a dozen offsets": shaken,
    "decoy: a clock that wanders": drifting,
}
CLOCK: Final = Kind("clock-slips", time_test, SLIPS, tuple(SLIPS))


def repeated_s(recording: Recording, period_s: float) -> Array:
    """When a sample is repeated: instants where the time steps by -1, by polynomials alone.

    A quintic with a step of the time in its middle, over a tenth of a period on each side, row by
    row; what stands out by twelve standard deviations counts, the largest of its neighbourhood.
    """
    values, side = (
        recording.values,
        int(0.09 * period_s / float(np.median(np.diff(recording.time_s)))),
    )
    at = (np.arange(2 * side) - side + 0.5) / side
    basis = np.linalg.qr(np.vander(at, 6))[0]
    windows = np.lib.stride_tricks.sliding_window_view(values, 2 * side)
    steps, errors = (np.zeros(len(windows)) for _ in range(2))
    for row, window in enumerate(windows):
        smooth = basis @ (basis.T @ window)
        change = np.gradient(smooth) * (at > 0.0)
        change -= basis @ (basis.T @ change)
        square = float(change @ change) + 1e-300
        steps[row] = float(change @ (window - smooth)) / square
        left = window - smooth - steps[row] * change
        errors[row] = math.sqrt(float(left @ left) / (2 * side - 7) / square)
    clear = np.abs(steps) / errors
    top = np.array([clear[max(row - side, 0) : row + side].max() for row in range(len(clear))])
    found = np.flatnonzero((clear == top) & (clear > 12.0) & (np.abs(steps + 1.0) < 0.15))
    return np.asarray(recording.time_s[found + side])


def regularity(name: str) -> str:
    """Whether samples are repeated at regular intervals, as where two clocks beat."""
    path = Path(RECORDINGS / name)
    points, part = measure_recording(pp.read(path).as_motion(), path)
    when = repeated_s(part, 1.0 / points.apparent_frequency_hz)
    number = np.round((when - when[0]) / np.median(np.diff(when)))
    (every, _), rest, *_ = np.polyfit(number, when, 1, full=True)
    scatter = math.sqrt(float(rest[0]) / max(len(when) - 2, 1))
    instants = ", ".join(f"{each:.3f}" for each in when)
    return (
        f"{path.stem}: a sample is repeated at {instants} s: every {every:.4f} s, within"
        f" {1e3 * scatter:.1f} ms"
    )


# ---------------------------------------------------------------- wander of a mark


def video(
    swing: Swing, along: Array, across: Array, *, seen: Callable[[Array, Array], Any] | None = None
) -> Recording:
    """Thirty frames a second of x and y, with errors along the string and across it."""
    rows = np.linspace(0, len(swing.time_s) - 1, len(along)).astype(np.intp)
    angle, radius = swing.angle[rows] + across, 1.0 + along
    x, y = radius * np.sin(angle), -radius * np.cos(angle)
    if seen is not None:
        x, y = seen(x, y)
    distance = np.hypot(x, y)
    return Recording(
        swing.time_s[rows],
        np.arctan2(x, -y),
        "angle_rad",
        radius_excess=distance / np.median(distance) - 1.0,
    )


def errors(swing: Swing) -> Array:
    """White and slow errors of two coordinates that have nothing to do with each other."""
    count = 30 * int(LASTS_S)
    white = swing.random.standard_normal((2, count))
    slow = np.array(
        [np.convolve(each, np.exp(-np.arange(90) / 20.0), "same") for each in white[::-1]]
    )
    return np.asarray(3e-4 * swing.random.standard_normal((2, count)) + 2e-4 * slow)


def wandering(swing: Swing, _: float) -> Recording:
    """A mark that wanders along one line."""
    along, across = errors(swing)
    kappa = swing.random.choice([-1.0, 1.0]) * swing.random.uniform(0.4, 2.0)
    return video(swing, along, 0.5 * across + kappa * along)


def oblique(swing: Swing, _: float) -> Recording:
    """A camera that looks obliquely, and a pivot that is misplaced."""
    flat, aside = swing.random.uniform(0.93, 1.0), swing.random.uniform(-0.02, 0.02, 2)
    return video(swing, *errors(swing), seen=lambda x, y: (flat * x + aside[0], y + aside[1]))


def stretched(swing: Swing, _: float) -> Recording:
    """A string that stretches as the tension asks."""
    along, across = errors(swing)
    rows = np.linspace(0, len(swing.time_s) - 1, len(along)).astype(np.intp)
    velocity = np.gradient(swing.angle, swing.time_s)[rows]
    tension = np.cos(swing.angle[rows]) + (velocity / swing.omega) ** 2
    return video(swing, along + swing.random.uniform(1e-3, 1e-2) * tension, across)


def mark_test(recording: Recording, _: float, period_s: float) -> Confirmation | None:
    """Whether angle and distance scatter together."""
    samples = prepare(recording, "found")
    along = corrections.wander(samples)
    if along is None:
        return None
    return corrections.wander_confirmed(samples, along, corrections.rows_of(samples, period_s))


MARK: Final = Kind(
    "tracking-noise",
    mark_test,
    {
        "a mark that wanders along a line": wandering,
        "decoy: coordinates with errors of their own": lambda swing, _: video(
            swing, *errors(swing)
        ),
        "decoy: an oblique camera, a misplaced pivot": oblique,
        "decoy: a string that stretches": stretched,
    },
)
KINDS: Final = (COUNTS, TIME, CLOCK, MARK)


def is_claimed(kind: Kind, name: str, number: int) -> bool:
    """Make a recording, and ask the test without a model, then the diagnosis."""
    random = np.random.default_rng([zlib.crc32(name.encode()), number])
    swing, at_s = Swing(random), random.uniform(0.2, 0.8) * LASTS_S
    recording = kind.makers[name](swing, at_s)
    if name not in kind.nowhere:
        sure = kind.test(recording, at_s, swing.period_s)
        if sure is None or sure.p_value >= CONFIRMED:
            return False
    effects = pp.diagnose(recording).to_dict().get("effects", [])
    return any(
        each["id"] == kind.effect
        and each["probability"] >= PROBABLE
        and each.get("confirmed", {"p_value": 1.0})["p_value"] < CONFIRMED
        for each in effects
    )


def table(number: int, effect: str) -> Iterator[str]:
    """A row for each family, and the decoys of each kind together; what is done is kept."""
    done: dict[str, int] = journal.read("found", {}, SOURCES)
    yield "| effect | made | claimed |"
    yield "|---|---|---|"
    for kind in [kind for kind in KINDS if effect in ("", kind.effect)]:
        false, made = 0, 0
        for name in kind.makers:
            decoy = name.startswith("decoy")
            asked = number if decoy else math.ceil(number / 3)
            key = f"{kind.effect}, {name}, {asked}"
            if key not in done:
                done[key] = sum(is_claimed(kind, name, each) for each in range(asked))
                journal.keep("found", done, SOURCES)
            claimed = done[key]
            yield f"| {kind.effect} | {name} | {wilson(claimed, asked)} |"
            if decoy:
                false, made = false + claimed, made + asked
        yield f"| {kind.effect} | **all decoys** | {wilson(false, made)} |"


def main() -> None:
    """Print the rates, and the tests of the public recordings if asked for."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--decoys", type=int, default=75, help="of each family")
    parser.add_argument("--effect", default="", help="only this one, and no page")
    parser.add_argument("--recordings", action="store_true")
    asked = parser.parse_args()
    if asked.recordings:
        print_recordings()
        return
    lines = []
    for line in table(asked.decoys, asked.effect):
        print(line, flush=True)
        lines.append(line)
    if asked.effect:
        return
    made = f"\n\nMade by commit {journal.commit()}."
    journal.put("found.md", "decoys", "\n".join(lines) + made)


def print_recordings() -> None:
    """Print what the tests without a model say of the public recordings."""
    asked: list[tuple[str, Kind, float]] = [
        *((f"yfysiks-encoder/data2_{n}.csv", COUNTS, 0.0) for n in (12, 14, 20, 22)),
        ("profcarter-adip/adip_pend_data.mat", TIME, 115.56),
        *((f"jiarui-phy180/{n}.txt", MARK, 0.0) for n in ("8050", "8053", "8055", "AAAtAmp3")),
    ]
    for name, kind, at_s in asked:
        path = Path(RECORDINGS / name)
        points, part = measure_recording(pp.read(path).as_motion(), path)
        found = kind.test(part, at_s, 1.0 / points.apparent_frequency_hz)
        said = f"{found.summary}: p = {found.p_value:.2g}" if found else "not tested"
        print(f"{path.stem}: {kind.effect}: {said}", flush=True)
    for name in ("adip", "cdip"):
        file = f"profcarter-adip/{name}_pend_data.mat"
        effects = pp.diagnose(RECORDINGS / file).to_dict()["effects"]
        for each in effects:
            if each["id"] == "clock-slips":
                sure = each["confirmed"]
                print(f"{name}: clock-slips: {sure['summary']}: p = {sure['p_value']:.2g}")
        print(regularity(file), flush=True)


if __name__ == "__main__":
    main()
