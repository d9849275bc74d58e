"""The pages themselves: everything prepared, handed to the templates."""

from __future__ import annotations

import base64
import hashlib
import io
import json
import re
from collections import Counter
from collections.abc import Mapping
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from markupsafe import Markup

from pendpipe.analysis.fit.printed import cause, facts, heading, sentence, size
from pendpipe.analysis.fit.result import FitResult
from pendpipe.figures.data import error, number, used
from pendpipe.files import read_json, without_folders
from pendpipe.quantities import compact, with_error
from pendpipe.recording import Recording
from pendpipe.report.captions import (
    CAPTIONS,
    GLOSSARY,
    OF_A_RECORDING,
    PROOF_CAPTIONS,
    Caption,
)
from pendpipe.report.tables import (
    CHI2_RANGE,
    STATES,
    Health,
    findings,
    grouped_warnings,
    headline,
    table_of_records,
)
from pendpipe.templates import render as fill_template

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from pendpipe.diagnosis.run import Outcome

TEMPLATES: Final = Path(__file__).parent / "templates"
BUDGET_BYTES: Final = 5_000_000
"""The page stays below this up to 700 records; what no longer fits is named, left in its file."""
_RESERVE_BYTES: Final = 350_000
_RECORD_BYTES: Final = 6_000
"""What a record takes beside its figures: its row, its section, its share of the downloads."""

TOGETHER: Final = "campaign_diagnosis.json"

Content = Mapping[str, Any]


_DROPPED = re.compile(
    r"<\?xml.*?\?>|<!DOCTYPE.*?>|<!--.*?-->|<metadata>.*?</metadata>"
    r"|<style type=\"text/css\">.*?</style>",
    re.DOTALL,
)
_NAME = re.compile(r'(\bid="|url\(#|href="#)([^")]+)')
_COORDINATES = re.compile(r'( (?:d|x|y)=")([^"]*)')
_DIGITS = re.compile(r"(\d+\.\d{2})\d+")


def inline_svg(text: str, prefix: str, title: str, description: str) -> Markup:
    """Return the SVG element of a file for use inside HTML.

    Parameters
    ----------
    text
        The file's content, as matplotlib writes it.
    prefix
        Set before every identifier, so that several figures in one page do not clash.
    title, description
        What a screen reader reads out: the name, and what the figure shows.
    """
    body = _DROPPED.sub("", text)
    start = body.index("<svg")
    head, _, rest = body[start:].partition(">")
    box = re.search(r'viewBox="([^"]+)"', head)
    rest = rest.replace("xlink:href", "href")
    rest = _NAME.sub(lambda found: f"{found.group(1)}{prefix}-{found.group(2)}", rest)
    # A hundredth of a point is finer than any screen or printer.
    rest = _COORDINATES.sub(lambda found: found.group(1) + _DIGITS.sub(r"\1", found.group(2)), rest)
    name, words = f"{prefix}-title", f"{prefix}-description"
    opening = (
        f'<svg class="figure" role="img" viewBox="{escape(box.group(1) if box else "")}"'
        f' aria-labelledby="{name} {words}">'
        f'<title id="{name}">{escape(title)}</title><desc id="{words}">{escape(description)}</desc>'
    )
    return Markup(opening + rest.strip())


class Room:
    """The bytes that a page has left for figures."""

    def __init__(self, left: int) -> None:
        self.left = left

    def drawing(self, path: Path, prefix: str, title: str, description: str) -> Markup | None:
        """Return a drawn SVG as `inline_svg` does; None where there is none, or no room for it."""
        if not path.is_file():
            return None
        svg = inline_svg(path.read_text(encoding="utf-8"), prefix, title, description)
        self.left -= len(svg.encode())
        return svg if self.left > 0 else None


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
    columns, lines = table_of_records(entries, has_theory=has_theory)
    room = Room(BUDGET_BYTES)
    drawn = {
        name: svg
        for name, words in CAPTIONS.items()
        if (svg := room.drawing(figures / f"{name}.svg", name, words.title, words.shows))
    }
    room.left -= _RESERVE_BYTES + _RECORD_BYTES * len(entries)
    decays, outside = _decays(folder, lines, room)
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
        columns=columns,
        diagnosed=diagnoses(folder, names, room),
        together=read_json(folder / TOGETHER) if (folder / TOGETHER).is_file() else None,
        asked=asked,
        proof=proven,
        records=lines,
        counts=Counter(line["health"][:3] for line in lines),
        chi2_range=CHI2_RANGE,
        states=STATES,
        comparison=comparison,
        fitted=used(comparison),
        decays=decays,
        outside=outside,
        glossary=GLOSSARY,
        number=number,
        error=error,
        with_error=with_error,
        compact=compact,
        without_folders=without_folders,
        provenance=comparison.get("provenance") or {},
        numbers=base64.b64encode(json.dumps(summary, indent=1).encode()).decode(),
        **own_files(),
        findings=findings(comparison),
        warned=grouped_warnings(entries),
    )


