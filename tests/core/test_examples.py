"""Every example in a docstring runs and prints what it says."""

import doctest
import importlib
from pathlib import Path

import pytest

import pendpipe

PACKAGE = Path(pendpipe.__file__).parent
ROOT = PACKAGE.parents[1]


def modules_with_examples() -> list[str]:
    """Name the modules whose source has an example."""
    found = [path for path in PACKAGE.rglob("*.py") if ">>> " in path.read_text(encoding="utf-8")]
    names = [path.relative_to(PACKAGE.parent).with_suffix("").parts for path in sorted(found)]
    return [".".join(parts).removesuffix(".__init__") for parts in names]


@pytest.mark.parametrize("name", modules_with_examples())
def test_examples_run(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(ROOT)
    result = doctest.testmod(importlib.import_module(name), optionflags=doctest.ELLIPSIS)
    assert result.attempted > 0
    assert result.failed == 0


@pytest.mark.parametrize("name", pendpipe.__all__)
def test_every_public_name_has_an_example(name: str) -> None:
    public = getattr(pendpipe, name)
    if callable(public):
        assert ">>> " in (public.__doc__ or ""), f"pendpipe.{name} has no example"
