"""How much the residual's amplitude differs from half cycle to half cycle."""

from __future__ import annotations

import numpy as np
from numba import njit

from pendpipe.arrays import FloatArray


@njit(cache=True, fastmath={"contract", "reassoc"}, error_model="numpy")
def _against_parabola(
    time_s: FloatArray, residual: FloatArray, start_s: float, stop_s: float
) -> tuple[float, float]:
    """Sums of the residual times a parabola, and of the parabola's square."""
    inverse, product, square = 1.0 / (stop_s - start_s), 0.0, 0.0
    for i in range(len(time_s)):
        share = (time_s[i] - start_s) * inverse
        form = share * (1.0 - share)
        product += residual[i] * form
        square += form * form
    return product, square


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
    total, first = 0.0, int(np.searchsorted(time_s, middles[0]))
    for k in range(len(middles) - 1):
        last = np.searchsorted(time_s[first:], middles[k + 1]) + first
        if last < first + 3:
            return 1.0, 0
        product, square = _against_parabola(
            time_s[first:last], residual[first:last], middles[k], middles[k + 1]
        )
        total += product * product / square
        first = last
    return total / (len(middles) - 1), len(middles) - 1
