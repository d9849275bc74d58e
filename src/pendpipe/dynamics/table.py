"""The tabulated half-cycle map.

Without explicit time dependence a half cycle depends on its amplitude y alone, and smoothly on
ln y as long as y is well above the amplitude m of the stop. So a few half cycles are solved,
at Chebyshev points in ln y, and all others are interpolated: every number of a half cycle's row
(see `half_cycle.py`) becomes a polynomial in z = (ln y - middle)/half_span.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.polynomial.chebyshev import chebpts1

from pendpipe.arrays import FloatArray
from pendpipe.dynamics.chebyshev import analysis, powers_of_chebyshev
from pendpipe.dynamics.half_cycle import half_cycle
from pendpipe.dynamics.kernel import Matrix, kernel
from pendpipe.dynamics.layout import FEW_POINTS, MOST_POINTS, TABLE, Work
from pendpipe.dynamics.panel import (
    CURVATURE,
    amplitude_at,
    complement_for,
    curve,
    quadratic_at_rest,
)

_WIDEST, _FEW = 5.2, 0.31
"""The widest range of ln y that one table spans, and the share of it that few points resolve."""
NARROWEST = 0.01
"""A narrower range would suffer from the rounding of ln y."""
SMOOTH_FROM = 20.0
"""Below this multiple of m, half cycles are solved one by one."""
_LOSS_TOLERANCE = 5e-11
"""Of the last two coefficients, relative to the least loss; what follows is 30 times less."""
_WAVEFORM_TOLERANCE = 1e-10
"""Of the last coefficients of a waveform, over the amplitude: the engine's own accuracy."""
_EXCESS_TOLERANCE = 1e-11
"""The same of what a pendulum's half cycle lasts longer, which adds up over a record."""
_LOW_POWERS = 4
"""Of time in x/y that are asked: the higher ones are mostly rounding."""

_POWERS: FloatArray = powers_of_chebyshev(MOST_POINTS)
_FEW_NODES, _MANY_NODES = chebpts1(FEW_POINTS), chebpts1(MOST_POINTS)
_FEW_ANALYSIS, _MANY_ANALYSIS = analysis(_FEW_NODES), analysis(_MANY_NODES)

_NONE: FloatArray = np.empty(0)
"""No times."""

# Entries of a segment's description.
LOW, HIGH, MIDDLE, INVERSE, POINTS, PANELS = range(6)
DONE, MORE_PANELS, LESS_SPAN = range(3)


@kernel()
def widest(shape: FloatArray, log_y: float) -> float:
    """Return the widest span below ln y that a table resolves to 1e-12.

    What a half cycle of the linear pendulum does is a sum of powers of y, entire in ln y. The
    sine's elliptic integrals have a branch point at ln y = ln 2 + i pi/2, where k^2 is infinite.
    """
    if shape[CURVATURE] == 0.0:
        return _WIDEST
    above = max(0.0, math.log(2.0) - log_y)
    return min(_WIDEST, 0.8 * math.sqrt(above * above + 0.25 * math.pi * math.pi))


@kernel()
def points_for(shape: FloatArray, log_y: float, span: float) -> int:
    """Return how many points, a multiple of six, resolve a span below ln y."""
    return FEW_POINTS if span < _FEW * widest(shape, log_y) else MOST_POINTS


@kernel()
def half_cycles_and_span(
    shape: FloatArray, log_y: float, half_cycles: float, room: float
) -> tuple[float, float]:
    """Estimate how far ln y falls in `half_cycles`, at most by `room`: half cycles, span.

    By the slow equation 13, ln(y/y') = 2 (delta/y + h + q y) + pi g, good to a few per cent and
    only used to lay out tables: nothing is lost but time if it is wrong.
    """
    m, h, q, g = shape[0], shape[1], shape[2], shape[3]
    delta = m * (curve(shape, m) - h - quadratic_at_rest(shape) * m)
    step = min(0.125, room / 8.0)
    count, span = 0.0, 0.0
    while span < room:
        y = amplitude_at(shape, log_y - span - 0.5 * step)
        loss = 2.0 * (delta / y + h + q * y) + math.pi * g + 1e-300
        loss /= curve(shape, y) ** 2
        if count + step / loss >= half_cycles:
            span += (half_cycles - count) * loss * 1.03 + 2.0 * loss
            return half_cycles, min(max(span, NARROWEST), room)
        count += step / loss
        span += step
    return count, room


