"""How often lost counts and clock slips are claimed where there are none.

    python -m benchmarks.found [--decoys N] [--recordings]

Decoys are made to look alike: an encoder whose level steps after reversals as often as that of a
real one, but by any amount (0.6 to 2.6 counts), or wanders as a random walk; a clock that slips by
any part of a sample, or whose time wanders. A claim is a p-value of whole numbers below 1e-3; of
counts, the second test, which does not use the model, must lie below 0.01 as well. As many true
ones are made, so that a small rate says something. `--recordings` prints the second test for the
public recordings of encoders that write a row at each count.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from benchmarks.known_physics import RECORDINGS
from benchmarks.null_families import wilson
from pendpipe.analysis.turning_points.samples import Samples, prepare
from pendpipe.diagnosis.data import Data
from pendpipe.diagnosis.forensics import slips
from pendpipe.diagnosis.forensics.finding import Finding
from pendpipe.diagnosis.noise import white_noise
from pendpipe.diagnosis.refine import refine
from pendpipe.effects.catalogue.restoring import circular_error
from pendpipe.effects.model import Model

Array = NDArray[np.float64]
LASTS_S: Final = 60.0
COUNT: Final = 2.0 * math.pi / 600.0
RATE_HZ: Final = 60.0
STEPS: Final = 16
CLAIMED, CONFIRMED = 1e-3, 0.01


class Swing:
    """A pendulum under sin x with viscous damping, by scipy's integrator."""

    def __init__(self, random: np.random.Generator) -> None:
        self.omega = random.uniform(4.0, 7.0)
        self.loss, self.start = random.uniform(0.002, 0.012), random.uniform(0.4, 0.9)
        self.time_s = np.arange(0.0, LASTS_S + 2.0, 1e-3)
        law = lambda _, y: [y[1], -(self.omega**2) * math.sin(y[0]) - 2.0 * self.loss * y[1]]
        lasts = (0.0, float(self.time_s[-1]))
        start = [self.start, 0.0]
        self.angle: Array = solve_ivp(
            law, lasts, start, "DOP853", t_eval=self.time_s, rtol=1e-8, atol=1e-10
        ).y[0]

    def encoder(self, level: Array) -> Samples:
        """Read at each edge that it passes, from a level that changes."""
        edges = np.floor(self.angle / COUNT).astype(np.int64)
        at = np.flatnonzero(np.diff(edges)) + 1
        angle = COUNT * np.maximum(edges[at], edges[at - 1])
        late = (angle - self.angle[at - 1]) / (self.angle[at] - self.angle[at - 1])
        return Samples(
            self.time_s[at - 1] + 1e-3 * late,
            angle + level[at],
            "rad",
            None,
            0.05 * COUNT,
            counts=True,
        )

    def sampled(self, late_s: Array, random: np.random.Generator) -> Samples:
        """Read by a clock that is ahead of its stamps."""
        stamps = np.arange(len(late_s)) / RATE_HZ + 1.0
        angle = np.interp(stamps + late_s, self.time_s, self.angle)
        noise = 1e-4 * random.standard_normal(len(stamps))
        return Samples(stamps, angle + noise, "rad", None, 1e-4)

    def found(self, name: str, samples: Samples) -> Finding:
        """Fit sin x from the truth, and look for slips."""
        time = samples.time_s
        data = Data(
            time,
            samples.values,
            float(np.median(np.diff(time))),
            uniform=not samples.counts,
            weight=np.ones(len(time)),
            time_noise=samples.counts,
            noise_rms=samples.noise_rms,
        )
        model = Model(time, data.interval_s, (circular_error,), order=20)
        start = np.array([0.0, self.loss, 0.0, 0.5, self.omega, self.start, 0.0, 0.0, 1.0])
        fit = refine(model, data, white_noise(data, 2e-4), start)
        return slips.find(name, data, fit, samples)[1]


def sizes(random: np.random.Generator, *, whole: bool) -> Array:
    """Steps of either sign: by one, or by any amount."""
    size = np.ones(STEPS) if whole else random.uniform(0.6, 2.6, STEPS)
    return np.asarray(size * random.choice([-1.0, 1.0], STEPS))


def steps_at(rows: Any, count: int, size: Array, random: np.random.Generator) -> Array:
    """A staircase at some of the rows."""
    chosen = random.choice(rows, len(size), replace=False)
    return np.asarray(np.cumsum(np.bincount(chosen, size, count)))


def walk(count: int, end: float, random: np.random.Generator) -> Array:
    """A random walk with this standard deviation at its end."""
    return np.asarray(np.cumsum(random.standard_normal(count)) * end / math.sqrt(count))


def lost_counts(random: np.random.Generator, kind: str) -> Finding:
    """Lost counts after reversals, or a decoy of them."""
    swing = Swing(random)
    count = len(swing.time_s)
    turns = np.flatnonzero(np.diff(np.sign(np.diff(swing.angle))))[3:-3] + 30
    level = (
        walk(count, 3.0, random)
        if kind == "wander"
        else steps_at(turns, count, sizes(random, whole=kind == "true"), random)
    )
    return swing.found("count-slips", swing.encoder(COUNT * level))


def clock_slips(random: np.random.Generator, kind: str) -> Finding:
    """A clock that slips, or a decoy of it."""
    swing, count = Swing(random), int((LASTS_S - 2.0) * RATE_HZ)
    late = (
        walk(count, 3.0, random)
        if kind == "wander"
        else steps_at(range(200, count - 200), count, sizes(random, whole=kind == "true"), random)
    )
    return swing.found("clock-slips", swing.sampled(late / RATE_HZ, random))


MAKERS: Final[dict[str, Callable[[np.random.Generator, str], Finding]]] = {
    "lost counts": lost_counts,
    "clock slips": clock_slips,
}
KINDS: Final = {"true": "whole steps", "any size": "steps of any size", "wander": "random walk"}


def is_claimed(finding: Finding) -> bool:
    """Whether a finding would be told as a fact."""
    sure = finding.identifier != "count-slips" or (
        finding.confirmed is not None and finding.confirmed.p_value < CONFIRMED
    )
    return finding.p_value < CLAIMED and sure


def main() -> None:
    """Print the rates, and the second test of the recordings if asked for."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--decoys", type=int, default=40, help="of each kind")
    parser.add_argument("--recordings", action="store_true")
    asked = parser.parse_args()
    print("| what | made | claimed |\n|---|---|---|")
    for name, make in MAKERS.items():
        for kind, words in KINDS.items():
            claimed = sum(
                is_claimed(make(np.random.default_rng([len(name), len(kind), number]), kind))
                for number in range(asked.decoys)
            )
            print(f"| {name} | {words} | {wilson(claimed, asked.decoys)} |", flush=True)
    if not asked.recordings:
        return
    for path in sorted((RECORDINGS / "yfysiks-encoder").glob("data2_*.csv")):
        print_second_test(path)


def print_second_test(path: Any) -> None:
    """Print the second test of one recording."""
    import pendpipe as pp
    from pendpipe.analysis.free_decay import measure_recording

    _, part = measure_recording(pp.read(path).as_motion(), path)
    samples = prepare(part, path)
    found = slips.steps_of_the_level(samples, slips.count_of(samples))
    print(f"{path.stem}: {found.summary}, p = {found.p_value:.2g}" if found else path.stem)


if __name__ == "__main__":
    main()
