"""The times of the rows: in seconds, in order, evened out where their stamps are coarse."""

from bisect import bisect_right
from dataclasses import dataclass, field
from itertools import product
from typing import Final

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from pendpipe.analysis.half_cycles import periods
from pendpipe.arrays import BoolArray, FloatArray, IntArray
from pendpipe.errors import InputError, refuse_if
from pendpipe.facts import SWINGS, Fact, How
from pendpipe.formats.columns import Choice
from pendpipe.formats.grammar import MOST_DAMAGED
from pendpipe.formats.lists import ONE_WAY, counts_samples, one_way
from pendpipe.formats.table import FEWEST, Column, ReadOptions, Table
from pendpipe.formats.words import Unit, counts_swings, plain, unit_of
from pendpipe.recording import is_uniform

_EPOCH: Final = 3e8
"""Seconds beyond which a clock counts from a date (1979 in Unix time), not a start."""
_LATEST: Final = 1e10
"""Seconds since 1970 that no recording has reached: the unit in the header is wrong."""
_LONGEST_S: Final = 300.0
"""Period beyond which a time without a unit is hardly in seconds: no pendulum is so slow."""
_SHORTEST_S: Final = 5e-4
"""Period below which it is hardly in seconds either."""
_SWINGS_S: Final = (0.02, 100.0)
"""Shortest and longest period of what is read without a unit of time, s; units of clocks are a
thousand apart, so that of a second's swing one fits."""
_TICKS: Final = (
    (1.0, "seconds"),
    (1e-3, "milliseconds"),
    (1e-6, "microseconds"),
    (1e-9, "nanoseconds"),
)
_LATE: Final = 3.0
"""Packets by which a stamp may be off the line: more is a pause."""
_RATES: Final = 0.02
"""By which a rate that is given may differ from that of the stamps: pauses are in these."""


_ROUNDED: Final = 0.02
"""Share of the rows with the stamp of the row above that tells rounded stamps from copies."""
_MOST_MISSING: Final = 0.02
"""Of the rows, beyond which missing frames make any interval fit."""
_MOST_TORN: Final = 0.05
"""Share of stamps off the longest rise that are interpolated, since their rows stay."""
_BESIDE: Final = 4
"""Stamps to each side of one, by whose median the step there is known."""
_WITHIN: Final = 0.6
"""Of its last digit, within which a stamp lies: half of it by rounding, and a tenth of jitter."""
_RUNS: Final = 50
"""Runs below one another at most, and rows of each at least."""
_BETTER: Final = 1000.0
"""Times by which periods agree better, beyond which only the digits of the stamps show."""
_DAYS: Final = (2e4, 1e6)
"""Days since 1900 by which spreadsheets count, from 1954 on."""
_TRIES, _ROUNDS = 21, 8
"""Numbers of missing frames that are tried, and lines through the stamps of each count."""
_FEW_TRIES: Final = 3
"""Of more rows than `_LONG`, through which a line is so sure that it finds their number itself."""
_LONG: Final = 200_000
"""Rows, of which all tries take a second and a half."""


@dataclass
class TimeBase:
    """Times of the rows that are kept; which rows those are, in order; what was done.

    Parameters
    ----------
    time_s
        Shape (n,), rising.
    rows
        Row of the table that each comes from, shape (n,); a permutation where the file
        has its newest row first.
    lines
        Line of the file that each comes from, where it has lines: a lost row leaves one.
    """

    time_s: FloatArray
    rows: IntArray
    lines: IntArray | None = None
    facts: list[Fact] = field(default_factory=list)
    metadata: dict[str, str] = field(default_factory=dict)

    def say(self, kind: str, value: str, said: str, how: How = "shown") -> None:
        """Add a fact."""
        self.facts.append(Fact(kind, value, how, said))

    def keep(self, rows: slice | BoolArray | IntArray, said: str = "") -> None:
        """Keep some of the rows, or put them into another order, and say so."""
        before = len(self.time_s)
        self.time_s, self.rows = self.time_s[rows], self.rows[rows]
        self.lines = None if self.lines is None else self.lines[rows]
        if said:
            self.say("rows", f"{len(self.time_s)} of {before}", said)


