"""What lies before and after a decay, told in stretches of rest, motion and gaps."""

from __future__ import annotations

from itertools import pairwise
from typing import Final

import numpy as np

from pendpipe.analysis.turning_points.table import Cut
from pendpipe.arrays import FloatArray

_SHORT: Final = 8.0
"""Half periods below which a rest between two motions is part of the handling."""
_NO_DECAY: Final = "no free decay: handling, clamp, repositioning or drive"


def stretches(
    time: FloatArray,
    values: FloatArray,
    start_s: float,
    stop_s: float,
    *,
    quiet: float,
    window_s: float,
    before: str,
) -> list[Cut]:
    """Tell what is left out of ``[start_s, stop_s]``.

    Parameters
    ----------
    time, values
        The recording.
    quiet
        A stretch of `window_s` that moves by less than this is at rest.
    before
        The reason why motion before the start is no free decay.
    """
    sides = (
        (float(time[0]), start_s, "rest before release", before),
        (stop_s, float(time[-1]), "at rest after the decay", _NO_DECAY),
    )
    return [
        Cut(low, high, rest if still else motion)
        for begin, end, rest, motion in sides
        if end > begin
        for low, high, still in _parts(time, values, begin, end, quiet, window_s)
    ]


def _parts(
    time: FloatArray, values: FloatArray, begin: float, end: float, quiet: float, window_s: float
) -> list[tuple[float, float, bool]]:
    """Go through windows of half a period; say of each whether it is rest (gaps are)."""
    count = max(1, min(2000, round((end - begin) / window_s)))
    edges = np.linspace(begin, end, count + 1)
    places = np.searchsorted(time, edges)
    # One sample more at each side: what moves between two windows is motion too.
    windows = [values[max(first - 1, 0) : last + 1] for first, last in pairwise(places.tolist())]
    still = [len(part) < 2 or float(np.ptp(part)) < quiet for part in windows]
    for first, last in _runs(still)[1:-1]:
        # A short rest between two motions is part of the handling.
        if edges[last] - edges[first] < _SHORT * window_s:
            still[first:last] = [False] * (last - first)
    return [(float(edges[a]), float(edges[b]), still[a]) for a, b in _runs(still)]


def _runs(flags: list[bool]) -> list[tuple[int, int]]:
    """First and last+1 of each run of the same."""
    ends = [0, *(i for i in range(1, len(flags)) if flags[i] != flags[i - 1]), len(flags)]
    return list(pairwise(ends))
