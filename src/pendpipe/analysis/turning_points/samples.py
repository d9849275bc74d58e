"""The readings that turning points are taken from, and what makes them unfit."""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from pendpipe.analysis.noise import noise_rms
from pendpipe.arrays import FloatArray
from pendpipe.errors import NotAnalysableError, refuse_if
from pendpipe.recording import Recording, find_step

_BEGINNING: Final = 2048
"""Readings that tell a step: at the beginning the motion crosses most."""
_FEWEST: Final = 16
_SATURATED: Final = 0.1


@dataclass(frozen=True)
class Samples:
    """Readings against time, with their noise.

    Parameters
    ----------
    time_s, values
        Shape (n,), finite, times strictly rising.
    unit
        ``"rad"`` or ``"m"``.
    step
        The step of the readings; None where there is none, or where the times of the
        steps are the data (`counts`).
    noise_rms
        First estimate of one reading's standard deviation.
    counts
        Whether each row marks the passage of one count of an encoder: the angle is then
        exact, and the error is in the time.
    promised_step
        The converter's step, where only every so manieth of its codes comes and `step` is
        as much larger; None elsewhere.
    radius_excess
        Of positions: distance from the pivot over its median, less 1, shape (n,).
    """

    time_s: FloatArray
    values: FloatArray
    unit: str
    step: float | None
    noise_rms: float
    counts: bool = False
    promised_step: float | None = None
    radius_excess: FloatArray | None = None

    def __len__(self) -> int:
        return len(self.time_s)


def prepare(recording: Recording, place: str | Path) -> Samples:
    """Take the readings of a recording, or say why they can't be used.

    Nothing is copied where every row is good, so that a record may fill the memory.

    Raises
    ------
    NotAnalysableError
        Dead or saturated channel, too few readings.
    InputError
        A sensor constant that is no number.
    """
    if recording.quantity == "volts":
        recording = recording.as_motion(place=place)
    time, values, radius = recording.time_s, recording.values, recording.radius_excess
    low, high = _range(values)
    if recording.quality is not None or not math.isfinite(high - low):
        time, values = time[recording.usable], values[recording.usable]
        radius = None if radius is None else radius[recording.usable]
        low, high = _range(values)
    refuse_if(
        len(values) < _FEWEST,
        place,
        f"{len(values)} readings are too few",
        "record at least three half cycles",
        NotAnalysableError,
    )
    refuse_if(
        low == high,
        place,
        f"the channel is dead: it reads {low:.6g} throughout",
        "check the sensor",
        NotAnalysableError,
    )
    _refuse_saturated(values, low, high, place)
    step = recording.resolution or find_step(values[:_BEGINNING])
    if step is not None and _one_row_a_count(time, values, step):
        return _edges(time, values, recording.unit, step)
    noise = noise_rms(values, step)
    return Samples(time, values, recording.unit, step, noise, radius_excess=radius)


def _range(values: FloatArray) -> tuple[float, float]:
    """The least and the greatest reading; not finite where one of them isn't."""
    return (float(values.min()), float(values.max())) if len(values) else (math.nan, math.nan)


def _refuse_saturated(values: FloatArray, low: float, high: float, place: str | Path) -> None:
    """Refuse a channel that spends its turning points at the end of its range.

    A sine spends (2/pi) sqrt(2 step/y) of its time within a step of its extremes, both
    together, and a decaying one less: long stays at the very largest and smallest value
    are the converter's.
    """
    piece = values[: 1 << 18]
    for extreme in (low, high):
        at = piece == extreme
        count = np.count_nonzero(at)
        share = count / len(piece)
        if share <= _SATURATED:
            continue
        runs = int(at[0]) + np.count_nonzero(at[1:] & ~at[:-1])
        levels = np.unique(piece)
        step = abs(float(levels[1 if extreme == low else -2]) - extreme) if len(levels) > 1 else 0.0
        expected = math.sqrt(max(step, 1e-12) / (high - low))
        refuse_if(
            len(levels) > 16 and share > 2.0 * expected and count > 8 * runs,
            place,
            f"the channel is saturated: {100.0 * share:.0f} % of the readings are {extreme:.6g}",
            "lower the gain or the starting amplitude, or cut with --start",
            NotAnalysableError,
        )


def _one_row_a_count(time: FloatArray, values: FloatArray, step: float) -> bool:
    """Whether rows come when the count changes, rather than by the clock."""
    piece, when = values[: 1 << 16], time[: 1 << 16]
    change = np.abs(np.diff(piece))
    intervals = np.diff(when)
    single = float(np.mean(np.abs(change - step) < 0.1 * step))
    uneven = float(np.percentile(intervals, 90)) > 1.5 * float(np.percentile(intervals, 10))
    return len(piece) > 50 and single > 0.98 and uneven


def _edges(time: FloatArray, values: FloatArray, unit: str, step: float) -> Samples:
    """Turn counts into the angles at which they changed, half a step back.

    The same edge is then passed upwards and downwards at the same angle, so that the
    encoder's width of a step is no friction.
    """
    angles = values[1:] - 0.5 * np.copysign(step, np.diff(values))
    # The lines of a scale are placed to a small part of its step.
    return Samples(time[1:], angles, unit, None, 0.05 * step, counts=True)
