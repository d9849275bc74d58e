"""Chebyshev polynomials on one panel: nodes, integration, and the change to powers.

A panel is a piece of a half cycle, mapped to -1 <= z <= 1. A function is known by its values
at the 17 Chebyshev-Lobatto nodes, both ends among them; 17 are enough for 1e-12 on a half
cycle of a pendulum with Q above about 30, and a panel that is not resolved is halved.
"""

import numpy as np
from numpy.polynomial import chebyshev

from pendpipe.arrays import FloatArray
from pendpipe.dynamics.layout import DEGREE


def lobatto_nodes(degree: int) -> FloatArray:
    """Return the nodes from -1 to 1, shape (degree + 1,)."""
    return np.asarray(chebyshev.chebpts2(degree + 1))


def analysis(nodes: FloatArray) -> FloatArray:
    """Return the matrix that turns values at Chebyshev's points into Chebyshev coefficients."""
    return np.asarray(np.linalg.inv(chebyshev.chebvander(nodes, len(nodes) - 1)))


def lobatto_integration(degree: int) -> FloatArray:
    """Return the matrix that integrates from -1 to each node."""
    integral = chebyshev.chebint(np.eye(degree + 1), lbnd=-1.0, axis=0)
    nodes = lobatto_nodes(degree)
    matrix = chebyshev.chebvander(nodes, degree + 1) @ integral
    matrix[0] = 0.0
    return np.asarray(matrix @ analysis(nodes))


def powers_of_chebyshev(count: int) -> FloatArray:
    """Return the coefficients of the powers z^i in T_k, one row per k, for k < count."""
    rows = np.zeros((count, count))
    for k in range(count):
        rows[k, : k + 1] = chebyshev.cheb2poly(np.eye(count)[k, : k + 1])
    return rows


NODES: FloatArray = lobatto_nodes(DEGREE)
# Transposed, so that a product runs along contiguous columns.
ANALYSIS_T: FloatArray = np.ascontiguousarray(analysis(NODES).T)
INTEGRATION_T: FloatArray = np.ascontiguousarray(lobatto_integration(DEGREE).T)
POWERS_T: FloatArray = np.ascontiguousarray(ANALYSIS_T @ powers_of_chebyshev(DEGREE + 1))
"""Values at the nodes to the coefficients of 1, z, ..., z^16 (transposed)."""
