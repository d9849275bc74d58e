"""Thousands of recordings: fitted side by side, in the order in which they come."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sized
from functools import partial
from typing import TYPE_CHECKING, Any

from pendpipe.errors import InputError, refuse_if
from pendpipe.process import cores, in_order
from pendpipe.recording import Recording

if TYPE_CHECKING:
    from concurrent.futures import Executor

    from pendpipe.analysis.fit.result import FitResult
    from pendpipe.api import Source


def fit_many(
    recordings: Iterable[Source],
    *,
    processes: int | None = None,
    executor: Executor | None = None,
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
    executor
        What runs the fits instead of processes of our own: any executor of `concurrent.futures`'
        kind, such as a cluster's (Dask's ``client.get_executor()``, mpi4py's ``MPIPoolExecutor``).
        It is left open. `processes` is then how many fits it runs at once.
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
    refuse_if(own, ", ".join(own), "this option is for one recording", "leave it out")
    refuse_if(
        processes is not None and processes < 1, "processes", f"{processes} are too few", "give 1"
    )
    work = partial(_fit, options)
    number = processes or cores()
    total = len(recordings) if isinstance(recordings, Sized) else None
    fitted = in_order(work, enumerate(recordings, start=1), number, executor)
    return _with_bar(fitted, total, progress)


def _with_bar(
    fitted: Iterator[FitResult | InputError], total: int | None, progress: bool | None
) -> Iterator[FitResult | InputError]:
    from tqdm import tqdm

    silent = None if progress is None else not progress
    with tqdm(total=total, unit=" fits", disable=silent) as bar:
        for result in fitted:
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
