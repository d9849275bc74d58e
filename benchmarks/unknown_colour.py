"""What a slow drift is worth to one who has to learn the noise's colour from the same record.

    python -m benchmarks.unknown_colour [--count 20]

The challenge's oracle knows the noise; a program does not, and a level that drifts is like red
noise. Here one is asked who knows more than any program can, the pendulum, the drift's very
shape, the white noise and where red noise ends, and lacks only how steep and how strong the red
part is: both are chosen for the greatest likelihood, once without the drift and once with it.
He pays the oracle's own look-elsewhere. Recordings are those of `benchmarks.diagnosis`.
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np

from benchmarks.diagnosis import SIZES, Case, seed_of
from pendpipe.arrays import FloatArray
from pendpipe_challenge.intervals import power_ratio
from pendpipe_challenge.items import draw_sized, judge
from pendpipe_challenge.sets import process_pool
from pendpipe_challenge.sizing import Sized

SLOW: Final = ("offset-drift", "equilibrium-creep", "equilibrium-step")
STEEPNESS: Final = (0.3, 0.6, 0.9, 1.2, 1.5)
"""Exponents of the red part; the truth lies between 0.3 and 1.5, or there is none."""
STRENGTHS: Final = (0.0, *np.geomspace(1 / 30, 30.0, 21))
"""Its power in units of that with which it joins the white part at the corner (the truth: 1, or
there is none)."""
KNOWN: Final = {"steepness unknown": 1.001, "strength too, 3 times": 3.2, "10": 10.1, "30": 30.1}
"""What he lacks, and how many times stronger or weaker than it is the red part may be for him."""


class Answer(NamedTuple):
    """One recording: whether it is found by the oracle, and by one who lacks the colour."""

    red: bool
    oracle: bool
    without_colour: tuple[bool, ...]


def likelihoods(
    columns: FloatArray, residual: FloatArray, slow: FloatArray, white_sd: float
) -> FloatArray:
    """2 ln L of a residual for all strengths of one steepness, columns fitted, constants left out.

    C = sd^2 I + strength L L^T: with L L^T = U diag(l) U^T all products with C^-1 are
    those with U^T, and ln det C is a sum over l.

    Parameters
    ----------
    columns
        What is fitted besides, shape (samples, parameters).
    residual
        Shape (samples,).
    slow
        L, shape (samples, waves).
    white_sd
        sd.

    Returns
    -------
    ndarray
        For each of `STRENGTHS`.
    """
    values, vectors = np.linalg.eigh(slow.T @ slow)
    kept = values > 1e-10 * values.max(initial=0.0)
    values = values[kept]
    basis = slow @ (vectors[:, kept] / np.sqrt(values))
    both = np.column_stack([columns / np.linalg.norm(columns, axis=0), residual])
    white, red = both.T @ both, basis.T @ both
    found = []
    for strength in STRENGTHS:
        power = strength * values / white_sd**2
        products = white - red.T @ ((power / (1.0 + power))[:, None] * red)
        own, mixed, square = products[:-1, :-1], products[:-1, -1], products[-1, -1]
        left = square - mixed @ np.linalg.lstsq(own, mixed, rcond=1e-12)[0]
        found.append(-np.log1p(power).sum() - left / white_sd**2)
    return np.array(found)


def gains(sized: Sized, angle_rad: FloatArray) -> list[float]:
    """2 ln of the ratio of likelihoods with and without the drift, each with its best colour."""
    bench, kept = sized.bench, sized.bench.kept
    there = bench.reading(sized.point)
    drift = (sized.scenario.reading_rad(np.random.default_rng(0)) - there)[kept]
    tangent = bench.tangent(sized.point)
    residual = (angle_rad - there)[kept]
    scenario = sized.without
    waves = [
        replace(scenario.noise, alpha=alpha).slow(scenario.time_s)[kept] for alpha in STEEPNESS
    ]
    without, with_it = (
        np.max([likelihoods(columns, residual, slow, scenario.sd_rad) for slow in waves], axis=0)
        for columns in (tangent, np.column_stack([tangent, drift]))
    )
    strengths = np.array(STRENGTHS)
    allowed = [
        (strengths == 0.0) | ((strengths < most) & (strengths > 1.0 / most))
        for most in KNOWN.values()
    ]
    return [float(with_it[part].max() - without[part].max()) for part in allowed]


def answered(case: Case) -> Answer | None:
    """Make one recording again and ask both."""
    random = np.random.default_rng(seed_of(case))
    try:
        sized = draw_sized(random, case.names[0], case.size)
    except ValueError:
        return None
    codes = sized.scenario.record(random)
    verdict = judge(sized.bench, sized.point, sized.scenario, codes)
    angle = sized.scenario.chain.step_rad * codes.astype(np.float64)
    found = tuple(each > verdict.threshold for each in gains(sized, angle))
    return Answer(sized.without.noise.alpha > 0.0, verdict.detected, found)


def row(name: str, known: list[tuple[float, Answer]]) -> str:
    """At how many times the oracle's Delta chi^2 half are found."""
    sizes = np.array([size for size, _ in known])
    oracle = np.array([float(one.oracle) for _, one in known])
    cells = []
    for place in range(len(KNOWN)):
        found = np.array([float(one.without_colour[place]) for _, one in known])
        power = power_ratio(sizes, found, oracle)
        if "half" in power and found.any():
            half = power["half"]
            low, high = half["interval95"]
            cells.append(f"{half['ratio']:.2f} ({low:.2f} to {high:.2f})")
        else:
            cells.append("none found")
    return f"| {name} | {len(known)} | {' | '.join(cells)} |"


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=20, help="recordings of each size")
    parser.add_argument("--processes", type=int, default=2)
    arguments = parser.parse_args()
    print(f"| effect | recordings | {' | '.join(KNOWN)} |\n|---|---{'|---' * len(KNOWN)}|")
    for name in SLOW:
        cases = [
            Case("single", (name,), size, number)
            for number in range(arguments.count)
            for size in SIZES
        ]
        with process_pool(arguments.processes) as pool:
            told = list(zip(cases, pool.map(answered, cases), strict=True))
        known = [(case.size, answer) for case, answer in told if answer is not None]
        print(row(name, known), flush=True)
        for red in (False, True):
            part = [(size, one) for size, one in known if one.red is red]
            print(row(f"{name}, {'red' if red else 'white'} noise", part), flush=True)


if __name__ == "__main__":
    main()
