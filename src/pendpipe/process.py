"""What our processes ask of the system: one thread, and memory that is kept."""

import os
import sys
from typing import Final

ONE_THREAD: Final = {
    "OMP_NUM_THREADS": "1",
    "OPENBLAS_NUM_THREADS": "1",
    "MKL_NUM_THREADS": "1",
    "VECLIB_MAXIMUM_THREADS": "1",
}
"""What keeps numpy's linear algebra to one thread, where it is set before numpy is loaded."""

_MMAP_THRESHOLD: Final = -3
_TRIM_THRESHOLD: Final = -1
"""Of mallopt(3)."""
_KEPT: Final = 2**30


def one_thread() -> None:
    """Let numpy, loaded after this, keep to one thread, unless the user has said otherwise.

    Our matrices are small: more threads take twice the time of the processor and end no sooner.
    """
    for variable, number in ONE_THREAD.items():
        os.environ.setdefault(variable, number)


def keep_memory() -> None:
    """Let glibc keep what numpy's arrays leave.

    Without it each large array is mapped anew, page by page, and unmapped: up to a quarter of
    the time of a diagnosis. Only our own programs ask for it, since it holds for the whole process;
    without glibc nothing changes.
    """
    if sys.platform != "linux":
        return
    import ctypes

    mallopt = getattr(ctypes.CDLL(None), "mallopt", None)
    if mallopt is not None:
        mallopt(_MMAP_THRESHOLD, _KEPT)
        mallopt(_TRIM_THRESHOLD, _KEPT)