# Differences of infinite cells, which are refused in the end, are no numbers.
@np.errstate(invalid="ignore", over="ignore")
def time_base(table: Table, choice: Choice, options: ReadOptions) -> TimeBase:
    """Find the time of every row.

    In this order: the rate that the user gives, the instrument's own clock, the time
    column (in the unit given, or the one that fits), a column that counts samples with the
    rate in the header, the rate in the header alone.

    Raises
    ------
    InputError
        When there is no time, or it falls, repeats or is not a number: file, line, remedy.
    """
    reading = choice.readings[0] if choice.readings else table.columns[0]
    every = np.arange(len(reading.values))
    if options.sample_rate is not None:
        given = f"{options.sample_rate:g} Hz"
        said = f"times are counted at the given {given} from the first row"
        stamped = _stamped_rate(choice, options.sample_rate)
        odd = abs(stamped / options.sample_rate - 1.0) > _RATES
        said += (
            f", but the stamps of '{choice.time.label}' say {stamped:.4g} Hz"
            if choice.time and odd
            else ""
        )
        fact = Fact("clock", given, "guessed" if odd else "stated", said)
        return TimeBase(every.astype(np.float64) / options.sample_rate, every, facts=[fact])
    if reading.time_s is not None:
        return TimeBase(reading.time_s, every, facts=[Fact("clock", "the instrument's", "stated")])
    column = choice.time
    if column is not None and not choice.counts:
        return _from_column(table, choice, column, reading, options)
    counted = f" ('{column.label}' only counts)" if column is not None else ""
    interval_s = table.interval_s or np.nan
    refuse_if(
        table.interval_s is None,
        table.place,
        (f"{choice.listed.problem}; " if choice.listed else "")
        + f"there is no time column and no sample rate{counted}",
        "give --sample-rate, or name the time with --column TIME:READING",
    )
    number = every.astype(np.float64) if column is None else column.values - column.values[0]
    rate = f"{1 / interval_s:g} Hz"
    also = f" and '{column.label}'" if column is not None else ""
    base = TimeBase(number * interval_s, every)
    base.say("clock", rate, f"no time column: times from the header's {rate}{also}", "stated")
    return _in_order(table, choice, base, interval_s, options)


def _stamped_rate(choice: Choice, given: float) -> float:
    """Rows a second by the column of times, whatever its unit; NaN without one.

    Units of time lie a thousand apart: that one is taken which comes nearest to the `given` rate.
    """
    column = choice.time
    if column is None or choice.counts or not one_way(column.values) > ONE_WAY:
        return np.nan
    values = column.values[np.isfinite(column.values)]
    rate = (len(values) - 1) / abs(float(values[-1] - values[0]))
    return float(rate * 1000.0 ** np.rint(np.log10(given / rate) / 3.0))


def _from_column(
    table: Table, choice: Choice, column: Column, reading: Column, options: ReadOptions
) -> TimeBase:
    """Read the times off a column."""
    filled = np.ones(len(column.values), dtype=bool)
    if len(reading.values) == len(filled):
        # Of runs side by side one is shorter.
        filled &= ~(np.isnan(column.values) & ~np.isfinite(reading.values))
    refuse_text(table, column, "correct or drop the row")
    lost = ~np.isfinite(column.values) & filled
    bad = np.flatnonzero(lost)
    if few := 0 < len(bad) <= MOST_DAMAGED * len(filled):
        filled &= ~lost
    refuse_if(
        bad.size and not few,
        table.where(int(bad.min(initial=len(filled) - 1))),
        "the time is missing or NaN",
        "correct or drop the row",
    )
    factor, unit = _time_unit(choice, column, reading, options)
    if unit.how == "guessed" and table.interval_s is not None:
        # A clock without a unit ticks in some decimal part of a second.
        factor = table.interval_s / float(np.median(np.abs(np.diff(column.values[filled]))))
        factor, rate = 10.0 ** np.rint(np.log10(factor)), 1.0 / table.interval_s
        said = f"'{column.label}' ticks every {factor:g} s, by the header's {rate:g} Hz"
        unit = Fact("unit of time", f"{factor:g} s", "shown", said)
    rows = np.flatnonzero(filled)
    lines = None if table.lines is None or len(table.lines) < len(filled) else table.lines[rows]
    base = TimeBase(column.values[rows] * factor, rows, lines, [unit])
    for left, what in (
        (few * len(bad), "without a time"),
        (len(filled) - len(rows) - few * len(bad), "with neither time nor reading"),
    ):
        if left:
            base.say("rows", f"{left} left out", f"{left} row(s) {what} left out", "stated")
    return _in_order(table, choice, base, factor, options)


