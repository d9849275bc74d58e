"""Oscilloscopes of Tektronix: DPO2000 and MSO2000, a column of settings for each channel."""

import re

from pendpipe.formats.plugin import text_dialect


def _lines(lines: list[str]) -> list[str]:
    """Give each channel the unit that stands above it; leave out the peaks beside it."""
    at = next(row for row, line in enumerate(lines) if line.startswith("TIME,"))
    settings = {key: cells for key, *cells in (line.split(",") for line in lines[:at])}
    names = lines[at].split(",")
    units = [*settings.get("Horizontal Units", ["s"])[:1], *settings.get("Vertical Units", [])]
    unit = dict(zip(names, units, strict=False))
    kept = [column for column, name in enumerate(names) if not name.endswith("Peak Detect")]
    head = [f"{names[column]} ({unit.get(names[column]) or 'V'})" for column in kept]
    rows = (dict(enumerate(line.split(","))) for line in lines[at + 1 :] if line)
    return [",".join(head), *(",".join(row.get(column, "") for column in kept) for row in rows)]


DPO = text_dialect(
    "file of an oscilloscope",
    re.compile(r"Model,[DM][PS]O\d+.*\n(?:.*\n){1,40}TIME,").match,
    _lines,
)
