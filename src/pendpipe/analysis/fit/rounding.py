"""Readings that are rounded: between which limits the angle lay, and no more.

With noise of rms s before the rounding, a reading r stands for the interval r -+ step/2, and its
probability is Phi((r + step/2 - m)/s) - Phi((r - step/2 - m)/s) for a model m. Where s is half a
step or more this is the usual chi^2 with variance s^2 + step^2/12; below, that would take the
rounding for random, which it is not, least of all in the tail.
"""

from __future__ import annotations

import math

from pendpipe.arrays import FloatArray
from pendpipe.dynamics.kernel import kernel

ROOT_HALF = math.sqrt(0.5)  # erfc(x ROOT_HALF)/2 is the tail of a normal number
DENSITY = 1.0 / math.sqrt(2.0 * math.pi)  # of a normal number, at its mean
_FAR = 25.0
"""Standard deviations beyond which the tail's probability is taken from its series."""


@kernel()
def rounded(
    residual: FloatArray, half_step: float, noise: float, score: FloatArray, weight: FloatArray
) -> float:
    """Return -2 ln likelihood, and fill in its derivatives by the model.

    Parameters
    ----------
    residual
        Readings less model, shape (n,).
    half_step, noise
        Half the step of the readings; rms of the noise before the rounding.
    score, weight
        To be filled: d ln P/dm and -d^2 ln P/dm^2 (never negative), shape (n,).
    """
    total = 0.0
    for i in range(len(residual)):
        low, high = (residual[i] - half_step) / noise, (residual[i] + half_step) / noise
        # By symmetry the interval lies about zero or above it.
        sign = 1.0
        if low + high < 0.0:
            low, high, sign = -high, -low, -1.0
        if low > _FAR:
            # ln P ~ -low^2/2 - ln(low sqrt(2 pi)): the far limit adds nothing.
            total += low * low + 2.0 * math.log(low / DENSITY)
            score[i] = sign * (low + 1.0 / low) / noise
            weight[i] = (1.0 - 1.0 / low**2) / noise**2
            continue
        if low > 0.0:
            chance = 0.5 * (math.erfc(low * ROOT_HALF) - math.erfc(high * ROOT_HALF))
        else:
            chance = 0.5 * (math.erf(high * ROOT_HALF) - math.erf(low * ROOT_HALF))
        at_low = DENSITY * math.exp(-0.5 * low * low) / chance
        at_high = DENSITY * math.exp(-0.5 * high * high) / chance
        slope = at_low - at_high
        total -= 2.0 * math.log(chance)
        score[i] = sign * slope / noise
        weight[i] = max(slope * slope - low * at_low + high * at_high, 0.0) / noise**2
    return total
