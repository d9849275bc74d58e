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
    seen, waiting = set[str](), [module]
    while waiting:
        name = waiting.pop()
        if name not in seen and _files(name):
            seen.add(name)
            waiting.extend(_imports(name))
    digest = hashlib.sha256()
    for path in (path for name in sorted(seen) for path in _files(name)):
        digest.update(path.read_bytes())
    return digest.hexdigest()[:12]


@cache
def _files(module: str) -> tuple[Path, ...]:
    """The source of one of our modules, with a package's templates; nothing for others'."""
    package, *parts = module.split(".")
    path = PACKAGE.joinpath(*parts)
    candidates = (path.with_suffix(".py"), path / "__init__.py")
    ours = parts and package == PACKAGE.name
    source = [each for each in candidates if ours and each.is_file()][:1]
    templates = path.glob("templates/*") if source == [path / "__init__.py"] else ()
    return (*source, *sorted(file for file in templates if file.is_file()))


@cache
def _imports(module: str) -> frozenset[str]:
    """The modules of ours that a module names in its import statements."""
    found: set[str] = set()
    content = _files(module)[0].read_bytes()
    tree = ast.parse(content)
    for statement in _statements(tree.body):
        if isinstance(statement, ast.Import):
            found.update(alias.name for alias in statement.names)
        elif isinstance(statement, ast.ImportFrom) and statement.module and not statement.level:
            names = (f"{statement.module}.{alias.name}" for alias in statement.names)
            found.update((statement.module, *names))
    calls = ast.walk(tree) if b"import_module" in content else ()
    for call in (node for node in calls if isinstance(node, ast.Call)):
        found.update(_imported_by_name(call, module))
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
            yield from _statements([s for b in getattr(statement, part, []) for s in b.body])


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
