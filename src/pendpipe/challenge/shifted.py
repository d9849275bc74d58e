"""Lost and repeated samples: from one moment on the reading is that of another time."""

from __future__ import annotations

import numpy as np

from pendpipe.arrays import FloatArray
from pendpipe.challenge.bench import Bench

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