def refuse_text(table: Table, column: Column, remedy: str) -> None:
    """Refuse a column by the first of its cells that should be a number and is not."""
    row, text = next(iter(column.garbled.items()), (0, ""))
    refuse_if(column.garbled, table.where(row), f"'{text}' is not a number", remedy)


def _time_unit(
    choice: Choice, column: Column, reading: Column, options: ReadOptions
) -> tuple[float, Fact]:
    """Find the seconds in one unit of the time column: given, in the header, or by the swing."""
    if (asked := options.units[0]) is not None:
        given = unit_of(asked) or Unit("none", 1.0)
        refuse_if(
            given.kind != "time", "--unit", f"'{asked}' is not a unit of time", "give s, ms, us"
        )
        return given.factor, Fact("unit of time", asked, "stated")
    listed = choice.listed is not None and choice.listed.kind == "amplitudes"
    if listed and counts_swings(f"{column.name} {column.unit}"):
        return 1.0, Fact("unit of time", SWINGS, "stated", f"'{column.label}' counts swings")
    values = column.values[np.isfinite(column.values)]
    largest = float(np.abs(values).max(initial=0.0))
    for word in filter(unit_of, (column.unit, column.name)):
        unit = unit_of(word)
        fits = unit is not None and unit.kind == "time" and largest * unit.factor <= _LATEST
        if unit and fits and (word == column.unit or plain(word) not in ("t", "h", "min")):
            return unit.factor, Fact("unit of time", word, "stated")
    period = 0.0 if listed else _period(reading, values)
    for factor, name in _TICKS[::-1]:
        ticks = factor < 1.0 and float(np.ptp(values)) > 0.1 * largest
        # What wanders shows no period that would be none since 1970.
        short = reading.wanders or factor * period < _LONGEST_S
        if largest * factor > _EPOCH and not ticks and short:
            said = f"'{column.label}' counts {name} since 1970"
            return factor, Fact("unit of time", name, "shown", said)
    return _time_by_size(column, period, values)


def _period(reading: Column, values: FloatArray) -> float:
    """Period of the reading on a clock, in the clock's unit; 0 where nothing swings."""
    cycle = reading.swing.samples_per_cycle
    span = float(np.ptp(values)) if len(values) else 0.0
    return cycle * span / max(1, len(values) - 1)


def _time_by_size(column: Column, period: float, values: FloatArray) -> tuple[float, Fact]:
    """Take seconds, unless no pendulum would be so slow; sure of a list, or where no other fits."""
    kind, said = "unit of time", f"'{column.label}' is taken to be in seconds"
    short, long = _SWINGS_S
    fits = [size for size, _ in _TICKS if short <= size * period <= long]
    if period > _LONGEST_S:
        # The coarsest of those that make it a swing; a hundred milliseconds are one too.
        fitting = ((size, name) for size, name in _TICKS if size * period < _LONGEST_S / 10.0)
        factor, name = next(fitting, _TICKS[-1])
        said = f"'{column.label}' has no unit: taken to be {name} by a period of {period:.4g}"
        return factor, Fact(kind, name, "guessed", said)
    if 0.0 < period < _SHORTEST_S < 86400.0 * period < _LONGEST_S * 1e3:
        first, last = _DAYS
        dated = first < float(np.abs(values).max(initial=0.0)) < last
        said = f"'{column.label}' is taken to be in days, as spreadsheets count"
        return 86400.0, Fact(kind, "days", "shown" if dated else "guessed", said)
    whole = bool(np.all(values[:1000] == np.rint(values[:1000])))
    if (fits == [1.0] and not (whole and period)) or not period:
        return 1.0, Fact(kind, "s", "shown", said)
    said += f": a period of {period:.4g} s" if period else ""
    return 1.0, Fact(kind, "s", "guessed", said, option="--unit ms: for milliseconds")


