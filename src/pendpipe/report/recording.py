"""One recording on one page: its fit, its figure and, where asked, its diagnosis."""

import io

from pendpipe.analysis.fit.result import (
    WITHOUT_LAW,
    FitResult,
    qualities,
    quotable,
    rate_with_error,
    seen_qualities,
    small_period,
)
from pendpipe.quantities import compact, with_error
from pendpipe.recording import Recording
from pendpipe.report.page import inline_svg, own_files
from pendpipe.templates import render as fill_template

LIGHTS = {"green": ("good", "✓"), "amber": ("look", "!"), "red": ("bad", "✗")}
"""Colour class and symbol of a light: colour never carries a meaning alone."""


def render_recording(
    name: str,
    recording: Recording,
    result: FitResult,
    statement: str | None = None,
) -> str:
    """Make the page of one recording.

    Parameters
    ----------
    name
        What to call the recording: the name of its file.
    recording
        The whole of it, with its notes.
    result
        The fit, with its readings.
    statement
        The diagnosis in a paragraph; None where none was asked for.

    Returns
    -------
    str
        One HTML document that refers to nothing outside itself.
    """
    unit = result["amplitude"].unit
    period = small_period(result)
    numbers = [("Period", with_error(period.value, period.sd, "s"))]
    if result.light == "red":
        rows = [
            (compact(amplitude, unit), with_error(seen.value, seen.sd), WITHOUT_LAW)
            for amplitude, seen in seen_qualities(result)
        ]
    else:
        titles = {"a": "quadratic", "b": "linear", "c": "Coulomb"}
        numbers += [
            (f"{letter} ({titles[letter]})", rate_with_error(result[letter], short=False))
            for letter in titles
        ]
        rows = [
            (
                compact(each.amplitude_rad, unit),
                with_error(each.quality_factor.value, each.quality_factor.sd),
                each.cause,
            )
            for each in qualities(result)
        ]
    drawn, title = io.StringIO(), "The decay with its fit"
    result.plot().savefig(drawn, format="svg", metadata={"Date": None, "Creator": "pendpipe"})
    return fill_template(
        "pendpipe.report",
        "recording.html",
        name_of_recording=name,
        style=own_files()["style"],
        light=(result.light, *LIGHTS[result.light]),
        reason=result.light_reason,
        numbers=numbers,
        qualities=rows,
        advice=quotable(result),
        checks=[check.sentence(unit) for check in result.decrement_check],
        figures=[(title, inline_svg(drawn.getvalue(), "figure0", title, title))],
        statement=statement,
        cuts=result.cuts,
        guesses=(*recording.weak_guesses, *recording.notes),
        warnings=result.warnings,
        provenance=result.provenance,
    )
