"""Our processes: one thread each, memory that is kept, and how many do something side by side."""

from __future__ import annotations

import os
import sys
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from contextlib import chdir, nullcontext
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

if TYPE_CHECKING:
    from concurrent.futures import Executor, Future

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


def leave_the_folder_out() -> None:
    """Let the working folder run and configure nothing in our programs.

    Python puts it on the path of what is begun by ``-m`` or ``-c``, so a job of Snakemake or a
    worker would import a `signal.py` that lies there; matplotlib reads a `matplotlibrc` there
    when it is imported.
    """
    os.environ["PYTHONSAFEPATH"] = "1"
    if os.path.lexists("matplotlibrc"):
        with chdir(Path(__file__).parent):
            import matplotlib as mpl  # noqa: F401


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


_AHEAD: Final = 4
"""Jobs a process that are taken before the first result is."""


def cores() -> int:
    """How many cores this process may use: a cluster's job has fewer than its node."""
    try:
        return len(os.sched_getaffinity(0))
    except AttributeError:  # Windows, macOS
        return os.cpu_count() or 1


def in_order(
    work: Callable[[Any], Any],
    jobs: Iterable[Any],
    number: int,
    executor: Executor | None = None,
) -> Iterator[Any]:
    """Map over `jobs`, `number` of them side by side; as many as can be used are taken ahead.

    1 starts no process. An `executor` of the caller's takes the jobs instead, and is left open.
    """
    if number == 1 and executor is None:
        yield from map(work, jobs)
        return
    from concurrent.futures import ProcessPoolExecutor

    left = iter(jobs)
    with nullcontext(executor) if executor else ProcessPoolExecutor(number) as pool:
        waiting: deque[Future[Any]] = deque()
        try:
            waiting.extend(pool.submit(work, job) for job in islice(left, _AHEAD * number))
            while waiting:
                yield waiting.popleft().result()
                waiting.extend(pool.submit(work, job) for job in islice(left, 1))
        finally:
            for each in waiting:
                each.cancel()
