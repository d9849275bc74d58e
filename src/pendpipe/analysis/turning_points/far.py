"""Turning points far out, where a half cycle no longer has the shape of small swings."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Final

import numpy as np

from pendpipe.analysis.turning_points.samples import Samples
from pendpipe.analysis.turning_points.table import TurningPoints

FAR: Final = 1.2
"""Angle in rad from which a turning point is read off the readings next to it."""
_REACH: Final = 0.12
"""Of a half period: so near to the turning point a fourth power follows sin x to 0.1 mrad."""
_FEWEST: Final = 10
_MOST: Final = 0.5
"""Of the reach, by which the turning point may lie off the middle of the readings."""


def far_points(samples: Samples, points: TurningPoints) -> TurningPoints:
    """Measure turning points beyond 1.2 rad again, by the readings next to each.

    The angle is a polynomial of the time up to the fourth power, without the third, and with the
    step of the acceleration where friction turns.
    """
    far = np.flatnonzero(np.abs(points.angle_rad) > FAR).tolist()
    if samples.unit != "rad" or not far:
        return points
    angle, time = points.angle_rad.copy(), points.time_s.copy()
    angle_sd, time_sd = points.angle_sd_rad.copy(), points.time_sd_s.copy()
    for k in far:
        beside = slice(max(k - 1, 0), k + 2)
        half = np.diff(points.time_s[beside]) / np.diff(points.half_cycle[beside])
        reach = _REACH * float(np.min(half))
        for _ in range(3):
            ends = np.searchsorted(samples.time_s, [time[k] - reach, time[k] + reach])
            near = slice(*ends.tolist())
            z = (samples.time_s[near] - time[k]) / reach
            if len(z) < _FEWEST:
                break
            columns = [np.ones_like(z), z, z**2, z**4]
            if min(-z[0], z[-1]) > _MOST:
                # Where the record begins with a release there is one side only, and no step.
                columns.append(z * np.abs(z))
            inverse = np.linalg.pinv(np.stack(columns, axis=1))
            top, slope, bend, _, *step = (inverse @ samples.values[near]).tolist()
            turn = -0.5 * slope / bend
            if not abs(turn) < _MOST:
                break
            time[k] += reach * turn
            bend += math.copysign(sum(step), turn)
            angle[k] = top + (slope + bend * turn) * turn - points.level_rad[k]
            errors = samples.noise_rms * np.linalg.norm(inverse[:2], axis=1)
            angle_sd[k] = max(float(errors[0]), points.angle_sd_rad[k])
            time_sd[k] = max(0.5 * reach * float(errors[1]) / abs(bend), points.time_sd_s[k])
    return replace(points, angle_rad=angle, time_s=time, angle_sd_rad=angle_sd, time_sd_s=time_sd)
