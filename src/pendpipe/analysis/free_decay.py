"""Which part of a recording is one free decay.

A pendulum that swings by itself turns at alternate sides, each time nearer to the centre,
after half periods that change little. What does not go like that is cut, with its reason:
rest before the release, the hand's pull, driven parts, rest after the stop, clamping and
repositioning, and every decay but the most telling one.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

import numpy as np

from pendpipe.analysis._decay_runs import Run, best_runs
from pendpipe.analysis._stretches import Cut, stretches
from pendpipe.analysis.half_cycles import HalfCycles, half_cycles, usual_half_period
from pendpipe.analysis.noise import noise_rms
from pendpipe.arrays import FloatArray
from pendpipe.errors import NotAnalysableError
from pendpipe.recording import Recording

__all__ = ["Cut", "FreeDecay", "find_free_decay"]

_BLOCKS: Final = 9
_LEAST_HALF_CYCLES: Final = 3


@dataclass(frozen=True)
class FreeDecay:
    """The part of a recording that is one free decay.

    Parameters
    ----------
    start_s, stop_s
        Its ends, on the recording's clock.
    cuts
        What lies outside, with the reason, in the order of time.
    half_period_s
        The half period, roughly (the median).
    half_cycles
        How many half cycles were counted in it.
    notes
        What else was noticed, a clause each.
    """

    start_s: float
    stop_s: float
    cuts: list[Cut]
    half_period_s: float
    half_cycles: int
    notes: list[str] = field(default_factory=list)

    def of(self, recording: Recording) -> Recording:
        """Return that part of the recording."""
        return recording.between(self.start_s, self.stop_s)


def find_free_decay(recording: Recording, place: str | Path = "recording") -> FreeDecay:
    """Find the free decay in a recording of angles or displacements.

    After a pull or a hold by hand it starts where the first free swing passes its middle
    (the hand may have followed until then); in a recording that begins in free motion, at
    its first sample. It ends half a period after the last turning point that stands out of
    noise and step, or with the recording, or where something else begins.

    Parameters
    ----------
    recording
        In radians or metres (`Recording.as_motion`); samples may be uneven.
    place
        Named in messages.

    Raises
    ------
    NotAnalysableError
        When there is no free decay of at least three half cycles: one line that says why.
    """
    usable = recording.usable
    time, values = recording.time_s[usable], recording.values[usable]
    span = float(np.ptp(values)) if len(values) else 0.0
    if len(values) < 8 or span == 0:
        why = "the reading never changes" if len(values) >= 8 else f"{len(values)} samples only"
        raise NotAnalysableError(place, why, "is this the right channel?")
    step = recording.resolution
    least = max(6.5 * noise_rms(values, step, quieter=0.1), 1.6 * (step or 0.0))
    half_period = usual_half_period(time, values)
    if half_period is None or span < 3.0 * least:
        why = (
            f"no oscillation: the reading moves by {span:.3g} {recording.unit}, its noise and step"
            f" hide {least:.2g}"
            if span < 10.0 * least
            else "no oscillation: the reading does not swing to and fro"
        )
        raise NotAnalysableError(place, why, "give a recording of a free decay")
    pieces = _pieces(time, 2.0 * half_period)
    found = [
        (first, last, cycles, run)
        for first, last in pieces
        if last - first >= 8
        for cycles in [half_cycles(time[first:last], values[first:last], least, half_period)]
        for run in best_runs(cycles)
    ]
    found = [entry for entry in found if entry[3].legs >= _LEAST_HALF_CYCLES]
    if not found:
        raise NotAnalysableError(
            place,
            "no free decay: no three half cycles follow each other with falling amplitude",
            "handling, a clamp or a drive can't be analysed",
        )
    first, last, cycles, run = max(found, key=lambda entry: entry[3].worth)
    rivals = sum(entry[3].path > 0.2 * run.path for entry in found) - 1
    if run.legs < 6 * _LEAST_HALF_CYCLES and rivals >= max(2, run.legs // 3):
        raise NotAnalysableError(
            place,
            f"no free decay: {rivals + 1} short oscillations of {run.legs} half cycles or so",
            "irregular motion can't be analysed",
        )
    _refuse_without_fall(place, cycles, run, least)
    start, stop = _ends(time[first:last], values[first:last], cycles, run)
    others = [(c, r) for _, _, c, r in found if r is not run and r.path > 0.05 * run.path]
    half = float(np.median(np.diff(cycles.middle_s[run.first : run.last + 1])))
    quiet = max(2.0 * least, 0.02 * float(cycles.swing[run.first]))
    before = "driven: the amplitude is held up" if run.driven else "moved by hand before release"
    cuts = stretches(time, values, start, stop, quiet=quiet, window_s=half, before=before)
    notes = [
        f"another decay of {r.legs} half cycles from {c.middle_s[r.first]:.6g} s is not used"
        for c, r in others
    ]
    if run.bridged:
        notes.append(f"{run.bridged} disturbed half cycle(s) inside the decay are kept")
    return FreeDecay(start, stop, cuts, half, run.legs, notes)


def _pieces(time: FloatArray, longest_s: float) -> list[tuple[int, int]]:
    """Part the record at gaps in which the motion could have done anything."""
    edges = (np.flatnonzero(np.diff(time) > longest_s) + 1).tolist()
    return list(zip([0, *edges], [*edges, len(time)], strict=True))


def _rise(swing: FloatArray) -> float:
    """The most that swings grow again after having been smaller, over blocks that calm noise."""
    if len(swing) < 2 * _BLOCKS:
        return 0.0
    means = np.array([float(np.mean(part)) for part in np.array_split(swing, _BLOCKS)])
    return float(np.max(means - np.minimum.accumulate(means)))


def _refuse_without_fall(place: str | Path, cycles: HalfCycles, run: Run, least: float) -> None:
    """Refuse motion that does not decay, or that hardly stands out of noise and step."""
    swing = cycles.swing[run.first : run.last + 1]
    if float(swing[:3].max()) < 3.0 * least:
        raise NotAnalysableError(
            place,
            f"the largest half cycle ({swing[:3].max():.2g}) hardly stands out of noise and step"
            f" ({least:.2g})",
            "record with a larger amplitude",
        )
    third = max(1, len(swing) // 3)
    fall = float(np.mean(swing[:third]) - np.mean(swing[-third:]))
    scatter = float(np.std(np.diff(swing))) / np.sqrt(2.0)
    few = max(3.0 * scatter / np.sqrt(third), _rise(swing), 0.3 * least, 1e-4 * float(swing[0]))
    if fall <= few:
        raise NotAnalysableError(
            place,
            f"the amplitude does not fall over {len(swing)} half cycles",
            "a driven oscillation has no free decay",
        )


def _ends(
    time: FloatArray, values: FloatArray, cycles: HalfCycles, run: Run
) -> tuple[float, float]:
    """Find start and stop of a run of half cycles within its piece of the record."""
    middle = cycles.middle_s[run.first : run.last + 1]
    half_first = float(middle[1] - middle[0])
    half_last = float(np.median(np.diff(middle[-4:])))
    begin, end = float(time[0]), float(time[-1])
    start = float(middle[0])
    if _free_from_the_first_sample(begin, float(values[0]), cycles, run, half_first):
        start = begin
    # Half a period after its last middle the pendulum has turned and swung back once more.
    stop = float(middle[-1]) + (1.5 if run.fades else 0.5) * half_last
    return start, end if end - stop < 0.3 * half_last else stop


def _free_from_the_first_sample(
    begin: float, reading: float, cycles: HalfCycles, run: Run, half_period: float
) -> bool:
    """Say whether the recording begins in the free motion, rather than in a hold or a pull.

    The first sample must lie on the cosine that the first half cycles continue.
    """
    if run.driven or run.first > 1:
        return False
    turn = float(cycles.middle_s[run.first]) - 0.5 * half_period
    if turn - begin > 1.1 * half_period or begin - turn > 0.6 * half_period:
        return False
    if run.first == 0:
        return begin > turn - 0.2 * half_period
    top, bottom = cycles.turn[run.first], cycles.turn[run.first + 1]
    centre, amplitude = 0.5 * float(top + bottom), 0.5 * float(top - bottom)
    expected = centre + amplitude * np.cos(np.pi * (begin - turn) / half_period)
    return bool(abs(reading - expected) < 0.15 * abs(amplitude))
