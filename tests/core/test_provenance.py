"""Editing the library changes the version of what depends on it, and of nothing else."""

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


BY_NAME = "import importlib\nkind = 'text'\nx = importlib.import_module({})\n"
OWN = 'import importlib\nfound = [importlib.import_module(f"{__name__}.{n}") for n in ["text"]]\n'


@pytest.mark.parametrize(
    ("stage", "edited", "changes"),
    [
        ("", "used.py", True),
        ("", "stage.py", True),
        ("", "other.py", False),
        ("from pendpipe._version import version\n", "_version.py", False),
        ("from pendpipe.readers import draw\n", "readers/templates/page.html", True),
        # Which reader a file needs is known only at run time: each of them counts.
        (BY_NAME.format('"pendpipe.readers.text"'), "readers/text.py", True),
        (BY_NAME.format('f"pendpipe.readers.{kind}"'), "readers/text.py", True),
        # A package that imports its own modules.
        ("from pendpipe import readers\n", "readers/text.py", True),
    ],
)
def test_the_version_follows_what_is_imported(
    library: Path, stage: str, edited: str, changes: bool
) -> None:
    (library / "readers/templates").mkdir(parents=True)
    (library / "readers/__init__.py").write_text(OWN if "import readers" in stage else "draw = 1\n")
    (library / "readers/text.py").write_text("x = 1\n")
    (library / "readers/templates/page.html").write_text("before")
    if stage:
        (library / "stage.py").write_text(stage)
    before = version()
    (library / edited).write_text("x = y = 2\n")
    assert (version() != before) == changes


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
