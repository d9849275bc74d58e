"""One half cycle of Eq. 8 by the phase clock: panel after panel, halved where it must be.

What a half cycle hands on is one row of numbers, the same whether it was solved here or read
from the table (`table.py`):

    [0]  ln(y/y'), the loss of amplitude          [1]  duration in radians, less pi
    [HEAD ...]  for each sensitivity (the amplitude y at the start, then the directions)
                dy'/dy or (dy'/dp)/y, and after these y dtau/dy or dtau/dp
    then for each panel   tau - psi at its end, and the polynomials of degree 16 in time:
                x/y, dx/dy, (dx/dp)/y at fixed time since the start of the half cycle.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from pendpipe.dynamics.chebyshev import DEGREE
from pendpipe.dynamics.panel import (
    COS,
    EXCESS,
    LOSS,
    NODE_COUNT,
    SIN,
    kernel,
    place,
    polynomial,
    solve,
    time_nodes,
    unresolved,
)
from pendpipe.dynamics.sensitivities import sensitivities

if TYPE_CHECKING:
    from pendpipe.arrays import FloatArray

HEAD = 2
LOSS_TOLERANCE = 5e-10
"""Bound of `solve`'s estimate, which is a thousand times the error: 5e-13 of a half cycle's loss."""
WAVEFORM_TOLERANCE = 1e-12
"""Of the polynomial in time, relative to the amplitude."""


@kernel
def panel_width(columns: int, polynomials: int) -> int:
    """Return how many numbers of a row belong to one panel."""
    return 1 + polynomials * NODE_COUNT if polynomials > 0 else 0


@kernel
def row_width(columns: int, polynomials: int, panels: int) -> int:
    """Return the length of a half cycle's row."""
    return HEAD + 2 * columns + panels * panel_width(columns, polynomials)


@kernel
def start_derivatives(
    directions: FloatArray, radius: float, sigma: FloatArray, shift: FloatArray
) -> None:
    """Set d ln r/dp and dtau/dp at the turning point y = m + r."""
    for c in range(sigma.size):
        sigma[c] = 1.0 / radius if c == 0 else -directions[c - 1, 0] / radius
        shift[c] = 0.0


@kernel
def end_derivatives(
    directions: FloatArray,
    radius: float,
    y: float,
    sigma: FloatArray,
    shift: FloatArray,
    row: FloatArray,
) -> None:
    """Write the derivatives of the next turning point, y' = r - m, to the row's head."""
    columns = sigma.size
    for c in range(columns):
        if c == 0:
            row[HEAD] = radius * sigma[0]
            row[HEAD + columns] = y * shift[0]
        else:
            row[HEAD + c] = (radius * sigma[c] - directions[c - 1, 0]) / y
            row[HEAD + columns + c] = shift[c]


@kernel
def panel_polynomials(
    node: FloatArray,
    shape: FloatArray,
    radius: float,
    half_width: float,
    y: float,
    columns: FloatArray,
    chebyshev: FloatArray,
    out: FloatArray,
) -> bool:
    """Write a solved panel's polynomials in time; say whether time resolves the waveform."""
    time_nodes(node, half_width, chebyshev)
    waveform = columns[columns.shape[0] - 1]
    for j in range(NODE_COUNT):
        waveform[j] = (shape[0] + radius * (1.0 + node[LOSS, j]) * node[COS, j]) / y
    polynomial(node, waveform, chebyshev, out[:NODE_COUNT])
    resolved = unresolved(waveform) <= WAVEFORM_TOLERANCE
    for c in range(columns.shape[0] - 1):
        if c > 0:
            for j in range(NODE_COUNT):
                columns[c, j] /= y
        polynomial(node, columns[c], chebyshev, out[(c + 1) * NODE_COUNT : (c + 2) * NODE_COUNT])
    return resolved


@kernel
def tabulated_half_cycle(
    node: FloatArray,
    shape: FloatArray,
    directions: FloatArray,
    y: float,
    panels: int,
    polynomials: int,
    sigma: FloatArray,
    shift: FloatArray,
    columns: FloatArray,
    chebyshev: FloatArray,
    row: FloatArray,
) -> bool:
    """Solve a half cycle on `panels` equal panels into `row`; say whether these resolve it."""
    m = shape[0]
    radius = y - m
    start_derivatives(directions, radius, sigma, shift)
    half_width = 0.5 * math.pi / panels
    change, excess = 0.0, 0.0
    width = panel_width(sigma.size, polynomials)
    at = HEAD + 2 * sigma.size
    for p in range(panels):
        if panels > 1 or node[SIN, DEGREE // 2] != 1.0:
            place(node, 2.0 * p * half_width, half_width)
        here = radius * (1.0 + change)
        if not solve(node, shape, here, half_width, LOSS_TOLERANCE):
            return False
        if sigma.size > 0:
            sensitivities(node, shape, directions, here, half_width, sigma, shift, columns)
        excess += node[EXCESS, DEGREE]
        if polynomials > 0:
            row[at] = excess
            if not panel_polynomials(
                node, shape, here, half_width, y, columns, chebyshev, row[at + 1 : at + width]
            ):
                return False
            at += width
        change += node[LOSS, DEGREE] * (1.0 + change)
    row[0] = -math.log1p((radius * change - 2.0 * m) / y)
    row[1] = excess
    end_derivatives(directions, radius * (1.0 + change), y, sigma, shift, row)
    return True
