"""The arrays that a march needs, carved out of one buffer: the engine allocates nothing."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from pendpipe.dynamics.panel import NODE_COUNT, NODE_SIZE, kernel

if TYPE_CHECKING:
    from pendpipe.arrays import FloatArray

HEAD = 2
MOST_POINTS = 18
MOST_PANELS = 4
_DESCRIPTION = 6
_THETA = 512


class Work(NamedTuple):
    """Workspace and constants of a march; S sensitivities (the amplitude and S - 1 rates)."""

    shape: FloatArray
    """m, h, q, g of `panel.py`."""
    directions: FloatArray
    """(S - 1, 4): the derivatives of m, h, q and g by each rate."""
    rates: FloatArray
    """(S - 1,): the rates themselves."""
    motion: FloatArray
    """omega, the time of the release, the offset."""
    node: FloatArray
    """The panel in hand; see `panel.py`."""
    placed: FloatArray
    """Start and half width of that panel."""
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
    cosines: FloatArray
    segment: FloatArray
    """What the table spans; see `table.py`."""
    table: FloatArray
    total: FloatArray
    """(S + 2, 17): the polynomials of the angle, its velocity and its derivatives."""
    theta: FloatArray
    """A block of places within a panel."""
    wanted: FloatArray
    """How `march` lays out its tables."""


@kernel
def panel_width(polynomials: int) -> int:
    """Return how many numbers of a row belong to one panel."""
    return 1 + polynomials * NODE_COUNT if polynomials > 0 else 0


@kernel
def row_width(sensitivities: int, polynomials: int, panels: int) -> int:
    """Return the length of a half cycle's row."""
    return HEAD + 2 * sensitivities + panels * panel_width(polynomials)


def buffer_size(sensitivities: int, polynomials: int) -> int:
    """Return how long a buffer `carve` needs."""
    per_panel = 1 + polynomials * NODE_COUNT if polynomials > 0 else 0
    width = HEAD + 2 * sensitivities + MOST_PANELS * per_panel
    fixed = NODE_SIZE + 2 + NODE_COUNT * NODE_COUNT + 4 * MOST_POINTS + _DESCRIPTION + _THETA + 2
    return (
        fixed
        + 6 * sensitivities
        + (2 * sensitivities + 3) * NODE_COUNT
        + (2 * MOST_POINTS + 2) * width
    )


@kernel
def carve(
    buffer: FloatArray,
    constants: FloatArray,
    directions: FloatArray,
    rates: FloatArray,
    sensitivities: int,
    polynomials: int,
) -> Work:
    """Cut `buffer` and `constants` (m, h, q, g, omega, time, offset) into the arrays of a march."""
    s, n = sensitivities, NODE_COUNT
    width = row_width(s, polynomials, MOST_PANELS)
    points = MOST_POINTS
    node, rest = buffer[:NODE_SIZE], buffer[NODE_SIZE:]
    placed, rest = rest[:2], rest[2:]
    sigma, rest = rest[:s], rest[s:]
    shift, rest = rest[:s], rest[s:]
    kept, rest = rest[: 2 * s].reshape(2, s), rest[2 * s :]
    columns, rest = rest[: (s + 1) * n].reshape(s + 1, n), rest[(s + 1) * n :]
    chebyshev, rest = rest[: n * n].reshape(n, n), rest[n * n :]
    amplitude, rest = rest[:s], rest[s:]
    clock, rest = rest[:s], rest[s:]
    row, rest = rest[:width], rest[width:]
    rows, rest = (
        rest[: (points + 1) * width].reshape(points + 1, width),
        rest[(points + 1) * width :],
    )
    cosines, rest = rest[: 4 * points], rest[4 * points :]
    segment, rest = rest[:_DESCRIPTION], rest[_DESCRIPTION:]
    table, rest = rest[: points * width].reshape(points, width), rest[points * width :]
    total, rest = rest[: (s + 2) * n].reshape(s + 2, n), rest[(s + 2) * n :]
    return Work(
        constants[:4], directions, rates, constants[4:7], node, placed, sigma, shift, kept,
        columns, chebyshev, amplitude, clock, row, rows, cosines, segment, table, total,
        rest[:_THETA], rest[_THETA:],
    )  # fmt: skip
