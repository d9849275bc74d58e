"""What samples and times show of themselves: uniformity, gaps, step, clipping."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pendpipe.arrays import FloatArray


@dataclass(frozen=True)
class Gap:
    """Time that is missing after a sample."""

    after_sample: int
    missing_s: float


def is_uniform(time_s: FloatArray) -> bool:
    """Say whether the samples are evenly spaced, gaps apart.

    99 % of the intervals lie within a tenth of their median.
    """
    steps = np.diff(time_s)
    if len(steps) < 2:
        return True
    middle = float(np.median(steps))
    return float(np.mean(np.abs(steps - middle) <= 0.1 * middle)) >= 0.99 or (
        # A handful of gaps in a short recording is no unevenness.
        bool(np.all(np.abs(steps / middle - np.rint(steps / middle)) < 0.1))
        and float(np.mean(steps < 1.5 * middle)) > 0.8
    )


def sample_rate(time_s: FloatArray) -> float:
    """Samples a second, gaps left out; of uneven samples the reciprocal median interval."""
    steps = np.diff(time_s)
    if not len(steps):
        return float("nan")
    middle = float(np.median(steps))
    usual = steps[np.abs(steps - middle) <= 0.5 * middle]
    return 1.0 / float(usual.mean() if is_uniform(time_s) else middle)


def find_gaps(time_s: FloatArray) -> list[Gap]:
    """Find the gaps.

    In evenly spaced samples an interval beyond 1.5 times the median; where a row stands
    for a count of an encoder, silence is natural at every turning point and grows near
    rest: there one beyond 50 times the 99th percentile.
    """
    steps = np.diff(time_s)
    if len(steps) < 2:
        return []
    middle = float(np.median(steps))
    limit = 1.5 * middle if is_uniform(time_s) else 50.0 * float(np.percentile(steps, 99))
    return [Gap(int(at), float(steps[at] - middle)) for at in np.flatnonzero(steps > limit)]


def resolution(values: FloatArray) -> float | None:
    """Find the step between readings: the smallest common spacing of the distinct values.

    ``None`` where the values have no common step (a computed or a smoothed reading).
    """
    distinct = np.unique(values[np.isfinite(values)])
    if len(distinct) < 3:
        return float(np.ptp(distinct)) if len(distinct) == 2 else None
    spacings = np.diff(distinct)
    spacings = spacings[spacings > 1e-9 * float(np.ptp(distinct))]
    # Values that arithmetic has left a rounding error apart are one value.
    if not len(spacings):
        return None
    for share in (0.02, 0.5, 0.2):
        found = _refined(distinct, float(np.quantile(spacings, share)))
        if found is not None:
            return found
    low = spacings[spacings <= 1.35 * float(np.quantile(spacings, 0.02))]
    return _refined(distinct, float(low.mean()))


def _refined(distinct: FloatArray, step: float) -> float | None:
    """Fit ``value = start + k step`` and keep the step if nearly all values lie on it.

    The reach of the fit grows, since an error of the step adds up over many steps.
    """
    offsets = distinct - distinct[len(distinct) // 2]
    reach = 4.0 * step
    full = float(np.abs(offsets).max())
    while True:
        near = offsets[np.abs(offsets) <= reach]
        multiples = np.rint(near / step)
        weight = float(multiples @ multiples)
        if weight > 0:
            step = float(near @ multiples) / weight
        misfit = np.abs(near - multiples * step)
        if np.mean(misfit < 0.2 * step) < 0.9:
            return None
        if reach >= full:
            return step if float(np.sqrt(np.mean(misfit**2))) < 0.15 * step else None
        reach *= 2.0


def clipped_samples(
    values: FloatArray, step: float | None, limits: tuple[float, float] | None = None
) -> int:
    """Count samples that stand at the end of the converter's range.

    Either at its known limits; or in flat tops: at least two runs of three or more equal
    readings at the very extreme, whose neighbours lie more than four steps off, as no
    smooth motion would have it.
    """
    if not len(values):
        return 0
    if limits is not None:
        tolerance = 0.5 * (step or 0.0)
        return int(np.sum((values <= limits[0] + tolerance) | (values >= limits[1] - tolerance)))
    span = float(np.ptp(values[np.isfinite(values)])) if np.isfinite(values).any() else 0.0
    off = max(4.0 * (step or 0.0), 1e-3 * span)
    return sum(_flat_tops(sign * values, off) for sign in (1.0, -1.0)) if span else 0


def _flat_tops(values: FloatArray, off: float) -> int:
    """Count the samples of flat runs at the maximum with a fall beyond `off` beside them."""
    top = np.nanmax(values)
    at = np.concatenate(([False], values == top, [False]))
    edges = np.flatnonzero(np.diff(at.astype(np.int8)))
    starts, stops = edges[::2], edges[1::2]
    total = runs = 0
    for start, stop in zip(starts.tolist(), stops.tolist(), strict=True):
        sides = [values[start - 1]] if start else []
        sides += [values[stop]] if stop < len(values) else []
        if stop - start >= 3 and sides and top - min(sides) > off:
            runs += 1
            total += stop - start
    return total if runs >= 2 else 0
