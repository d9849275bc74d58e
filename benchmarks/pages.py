"""The campaign's page in a real browser: size, time, memory and sheets by the number of records.

``python -m benchmarks.pages [RESULTS]`` takes the records of a finished campaign over and over.
Printed are the CPU time in which a page is made, the time until it is drawn and zoomed, and how
long the browser's main thread was busy until then, whatever else the machine does meanwhile.
The browser is the system's Chromium, driven by Playwright with the network cut.
"""

import json
import os
import re
import shutil
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import yaml

from pendpipe.report.page import OWN_PAGE, render

COUNTS = (27, 100, 1000)
BROWSERS = ("chromium", "chromium-browser", "google-chrome", "chrome")
SETTLED = """() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(() =>
  done(performance.now()))))"""
"""Milliseconds from the start of the navigation until what was loaded has been drawn."""


def installed() -> str | None:
    """The system's Chromium."""
    names = (os.environ.get("CHROMIUM", ""), *BROWSERS)
    return next((path for name in names if name and (path := shutil.which(name))), None)


@contextmanager
def browser() -> Iterator[Any]:
    """Chromium as it is installed."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as driver:
        # A container's user may be root, which Chromium's sandbox refuses.
        running = driver.chromium.launch(executable_path=installed(), args=["--no-sandbox"])
        try:
            yield running
        finally:
            running.close()


def repeated(results: Path, home: Path, count: int) -> tuple[Path, dict[str, Any]]:
    """Make a campaign of so many records of another; return its page and its own pages' sizes."""
    comparison = json.loads((results / "comparison.json").read_text())
    entries, names = comparison["records"], [entry["record"] for entry in comparison["records"]]
    comparison["records"] = []
    for index in range(count):
        like, again = entries[index % len(entries)], index // len(entries)
        name = f"{like['record']}-{again}" if again else like["record"]
        comparison["records"].append({**like, "record": name})
        for path in (results / like["record"]).rglob("*"):
            place = home / name / path.relative_to(results / like["record"])
            if path.is_file() and path.name != OWN_PAGE:
                place.parent.mkdir(parents=True, exist_ok=True)
                place.symlink_to(path.resolve())
    own = {}

    def own_page(record: str, page: str) -> None:
        (home / record / OWN_PAGE).write_text(page)
        own[record] = len(page.encode())

    settings = yaml.safe_load(Path("config/config.yaml").read_text())
    numbers = json.loads((results / "campaign.json").read_text())
    page = home / "report.html"
    figures = results / "figures"
    page.write_text(
        render(settings, comparison, numbers, home, figures, home=page, own_page=own_page)
    )
    assert len({entry["record"] for entry in comparison["records"]}) == count, names
    return page, own


def sheets(pdf: bytes) -> int:
    """How many pages a PDF of Chromium has."""
    return len(re.findall(rb"/Type\s*/Page\b(?!s)", pdf))


def measured(page: Path, chromium: Any) -> dict[str, Any]:
    """Open a page and zoom in on its first waveform."""
    context = chromium.new_context(offline=True)
    tab = context.new_page()
    metrics = context.new_cdp_session(tab)
    metrics.send("Performance.enable", {"timeDomain": "threadTicks"})
    tab.goto(page.as_uri())
    ready_ms = tab.evaluate(SETTLED)
    told = metrics.send("Performance.getMetrics")["metrics"]
    busy_s = next(each["value"] for each in told if each["name"] == "TaskDuration")
    zoom_ms = None
    if tab.locator("[data-view]").count():
        began = time.perf_counter()
        tab.evaluate("document.querySelector('[data-view]').closest('details').open = true")
        tab.locator("[data-view]").first.press("+")
        tab.wait_for_selector("[data-shown]")
        zoom_ms = 1e3 * (time.perf_counter() - began)
    found = {
        "MB": page.stat().st_size / 1e6,
        "ready_ms": ready_ms,
        "zoom_ms": zoom_ms,
        "busy_ms": 1e3 * busy_s,
        "nodes": tab.evaluate("document.querySelectorAll('*').length"),
        "sheets": sheets(tab.pdf(prefer_css_page_size=True)),
    }
    context.close()
    return found


def main() -> None:
    """Print a line for each number of records."""
    results = Path(sys.argv[1] if len(sys.argv) > 1 else "results").resolve()
    if installed() is None:
        sys.exit("no Chromium is installed")
    print("records   MB  CPU s    ready ms  zoom ms  busy ms  elements  sheets  own pages (MB)")
    for count in COUNTS:
        with tempfile.TemporaryDirectory() as folder, browser() as chromium:
            began = time.process_time()
            page, own = repeated(results, Path(folder), count)
            made_s = time.process_time() - began
            found = measured(page, chromium)
            zoom = "–" if found["zoom_ms"] is None else f"{found['zoom_ms']:.0f}"
            print(
                f"{count:7} {found['MB']:5.2f} {made_s:8.1f} {found['ready_ms']:9.0f} {zoom:>8}"
                f" {found['busy_ms']:9.0f} {found['nodes']:9} {found['sheets']:7}"
                f"  {len(own)} ({sum(own.values()) / 1e6:.0f})",
                flush=True,
            )


if __name__ == "__main__":
    main()
