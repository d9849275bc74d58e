"""The `[[effects]]` of a model file: which of the catalogue, and how strong."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from pendpipe.arrays import FloatArray
from pendpipe.configuration.faults import nearest
from pendpipe.effects.catalogue import by_identifier
from pendpipe.effects.effect import Effect, Parameter
from pendpipe.errors import InputError


class Given(NamedTuple):
    """An effect with its values, a switch's size included."""

    effect: Effect
    values: FloatArray

    def named(self) -> dict[str, float]:
        """The values by their parameters' names."""
        first = 1 if self.effect.parameter_free else 0
        names = [parameter.name for parameter in self.effect.parameters]
        return dict(zip(names, self.values[first:].tolist(), strict=True))


def read_effects(place: str | Path, tables: Sequence[Mapping[str, Any]]) -> list[Given]:
    """Check the tables `[[effects]]` of a model file.

    Raises
    ------
    InputError
        Where an identifier or a parameter is unknown, missing, or out of its bounds.
    """
    return [
        _read(f"{place}, effects {number}", dict(table))
        for number, table in enumerate(tables, start=1)
    ]


def _read(place: str, table: dict[str, Any]) -> Given:
    identifier = table.pop("id", None)
    if not isinstance(identifier, str):
        raise InputError(place, "its id is missing", 'add id = "...", a name of docs/effects.md')
    effect = by_identifier(identifier, place)
    place = f"{place} ({identifier})"
    known = [parameter.name for parameter in effect.parameters]
    for name in table:
        if name not in known:
            raise InputError(place, f"unknown parameter '{name}'", nearest(name, known))
    values = [_value(place, parameter, table) for parameter in effect.parameters]
    return Given(effect, np.array([1.0] * effect.parameter_free + values))


def _value(place: str, parameter: Parameter, table: Mapping[str, Any]) -> float:
    given = table.get(parameter.name, parameter.default)
    unit = f", in {parameter.unit}" if parameter.unit_in("rad") else ""
    if given is None:
        raise InputError(place, f"'{parameter.name}' is missing", f"add it{unit}")
    if isinstance(given, bool) or not isinstance(given, int | float):
        raise InputError(place, f"'{parameter.name}' is no number", f"give a number{unit}")
    if not parameter.low <= given <= parameter.high:
        raise InputError(
            place,
            f"'{parameter.name}' is {given:g}",
            f"give a number from {parameter.low:g} to {parameter.high:g}{unit}",
        )
    return float(given)
