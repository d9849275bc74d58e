"""The page itself: everything prepared, handed to the template."""

from __future__ import annotations

import base64
import csv
import hashlib
import io
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

from markupsafe import Markup

from pendpipe.analysis.fit.result import read_fit
from pendpipe.report import remarks
from pendpipe.report.captions import CAPTIONS, GLOSSARY
from pendpipe.report.diagnoses import diagnoses
from pendpipe.report.headline import headline
from pendpipe.report.health import CHI2_RANGE
from pendpipe.report.proof import proof
from pendpipe.report.records import Line, Table, table_of_records
from pendpipe.report.vector import Room
from pendpipe.templates import render as fill_template

TEMPLATES: Final = Path(__file__).parent / "templates"
BUDGET_BYTES: Final = 5_000_000
"""The page stays below this up to 700 records; what no longer fits is named, left in its file."""
_RESERVE_BYTES: Final = 350_000
_RECORD_BYTES: Final = 6_000
"""What a record takes beside its figures: its row, its section, its share of the downloads."""

Content = Mapping[str, Any]


def render(
    configuration: Content,
    comparison: Content,
    summary: Content,
    folder: Path,
    figures: Path,
    challenge: Path | None = None,
) -> str:
    """Make the page.

    Parameters
    ----------
    configuration, comparison, summary
        The campaign's configuration, comparison.json and campaign.json.
    folder
        The campaign's results, with a folder for each record.
    figures
        Where figures 3 to 10 are.
    challenge
        Scores of a challenge, if there is one.

    Returns
    -------
    str
        One HTML document that refers to nothing outside itself.
    """
    entries = list(comparison["records"])
    has_theory = bool(comparison.get("has_theory"))
    table = table_of_records(entries, _hashes(folder, entries), has_theory=has_theory)
    room = Room(BUDGET_BYTES)
    drawn = {
        name: svg
        for name, words in CAPTIONS.items()
        if (svg := room.drawing(figures / f"{name}.svg", name, words.title, words.shows))
    }
    room.left -= _RESERVE_BYTES + _RECORD_BYTES * len(entries)
    decays, outside = _decays(folder, table.lines, room)
    proven = proof(challenge, room)
    asked = configuration.get("diagnose") or {}
    names = [str(entry["record"]) for entry in entries if asked.get("enabled", True)]
    return fill_template(
        "pendpipe.report",
        "page.html",
        title=comparison.get("title") or "A campaign of free decays",
        has_theory=has_theory,
        simulated=sum(entry.get("source") == "simulated" for entry in entries),
        rows=headline(comparison, configuration.get("simulated") or {}),
        figures=drawn,
        captions=CAPTIONS,
        table=table,
        diagnosed=diagnoses(folder, names, room),
        asked=asked,
        proof=proven,
        records=table.lines,
        counts=_counts(table.lines),
        chi2_range=CHI2_RANGE,
        decays=decays,
        outside=outside,
        glossary=GLOSSARY,
        provenance=comparison.get("provenance") or {},
        downloads=_downloads(table, summary),
        **_own_files(),
        **remarks.of_campaign(comparison, list(drawn), folder),
    )


def _own_files() -> dict[str, str]:
    """The package's own style and script; the policy names the script by its hash."""
    script = (TEMPLATES / "script.js").read_text(encoding="utf-8").strip()
    return {
        "style": Markup((TEMPLATES / "style.css").read_text(encoding="utf-8").strip()),
        "script": Markup(script),
        "script_hash": base64.b64encode(hashlib.sha256(script.encode()).digest()).decode(),
    }


def page_files(comparison: Content, folder: Path, figures: Path) -> list[Path]:
    """The results beside the comparison that a page is made of, where they are there."""
    files = [figures / f"{name}.svg" for name in CAPTIONS]
    files += [
        folder / str(entry["record"]) / name
        for entry in comparison["records"]
        for name in (
            "fit.json",
            "figures/decay.svg",
            "diagnosis/diagnosis.json",
            "diagnosis/residual_map.svg",
        )
    ]
    return [path for path in files if path.is_file()]


def _decays(folder: Path, table: list[Line], room: Room) -> tuple[dict[str, Markup], list[str]]:
    """Each record's decay figure while there is room, and the records beyond it."""
    decays: dict[str, Markup] = {}
    outside: list[str] = []
    for line in table:
        path = folder / line.name / "figures" / "decay.svg"
        if line.refused or not path.is_file():
            continue
        # The prefix is a number: a record's name need not be an identifier.
        words = f"{CAPTIONS['decay'].shows} Record {line.name}."
        svg = room.drawing(path, line.anchor, f"Decay of {line.name}", words)
        if svg is None:
            outside.append(line.name)
        else:
            decays[line.name] = svg
    return decays, outside


def _hashes(folder: Path, entries: list[Content]) -> dict[str, str]:
    """SHA-256 of each record's input, from its fit."""
    return {
        str(entry["record"]): str(read_fit(path).provenance.get("input_sha256", ""))
        for entry in entries
        if not entry.get("refused")
        and (path := folder / str(entry["record"]) / "fit.json").is_file()
    }


def _counts(table: list[Line]) -> list[tuple[str, str, str, int]]:
    """How many records stand in each state that occurs: word, symbol, colour, number."""
    found = [(line.health.word, line.health.symbol, line.health.colour) for line in table]
    return [(*state, found.count(state)) for state in dict.fromkeys(found)]


def _downloads(table: Table, summary: Content) -> dict[str, str]:
    """Files inside the page, as data addresses: they can be saved without a script."""
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    names = [f"{c.head} ({c.unit})" if c.unit else c.head for c in table.columns]
    pairs = [name for head in names for name in (head, f"sd of {head}")]
    writer.writerow(["record", "fit", "fluid", "branch", *pairs])
    for line in table.lines:
        numbers = [text for cell in line.cells for text in (cell.value, cell.sd)]
        words = [line.name, line.health.word, line.fluid, line.branch]
        writer.writerow([*map(_no_formula, words), *numbers])
    return {
        "records.csv": _data_address("text/csv", stream.getvalue()),
        "campaign.json": _data_address("application/json", json.dumps(summary, indent=1)),
    }


def _no_formula(text: str) -> str:
    """A word that a spreadsheet would take for a formula, with the apostrophe that stops it."""
    return f"'{text}" if text.startswith(("=", "+", "-", "@", "\t", "\r")) else text


def _data_address(kind: str, text: str) -> str:
    return f"data:{kind};base64,{base64.b64encode(text.encode()).decode()}"
