"""The fits of many recordings as one table: printed, and as CSV, Excel, HTML or LaTeX."""

from __future__ import annotations

import io
import math
import re
import statistics
import zipfile
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, NamedTuple

from pendpipe.analysis.fit.printed import SHORT, percent, period_name, short_size
from pendpipe.analysis.fit.quality import pendulum_of
from pendpipe.cells import csv_text, inert
from pendpipe.errors import refuse_if
from pendpipe.estimate import Estimate, chi_square_p_value
from pendpipe.files import MADE_BY, is_stream, told_apart, write_json, write_whole
from pendpipe.quantities import in_columns, with_error

if TYPE_CHECKING:
    from pendpipe.analysis.fit.quality import Quality
    from pendpipe.analysis.fit.result import FitResult

COLUMNS: Final = (
    *("file", "light", "T0_s", "T0_sd_s", "Q", "Q_sd", "amplitude", "amplitude_unit"),
    *("amplitude_deg", "dominant_loss", "dominant_share", "a", "a_sd", "a_unit", "b", "b_sd"),
    *("b_unit", "c", "c_sd", "c_unit", "damping_time_s", "half_life_s", "logarithmic_decrement"),
    *("quotable", "remark", "T_s", "T_sd_s", "a_limit95", "b_limit95", "c_limit95"),
    *("g_m_per_s2", "g_sd_m_per_s2", "length_m", "length_sd_m"),
)
"""Of the table that is written: a value and its standard deviation have a column each. T is the
period of what is no pendulum; a rate that may be zero has its upper limit (95 %) as well."""
FORMS: Final = (".json", ".csv", ".xlsx", ".html", ".tex")
_AGREES: Final = 5.0
"""Standard deviations, or robust ones of the class, within which a file agrees with its median."""
_ALIKE: Final = {"T0": 0.03, "T": 0.03, "Q": 0.3}
"""Part by which those of a class may differ: beyond, they are of different pendulums."""
_CHANCE: Final = 0.001
"""Probability of a larger chi^2 below which the values differ by more than their errors."""


class Fitted(NamedTuple):
    """One recording of a class: its fit, or why there is none."""

    file: str
    fit: FitResult | None
    refusal: str = ""


class Together(NamedTuple):
    """A quantity over the files that agree; its mean where their errors explain its scatter."""

    name: str
    files: int
    of: int
    mean: Estimate
    """Weighted by the variances; NaN where they differ by more than their errors."""
    scatter: float
    """Standard deviation of the values."""
    chi2: float
    p_value: float

    def __str__(self) -> str:
        mean, unit = self.mean, self.mean.unit
        if math.isnan(mean.value):
            by, own = with_error(self.scatter, None, unit), f"{self.chi2:.3g} for {self.files - 1}"
            return (
                f"{self.name}: {self.files} files scatter by {by}, more than their errors"
                f" (chi² {own}): no mean (--mean)"
            )
        agree = "they agree" if self.p_value >= _CHANCE else "they differ by more than their errors"
        left = f" ({self.of - self.files} far from them left out)" if self.files < self.of else ""
        return (
            f"{self.name}: mean of {self.files} files{left}"
            f" {with_error(mean.value, mean.sd, unit, short=True)}, scatter"
            f" {with_error(self.scatter, None, unit)}; {agree}: chi² {self.chi2:.3g} for"
            f" {self.files - 1} (p = {self.p_value:.2g})"
        )


def form_of(out: str | Path) -> str:
    """Return the form that a file's suffix asks for; JSON where it has none.

    Raises
    ------
    InputError
        If nothing is written in that form.
    """
    suffix = ".json" if is_stream(out) else Path(out).suffix.lower() or ".json"
    refuse_if(
        suffix not in FORMS,
        f"--out {out}",
        "its format is unknown",
        f"end its name in {', '.join(FORMS[:-1])} or {FORMS[-1]}",
    )
    return suffix


def write_fits(out: str | Path, fits: Sequence[Fitted], content: Mapping[str, Any]) -> None:
    """Write fits in the form that the suffix asks for; `content` is the JSON."""
    form = form_of(out)
    if form == ".json":
        write_json(out, content)
        return
    makers: dict[str, Callable[[Sequence[Fitted]], str | bytes]] = {
        ".csv": _csv,
        ".xlsx": _excel,
        ".html": class_page,
        ".tex": _latex,
    }
    write_whole(out, makers[form](fits))


