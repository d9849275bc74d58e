"""The orthonormal cosine transform (DCT-II) and its inverse, by numpy's Fourier transform.

scipy has both; importing it for them would take longer than all transforms of a diagnosis.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from pendpipe.arrays import FloatArray

_Complex = NDArray[np.complex128]


def cosines(rows: FloatArray) -> FloatArray:
    """Return c_k = sqrt((2 - [k = 0])/n) sum over j of x_j cos(pi k (2 j + 1)/(2 n)), last axis.

    The even entries followed by the odd ones backwards have a Fourier transform whose phases
    have only to be turned (Makhoul 1980). Single precision stays single.
    """
    count = rows.shape[-1]
    if count < 2:
        return np.array(rows)
    half = (count + 1) // 2
    mixed = np.empty(rows.shape, dtype=rows.dtype)
    mixed[..., :half] = rows[..., ::2]
    mixed[..., half:] = rows[..., 1::2][..., ::-1]
    turned = np.fft.rfft(mixed)
    turned *= _turn(count).astype(turned.dtype)
    found = mixed
    lines = turned.shape[-1]
    found[..., :lines] = turned.real
    found[..., lines:] = -turned.imag[..., count - lines : 0 : -1]
    return found


def from_cosines(rows: FloatArray) -> FloatArray:
    """Return the inverse of `cosines` (and its transpose), last axis."""
    count = rows.shape[-1]
    if count < 2:
        return np.array(rows)
    lines = count // 2 + 1
    turned = np.empty((*rows.shape[:-1], lines), dtype=np.result_type(rows.dtype, np.complex64))
    turned.real = rows[..., :lines]
    turned.imag[..., 0] = 0.0
    turned.imag[..., 1:] = -rows[..., : count - lines : -1]
    turned /= _turn(count).astype(turned.dtype)
    mixed = np.fft.irfft(turned, n=count)
    half = (count + 1) // 2
    found = np.empty(rows.shape, dtype=rows.dtype)
    found[..., ::2] = mixed[..., :half]
    found[..., 1::2] = mixed[..., half:][..., ::-1]
    return found


@lru_cache(maxsize=8)
def _turn(count: int) -> _Complex:
    """sqrt(2/n) e^(-i pi k/(2 n)), the level's own scale included."""
    order = np.arange(count // 2 + 1)
    turn = np.sqrt(2.0 / count) * np.exp(-0.5j * np.pi * order / count)
    turn[0] = np.sqrt(1.0 / count)
    return np.asarray(turn)
