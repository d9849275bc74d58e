"""Oscilloscopes of Tektronix: .ISF, a head of settings and one curve of whole numbers."""

import re
from pathlib import Path
from typing import Final

import numpy as np

from pendpipe.formats.plugin import Dialect
from pendpipe.formats.table import Column, ReadOptions, Table, damaged_if

_HEAD: Final = re.compile(rb":?(WFMP|WFMPRE|WFMO|WFMOUTPRE)(:NR_P|:BYT_N|[;:]).*?:CURVE? ?#", re.S)


def _read(place: Path, data: bytes, _options: ReadOptions) -> Table:
    """Read the curve: x = XZE + XIN n, y = YZE + YMU (counts - YOF).

    Raises
    ------
    ValueError
        When a setting is absent, or the curve is shorter than it says.
    """
    mark = data.index(b"#", data.index(b":CURV"))
    head, digits = data[:mark].decode("latin-1"), int(data[mark + 1 : mark + 2])
    start = mark + 2 + digits
    size = int(data[mark + 2 : start])
    damaged_if(start + size > len(data), f"its curve of {size} bytes is cut short")

    def said(name: str, usual: str = "") -> str:
        found = re.search(rf'[;:]{name}[A-Z]*\s+"?([^";]+)', head)
        damaged_if(found is None and not usual, f"it does not say {name}")
        return found[1].strip() if found else usual

    order = "<" if said("BYT_O", "MSB").startswith("LSB") else ">"
    sign = "u" if said("BN_F", "RI") == "RP" else "i"
    counts = np.frombuffer(data[start : start + size], f"{order}{sign}{said('BYT_N')}")
    step = float(said("YMU"))
    values = float(said("YZE", "0")) + step * (counts - float(said("YOF", "0")))
    time_s = float(said("XZE", "0")) + float(said("XIN")) * np.arange(len(counts), dtype=np.float64)
    name = said("WFI", "curve").partition(",")[0]
    column = Column(name, said("YUN", "V"), values, 1, time_s=time_s, resolution=abs(step))
    return Table(place, "tektronix-isf", (column,))


ISF = Dialect("file of an oscilloscope", lambda head: _HEAD.match(head) is not None, _read)