def record(fitted: Fitted) -> dict[str, Any]:
    """Return a row of the table that is written, by `COLUMNS`; what is not there is None."""
    fit, row = fitted.fit, dict.fromkeys(COLUMNS)
    row |= {"file": fitted.file, "light": "refused", "remark": fitted.refusal or None}
    if fit is None:
        return row
    unit = fit["amplitude"].unit
    # Of two modes that beat neither is the period.
    numbers = {period_name(fit): (fit.period, "_s")} if fit.hindered != "beat" else {}
    ends = {"g": "_m_per_s2", "length": "_m"}
    numbers |= {name: (each, ends[name]) for name, each in pendulum_of(fit).items()}
    if fit.quality_factors:
        large = fit.quality_factors[0]
        numbers["Q"] = large.quality_factor, ""
        row |= {"amplitude": large.amplitude_rad, "amplitude_unit": unit}
        if unit == "rad":
            row["amplitude_deg"] = math.degrees(large.amplitude_rad)
        if (loss := large.dominant) is not None:
            row |= {"dominant_loss": SHORT[loss], "dominant_share": large.losses[loss].value}
        row |= {name: each.value for name, each in fit.damping().items() if name != "amplitude_rad"}
    if fit.light != "red":
        numbers |= {name: (fit[name], "") for name in "abc"}
        row |= {f"{name}_unit": fit[name].unit for name in "abc"}
        row |= {f"{n}_limit95": fit[n].bounds95[1] for n in "abc" if fit[n].is_limit}
    for name, (estimate, end) in numbers.items():
        row |= {f"{name}{end}": estimate.value, f"{name}_sd{end}": estimate.sd}
    row = {name: None if cell != cell else cell for name, cell in row.items()}
    return row | {
        "light": fit.light,
        "quotable": " ".join(fit.quotable),
        "remark": None if fit.light == "green" and not fit.refuted else fit.light_reason,
    }


def together(fits: Sequence[Fitted], *, mean: bool = False) -> list[Together]:
    """Return scatter and chi^2 of T0, T and Q over the files that agree with their median.

    Their means, where errors explain the scatter: else they are of different pendulums, of which
    there is a `mean` only if it is asked for.
    """
    found = [each.fit for each in fits if each.fit is not None and each.fit.light != "red"]
    groups = list[Together]()
    for name in ("T0", "T"):
        timed = [f for f in found if "period" in f.quotable and period_name(f) == name]
        one = [timed[k] for k in _agreeing(name, [fit.period for fit in timed])]
        lossy = [fit.quality_factors[0].quality_factor for fit in one if "Q" in fit.quotable]
        alike = [lossy[k] for k in _agreeing("Q", lossy)]
        if len(one) > 1:
            groups.append(_together(name, [f.period for f in one], len(timed), mean=mean))
            if len(alike) > 1 and not math.isnan(groups[-1].mean.value):
                groups.append(_together("Q", alike, len(lossy), mean=mean))
    return groups


def _agreeing(name: str, values: Sequence[Estimate]) -> list[int]:
    """Return which of some values agree with their median."""
    if not values:
        return []
    middle = statistics.median(each.value for each in values)
    robust = 1.4826 * statistics.median(abs(each.value - middle) for each in values)
    spread = min(_AGREES * robust, _ALIKE[name] * abs(middle))
    return [
        k
        for k, each in enumerate(values)
        if abs(each.value - middle) <= max(_AGREES * each.sd, spread)
    ]


def _together(name: str, kept: Sequence[Estimate], of: int, *, mean: bool) -> Together:
    weights = [each.sd**-2 for each in kept]
    middle = sum(w * each.value for w, each in zip(weights, kept, strict=True)) / sum(weights)
    chi2 = sum(w * (each.value - middle) ** 2 for w, each in zip(weights, kept, strict=True))
    scatter = statistics.stdev([each.value for each in kept]) if len(kept) > 1 else 0.0
    p_value = chi_square_p_value(chi2, len(kept) - 1)
    estimate = Estimate(middle, sum(weights) ** -0.5, kept[0].unit)
    if not (mean or p_value >= _CHANCE):
        estimate = Estimate(math.nan, math.nan, kept[0].unit)
    return Together(name, len(kept), of, estimate, scatter, chi2, p_value)


HEAD: Final = ("file", "light", "period", "Q", "at", "loses most by", "remark")
WIDE: Final = ("a", "b", "c")
_REMARK: Final = 60
"""Characters of a remark, so that a row fits a terminal."""


def printed(fits: Sequence[Fitted], *, wide: bool = False, mean: bool = False) -> str:
    """Lay a class out, one line per file; then what the files say together."""
    rows = [
        (*cells, remark if each.fit is None or len(remark) <= _REMARK else f"{remark[:_REMARK]}…")
        for each in fits
        for *cells, remark in [_row(each, wide=wide)]
    ]
    head = (*HEAD[:-1], *(WIDE if wide else ()), HEAD[-1])
    kept = sum(each.fit is not None and each.fit.light != "red" for each in fits)
    red = sum(each.fit is not None and each.fit.light == "red" for each in fits)
    refused = len(fits) - kept - red
    counts = f"{kept} fitted, {red} red, {refused} refused"
    return "\n".join([in_columns([head, *rows]), *map(str, together(fits, mean=mean)), counts])


def _row(fitted: Fitted, *, wide: bool) -> tuple[str, ...]:
    """The cells of one recording under `HEAD`, the remark whole."""
    fit, blank = fitted.fit, ("",) * (len(WIDE) if wide else 0)
    if fit is None:
        return (fitted.file, "refused", *[""] * 4, *blank, fitted.refusal)
    unit, found = fit["amplitude"].unit, fit.quality_factors
    large = found[0] if found else None
    loss = large.dominant if large else None
    rates = tuple("" if fit.light == "red" else fit[n].or_limit() for n in WIDE if wide)
    remark = "" if fit.light == "green" else fit.light_reason
    if not remark and fit.refuted:
        remark = "more than noise is left: diagnose"
    return (
        fitted.file,
        fit.light,
        _period(fit),
        _quality(fit, large) if large else "",
        short_size(large.amplitude_rad, unit) if large else "",
        f"{percent(large.losses[loss])} {SHORT[loss]}" if large and loss else "",
        *rates,
        remark,
    )


