"""From the chosen column to radians, volts, metres, or the file's own unit."""

from __future__ import annotations

import re
from dataclasses import dataclass, replace

import numpy as np

from pendpipe.arrays import FloatArray
from pendpipe.errors import InputError
from pendpipe.formats.choose import Choice
from pendpipe.formats.samples import (
    derivative_slope,
    follows_sine,
    periods,
    resolution,
    same_motion,
)
from pendpipe.formats.table import Column, ReadOptions, Table
from pendpipe.formats.words import Unit, unit_of
from pendpipe.recording import Quantity, from_below, jumps_of_a_turn

_RADIAN = Unit("angle", 1.0, "rad")
_DEGREE = Unit("angle", np.pi / 180, "rad")
_UNKNOWN = Unit("own", 1.0, "1")
_QUANTITIES: dict[str, Quantity] = {
    "angle": "angle_rad",
    "volts": "volts",
    "length": "displacement_m",
    "own": "reading",
}


@dataclass(frozen=True)
class Readings:
    """Values of all rows, shape (n,), in the unit of `quantity`; scale; what was guessed."""

    values: FloatArray
    quantity: Quantity
    factor: float
    unit: str
    notes: tuple[str, ...] = ()
    weak_guesses: tuple[str, ...] = ()


@dataclass(frozen=True)
class _Guess:
    """A unit, its reason, and whether it is a weak guess."""

    unit: Unit
    why: str = ""
    weak: bool = False


def readings(table: Table, choice: Choice, options: ReadOptions, time_s: FloatArray) -> Readings:
    """Turn the chosen column, or the pair x, y, into one of the quantities.

    Parameters
    ----------
    time_s
        Times of all rows, NaN where a row is left out.
    """
    if len(choice.readings) == 2:
        return _position(choice.readings[0], choice.readings[1])
    column = choice.readings[0]
    guess = _unit(table, choice, column, options, time_s)
    values = column.values * guess.unit.factor
    notes: tuple[str, ...] = ()
    if guess.unit.kind == "angle":
        values, notes = from_below(values)
    elif guess.unit.name == "counts":
        values, notes = _over_the_turn(values)
    found = Readings(
        values, _QUANTITIES[guess.unit.kind], guess.unit.factor, guess.unit.name, notes
    )
    if not guess.why:
        return found
    stated = f"'{column.label}' {guess.why}"
    if guess.weak:
        return replace(found, weak_guesses=(f"{stated} (--unit)",))
    return replace(found, notes=(stated, *notes))


