"""The project speaks the field's English: no retired word comes back."""

import re
from pathlib import Path

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


def test_a_retired_word_stays_retired() -> None:
    words = retired()
    assert len(words) > 10
    any_of_them = re.compile(
        # "lopsided" in quotation marks is the challenge's label; names of folders are no words.
        rf"(?<![a-z\"/`])({'|'.join(map(re.escape, words))})(?![a-z])",
        re.IGNORECASE,
    )
    found = [
        f"{path.relative_to(ROOT)}:{number}: {word}"
        for path in pages()
        for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1)
        for word in any_of_them.findall(line)
    ]
    assert not found
