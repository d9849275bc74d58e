"""Sizes that the engine and its callers must agree on; free of Numba."""

from __future__ import annotations

DEGREE = 16
"""Of the polynomials on a panel."""
NODE_COUNT = DEGREE + 1
NODE_SIZE = 504
"""Of the workspace of one panel; see `panel.py`."""
SLOTS = 16
"""Panels whose nodes and last solutions are kept."""
HEAD = 2
"""The first numbers of a half cycle's row; see `half_cycle.py`."""
FEW_POINTS, MOST_POINTS = 12, 18
"""Half cycles in a table: multiples of six (see `table.look_up`)."""
MOST_PANELS = 8
"""Panels to a half cycle in a table."""
DESCRIPTION = 6
THETA = 512
CONSTANTS = 10
"""m, h, q, g, k, omega; time and offset of the release, and twice the side of the release."""
MOMENTS = NODE_COUNT + 1
PLACES = 8
"""Of a panel, at which the normal matrix is taken; see `comparison.py`."""
BATCH = 8 * PLACES
"""Places that are multiplied in one go."""

RUNNING, STOPPED, OVERDAMPED = 0, 1, 2
"""How a march ends."""


def panel_width(polynomials: int) -> int:
    """Return how many numbers of a half cycle's row belong to one panel."""
    return 1 + polynomials * NODE_COUNT if polynomials > 0 else 0


def row_width(sensitivities: int, polynomials: int, panels: int) -> int:
    """Return the length of a half cycle's row."""
    width = 1 + polynomials * NODE_COUNT if polynomials > 0 else 0
    return HEAD + 2 * sensitivities + panels * width


def work_size(sensitivities: int, polynomials: int) -> int:
    """Return how many numbers `workspace.carve` needs."""
    s, n, width = sensitivities, NODE_COUNT, row_width(sensitivities, polynomials, MOST_PANELS)
    matrices = (2 * s + 3 + n) * n + (2 * MOST_POINTS + 2) * width
    compared = MOMENTS + THETA + (most_columns(s) + 1) * BATCH
    return SLOTS * NODE_SIZE + 3 + 6 * s + matrices + DESCRIPTION + THETA + compared


def most_columns(sensitivities: int) -> int:
    """Return the columns of the Jacobian: rates, omega, angle, time, offset."""
    return sensitivities + 3 if sensitivities > 0 else 0


def sums_size(columns: int) -> int:
    """Return how many numbers a comparison gives: chi^2, gradient, normal matrix."""
    return 1 + columns * (1 + columns)


def inputs_size(directions: int) -> int:
    """Return how many numbers tell the engine what to do: constants, rates, directions."""
    return CONSTANTS + 5 * directions