def _unit(
    table: Table, choice: Choice, column: Column, options: ReadOptions, time_s: FloatArray
) -> _Guess:
    """Find the unit: from the user, from the file, or from the numbers."""
    if options.reading_unit is not None:
        given = unit_of(options.reading_unit)
        if given is None or given.kind not in _QUANTITIES:
            raise InputError(
                "--unit",
                f"'{options.reading_unit}' is not known",
                "give rad, deg, V, mV, m, mm, px, counts, rad/s, m/s^2, ...",
            )
        return _Guess(given)
    # "second,Volt,Volt": some programs print the unit for a name.
    written = unit_of(column.unit or (column.name if len(column.name) > 2 else ""))
    role = choice.roles.get(column.number, "unknown")
    if written is not None and written.kind in _QUANTITIES:
        if role == "velocity" and written.kind in ("angle", "length"):
            return _Guess(Unit("own", written.factor, f"{written.name}/s"))
        return _contradicted(column, written, time_s) or _Guess(written)
    if column.unit and written is None:
        return _Guess(Unit("own", 1.0, column.unit), f"is in {column.unit}, analysed as it stands")
    if written is not None or role in ("none", "time", "index"):
        raise InputError(
            table.place,
            f"'{column.label}' ({column.unit or 'by its name'}) is nothing that a pendulum's"
            " motion is read from",
            "choose another with --column, or give its unit with --unit",
        )
    finite = column.values[np.isfinite(column.values)]
    whole = bool(len(finite)) and bool(np.all(finite == np.rint(finite)))
    reach = _reach(finite)
    # Whole numbers are an instrument's counts where degrees or millimetres would not be: a
    # pendulum seldom goes beyond 180 degrees.
    few = {"volts": 20.0, "signal": 20.0, "angle": 180.0, "length": 400.0, "unknown": 400.0}
    counted = re.search(r"(?i)enc|count|tick|raw", column.name) is not None
    if whole and (counted or reach > few.get(role, np.inf)):
        return _Guess(
            Unit("own", 1.0, "counts"), "holds whole numbers: analysed as counts", weak=True
        )
    headed = _UNITS_OF.search(table.metadata.get("header", ""))
    named = unit_of(headed[1]) if headed else None
    if headed and named and named.kind in ("length", "volts") and role in ("unknown", named.kind):
        return _Guess(named, f"is in {headed[1]}, by the header")
    if role == "volts":
        return _Guess(Unit("volts", 1.0, "V"), "has no unit: taken to be volts", weak=True)
    names = {other.name.lower() for other in choice.channels if not other.unit}
    # A phone's sensor: of a position it knows nothing.
    sensed = role == "length" and {"x", "y", "z"} <= names
    if sensed or role in ("velocity", "acceleration", "signal"):
        what = "one of x, y, z" if sensed else role
        return _Guess(_UNKNOWN, f"({what}) has no unit: analysed in its own", weak=True)
    if role == "length":
        if reach <= 2.0:
            grown = _by_period(column, time_s, named=False)
            if grown is not None and not grown.weak:
                return grown
            return _Guess(Unit("length", 1.0, "m"), "has no unit: taken to be metres", weak=True)
        return _Guess(
            _UNKNOWN, f"swings by {reach:.3g} and has no unit: analysed in its own", weak=True
        )
    return _angle_unit(table, choice, column, time_s)


_UNITS_OF = re.compile(r"(?i)\b(?:vertical|length) units?\W+([a-zµ]+)")
"""What an oscilloscope, or a system of cameras, says above its table."""


def _reach(finite: FloatArray) -> float:
    """How far the readings go from their middle."""
    if not len(finite):
        return 0.0
    low, middle, high = np.percentile(finite, (0.2, 50, 99.8))
    return max(float(high - middle), float(middle - low))


def _contradicted(column: Column, written: Unit, time_s: FloatArray) -> _Guess | None:
    """Doubt a header that gives the one unit of angles where the period shows the other."""
    if written.kind != "angle":
        return None
    reach = _reach(column.values[np.isfinite(column.values)])
    if written.factor == _DEGREE.factor and 0.3 < reach < 3.0:
        other, name, headed = _RADIAN, "radians", "degrees"
    elif written.factor == 1.0 and 3.6 < reach < 170.0:
        other, name, headed = _DEGREE, "degrees", "radians"
    else:
        return None
    slope = follows_sine(time_s, column.values, other.factor)
    if slope is None or abs(slope - 1.0) > 0.25:
        return None
    why = f"is headed in {headed}, but its period grows as a swing in {name} does: taken as such"
    return _Guess(other, why, weak=True)


def _angle_unit(table: Table, choice: Choice, column: Column, time_s: FloatArray) -> _Guess:
    """Tell degrees from radians by whatever the file gives away."""
    finite = column.values[np.isfinite(column.values)]
    if not len(finite):
        return _Guess(_RADIAN)
    reach = _reach(finite)
    words = " ".join((column.name, *table.metadata, *table.metadata.values())).lower()
    stated = re.search(
        r"\b(deg|degs|degrees?|grad|grado|gradi|grados)\b(?! c)|_deg|°(?!\s*[cf])", words
    )
    if stated and "rad" not in words.replace("grad", ""):
        return _Guess(_DEGREE, "is taken to be in degrees (the header names them)")
    by_step = _by_step(finite, choice.roles.get(column.number) == "angle")
    if by_step is not None:
        return by_step
    by_sibling = _by_sibling(choice, column, time_s)
    if by_sibling is not None:
        return by_sibling
    return _by_size(choice, column, finite, reach, time_s)


