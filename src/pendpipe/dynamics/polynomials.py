"""Polynomials of degree 16 at many places."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pendpipe.dynamics.layout import NODE_COUNT
from pendpipe.dynamics.panel import inlined, kernel

if TYPE_CHECKING:
    from pendpipe.arrays import FloatArray


@kernel
def horner(c: FloatArray, theta: FloatArray, out: FloatArray) -> None:
    """Evaluate the polynomial of degree 16 with coefficients `c` at `theta`.

    Written out, so that the compiler keeps the coefficients in registers.
    """
    c0, c1, c2, c3, c4, c5, c6, c7, c8 = c[0], c[1], c[2], c[3], c[4], c[5], c[6], c[7], c[8]
    c9, c10, c11, c12, c13, c14, c15, c16 = c[9], c[10], c[11], c[12], c[13], c[14], c[15], c[16]
    for i in range(theta.size):
        z = theta[i]
        upper = ((((((((c16 * z + c15) * z + c14) * z + c13) * z + c12) * z) + c11) * z) + c10) * z
        lower = ((((((upper + c9) * z + c8) * z + c7) * z + c6) * z + c5) * z + c4) * z
        out[i] = (((lower + c3) * z + c2) * z + c1) * z + c0


@inlined
def horner_few(c: FloatArray, theta: FloatArray, out: FloatArray) -> None:
    """As `horner`, at a few places: even and odd powers apart, so that each step waits less."""
    for i in range(theta.size):
        z = theta[i]
        square = z * z
        even, odd = c[NODE_COUNT - 1], c[NODE_COUNT - 2]
        for k in range(NODE_COUNT - 3, 0, -2):
            even, odd = even * square + c[k], odd * square + c[k - 1]
        out[i] = even * square + c[0] + z * odd