def _in_order(
    table: Table, choice: Choice, base: TimeBase, tick: float, options: ReadOptions
) -> TimeBase:
    """Turn times that are out of order, or repeat, into times that rise; or refuse them."""
    if one_way(base.time_s) > ONE_WAY and base.time_s[-1] < base.time_s[0]:
        base.keep(slice(None, None, -1), "the newest row stands first: rows turned round")
    start = float(base.time_s[0]) if len(base.time_s) else 0.0
    dated = abs(start) > _EPOCH
    base.time_s = base.time_s - start * dated
    if np.diff(base.time_s).min(initial=1.0) <= 0:
        # What lies before --start, or behind --stop, need not be in order.
        start_s, stop_s = options.start_s, options.stop_s
        late = np.flatnonzero(base.time_s >= (np.inf if stop_s is None else stop_s))
        base.keep(slice(late.min(initial=len(base.time_s)) + 1))
        early = np.flatnonzero(base.time_s <= (-np.inf if start_s is None else start_s))
        base.keep(slice(early.max(initial=0), None))
    repairs = [
        _count_rows,
        _keep_last,
        _drop_repeats,
        _first_of_stacked,
        _through_packets,
    ]
    # Where stamps are rounded, rows of one time are no copies.
    rounded = len(base.time_s) > 1 and np.mean(np.diff(base.time_s) == 0.0) > _ROUNDED
    repairs.insert(0 if rounded else 3, _interpolate_torn)
    for repair in repairs:
        if np.diff(base.time_s).min(initial=1.0) <= 0:
            repair(choice, base)
    steps = np.diff(base.time_s)
    if steps.min(initial=1.0) > 0:
        _count_late_rows(choice, base)
        _without_lone_ends(base)
        if dated:
            start, base.time_s = start + base.time_s[0], base.time_s - base.time_s[0]
            base.metadata["recorded_at"] = f"{start:.6f} s since 1970"
            said = f"times are counted from the first row ({start:.6f} s on its clock)"
            base.say("clock", f"from {start:.6f} s", said, "stated")
        return base
    at = int(np.argmax(steps <= 0))
    verb = "repeats" if steps[at] == 0 else "falls"
    before, after = base.time_s[at] / tick, base.time_s[at + 1] / tick
    clocks = (
        f"take the time from '{column.label}' (--column '{column.label}:READING'), "
        for column in table.columns
        if column is not choice.time and not counts_samples(column)
        if np.diff(column.values).min(initial=np.inf) > 0
    )
    end = f"{base.time_s[at]:.10g}"
    raise InputError(
        table.where(int(base.rows[at + 1])),
        f"the time {verb} ({before:.10g} is followed by {after:.10g})",
        f"{next(clocks, '')}read what lies before it (--stop {end}) or behind it (--start {end}),"
        " or give --sample-rate if the rows are evenly spaced",
    )


def _count_rows(_choice: Choice, base: TimeBase) -> None:
    """Count the rows where stamps are rounded and repeat; a logger may slow down behind them."""
    whole = len(base.time_s)
    last = int(np.max(np.flatnonzero(np.diff(base.time_s) == 0.0), initial=-2)) + 2
    for rows in sorted({whole, last}, reverse=True):
        even = _rounded(base.time_s[:rows], base.lines)
        # So far from its zero a clock has no digits left between the rows.
        interval = 0.0 if even is None else float(np.diff(even).min())
        if even is None or not interval > 0.0:
            continue
        frames = round((even[-1] - even[0]) / interval) + 1 - len(even)
        lost = f", with {frames} missing" if frames else ""
        until = f" until {even[-1]:.6g} s" if rows < whole else ""
        exact = min(interval, np.ptp(base.time_s[:rows] - even))
        base.say(
            *("clock", f"{1.0 / interval:.6g} Hz"),
            f"time stamps are rounded and repeat{until}: rows are counted at"
            f" {1.0 / interval:.6g} Hz{lost}, which all stamps agree with: the rate is known to"
            f" {100.0 * exact / np.ptp(even):.1g} %",
        )
        base.time_s = np.append(even, base.time_s[rows:])
        return


