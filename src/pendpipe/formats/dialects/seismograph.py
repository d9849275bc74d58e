"""Seismographs' text: SLIST, GSE2 (samples in lines, in segments) and SAC."""

import re
from typing import Final

from pendpipe.formats.clock import column_of_clock_times
from pendpipe.formats.plugin import text_dialect

_SEGMENT: Final = re.compile(
    r"(?:TIMESERIES|WID2)\b(?=.*?(?:\bINT +\d+|, \d+ samples,) +(?![0.]+\b)(\d+\.?\d*)\b)"
    r".*?(\d{4})[-/](\d\d)[-/](\d\d[T ][\d:.]+).*\n(?:[A-Z].*\n)*([-+\d.eE\s]*)"
)


def _lines(lines: list[str]) -> list[str]:
    """Put the samples, several in a line, below one another, with their times."""
    unit = [*re.findall(r", (\S+)$", lines[0]), "counts"][0]
    rows = [f"time (s)\tchannel ({unit})"]
    for rate, *date, samples in _SEGMENT.findall("\n".join(lines)):
        start = column_of_clock_times(["-".join(date)])
        first_s = 0.0 if start is None else float(start[0])
        cells = enumerate(samples.split())
        rows += [f"{first_s + at / float(rate):.6f}\t{cell}" for at, cell in cells]
    return rows


def _lines_of_sac(lines: list[str]) -> list[str]:
    """Put the samples below one another: first of all stands their interval."""
    return [f"# dt = {lines[0].split()[0]} s", *" ".join(lines[30:]).split()]


SEGMENTS = text_dialect(
    "seismogram",
    re.compile(r"(?:.*\n){0,9}WID2 .* INT |TIMESERIES .*SLIST").match,
    _lines,
)
SAC = text_dialect(
    "seismogram",
    re.compile(r"(?: *\S+(?: +\S+){4} *\n){22}.*-12345").match,
    _lines_of_sac,
)
