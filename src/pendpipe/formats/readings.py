"""From the chosen column to radians, volts or metres, with every guess told."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pendpipe.arrays import FloatArray
from pendpipe.errors import InputError
from pendpipe.formats.choose import Choice, meaning
from pendpipe.formats.options import ReadOptions
from pendpipe.formats.table import Column, Table
from pendpipe.formats.units import Unit, unit_of
from pendpipe.recording import Quantity


@dataclass(frozen=True)
class Readings:
    """Values of all rows, shape (n,), in the unit of `quantity`; scale; what was guessed."""

    values: FloatArray
    quantity: Quantity
    factor: float
    notes: tuple[str, ...]


def readings(
    table: Table, choice: Choice, options: ReadOptions, time_s: FloatArray, *, as_told: bool = False
) -> Readings:
    """Turn the chosen column, or the pair x, y, into one of the quantities.

    Parameters
    ----------
    time_s
        Times of all rows, NaN where a row is left out (only an angular velocity needs them).
    as_told
        Keep an angle's zero where the file has it.
    """
    if len(choice.readings) == 2:
        return _position(choice.readings[0], choice.readings[1])
    column = choice.readings[0]
    unit, notes = _unit(table, column, options)
    values = column.values * unit.factor
    if unit.kind == "volts":
        return Readings(values, "volts", unit.factor, tuple(notes))
    if unit.kind == "length":
        return Readings(values, "displacement_m", unit.factor, tuple(notes))
    if unit.kind == "angular velocity":
        values = _integrated(values, time_s)
        notes.append(f"'{column.label}' is an angular velocity: the angle is its integral")
        return Readings(values, "angle_rad", unit.factor, tuple(notes))
    if not as_told:
        values, more = _from_below(values)
        notes.extend(more)
    return Readings(values, "angle_rad", unit.factor, tuple(notes))


def _unit(table: Table, column: Column, options: ReadOptions) -> tuple[Unit, list[str]]:
    """Find the unit: told by the user, told by the file, or guessed from the numbers."""
    if options.reading_unit is not None:
        told = unit_of(options.reading_unit)
        if told is None or told.kind not in ("angle", "volts", "length", "angular velocity"):
            raise InputError(
                "--unit",
                f"'{options.reading_unit}' is not known",
                "give rad, deg, V, mV, m, mm, ...",
            )
        return told, []
    written = unit_of(column.unit) if column.unit else None
    if written is not None and written.kind in ("angle", "volts", "length", "angular velocity"):
        return written, []
    role = meaning(column)
    if written is not None or role == "other":
        raise InputError(
            table.place,
            f"'{column.label}' ({column.unit or 'by its name'}) is neither an angle, a voltage nor"
            " a displacement",
            "choose another with --channel or --column, or say its unit with --unit",
        )
    if role == "volts":
        return Unit("volts", 1.0), [f"'{column.label}' has no unit: taken to be volts"]
    if role == "length":
        return Unit("length", 1.0), [f"'{column.label}' has no unit: taken to be metres"]
    if role == "angular velocity":
        return Unit("angular velocity", 1.0), [f"'{column.label}' is taken to be in rad/s"]
    return _angle_unit(table, column)


def _angle_unit(table: Table, column: Column) -> tuple[Unit, list[str]]:
    """Tell degrees from radians: no pendulum swings beyond pi about its centre."""
    words = " ".join((column.name, *table.metadata, *table.metadata.values())).lower()
    finite = column.values[np.isfinite(column.values)]
    if not len(finite):
        return Unit("angle", 1.0), []
    low, middle, high = np.percentile(finite, (0.2, 50, 99.8))
    reach = max(float(high - middle), float(middle - low))
    # Between -pi and pi with jumps of a turn: radians that go over the top of the scale.
    turns = _jumps_of_a_turn(finite) and float(np.ptp(finite)) < 2.02 * np.pi
    said = ("deg" in words or "°" in words or "grad" in words) and "rad" not in words
    if not said and (reach <= 1.1 * np.pi or turns):
        return Unit("angle", 1.0), [f"'{column.label}' has no unit: taken to be radians"]
    if reach > 1000:
        raise InputError(
            table.place,
            f"'{column.label}' reaches {reach:.4g} and has no unit",
            "say it with --unit, or turn counts into an angle first",
        )
    why = "its name or header says so" if said else f"it reaches {reach:.3g}"
    return Unit("angle", np.pi / 180), [f"'{column.label}' is taken to be in degrees ({why})"]


def _jumps_of_a_turn(values: FloatArray) -> bool:
    """Say whether neighbouring readings (radians) lie a turn apart."""
    jumps = np.abs(np.diff(values))
    return bool(np.any((jumps > 1.8 * np.pi) & (jumps < 2.2 * np.pi)))


def _from_below(values: FloatArray) -> tuple[FloatArray, list[str]]:
    """Count the angle from where the pendulum hangs: undo wraps, then whole half turns.

    A centre within 0.35 rad of a multiple of pi is taken to be where the pendulum hangs:
    at an odd one the file counts from the top, at an even one from some turns ago. So is
    one within 0.15 rad of a quarter turn: polar angles are counted from the horizontal.
    """
    notes = []
    finite = np.isfinite(values)
    if _jumps_of_a_turn(values[finite]):
        values = values.copy()
        values[finite] = np.unwrap(values[finite])
        notes.append("the angle jumps by a turn: unwrapped")
    low, high = np.percentile(values[finite], (5, 95)) if finite.any() else (0.0, 0.0)
    centre = float(np.median(values[finite])) if finite.any() else 0.0
    centre = centre if high - low < 1.0 else 0.5 * float(low + high)
    for quarters, words in ((2, "half turn"), (1, "quarter turn")):
        turns = round(centre / (0.5 * np.pi * quarters))
        shift = 0.5 * np.pi * quarters * turns
        if turns and abs(centre - shift) < (0.35 if quarters == 2 else 0.15):
            notes.append(
                f"the angle swings about {centre:.3f} rad: {shift:.4f} rad"
                f" ({turns} {words}) taken off, so that it hangs at 0"
            )
            return values - shift, notes
    return values, notes


def _position(x: Column, y: Column) -> Readings:
    """Turn a position seen from the pivot into an angle: atan2(x, -y), 0 straight down."""
    down = -1.0 if float(np.nanmedian(y.values)) < 0 else 1.0
    angle = np.arctan2(x.values, down * y.values)
    sign = "-" if down < 0 else ""
    note = f"angle = atan2({x.label}, {sign}{y.label}), the position seen from the pivot"
    return Readings(angle, "angle_rad", 1.0, (note,))


def _integrated(rate: FloatArray, time_s: FloatArray) -> FloatArray:
    """Integrate an angular velocity (trapezoids), its mean taken out against drift."""
    timed = np.isfinite(time_s)
    angle: FloatArray = np.full(len(rate), np.nan)
    if not np.isfinite(rate[timed]).all():
        return angle
    free = rate[timed] - np.mean(rate[timed])
    steps = 0.5 * (free[1:] + free[:-1]) * np.diff(time_s[timed])
    angle[timed] = np.concatenate(([0.0], np.cumsum(steps)))
    angle -= float(np.mean(angle[timed]))
    return angle
