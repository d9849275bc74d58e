"""One half cycle of Eq. 8 by the phase clock: panel after panel, halved where it must be.

What a half cycle hands on is one row of numbers, the same whether it was solved here or read
from the table (`table.py`):

    [0]  ln(y/y'), the loss of amplitude          [1]  duration in radians, less pi
    [HEAD ...]  for each sensitivity (the amplitude y at the start, then the rates)
                dy'/dy or (dy'/dp)/y, and after these y dtau/dy or dtau/dp
    then for each panel   tau - psi at its end, and the polynomials of degree 16 in time:
                x/y, dx/dy, (dx/dp)/y at fixed time since the start of the half cycle.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from pendpipe.dynamics.emission import emit
from pendpipe.dynamics.layout import DEGREE, HEAD, NODE_COUNT
from pendpipe.dynamics.panel import (
    COS,
    EXCESS,
    LOSS,
    part,
    place,
    polynomial,
    solve,
    time_nodes,
    unresolved,
)
from pendpipe.dynamics.sensitivities import sensitivities
from pendpipe.dynamics.workspace import panel_width

if TYPE_CHECKING:
    from pendpipe.arrays import FloatArray
    from pendpipe.dynamics.workspace import Work

LOSS_TOLERANCE = 5e-9
"""Bound of `solve`'s estimate, a thousand times the error: that is 5e-12 of a half cycle's loss."""
WAVEFORM_TOLERANCE = 1e-12
"""Of the polynomial in time, relative to the amplitude."""
FINEST = 30
"""The finest panel is a half cycle halved so often; it is accepted as it is."""


@part
def _start(work: Work, radius: float) -> None:
    """Set d ln r/dp and dtau/dp at the turning point y = m + r."""
    for c in range(work.sigma.size):
        work.sigma[c] = 1.0 / radius if c == 0 else -work.directions[c - 1, 0] / radius
        work.shift[c] = 0.0


@part
def _end(work: Work, radius: float, y: float, row: FloatArray) -> None:
    """Write the derivatives of the next turning point, y' = r - m, to the row's head."""
    columns = work.sigma.size
    for c in range(columns):
        if c == 0:
            row[HEAD] = radius * work.sigma[0]
            row[HEAD + columns] = y * work.shift[0]
        else:
            row[HEAD + c] = (radius * work.sigma[c] - work.directions[c - 1, 0]) / y
            row[HEAD + columns + c] = work.shift[c]


@part
def _solve_panel(
    work: Work, radius: float, start: float, half_width: float, y: float, finest: bool,
    polynomials: FloatArray,
) -> bool:  # fmt: skip
    """Solve a panel with all that is asked of it; say whether it is resolved."""
    place(work.node, work.placed, start, half_width)
    tolerance = math.inf if finest else LOSS_TOLERANCE
    if not solve(work.node, work.shape, radius, half_width, tolerance):
        return False
    if work.sigma.size > 0:
        sensitivities(
            work.node, work.shape, work.directions, radius, half_width,
            work.sigma, work.shift, work.columns,
        )  # fmt: skip
    if polynomials.size == 0:
        return True
    return _in_time(work, radius, half_width, y, polynomials) or finest


@part
def _in_time(
    work: Work, radius: float, half_width: float, y: float, polynomials: FloatArray
) -> bool:
    """Write a solved panel's polynomials in time; say whether they resolve the waveform."""
    n, node, count = NODE_COUNT, work.node, work.sigma.size
    time_nodes(node, half_width, work.chebyshev)
    waveform = work.columns[count]
    for j in range(n):
        waveform[j] = (work.shape[0] + radius * (1.0 + node[LOSS + j]) * node[COS + j]) / y
    polynomial(node, waveform, work.chebyshev, polynomials, 0)
    resolved = unresolved(waveform, 0) <= WAVEFORM_TOLERANCE
    for c in range(count):
        column = work.columns[c]
        if c > 0:
            for j in range(n):
                column[j] /= y
        polynomial(node, column, work.chebyshev, polynomials, (c + 1) * n)
    return resolved


@part
def even_half_cycle(work: Work, y: float, panels: int, polynomials: int, row: FloatArray) -> bool:
    """Solve a half cycle on `panels` equal panels into `row`; say whether these resolve it."""
    m = work.shape[0]
    radius = y - m
    _start(work, radius)
    half_width = 0.5 * math.pi / panels
    change, excess = 0.0, 0.0
    width = panel_width(polynomials)
    at = HEAD + 2 * work.sigma.size
    for p in range(panels):
        if not _solve_panel(
            work, radius * (1.0 + change), 2.0 * p * half_width, half_width, y, False,
            row[at + 1 : at + width],
        ):  # fmt: skip
            return False
        excess += work.node[EXCESS + DEGREE]
        if polynomials > 0:
            row[at] = excess
            at += width
        change += work.node[LOSS + DEGREE] * (1.0 + change)
    row[0] = -math.log1p((radius * change - 2.0 * m) / y)
    row[1] = excess
    _end(work, radius * (1.0 + change), y, row)
    return True


@part
def direct_half_cycle(
    work: Work, y: float, begin: float, signs: FloatArray, level: int, polynomials: int,
    time_s: FloatArray, first: int, guess: int, angle_rad: FloatArray, jacobian: FloatArray,
) -> tuple[float, float, int, int]:  # fmt: skip
    """Solve a half cycle on panels as fine as it needs, and write its samples.

    `begin` is its start in radians since the release, `level` the number of halvings to begin
    with. Returns the amplitude at its end (negative if the pendulum stops before it reaches
    its equilibrium), its duration less pi, the index of the next sample, and the number of
    halvings it began with, which is negative if the pendulum is overdamped.
    """
    m, row = work.shape[0], work.row
    radius = y - m
    _start(work, radius)
    change, excess, k = 0.0, 0.0, 0
    coarsest, at = -1, HEAD + 2 * work.sigma.size
    width = polynomials * NODE_COUNT
    while k < 1 << level:
        half_width = 0.5 * math.pi / (1 << level)
        start = 2.0 * k * half_width
        for c in range(work.sigma.size):
            work.kept[0, c], work.kept[1, c] = work.sigma[c], work.shift[c]
        if not _solve_panel(
            work, radius * (1.0 + change), start, half_width, y, level >= FINEST,
            row[at : at + width],
        ):  # fmt: skip
            if level >= FINEST:
                return y, 0.0, first, -1
            for c in range(work.sigma.size):
                work.sigma[c], work.shift[c] = work.kept[0, c], work.kept[1, c]
            level, k = level + 1, 2 * k
            continue
        if coarsest < 0:
            coarsest = level
        duration = 2.0 * half_width + work.node[EXCESS + DEGREE]
        if polynomials > 0:
            end = emit(
                work, row[at : at + width], begin + start + excess, duration, y, signs,
                time_s, first, guess, angle_rad, jacobian,
            )  # fmt: skip
            first, guess = end, end - first
        excess += work.node[EXCESS + DEGREE]
        change += work.node[LOSS + DEGREE] * (1.0 + change)
        k += 1
        if k % 2 == 0 and level > 0:
            k, level = k // 2, level - 1
    end_radius = radius * (1.0 + change)
    _end(work, end_radius, y, row)
    return end_radius - m, excess, first, coarsest
