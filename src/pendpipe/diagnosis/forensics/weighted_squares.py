"""Tails of weighted sums of squares of normal numbers, for which scipy has no function."""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from scipy.special import ndtr

from pendpipe.arrays import FloatArray

_NEWTON_ROUNDS: Final = 60


def tail_of_squares(total: float, weight: FloatArray) -> float:
    """Return P(sum of w_i z_i^2 > total), z_i independent and normal.

    The saddlepoint approximation of Lugannani and Rice (Kuonen, Biometrika 86 (1999) 929),
    accurate to a few per cent of the probability, however small.

    Parameters
    ----------
    total
        The observed sum.
    weight
        w_i, of either sign, shape (n,).
    """
    weight = weight[weight != 0.0]
    if len(weight) == 0:
        return 1.0
    mean = float(weight.sum())
    spread = math.sqrt(2.0 * float(np.sum(weight**2)))
    if abs(total - mean) < 1e-3 * spread:
        # At the mean itself the formula is 0/0; its limit contains the skewness.
        skew = 8.0 * float(np.sum(weight**3)) / spread**3
        return 0.5 - skew / (6.0 * math.sqrt(2.0 * math.pi))
    if float(weight.min()) > 0.0 and total <= 0.0:
        return 1.0
    if float(weight.max()) < 0.0 and total >= 0.0:
        return 0.0
    tilt = _saddlepoint(total, weight)
    left = 1.0 - 2.0 * tilt * weight
    cumulant = -0.5 * float(np.sum(np.log(left)))
    curvature = 2.0 * float(np.sum((weight / left) ** 2))
    w = math.copysign(math.sqrt(max(2.0 * (tilt * total - cumulant), 0.0)), tilt)
    v = tilt * math.sqrt(curvature)
    if abs(w) < 1e-6 or v / w <= 0.0:
        return 0.5
    return float(ndtr(-w - math.log(v / w) / w))


def _saddlepoint(total: float, weight: FloatArray) -> float:
    """Find the saddlepoint: there the cumulant generating function has the derivative `total`."""
    high_weight, low_weight = float(weight.max()), float(weight.min())
    high = 0.5 / high_weight if high_weight > 0.0 else math.inf
    low = 0.5 / low_weight if low_weight < 0.0 else -math.inf
    tilt = 0.0
    for _ in range(_NEWTON_ROUNDS):
        left = 1.0 - 2.0 * tilt * weight
        excess = float(np.sum(weight / left)) - total
        if excess > 0.0:
            high = tilt
        else:
            low = tilt
        step = excess / (2.0 * float(np.sum((weight / left) ** 2)))
        trial = tilt - step
        if not low < trial < high:
            # Newton's step leaves the possible range: bisect it.
            if math.isinf(low) or math.isinf(high):
                trial = 2.0 * tilt - math.copysign(1.0 / (abs(weight).max()), excess)
            else:
                trial = 0.5 * (low + high)
        if abs(trial - tilt) < 1e-12 * max(abs(trial), 1e-3 / abs(weight).max()):
            return trial
        tilt = trial
    return tilt
