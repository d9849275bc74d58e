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

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup

from pendpipe.analysis.fit.result import read_fit
from pendpipe.report import remarks
from pendpipe.report.captions import CAPTIONS, GLOSSARY
from pendpipe.report.diagnoses import Diagnosed, diagnoses
from pendpipe.report.headline import headline
from pendpipe.report.health import CHI2_RANGE
from pendpipe.report.proof import proof
from pendpipe.report.records import Line, Table, table_of_records
from pendpipe.report.remarks import findings
from pendpipe.report.vector import inline_svg

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
    drawn = _campaign_figures(figures)
    entries = list(comparison["records"])
    budget = BUDGET_BYTES - _RESERVE_BYTES - _RECORD_BYTES * len(entries)
    has_theory = bool(comparison.get("has_theory"))
    table = table_of_records(entries, _hashes(folder, entries), has_theory=has_theory)
    decays, outside = _decays(folder, table.lines, budget - sum(map(len, drawn.values())))
    spent = sum(map(len, [*drawn.values(), *decays.values()]))
    proven = proof(challenge, spent=spent, budget=budget)
    spent += proven.bytes if proven else 0
    asked = configuration.get("diagnose") or {}
    diagnosed = _diagnoses(asked, folder, entries, spent, budget)
    script = (TEMPLATES / "script.js").read_text(encoding="utf-8").strip()
    style = (TEMPLATES / "style.css").read_text(encoding="utf-8").strip()
    environment = Environment(
        loader=FileSystemLoader(TEMPLATES),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    return environment.get_template("page.html").render(
        title=comparison.get("title") or "A campaign of free decays",
        has_theory=has_theory,
        simulated=sum(entry.get("source") == "simulated" for entry in entries),
        rows=headline(comparison, configuration.get("simulated") or {}),
        findings=findings(comparison),
        figures=drawn,
        captions=CAPTIONS,
        columns=table.columns,
        has_fluid=any(line.fluid for line in table.lines),
        has_branch=any(line.branch for line in table.lines),
        diagnosed=diagnosed,
        diagnosis_baseline="Eq. 3" if asked.get("baseline") == "viscous" else "Eq. 8",
        diagnosis_level=asked.get("level", 0.01),
        proof=proven,
        records=table.lines,
        counts=_counts(table.lines),
        chi2_range=CHI2_RANGE,
        decays=decays,
        outside=outside,
        warned=remarks.grouped_warnings(entries),
        exponents=remarks.exponent_tables(comparison),
        budget=remarks.budget_rows(comparison),
        checks=remarks.check_rows(comparison),
        steps=remarks.steps(comparison, list(drawn), folder),
        glossary=GLOSSARY,
        provenance=comparison.get("provenance") or {},
        downloads=_downloads(table, summary),
        # These two are the package's own files; the policy names the script by its hash.
        style=Markup(style),
        script=Markup(script),
        script_hash=base64.b64encode(hashlib.sha256(script.encode()).digest()).decode(),
    )


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


def _campaign_figures(figures: Path) -> dict[str, Markup]:
    """The figures that are there, ready for the page."""
    drawn = {}
    for name, caption in CAPTIONS.items():
        path = figures / f"{name}.svg"
        if path.is_file():
            text = path.read_text(encoding="utf-8")
            drawn[name] = inline_svg(text, name, caption.title, caption.shows)
    return drawn


def _decays(folder: Path, table: list[Line], left: int) -> tuple[dict[str, Markup], list[str]]:
    """Each record's decay figure while the bytes left last, and the records beyond it."""
    decays: dict[str, Markup] = {}
    outside: list[str] = []
    for line in table:
        path = folder / line.name / "figures" / "decay.svg"
        if line.refused or not path.is_file():
            continue
        # The prefix is a number: a record's name need not be an identifier.
        words = f"{CAPTIONS['decay'].shows} Record {line.name}."
        svg = inline_svg(
            path.read_text(encoding="utf-8"), line.anchor, f"Decay of {line.name}", words
        )
        left -= len(svg.encode())
        if left < 0:
            outside.append(line.name)
        else:
            decays[line.name] = svg
    return decays, outside


def _diagnoses(
    asked: Content, folder: Path, entries: list[Content], spent: int, budget: int
) -> list[Diagnosed]:
    """The records' diagnoses, where the campaign asks for them."""
    if not asked.get("enabled", True):
        return []
    names = [str(entry["record"]) for entry in entries]
    return diagnoses(folder, names, spent=spent, budget=budget)


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