def own_files() -> dict[str, str]:
    """The package's own style and script; the policy names the script by its hash."""
    script = (TEMPLATES / "script.js").read_text(encoding="utf-8").strip()
    return {
        "style": Markup((TEMPLATES / "style.css").read_text(encoding="utf-8").strip()),
        "script": Markup(script),
        "script_hash": base64.b64encode(hashlib.sha256(script.encode()).digest()).decode(),
    }


def page_files(comparison: Content, folder: Path, figures: Path) -> list[Path]:
    """The results beside the comparison that a page is made of, where they are there."""
    files = [folder / TOGETHER, *(figures / f"{name}.svg" for name in CAPTIONS)]
    files += [
        folder / str(entry["record"]) / name
        for entry in comparison["records"]
        for name in (
            "figures/decay.svg",
            "diagnosis/diagnosis.json",
            "diagnosis/residual_map.svg",
        )
    ]
    return [path for path in files if path.is_file()]


def _decays(
    folder: Path, lines: list[dict[str, Any]], room: Room
) -> tuple[dict[str, Markup], list[str]]:
    """Each record's decay figure while there is room, and the records beyond it."""
    drawn = {
        # The prefix is a number: a record's name need not be an identifier.
        name: room.drawing(
            path, line["anchor"], f"Decay of {name}", f"{CAPTIONS['decay'].shows} Record {name}."
        )
        for line in lines
        if not line["refused"]
        and (path := folder / (name := line["name"]) / "figures" / "decay.svg").is_file()
    }
    decays = {name: svg for name, svg in drawn.items() if svg is not None}
    return decays, [name for name in drawn if name not in decays]


VERDICTS: Final = {
    "consistent": Health("consistent", "✔", "good", "the noise explains what the model leaves"),
    "missing-physics": Health("missing physics", "▲", "look", "something was left out"),
    "not-analysable": Health("not analysable", "○", "none", "there is no diagnosis"),
}
"""How each verdict is shown."""


def diagnoses(folder: Path, names: list[str], room: Room) -> list[dict[str, Any]]:
    """Read every record's diagnosis; none where the campaign was not diagnosed.

    Parameters
    ----------
    folder
        The campaign's results.
    names
        Of the records.
    room
        What the page has left for figures.
    """
    found = []
    for index, name in enumerate(names, start=1):
        place, anchor = folder / name / "diagnosis", f"diagnosis-{index}"
        if not (place / "diagnosis.json").is_file():
            continue
        content = read_json(place / "diagnosis.json")
        # What is presumed is fitted, and no finding.
        content["effects"] = [each for each in content["effects"] if not each.get("presumed")]
        figure = None
        if content["verdict"] == "missing-physics":
            words = f"{CAPTIONS['residual_map'].shows} Record {name}."
            title = f"Residual of {name} before and after"
            figure = room.drawing(place / "residual_map.svg", anchor, title, words)
        found.append(
            {
                "name": name,
                "anchor": anchor,
                "light": VERDICTS[content["verdict"]],
                "statement": without_folders(str(content["statement"])),
                "figure": figure,
                "content": content,
            }
        )
    return found


KEPT: Final = {
    True: Health("kept", "✔", "good", "what was promised came out"),
    False: Health("not kept", "▲", "look", "less came out than was promised"),
    None: Health("not judged", "○", "none", "too few items to judge"),
}
"""How each promise is shown."""


