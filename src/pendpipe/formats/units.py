"""The unit of the readings: as the file states it, else as one test of physics shows it."""

import re
import sys
from dataclasses import dataclass
from typing import Final

import numpy as np

from pendpipe.analysis.half_cycles import periods
from pendpipe.analysis.readings import from_below, jumps_of_a_turn
from pendpipe.arrays import FloatArray
from pendpipe.errors import refuse_if
from pendpipe.facts import Fact, How
from pendpipe.formats.circle import seen_from_pivot
from pendpipe.formats.columns import Choice
from pendpipe.formats.table import (
    Column,
    ReadOptions,
    Table,
    derivative_slope,
    sine_in,
)
from pendpipe.formats.times import TimeBase
from pendpipe.formats.words import Unit, unit_of
from pendpipe.physics.lengthening import ANGLES, unit_shown
from pendpipe.recording import Quantity

_ANGLES = {name: Unit("angle", size, "rad") for name, size in ANGLES.items()}
_RADIAN, _DEGREE = _ANGLES["radians"], _ANGLES["degrees"]
_UNKNOWN = Unit("own", 1.0, "1")
_QUANTITIES: dict[str, Quantity] = {
    "angle": "angle_rad",
    "volts": "volts",
    "length": "displacement_m",
    "own": "reading",
}


@dataclass(frozen=True)
class Readings:
    """Values of all rows, shape (n,), in the unit of `quantity`; scale; how it is known."""

    values: FloatArray
    quantity: Quantity
    factor: float
    unit: str
    facts: tuple[Fact, ...] = ()
    radius_excess: FloatArray | None = None


@dataclass(frozen=True)
class _Guess:
    """A unit, its reason, and how it is known."""

    unit: Unit
    why: str = ""
    how: How = "stated"


def readings(table: Table, choice: Choice, options: ReadOptions, base: TimeBase) -> Readings:
    """Turn the chosen column, or the pair x, y, into one of the quantities.

    Raises
    ------
    InputError
        When the columns have fewer rows than the times, or the column is no motion.
    """
    rows = len(choice.readings[0].values)
    refuse_if(
        any(len(c.values) != rows for c in choice.readings) or base.rows.max(initial=0) >= rows,
        table.place,
        "the columns have unequal lengths",
        "choose with --column",
    )
    time_s = np.full(rows, np.nan)
    time_s[base.rows] = base.time_s
    if len(choice.readings) == 2:
        seen = seen_from_pivot(*choice.readings, time_s)
        return Readings(
            *(seen.angle_rad, "angle_rad", 1.0, "rad", (seen.fact,)),
            radius_excess=seen.radius_excess,
        )
    column = choice.readings[0]
    guess = _unit(table, choice, column, options, time_s)
    unit, values, notes = guess.unit, column.values * guess.unit.factor, tuple[str, ...]()
    if unit.kind == "angle" and choice.listed is None:
        values, notes = from_below(values)
    elif unit.name == "counts":
        values, notes = _over_the_turn(values)
    said = f"'{column.label}' {guess.why}" if guess.why else ""
    facts = (
        Fact("unit", unit.name, guess.how, said),
        *(Fact("turns", "undone", "shown", note) for note in notes),
    )
    return Readings(values, _QUANTITIES[unit.kind], unit.factor, unit.name, facts)


def _unit(
    table: Table, choice: Choice, column: Column, options: ReadOptions, time_s: FloatArray
) -> _Guess:
    """Find the unit: from the user, from the file, or from the numbers."""
    if (asked := options.units[1]) is not None:
        given = unit_of(asked) or Unit("none", 1.0)
        refuse_if(
            given.kind not in _QUANTITIES,
            "--unit",
            f"'{asked}' is not known",
            "give rad, deg, V, mV, m, mm, px, counts, rad/s, m/s^2, ...",
        )
        return _Guess(given)
    # "second,Volt,Volt": some programs print the unit for a name.
    written = unit_of(column.unit or (column.name if len(column.name) > 2 else ""))
    role = column.role
    if written is not None and written.kind in _QUANTITIES:
        if role == "velocity" and written.kind in ("angle", "length"):
            return _Guess(Unit("own", written.factor, f"{written.name}/s"))
        return _contradicted(column, written, time_s) or _Guess(written)
    if column.unit and written is None:
        return _Guess(Unit("own", 1.0, column.unit), f"is in {column.unit}, analysed as it stands")
    refuse_if(
        written is not None or role in ("none", "time", "index"),
        table.place,
        f"'{column.label}' ({column.unit or 'by its name'}) does not describe a pendulum's motion",
        "choose another with --column, or give its unit with --unit",
    )
    finite = column.values[np.isfinite(column.values)]
    headed = [*_UNITS_OF.findall(table.metadata.get("header", "")), ""][0]
    named = unit_of(headed) or Unit("none", 1.0)
    if named.kind in ("length", "volts") and role in ("unknown", named.kind):
        return _Guess(named, f"is in {headed}, by the header")
    if np.all(finite == np.rint(finite)) and re.search(r"(?i)enc|count|tick|raw|adc", column.name):
        return _Guess(
            Unit("own", 1.0, "counts"), "holds whole numbers: analysed as counts", "guessed"
        )
    if role == "volts" and (options.volts_per_radian or _VOLTS.search(column.name)):
        return _Guess(Unit("volts", 1.0, "V"), "has no unit: taken to be volts", "guessed")
    # A phone's sensor: of a position it knows nothing.
    names = {other.name.lower() for other in choice.channels if not other.unit}
    sensed = role == "length" and {"x", "y", "z"} <= names
    what = " (one of x, y, z)" if sensed else f" ({role})" if role in _OF_SENSORS else ""
    found = None if what else _angle_unit(table, choice, column, time_s)
    return found or _Guess(
        _UNKNOWN, f"{what.strip()} has no unit: analysed in its own".strip(), "guessed"
    )


