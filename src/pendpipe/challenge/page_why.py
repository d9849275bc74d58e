"""The part of the page that says what a missed promise was missed by."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from pendpipe.challenge.wording import Score, cell

MOST: Final = 12
"""Rows of a table; what is rarer is summed up."""
KINDS: Final = {
    "undetected": "Not detected", "misnamed": "Misnamed", "outside": "Outside the catalogue",
    "false-alarm": "False alarms",
}  # fmt: skip
"""Of failures, and how the page calls them."""


def why(scores: Score) -> Iterator[str]:
    """For each promise that was not kept: the causes by number, and what physics says of them."""
    if not scores["causes"]:
        return
    yield "## Why promises were missed"
    yield ""
    yield "Counted from the opened truth. Narrowly: the oracle's own score was above its threshold"
    yield "by less than the factor that was promised, so that chance had a part in it."
    yield ""
    before: Score = {}
    for found in scores["causes"].values():
        yield f"### {found['promise']}"
        yield ""
        if found.get("bins") is not None:
            yield from _bins(found["bins"])
        elif found["rows"] == before.get("rows"):
            yield "The same as above."
            yield ""
            continue
        else:
            yield from _rows(found["rows"])
        before = found
    yield from _reasons(scores)


def _reasons(scores: Score) -> Iterator[str]:
    """What physics says of the causes that occurred, each once."""
    if not any(each["reasons"] for each in scores["causes"].values()):
        return
    yield "### What physics says of these causes"
    yield ""
    yield "Reasons are kept in `src/pendpipe/challenge/reasons.toml`; only those whose cause"
    yield "occurred are shown."
    yield ""
    found = {
        (reason["of"], reason["cause"]): reason["why"]
        for each in scores["causes"].values() for reason in each["reasons"]
    }  # fmt: skip
    for kind, words in KINDS.items():
        for (of, cause), text in sorted(found.items()):
            if of == kind:
                yield f"- {words}, **{cause}**: {text}"
    yield ""


def _rows(rows: list[Score]) -> Iterator[str]:
    """Failures by cause."""
    if not rows:
        yield "No single item accounts for it: it is the sum of small differences."
        yield ""
        return
    narrow = any("narrowly" in row for row in rows)
    heads = ["hidden", "law", "answer", "how often", "of", "largest Δχ²"]
    heads += ["narrowly"] if narrow else []
    yield f"| {' | '.join(heads)} |"
    yield "|---" * len(heads) + "|"
    for row in rows[:MOST]:
        cells = [row["hidden"], cell(row["law"]), row["said"], str(row["count"]), str(row["of"])]
        cells += [f"{row['largest']:.0f}" if row["largest"] else ""]
        cells += [str(row["narrowly"])] if narrow else []
        yield f"| {' | '.join(cells)} |"
    if len(rows) > MOST:
        rest = sum(row["count"] for row in rows[MOST:])
        yield f"| others | | | {rest} " + "| " * (len(heads) - 4) + "|"
    yield ""


def _bins(bins: list[Score]) -> Iterator[str]:
    """Stated probabilities that did not come true, and what was behind them."""
    if not bins:
        yield "No bin by itself is off by more than its interval."
        yield ""
        return
    yield "| stated | came true | of the error | families (right of all) | mostly |"
    yield "|---|---|---|---|---|"
    for row in bins:
        low, high = row["edges"]
        families = ", ".join(f"{name} {a} of {b}" for name, (a, b) in row["families"].items())
        culprits = "; ".join(
            f"{cell(each['law']) if each['hidden'].startswith('unnamed-') else each['hidden']}"
            f" → {each['said']} {each['count']}"
            for each in row["culprits"]
        )
        kind = "wrong" if row["boasts"] else "right"
        yield (
            f"| {low:.1f} to {high:.1f} | {100 * row['met']:.0f} % of {row['of']} |"
            f" {row['error']:.3f} | {families} | {kind}: {culprits} |"
        )
    yield ""
    if not any(row["boasts"] for row in bins):
        yield "More came true than was stated, in each of these: what the readings say for a name"
        yield "and against its rivals was discounted too far."
        yield ""
