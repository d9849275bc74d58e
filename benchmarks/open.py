"""`pendpipe open` in Chromium: seconds from the drop, digits beside `fit`, axe, keys, pictures.

    python -m benchmarks.open [sheets] [many] [keys] [--number 30] [--pictures .evidence/open]

``sheets`` drops a file each of five instruments, of ``../shared``, or else the examples, on an
empty page; ``many`` drops a number at once, which are these again; ``keys`` needs no mouse. A sheet
has the digits of ``pendpipe fit`` where its rows and its line to copy begin as those of `fit`,
which ends a long row earlier. axe looks at the empty page, each sheet and the table, light and
dark, at 1280 and 390 px. The status is 1 where digits differ, axe finds something or a page is
wider than its window or its paper; a complaint of the browser and a key that leads nowhere are
errors. Chromium, Playwright and axe-playwright-python are needed (the extra dev).
"""

from __future__ import annotations

import argparse
import base64
import os
import re
import shutil
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from itertools import cycle, islice
from pathlib import Path
from typing import Any, Final

from benchmarks.journal import ROOT, commit
from benchmarks.table import head, table_row
from pendpipe.commands.open import Door

EXAMPLES: Final = tuple(ROOT / "examples" / f"{name}-pendulum.csv" for name in ("rod", "string"))
RECORDINGS: Final = ROOT.parent / "shared" / "recordings"
FILES: Final = {
    "encoder": "yfysiks-encoder/data2_22.csv",
    "gyroscope of a phone": "ganesh999-phone-gyro/Gyroscope.csv",
    "video, Tracker": "yyzcr-tracker/pendulum_data_from_tracker_copy.txt",
    "motion sensor": "filo0509-spring/molla_durissima_discopieno_14.91945_0.2016_1.csv",
    "DATAQ, WinDaq": "windaq-vendor-sample/SAMPLE.WDH",
}
WIDTHS: Final = (1280, 390)
PAPER: Final = 703
"""A4 less the margins of 12 mm of style.css, in pixels of 1/96 inch."""
KEYS: Final = 100
"""What is not reached by so many is not reached."""


def installed() -> str | None:
    """Return the path of a Chromium."""
    names = (os.environ.get("CHROMIUM", ""), "chromium", "chromium-browser", "google-chrome")
    return next((path for name in names if name and (path := shutil.which(name))), None)


