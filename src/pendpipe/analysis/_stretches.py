"""What lies before and after a decay, told in stretches of rest, motion and gaps."""

from __future__ import annotations

import numpy as np

from pendpipe.analysis.turning_points.table import Cut
from pendpipe.arrays import FloatArray


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
    cuts = []
    begin, end = float(time[0]), float(time[-1])
    if start_s > begin:
        cuts += _named(
            _parts(time, values, begin, start_s, quiet, window_s),
            rest="rest before release",
            motion=before,
        )
    if stop_s < end:
        cuts += _named(
            _parts(time, values, stop_s, end, quiet, window_s),
            rest="at rest after the decay",
            motion="no free decay: handling, clamp, repositioning or drive",
        )
    return cuts


def _parts(
    time: FloatArray, values: FloatArray, begin: float, end: float, quiet: float, window_s: float
) -> list[tuple[float, float, str]]:
    """Go through windows of half a period; say of each whether it is rest, motion or gap."""
    count = max(1, min(2000, round((end - begin) / window_s)))
    edges = np.linspace(begin, end, count + 1)
    places = np.searchsorted(time, edges)
    out: list[tuple[float, float, str]] = []
    for number in range(count):
        # One sample more at each side: what moves between two windows is motion too.
        part = values[max(places[number] - 1, 0) : places[number + 1] + 1]
        kind = "rest" if len(part) < 2 or float(np.ptp(part)) < quiet else "motion"
        low, high = float(edges[number]), float(edges[number + 1])
        if out and out[-1][2] == kind:
            out[-1] = (out[-1][0], high, kind)
        else:
            out.append((low, high, kind))
    return _without_short_rests(out, 8.0 * window_s)


def _without_short_rests(
    parts: list[tuple[float, float, str]], shortest_s: float
) -> list[tuple[float, float, str]]:
    """Count a short rest between two motions as part of the handling."""
    out = parts[:1]
    for number, (low, high, kind) in enumerate(parts[1:], start=1):
        inside = number + 1 < len(parts) and out[-1][2] == "motion"
        kind = "motion" if inside and high - low < shortest_s else kind
        if out[-1][2] == kind:
            out[-1] = (out[-1][0], high, kind)
        else:
            out.append((low, high, kind))
    return out


def _named(parts: list[tuple[float, float, str]], *, rest: str, motion: str) -> list[Cut]:
    words = {"rest": rest, "motion": motion}
    return [Cut(low, high, words[kind]) for low, high, kind in parts]
