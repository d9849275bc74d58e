"""Each record's waveform and Q(A) as plain SVG, with the readings packed for the page's zoom.

Drawn by hand since a page holds hundreds: a few kilobytes each, legible without the script,
in the page's own colours, and the script redraws them from the packed readings.
"""

import base64
import zlib
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np

from pendpipe.arrays import AnyArray, FloatArray
from pendpipe.cells import csv_rows
from pendpipe.figures.data import Decay, local_quality
from pendpipe.quantities import axis_unit, pretty_unit
from pendpipe.recording import Recording

LEFT, RIGHT, TOP, BOTTOM = 54, 632, 22, 150
"""The frame in a drawing of 640 by 190 pixels, as in `parts.html` and `script.js`."""
_FEW_PERIODS: Final = 60
"""Below this a waveform is drawn as the line; above, as the band between its extremes."""


@dataclass(frozen=True)
class Axis:
    """One axis: its ends, where they lie in the drawing, and its label."""

    low: float
    high: float
    start: float
    stop: float
    label: str
    logarithmic: bool = False

    def __call__(self, values: Any) -> AnyArray:
        """Return where values lie, in pixels."""
        turn = np.log if self.logarithmic else np.asarray
        low, high = turn(self.low), turn(self.high)
        return np.asarray(self.start + (turn(values) - low) / (high - low) * self.span)

    @property
    def span(self) -> float:
        """Its length in pixels, negative upwards."""
        return self.stop - self.start

    def ticks(self) -> list[tuple[float, str]]:
        """Return where numbers stand, and the numbers."""
        from matplotlib.ticker import LogLocator, MaxNLocator

        wide = self.logarithmic and self.high > 10.0 * self.low
        locator = LogLocator(subs=(1.0, 2.0, 5.0)) if wide else MaxNLocator(5, steps=[1, 2, 5, 10])
        ticks = [v for v in locator.tick_values(self.low, self.high) if self.low <= v <= self.high]
        return [(round(float(self(v)), 1), f"{v:.6g}".replace("-", "−")) for v in ticks]


@dataclass(frozen=True)
class Chart:
    """What the template draws.

    Parameters
    ----------
    x, y
        The axes.
    paths
        Class of the style sheet and path, each.
    shaded
        Left end and width of what was cut, in pixels.
    csv
        What is drawn, as a table; empty where the readings are packed.
    packed
        The readings for the script: see `pack`.
    """

    x: Axis
    y: Axis
    paths: list[tuple[str, str]]
    shaded: list[tuple[float, float]] = field(default_factory=list)
    csv: str = ""
    packed: dict[str, Any] = field(default_factory=dict)

    @property
    def size(self) -> int:
        """About how many bytes it takes in a page, without what is packed."""
        return 1500 + len(self.csv) + sum(len(path) for _, path in self.paths)


def line(x: FloatArray, y: FloatArray) -> str:
    """Return a path through points, interrupted where y is NaN."""
    finite = np.isfinite(y)
    starts = finite & ~np.concatenate([[False], finite[:-1]])
    rows = zip(starts[finite], x[finite].tolist(), y[finite].tolist(), strict=True)
    return "".join(f"{'M' if first else 'L'}{a:.1f},{b:.1f}" for first, a, b in rows)


