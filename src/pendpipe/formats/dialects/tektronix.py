"""Oscilloscopes of Tektronix: TDS, whose settings stand to the left of the first readings."""

import re

from pendpipe.formats.plugin import text_dialect

_PANEL = re.compile(r"([^,]*),([^,]*),([^,]*),(\s*[+-]?[\d.]+(?:[eE][+-]?\d+)?,.*)")


def _lines(lines: list[str]) -> list[str]:
    """Put above the readings what stands beside them."""
    rows = [_PANEL.fullmatch(line) for line in lines]
    if any(row is None for row, line in zip(rows, lines, strict=True) if line.strip()):
        return lines
    settings = {row[1].strip(): row[2].strip() for row in rows[:30] if row is not None}
    across, up = settings.get("Horizontal Units", "s"), settings.get("Vertical Units", "V")
    names = f"time ({across}),{settings.get('Source', 'CH1')} ({up}),"
    return [names, *(row[4] if row is not None else "" for row in rows)]


TDS = text_dialect("file of an oscilloscope", re.compile('"?Record Length"?,').match, _lines)
