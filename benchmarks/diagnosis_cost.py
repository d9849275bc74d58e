"""What a diagnosis costs on one core: nulls and single effects of 4000 and of 32768 readings.

    python -m benchmarks.diagnosis_cost

The pendulums are the challenge's, sampled as finely as asked. Times are CPU seconds of one
process with one thread, compiled code warm; pysindy, where it is installed, judges the same.
"""

from __future__ import annotations

import importlib.util
import time
import warnings
from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from benchmarks.diagnosis import EFFECTS
from benchmarks.table import Row, at_most, write
from pendpipe_challenge.sets import process_pool

if TYPE_CHECKING:
    from pendpipe.recording import Recording
    from pendpipe_challenge.scenario import Scenario

ASKED_S: Final = {4000: 2.0, 32768: 10.0}
"""CPU seconds that a recording of so many readings may cost."""
NULLS: Final = 20
SIZE: Final = 100.0
"""Delta chi^2 of what is hidden in the others, one of each of the representative twenty."""


class Cost(NamedTuple):
    """CPU seconds for one recording."""

    samples: int
    hidden: str
    diagnosis_s: float
    pysindy_s: float | None


def finely(scenario: Scenario, samples: int) -> Scenario:
    """The same pendulum over the same span, read more often."""
    return replace(scenario, samples=samples, interval_s=scenario.span_s / samples)


def recorded(samples: int, hidden: str, number: int) -> tuple[Recording, float]:
    """One recording and its true angular frequency; nothing is hidden where no effect is named."""
    import tempfile
    from pathlib import Path

    from pendpipe.recording import read_plain
    from pendpipe_challenge.catalogue import hide
    from pendpipe_challenge.recordings import write_recording
    from pendpipe_challenge.scenario import draw_scenario
    from pendpipe_challenge.sizing import size

    random = np.random.default_rng([samples, number, *map(ord, hidden)])
    while True:
        scenario = finely(draw_scenario(random, stop=False), samples)
        if hidden:
            sized = size(hide(random, hidden, scenario), SIZE)
            if sized is None:
                continue
            scenario = sized.scenario
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder, "recording.csv")
            write_recording(path, scenario, scenario.record(random))
            return read_plain(path).as_motion(), scenario.omega


def cost(samples: int, hidden: str, number: int) -> Cost:
    """Make a recording, diagnose it, and have pysindy judge it."""
    from pendpipe.diagnosis.run import diagnose_recording
    from pendpipe.process import keep_memory

    keep_memory()  # as the command does
    recording, omega = recorded(samples, hidden, number)
    began = time.process_time()
    diagnose_recording(recording)
    taken = time.process_time() - began
    peer = None
    if importlib.util.find_spec("pysindy"):
        from pendpipe_challenge.peers import by_sindy

        began = time.process_time()
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            by_sindy(recording.time_s, recording.values, omega)
        peer = time.process_time() - began
    return Cost(samples, hidden, taken, peer)


def costs() -> Iterator[Cost]:
    """All recordings in one process, one after the other; the first is not counted."""
    with process_pool(1) as pool:
        pool.submit(cost, 4000, EFFECTS[0], 99).result()
        for samples in ASKED_S:
            for number in range(NULLS):
                yield pool.submit(cost, samples, "", number).result()
            for effect in EFFECTS:
                yield pool.submit(cost, samples, effect, 0).result()


def rows(found: list[Cost]) -> Iterator[Row]:
    """Median, nine tenths and the largest, and the ratio to pysindy."""
    for samples, asked in ASKED_S.items():
        for words, hides in (("nulls", False), ("single effects of 100", True)):
            part = [
                each for each in found if each.samples == samples and bool(each.hidden) is hides
            ]
            own = np.array([each.diagnosis_s for each in part])
            levels = [float(np.quantile(own, share)) for share in (0.5, 0.9, 1.0)]
            slowest = part[int(own.argmax())].hidden
            yield at_most(
                f"{samples} readings, {len(part)} {words}: median, nine tenths, largest"
                f"{f' ({slowest})' if slowest else ''}",
                levels,
                asked,
                " s",
            )
            peer = [each.pysindy_s for each in part if each.pysindy_s is not None]
            if peer:
                ratio = float(np.median(own) / np.median(peer))
                yield Row("the median over pysindy's on the same recordings", f"{ratio:.3g}")


def main() -> None:
    """Measure and write the table."""
    found = []
    for each in costs():
        found.append(each)
        print(f"{each.samples} {each.hidden or 'nothing'}: {each.diagnosis_s:.2f} s", flush=True)
    write("diagnosis", "The diagnosis, CPU seconds on one core", list(rows(found)))


if __name__ == "__main__":
    main()
