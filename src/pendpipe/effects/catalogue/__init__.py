"""The catalogue: every effect that is known, each declared once in a module of this package.

A new effect is a function declared by `enters` in one of these modules, or in a module of its
own: whatever is declared here is found. Other packages name theirs under the entry point
``pendpipe.effects``; one that can't be loaded is named in a line and passed over.
"""

import importlib
import pkgutil
import sys
from collections.abc import Iterator
from importlib.metadata import entry_points
from pathlib import Path
from typing import Final

from pendpipe.effects.effect import Effect, Parameter
from pendpipe.errors import InputError, nearest

ENTRY_POINT: Final = "pendpipe.effects"
_FIRST: Final = ("restoring", "losses", "in_time", "reading")
"""The order of the manual: dynamics, then measurement. Other modules follow by name."""


def _found() -> Iterator[Effect]:
    """Yield every effect and its variants, module by module, as they are declared."""
    names = [module.name for module in pkgutil.iter_modules(__path__)]
    for name in sorted(names, key=lambda name: (*_FIRST, name).index(name)):
        module = importlib.import_module(f"{__name__}.{name}")
        for effect in vars(module).values():
            # Variants of one entry stand in a table.
            each = effect.values() if isinstance(effect, dict) else [effect]
            yield from (one for one in each if isinstance(one, Effect))
    for entry in sorted(entry_points(group=ENTRY_POINT)):
        try:
            effect = entry.load()
        except Exception as fault:
            said = " ".join(str(fault).split())[:120]
            print(f"the plugin '{entry.name}' is skipped ({said})", file=sys.stderr)
        else:
            yield from [effect] if isinstance(effect, Effect) else []


_ALL: Final = tuple(_found())
# A variant of an entry, which only the diagnosis uses, has a key of its own.
CATALOGUE: Final = tuple(effect for effect in _ALL if effect.key == effect.identifier)
"""In the order of the manual: dynamics, then measurement."""

_BY_IDENTIFIER: Final = {effect.identifier: effect for effect in CATALOGUE}


def declared(identifier: str) -> dict[str, Parameter]:
    """Return the parameters of an entry and of its variants, by name; none of what is no entry."""
    entries = (effect for effect in _ALL if effect.identifier == identifier)
    return {each.name: each for effect in entries for each in effect.parameters}


def by_identifier(name: str, place: str | Path = "effect") -> Effect:
    """Return the effect of an identifier.

    Parameters
    ----------
    name
        Its identifier.
    place
        Where the name stands, for the message.

    Raises
    ------
    InputError
        If there is none; the message gives the nearest name.
    """
    found = _BY_IDENTIFIER.get(name)
    if found is None:
        remedy = nearest(name, _BY_IDENTIFIER, "pendpipe effects --list prints all names")
        raise InputError(place, f"there is no effect '{name}'", remedy)
    return found


__all__ = ["CATALOGUE", "by_identifier", "declared"]