def _count_late_rows(choice: Choice, base: TimeBase) -> None:
    """Count rows that were stamped as they arrived: by rows the periods agree far better."""
    values = _values(choice, base)
    steps = np.diff(base.time_s)
    # Rows that arrive in bursts are even within these, which take up little of the time.
    if len(values) <= FEWEST or (
        is_uniform(base.time_s) and 2.0 * np.median(steps) > np.mean(steps)
    ):
        return
    index = np.arange(len(values))
    even: FloatArray = np.polynomial.Polynomial.fit(index, base.time_s, 1)(index)
    stamped, counted = (periods(time, values)[0] for time in (base.time_s, even))
    if min(len(stamped), len(counted)) < FEWEST:
        return
    scatter = [np.median(np.abs(np.diff(found))) / np.median(found) for found in (stamped, counted)]
    if scatter[1] < min(0.1 * scatter[0], 0.03):
        late = float(np.std(base.time_s - even))
        # Of exact times the periods agree to the last digit.
        better = float(min(scatter[0] / max(scatter[1], 1e-300), _BETTER))
        rate = 1.0 / (even[1] - even[0])
        base.say(
            *("clock", f"{rate:.6g} Hz"),
            f"time stamps scatter by {late:.2g} s, as of arrival: rows are counted at"
            f" {rate:.6g} Hz, by which the periods agree"
            f" {better:.0f} times better{' or more' * (better == _BETTER)}; the rate is known"
            f" to {100.0 * late / np.ptp(even):.1g} %",
            "guessed",
        )
        base.time_s = even


def _without_lone_ends(base: TimeBase) -> None:
    """Leave out a first or last row that a torn stamp has put a long way from the others."""
    steps = np.diff(base.time_s)
    usual = (
        float(np.median(steps))
        if len(steps) * MOST_DAMAGED > 1 and is_uniform(base.time_s)
        else np.inf
    )
    first, last = (bool(np.any(end > 50.0 * usual)) for end in (steps[:1], steps[-1:]))
    if first or last:
        note = f"{first + last} lone row(s) left out, with a stamp far from the others'"
        base.keep(slice(int(first), len(base.time_s) - last), note)


def _values(choice: Choice, base: TimeBase) -> FloatArray:
    """Give the readings of the rows that are kept; none where there are fewer."""
    values = choice.readings[0].values if choice.readings else np.empty(0)
    return values[base.rows] if len(values) > base.rows.max(initial=0) else np.empty(0)


def _drop_repeats(choice: Choice, base: TimeBase) -> None:
    """Leave out rows with the time of an earlier row: a logger that sends what it has sent.

    Whole copies always; with other readings where they are rare, for then the earlier row,
    which stands where its time belongs, is the true one.
    """
    _, first, which = np.unique(base.time_s, return_index=True, return_inverse=True)
    origin = first[which.reshape(-1)]
    again = origin < np.arange(len(origin))
    if many := (of_one_stamp := again.sum()) > max(20, 0.01 * len(again)):
        long = (c.values for c in choice.channels if len(c.values) > base.rows.max())
        for values in (column[base.rows] for column in long):
            again &= (values == values[origin]) | (np.isnan(values) & np.isnan(values[origin]))
    # Of many rows with one stamp, some have the same reading near a turn.
    if again.any() and not (many and again.sum() < 0.5 * of_one_stamp):
        base.keep(~again, f"{again.sum()} row(s) that repeat the time of an earlier row left out")


def _first_of_stacked(_choice: Choice, base: TimeBase) -> None:
    """Keep the first of several runs that stand below one another, each from its own start."""
    starts = np.flatnonzero(np.diff(base.time_s) < 0) + 1
    lengths = np.diff(np.concatenate(([0], starts, [len(base.time_s)])))
    again = np.abs(base.time_s[starts] - base.time_s[0]) < 0.05 * np.ptp(base.time_s)
    if not 0 < len(starts) <= _RUNS or lengths.min() < _RUNS or not again.all():
        return
    base.say(
        *("rows", f"the first {lengths[0]}"),
        f"{len(lengths)} runs stand below one another: the first is read ({lengths[0]} rows);"
        " put each into a file of its own for the others",
        "guessed",
    )
    base.keep(slice(starts[0]))


