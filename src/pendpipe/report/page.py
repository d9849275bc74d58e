"""The pages themselves: everything prepared, handed to the templates."""

from __future__ import annotations

import base64
import io
import json
import math
import os
import re
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from html import escape, unescape
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, Literal, NamedTuple
from urllib.parse import quote

from markupsafe import Markup

from pendpipe.analysis.fit.printed import cause, facts, heading, sentence, size
from pendpipe.analysis.fit.result import FitResult
from pendpipe.figures.data import NothingToDrawError, error, number, used
from pendpipe.files import read_json, without_folders
from pendpipe.quantities import compact, with_error
from pendpipe.recording import Recording, read_plain
from pendpipe.report import own_files
from pendpipe.report.captions import (
    CAPTIONS,
    EQUATIONS,
    GLOSSARY,
    OF_A_RECORDING,
    Caption,
)
from pendpipe.report.tables import (
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

    from pendpipe.diagnosis.result import Diagnosis
    from pendpipe.prediction import Prediction
    from pendpipe.report.charts import Chart

BUDGET_BYTES: Final = 5_000_000
"""The page stays below this at 1,000 records; what no longer fits is on a record's own page."""
MANY: Final = 100
"""Beyond this only records that were refused, failed or miss something are drawn."""
_RESERVE_BYTES: Final = 250_000
"""For what is on every page: style, script and words."""
_ROW_BYTES, _RECORD_BYTES = 2_000, 4_500
"""What a record takes beside its drawings: in the tables, and in words where it is drawn."""

TOGETHER: Final = "campaign_diagnosis.json"
OWN_PAGES: Final = "pages"
"""The folder of the records' own pages, beside the records' folders."""
OF_THE_CAMPAIGN: Final = ("records.csv", "comparison.json", TOGETHER)
OF_A_RECORD: Final = (
    *("recording.csv", "turning_points.csv", "fit.json", "diagnosis/diagnosis.json"),
    "figures/decay.svg",
)
"""Files that the page links to."""

Content = Mapping[str, Any]


_DROPPED = re.compile(
    r"<\?xml.*?\?>|<!DOCTYPE.*?>|<!--.*?-->|<metadata>.*?</metadata>"
    r"|<style type=\"text/css\">.*?</style>",
    re.DOTALL,
)
_NAME = re.compile(r'(\bid="|url\(#|href="#)([^")]+)')
_COORDINATES = re.compile(r'( (?:d|x|y)=")([^"]*)')
_TABLE = re.compile(r"<dc:subject>\s*<rdf:Bag>\s*<rdf:li>(.*?)</rdf:li>", re.DOTALL)
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


def table_inside(path: Path) -> str:
    """The data that `pendpipe.figures.style.save` has put into a drawing, as CSV."""
    found = _TABLE.search(path.read_text(encoding="utf-8"))
    return unescape(found.group(1)) if found else ""


class Room:
    """The bytes that a page has left for figures."""

    def __init__(self, left: int) -> None:
        self.left = left

    def take(self, size: int) -> bool:
        """Whether so many bytes fit; they are taken then."""
        if fits := size < self.left:
            self.left -= size
        return fits

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
    *,
    home: Path | None = None,
    own_page: Callable[[str, str], None] | None = None,
    linked: bool = True,
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
    home
        The page's file: it links to the results that lie beside or below it.
    own_page
        Is handed the name and the page of each record that is not wholly on this one.
    linked
        Whether the records' files stay where they are, for links.

    Returns
    -------
    str
        One HTML document that loads nothing from outside itself.
    """
    entries = list(comparison["records"])
    has_theory = bool(comparison.get("has_theory"))
    columns, lines = table_of_records(entries, has_theory=has_theory)
    room = Room(BUDGET_BYTES - _RESERVE_BYTES - _ROW_BYTES * len(entries))
    drawn = {
        name: svg
        for name, words in CAPTIONS.items()
        if (svg := room.drawing(figures / f"{name}.svg", name, words.title, words.shows))
    }
    asked = configuration.get("diagnose") or {}
    for line in lines:
        enabled = asked.get("enabled", True)
        line["diagnosis"] = _diagnosis(folder / line["name"]) if enabled else None
    title = comparison.get("title") or "A campaign of free decays"
    below = home is not None and folder.absolute().is_relative_to(home.absolute().parent)
    links = Links(folder, home.parent if home is not None and below else None, linked)
    shared = _FOR_TEMPLATES | own_files()
    _draw_records(folder, lines, room, links)
    for line in lines:
        if own_page is not None and below and not line["refused"] and not line["zoom"]:
            line["page"] = links.to(OWN_PAGES, f"{line['name']}.html")
            own_page(line["name"], _own_page(folder, line, home, title, shared, linked=linked))
        line["link"] = f"#{line['anchor']}" if line["drawn"] else line["page"]
    return fill_template(
        "pendpipe.report",
        "page.html",
        title=title,
        has_theory=has_theory,
        simulated=sum(entry.get("source") == "simulated" for entry in entries),
        rows=headline(comparison, configuration),
        figures=drawn,
        tables={name: table_inside(figures / f"{name}.svg") for name in drawn},
        columns=columns,
        diagnosed=[line["diagnosis"] | line for line in lines if line["diagnosis"]],
        many=len(lines) > MANY,
        together=read_json(folder / TOGETHER) if (folder / TOGETHER).is_file() else None,
        asked=asked,
        records=lines,
        files=links.present(OF_THE_CAMPAIGN),
        counts=Counter(line["health"][:3] for line in lines),
        states=STATES,
        comparison=comparison,
        fitted=used(comparison),
        **({"fits": ()} if has_theory else _fits(folder, lines)),
        equations=EQUATIONS,
        glossary=GLOSSARY,
        provenance=comparison.get("provenance") or {},
        numbers=base64.b64encode(json.dumps(summary, indent=1).encode()).decode(),
        findings=findings(comparison),
        warned=grouped_warnings(entries),
        **shared,
    )


def formula(latex: str) -> Markup:
    """A formula as MathML, which browsers draw by themselves."""
    from latex2mathml.converter import convert

    return Markup(convert(latex))


_FOR_TEMPLATES: Final[dict[str, Any]] = {
    "captions": CAPTIONS,
    "compact": compact,
    "error": error,
    "formula": formula,
    "number": number,
    "with_error": with_error,
    "without_folders": without_folders,
}


def _fits(folder: Path, lines: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Of recordings without a theory, the table that `fit` prints: period, Q and losses."""
    from pendpipe.analysis.fit.result import FitResult
    from pendpipe.report.class_table import HEAD, Fitted, cells_of, together

    found = []
    for line in lines:
        path = folder / line["name"] / "fit.json"
        fit = (
            FitResult.from_json(read_json(path)) if not line["refused"] and path.is_file() else None
        )
        found.append(Fitted(line["name"], fit, without_folders(str(line["refused"] or ""))))
    links = [line["link"] for line in lines]
    return {
        "fits_head": ("record", *HEAD[1:]),
        "fits": list(zip(cells_of(found, wide=False), links, strict=True)),
        "alike": [str(each) for each in together(found)],
    }


class Links(NamedTuple):
    """Links from a page in the folder `home` to the results in `folder`; none without `home`."""

    folder: Path
    home: Path | None
    records: bool = True
    """Whether the records' files are linked to as well."""

    def to(self, *names: str) -> str | None:
        """The link to a result, by its folder and name."""
        if self.home is None:
            return None
        return quote(Path(os.path.relpath(self.folder.joinpath(*names), self.home)).as_posix())

    def present(self, names: Iterable[str], record: str = "") -> list[tuple[str, str]]:
        """Names and links of those of a record's (or the campaign's) files that there are."""
        wanted = names if self.records or not record else ()
        there = [name for name in wanted if (self.folder / record / name).is_file()]
        return [(name, link) for name in there if (link := self.to(record, name))]


def _draw_records(folder: Path, lines: list[dict[str, Any]], room: Room, links: Links) -> None:
    """Give the records their drawings while there is room, those that need a look first."""
    for line in lines:
        found = line["diagnosis"] and line["diagnosis"]["content"]["effects"]
        line["marked"] = bool(line["refused"] or line["health"].word == "red" or found)
        line |= dict.fromkeys(("waveform", "quality", "map", "decay", "page"))
        line |= {"drawn": False, "zoom": False, "files": []}
    first = sorted(lines, key=lambda line: not line["marked"])
    for line in first if len(lines) <= MANY else [line for line in first if line["marked"]]:
        line["files"] = links.present(OF_A_RECORD, line["name"])
        drawings = {} if line["refused"] else _drawings(folder, line["entry"])
        size = _RECORD_BYTES + sum(chart.size for chart in drawings.values())
        line["drawn"] = room.take(size)
        line |= drawings if line["drawn"] else {}
    drawn = [line for line in first if line["drawn"] and not line["refused"]]
    for line in drawn:
        line["map"] = _residual_map(folder, line, room)
    for line in drawn:
        packed = line["waveform"].packed if line["waveform"] else {}
        line["zoom"] = bool(packed) and room.take(len(str(packed)))
    # All or none: they show in detail what each waveform and Q(A) shows at a glance.
    decays = {line["name"]: folder / line["name"] / "figures" / "decay.svg" for line in drawn}
    if sum(path.stat().st_size for path in decays.values() if path.is_file()) < room.left:
        for line in drawn:
            line["decay"] = _decay(decays[line["name"]], line, room)


def _decay(path: Path, line: Content, room: Room) -> Markup | None:
    # The prefix is a number: a record's name need not be an identifier.
    words = f"{CAPTIONS['decay'].shows} Record {line['name']}."
    return room.drawing(path, line["anchor"], f"Decay of {line['name']}", words)


def _residual_map(folder: Path, line: Content, room: Room) -> Markup | None:
    """What the model leaves, before and after; only where something is missing it is drawn."""
    if not line["diagnosis"] or line["diagnosis"]["content"]["verdict"] != "missing-physics":
        return None
    words = f"{CAPTIONS['residual_map'].shows} Record {line['name']}."
    title = f"Residual of {line['name']} before and after"
    path = folder / line["name"] / "diagnosis" / "residual_map.svg"
    return room.drawing(path, f"{line['anchor']}-map", title, words)


def _drawings(folder: Path, entry: Content) -> dict[str, Chart]:
    """A record's waveform and Q against amplitude, where its results are there."""
    from pendpipe.figures.data import read_decay
    from pendpipe.report.charts import quality_by_amplitude, waveform

    try:
        decay = read_decay(folder, entry)
        quality = quality_by_amplitude(decay)
    except NothingToDrawError:
        return {}
    drawn = {} if quality is None else {"quality": quality}
    if (path := folder / str(entry["record"]) / "recording.csv").is_file():
        constant = number(entry.get("volts_per_radian"))
        drawn["waveform"] = waveform(read_plain(path), decay, constant)
    return drawn


def _own_page(
    folder: Path,
    line: Content,
    home: Path | None,
    campaign: str,
    shared: Content,
    *,
    linked: bool,
) -> str:
    """The page of one record, with all its drawings."""
    room, place = Room(BUDGET_BYTES), folder / line["name"]
    own = {**line, "page": None, "zoom": True, "files": []}
    if linked:
        own["files"] = Links(folder, folder / OWN_PAGES).present(OF_A_RECORD, line["name"])
    if not line["drawn"]:
        own |= _drawings(folder, line["entry"])
    own["zoom"] = own["waveform"] is not None
    own["map"] = _residual_map(folder, own, room)
    own["decay"] = _decay(place / "figures" / "decay.svg", own, room)
    back = "" if home is None else os.path.relpath(home, folder / OWN_PAGES)
    back = quote(Path(back).as_posix())
    return fill_template(
        "pendpipe.report", "record_page.html", line=own, home=back, campaign=campaign, **shared
    )


VERDICTS: Final = {
    "consistent": Health("consistent", "✔", "good", "the noise explains what the model leaves"),
    "missing-physics": Health("missing physics", "▲", "look", "something was left out"),
    "not-analysable": Health("not analysable", "○", "none", "there is no diagnosis"),
}
"""How each verdict is shown."""


def _diagnosis(place: Path) -> dict[str, Any] | None:
    """Read a record's diagnosis; None where it was not diagnosed."""
    from pendpipe.diagnosis.summary import read_summary

    if not (path := place / "diagnosis" / "diagnosis.json").is_file():
        return None
    content = read_json(path)
    # What is presumed is fitted, and no finding.
    content["effects"] = [each for each in content["effects"] if not each.get("presumed")]
    parameters = content["baseline"].get("parameters") or {}
    unit = (parameters.get("amplitude") or {}).get("unit", "rad")
    return {
        "light": VERDICTS[content["verdict"]],
        "summary": read_summary(content["summary"], unit),
        "content": content,
    }


def render_recording(
    name: str,
    recording: Recording,
    result: FitResult,
    outcome: Diagnosis | None = None,
    prediction: Prediction | Literal[False] = False,
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
    prediction
        Of another experiment; False where none was asked for.

    Returns
    -------
    str
        One HTML document that refers to nothing outside itself.
    """
    from pendpipe.figures.data import Decay
    from pendpipe.figures.decays import draw_residual, draw_sheet

    assert result.points is not None
    decay = Decay(name, result.points, result)
    drawings: list[tuple[str, Figure]] = [("residual", draw_residual(decay))]
    if outcome is not None:
        from pendpipe.figures.diagnosis import draw_each

        drawings += list(draw_each(outcome))
    drawings += [("prediction", prediction.plot())] if prediction else []
    return fill_template(
        "pendpipe.report",
        "recording.html",
        name_of_recording=name,
        style=own_files()["style"],
        light=Health(result.light, *STATES[result.light], result.light_reason),
        heading=heading(result),
        advice=sentence(result),
        facts=list(facts(result)),
        table=list(_qualities(result)),
        sheet=_inlined(draw_sheet(decay, recording), "sheet", _SHEET),
        diagnosis=None if outcome is None else outcome.summary,
        details="" if outcome is None else outcome.details,
        predicted=prediction and prediction.answer,
        numbers=[(title, str(each)) for title, each in result.numbers().items()],
        figures=[
            {"svg": _inlined(figure, f"figure-{key}", caption), "caption": caption}
            for key, figure in drawings
            for caption in [OF_A_RECORDING[key]]
        ],
        cuts=result.cuts,
        guesses=(*recording.weak_guesses, *recording.notes),
        warnings=result.warnings,
        provenance=result.provenance,
    )


def _qualities(result: FitResult) -> Iterator[tuple[str, ...]]:
    """Amplitude, Q, period and what loses most, where there is a period."""
    for each in result.quality_factors:
        if math.isfinite(each.period_s):
            quality = with_error(each.quality_factor.value, each.quality_factor.sd)
            amplitude = size(each.amplitude_rad, result["amplitude"].unit)
            yield amplitude, quality, f"{each.period_s:.5g} s", cause(each)


_SHEET: Final = Caption(
    "The decay, and its quality factor",
    "Readings and fitted amplitude against time (cut parts shaded); Q against amplitude.",
    "The line is the fitted law; the circles are the turning points alone, without a law.",
)


def _inlined(figure: Figure, prefix: str, caption: Caption) -> Markup:
    import matplotlib as mpl

    drawn = io.StringIO()
    with mpl.rc_context({"svg.hashsalt": prefix}):  # so that the same page has the same bytes
        figure.savefig(drawn, format="svg", metadata={"Date": None, "Creator": "pendpipe"})
    return inline_svg(drawn.getvalue(), prefix, caption.title, caption.shows)
