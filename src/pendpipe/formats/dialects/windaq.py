"""WinDaq: recordings (.WDQ, .WDH, .WDC, .WHC), spreadsheet exports, and a DI-149's ASCII mode."""

import re
from typing import Final

from pendpipe.formats import windaq
from pendpipe.formats.plugin import Dialect, text_of

_SCAN: Final = re.compile(r"(^|\n)sc\s+[+-]?\d")
_NAMES: Final = re.compile(r"^\W*relative time", re.I | re.M)

WINDAQ = Dialect("WinDaq", windaq.has_mark, windaq.read_table, windaq.SUFFIXES)
EXPORT = Dialect("WinDaq CSV", lambda h: bool(_NAMES.search(text_of(h))), windaq.read_export)
CAPTURE = Dialect("DI-149 capture", lambda h: bool(_SCAN.search(text_of(h))), windaq.read_capture)
