"""The fact of saturation: readings that stand at the end of the sensor's range."""

import numpy as np

from pendpipe.arrays import FloatArray
from pendpipe.facts import Fact, How


def saturation(
    values: FloatArray, step: float | None, limits: tuple[float, float] | None = None
) -> Fact | None:
    """Say that turns are cut off; ``None`` where none is. Limits that are known state it."""
    if not (cut := clipped_samples(values, step, limits)):
        return None
    said = f"{cut} reading(s) at the end of the sensor's range: its turns are cut off"
    known: How = "shown" if limits is None else "stated"
    return Fact("saturation", f"{cut} readings", known, said)


@np.errstate(invalid="ignore", over="ignore")  # a span beyond all numbers; a NaN that signals
def clipped_samples(
    values: FloatArray, step: float | None, limits: tuple[float, float] | None = None
) -> int:
    """Count samples that stand at the end of the converter's range.

    Either at its known limits; or in flat tops: at least two runs of three or more equal
    readings at the very extremes, whose neighbours lie more than four steps off, as no
    smooth motion would have it. (Where readings are held for several rows, three times as many.)
    """
    if limits is not None:
        low, high = np.array(limits) + 0.5 * (step or 0.0) * np.array([1.0, -1.0])
        return int(np.sum((values <= low) | (values >= high)))
    finite = values[np.isfinite(values)]
    span = float(np.ptp(finite)) if len(finite) else 0.0
    off = max(4.0 * (step or 0.0), 1e-3 * span)
    starts = np.flatnonzero(np.diff(finite, prepend=np.nan) != 0.0)
    least = 3.0 * float(np.median(np.diff(starts))) if span else 0.0
    ends = [_flat_tops(sign * values, off, least) for sign in (1.0, -1.0)] if span else []
    return sum(count for count, _ in ends) if sum(flat for _, flat in ends) >= 2 else 0


def _flat_tops(values: FloatArray, off: float, least: float) -> tuple[int, int]:
    """Count the samples at the maximum, if flat runs there fall off steeply, and those runs."""
    top = np.nanmax(values)
    at = np.concatenate(([False], values == top, [False]))
    edges = np.flatnonzero(np.diff(at.astype(np.int8)))
    steep = 0
    for start, stop in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
        sides = values[max(start - 1, 0) : start].tolist() + values[stop : stop + 1].tolist()
        steep += stop - start >= least and bool(sides) and top - min(sides) > off
    return int(at.sum()) if steep else 0, steep
