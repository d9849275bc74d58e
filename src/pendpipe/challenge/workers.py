"""Processes beside each other, each of one thread."""

from __future__ import annotations

import multiprocessing
import os
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager

from pendpipe.process import ONE_THREAD


@contextmanager
def workers(number: int) -> Iterator[ProcessPoolExecutor]:
    """Run processes that keep to one thread each, whatever our own environment says.

    Linear algebra that takes every core in each of several processes spends its time
    waiting for itself: an item cost three times its CPU on two cores, more on busy ones
    (Snakemake sets the number of threads to the rule's, and the rule's are processes here).
    A forked process would have numpy, and its threads, from us; so they start
    afresh.

    Parameters
    ----------
    number
        Processes.
    """
    before = {name: os.environ.get(name) for name in ONE_THREAD}
    os.environ.update(ONE_THREAD)
    try:
        fresh = multiprocessing.get_context("spawn")
        with ProcessPoolExecutor(number, mp_context=fresh) as pool:
            yield pool
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value
