"""The engine's entry for callers outside Numba: one address, so that it can be kept as code."""

from __future__ import annotations

from typing import Any

from numba import cfunc, types

from pendpipe.dynamics import layout
from pendpipe.dynamics.layout import MOST_PANELS, OVERDAMPED, REQUEST
from pendpipe.dynamics.march import march
from pendpipe.dynamics.panel import kernel, row_width
from pendpipe.dynamics.views import gather, vector

_STATES = OVERDAMPED + 1
_SIZE = len(REQUEST)
_RATES, _TABULATE, _MOST, _SAMPLES, _ROOM, _COMPARED = (
    REQUEST.index(name) for name in ("rates", "tabulate", "most", "samples", "room", "compared")
)
_sums_size = kernel(layout.sums_size)


def _entry(request: Any) -> int:
    """Run `march.march` on a `layout.REQUEST`; return its two numbers as one."""
    asked = vector(request, _SIZE)
    rates, samples, compared = asked[_RATES], asked[_SAMPLES], asked[_COMPARED]
    sensitivities = rates + 1 if rates > 0 else 0
    parameters = rates + 4 if rates > 0 else 0
    polynomials = sensitivities + 1 if samples > 0 else 0
    counts = (
        rates,
        sensitivities,
        parameters,
        samples,
        samples - compared,
        2 + 2 * parameters,
        asked[_ROOM],
        compared,
        _sums_size(parameters) if compared > 0 else 0,
        polynomials,
        row_width(sensitivities, polynomials, MOST_PANELS),
    )
    work = gather(request, counts)
    count, state = march(work, asked[_TABULATE] != 0, asked[_MOST])
    return _STATES * count + state


def compiled_entry() -> Any:
    """Compile the engine."""
    signature = types.int64(types.CPointer(types.int64))  # type: ignore[no-untyped-call]
    return cfunc(signature, _nrt=False, error_model="numpy")(_entry)  # type: ignore[call-arg]
