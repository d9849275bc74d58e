"""The proof may not be the program agreeing with itself."""

from __future__ import annotations

import ast
from pathlib import Path

import pendpipe_challenge

FORBIDDEN = ("dynamics", "effects", "diagnose", "simulation", "analysis", "physics")


def test_the_challenge_imports_nothing_that_it_judges() -> None:
    folder = Path(pendpipe_challenge.__file__).parent
    files = list(folder.rglob("*.py"))
    assert len(files) > 15
    for path in files:
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            names = []
            if isinstance(node, ast.ImportFrom):
                names = [node.module or ""]
            elif isinstance(node, ast.Import):
                names = [alias.name for alias in node.names]
            for name in names:
                parts = name.split(".")
                assert not (parts[0] == "pendpipe" and set(parts[1:2]) & set(FORBIDDEN)), path
