"""Device and driver share no code, so that no error can be made on both sides alike."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

import pendpipe.acquisition

ROOT = Path(pendpipe.acquisition.__file__).parent
NEUTRAL = {"pendpipe.acquisition.clock", "pendpipe.arrays", "pendpipe.errors"}
"""Time, array types and the user's faults: nothing of these knows a byte of a protocol."""


def imports(module: Path) -> set[str]:
    """Every module named in an import of the file, at any depth."""
    found: set[str] = set()
    for node in ast.walk(ast.parse(module.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found |= {name.name for name in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0
            found.add(node.module or "")
    return found


def modules(package: str) -> list[Path]:
    found = sorted((ROOT / package).glob("**/*.py"))
    assert found
    return found


@pytest.mark.parametrize("module", modules("devices"), ids=lambda path: path.stem)
def test_devices_know_nothing_of_the_reading_side(module: Path) -> None:
    ours = {name for name in imports(module) if name.startswith("pendpipe")}
    assert {n for n in ours if not n.startswith("pendpipe.acquisition.devices")} <= NEUTRAL


@pytest.mark.parametrize("module", modules("drivers"), ids=lambda path: path.stem)
def test_drivers_know_nothing_of_the_devices(module: Path) -> None:
    ours = {name for name in imports(module) if name.startswith("pendpipe")}
    allowed = NEUTRAL | {"pendpipe.acquisition.line"}
    assert {n for n in ours if not n.startswith("pendpipe.acquisition.drivers")} <= allowed


def test_what_both_may_use_knows_neither() -> None:
    for name in ("clock.py", "line.py"):
        assert not any("drivers" in n or "devices" in n for n in imports(ROOT / name))