@contextmanager
def browser() -> Iterator[Any]:
    """Run the Chromium that is installed."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as driver:
        # A container's user may be root, which Chromium's sandbox refuses.
        running = driver.chromium.launch(executable_path=installed(), args=["--no-sandbox"])
        yield running
        running.close()


@contextmanager
def serving(folder: Path, live: Path | None = None) -> Iterator[Door]:
    """Serve the page of `pendpipe open`."""
    with Door(0, folder, live=live) as door:
        threading.Thread(target=door.serve_forever, daemon=True).start()
        yield door
        door.end()


@contextmanager
def opened(chromium: Any, door: Door, width: int = WIDTHS[0]) -> Iterator[Any]:
    """Open the page without recordings; a complaint, and a request to anybody else, is a fault."""
    for number in list(door._files):
        del door._files[number]
    context = chromium.new_context(viewport={"width": width, "height": 800})
    tab, faults = context.new_page(), list[str]()
    tab.on("console", lambda told: faults.append(f"{told.type}: {told.text}"))
    tab.on("pageerror", lambda error: faults.append(str(error)))
    # A chooser is kept from now on: a key that comes before Chromium is asked to has none.
    tab.on("filechooser", lambda _: None)
    tab.on("request", lambda asked: asked.url.startswith(door.address) or faults.append(asked.url))
    tab.goto(door.address)
    try:
        yield tab
        assert faults == []
    finally:
        context.close()


def said(tab: Any, text: str) -> None:
    """Wait until the page says this."""
    tab.locator("#status", has_text=text).wait_for(timeout=300_000)


def drop(tab: Any, files: Mapping[str, Path]) -> float:
    """Drop files under these names, as a hand does; return the seconds until all are read."""
    given = {name: base64.b64encode(path.read_bytes()).decode() for name, path in files.items()}
    held = tab.evaluate_handle(
        """(given) => { const held = new DataTransfer();
        for (const [name, text] of Object.entries(given))
          held.items.add(new File([Uint8Array.from(atob(text), (c) => c.charCodeAt(0))], name));
        return held; }""",
        given,
    )
    began = time.perf_counter()
    tab.dispatch_event("#drop", "drop", {"dataTransfer": held})
    said(tab, f"{len(files)} of {len(files)} read.")
    tab.locator("#sheet h1, #rows tr").first.wait_for()
    return time.perf_counter() - began


def look(
    tab: Any, name: str, pictures: Path | None = None, widths: Sequence[int] = WIDTHS
) -> list[str]:
    """Return what axe finds and what is too wide, light and dark; keep pictures, and the print."""
    from axe_playwright_python.sync_playwright import Axe

    found = list[str]()
    for width in (*widths, PAPER):
        printed = width == PAPER
        tab.set_viewport_size({"width": width, "height": 800})
        tab.emulate_media(media="print" if printed else "screen")
        for scheme in ("print",) if printed else ("light", "dark"):
            at = f"{name}-{width}-{scheme}"
            if not printed:
                tab.emulate_media(color_scheme=scheme)
                seen = Axe().run(tab, options={"preload": False}).response["violations"]
                found += [f"{at}: {fault['id']}" for fault in seen]
            if pictures:
                tab.screenshot(path=pictures / f"{at}.png", full_page=True)
        if tab.evaluate("() => document.documentElement.scrollWidth") > width:
            found.append(f"{name}-{width}: wider than its window, or its paper")
    tab.emulate_media(media="screen")
    return found


def tabbed(tab: Any, goal: Any) -> int:
    """Press Tab until this has the focus; return how often."""
    for times in range(KEYS):
        if goal.evaluate("(goal) => goal === document.activeElement"):
            return times
        tab.keyboard.press("Tab")
    raise AssertionError(f"{KEYS} keys do not lead to {goal}")


def by_keys(tab: Any) -> list[int]:
    """Choose the examples, open a sheet, set a time, go back, save the table; count the Tabs."""
    counts = [tabbed(tab, tab.get_by_label("Drop recordings"))]
    with tab.expect_file_chooser() as chooser:
        tab.keyboard.press("Enter")
    chooser.value.set_files(EXAMPLES)
    said(tab, "2 of 2 read.")
    counts.append(tabbed(tab, tab.get_by_role("link", name=EXAMPLES[0].name)))
    tab.keyboard.press("Enter")
    assert tab.locator("#one").evaluate("(one) => one === document.activeElement")
    assert tab.locator("#sheet h1").inner_text() == EXAMPLES[0].name
    counts.append(tabbed(tab, tab.get_by_label("From, s")))
    tab.keyboard.type("10")
    tab.keyboard.press("Enter")
    said(tab, "Read again.")
    assert "--start=10" in tab.locator("#command").inner_text()
    counts.append(tabbed(tab, tab.get_by_role("button", name="All recordings")))
    tab.keyboard.press("Enter")
    counts.append(tabbed(tab, tab.get_by_role("link", name="class.csv")))
    assert tab.locator("#commands").inner_text().count("\n") == 1, "each in a way of its own"
    with tab.expect_download() as download:
        tab.keyboard.press("Enter")
    table = Path(download.value.path()).read_text("utf-8").splitlines()
    assert [line.split(",")[0] for line in table[1:3]] == [file.name for file in EXAMPLES]
    return counts


def beside_fit(tab: Any, file: Path) -> tuple[list[str], int, int]:
    """Return T and Q of the line to copy, how many lines are those of `pendpipe fit`, of how many.

    The lines are the rows of the sheet's list and the line to copy.
    """
    words = [sys.executable, "-m", "pendpipe", "fit", str(file)]
    told = subprocess.run(words, capture_output=True, text=True, check=False).stdout
    copied = re.findall(r"^(Copy): (.*)$", told, flags=re.MULTILINE)
    found = re.findall(r"^  (\S.*?)  +(\S.*)$", told, flags=re.MULTILINE) + copied
    fit = {title: " ".join(text.split()) for title, text in found}  # as a page shows spaces
    rows = tab.locator("#sheet dl").first.locator("div").all()
    sheet = {row.locator("dt").inner_text(): row.locator("dd").inner_text() for row in rows}
    sheet["Copy"] = tab.locator("#sheet .copy").inner_text()
    same = sum(title in fit and text.startswith(fit[title]) for title, text in sheet.items())
    quoted = sheet["Copy"].partition(" (from")[0].split("; ")[:2]
    return quoted, same, len(sheet)


def main() -> int:
    """Drop, print what came of it, and keep the pictures."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("parts", nargs="*", help="sheets, many, keys; all, if none is named")
    parser.add_argument("--number", type=int, default=30, help="files that are dropped at once")
    parser.add_argument("--pictures", type=Path, default=ROOT / ".evidence" / "open")
    told = parser.parse_args()
    parts, pictures = told.parts or ("sheets", "many", "keys"), told.pictures
    pictures.mkdir(parents=True, exist_ok=True)
    files = {name: RECORDINGS / path for name, path in FILES.items()}
    files = {name: path for name, path in files.items() if path.exists()}
    files = files or {path.stem: path for path in EXAMPLES}
    missed = 0
    with tempfile.TemporaryDirectory() as place, serving(Path(place)) as door, browser() as chrome:
        with opened(chrome, door) as tab:
            found = look(tab, "empty", pictures)
        if "sheets" in parts:
            print(head("instrument", "drop to sheet, s", "period", "Q", "lines as in `fit`"))
            for name, path in files.items():
                with opened(chrome, door) as tab:
                    taken = drop(tab, {path.name: path})
                    quoted, same, of = beside_fit(tab, path)
                    cells = [f"{taken:.1f}", *quoted, f"{same} of {of}"]
                    print(table_row(name, cells), flush=True)
                    found += look(tab, path.stem, pictures)
                    missed += of - same
        if "many" in parts:
            with opened(chrome, door) as tab:
                copies = enumerate(islice(cycle(files.values()), told.number), 1)
                taken = drop(tab, {f"{number:02d}-{path.name}": path for number, path in copies})
                found += look(tab, "table", pictures)
            print(f"{told.number} files at once: {taken:.1f} s to the table")
        if "keys" in parts:
            with opened(chrome, door) as tab:
                counts = "-".join(map(str, by_keys(tab)))
            print(f"keys: {counts} Tabs to the choice, a sheet, a time, back, the table's file")
    print(f"axe, and what is too wide: {len(found)} findings", *found, sep="\n")
    print(f"({commit()}, load {os.getloadavg()[0]:.0f})")
    return int(bool(found or missed))


if __name__ == "__main__":
    sys.exit(main())
