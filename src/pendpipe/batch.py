"""Thousands of recordings: fitted side by side, in the order in which they come."""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Iterable, Iterator, Sized
from functools import partial
from itertools import islice
from typing import TYPE_CHECKING, Any, Final

from pendpipe.errors import InputError, refuse_if
from pendpipe.recording import Recording

if TYPE_CHECKING:
    from concurrent.futures import Future

    from pendpipe.analysis.fit.result import FitResult
    from pendpipe.api import Source

_AHEAD: Final = 4
"""Recordings a process that are read before the first of their fits is taken."""


def fit_many(
    recordings: Iterable[Source],
    *,
    processes: int | None = None,
    progress: bool | None = None,
    **options: Any,
) -> Iterator[FitResult | InputError]:
    """Fit many recordings, several at a time.

    Parameters
    ----------
    recordings
        Recordings, or paths of their files. A generator is read as it is needed: no more than
        four recordings and fits a process are in memory at a time, however slowly they are taken.
    processes
        How many fit at once; by default one for each core that this process may use. 1 starts none.
        A script that runs on Windows or macOS calls `fit_many` below
        ``if __name__ == "__main__":``.
    progress
        Whether a bar is drawn; by default where standard error is a terminal.
    **options
        Of `fit`: ``method``, ``restoring``, ``baseline``, ``fixed``, ``volts_per_radian``.

    Yields
    ------
    FitResult or InputError
        In the order of the recordings. One that can't be fitted yields the error that `fit`
        raises, and stops nothing.

    Examples
    --------
    >>> files = ["examples/rod-pendulum.csv", "examples/none.csv"]
    >>> for result in fit_many(files, processes=1):
    ...     print(result if isinstance(result, InputError) else result.light)
    green
    examples/none.csv: there is no such file; check the path
    """
    own = {"name", "points"} & options.keys()
    refuse_if(own, ", ".join(own), "it is for one recording", "leave it out")
    refuse_if(
        processes is not None and processes < 1, "processes", f"{processes} is none", "give 1"
    )
    work = partial(_fit, options)
    return _with_bar(work, recordings, processes or cores(), progress)


def _with_bar(
    work: Any, recordings: Iterable[Source], number: int, progress: bool | None
) -> Iterator[FitResult | InputError]:
    from tqdm import tqdm

    total = len(recordings) if isinstance(recordings, Sized) else None
    silent = None if progress is None else not progress
    jobs = enumerate(recordings, start=1)
    with tqdm(total=total, unit=" fits", disable=silent) as bar:
        for result in map(work, jobs) if number == 1 else _in_order(work, jobs, number):
            bar.update()
            yield result


def _fit(options: dict[str, Any], numbered: tuple[int, Source]) -> FitResult | InputError:
    from pendpipe.api import fit

    number, recording = numbered
    name = f"recording {number}" if isinstance(recording, Recording) else None
    try:
        return fit(recording, name=name, **options)
    except InputError as error:
        return error


def _in_order(work: Any, jobs: Iterator[Any], number: int) -> Iterator[Any]:
    """Map over `jobs` with `number` processes; as many jobs as can be used are taken ahead."""
    from concurrent.futures import ProcessPoolExecutor

    with ProcessPoolExecutor(number) as pool:
        waiting: deque[Future[Any]] = deque()
        try:
            waiting.extend(pool.submit(work, job) for job in islice(jobs, _AHEAD * number))
            while waiting:
                yield waiting.popleft().result()
                waiting.extend(pool.submit(work, job) for job in islice(jobs, 1))
        finally:
            pool.shutdown(wait=True, cancel_futures=True)


def cores() -> int:
    """How many cores this process may use: a cluster's job has fewer than its node."""
    try:
        return len(os.sched_getaffinity(0))
    except AttributeError:  # Windows, macOS
        return os.cpu_count() or 1
