"""What the engine and its callers must agree on, free of Numba: sizes, and where what lies.

A call hands over one record, its workspace, and arrays for half cycles, times and results: the
engine allocates nothing. `WORK` declares what lies in the record; kernels read its
fields as attributes, `work.sigma`. What a call is about stands first, in the order of `REQUEST`.
"""

import ctypes
import struct
from typing import Any, Final, NamedTuple

import numpy as np

WORD: Final[Any] = ctypes.c_int64


class Kind(NamedTuple):
    """What an annotation means."""

    item: np.dtype[Any] | None
    """The type of an array's numbers; None for a number."""
    axes: int
    words: list[Any]
    """What stands for it in a call: the number; a record's address; or of an array who owns it
    (two), its size, that of an item, its address, its shape and its strides."""


KINDS: Final = {
    "FloatArray": Kind(np.dtype(np.float64), 1, 7 * [WORD]),
    "Matrix": Kind(np.dtype(np.float64), 2, 9 * [WORD]),
    "Stack": Kind(np.dtype(np.float64), 3, 11 * [WORD]),
    "IntArray": Kind(np.dtype(np.int64), 1, 7 * [WORD]),
    "IntMatrix": Kind(np.dtype(np.int64), 2, 9 * [WORD]),
    "Work": Kind(np.dtype(np.float64), 1, [WORD]),
    "float": Kind(None, 0, [ctypes.c_double]),
    "int": Kind(None, 0, [WORD]),
    "None": Kind(None, 0, [WORD]),
}
"""By the name of an annotation."""

DEGREE: Final = 16
"""Of the polynomials on a panel."""
NODE_COUNT: Final = DEGREE + 1
"""Lobatto's, of which both ends are nodes."""
NODE_SIZE: Final = 504
"""Of the workspace of one panel; see `panel.py`."""
SLOTS: Final = 16
"""Panels whose nodes and last solutions are kept."""
HEAD: Final = 2
"""The first numbers of a half cycle's row; see `half_cycle.py`."""
FEW_POINTS, MOST_POINTS = 12, 18
"""Half cycles in a table: multiples of six (see `table.look_up`)."""
MOST_PANELS: Final = 8
"""Panels to a half cycle in a table."""
THETA: Final = 512
"""Places within a panel whose waves are computed together: 4 kB stay in the nearest cache."""

TABLE: Final = MOST_POINTS + 1  # behind the row of scratch
ROW: Final = TABLE + MOST_POINTS
"""Half cycles are rows of one matrix (see `half_cycle.py`): those that a table is made of and one
of scratch, from `TABLE` on the table, and in the row `ROW`, the last, the half cycle in hand."""

RUNNING, STOPPED, OVERDAMPED = range(3)
ENDINGS: Final = 3
"""How a march ends."""

_RATES: Final = 4
"""a, both parts of b, and c."""
_S: Final = _RATES + 1
"""Sensitivities: to the amplitude, and to the rates."""
Work = Any
"""A record of `WORK`."""
# The arrays of the engine, one behind the other.
WORK: Final = np.dtype(
    [
        ("shape", "f8", 6),  # m, h, q, g, k, f of `panel.py`
        ("omega", "f8"),
        ("release_s", "f8"),
        ("offset", "f8"),
        ("sign", "f8"),  # the side of the turning point in hand
        ("first_sign", "f8"),  # and of the release
        ("release", "f8"),  # its angle, positive
        ("until_s", "f8"),  # after it no turning point is wanted
        ("most", "i8"),  # turning points that are wanted
        ("rates", "i8"),
        ("sensitivities", "i8"),  # to the amplitude and the rates; or none
        ("polynomials", "i8"),  # of a panel
        ("head", "i8"),  # of a half cycle's row: its length, and that of each panel's part
        ("per_panel", "i8"),
        ("rate", "f8", _RATES),  # the rates themselves
        ("directions", "f8", (_S, 4)),  # of m, h, q and g by the amplitude (none), and each rate
        # d ln r/dp and dtau/dp at fixed phase, at the end of the last panel that was resolved
        ("sigma", "f8", _S),
        ("shift", "f8", _S),
        # dy/dp and dtau/dp at the last turning point
        ("amplitude", "f8", _S),
        ("clock", "f8", _S),
        ("segment", "f8", 6),  # what the table spans; see `table.py`
        ("wanted", "f8", 2),  # how `march` lays out its tables
        ("columns", "f8", (_S + 1, NODE_COUNT)),  # dx/dp, and x
        ("chebyshev", "f8", (NODE_COUNT, NODE_COUNT)),
        # the polynomials of the angle, its velocity and its derivatives
        ("total", "f8", (_S + 2, NODE_COUNT)),
        ("theta", "f8", THETA),  # a block of places within a panel
        ("nodes", "f8", (SLOTS, NODE_SIZE)),  # panels; see `panel.py`
    ]
)
WORK_SIZE: Final = WORK.itemsize // 8
"""In numbers: Python hands it over as an array of them."""
REQUEST: Final = struct.Struct("=13d6q")
"""The first fields, from the shape to the length of a panel's part."""
