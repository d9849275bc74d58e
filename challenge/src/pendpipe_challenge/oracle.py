"""The oracle: it knows nuisances, noise and catalogue, and pays the same look-elsewhere.

Its detection level comes from Monte Carlo of the projected Gaussian scores: that of the largest
score over the whole catalogue, scans included.

Rivals of a large effect, compared by nonlinear refits instead of linear scores.

Lost and repeated samples: from one moment on the reading is that of another time.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Final

import numpy as np

from pendpipe.arrays import FloatArray, IntArray
from pendpipe_challenge.bench import Bench, Point
from pendpipe_challenge.signatures import (
    Shape,
    Specials,
    Tones,
    beats,
    instrument,
    integrated,
    steps,
)
from pendpipe_challenge.torques import PARAMETERS

LEVEL: Final = 0.01
CLASS: Final = 6.0
"""Difference of Delta chi^2 within which two names cannot be told apart: exp(-3)."""
DRAWS: Final = 800


@dataclass(frozen=True)
class Verdict:
    """The oracle's answer about one recording.

    Parameters
    ----------
    scores
        Delta chi^2 of every effect, its best shape.
    threshold
        See the module.
    detected
        Whether any effect passes it.
    ranking
        Effects by likelihood, the best first (a parameter more costs 2).
    members
        The equivalence class: effects within `CLASS` of the best.
    """

    scores: dict[str, float]
    threshold: float
    detected: bool
    ranking: tuple[str, ...]
    members: tuple[str, ...]


@dataclass
class Oracle:
    """The catalogue's signatures for one workbench.

    Parameters
    ----------
    bench
        Baseline at the point about which scores are linear.
    """

    bench: Bench
    shapes: list[Shape] = field(init=False)
    steps: list[tuple[str, FloatArray]] = field(init=False)
    tones: Tones = field(init=False)
    specials: Specials = field(init=False)

    def __post_init__(self) -> None:
        bench = self.bench
        self.shapes = [
            *integrated(bench),
            *instrument(bench),
            *beats(bench),
        ]
        self.steps = []
        for effect, columns in steps(bench):
            left = bench.off(bench.whiten(columns))
            norms = np.linalg.norm(left, axis=0)
            known = norms > 1e-7 * max(float(norms.max()), 1e-300)
            self.steps.append((effect, left[:, known] / norms[known]))
        self.tones = Tones(bench)
        self.specials = Specials(bench)

    def scores(self, residuals: FloatArray) -> dict[str, FloatArray]:
        """Best score of every effect for each of several residuals (kept, draws)."""
        residuals = self.bench.off(residuals)
        found: dict[str, FloatArray] = {}

        def better(effect: str, values: FloatArray) -> None:
            found[effect] = np.maximum(found[effect], values) if effect in found else values

        for shape in self.shapes:
            better(shape.effect, np.sum((shape.columns.T @ residuals) ** 2, axis=0))
        for effect, columns in self.steps:
            better(effect, ((columns.T @ residuals) ** 2).max(axis=0))
        for part in (self.tones.scores(residuals), self.specials.of_residuals(residuals)):
            for effect, values in part.items():
                better(effect, values)
        return found

    @cached_property
    def threshold(self) -> float:
        """The level of the largest score."""
        random = np.random.default_rng(self.bench.count)
        largest = []
        for _ in range(DRAWS // 100):
            scores = self.scores(random.standard_normal((self.bench.count, 100)))
            largest.append(np.max(list(scores.values()), axis=0))
        return tail(np.concatenate(largest))

    def clean_scores(self, residual: FloatArray) -> dict[str, float]:
        """Scores of a noise-free residual: of the effects that are directions in it."""
        directions = {shape.effect for shape in self.shapes} | {name for name, _ in self.steps}
        directions |= {"tone-pickup", "periodic-drive", "second-mode"}
        found = self.scores(residual[:, None])
        return {name: float(found[name][0]) for name in directions}

    def judge(
        self,
        residual: FloatArray,
        codes: IntArray | None = None,
        more: dict[str, float] | None = None,
    ) -> Verdict:
        """Detect and name from one whitened residual and the codes it comes from.

        Parameters
        ----------
        residual
            Recording less the baseline about which the scores are linear, kept samples.
        codes
            The converter's codes, for its own faults.
        more
            Scores found in other ways, by refits for example.
        """
        scores = {name: float(u[0]) for name, u in self.scores(residual[:, None]).items()}
        if codes is not None:
            of_codes = self.specials.of_codes(codes)
            if of_codes["coarse-quantisation"] > 0.0:
                # Everything else is judged by the noise that such steps make.
                dead = len(codes) and of_codes["coarse-quantisation"] / (2.0 * len(codes))
                scenario = self.bench.scenario
                coarse = scenario.chain.step_rad * np.exp(dead) / np.sqrt(12.0)
                share = scenario.sd_rad**2 / (scenario.noise.white_sd**2 + coarse**2)
                scores = {name: value * share for name, value in scores.items()}
            scores |= of_codes
        for name, value in (more or {}).items():
            scores[name] = max(value, scores.get(name, 0.0))
        return Verdict(
            scores=scores,
            threshold=self.threshold,
            detected=max(scores.values()) > self.threshold,
            ranking=ranked(scores),
            members=members(scores),
        )


FREEDOM: Final = {
    "circular-error": 0,
    "tone-pickup": 3,
    "periodic-drive": 3,
    "second-mode": 4,
    "plane-coupling": 3,
    "power-law-damping": 2,
    "stribeck-friction": 2,
    "presliding-friction": 2,
    "vortex-shedding": 2,
    "release-transient": 2,
    "impulse": 2,
    "equilibrium-step": 2,
    "amplitude-step": 2,
    "frequency-step": 2,
    "damping-step": 2,
    "glitches": 2,
    "dropped-samples": 2,
    "clipping": 2,
}
"""Free numbers of each effect; 1 by default."""


def ranked(scores: dict[str, float]) -> tuple[str, ...]:
    """Effects by likelihood, two units of Delta chi^2 for each free number."""
    return tuple(sorted(scores, key=lambda name: 2.0 * FREEDOM.get(name, 1) - scores[name]))


def members(scores: dict[str, float]) -> tuple[str, ...]:
    """Names whose likelihood is within exp(-3) of the leader's."""
    best = max(scores.values())
    return tuple(name for name in ranked(scores) if best - scores[name] <= CLASS)