def _through_packets(_choice: Choice, base: TimeBase) -> None:
    """Put even times through the stamps of packets, which arrive late and not evenly, by a line.

    Most rows have the stamp of the row above; no stamp lies more than a few packets off the line,
    beyond which rows are missing.
    """
    steps, index = np.diff(base.time_s), np.arange(len(base.time_s))
    if steps.min() < 0.0 or np.mean(steps == 0.0) < 0.5:
        return
    line = np.polynomial.Polynomial.fit(index, base.time_s, 1)
    even, packet = line(index), float(np.mean(steps[steps > 0.0]))
    late = base.time_s - even
    if not np.abs(late).max() < _LATE * packet or not even[-1] > even[0]:
        return
    # What arrives together is late together: each stamp is one reading of the line.
    stamps = np.count_nonzero(steps) + 1
    error = float(np.std(late)) * np.sqrt(12.0 / stamps) / float(np.ptp(even))
    rate = 1.0 / float(even[1] - even[0])
    base.say(
        *("clock", f"{rate:.6g} Hz"),
        f"{len(index) / stamps:.3g} rows have one stamp, as packets have: times are even, at"
        f" {rate:.6g} Hz by a line through the stamps, known to {100.0 * error:.1g} %",
        "guessed",
    )
    base.time_s = even


def _interpolate_torn(_choice: Choice, base: TimeBase) -> None:
    """Interpolate stamps off the longest rise of them, and leave out rows that are off its ends.

    So a clock that was set for a while, and torn digits, stand in an otherwise rising time.
    """
    good = _longest_rise(base.time_s)
    torn = len(base.time_s) - len(good)
    rows, steps = np.diff(good), np.diff(base.time_s[good])
    # Behind a clock that was set back the next row comes too soon.
    far = rows > 1
    soon = far.any() and np.any(steps[far] < 0.5 * rows[far] * np.median(steps))
    if not 0 < torn <= _MOST_TORN * len(good) or soon:
        return
    base.time_s = np.interp(np.arange(len(base.time_s)), good, base.time_s[good])
    said = f"{torn} time stamp(s) that fall out of order interpolated"
    base.say("clock", f"{torn} interpolated", said)
    ends = len(base.time_s) - 1 - int(good[-1] - good[0])
    if ends:
        inside = slice(int(good[0]), int(good[-1]) + 1)
        base.keep(inside, f"{ends} row(s) at the ends left out, whose stamps are out of order")


def _longest_rise(time: FloatArray) -> IntArray:
    """Rows of the longest series of stamps that do not fall (patience sorting), shape (k,)."""
    least, rows, before = list[float](), list[int](), list[int]()
    for row, stamp in enumerate(time.tolist()):
        at = bisect_right(least, stamp)
        before.append(rows[at - 1] if at else -1)
        least[at : at + 1], rows[at : at + 1] = [stamp], [row]
    chain = rows[-1:]
    while before[chain[-1]] >= 0:
        chain.append(before[chain[-1]])
    return np.array(chain[::-1])


def _rounded(time: FloatArray, lines: IntArray | None = None) -> FloatArray | None:
    """Undo the coarseness of the stamps of evenly spaced rows; ``None`` if they are not that.

    One test for stamps that are rounded, cut, or stand for a block of rows: the rows are even
    within what one stamp stands for (`_coarseness`), which may change on the way. Stamps lie at
    the middle of it (rounded), or at either end (cut; the arrival of a block).

    Where a stamp shows that frames are missing, they are counted (`_frames`).
    """
    steps = np.diff(time)
    if len(time) < 10 or steps.min() < 0 or not 0.001 <= np.mean(steps == 0) < 1.0:
        return None
    # A clock's own jitter comes on top: a tenth of an interval.
    digit = _coarseness(time) + 0.15 * float(time[-1] - time[0]) / len(time)
    index: FloatArray = np.arange(len(time), dtype=np.float64)
    placed = index if lines is None else (lines[: len(time)] - lines[0]).astype(np.float64)
    places = (placed, index)[not 0.0 < placed[-1] - index[-1] <= 0.03 * len(time) :]
    for place, late in product(places, (0.0, 0.5, -0.5)):
        centre = time + late * digit
        even: FloatArray = np.polynomial.Polynomial.fit(place, centre, 1, w=1.0 / digit)(place)
        # Of two rows in three the rounding errors have a mean: the line lies midway.
        even += 0.5 * float(np.max(centre - even) + np.min(centre - even)) * (late == 0.0)
        if np.all(np.abs(centre - even) <= _WITHIN * digit) and even[-1] > even[0]:
            return even
    if np.mean(steps == 0) < _ROUNDED:
        return None
    counted = (_frames(time, digit, place) for place in places)
    return next((even for even in counted if even is not None), None)