def _period(fit: FitResult) -> str:
    """The period by its name, with what it tells of a pendulum whose length, or g, is given."""
    if fit.hindered == "beat":
        return "two modes beat"
    if math.isnan(fit.period.value):
        return "not shown: --period"
    given = {period_name(fit): fit.period, **pendulum_of(fit)}
    return ", ".join(
        f"{name} {with_error(each.value, each.sd, each.unit, short=True)}"
        for name, each in given.items()
    )


def _quality(fit: FitResult, large: Quality) -> str:
    """Q; of amplitudes without a period the time to a half."""
    found, name = large.quality_factor, ""
    if math.isnan(large.period_s):
        found, name = fit.damping()["half_life_s"], "to 1/2 in "
    return f"{name}{with_error(found.value, found.sd, found.unit, short=True)}"


def _csv(fits: Sequence[Fitted]) -> str:
    return csv_text(COLUMNS, (record(each).values() for each in fits))


def _excel(fits: Sequence[Fitted]) -> bytes:
    from openpyxl import Workbook

    book, out = Workbook(), io.BytesIO()
    sheet = book.active
    assert sheet is not None
    sheet.title = "fits"
    sheet.freeze_panes = "B2"
    rows = (COLUMNS, *(record(each).values() for each in fits), *zip(map(str, together(fits))))
    for row in rows:
        sheet.append([_NOT_IN_XML.sub("?", c) if isinstance(c, str) else c for c in row])
        for cell in sheet[sheet.max_row]:
            if isinstance(cell.value, str):
                # Text, even where somebody edits the cell later.
                cell.data_type, cell.quotePrefix = "s", inert(cell.value) != cell.value
    book.save(out)
    with zipfile.ZipFile(out, "a") as archive:
        archive.comment = f"\0made by {MADE_BY}\0".encode()
    return out.getvalue()


_NOT_IN_XML: Final = re.compile(r"[\x00-\x08\x0b-\x1f\ud800-\udfff]")
"""Control characters, and bytes of a name that are no text."""


def cells_of(fits: Sequence[Fitted], *, wide: bool = True) -> list[tuple[str, ...]]:
    """The cells of each row under `HEAD` (with `WIDE` before the remark)."""
    return [_row(each, wide=wide) for each in fits]


def class_page(fits: Sequence[Fitted], links: Sequence[str | None] | None = None) -> str:
    """Return the table as a page; each name is a link where there is one."""
    from urllib.parse import quote

    from pendpipe.report import own_files
    from pendpipe.templates import render

    names = told_apart([each.file for each in fits])
    rows = [(name, *cells[1:]) for name, cells in zip(names, cells_of(fits), strict=True)]
    return render(
        "pendpipe.report",
        "class.html",
        style=own_files()["style"],
        head=(*HEAD[:-1], *WIDE, HEAD[-1]),
        rows=[
            (cells, link and quote(link))
            for cells, link in zip(rows, links or [None] * len(rows), strict=True)
        ],
        together=[str(each) for each in together(fits)],
    )


_RAISED: Final = str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789")
_TEX: Final = str.maketrans(
    {sign: "\\" + sign for sign in "&%$#_{}"}
    | {"[": "{[}", "\n": " ", "\r": " "}  # behind \\ a bracket is its option
    | {"\\": r"\textbackslash{}", "~": r"\textasciitilde{}", "^": r"\textasciicircum{}"}
    | {"±": r"$\pm$", "×": r"$\times$", "°": r"\textdegree{}", "π": r"$\pi$"}
    | {"\N{MINUS SIGN}": "$-$"}
)


def latex(text: str) -> str:
    r"""Escape a cell for LaTeX.

    >>> latex("70 % drag_1"), latex("s⁻¹")
    ('70 \\% drag\\_1', 's\\textsuperscript{-1}')
    """
    return re.sub(
        "[⁻⁰¹²³⁴⁵⁶⁷⁸⁹]+",
        lambda found: rf"\textsuperscript{{{found[0].translate(_RAISED)}}}",
        text.translate(_TEX),
    )


def _latex(fits: Sequence[Fitted]) -> str:
    head = (*HEAD[:-1], *WIDE, HEAD[-1])
    lines = [" & ".join(map(latex, cells)) + r" \\" for cells in cells_of(fits)]
    return "\n".join(
        [
            f"% made_by: {MADE_BY}",
            rf"\begin{{tabular}}{{{'l' * len(head)}}}",
            r"\hline",
            " & ".join(map(latex, head)) + r" \\",
            r"\hline",
            *lines,
            r"\hline",
            r"\end{tabular}",
            *(rf"\par {latex(str(each))}" for each in together(fits)),
            "",
        ]
    )
