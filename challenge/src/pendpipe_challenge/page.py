"""The page about a scored set: what was hidden, what was found, what was missed."""

from __future__ import annotations

from typing import Any, Final

from pendpipe_challenge.intervals import Score, number, percent, with_interval

FAMILIES: Final = ("combinations", "ties", "outside", "withheld", "real")
MOST_ROWS: Final = 12
"""Rows of a table of causes; what is rarer is summed up."""
THRESHOLDS: Final = (0.0, 0.5, 0.8, 0.9)
"""Probabilities whose withholding is described."""
KINDS: Final = {
    "undetected": "Not detected",
    "misnamed": "Misnamed",
    "outside": "Outside the catalogue",
    "false-alarm": "False alarms",
}
"""Of failures, and how the page calls them."""


def page(scores: Score, figures: list[str], folder: str) -> str:
    """Write the page as Markdown, by the template ``page.md.j2``.

    Parameters
    ----------
    scores
        Of `score.score`.
    figures, folder
        Names of the drawn figures, and where they lie beside the page.
    """
    from jinja2 import Environment, PackageLoader

    environment = Environment(
        loader=PackageLoader("pendpipe_challenge", "."),
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    environment.filters |= {
        "percent": percent,
        "number": number,
        "with_interval": with_interval,
        "value": lambda score: with_interval(score["value"], score),
        "words": lambda key: key.replace("_", " "),
        "cell": lambda text: text.replace("|", r"\|"),
        "counts": _counts,
    }
    answered = [row for row in scores["abstention"] if row["accuracy"]["rate"] is not None]
    return environment.get_template("page.md.j2").render(
        scores,
        figures=figures,
        folder=folder,
        others={family: scores[family] for family in FAMILIES},
        changes=_changes(list(scores["real"]["by_change"].values())),
        thresholds=[row for row in answered if row["threshold"] in THRESHOLDS],
        reasons=_reasons(list(scores["causes"].values())),
        most=MOST_ROWS,
    )


def _counts(named: dict[str, int]) -> str:
    """Names with how often each was given."""
    return ", ".join(f"{name} {count}" for name, count in sorted(named.items())) or "none"


def _changes(entries: list[Score]) -> list[tuple[Any, ...]]:
    """What was concealed in real recordings, each recording and change once, with counts."""
    rows = []
    for source, effect in sorted({(entry["source"], entry["effect"]) for entry in entries}):
        same = [e for e in entries if (e["source"], e["effect"]) == (source, effect)]
        named, without = (sum(bool(e[key]) for e in same) for key in ("named", "twin_named"))
        rows.append((source, effect, len(same), named, without))
    return rows


def _reasons(causes: list[Score]) -> list[tuple[str, str, str]]:
    """Of the causes that occurred, each once: the failure's kind, the cause, the physics."""
    found = {(r["of"], r["cause"]): r["why"] for each in causes for r in each["reasons"]}
    return [
        (words, cause, why)
        for kind, words in KINDS.items()
        for (of, cause), why in sorted(found.items())
        if of == kind
    ]
