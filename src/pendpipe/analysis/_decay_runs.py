"""Runs of half cycles that follow one another as in a free decay."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from pendpipe.analysis.half_cycles import HalfCycles
from pendpipe.arrays import BoolArray, FloatArray

# Loose on purpose: an impulse or a beat is physics to be diagnosed, not to be cut.
_RISE: Final = 1.3
_FALL: Final = 0.3
_TAIL: Final = 0.05
_PERIOD: Final = 0.3
_WAVER: Final = 0.12


@dataclass(frozen=True)
class Run:
    """Half cycles `first` to `last` (inclusive) that belong together.

    Parameters
    ----------
    path
        How far the pendulum has gone in them.
    bridged
        Disturbed half cycles inside.
    fades
        Whether it ends in its own rest or with the record, rather than in something else.
    driven
        Whether the amplitude was held up before.
    """

    first: int
    last: int
    path: float
    bridged: int = 0
    fades: bool = False
    driven: bool = False

    @property
    def worth(self) -> float:
        """What it can tell: its path, less for a few half cycles (two tell no decay)."""
        return self.path * (1.0 - 2.0 / self.legs)

    @property
    def legs(self) -> int:
        """Number of half cycles."""
        return self.last - self.first + 1


def best_runs(cycles: HalfCycles) -> list[Run]:
    """Find the runs, the most telling first."""
    count = len(cycles)
    if count < 3:
        return []
    follows, swings = _follows(cycles).tolist(), cycles.swing.tolist()
    runs: list[tuple[int, int]] = []
    first, floor = 0, swings[0]
    for leg in range(1, count):
        allowed = _RISE * floor + _TAIL * swings[first] + cycles.step
        if not follows[leg - 1] or swings[leg] > allowed:
            runs.append((first, leg - 1))
            first, floor = leg, swings[leg]
        floor = min(floor, swings[leg])
    runs.append((first, count - 1))
    trimmed = [_trimmed(cycles, *run) for run in runs]
    kept = [run for run in _joined(cycles, trimmed) if run.legs >= 3 and _regular(cycles, run)]
    return sorted((_undriven(cycles, run) for run in kept), key=lambda run: -run.worth)


def _follows(cycles: HalfCycles) -> BoolArray:
    """Say for each half cycle but the last whether the next one may follow it freely."""
    swing, half = cycles.swing, np.diff(cycles.middle_s)
    usual = _running_median(half)
    # A step of the converter moves the passage of the middle by this share of a half period.
    blur = 0.5 * cycles.step / np.minimum(swing[1:], swing[:-1])
    steady = np.abs(np.log(half / usual)) < _PERIOD + np.minimum(blur, 0.3)
    rises = swing[1:] > _RISE * swing[:-1] + cycles.step
    loss = np.concatenate(([0.0], swing[:-2] - swing[1:-1]))
    # Coulomb friction takes the same from each half cycle, so the last ones shrink fast.
    drops = (swing[1:] < _FALL * swing[:-1]) & (swing[1:] < swing[:-1] - 1.6 * loss - cycles.step)
    return np.asarray(steady & ~rises & ~drops)


def _running_median(values: FloatArray) -> FloatArray:
    """The median of each value and its two neighbours to each side, fewer at the ends."""
    padded = np.pad(values, 2, constant_values=np.nan)
    ascending = np.sort(np.lib.stride_tricks.sliding_window_view(padded, 5), axis=1)
    last = 4 - np.count_nonzero(np.isnan(ascending), axis=1)
    row = np.arange(len(values))
    return np.asarray(0.5 * (ascending[row, last // 2] + ascending[row, (last + 1) // 2]))


def _trimmed(cycles: HalfCycles, first: int, last: int) -> Run:
    """Drop half cycles at the front that are smaller than what follows: a pull."""
    while last - first >= 2 and cycles.swing[first] < (
        0.93 * cycles.swing[first + 1] - 0.5 * cycles.step
    ):
        first += 1
    return Run(first, last, float(cycles.swing[first : last + 1].sum()))


def _joined(cycles: HalfCycles, runs: list[Run]) -> list[Run]:
    """Join runs that a few disturbed half cycles part (a tracking error, lost samples)."""
    out: list[Run] = []
    for run in (run for run in runs if run.legs >= 2):
        if out and _continues(cycles, out[-1], run):
            before = out.pop()
            lost = run.first - before.last - 1
            path = float(cycles.swing[before.first : run.last + 1].sum())
            run = Run(before.first, run.last, path, before.bridged + run.bridged + lost)
        out.append(run)
    return [_fading(cycles, run) for run in out]


def _regular(cycles: HalfCycles, run: Run) -> bool:
    """Say whether periods and amplitudes go on as smoothly as a pendulum's do."""
    swing = cycles.swing[run.first : run.last + 1]
    half = np.diff(cycles.middle_s[run.first : run.last + 1])
    blur = cycles.step / float(np.median(swing))
    # Where the sides differ, half cycles two apart are alike; of a few that says too little.
    apart = 2 if len(half) > 6 else 1
    waver = float(np.median(np.abs(half[apart:] - half[:-apart]))) / float(np.median(half))
    kinks = float(np.median(np.abs(np.diff(swing, 2)))) / float(np.median(swing))
    return waver < _WAVER + 0.5 * blur and kinks < _WAVER + 2.0 * blur


