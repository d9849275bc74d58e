"""The arrays that a march needs, carved out of one buffer: the engine allocates nothing."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from pendpipe.dynamics import layout
from pendpipe.dynamics.layout import (
    BATCH,
    DESCRIPTION,
    MOMENTS,
    MOST_PANELS,
    MOST_POINTS,
    NODE_COUNT,
    NODE_SIZE,
    SLOTS,
    THETA,
)
from pendpipe.dynamics.panel import kernel
from pendpipe.dynamics.views import matrix

if TYPE_CHECKING:
    from pendpipe.arrays import FloatArray


class Work(NamedTuple):
    """Workspace and constants of a march; S sensitivities (the amplitude and S - 1 rates)."""

    shape: FloatArray
    """m, h, q, g, k of `panel.py`."""
    directions: FloatArray
    """(S - 1, 4): the derivatives of m, h, q and g by each rate."""
    rates: FloatArray
    """(S - 1,): the rates themselves."""
    motion: FloatArray
    """omega, the time of the release, the offset."""
    nodes: FloatArray
    """(SLOTS, NODE_SIZE): the panels of the last half cycles; see `panel.py`."""
    sigma: FloatArray
    """(S,): d ln r/dp at fixed phase, at the end of the panel in hand."""
    shift: FloatArray
    """(S,): dtau/dp at fixed phase, since the start of the half cycle."""
    kept: FloatArray
    """(2, S): `sigma` and `shift` at the start of the panel, in case it must be halved."""
    columns: FloatArray
    """(S + 1, 17): dx/dp at the nodes, and x."""
    chebyshev: FloatArray
    """(17, 17): T_k where the nodes of time lie."""
    amplitude: FloatArray
    """(S,): dy/dp at the last turning point."""
    clock: FloatArray
    """(S,): dtau/dp at the last turning point."""
    row: FloatArray
    """The half cycle in hand; see `half_cycle.py`."""
    rows: FloatArray
    """The half cycles that a table is made of, and one row of scratch."""
    segment: FloatArray
    """What the table spans; see `table.py`."""
    table: FloatArray
    total: FloatArray
    """(S + 2, 17): the polynomials of the angle, its velocity and its derivatives."""
    theta: FloatArray
    """A block of places within a panel."""
    readings: FloatArray
    """What the samples are compared with; empty if they are not."""
    sums: FloatArray
    """What comes of it; see `comparison.py`."""
    moments: FloatArray
    """(18,): of the residuals of a block."""
    power: FloatArray
    """Residuals times a power of their place."""
    some: FloatArray
    """(columns, BATCH): the Jacobian's columns at some places of the last panels."""
    weights: FloatArray
    """(BATCH,): how many readings each of these places stands for."""
    wanted: FloatArray
    """How `march` lays out its tables; and how many of the places are taken."""


most_columns = kernel(layout.most_columns)
panel_width = kernel(layout.panel_width)
row_width = kernel(layout.row_width)


@kernel
def carve(
    buffer: FloatArray,
    constants: FloatArray,
    directions: FloatArray,
    rates: FloatArray,
    readings: FloatArray,
    sums: FloatArray,
    sensitivities: int,
    polynomials: int,
) -> Work:
    """Cut `buffer` and `constants` into the arrays of a march."""
    s, n = sensitivities, NODE_COUNT
    width = row_width(s, polynomials, MOST_PANELS)
    points = MOST_POINTS
    nodes, rest = matrix(buffer, SLOTS, NODE_SIZE), buffer[SLOTS * NODE_SIZE :]
    sigma, rest = rest[:s], rest[s:]
    shift, rest = rest[:s], rest[s:]
    kept, rest = matrix(rest, 2, s), rest[2 * s :]
    columns, rest = matrix(rest, s + 1, n), rest[(s + 1) * n :]
    chebyshev, rest = matrix(rest, n, n), rest[n * n :]
    amplitude, rest = rest[:s], rest[s:]
    clock, rest = rest[:s], rest[s:]
    row, rest = rest[:width], rest[width:]
    rows, rest = (
        matrix(rest, points + 1, width),
        rest[(points + 1) * width :],
    )
    segment, rest = rest[:DESCRIPTION], rest[DESCRIPTION:]
    table, rest = matrix(rest, points, width), rest[points * width :]
    total, rest = matrix(rest, s + 2, n), rest[(s + 2) * n :]
    columns_shown = most_columns(s)
    theta, rest = rest[:THETA], rest[THETA:]
    moments, rest = rest[:MOMENTS], rest[MOMENTS:]
    power, rest = rest[:THETA], rest[THETA:]
    some, rest = matrix(rest, columns_shown, BATCH), rest[columns_shown * BATCH :]
    weights, rest = rest[:BATCH], rest[BATCH:]
    return Work(
        constants[:5], directions, rates, constants[5:8], nodes, sigma, shift, kept,
        columns, chebyshev, amplitude, clock, row, rows, segment, table, total,
        theta, readings, sums, moments, power, some, weights, rest,
    )  # fmt: skip