def _by_size(
    choice: Choice, column: Column, finite: FloatArray, reach: float, time_s: FloatArray
) -> _Guess:
    """Judge by how far it swings, and by whether the period follows the amplitude."""
    named = choice.roles.get(column.number) == "angle"
    # Between -pi and pi with jumps of a turn: radians that go over the top of the scale.
    if jumps_of_a_turn(finite):
        return _Guess(_RADIAN, "jumps by 2 pi: taken to be in radians")
    if reach > 1.1 * np.pi:
        slope = follows_sine(time_s, column.values, np.pi / 180) if reach < 170 else None
        if slope is not None and abs(slope - 1.0) < 0.4:
            return _Guess(
                _DEGREE, "is taken to be in degrees (its period grows as such swings' does)"
            )
        odd = slope is not None and np.radians(reach) > 0.5
        if reach > 360.0 or odd or not (named or reach <= 90.0):
            return _Guess(
                _UNKNOWN, f"has no unit and swings by {reach:.4g}: analysed in its own", True
            )
        return _Guess(_DEGREE, f"has no unit and swings by {reach:.3g}: taken to be degrees", True)
    grown = _by_period(column, time_s, named=named)
    if grown is not None:
        return grown
    slope = follows_sine(time_s, column.values, 1.0)
    if slope is not None and abs(slope) < 0.35 and reach > 0.35:
        # No pendulum of so many radians: a torsion pendulum, or another unit.
        odd = f"has no unit, and its period does not grow as that of a pendulum of {reach:.2g} rad"
        level = float(np.median(finite))
        if named and abs(level - 0.5 * np.pi * np.rint(level / (0.5 * np.pi))) > 0.35:
            return _Guess(_DEGREE, f"{odd}; it hangs at {level:.3g}: taken to be degrees", True)
        if named:
            return _Guess(_RADIAN, f"{odd}: taken to be radians of a torsion pendulum", True)
        return _Guess(_UNKNOWN, f"{odd}: analysed in its own", weak=True)
    return _Guess(_RADIAN, "has no unit: taken to be radians", weak=True)


def _by_period(column: Column, time_s: FloatArray, *, named: bool) -> _Guess | None:
    """Take for radians what is swung through ever faster, just as such an angle is."""
    slope = follows_sine(time_s, column.values, 1.0)
    if slope is None or abs(slope - 1.0) >= 0.35:
        return None
    why = "is taken to be in radians (its period grows as such swings' does)"
    # Of a pendulum 1 m long (2 s) metres look the same.
    usual = float(np.median(periods(time_s, column.values)[0]))
    if not named and abs(usual - 2.0) < 0.3:
        return _Guess(_RADIAN, f"{why}, or in metres, with a string of 1 m", weak=True)
    return _Guess(_RADIAN, why)


def _by_step(finite: FloatArray, named: bool) -> _Guess | None:
    """Read the unit off the step: a printed digit of the other unit, or a part of a turn.

    A step of few digits is an encoder's in a column that is named an angle; in any other it may
    be a converter's.
    """
    if _printed_digit(finite, 1.0) is None:
        for unit, scale, name, other in (
            (_RADIAN, 180 / np.pi, "radians", "degrees"),
            (_DEGREE, np.pi / 180, "degrees", "radians"),
        ):
            digit = _printed_digit(finite, scale)
            if digit is not None:
                why = f"converted to {other}, its values are multiples of {digit:.4g}"
                return _Guess(unit, f"is taken to be in {name} ({why})")
    step = resolution(finite)
    if step is None or _is_round(step):
        return None
    if not named and abs(float(f"{step:.3g}") / step - 1.0) < 2e-5:
        return None
    for turn, unit, name in ((2 * np.pi, _RADIAN, "radians"), (360.0, _DEGREE, "degrees")):
        parts = turn / step
        whole = round(parts)
        near = abs(parts - whole) < 1e-6 * whole + 1e-4
        if near and 100 <= whole <= 1 << 20 and (whole % 4 == 0 or whole % 50 == 0):
            return _Guess(unit, f"is taken to be in {name} (its step is a turn over {whole})")
    return None


