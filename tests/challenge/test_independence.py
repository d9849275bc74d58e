"""The proof may not be the program agreeing with itself."""

import ast
from collections.abc import Iterator
from pathlib import Path

import pendpipe_challenge

PERMITTED = {"arrays", "errors", "files", "process", "version", "__file__"}
"""Of the library: what says nothing about pendulums."""


def parts_of_the_library(tree: ast.Module) -> Iterator[str]:
    """The modules and names of `pendpipe` that a file of the challenge uses."""
    for node in ast.walk(tree):
        names = []
        if isinstance(node, ast.ImportFrom):
            names = [f"{node.module}.{alias.name}" for alias in node.names]
        elif isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.Attribute):
            names = [ast.unparse(node)]
        yield from (name.split(".")[1] for name in names if name.startswith("pendpipe."))


def test_the_challenge_imports_nothing_that_it_judges() -> None:
    files = list(Path(pendpipe_challenge.__file__).parent.rglob("*.py"))
    used = {
        part
        for path in files
        for part in parts_of_the_library(ast.parse(path.read_text(encoding="utf-8")))
    }
    assert "arrays" in used
    assert used <= PERMITTED
