"""What `fit_many` costs beside `fit`, and what memory it takes: decays of 2,048 readings.

CPU seconds count, since a shared machine's clock does not: with two free cores it fits twice as
many a second as it says.
"""

from __future__ import annotations

import resource
import time
from collections.abc import Iterator
from itertools import cycle, islice

import numpy as np

import pendpipe as pp

SAMPLES = 2048
DIFFERENT = 60
"""Decays that are made; they are fitted over and over."""
NUMBER = 400


def decays() -> list[pp.Recording]:
    """Decays of some 60 swings: frequency, loss and noise differ."""
    random = np.random.default_rng(1)
    time_s = np.arange(SAMPLES) / 30.0
    return [
        pp.Recording(
            time_s=time_s,
            angle_rad=random.uniform(0.1, 0.2)
            * np.exp(-random.uniform(0.005, 0.02) * time_s)
            * np.cos(2.0 * np.pi * random.uniform(0.8, 0.9) * time_s)
            + 3e-4 * random.standard_normal(SAMPLES),
        )
        for _ in range(DIFFERENT)
    ]


def children_cpu_s() -> float:
    """CPU seconds of the processes that have ended."""
    spent = resource.getrusage(resource.RUSAGE_CHILDREN)
    return spent.ru_utime + spent.ru_stime


def main() -> None:
    """Print fits a CPU second alone and in two processes, and the memory of few and many."""
    made = decays()
    pp.fit(made[0])
    began = time.process_time()
    for recording in made:
        pp.fit(recording)
    alone = DIFFERENT / (time.process_time() - began)
    print(f"fit: {alone:.0f} a CPU second")

    def endless(number: int) -> Iterator[pp.Recording]:
        return islice(cycle(made), number)

    for number in (NUMBER // 4, NUMBER):
        began, before = time.process_time(), children_cpu_s()
        counted = sum(1 for _ in pp.fit_many(endless(number), processes=2, progress=False))
        spent = time.process_time() - began + children_cpu_s() - before
        peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0
        print(
            f"fit_many, two processes: {counted} fits, {number / spent:.0f} a CPU second"
            f" ({2.0 * number / spent:.0f} a second on two free cores,"
            f" {spent * alone / number:.2f} of a fit alone), {peak:.0f} MB at most"
        )


if __name__ == "__main__":
    main()