def _coarseness(time: FloatArray) -> FloatArray:
    """Find what one stamp stands for, shape (n,): its last digit, or the step to the next stamp.

    The step where several rows have one stamp, as whole blocks and arrays do.
    """
    digit = _last_digit(time)
    starts = np.flatnonzero(np.diff(time, prepend=-np.inf) > 0.0)
    if len(starts) <= 2 * _BESIDE:
        return digit
    window = 2 * _BESIDE + 1
    rows = np.diff(np.append(starts, len(time)))
    step = np.diff(time[starts])
    around = sliding_window_view(np.pad(np.append(step, step[-1:]), _BESIDE, mode="edge"), window)
    usual = np.median(around, axis=1)
    many = sliding_window_view(np.pad(rows, _BESIDE, mode="reflect"), window)
    crowded = np.mean(many, axis=1) > 1.3
    blocks: FloatArray = np.repeat(np.where(crowded, usual, 0.0), rows)
    return np.maximum(digit, blocks)


def _last_digit(time: FloatArray) -> FloatArray:
    """What one in the last printed digit of each stamp is worth.

    Either all have so many decimals, or all so many digits: then it grows with the time.
    """
    some = time[:: max(1, len(time) // 1000)]
    texts = [f"{abs(stamp):.10f}".rstrip("0") for stamp in (*time[:100], *some) if stamp]
    decimals = max((len(text.partition(".")[2]) for text in texts), default=0)
    digits = max((len(text.replace(".", "").lstrip("0")) for text in texts), default=1)
    size = np.floor(np.log10(np.maximum(np.abs(time), 1e-9)) + 1e-9)
    return np.maximum(10.0**-decimals, 10.0 ** (size - digits + 1))


def _frames(time: FloatArray, digit: FloatArray, index: FloatArray) -> FloatArray | None:
    """Count the frames from the first row to each, those missing as the stamps make most probable.

    Each row is at least one frame after the row above, as many as bring it within its stamp, and at
    least as many after the first as `index` says; a line through the stamps so counted improves
    the interval. Rounded stamps scatter by 1/12 of their last digit squared, and each missing
    frame may lie anywhere: -ln L is 6 sum(error/digit)^2 + (number missing) ln(rows).

    Returns
    -------
    time_s
        ``None`` where some stamp contradicts each count, or more than 2 % are missing: of
        so many any interval would do.
    """
    slack, rows = _WITHIN * digit, float(index[-1])
    most = _MOST_MISSING * len(time) + 3.0
    tries = _TRIES if len(time) < _LONG else _FEW_TRIES
    missing = np.unique(np.rint(np.linspace(0.0, most, tries))).tolist()
    least, found = np.inf, None
    for lost in missing:
        start, interval = float(time[0]), float(np.ptp(time)) / (rows + lost)
        for _ in range(_ROUNDS):
            first = np.ceil((time - start - slack) / interval - 1e-9)
            count = index + np.maximum.accumulate(np.maximum(first - index, 0.0))
            if count[-1] > rows + most:
                break
            even: FloatArray = start + interval * count
            off = (time - even) / digit
            score = 6.0 * float(off @ off) + float(count[-1] - rows) * np.log(len(time))
            if score < least and np.all(np.abs(off) <= _WITHIN):
                least, found = score, even
            line = np.polynomial.Polynomial.fit(count, time, 1, w=1.0 / digit).convert()
            start, interval = line.coef.tolist()
    return found


def _keep_last(choice: Choice, base: TimeBase) -> None:
    """For one row per count: of the rows in one tick of the clock keep the last."""
    jumps = np.abs(np.diff(_values(choice, base)))
    count = float(np.median(jumps)) if len(jumps) and np.all(np.diff(base.time_s) >= 0) else 0.0
    if count > 0 and np.mean(np.abs(jumps - count) < 0.01 * count) >= 0.9:
        last = np.append(np.diff(base.time_s) > 0, True)
        base.keep(
            last, f"{np.sum(~last)} count(s) within one tick of the clock merged with the next"
        )
