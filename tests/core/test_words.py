"""The project speaks the field's English: no retired word comes back."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
GLOSSARY = ROOT / "docs" / "glossary.md"


def retired() -> list[str]:
    """Read the words that the glossary retires."""
    table = GLOSSARY.read_text(encoding="utf-8").partition("| retired |")[2]
    rows = [line.split("|")[1] for line in table.splitlines()[2:] if line.startswith("|")]
    return [word.strip() for row in rows for word in row.split(",")]


def pages() -> list[Path]:
    """List what users and contributors read; the challenge keeps the labels of its sealed sets."""
    suffixes = {".py", ".md", ".smk", ".html", ".j2", ".yaml", ".toml", ".tsv"}
    folders = ["src", "docs", "config", "workflow", "examples", "benchmarks"]
    found = [path for name in folders for path in (ROOT / name).rglob("*")]
    return [
        path
        for path in [*found, ROOT / "README.md", ROOT / "CONTRIBUTING.md"]
        if path.suffix in suffixes
        and path.is_file()
        and path != GLOSSARY
        and "_build" not in path.parts
    ]


@pytest.mark.parametrize("word", retired())
def test_a_retired_word_stays_retired(word: str) -> None:
    pattern = re.compile(rf"(?<![a-z]){re.escape(word)}(?![a-z])", re.IGNORECASE)
    found = [
        f"{path.relative_to(ROOT)}:{number}"
        for path in pages()
        for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1)
        if pattern.search(line)
    ]
    assert not found


def test_the_glossary_retires_words() -> None:
    assert len(retired()) > 10
