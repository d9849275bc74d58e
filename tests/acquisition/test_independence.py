"""Device and driver share no code, so that no error can be made on both sides alike."""

import ast
from pathlib import Path

import pytest

import pendpipe.acquisition

ROOT = Path(pendpipe.acquisition.__file__).parent
NEUTRAL = {"pendpipe.acquisition.clock", "pendpipe.acquisition.models"}
LINE = "pendpipe.acquisition.line"
"""Time, the figures of a box, and the line: none knows a byte of a protocol."""


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


@pytest.mark.parametrize(
    ("side", "allowed"), [("devices", NEUTRAL), ("drivers", NEUTRAL | {LINE}), (".", None)]
)
def test_devices_and_drivers_know_nothing_of_each_other(
    side: str, allowed: set[str] | None
) -> None:
    """Nor does what both may use know either."""
    names = ["clock.py", "line.py", "models.py"] if allowed is None else ["*.py"]
    found = [path for name in names for path in (ROOT / side).glob(name)]
    assert found
    ours = {name for path in found for name in imports(path) if name.startswith("pendpipe.acq")}
    own = f"pendpipe.acquisition.{side}"
    assert {name for name in ours if not name.startswith(own)} <= (allowed or NEUTRAL)