def proof(folder: Path | None, room: Room) -> dict[str, Any] | None:
    """Read a set's scores and figures; None where there is no scored set.

    Parameters
    ----------
    folder
        Where ``pendpipe challenge score`` has put ``scores.json`` and ``figures/``.
    room
        What the page has left for figures.
    """
    if folder is None or not (folder / "scores.json").is_file():
        return None
    scores = read_json(folder / "scores.json")
    promises = [(row["promise"], row["measured"], KEPT[row["kept"]]) for row in scores["promises"]]

    def drawn(name: str, title: str, shows: str) -> Markup | None:
        return room.drawing(folder / "figures" / f"{name}.svg", f"proof-{name}", title, shows)

    figures = [
        {"svg": svg, "caption": caption}
        for name, caption in PROOF_CAPTIONS.items()
        if (svg := drawn(name, caption.title, caption.shows)) is not None
    ]
    words = CAPTIONS["residual_map"]
    return {
        "scores": scores,
        "promises": promises,
        "figures": figures,
        "cases": [
            drawn(
                str(row["figure"]).removesuffix(".svg"),
                f"{words.title}: {row['item']}",
                words.shows,
            )
            if row.get("figure") and row["same_answer"]
            else None
            for row in scores["six_cases"]
        ],
    }


LIGHTS = {"green": ("good", "✓"), "amber": ("look", "!"), "red": ("bad", "✗")}
"""Colour class and symbol of a light: colour never carries a meaning alone."""


def render_recording(
    name: str,
    recording: Recording,
    result: FitResult,
    outcome: Outcome | None = None,
) -> str:
    """Make the page of one recording: a sheet to print, and the rest below a fold.

    Parameters
    ----------
    name
        What to call the recording: the name of its file.
    recording
        The whole of it, with its notes.
    result
        The fit, with its readings.
    outcome
        The diagnosis; None where none was asked for.

    Returns
    -------
    str
        One HTML document that refers to nothing outside itself.
    """
    from pendpipe.figures.decays import Decay, draw_residual, draw_sheet

    assert result.points is not None
    decay = Decay(name, result.points, result)
    drawings: list[tuple[str, Figure]] = [("residual", draw_residual(decay))]
    if outcome is not None:
        from pendpipe.figures.diagnosis import draw_each

        drawings += list(draw_each(outcome))
    figures = [
        {
            "svg": _inlined(figure, f"figure-{key}", OF_A_RECORDING[key]),
            "caption": OF_A_RECORDING[key],
        }
        for key, figure in drawings
    ]
    unit = result["amplitude"].unit
    return fill_template(
        "pendpipe.report",
        "recording.html",
        name_of_recording=name,
        style=own_files()["style"],
        light=(result.light, *LIGHTS[result.light]),
        reason=result.light_reason,
        heading=heading(result, name).partition(": ")[2],
        advice=sentence(result),
        facts=list(facts(result)),
        table=[
            (
                size(each.amplitude_rad, unit),
                with_error(each.quality_factor.value, each.quality_factor.sd),
                f"{each.period_s:.5g} s",
                cause(each),
            )
            for each in result.quality_factors
        ],
        sheet=_inlined(draw_sheet(decay, recording), "sheet", _SHEET),
        diagnosis=None if outcome is None else outcome.diagnosis.summary,
        details="" if outcome is None else outcome.diagnosis.details,
        numbers=[(title, str(each)) for title, each in result.numbers().items()],
        figures=figures,
        cuts=result.cuts,
        guesses=(*recording.weak_guesses, *recording.notes),
        warnings=result.warnings,
        provenance=result.provenance,
    )


_SHEET: Final = Caption(
    "The decay, and its quality factor",
    "Readings and fitted amplitude against time, what was left out shaded; Q against amplitude.",
    "The line is the fitted law; the circles are the turning points alone and need no law.",
)


def _inlined(figure: Figure, prefix: str, caption: Caption) -> Markup:
    drawn = io.StringIO()
    figure.savefig(drawn, format="svg", metadata={"Date": None, "Creator": "pendpipe"})
    return inline_svg(drawn.getvalue(), prefix, caption.title, caption.shows)
