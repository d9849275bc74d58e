"""What the workflow costs: CPU seconds of campaigns and plans, and statements of its parts.

    python -m benchmarks.workflow                       every part, some five minutes
    python -m benchmarks.workflow plan --number 1000    plans of a thousand records alone

`default` runs the default campaign from nothing, adds a record to it, and takes off what that
record alone takes; `files` begins a campaign of thirty files by ``init`` and runs it without
diagnoses; `plan` plans ten thousand records, with one more, and one file of them; `parts` counts
statements.
The table is that of docs/scale.md.
"""

from __future__ import annotations

import argparse
import ast
import os
import shutil
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path

from benchmarks.house import statements
from benchmarks.journal import ROOT, commit
from benchmarks.scale import FILES, Cost, cost, pretend, write_campaign
from benchmarks.table import head, table_row

Row = tuple[str, float, float | str, int]
"""What, CPU seconds or a number, seconds by the clock, and what is wanted."""


def _row(what: str, spent: Cost, wanted: int) -> Row:
    return what, spent.cpu_s, round(spent.clock_s), wanted


def default(folder: Path, _number: int) -> Iterator[Row]:
    """The default campaign, and one record more in it above that record alone."""
    shutil.copytree(ROOT / "config", folder / "config")
    yield _row("default campaign", cost(folder, "--cores", "2"), 60)
    # A first plan looks at all files once.
    cost(folder, "-n")
    with (folder / "config/records.tsv").open("a", encoding="utf-8") as table:
        table.write("added\tsimulated\twater\thigh\thigh-3\t\t\t\t\t20.0\n")
    shutil.copytree(folder, alone := folder / "alone")
    own = cost(alone, "--record", "added")
    more = cost(folder, "--cores", "2")
    yield "one record more in 27, above that record alone", more.cpu_s - own.cpu_s, "", 10


def files(folder: Path, number: int) -> Iterator[Row]:
    """Files of 2,048 readings through all stages but the diagnosis."""
    write_campaign(folder, number := min(number, 30), diagnosed=False)
    for path in (folder / "config/config.yaml", folder / "records.tsv"):
        path.unlink()
    names = [f"{name}.csv" for name in range(number)]
    begun = cost(folder, ".", *names, command="init")
    settings = folder / "config/config.yaml"
    text = settings.read_text(encoding="utf-8").replace("enabled: true", "enabled: false")
    settings.write_text(text, encoding="utf-8")
    ran = cost(folder, "--cores", "2")
    both = Cost(begun.clock_s + ran.clock_s, begun.cpu_s + ran.cpu_s, ran.memory_mb)
    yield _row(f"{number} files: init, and campaign without diagnoses", both, 25)


def plan(folder: Path, number: int) -> Iterator[Row]:
    """Plans of many records, of which nothing is done, all, or all but one."""
    write_campaign(folder, number, diagnosed=True)
    yield _row(f"plan of {number:,} records", cost(folder, "-n"), 6)
    name = f"results/r{number // 2:05d}/fit.json"
    yield _row("plan of one file of them", cost(folder, "-n", "--", name), 6)
    pretend(folder)
    with (folder / "records.tsv").open("a", encoding="utf-8") as table:
        table.write(f"added\t{FILES - 1}.csv\n" if number >= FILES else "added\t0.csv\n")
    yield _row("plan with one record more, when all is done", cost(folder, "-n"), 6)


_PARTS = (
    *("stages/chunks", "stages/archive", "stages/watch", "stages/refusal", "stages/unpack"),
    *("provenance", "configuration/jobs", "commands/stage", "commands/doctor"),
)


def parts(_folder: Path, _number: int) -> Iterator[Row]:
    """What the make beside Snakemake is made of."""
    sources = (ROOT.joinpath("src/pendpipe", f"{name}.py") for name in _PARTS)
    trees = (ast.parse(path.read_text(encoding="utf-8")) for path in sources)
    yield "statements of the parts", sum(statements(ast.walk(tree)) for tree in trees), "", 350


ALL: dict[str, Callable[[Path, int], Iterator[Row]]] = {
    each.__name__: each for each in (default, files, plan, parts)
}


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("parts", nargs="*", choices=[*ALL, []], help="all, if none is named")
    parser.add_argument("--number", type=int, default=10_000, help="records (%(default)s)")
    told = parser.parse_args()
    print(head("what", "CPU s, or number", "clock, s", "wanted", "load", "commit"))
    for name in told.parts or ALL:
        with tempfile.TemporaryDirectory(prefix="pendpipe-") as place:
            for what, found, clock, wanted in ALL[name](Path(place), told.number):
                cells = (f"{found:.1f}".removesuffix(".0"), clock, wanted)
                load = f"{os.getloadavg()[0]:.0f}"
                print(table_row(what, [*cells, load, commit()]), flush=True)


if __name__ == "__main__":
    main()
