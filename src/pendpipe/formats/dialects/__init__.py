"""Every dialect: the modules of this package, and what other packages add.

A module declares its kind of file as a `Dialect`; whatever is declared is found. Other packages
name theirs under the entry point ``pendpipe.formats``.
"""

import importlib
import pkgutil
from collections.abc import Callable, Iterator
from functools import cache, partial
from importlib.metadata import entry_points

from pendpipe.formats.plugin import Dialect

ENTRY_POINT = "pendpipe.formats"


@cache
def dialects() -> tuple[tuple[Dialect, ...], tuple[str, ...]]:
    """Find all dialects, ours first, and say in a line which can't be used."""
    loads: list[tuple[str, Callable[[], object]]] = [
        (module.name, partial(importlib.import_module, f"{__name__}.{module.name}"))
        for module in pkgutil.iter_modules(__path__)
    ]
    loads += [(entry.name, entry.load) for entry in sorted(entry_points(group=ENTRY_POINT))]
    found, notes = list[Dialect](), list[str]()
    for name, load in loads:
        try:
            found += _declared(load())
        except Exception as fault:
            notes.append(_passed_over(name, fault))
    return tuple(found), tuple(notes)


def _declared(value: object) -> Iterator[Dialect]:
    """Give the dialect that an entry point names, or those of a module."""
    values = [value] if isinstance(value, Dialect) else vars(value).values()
    yield from (each for each in values if isinstance(each, Dialect))


def of_file(head: bytes, suffix: str) -> tuple[list[Dialect], list[str]]:
    """Give the dialects that call a file their own, and a line for each that failed."""
    known, lines = dialects()
    mine, notes = list[Dialect](), list(lines)
    for dialect in known:
        try:
            if suffix in dialect.suffixes or dialect.is_mine(head):
                mine.append(dialect)
        except Exception as fault:
            notes.append(_passed_over(dialect.name, fault))
    return mine, notes


def _passed_over(name: str, fault: Exception) -> str:
    said = " ".join(str(fault).split())[:120]
    return f"the plugin '{name}' is skipped ({type(fault).__name__}: {said})"
