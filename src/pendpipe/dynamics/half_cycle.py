"""One half cycle of Eq. 8 by the phase clock: panel after panel, halved where it must be.

What a half cycle hands on is one row of numbers, the same whether it was solved here or read
from the table (`table.py`):

    [0]  ln(y/y'), the loss of amplitude          [1]  duration in radians, less pi
         (for the sine ln(y C'/(C y')), the loss of `panel.log_amplitude`)
    [HEAD ...]  for each sensitivity (the amplitude y at the start, then the rates)
                dy'/dy or (dy'/dp)/y, and after these y dtau/dy or dtau/dp
    then for each panel   tau - w at its end, and the polynomials of degree 16 in time:
                x/y, dx/dy, (dx/dp)/y at fixed time since the start of the half cycle.

An amplitude y is one of s (see `panel.py`), x is the angle.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from pendpipe.dynamics.emission import emit
from pendpipe.dynamics.kernel import kernel
from pendpipe.dynamics.layout import DEGREE, HEAD, NODE_COUNT, SLOTS
from pendpipe.dynamics.panel import (
    COS,
    CURVATURE,
    EXCESS,
    LOSS,
    angle_of,
    complement_for,
    curve,
    log_amplitude,
    panel_width,
    place,
    polynomial,
    solve,
    time_nodes,
    unresolved,
)
from pendpipe.dynamics.sensitivities import sensitivities

if TYPE_CHECKING:
    from pendpipe.arrays import FloatArray
    from pendpipe.dynamics.layout import Work

LOSS_TOLERANCE = 5e-9
"""Bound of `solve`'s estimate, a thousand times the error: that is 5e-12 of a half cycle's loss."""
WAVEFORM_TOLERANCE, SINE_TOLERANCE = 1e-12, 2e-11
"""Of the polynomial in time, relative to the amplitude."""
FINEST = 30
"""The finest panel is a half cycle halved so often; it is accepted as it is."""


@kernel
def _start(work: Work, radius: float) -> None:
    """Set d ln r/dp and dtau/dp at the turning point y = m + r."""
    for c in range(work.sensitivities):
        work.sigma[c] = 1.0 / radius if c == 0 else -work.directions[c - 1, 0] / radius
        work.shift[c] = 0.0


@kernel
def _end(work: Work, radius: float, y: float, row: FloatArray) -> None:
    """Write the derivatives of the next turning point, y' = r - m, to the row's head."""
    columns = work.sensitivities
    for c in range(columns):
        if c == 0:
            row[HEAD] = radius * work.sigma[0]
            row[HEAD + columns] = y * work.shift[0]
        else:
            row[HEAD + c] = (radius * work.sigma[c] - work.directions[c - 1, 0]) / y
            row[HEAD + columns + c] = work.shift[c]


@kernel
def _solve_panel(
    work: Work,
    node: FloatArray,
    radius: float,
    p: int,
    panels: int,
    y: float,
    complement: float,
    finest: bool,
    polynomials: FloatArray,
) -> bool:
    """Solve panel p of `panels` with all that is asked of it; return whether it is resolved."""
    half_width = 0.5 * math.pi / panels
    place(node, 2.0 * p * half_width, half_width, complement)
    tolerance = math.inf if finest else LOSS_TOLERANCE
    if not solve(node, work.shape, radius, half_width, tolerance):
        return False
    if work.sensitivities > 0:
        sensitivities(work, node, radius, half_width)
    if polynomials.size == 0:
        return True
    return _in_time(work, node, radius, half_width, y, polynomials) or finest


@kernel
def _in_time(
    work: Work,
    node: FloatArray,
    radius: float,
    half_width: float,
    y: float,
    polynomials: FloatArray,
) -> bool:
    """Write a solved panel's polynomials in time; return whether they resolve the waveform."""
    n, count = NODE_COUNT, work.sensitivities
    time_nodes(node, half_width, work.chebyshev)
    waveform = work.columns[count]
    for j in range(n):
        s = work.shape[0] + radius * (1.0 + node[LOSS + j]) * node[COS + j]
        waveform[j] = angle_of(work.shape, s) / y
    polynomial(node, waveform, work.chebyshev, polynomials, 0)
    bent = work.shape[CURVATURE] > 0.0
    resolved = unresolved(waveform, 0) <= (SINE_TOLERANCE if bent else WAVEFORM_TOLERANCE)
    for c in range(count):
        column = work.columns[c]
        if c > 0:
            for j in range(n):
                column[j] /= y
        polynomial(node, column, work.chebyshev, polynomials, (c + 1) * n)
    return resolved


