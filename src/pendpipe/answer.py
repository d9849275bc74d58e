"""The answer to a question about a recording, and its views: text, and HTML for a notebook."""

from __future__ import annotations

from dataclasses import dataclass
from html import escape
from typing import Final

from pendpipe.quantities import in_columns

WIDTH: Final = 120
"""Of a line that is printed, in characters: that of a terminal on half a screen."""
COLOURS: Final = {"green": "#00664b", "amber": "#8a4b00", "red": "#a3210f"}
"""Of a light, dark enough on white to be read (contrast above 4.5)."""

SMALLEST: Final = 1e-12
"""Smaller p-values rest on tails of the noise that nobody has tested."""
Table = tuple[tuple[str, ...], ...]


@dataclass(frozen=True)
class Answer:
    """What is known, one row a question.

    Parameters
    ----------
    headlines
        The answer in a line; then shorter ones, for where it is too wide.
    rows
        Title and text of what is known.
    light, remarks
        How far it may be believed; and what must be known before any number is read.
    tables
        Numbers side by side, heads first; then fewer of them.
    sentence, following
        What to copy, and what to do next.
    """

    headlines: tuple[str, ...]
    rows: tuple[tuple[str, str], ...]
    light: str = ""
    remarks: tuple[str, ...] = ()
    tables: tuple[Table, ...] = ()
    sentence: str = ""
    following: str = ""

    def lines(self, name: str = "", width: float = WIDTH) -> list[str]:
        """Return it as it is printed, all but the last two lines at most `width` wide.

        What makes room are numbers of the headline, last clauses, and rows of the table.

        >>> Answer(("it swings",), (("period", "2.0 s"),), sentence="T = 2.0 s.").lines("a.csv")
        ['a.csv: it swings', '  period                2.0 s', 'Copy: T = 2.0 s.']
        """
        ends = f"   {self.light.upper()}" if self.light else ""
        heads = [f"{name}: {each}{ends}" if name else f"{each}{ends}" for each in self.headlines]
        tables = [in_columns(list(zip(*table, strict=True))) for table in self.tables]
        return [
            _fitting(heads, width),
            *(_within(f"  {line}", width) for line in self.remarks),
            *(_within(f"  {title:<22}{text}", width) for title, text in self.rows),
            *(f"  {row}" for row in _fitting(tables, width - 2).splitlines()),
            *([f"Copy: {self.sentence}"] if self.sentence else []),
            *([f"Next: {self.following}"] if self.following else []),
        ]

    def html(self, name: str = "") -> str:
        """Return it for a notebook: paragraphs, a list of what is known, and a table."""
        title = escape(f"{name}: {self.headlines[0]}" if name else self.headlines[0])
        if self.light:
            title += f" <span style='color:{COLOURS[self.light]}'>{self.light}</span>"
        cells = (f"<dt>{escape(key)}</dt><dd>{escape(text)}</dd>" for key, text in self.rows)
        head, *body = self.tables[0] if self.tables else ((),)
        rows = (
            "".join(f"<{kind}>{escape(cell)}</{kind}>" for cell in row)
            for kind, row in (("th", head), *(("td", row) for row in body))
        )
        parts = (
            f"<p><strong>{title}</strong></p>",
            *(f"<p>{escape(line)}</p>" for line in self.remarks),
            f"<dl>{''.join(cells)}</dl>" if self.rows else "",
            f"<table>{''.join(f'<tr>{row}</tr>' for row in rows)}</table>" if body else "",
            f"<p><strong>{escape(self.sentence)}</strong></p>" if self.sentence else "",
        )
        return "".join(parts)


def _fitting(texts: list[str], width: float) -> str:
    """Return the first text that is narrow enough, else the last."""
    narrow = (text for text in texts if max(map(len, text.splitlines()), default=0) <= width)
    return next(narrow, texts[-1] if texts else "")


def _within(line: str, width: float) -> str:
    """Leave out the last clauses of a line until it is short enough, then what explains them."""
    for mark in ("; ", ": "):
        while len(line) > width and mark in line:
            line = line.rpartition(mark)[0]
    return line


def printed(p_value: float) -> str:
    """Return a p-value as it is printed: below 1e-12 it would rest on untested tails.

    >>> printed(0.0312), printed(0.0)
    ('p = 0.031', 'p < 1e-12')
    """
    return f"p = {p_value:.2g}" if p_value >= SMALLEST else f"p < {SMALLEST:.0e}"


def percent(share: float) -> str:
    """Print a probability in per cent."""
    if share > 0.995:
        return "> 99 %"
    return f"{100.0 * share:.0f} %" if share >= 0.01 else "< 1 %"


def factor(ratio: float) -> str:
    """Print a ratio to two digits, without a power of ten."""
    return f"{float(f'{ratio:.2g}'):,.0f}" if ratio > 9.95 else f"{ratio:.2g}"
