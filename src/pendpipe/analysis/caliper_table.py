"""The table of a calibration: volts against angles or against a caliper's displacements."""

from __future__ import annotations

import csv
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from pendpipe.arrays import FloatArray
from pendpipe.errors import InputError

ANGLES: Final = ("angle_rad", "angle_deg", "displacement_m")
_LARGEST: Final = 1e6
"""No angle, displacement or voltage of a sensor is as large: what claims to be is a slip."""


@dataclass(frozen=True)
class CaliperTable:
    """Points of a calibration, each array of shape (n,)."""

    angle_rad: FloatArray
    volts: FloatArray
    volts_sd: FloatArray | None
    angle_sd_rad: FloatArray
    by_displacement: bool
    """Whether the angles were made from displacements, with an arm's common error."""


def read_caliper_table(
    path: str | Path,
    *,
    arm_m: float | None = None,
    displacement_sd_m: float = 0.0,
    delimiter: str | None = None,
    decimal: str | None = None,
) -> CaliperTable:
    """Read a calibration's table.

    Parameters
    ----------
    path
        A CSV with a header: ``volts``, one of ``angle_rad``, ``angle_deg``,
        ``displacement_m``, optionally ``volts_sd`` and ``angle_sd_rad``.
    arm_m
        From the axis to where the caliper touches: angle = displacement/arm.
    displacement_sd_m
        Standard deviation of a displacement, where the table gives none of the angle.
    delimiter, decimal
        Where the guess is wrong: tab, semicolon and comma are tried in this order, and
        the decimal mark is a point, or a comma where cells can be read with it only.

    Raises
    ------
    InputError
        On a missing column or arm, or text in a number: file, line, what, remedy.
    """
    place = Path(path)
    columns = _columns(place, delimiter, decimal)
    found = [name for name in ANGLES if name in columns]
    angle, sd = _angles(place, columns[found[0]], found[0], arm_m, displacement_sd_m)
    return CaliperTable(
        angle_rad=angle,
        volts=columns["volts"],
        volts_sd=columns.get("volts_sd"),
        angle_sd_rad=columns.get("angle_sd_rad", np.full(len(angle), sd)),
        by_displacement=found[0] == "displacement_m",
    )


def _angles(
    place: Path, values: FloatArray, name: str, arm_m: float | None, displacement_sd_m: float
) -> tuple[FloatArray, float]:
    """Turn a column into radians, with the standard deviation that the caliper leaves."""
    if name == "angle_rad":
        return values, 0.0
    if name == "angle_deg":
        return np.deg2rad(values), 0.0
    if arm_m is None or not 0.0 < arm_m < np.inf:
        raise InputError(
            place, "displacements need the arm on which they were measured", "give --arm-m 0.3"
        )
    return values / arm_m, displacement_sd_m / arm_m


def _columns(place: Path, delimiter: str | None, decimal: str | None) -> dict[str, FloatArray]:
    """Read the named columns of numbers; columns that this module does not use may be text."""
    try:
        text = place.read_text(encoding="utf-8-sig")
    except OSError:
        raise InputError(place, "the table can't be read", "check the path") from None
    except UnicodeDecodeError:
        raise InputError(place, "this is no UTF-8 text", "save the table as CSV") from None
    lines = [
        (number, line)
        for number, line in enumerate(text.splitlines(), start=1)
        if line.strip() and not line.lstrip().startswith("#")
    ]
    if not lines:
        raise InputError(place, "the file is empty", "give a table with a header")
    mark = delimiter or next((sign for sign in "\t;," if sign in lines[0][1]), ",")
    names = [name.strip().strip('"') for name in lines[0][1].split(mark)]
    for needed in (("volts",), ANGLES):
        if sum(name in names for name in needed) != 1:
            raise InputError(
                f"{place}, line {lines[0][0]}",
                f"exactly one column {' or '.join(needed)} is needed (found {', '.join(names)})",
                "rename the columns",
            )
    wanted = [name for name in (*ANGLES, "volts", "volts_sd", "angle_sd_rad") if name in names]
    rows = [(number, next(csv.reader([line], delimiter=mark))) for number, line in lines[1:]]
    return {
        name: np.array([_number(place, row, names.index(name), name, decimal) for row in rows])
        for name in wanted
    }


def _number(
    place: Path, row: tuple[int, list[str]], index: int, name: str, decimal: str | None
) -> float:
    """Read one cell."""
    number, cells = row
    where = f"{place}, line {number}"
    if index >= len(cells):
        raise InputError(where, f"{name} is missing", "complete or drop the row")
    text = cells[index].strip()
    if decimal == "," or (decimal is None and "." not in text):
        text = text.replace(",", ".")
    try:
        value = float(text)
    except ValueError:
        raise InputError(
            where, f"{name} '{text}' is no number", "correct or drop the row"
        ) from None
    if not abs(value) < _LARGEST:  # nor is NaN
        raise InputError(where, f"{name} is {text}", "correct or drop the row")
    return value