@kernel()
def build(work: Work, rows: Matrix, log_y: float, span: float, panels: int) -> int:
    """Tabulate the half cycles with ln y from log_y - span to log_y in `rows`.

    Returns DONE, or what stands in the way: a half cycle needs more panels, or the span is too
    wide for the points.
    """
    points, half = points_for(work.shape, log_y, span), 0.5 * span
    segment = work.segment
    segment[MIDDLE], segment[INVERSE] = log_y - half, 1.0 / half
    segment[POINTS], segment[PANELS] = points, panels
    width = work.head + panels * work.per_panel
    level, complement = int(math.log2(panels)), complement_for(work.shape, log_y)
    nodes = _MANY_NODES if points == MOST_POINTS else _FEW_NODES
    for i in range(points):
        y = amplitude_at(work.shape, log_y - half + half * nodes[i])
        if half_cycle(work, _NONE, rows, rows[i], y, complement, 0.0, level, 0, 0, True)[3] < 0:
            return MORE_PANELS
    # The sine's excess is no work of the losses, and not to be measured by them.
    excess = _EXCESS_TOLERANCE if work.shape[CURVATURE] > 0.0 else 0.0
    if not _interpolate(points, width, rows, work.head, work.per_panel, excess, rows[TABLE:]):
        return LESS_SPAN
    segment[LOW], segment[HIGH] = log_y - span, log_y
    return DONE


def _transformed(
    points: int,
    width: int,
    rows: FloatArray,
    first: int,
    per_panel: int,
    excess: float,
    table: FloatArray,
) -> bool:
    own = _MANY_ANALYSIS if points == MOST_POINTS else _FEW_ANALYSIS
    found = own @ rows[:points, :width]
    table[:points, :width] = _POWERS[:points, :points].T @ found
    last, least = abs(found[-2:]), _LOSS_TOLERANCE * rows[:points, 0].min()
    power = (np.arange(width) - first) % per_panel
    low = (np.arange(width) >= first) & (power > 0) & (power <= _LOW_POWERS)
    within = [last[:, 0] <= least, last[:, 1] <= max(least, excess)]
    return bool(np.all(within) and np.all(last[:, low] <= _WAVEFORM_TOLERANCE))


@kernel(arrays=_transformed)
def _interpolate(
    points: int,
    width: int,
    rows: FloatArray,
    first: int,
    per_panel: int,
    excess: float,
    table: FloatArray,
) -> bool:
    """Turn the solved rows into polynomials in z; return whether their coefficients die out."""
    for k in range(points):
        for j in range(width):
            table[k, j] = 0.0
    least = rows[0, 0]
    for i in range(points):
        least = min(least, rows[i, 0])
    resolved = True
    scratch = rows[MOST_POINTS]
    own = _MANY_ANALYSIS if points == MOST_POINTS else _FEW_ANALYSIS
    for k in range(points):
        for j in range(width):
            scratch[j] = 0.0
        for i in range(points):
            weight = own[k, i]
            for j in range(width):
                scratch[j] += weight * rows[i, j]
        if k >= points - 2:
            resolved = resolved and abs(scratch[0]) <= _LOSS_TOLERANCE * least
            resolved = resolved and abs(scratch[1]) <= max(_LOSS_TOLERANCE * least, excess)
            # The low powers of time in x/y stand for all: the high ones are mostly rounding.
            for j in range(first, width):
                if 0 < (j - first) % per_panel <= _LOW_POWERS:
                    resolved = resolved and abs(scratch[j]) <= _WAVEFORM_TOLERANCE
        for i in range(k + 1):
            power = _POWERS[k, i]
            if power != 0.0:
                for j in range(width):
                    table[i, j] += power * scratch[j]
    return resolved


def _series(
    segment: FloatArray, table: FloatArray, log_y: float, width: int, row: FloatArray
) -> None:
    z, points = (log_y - segment[MIDDLE]) * segment[INVERSE], int(segment[POINTS])
    row[:width] = z ** np.arange(points) @ table[:points, :width]


@kernel(arrays=_series)
def look_up(
    segment: FloatArray, table: FloatArray, log_y: float, width: int, row: FloatArray
) -> None:
    """Write the half cycle that starts at ln y = log_y to `row`."""
    z = (log_y - segment[MIDDLE]) * segment[INVERSE]
    for j in range(width):
        row[j] = 0.0
    # Horner's scheme on all entries at once, six powers in a pass to spare the memory.
    for k in range(int(segment[POINTS]) - 6, -1, -6):
        t0, t1, t2 = table[k], table[k + 1], table[k + 2]
        t3, t4, t5 = table[k + 3], table[k + 4], table[k + 5]
        for j in range(width):
            upper = ((row[j] * z + t5[j]) * z + t4[j]) * z + t3[j]
            row[j] = ((upper * z + t2[j]) * z + t1[j]) * z + t0[j]


@kernel()
def look_up_turning_point(
    segment: FloatArray, table: FloatArray, log_y: float
) -> tuple[float, float]:
    """Return the loss and the excess duration of the half cycle that starts at ln y = log_y."""
    z = (log_y - segment[MIDDLE]) * segment[INVERSE]
    square = z * z
    # Even and odd powers apart: each half cycle waits for the one before, and so waits less.
    even_loss, odd_loss, even_excess, odd_excess = 0.0, 0.0, 0.0, 0.0
    for k in range(int(segment[POINTS]) - 2, -1, -2):
        even_loss = even_loss * square + table[k, 0]
        odd_loss = odd_loss * square + table[k + 1, 0]
        even_excess = even_excess * square + table[k, 1]
        odd_excess = odd_excess * square + table[k + 1, 1]
    return even_loss + z * odd_loss, even_excess + z * odd_excess
