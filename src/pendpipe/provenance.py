"""Which code made a result: so that editing the library reruns what depends on it."""

import ast
import hashlib
from collections.abc import Iterator
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
    seen: set[str] = set()
    waiting = [module]
    while waiting:
        name = waiting.pop()
        if name in seen or _file(name) is None:
            continue
        seen.add(name)
        waiting.extend(_imports(name))
    digest = hashlib.sha256()
    for name in sorted(seen):
        digest.update(_content(name))
        for data in _data_of(name):
            digest.update(data.read_bytes())
    return digest.hexdigest()[:12]


@cache
def _data_of(module: str) -> tuple[Path, ...]:
    """The data files (templates) beside a package's ``__init__``, in a folder of their own."""
    path = _file(module)
    assert path is not None
    if path.name != "__init__.py":
        return ()
    return tuple(sorted(file for file in path.parent.glob("templates/*") if file.is_file()))


@cache
def _file(module: str) -> Path | None:
    """The source file of one of our modules."""
    parts = module.split(".")
    if parts[0] != PACKAGE.name:
        return None
    path = PACKAGE.joinpath(*parts[1:])
    for candidate in (path.with_suffix(".py"), path / "__init__.py"):
        if len(parts) > 1 and candidate.is_file():
            return candidate
    return None


@cache
def _content(module: str) -> bytes:
    path = _file(module)
    assert path is not None
    return path.read_bytes()


@cache
def _imports(module: str) -> frozenset[str]:
    """The modules of ours that a module names in its import statements."""
    found: set[str] = set()
    content = _content(module)
    tree = ast.parse(content)
    for statement in _statements(tree.body):
        if isinstance(statement, ast.Import):
            found.update(alias.name for alias in statement.names)
        elif isinstance(statement, ast.ImportFrom) and statement.module and not statement.level:
            found.add(statement.module)
            found.update(f"{statement.module}.{alias.name}" for alias in statement.names)
    if b"import_module" in content:
        for node in ast.walk(tree):
            if isinstance(node, ast.Call):
                found.update(_imported_by_name(node, module))
    # A package's own __init__ runs before its modules do.
    parents = {name.rpartition(".")[0] for name in found}
    return frozenset(name for name in found | parents if name.startswith(PACKAGE.name))


def _statements(body: list[ast.stmt]) -> Iterator[ast.stmt]:
    """All statements, however deep; an import is none of an expression's many parts."""
    for statement in body:
        yield statement
        for part in ("body", "orelse", "finalbody"):
            yield from _statements(getattr(statement, part, []))
        for part in ("handlers", "cases"):
            for block in getattr(statement, part, []):
                yield from _statements(block.body)


def _imported_by_name(call: ast.Call, module: str) -> set[str]:
    """What ``importlib.import_module(f"pendpipe.commands.{name}")`` may import: each of them.

    A package that imports its own modules writes ``f"{__name__}.{name}"``.
    """
    if ast.unparse(call.func) != "importlib.import_module":
        return set()
    match call.args[0]:
        case ast.Constant(value=str(name)):
            return {name}
        case ast.JoinedStr(values=[ast.Constant(value=str(start)), *_]):
            return _modules_of(start.rpartition(".")[0])
        case ast.JoinedStr(values=[ast.FormattedValue(value=ast.Name(id="__name__")), *_]):
            return _modules_of(module)
    raise ValueError(f"no name to follow in {ast.unparse(call)}")


def _modules_of(package: str) -> set[str]:
    folder = PACKAGE.joinpath(*package.split(".")[1:])
    return {f"{package}.{path.stem}" for path in folder.glob("*.py")}
