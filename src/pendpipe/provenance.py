"""Which code made a result: so that editing the library reruns what depends on it."""

import hashlib
import re
from functools import cache
from pathlib import Path
from typing import Final

PACKAGE: Final = Path(__file__).parent


def code_version(module: str) -> str:
    """Hash the source of a module and of everything of ours that it imports.

    Imports inside functions count too, and those by a name known only at run time. The hash
    is a parameter of the rule that calls the module, so Snakemake reruns the rule when, and
    only when, its code has changed.

    Parameters
    ----------
    module
        Dotted name, ``"pendpipe.commands.fit"``.

    Returns
    -------
    str
        Twelve hexadecimal digits.
    """
    digest = hashlib.sha256()
    for path in (path for name in sorted(imported(module)) for path in _files(name)):
        digest.update(path.read_bytes())
    return digest.hexdigest()[:12]


def imported(module: str) -> set[str]:
    """A module of ours and all that it imports."""
    seen, waiting = set[str](), [module]
    while waiting:
        name = waiting.pop()
        if name not in seen and _files(name):
            seen.add(name)
            waiting.extend(_imports(name))
    return seen


@cache
def _files(module: str) -> tuple[Path, ...]:
    """The source of one of our modules, with a package's templates; nothing for others'."""
    package, *parts = module.split(".")
    path = PACKAGE.joinpath(*parts)
    candidates = (path.with_suffix(".py"), path / "__init__.py")
    # The version counts commits: another one is no other code.
    ours = parts and package == PACKAGE.name and parts != ["_version"]
    source = [each for each in candidates if ours and each.is_file()][:1]
    templates = path.glob("templates/*") if source == [path / "__init__.py"] else ()
    return (*source, *sorted(file for file in templates if file.is_file()))


_IMPORT: Final = re.compile(r"^ *(?:from (pendpipe[\w.]*) )?import (\([^)]*\)|.*)", re.MULTILINE)
_BY_NAME: Final = re.compile(r'importlib\.import_module[(,]\s*(?:f?"([\w.]+)(\{?))?')
"""With a name known only at run time: each module of that package counts."""


@cache
def _imports(module: str) -> frozenset[str]:
    """The modules of ours that a module names in its import statements.

    A package that imports its own modules by name writes ``f"{__name__}.{name}"``.
    """
    text = _files(module)[0].read_text(encoding="utf-8").replace("{__name__}", module)
    found: set[str] = set()
    for origin, names in _IMPORT.findall(text):
        listed = re.findall(r"[\w.]+", names)
        found.update((origin, *(f"{origin}.{name}" for name in listed)) if origin else listed)
    for start, unknown in _BY_NAME.findall(text):
        if not start:
            raise ValueError(f"{module} imports what has no name to follow")
        package = start.rpartition(".")[0]
        modules = PACKAGE.joinpath(*package.split(".")[1:]).glob("*.py")
        found |= {f"{package}.{path.stem}" for path in modules} if unknown else {start}
    # A package's own __init__ runs before its modules do.
    parents = {name.rpartition(".")[0] for name in found}
    return frozenset(name for name in found | parents if name.startswith(PACKAGE.name))
