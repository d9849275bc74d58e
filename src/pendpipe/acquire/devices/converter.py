"""The analog-to-digital converter of a simulated instrument."""

from __future__ import annotations

import numpy as np

from pendpipe.arrays import FloatArray, IntArray


def convert(volts: FloatArray, bits: int, range_volts: float) -> IntArray:
    """Round volts at the terminals to the converter's codes.

    Parameters
    ----------
    volts
        The signal, any shape, in V.
    bits
        Resolution; the step is ``2 range_volts / 2**bits``.
    range_volts
        Full scale is plus and minus it.

    Returns
    -------
    IntArray
        Signed codes, ``-2**(bits-1)`` to ``2**(bits-1) - 1``, 0 at 0 V; a signal beyond
        the range gives the end code.
    """
    half = 1 << (bits - 1)
    codes = np.rint(np.asarray(volts, dtype=np.float64) * (half / range_volts))
    return np.clip(codes, -half, half - 1).astype(np.int64)
