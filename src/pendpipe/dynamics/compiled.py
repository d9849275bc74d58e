"""The compiled entry to the engine.

Numba notices a change of the file in which a cached function stands, but not of the files whose
functions it calls. So the digest of all of them is a free variable of the entry, which is part
of the key under which Numba keeps it.
"""

from __future__ import annotations

import hashlib
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

from numba import njit

from pendpipe.dynamics.march import march

if TYPE_CHECKING:
    from collections.abc import Callable

    from pendpipe.arrays import FloatArray

_SOURCES = (
    "chebyshev.py", "emission.py", "half_cycle.py", "march.py", "panel.py", "sensitivities.py",
    "table.py", "workspace.py",
)  # fmt: skip


def _digest() -> int:
    """Return a number that changes with the engine's sources."""
    folder = Path(__file__).parent
    text = b"".join((folder / name).read_bytes() for name in _SOURCES)
    return int.from_bytes(hashlib.blake2b(text, digest_size=6).digest())


@cache
def engine() -> Callable[..., tuple[int, int]]:
    """Return `march.march`, compiled; the first call in a new installation takes a while."""
    sources = _digest()

    def run(
        constants: FloatArray, directions: FloatArray, rates: FloatArray, y: float,
        tabulate: bool, most: int, until_s: float,
        time_s: FloatArray, angle_rad: FloatArray, jacobian: FloatArray, turning: FloatArray,
        buffer: FloatArray,
    ) -> tuple[int, int]:  # fmt: skip
        buffer[0] = sources  # a use, so that it is a free variable
        return march(
            constants, directions, rates, y, tabulate, most, until_s,
            time_s, angle_rad, jacobian, turning, buffer,
        )  # fmt: skip

    return njit(run, cache=True, _nrt=False, error_model="numpy")  # type: ignore[no-any-return]
