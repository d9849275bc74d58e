"""Editing the library changes the version of what depends on it, and of nothing else."""

from __future__ import annotations

from pathlib import Path

import pytest

from pendpipe import provenance


@pytest.fixture
def library(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A library of three modules: `stage` uses `used`, inside a function; `other` stands alone."""
    package = tmp_path / "pendpipe"
    package.mkdir()
    (package / "__init__.py").write_text("")
    (package / "stage.py").write_text("def run():\n    from pendpipe.used import x\n    return x\n")
    (package / "used.py").write_text("x = 1\n")
    (package / "other.py").write_text("y = 1\n")
    monkeypatch.setattr(provenance, "PACKAGE", package)
    return package


def version() -> str:
    for kept in (provenance._imports, provenance._files):
        kept.cache_clear()
    return provenance.code_version("pendpipe.stage")


@pytest.mark.parametrize(("edited", "changes"), [("used", True), ("stage", True), ("other", False)])
def test_the_version_follows_the_imports(library: Path, edited: str, changes: bool) -> None:
    before = version()
    (library / f"{edited}.py").write_text("x = y = 2\n")
    assert (version() != before) == changes


def test_a_template_counts_as_code_of_its_package(library: Path) -> None:
    (library / "stage.py").write_text("from pendpipe.page import draw\n")
    (library / "page/templates").mkdir(parents=True)
    (library / "page/__init__.py").write_text("draw = 1\n")
    template = library / "page/templates/page.html"
    template.write_text("before")
    before = version()
    template.write_text("after")
    assert version() != before


@pytest.mark.parametrize("name", ['"pendpipe.readers.text"', 'f"pendpipe.readers.{kind}"'])
def test_a_module_imported_by_name_counts(library: Path, name: str) -> None:
    """Which reader a file needs is known only at run time: each of them counts."""
    (library / "stage.py").write_text(
        f"import importlib\nkind = 'text'\nreader = importlib.import_module({name})\n"
    )
    (library / "readers").mkdir()
    (library / "readers/__init__.py").write_text("")
    reader = library / "readers/text.py"
    reader.write_text("x = 1\n")
    before = version()
    reader.write_text("x = 2\n")
    assert version() != before


def test_a_package_that_imports_its_own_modules_depends_on_each(library: Path) -> None:
    (library / "stage.py").write_text("from pendpipe import catalogue\n")
    (library / "catalogue").mkdir()
    (library / "catalogue/__init__.py").write_text(
        'import importlib\nfound = [importlib.import_module(f"{__name__}.{n}") for n in "ab"]\n'
    )
    entry = library / "catalogue/a.py"
    entry.write_text("x = 1\n")
    before = version()
    entry.write_text("x = 2\n")
    assert version() != before


def test_the_readers_of_files_count() -> None:
    """They are imported by name, each when a file needs it."""
    dialects = "pendpipe.formats.dialects"
    assert dialects in provenance._imports("pendpipe.formats.reading")
    assert {f"{dialects}.windaq", f"{dialects}.octave"} <= provenance._imports(dialects)
    assert "pendpipe.formats.trees" in provenance._imports(f"{dialects}.arrays")


def test_the_versions_of_all_commands_can_be_found() -> None:
    """An import that can't be followed would keep the workflow from starting."""
    for path in (provenance.PACKAGE / "commands").glob("*.py"):
        assert len(provenance.code_version(f"pendpipe.commands.{path.stem}")) == 12
