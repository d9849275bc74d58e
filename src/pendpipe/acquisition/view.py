"""What a page shows of a recording while it is made: the last minute, the amplitude, the time left.

The page (`pendpipe open --live`) is a process of its own that opens nothing but the raw file, and
that for reading: closed, slow, stopped or killed, it can't keep the recorder from anything. It ends
with the recorder, whose end of a pipe then closes, however the recorder ended.
"""

import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, Final

import numpy as np

from pendpipe.acquisition.decode import decode_recording
from pendpipe.acquisition.raw import RawReader
from pendpipe.arrays import FloatArray
from pendpipe.errors import InputError

_LAST_S: Final = 60.0
"""Seconds that are shown as they came."""
_COLUMNS: Final = 600
"""Most extremes that the last minute is drawn by."""
_STRETCHES: Final = 200
"""Of the whole, each drawn from its least to its largest: one a column."""
_SHORTEST_STRETCH_S: Final = 5.0
"""Amplitudes are half the range of a stretch: a 200th of the recording, and no less than that."""


@contextmanager
def shown(raw: Path) -> Iterator[None]:
    """Show a recording that is being made; its page's address goes to standard error."""
    viewer = subprocess.Popen(
        [sys.executable, "-P", "-m", "pendpipe", "open", "--live", str(raw)],
        stdin=subprocess.PIPE,
        stdout=subprocess.DEVNULL,
        start_new_session=True,  # Ctrl-C is the recorder's
    )
    try:
        yield
    finally:
        with suppress(OSError, subprocess.TimeoutExpired):
            viewer.communicate(timeout=2.0)
        if viewer.poll() is None:  # stopped, or at a loss
            viewer.kill()
            viewer.wait()


class Shown:
    """What the page draws of a raw file: only what is new is read and decoded.

    Parameters
    ----------
    path
        The raw file, to which somebody writes.
    """

    def __init__(self, path: Path) -> None:
        self._reader = RawReader(path)
        self._since_s = 0.0
        self._amplitude: list[tuple[float, float]] = []
        self._lost = 0

    def state(self) -> dict[str, Any]:
        """Return the readings so far: times in s, readings in V."""
        try:
            raw = self._reader.read()
            last_s = float(raw.arrival_s[-1]) if len(raw.arrival_s) else 0.0
            # Some of what arrived later was read before.
            recording = decode_recording(raw.since(min(self._since_s, last_s - _LAST_S) - _LAST_S))
        except InputError:
            return {"scans": 0}
        duration_s = float(raw.header["duration_s"])
        read = np.isfinite(recording.values)
        all_s = last_s - recording.time_s[-1] + recording.time_s
        time_s, volts = all_s[read], recording.values[read]
        # Whole stretches alone: the last one is still growing.
        stretch_s = max(_SHORTEST_STRETCH_S, duration_s / _STRETCHES)
        new = time_s >= self._since_s
        number, first = np.unique(time_s[new] // stretch_s, return_index=True)
        extent = np.maximum.reduceat(volts[new], first) - np.minimum.reduceat(volts[new], first)
        middle = ((number + 0.5) * stretch_s).tolist()
        self._amplitude += list(zip(middle, (0.5 * extent).tolist(), strict=True))[:-1]
        done_s = max(float(number[-1]) * stretch_s, self._since_s) if len(number) else 0.0
        self._lost += int(np.sum((all_s >= self._since_s) & (all_s < done_s) & ~read))
        self._since_s = done_s
        recent = time_s > time_s[-1] - _LAST_S
        scans = len(raw.data) // (2 * len(raw.header["channels"]))
        return {
            "elapsed_s": last_s,
            "duration_s": duration_s,
            "model": raw.header["model"],
            "scans": min(scans, int(raw.event("stopped").get("keep_scans") or scans)),
            "lost": self._lost + int(np.sum((all_s >= done_s) & ~read)),
            "bytes": len(raw.data),
            "reason": (raw.event("stopped") or raw.event("broken")).get("reason", ""),
            "last": thinned(time_s[recent], volts[recent]),
            "amplitude": self._amplitude,
        }


def thinned(time_s: FloatArray, values: FloatArray) -> list[tuple[float, float]]:
    """Return points that look like all: of many the least and the largest of a few each."""
    each = -(-len(values) // _COLUMNS)
    if each > 2:
        starts = np.arange(0, len(values), each)
        parts = zip(starts.tolist(), [*starts[1:].tolist(), len(values)], strict=True)
        keep = [{a + int(values[a:b].argmin()), a + int(values[a:b].argmax())} for a, b in parts]
        index = sorted(set[int]().union(*keep))
        time_s, values = time_s[index], values[index]
    return list(zip(time_s.tolist(), values.tolist(), strict=True))
