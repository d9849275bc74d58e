"""How often each test that shows a fact of a file is wrong.

    python -m benchmarks.facts [--only KIND] [--number 4000]

Each kind of fact has drawings of its own: recordings of which the fact is known, sound ones and
those that the test is for. It is wrong where it is shown and false; of what is guessed nothing is
counted. The rates that `pendpipe.facts.KINDS` states are the upper ends of these intervals.
"""

from __future__ import annotations

import importlib
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from random import Random
from typing import Final, NamedTuple

import numpy as np

from benchmarks.journal import judge_parser
from benchmarks.table import head, share, table_row
from pendpipe.analysis.readings import find_step, from_below, pull_along_string, with_amplitudes
from pendpipe.arrays import FloatArray
from pendpipe.errors import InputError
from pendpipe.facts import KINDS, Fact
from pendpipe.formats.columns import choose
from pendpipe.formats.lists import steady
from pendpipe.formats.lost import lost_readings
from pendpipe.formats.reading import recording_of
from pendpipe.formats.saturation import saturation
from pendpipe.formats.table import Column, ReadOptions, Table, swing_of
from pendpipe.formats.times import time_base
from pendpipe.physics.lengthening import elliptic
from pendpipe.physics.pendulum import STANDARD_GRAVITY_M_PER_S2
from pendpipe.recording import Recording

Rng = np.random.Generator
OPTIONS: Final = ReadOptions()
_NEAR: Final = 0.25
"""By which a scale of the readings may be off before it changes what sin x makes of T."""


class Swing(NamedTuple):
    """Times and angles of a pendulum under gravity, with noise; its period; readings a cycle."""

    time_s: FloatArray
    angle_rad: FloatArray
    period_s: float
    cycle: float


def between(rng: Rng, low: float, high: float) -> float:
    """A number whose logarithm is evenly spread."""
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def swing(rng: Rng, fewest: float = 5.0, largest_q: float = 1000.0, loudest: float = 0.1) -> Swing:
    """Draw a swing of `fewest` to 400 readings a cycle, 8 to 200 cycles, Q from 10 on."""
    cycle, quality, amplitude = (
        between(rng, fewest, 400.0),
        between(rng, 10.0, largest_q),
        between(rng, 0.02, 2.0),
    )
    period, turns = (
        between(rng, 0.3, 4.0),
        np.arange(min(int(cycle * between(rng, 8, 200)), 20_000)) / cycle,
    )
    size = amplitude * np.exp(-np.pi * turns / quality)
    phase = np.cumsum(0.5 * np.pi / elliptic(np.sin(0.5 * size) ** 2)[0]) / cycle
    angle = size * np.cos(2.0 * np.pi * phase + rng.uniform(0.0, 6.3))
    noise = amplitude * between(rng, 1e-5, loudest) * rng.standard_normal(len(turns))
    return Swing(turns * period, angle + noise, period, cycle)


def stepped(rng: Rng, values: FloatArray) -> FloatArray:
    """Readings of a converter, of 20 to 10^4 steps to their span; a third has no step."""
    step = float(np.ptp(values)) * (between(rng, 1e-4, 0.05) if rng.integers(3) else 1e-9)
    return np.asarray(step * np.rint(values / step))


def table(*columns: tuple[str, str, FloatArray]) -> Table:
    """A table as a reader finds it."""
    found = (Column(*each, number) for number, each in enumerate(columns, start=1))
    return Table(Path("drawn"), "csv", tuple(found))


Answer = tuple[Fact | None, bool]
"""What is said of a drawing, and whether it is so."""


def _of_kind(kind: str, facts: tuple[Fact, ...] | list[Fact]) -> Fact | None:
    return next((fact for fact in facts[::-1] if fact.kind == kind and fact.how == "shown"), None)


def layout(rng: Rng) -> Answer:
    """A table of text: right where rows and columns are, whatever their unit."""
    dialects = importlib.import_module("tests.formats.test_dialects")
    sample = dialects.draw(Random(int(rng.integers(1 << 30))))
    with tempfile.TemporaryDirectory() as folder:
        found, said = dialects.outcome(Path(folder) / "a.txt", sample)
    return Fact("layout", "", "shown"), found != "wrong" or said.startswith("unit")