def _continues(cycles: HalfCycles, before: Run, after: Run) -> bool:
    """Say whether `after` goes on where `before` was broken off."""
    half = float(np.median(np.diff(cycles.middle_s[before.first : before.last + 1])))
    pause = float(cycles.middle_s[after.first] - cycles.middle_s[before.last])
    # Where a turning point is lost in a gap, the swings beside it are too small.
    last = float(np.max(cycles.swing[max(before.first, before.last - 2) : before.last + 1]))
    ratio = float(cycles.swing[after.first]) / last
    strong = float(cycles.swing[after.first]) > 3.0 * cycles.step
    if not (strong and before.legs >= 3 and pause < 4.5 * half and 0.5 < ratio < 1.15):
        return False
    other = np.diff(cycles.middle_s[after.first : after.last + 1])
    return bool(len(other)) and abs(float(np.median(other)) / half - 1.0) < _PERIOD


def _fading(cycles: HalfCycles, run: Run) -> Run:
    """Note whether the run's own last swing follows it, and then rest or the record's end."""
    if run.legs < 3:
        return run
    half = float(np.median(np.diff(cycles.middle_s[run.first : run.last + 1])))
    swing = float(cycles.swing[run.last])
    if run.last + 1 == len(cycles):
        return replace(run, fades=cycles.ending < _RISE * swing + cycles.step)
    pause = float(cycles.middle_s[run.last + 1] - cycles.middle_s[run.last])
    return replace(run, fades=pause > 1.5 * half)


def _undriven(cycles: HalfCycles, run: Run) -> Run:
    """Cut a front part whose amplitude is held while the part after it falls.

    The loss of a free half cycle grows with its amplitude; so the first k half cycles lose
    at least k times what those after them lose. A tenth of that is no free decay. (The top
    of a beat is flat too, but loses 0.3 of it.)
    """
    swing = cycles.swing[run.first : run.last + 1]
    count = len(swing)
    if count < 9:
        return run
    k = np.arange(4, count - 4)
    ahead = np.minimum(np.maximum(4, k // 2), count - 1 - k)
    # Medians of seven: a disturbed half cycle inside the run is no drive.
    padded = np.pad(swing, 3, mode="reflect", reflect_type="odd")
    smooth: FloatArray = np.median(np.lib.stride_tricks.sliding_window_view(padded, 7), axis=1)
    falls = smooth[k] - smooth[k + ahead]
    expected = k * falls / ahead
    lost = smooth[0] - smooth[k]
    held = (lost < 0.1 * expected) & (expected > np.maximum(0.1 * swing[0], 3.0 * cycles.step))
    # Near the end a small scatter of few half cycles would stand for the loss of hundreds, and
    # the last fall of an amplitude that wavers all along for the end of its drive.
    waver = np.maximum.accumulate(np.maximum.accumulate(smooth) - smooth)[k]
    held &= falls > np.maximum(2.0 * waver, 3.0 * cycles.step)
    gain = np.where(held, expected - lost, 0.0)
    best = int(np.argmax(gain))
    if gain[best] <= 0:
        return run
    first = run.first + int(k[best])
    return replace(
        run,
        first=first,
        path=float(cycles.swing[first : run.last + 1].sum()),
        driven=True,
    )
