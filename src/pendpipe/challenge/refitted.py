"""Rivals of a large effect, compared by nonlinear refits instead of linear scores."""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np

from pendpipe.arrays import FloatArray
from pendpipe.challenge import layout
from pendpipe.challenge.bank import Shape
from pendpipe.challenge.bench import Point
from pendpipe.challenge.oracle import Oracle

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
    shapes = {name: details.get(name, layout.PARAMETERS[name]) for name in shape.free}
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
    """The oracle's point with an effect's shape, its strength nought."""
    truth = oracle.bench.truth
    return replace(truth, motion=truth.motion.changed(**details))
