"""The scaled complementary error function of complex numbers, without scipy's slow import."""

from __future__ import annotations

from functools import lru_cache
from typing import Final

import numpy as np
from numpy.typing import NDArray

_TERMS: Final = 32
"""For nine figures at least."""

Complex = NDArray[np.complex128]


def erfcx(z: Complex) -> Complex:
    """Return e^(z^2) erfc(z) for Re z >= 0, as Weideman (1994) sums it.

    With L = sqrt(N/sqrt 2) and Z = (L - z)/(L + z),
    erfcx(z) = 2 p(Z)/(L + z)^2 + 1/(sqrt(pi) (L + z)), p a polynomial of N terms.
    """
    scale = np.sqrt(_TERMS / np.sqrt(2.0))
    down = 1.0 / (scale + z)
    found = 2.0 * np.polyval(_polynomial(), (scale - z) * down) * down**2
    return np.asarray(found + down / np.sqrt(np.pi))


@lru_cache(maxsize=1)
def _polynomial() -> NDArray[np.float64]:
    """Coefficients of p, the highest power first."""
    half = 2 * _TERMS
    scale = np.sqrt(_TERMS / np.sqrt(2.0))
    theta = np.arange(-half + 1, half) * np.pi / half
    t = scale * np.tan(0.5 * theta)
    weight = np.append(0.0, np.exp(-(t**2)) * (scale**2 + t**2))
    found = np.fft.fft(np.fft.fftshift(weight)).real / (2.0 * half)
    return np.asarray(found[_TERMS:0:-1])