def _printed_digit(finite: FloatArray, scale: float) -> float | None:
    """Find the decimal place of which all readings, times `scale`, are multiples."""
    some = finite[:: max(1, len(finite) // 2000)]
    # Beyond 1e9 a double has no such digits left.
    if len(some) < 20 or np.abs(some).max() > 1e9:
        return None
    some = scale * some
    for place in range(7):
        whole = some * 10.0**place
        # Of readings that have no such digit a few in a hundred are this near to one.
        if np.ptp(whole) > 20.0 and np.all(np.abs(whole - np.rint(whole)) < 0.03):
            return 10.0**-place
    return None


def _is_round(step: float) -> bool:
    """Say whether a step is 1, 2, 2.5 or 5 of some decimal place: a printed digit."""
    leading = step / 10.0 ** np.floor(np.log10(step) + 1e-9)
    return bool(np.min(np.abs(leading - np.array([1.0, 2.0, 2.5, 5.0, 10.0])) / leading) < 2e-5)


def _by_sibling(choice: Choice, column: Column, time_s: FloatArray) -> _Guess | None:
    """Compare with the same angle in another unit, or with its derivative in a known one."""
    for other in choice.channels:
        unit = unit_of(other.unit) if other.unit else None
        if other is column or unit is None or len(other.values) != len(column.values):
            continue
        if unit.kind == "angle":
            good = np.isfinite(column.values) & np.isfinite(other.values)
            ratio = same_motion(column.values[good], other.values[good], 0.99) if good.any() else 0
            scale = unit.factor * ratio if ratio else None
        elif unit.name == "rad/s":
            slope = derivative_slope(time_s, column.values, other.values)
            scale = unit.factor * abs(slope) if slope is not None else None
        else:
            continue
        for guess, name in ((_RADIAN, "radians"), (_DEGREE, "degrees")):
            if scale is not None and abs(scale / guess.factor - 1.0) < 0.25:
                return _Guess(guess, f"is taken to be in {name} (by '{other.label}' beside it)")
    return None


def _over_the_turn(values: FloatArray) -> tuple[FloatArray, tuple[str, ...]]:
    """Undo the jumps of an absolute encoder of 2^k counts that hangs near its zero."""
    finite = np.isfinite(values)
    low, high = np.min(values[finite], initial=0.0), np.max(values[finite], initial=0.0)
    turn = 2.0 ** np.ceil(np.log2(high + 1.0)) if high > 0.0 else 1.0
    jumps = np.abs(np.diff(values[finite])) > 0.8 * turn
    if low < 0.0 or turn < 256.0 or not jumps.any():
        return values, ()
    values = values.copy()
    values[finite] = np.unwrap(values[finite], period=turn)
    return values, (f"the counts jump by a turn of {turn:g}: unwrapped",)


def _position(x: Column, y: Column) -> Readings:
    """Turn a position seen from the pivot into an angle: atan2(x, -y), 0 straight down."""
    down = -1.0 if float(np.nanmedian(y.values)) < 0 else 1.0
    angle = np.arctan2(x.values, down * y.values)
    sign = "-" if down < 0 else ""
    note = f"angle = atan2({x.label}, {sign}{y.label}), the position seen from the pivot"
    return Readings(angle, "angle_rad", 1.0, "rad", (note,))
