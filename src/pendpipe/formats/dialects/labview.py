"""LabVIEW's measurement files (.lvm): two headers, and each segment with one of its own."""

import re
from itertools import zip_longest

from pendpipe.formats.plugin import text_dialect


def _lines(lines: list[str]) -> list[str]:
    """Make of the headers remarks and one row of names with units."""
    ends = [row for row, line in enumerate(lines[:100]) if line.startswith("***End_of_Header***")]
    at = max(ends[:2], default=-1) + 1
    settings = {key: cells for key, *cells in (line.split("\t") for line in lines[:at])}
    names = [
        name for name in "".join(lines[at : at + 1]).split("\t") if name not in ("Comment", "")
    ]
    units = ["s", *settings.get("Y_Unit_Label", [])][: len(names)]
    head = [f"{n} ({u})" if u else n for n, u in zip_longest(names, units, fillvalue="")]
    bare = settings.get("X_Columns") == ["No"]  # then the rows begin with an empty cell
    below = (line for line in lines[at + 1 :] if not re.match(r"[A-Z*]", line))
    rows = [line[bare:].rstrip("\t") for line in below]
    return [*("# " + line for line in lines[:at]), "\t".join(head[bare:]), *rows]


LABVIEW = text_dialect("LabVIEW file", re.compile("LabVIEW Measurement").match, _lines)
