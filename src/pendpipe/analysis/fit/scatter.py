"""How much the residual's amplitude differs from half cycle to half cycle."""

from __future__ import annotations

import numpy as np
from numba import njit

from pendpipe.arrays import FloatArray


@njit(cache=True, error_model="numpy")
def half_cycle_scatter(
    middles: FloatArray, time_s: FloatArray, residual: FloatArray
) -> tuple[float, int]:
    """Return the mean square of the half cycles' residual amplitudes, in units of the noise's.

    Each is the residual's product with a parabola that vanishes at the `middles` between
    turning points (a half wave, near enough), over the root of the parabola's square.

    Returns
    -------
    ratio, half_cycles
        0 half cycles if one of them has fewer than three readings.
    """
    total, i = 0.0, np.searchsorted(time_s, middles[0])
    for k in range(len(middles) - 1):
        start_s, inverse = middles[k], 1.0 / (middles[k + 1] - middles[k])
        product, square, first = 0.0, 0.0, i
        while i < len(time_s) and time_s[i] < middles[k + 1]:
            share = (time_s[i] - start_s) * inverse
            form = share * (1.0 - share)
            product += residual[i] * form
            square += form * form
            i += 1
        if i < first + 3:
            return 1.0, 0
        total += product * product / square
    return total / (len(middles) - 1), len(middles) - 1
