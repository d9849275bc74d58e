"""Start numba for a short job."""

from __future__ import annotations

import sys


def start_numba() -> None:
    """Import numba without the scipy that it would bring along.

    As soon as numba loads a compiled function it asks scipy.linalg for BLAS, which costs a
    job 0.2 s; no function of ours calls BLAS. A process of the command line is ours alone,
    so nobody misses it there; the library itself leaves numba as it is.
    """
    name = "scipy.linalg.cython_blas"
    if name in sys.modules or "numba" in sys.modules:
        return
    sys.modules[name] = None  # type: ignore[assignment]
    try:
        import numba.np.arraymath  # noqa: F401
    finally:
        del sys.modules[name]