@kernel
def even_half_cycle(work: Work, y: float, complement: float, panels: int, row: FloatArray) -> bool:
    """Solve a half cycle on `panels` equal panels into `row`; return whether these resolve it."""
    m = work.shape[0]
    radius = y - m
    _start(work, radius)
    change, excess = 0.0, 0.0
    width = panel_width(work.polynomials)
    at = HEAD + 2 * work.sensitivities
    for p in range(panels):
        node = work.nodes[(panels + p) % SLOTS]
        if not _solve_panel(
            work,
            node,
            radius * (1.0 + change),
            p,
            panels,
            y,
            complement,
            False,
            row[at + 1 : at + width],
        ):
            return False
        excess += node[EXCESS + DEGREE]
        if width > 0:
            row[at] = excess
            at += width
        change += node[LOSS + DEGREE] * (1.0 + change)
    gain = radius * change - 2.0 * m
    row[0] = -math.log1p(gain / y)
    if work.shape[CURVATURE] > 0.0:
        row[0] += 0.5 * math.log1p(-0.25 * gain * (2.0 * y + gain) / curve(work.shape, y) ** 2)
    row[1] = excess
    _end(work, radius * (1.0 + change), y, row)
    return True


@kernel
def direct_half_cycle(
    work: Work, y: float, begin: float, level: int, first: int, guess: int
) -> tuple[float, float, int, int]:
    """Solve a half cycle on panels as fine as it needs, and write its samples.

    `begin` is its start in radians since the release, `level` the number of halvings to begin
    with. Returns the amplitude at its end (negative if the pendulum stops before it reaches
    its equilibrium), its duration less pi, the index of the next sample, and the number of
    halvings it began with, which is negative if the pendulum is overdamped.
    """
    m, row = work.shape[0], work.row
    radius = y - m
    complement = complement_for(work.shape, log_amplitude(work.shape, y))
    _start(work, radius)
    change, excess, k = 0.0, 0.0, 0
    coarsest, at = -1, HEAD + 2 * work.sensitivities
    width = work.polynomials * NODE_COUNT
    while k < 1 << level:
        panels = 1 << level
        node = work.nodes[(panels + k) % SLOTS]
        for c in range(work.sensitivities):
            work.kept[0, c], work.kept[1, c] = work.sigma[c], work.shift[c]
        if not _solve_panel(
            work,
            node,
            radius * (1.0 + change),
            k,
            panels,
            y,
            complement,
            level >= FINEST,
            row[at : at + width],
        ):
            if level >= FINEST:
                return y, 0.0, first, -1
            for c in range(work.sensitivities):
                work.sigma[c], work.shift[c] = work.kept[0, c], work.kept[1, c]
            level, k = level + 1, 2 * k
            continue
        if coarsest < 0:
            coarsest = level
        duration = math.pi / panels + node[EXCESS + DEGREE]
        if width > 0:
            begins = begin + math.pi * k / panels + excess
            end = emit(work, row[at : at + width], begins, duration, y, first, guess)
            first, guess = end, end - first
        excess += node[EXCESS + DEGREE]
        change += node[LOSS + DEGREE] * (1.0 + change)
        k += 1
        if k % 2 == 0 and level > 0:
            k, level = k // 2, level - 1
    end_radius = radius * (1.0 + change)
    _end(work, end_radius, y, row)
    return end_radius - m, excess, first, coarsest
