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

    99 % of the intervals lie within 15 % of their median (a clock printed with too few
    digits alternates by 10 %).
    """
    steps = np.diff(time_s)
    if len(steps) < 2:
        return True
    middle = float(np.median(steps))
    if not middle > 0:
        return False
    return float(np.mean(np.abs(steps - middle) <= 0.15 * middle)) >= 0.99 or (
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
    if not middle > 0:
        return float("nan")
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
    """Find the step between readings: what all differences of neighbours are multiples of.

    ``None`` where there is none (a computed or a smoothed reading). Neighbours, and not
    all distinct values, since an encoder that has lost a count once has two ladders of
    values with one step.
    """
    finite = values[np.isfinite(values)]
    if len(finite) < 2 or np.abs(finite).max() > 1e100:
        return None
    jumps = np.abs(np.diff(finite))
    # Values that arithmetic has left a rounding error apart are one value.
    jumps = np.sort(jumps[jumps > 1e-9 * float(np.ptp(finite))])
    if not len(jumps):
        return None
    smallest = float(jumps[min(2, len(jumps) - 1)])
    near = float(jumps[jumps <= 1.35 * smallest].mean())
    for start in (near, smallest):
        found = _refined(jumps, start)
        if found is not None:
            return found
    return None


def _refined(jumps: FloatArray, step: float) -> float | None:
    """Fit ``jump = k step`` and keep the step if nearly all jumps lie on it.

    The reach of the fit grows, since an error of the step adds up over many steps.
    """
    reach, full = 4.0 * step, float(jumps[-1])
    while True:
        near = jumps[jumps <= reach]
        multiples = np.rint(near / step)
        weight = float(multiples @ multiples)
        if weight > 0:
            step = float(near @ multiples) / weight
        misfit = np.abs(near - multiples * step)
        # Jumps that belong to no ladder are spread evenly: 40 % of them within 0.2.
        if np.mean(misfit < 0.2 * step) < 0.9:
            return None
        if reach >= full:
            return step
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
    """Count the samples at the maximum, if two flat runs there fall off steeply."""
    top = np.nanmax(values)
    at = np.concatenate(([False], values == top, [False]))
    edges = np.flatnonzero(np.diff(at.astype(np.int8)))
    steep = 0
    for start, stop in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
        sides = values[max(start - 1, 0) : start].tolist() + values[stop : stop + 1].tolist()
        steep += stop - start >= 3 and bool(sides) and top - min(sides) > off
    return int(at.sum()) if steep >= 2 else 0