def _turned_over(rng: Rng, time: FloatArray) -> tuple[FloatArray, str]:
    """Stamps of a clock that begins again at 0 on the way."""
    turn, unit, tick = [
        (2.0**16, "ms", 1e3),
        (2.0**32, "us", 1e6),
        (86400.0, "s", 1.0),
        (604800.0, "s", 1.0),
    ][rng.integers(4)]
    first = turn - tick * float(rng.uniform(0.1, 0.9)) * float(time[-1])
    return np.mod(np.rint(1e3 * (first + tick * time)) / 1e3, turn), unit


def _damaged(rng: Rng) -> tuple[Table, FloatArray]:
    """A recording whose clock has one of ten faults, or none; with the true time of each row."""
    drawn = swing(rng)
    time, x = drawn.time_s, stepped(rng, drawn.angle_rad)
    interval, rows = drawn.period_s / drawn.cycle, np.arange(len(time))
    name, unit, stamps = "time", "s", time + between(rng, 1e-3, 1e3)
    fault, more = int(rng.integers(11)), list[tuple[str, str, FloatArray]]()
    if fault == 0:
        stamps, unit = _turned_over(rng, time)
    elif fault == 1:
        more = [("ns", "ns", 1e9 * np.mod(stamps, 1.0))]
        stamps = np.floor(stamps)
    elif fault == 2:
        name, unit = "dt", "ms"
        stamps = np.full(len(time), 1e3 * interval)
    elif fault == 3:
        torn = rng.choice(rows, max(1, len(rows) // 200), replace=False)
        stamps[torn] *= 10.0 ** rng.choice([-3, -2, -1, 1, 2, 3], len(torn))
    elif fault == 4:
        digit = 10.0 ** np.ceil(np.log10(interval))
        stamps = digit * np.rint(stamps / digit)
    elif fault == 5:
        block = int(rng.integers(2, 20))
        stamps = stamps[rows // block * block]
    elif fault == 6:
        again = np.sort(np.append(rows, rng.choice(rows, max(1, len(rows) // 100), replace=False)))
        rows = again
    elif fault == 7:
        rows = rows[::-1]
    elif fault == 8:
        stamps = np.sort(stamps + interval * rng.exponential(3.0, len(rows)))
    elif fault == 9:
        stamps[-1] += 1e4 * interval
    columns = ((name, unit, stamps[rows]), *((n, u, v[rows]) for n, u, v in more))
    return table(*columns, ("theta", "rad", x[rows])), time[rows]


def _clock(kind: str, rng: Rng) -> Answer:
    """Right where no row is off by more than an interval, or what a stamp stands for."""
    found, true = _damaged(rng)
    choice = choose(found, OPTIONS)
    base = time_base(found, choice, OPTIONS)
    off = base.time_s - true[base.rows]
    interval = float(np.median(np.abs(np.diff(true))))
    stamped = found.columns[0].values[base.rows]
    # A stamp that is repeated stands for all rows until the next.
    coarse = float(np.ptp(true)) / max(1, len(np.unique(stamped)) - 1) if choice.time else interval
    whole = len(base.rows) > 0.98 * len(np.unique(true))
    right = whole and float(np.ptp(off)) <= max(interval, coarse)
    return _of_kind(kind, [*choice.facts, *base.facts]), right


def unit_of_time(rng: Rng) -> Answer:
    """Stamps without a unit, of swings of 0.03 to 80 s in nine cases of ten."""
    drawn = swing(rng)
    size = float(rng.choice([1.0, 1e-3, 1e-6, 1e-9]))
    slow = float(np.exp(rng.normal(np.log(1.5), 2.4))) / drawn.period_s
    since = float(rng.choice([0.0, 0.0, 1.7e9]))
    digits = max(size, 1e-7) if rng.integers(2) else 1e-12
    stamps = np.rint((since + slow * drawn.time_s) / digits) * digits / size
    found = table(("t", "", stamps), ("theta", "rad", drawn.angle_rad))
    choice = choose(found, OPTIONS)
    base = time_base(found, choice, OPTIONS)
    return _of_kind("unit of time", base.facts), bool(
        0.9 < np.ptp(base.time_s) / (slow * np.ptp(drawn.time_s)) < 1.1
    )


def _columns(rng: Rng) -> tuple[Table, int, int]:
    """Columns without names: a time and a swing among three others; the places of these two."""
    drawn = swing(rng)
    x, time, many = drawn.angle_rad, drawn.time_s, len(drawn.time_s)
    beside = [
        rng.standard_normal(many),
        np.cumsum(rng.standard_normal(many)),
        np.gradient(x, time),
        x**2 + 1e-3 * rng.standard_normal(many),
        np.sin(40.0 * time) + rng.standard_normal(many),
        20.0 + 1e-4 * time + 0.1 * rng.standard_normal(many),
        np.full(many, 7.0),
        np.sin(2.0 * np.pi * time / (0.9 * drawn.period_s)),
        np.arange(many, dtype=np.float64),
    ]
    # The number of the row is that, and no other time.
    sizes = [*(between(rng, 1e-2, 1e2) for _ in beside[:-1]), 1.0]
    some = [sizes[k] * beside[k] for k in rng.choice(len(beside), 3, replace=False)]
    held = [time, between(rng, 1e-2, 1e2) * x, *some]
    order = rng.permutation(len(held))
    found = table(*(("", "", held[place]) for place in order))
    return found, int(np.flatnonzero(order == 0)[0]) + 1, int(np.flatnonzero(order == 1)[0]) + 1


def _column(kind: str, rng: Rng) -> Answer:
    """Right where the column is the time, or the swing."""
    found, time, reading = _columns(rng)
    choice = choose(found, OPTIONS)
    if kind == "time column":
        return _of_kind(kind, choice.facts), choice.time is not None and choice.time.number == time
    return _of_kind(kind, choice.facts), choice.readings[0].number == reading


def unit(rng: Rng) -> Answer:
    """Readings without a unit: angles in three cases of five, else lengths, pixels, volts."""
    drawn = swing(rng)
    length_m = STANDARD_GRAVITY_M_PER_S2 * (drawn.period_s / (2.0 * np.pi)) ** 2
    scales = [
        *(1.0, 180.0 / np.pi, 1.0, 180.0 / np.pi, 1.0, 180.0 / np.pi),
        *(length_m, 1e2 * length_m, between(rng, 50.0, 2000.0), between(rng, 0.1, 10.0)),
    ]
    values = float(rng.choice(scales)) * drawn.angle_rad
    values = np.round(values, int(rng.integers(2, 6))) if rng.integers(2) else values
    found = recording_of(table(("t", "s", drawn.time_s), ("value", "", values)), OPTIONS)
    ratio = float(np.std(found.values) / np.std(drawn.angle_rad))
    return _of_kind("unit", found.facts), bool(abs(ratio - 1.0) < _NEAR)


def turns(rng: Rng) -> Answer:
    """Angles about any zero, half of them within one turn; right where a constant is off."""
    drawn = swing(rng)
    true = drawn.angle_rad + rng.uniform(0.0, 2.0 * np.pi)
    cut = rng.uniform(0.0, 2.0 * np.pi)
    wrapped = np.mod(true - cut, 2.0 * np.pi) + cut if rng.integers(2) else true
    values, notes = from_below(wrapped)
    fact = Fact("turns", "undone", "shown") if notes else None
    return fact, bool(np.ptp(values - true) < _NEAR)


def pivot(rng: Rng) -> Answer:
    """Positions on a circle about a pivot, or on none: on a line, or of a swing in two planes."""
    drawn = swing(rng)
    arm = between(rng, 0.1, 1000.0)
    angle = np.clip(drawn.angle_rad, -1.4, 1.4)
    x, y = arm * np.sin(angle), -arm * np.cos(angle)
    turned = bool(rng.integers(4))
    if not turned:
        tilt = rng.uniform(-0.3, 0.3)
        x, y = arm * angle * np.cos(tilt), arm * angle * np.sin(tilt)
    y = y + arm * between(rng, 1e-5, 1e-2) * rng.standard_normal(len(y))
    centre = arm * rng.uniform(-3.0, 3.0, 2) * rng.integers(2)
    found = table(("t", "s", drawn.time_s), ("x", "m", x + centre[0]), ("y", "m", y + centre[1]))
    recording = recording_of(found, OPTIONS)
    if len(choose(found, OPTIONS).readings) < 2:
        return None, True
    slope = float(np.polyfit(angle, recording.values, 1)[0])
    return _of_kind("pivot", recording.facts), turned and abs(abs(slope) - 1.0) < 0.05


def amplitudes(rng: Rng) -> Answer:
    """Swings of 2 to 400 readings a cycle, and as often the sizes of their turning points."""
    drawn = swing(rng, fewest=2.0)
    time, values, listed = drawn.time_s, drawn.angle_rad, bool(rng.integers(2))
    if listed:
        every = max(1, round(drawn.cycle))
        size = np.abs(drawn.angle_rad[: len(time) // every * every]).reshape(-1, every).max(axis=1)
        time, values = time[: len(size) * every : every], size
    found = with_amplitudes(Recording(time_s=time, displacement_m=values))
    return _of_kind("amplitudes", found.facts), listed


def pull(rng: Rng) -> Answer:
    """An axis of an accelerometer at a part of the length; right where 2 f is seen.

    One axis in two lies as it may, the others near the string.
    """
    drawn = swing(rng, loudest=1e-4)
    angle, at = drawn.angle_rad, rng.uniform(0.0, 1.5)
    squared = (np.gradient(angle, drawn.time_s) * drawn.period_s / (2.0 * np.pi)) ** 2
    tilt = np.arccos(rng.uniform(*((0.96, 1.0) if rng.integers(2) else (-1.0, 1.0))))
    along, across = np.cos(angle) + at * squared, (1.0 - at) * np.sin(angle)
    values = STANDARD_GRAVITY_M_PER_S2 * (along * np.cos(tilt) + across * np.sin(tilt))
    # Phones scatter by 0.001 to 0.1 m/s^2.
    values += between(rng, 1e-3, 0.1) * rng.standard_normal(len(values))
    twice = swing_of(values).samples_per_cycle < 0.75 * drawn.cycle
    return pull_along_string(drawn.time_s, values), twice


def drive(rng: Rng) -> Answer:
    """A free decay, of Q up to 10,000, or as often a motion that keeps its size."""
    drawn = swing(rng, largest_q=1e4)
    driven, values = bool(rng.integers(2)), drawn.angle_rad
    if driven:
        size = float(np.abs(values[: int(drawn.cycle) + 1]).max())
        values = size * np.sin(2.0 * np.pi / drawn.period_s * drawn.time_s)
        values += size * between(rng, 1e-5, 0.1) * rng.standard_normal(len(values))
    said = steady(drawn.time_s, stepped(rng, values), ())
    return Fact("drive", said, "shown") if said else None, driven


def lost(rng: Rng) -> Answer:
    """A sound swing, which has lost none."""
    values = stepped(rng, swing(rng).angle_rad)
    facts = lost_readings(values, swings=swing_of(values).clear)[1]
    return _of_kind("lost readings", facts), not facts


def cut_off(rng: Rng) -> Answer:
    """A sound swing, of which none is cut off."""
    values = stepped(rng, swing(rng).angle_rad)
    fact = saturation(values, find_step(values))
    return fact, fact is None


DRAWN: Final[dict[str, Callable[[Rng], Answer]]] = {
    "layout": layout,
    "rows": lambda rng: _clock("rows", rng),
    "time column": lambda rng: _column("time column", rng),
    "unit of time": unit_of_time,
    "clock": lambda rng: _clock("clock", rng),
    "reading": lambda rng: _column("reading", rng),
    "unit": unit,
    "turns": turns,
    "pivot": pivot,
    "amplitudes": amplitudes,
    "pull": pull,
    "drive": drive,
    "lost readings": lost,
    "saturation": cut_off,
}
"""Of each kind that a test shows, the drawing of one case."""


def counted(kind: str, number: int) -> tuple[int, int]:
    """How often a fact is shown, and how often that is wrong; refusals show none."""
    shown = wrong = 0
    for seed in range(number):
        try:
            fact, right = DRAWN[kind](np.random.default_rng((660, seed)))
        except InputError:
            continue
        shown += fact is not None and fact.how == "shown"
        wrong += fact is not None and fact.how == "shown" and not right
    return shown, wrong


def main() -> int:
    """Print a row a kind; fail where a rate is beyond what is stated."""
    parser = judge_parser(__doc__, "facts", 4000)
    parser.add_argument("--only", default="", choices=("", *DRAWN))
    told = parser.parse_args()
    print(head("kind", "shown", "wrong, of all that are drawn", "stated"))
    beyond = 0
    for kind in DRAWN:
        if told.only in ("", kind):
            number = min(told.number, 1000) if kind == "layout" else told.number
            shown, wrong = counted(kind, number)
            print(table_row(kind, (shown, share(wrong, number), KINDS[kind].wrong)), flush=True)
            beyond += wrong > (KINDS[kind].wrong or 0) * number
    return int(beyond > 0)


if __name__ == "__main__":
    sys.exit(main())
