"""Evidence of the acquisition: faults by the hundred thousand, kills, full disks, a pulled plug.

``python -m benchmarks.acquisition`` prints the tables and writes them into
``docs/acquisition.md`` (``make evidence`` does). A part may be named: ``faults``, ``slips``,
``clock``, ``live``, ``kill``, ``disk``, ``plug``, ``speed``, ``windaq``, ``fuzz``; parts not
run keep their tables.
Kills and fuzzing go on where they were broken off, as long as the code is the same.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

from benchmarks.acquisition_crash import disk_table, kill_table, plug_table
from benchmarks.acquisition_faults import clock_table, fault_table
from benchmarks.acquisition_live import live_table
from benchmarks.acquisition_slips import slip_table
from benchmarks.acquisition_speed import speed_table
from benchmarks.acquisition_windaq import windaq_table
from benchmarks.fuzz import fuzz_table

PAGE = Path(__file__).resolve().parents[1] / "docs" / "acquisition.md"
PARTS: dict[str, Callable[[Path], str]] = {
    "faults": fault_table,
    "slips": slip_table,
    "clock": clock_table,
    "live": live_table,
    "kill": kill_table,
    "disk": disk_table,
    "plug": plug_table,
    "speed": speed_table,
    "windaq": windaq_table,
    "fuzz": fuzz_table,
}


def put(part: str, table: str) -> None:
    """Replace what stands between a part's markers in the page."""
    begin, end = f"<!-- measured: {part} -->", f"<!-- end: {part} -->"
    text = PAGE.read_text(encoding="utf-8")
    before, _, rest = text.partition(begin)
    _, _, after = rest.partition(end)
    PAGE.write_text(f"{before}{begin}\n{table}\n{end}{after}", encoding="utf-8")


def main(arguments: list[str] | None = None) -> int:
    for part in arguments or list(PARTS):
        with tempfile.TemporaryDirectory(prefix="pendpipe-") as folder:
            table = PARTS[part](Path(folder))
        print(f"\n{part}\n\n{table}", flush=True)
        put(part, table)
    return 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