def extremes(
    time_s: FloatArray, values: FloatArray, buckets: int
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the middle of each bucket of time with the least and the largest value in it.

    A bucket no shorter than a period holds both extremes of the motion, so that the band of a
    decay falls as the decay does; in shorter ones it would beat with the swings.
    NaN stands for a bucket without readings.
    """
    edges = np.linspace(time_s[0], time_s[-1], buckets + 1)
    first = np.searchsorted(time_s, edges[:-1])
    filled = np.diff(np.append(first, len(time_s))) > 0
    low, high = np.full((2, buckets), np.nan)
    low[filled] = np.minimum.reduceat(values, first[filled])
    high[filled] = np.maximum.reduceat(values, first[filled])
    return 0.5 * (edges[1:] + edges[:-1]), low, high


def waveform(recording: Recording, decay: Decay, volts_per_radian: float) -> Chart:
    """Draw a record's readings with the amplitude of the fitted law."""
    usable = recording.usable
    in_volts = recording.quantity == "volts" and np.isfinite(volts_per_radian)
    scale = 1.0 / volts_per_radian if in_volts else 1.0
    unit = "rad" if in_volts else recording.unit
    time, values = recording.time_s[usable], scale * recording.values[usable]
    factor, shown = axis_unit(values, unit)
    values = factor * values
    x = Axis(float(time[0]), float(time[-1]), LEFT, RIGHT, "Time (s)")
    centre, half = 0.5 * float(values.max() + values.min()), 0.52 * float(np.ptp(values)) or 1.0
    name = {"rad": "Angle", "V": "Sensor output"}.get(unit, "Motion")
    y = Axis(centre - half, centre + half, BOTTOM, TOP, f"{name} ({shown})")
    periods = int((time[-1] - time[0]) * decay.fit.value("frequency"))
    buckets = min(RIGHT - LEFT, periods) if periods > _FEW_PERIODS else RIGHT - LEFT
    middle, least, most = extremes(time, values, buckets)
    if periods > _FEW_PERIODS:
        readings = "".join(areas(x(middle), y(least), y(most)))
    else:
        readings = line(np.repeat(x(middle), 2), y(np.column_stack([least, most]).ravel()))
    paths = [("band" if periods > _FEW_PERIODS else "thin", readings)]
    if decay.fit.light != "red" and decay.points.unit == unit:
        elapsed = np.linspace(0.0, float(decay.elapsed_s[-1]), 60)
        at = decay.points.time_s[0] + elapsed
        level = np.interp(at, decay.points.time_s, decay.level_rad)
        reach = decay.along(elapsed)[0]
        both = (line(x(at), y(factor * (level + sign * reach))) for sign in (1.0, -1.0))
        paths.append(("law", "".join(both)))
    cuts = [np.clip(x([cut["start_s"], cut["stop_s"]]), LEFT, RIGHT) for cut in decay.fit.cuts]
    shaded = [(round(float(a), 1), round(float(b - a), 1)) for a, b in cuts]
    return Chart(x, y, paths, shaded, packed=pack(recording, factor * scale))


def areas(x: FloatArray, low: FloatArray, high: FloatArray) -> Iterator[str]:
    """The band between two curves, a closed path for each stretch without a gap."""
    filled = np.flatnonzero(np.isfinite(low))
    for run in np.split(filled, np.flatnonzero(np.diff(filled) > 1) + 1):
        there = np.concatenate([x[run], x[run][::-1]])
        yield line(there, np.concatenate([high[run], low[run][::-1]])) + "Z"


def pack(recording: Recording, scale: float) -> dict[str, Any]:
    """Pack readings for the page: second differences of whole numbers, deflated, in base64.

    Counts of the converter are kept to the bit; readings without a step, or with more than
    2^16, are rounded to 2^-16 of their range. Times are kept to 2^-31 of the length.

    Returns
    -------
    dict
        ``times`` and ``counts`` (base64), ``begin`` and ``tick`` (s), ``origin`` and ``step``
        (of the value shown: ``origin + step count``).
    """
    usable = recording.usable
    time, values = recording.time_s[usable], recording.values[usable]
    low, high = float(values.min()), float(values.max())
    step = recording.resolution or 0.0
    if not step or high - low > 65_535 * step:
        step = (high - low) / 65_535 or 1.0
    origin = low + 32_768 * step
    tick = float(time[-1] - time[0]) / (2**31 - 1)
    return {
        "times": _packed(np.rint((time - time[0]) / tick).astype("<i4")),
        "counts": _packed((np.rint((values - low) / step) - 32_768).astype("<i2")),
        "begin": float(time[0]),
        "tick": tick,
        "origin": scale * origin,
        "step": scale * step,
    }


def _packed(numbers: AnyArray) -> str:
    for _ in range(2):  # differences wrap around, and so do the sums that undo them
        numbers = np.diff(numbers, prepend=numbers.dtype.type(0))
    return base64.b64encode(zlib.compress(numbers.tobytes(), 9)).decode()


def quality_by_amplitude(decay: Decay) -> Chart | None:
    """Draw Q of the fitted law against amplitude, and what the turning points alone show.

    Returns
    -------
    Chart or None
        None where neither has a value.
    """
    factor, shown = axis_unit(decay.amplitude_rad, decay.points.unit)
    time, seen, sd = local_quality(decay)
    amplitude = factor * np.interp(time, decay.points.time_s, decay.amplitude_rad)
    reach, law = np.empty((2, 0))
    if decay.fit.light != "red":
        reach, law = decay.along(np.linspace(0.0, float(decay.elapsed_s[-1]), 60))
        reach = factor * reach
    good = np.isfinite(law) & (reach > 0.0)
    reach, law = reach[good], law[good]
    across = np.concatenate([amplitude[amplitude > 0.0], reach])
    if len(across) < 2 or across.min() == across.max():
        return None
    up = 1.08 * float(max([*law, *(seen + sd)]))
    label = f"Amplitude ({pretty_unit(shown)})"
    x = Axis(0.97 * float(across.min()), 1.03 * float(across.max()), LEFT, RIGHT, label, True)
    y = Axis(0.0, up, BOTTOM, TOP, "Q")
    points = zip(x(amplitude), y(seen), y(seen - sd), y(seen + sd), strict=True)
    dots = "".join(
        f"M{a - 2.5:.1f},{b:.1f}a2.5,2.5 0 1,0 5,0a2.5,2.5 0 1,0 -5,0M{a:.1f},{c:.1f}V{d:.1f}"
        for a, b, c, d in points
    )
    rows = [
        ("turning points", f"{a:.6g}", f"{q:.6g}", f"{s:.2g}")
        for a, q, s in zip(amplitude, seen, sd, strict=True)
    ]
    rows += [("fitted law", f"{a:.6g}", f"{q:.6g}", "") for a, q in zip(reach, law, strict=True)]
    csv = csv_rows([("of", f"amplitude ({shown})", "Q", "sd of Q"), *rows])
    return Chart(x, y, [("law", line(x(reach), y(law))), ("dots", dots)], csv=csv)