_METRE_S: Final = 0.3
"""Off 2 s, within which g/omega^2 is 1 m to 30 %, as is no other of the usual units."""
_POSITION: Final = 0.02
"""Error of the share of sin x up to which it says of a position that it is an angle. In pixels, or
metres, of lengths from 1 to 10^4 the share goes as their square, which by chance lies within two
errors of 1, 0.92 to 1.08 of it, one time in 200."""
_ASIDE: Final = 3.0
"""Degrees by which a camera hangs askew, as a rule: chance lies as near to a quarter turn once in
fifteen times, so that a centre only lets guess."""
_NEAR: Final = 0.06
"""Chance that a number lies within 0.03 of a whole one."""
_DIGITS: Final = 20
"""Readings of which `_printed_digit` looks at as many at least."""
_PLACES: Final = 6
"""Decimals that are looked for."""
_VOLTS: Final = re.compile(r"(?i)volt|spannung|tensi|напряж|电压|電圧|^(u|ch(annel)? ?\d|ampl)$")
"""Names of voltages, and of the channels of an oscilloscope."""

_OF_SENSORS: Final = ("velocity", "acceleration", "signal")
_UNITS_OF = re.compile(r"(?i)\b(?:vertical|length) units?\W+([a-zµ]+)")
"""What an oscilloscope, or a system of cameras, says above its table."""


def _contradicted(column: Column, written: Unit, time_s: FloatArray) -> _Guess | None:
    """Doubt a header that gives the one unit of angles where the period shows the other."""
    headed = next((name for name, unit in _ANGLES.items() if unit == written), "")
    other = {"radians": "degrees", "degrees": "radians"}.get(headed, "")
    name = _by_sine(periods(time_s, column.values), other) if other else None
    if name is None:
        return None
    why = f"is headed in {headed}, but its period grows as a swing in {name} does: taken as such"
    return _Guess(_ANGLES[name], why, "guessed")


def _by_sine(cycles: tuple[FloatArray, FloatArray], *names: str) -> str | None:
    """The unit of angles, among those named, in which periods lengthen as that of sin x."""
    units = {name: ANGLES[name] for name in names}
    return unit_shown(lambda size: sine_in(*cycles, size), units)


def _angle_unit(table: Table, choice: Choice, column: Column, time_s: FloatArray) -> _Guess | None:
    """Find an angle's unit in the header's words, or by a test of physics; ``None`` without either.

    In this order: the derivative beside it in a known unit; the period, which lengthens as that
    of sin x does in one unit only; numbers that are round in the other unit; jumps of a turn.
    """
    finite = column.values[np.isfinite(column.values)]
    if not len(finite):
        return _Guess(_RADIAN)
    words = " ".join((column.name, *table.metadata, *table.metadata.values())).lower()
    stated = re.search(
        r"\b(deg|degs|degrees?|grad|grado|gradi|grados)\b(?! c)|_deg|°(?!\s*[cf])", words
    )
    # What a header says of another column, or of a rate, it does not say of this one.
    named = {unit.name for c in choice.channels if (unit := unit_of(c.unit)) is not None}
    elsewhere = named & {"rad", "rad/s"} or "rad" in words.replace("grad", "")
    if stated and column.role != "length" and not elsewhere:
        return _Guess(_DEGREE, "is taken to be in degrees (the header names them)")
    return (
        _by_rate(choice, column, time_s)
        or _by_period(column, time_s)
        or (_by_digits(finite) if column.role != "length" else None)
        or (
            _Guess(_RADIAN, "jumps by 2 pi: it is in radians", "shown")
            if jumps_of_a_turn(finite)
            else None
        )
        or (_by_centre(finite) if column.role == "angle" else None)
    )