def tail(values: FloatArray, level: float = LEVEL) -> float:
    """Upper quantile by the exponential tail above the upper tenth."""
    start = float(np.quantile(values, 0.9))
    beyond = values[values > start] - start
    return start + float(beyond.mean()) * float(np.log(0.1 / level))


LARGE: Final = 40.0
"""Below this score the linear comparison is good enough."""
HUGE: Final = 3000.0
"""Above it the leader stands apart, and refits from so far away are long."""
NEAR: Final = 0.12
"""Rivals whose linear score lacks at most this share of the leader's are refitted."""
RIVALS: Final = 4
"""So many of them at most: a refit costs as much as a hundred trajectories."""


def refitted(oracle: Oracle, angle: FloatArray, residual: FloatArray) -> dict[str, float]:
    """Delta chi^2 of the leading torques with everything free, their shapes too.

    Parameters
    ----------
    oracle
        About the baseline's best point.
    angle
        The readings, rad, whole record.
    residual
        The readings less the baseline there, whitened, kept part.
    """
    bench = oracle.bench
    left = bench.off(residual)
    plain = float(left @ left)
    linear = [(float(np.sum((s.columns.T @ left) ** 2)), s) for s in oracle.shapes]
    leader = max(score for score, _ in linear)
    if not LARGE < leader < HUGE:
        return {}
    best: dict[str, tuple[float, Shape]] = {}
    for score, shape in linear:
        if shape.step == 0.0 or score < (1.0 - NEAR) * leader:
            continue
        if score > best.get(shape.effect, (0.0, shape))[0]:
            best[shape.effect] = (score, shape)
    found = {}
    nearest = sorted(best.items(), key=lambda entry: -entry[1][0])[:RIVALS]
    for effect, (score, shape) in nearest:
        square = _refit(oracle, angle, residual, shape)
        if np.isfinite(square):
            found[effect] = max(score, plain - square)
    return found


def _refit(oracle: Oracle, angle: FloatArray, residual: FloatArray, shape: Shape) -> float:
    """Chi^2 of baseline and effect together, from where the linear scores point."""
    bench = oracle.bench
    details = dict(shape.details)
    column = bench.tangent(_with(oracle, details), {shape.parameter: shape.step})
    jacobian = bench.whiten(column)
    change = np.linalg.lstsq(jacobian, residual, rcond=1e-12)[0]
    start = _with(oracle, details)
    for name, by in zip((*bench.names, shape.parameter), change, strict=True):
        unit = bench.scenario.sd_rad if name == "offset" else bench.sizes.get(name, shape.step)
        start = start.moved(name, unit * by)
    shapes = {name: details.get(name, PARAMETERS[name]) for name in shape.free}
    free = {name: 1e-3 * value for name, value in shapes.items()}
    # A neighbouring shape has its own signature in the bank; far ones need tiny steps.
    limits = {name: (0.4 * value, 2.5 * value) for name, value in shapes.items()}
    own = {shape.parameter: shape.step}
    begun, _, square = bench.refit(angle, start, 3, own)
    if free:
        _, _, more = bench.refit(angle, begun, 3, own | free, limits)
        square = float(np.nanmin([square, more]))
    return square


def _with(oracle: Oracle, details: dict[str, float]) -> Point:
    """The oracle's point with an effect's shape, its strength zero."""
    truth = oracle.bench.truth
    return replace(truth, motion=truth.motion.changed(**details))


SHIFTS = (-2, -1, 1, 2, 3)


def shift_score(bench: Bench, angle: FloatArray, residual: FloatArray) -> float:
    """2 ln L of the best shift and moment against no shift.

    Parameters
    ----------
    bench
        At the truth: the oracle knows the motion before anything was lost.
    angle
        The readings, rad, whole record.
    residual
        Whitened residual of the unshifted baseline at its best.
    """
    scenario = bench.scenario
    before = bench.whiten((angle - bench.true_reading)[bench.kept])
    time = np.concatenate(
        [scenario.time_s, scenario.time_s[-1] + scenario.interval_s * np.arange(1.0, 5.0)]
    )
    motion = bench.truth.motion.run(time).angle_rad
    best = np.inf
    count = len(scenario.time_s)
    for shift in SHIFTS:
        index = np.clip(np.arange(count) + shift, 0, len(time) - 1)
        moved = bench.gain * motion[index] + bench.truth.level_rad
        after = bench.whiten((angle - moved)[bench.kept])
        # The first `n` samples unshifted, the others shifted.
        square = np.concatenate([[0.0], np.cumsum(before**2)])
        later = np.concatenate([np.cumsum(after[::-1] ** 2)[::-1], [0.0]])
        best = min(best, float((square + later)[5:-5].min()))
    return max(0.0, float(residual @ residual) - best)
