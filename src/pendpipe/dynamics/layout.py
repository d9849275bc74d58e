"""What the engine and its callers must agree on, free of Numba: sizes, and where what lies.

A call hands over integers: the addresses of arrays (`ADDRESSES`) and numbers of things (`COUNTS`).
One of the arrays is the workspace: the engine allocates nothing. `FIELDS` declares where in it
each array of the engine lies.
"""

from typing import Any, Final, NamedTuple

DEGREE: Final = 16
"""Of the polynomials on a panel."""
NODE_COUNT: Final = DEGREE + 1
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

RUNNING, STOPPED, OVERDAMPED = range(3)
ENDINGS: Final = 3
"""How a march ends."""

COUNTS: Final = (
    "rates",
    "sensitivities",
    "parameters",
    "samples",
    "recorded",
    "room",
    "polynomials",
    "width",
    "most",
)
"""Numbers of rates; of sensitivities (to the amplitude and those); of columns of the Jacobian; of
samples; of what is recorded of a turning point, and of how many; of the polynomials of a panel; the
width of a row; how many turning points are wanted at most."""
Work = Any
"""What the engine works on: the arrays of `FIELDS` and the numbers of `COUNTS`, as attributes."""


class Field(NamedTuple):
    """An array of the engine: where it lies, and its shape.

    Parameters
    ----------
    owner
        The array of which it is a part.
    offset, widths
        Where it begins: so many numbers, and widths of a row, behind the owner's first.
    rows, columns
        Its shape, each a number or the name of one that the engine knows (`COUNTS`),
        with what is added to it; `rows` is None for a vector.
    """

    owner: str
    offset: int
    widths: int
    rows: tuple[str, int] | None
    columns: tuple[str, int]


_MOST_RATES: Final = 4
_S: Final = _MOST_RATES + 1
_INSIDE: Final[dict[str, tuple[int, tuple[str, int] | None, tuple[str, int]]]] = {
    # name: room, rows, columns
    "shape": (5, None, ("", 5)),  # m, h, q, g, k of `panel.py`
    "motion": (3, None, ("", 3)),  # omega, the time of the release, the offset
    "signs": (2, None, ("", 2)),  # the side of the turning point in hand, and of the release
    "limits": (2, None, ("", 2)),  # the angle of the release, and the time of the end
    "rate": (_MOST_RATES, None, ("rates", 0)),  # the rates themselves
    "directions": (4 * _MOST_RATES, ("rates", 0), ("", 4)),  # of m, h, q and g by each rate
    # d ln r/dp and dtau/dp at fixed phase, at the end of the panel in hand, and at its start
    "sigma": (_S, None, ("sensitivities", 0)),
    "shift": (_S, None, ("sensitivities", 0)),
    "kept": (2 * _S, ("", 2), ("sensitivities", 0)),
    # dy/dp and dtau/dp at the last turning point
    "amplitude": (_S, None, ("sensitivities", 0)),
    "clock": (_S, None, ("sensitivities", 0)),
    "segment": (6, None, ("", 6)),  # what the table spans; see `table.py`
    "wanted": (2, None, ("", 2)),  # how `march` lays out its tables
    "columns": ((_S + 1) * NODE_COUNT, ("sensitivities", 1), ("", NODE_COUNT)),  # dx/dp, and x
    "chebyshev": (NODE_COUNT * NODE_COUNT, ("", NODE_COUNT), ("", NODE_COUNT)),
    # the polynomials of the angle, its velocity and its derivatives
    "total": ((_S + 2) * NODE_COUNT, ("sensitivities", 2), ("", NODE_COUNT)),
    "theta": (THETA, None, ("", THETA)),  # a block of places within a panel
    "nodes": (SLOTS * NODE_SIZE, ("", SLOTS), ("", NODE_SIZE)),  # panels; see `panel.py`
}


def _placed() -> tuple[dict[str, Field], int]:
    """Return the fields of the workspace, one behind the other, and their fixed room."""
    fields, offset = {}, 0
    for name, (room, rows, columns) in _INSIDE.items():
        fields[name] = Field("workspace", offset, 0, rows, columns)
        offset += room
    return fields, offset


_FIELDS, _FIXED = _placed()
FIELDS: Final[dict[str, Field]] = _FIELDS | {
    # the half cycle in hand (see `half_cycle.py`), those that a table is made of (and one row of
    # scratch), and the table
    "row": Field("workspace", _FIXED, 0, None, ("width", 0)),
    "rows": Field("workspace", _FIXED, 1, ("", MOST_POINTS + 1), ("width", 0)),
    "table": Field("workspace", _FIXED, MOST_POINTS + 2, ("", MOST_POINTS), ("width", 0)),
    "time_s": Field("time_s", 0, 0, None, ("samples", 0)),
    "angle_rad": Field("angle_rad", 0, 0, None, ("samples", 0)),
    "jacobian": Field("jacobian", 0, 0, ("parameters", 0), ("samples", 0)),
    "turning": Field("turning", 0, 0, ("recorded", 0), ("room", 0)),
}
"""Every array that the engine works on, by name."""


def panel_width(polynomials: int) -> int:
    """Return how many numbers of a half cycle's row belong to one panel."""
    return 1 + polynomials * NODE_COUNT if polynomials > 0 else 0


def row_width(sensitivities: int, polynomials: int, panels: int) -> int:
    """Return the length of a half cycle's row."""
    width = 1 + polynomials * NODE_COUNT if polynomials > 0 else 0
    return HEAD + 2 * sensitivities + panels * width


def work_size(rates: int, samples: int) -> int:
    """Return how many numbers the workspace has."""
    width = counts(rates, samples, 0, 0)[COUNTS.index("width")]
    return _FIXED + (2 * MOST_POINTS + 2) * width


def counts(rates: int, samples: int, room: int, most: int) -> tuple[int, ...]:
    """Return the integers of a call, in the order of `COUNTS`."""
    sensitivities, parameters = (rates + 1, rates + 4) if rates else (0, 0)
    polynomials = sensitivities + 1 if samples else 0
    return (
        rates,
        sensitivities,
        parameters,
        samples,
        2 + 2 * parameters,
        room,
        polynomials,
        row_width(sensitivities, polynomials, MOST_PANELS),
        most,
    )


ADDRESSES: Final = tuple({field.owner: None for field in FIELDS.values()})
"""The arrays of a call."""