def _by_centre(finite: FloatArray) -> _Guess | None:
    """Take for degrees what swings within a quarter turn about one, two or three quarters of 360.

    So an angle from the horizontal, or from the axis x of a picture. Of radians that centre would
    lie 14 turns off or more.
    """
    low, high = np.percentile(finite, (1, 99)).tolist()
    centre, turn = 0.5 * (low + high), 360.0
    nearest = 0.25 * turn * round(centre / (0.25 * turn))
    aside = abs(centre - nearest)
    if not (0.0 < abs(nearest) < turn and aside < _ASIDE and high - low < 0.5 * turn):
        return None
    return _Guess(_DEGREE, f"swings about {centre:.4g}: taken to be in degrees", "guessed")


def _by_period(column: Column, time_s: FloatArray) -> _Guess | None:
    """Take for radians, degrees or turns what is swung through ever faster, just as they are."""
    cycles = periods(time_s, column.values)
    position = column.role == "length"
    name = _by_sine(cycles, *(["radians"] if position else ANGLES))
    told = sine_in(*cycles, 1.0) if position and name else None
    if name is None or (told and told.sd > _POSITION):
        return None
    why = f"is in {name}: its period lengthens with the swing as sin x has it"
    # Of a pendulum 1 m long (2 s) metres look the same.
    usual = float(np.median(cycles[0]))
    if name == "radians" and column.role != "angle" and abs(usual - 2.0) < _METRE_S:
        return _Guess(_RADIAN, f"{why}, or in metres, with a string of 1 m", "guessed")
    return _Guess(_ANGLES[name], why, "shown")


def _by_digits(finite: FloatArray) -> _Guess | None:
    """Read the unit off printed digits: all numbers are multiples of one in the other unit."""
    if _printed_digit(finite, 1.0) is not None:
        return None
    shown = (
        _Guess(
            unit,
            f"is in {name} (converted to {other}, its values are multiples of {digit:.4g})",
            "shown",
        )
        for unit, scale, name, other in (
            (_RADIAN, 180 / np.pi, "radians", "degrees"),
            (_DEGREE, np.pi / 180, "degrees", "radians"),
        )
        if (digit := _printed_digit(finite, scale))
    )
    return next(shown, None)


def _printed_digit(finite: FloatArray, scale: float) -> float | None:
    """Find the decimal place of which all readings, times `scale`, are multiples."""
    some = finite[:: max(1, len(finite) // 2000)]
    # Beyond it a double has no such digits left.
    if len(some) < _DIGITS or np.abs(some).max() > 10.0 ** (sys.float_info.dig - _PLACES):
        return None
    wholes = ((10.0**-place, scale * some * 10.0**place) for place in range(_PLACES + 1))
    # Of readings that have no such digit a few in a hundred are this near to one.
    digits = (
        digit
        for digit, whole in wholes
        if np.ptp(whole) > 20.0 and np.all(np.abs(whole - np.rint(whole)) < 0.5 * _NEAR)
    )
    return next(digits, None)


def _by_rate(choice: Choice, column: Column, time_s: FloatArray) -> _Guess | None:
    """Compare its derivative with one in a known unit that stands beside it."""
    slopes = (
        (other, unit.factor * abs(derivative_slope(time_s, column.values, other.values) or 0.0))
        for other in choice.channels
        if (unit := unit_of(other.unit)) is not None and unit.name == "rad/s"
        if len(other.values) == len(column.values)
    )
    shown = (
        _Guess(guess, f"is taken to be in {name} (by '{other.label}' beside it)", "shown")
        for other, slope in slopes
        for guess, name in ((_RADIAN, "radians"), (_DEGREE, "degrees"))
        if abs(slope / guess.factor - 1.0) < 0.25
    )
    return next(shown, None)


_LEAST_TURN: Final = 256.0
"""Counts of the coarsest absolute encoder, of 8 bits."""


def _over_the_turn(values: FloatArray) -> tuple[FloatArray, tuple[str, ...]]:
    """Undo the jumps of an absolute encoder of 2^k counts that hangs near its zero."""
    finite = np.isfinite(values)
    low, high = np.min(values[finite], initial=0.0), np.max(values[finite], initial=0.0)
    turn = 2.0 ** np.ceil(np.log2(high + 1.0)) if high > 0.0 else 1.0
    if low < 0.0 or turn < _LEAST_TURN or not np.any(np.abs(np.diff(values[finite])) > 0.8 * turn):
        return values, ()
    values[finite] = np.unwrap(values[finite], period=turn)
    return values, (f"the counts jump by a turn of {turn:g}: unwrapped",)
