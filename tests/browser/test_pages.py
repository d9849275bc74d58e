"""Pages in a real browser, from a file, with the network cut."""

import csv
import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pendpipe.recording import read_plain
from pendpipe.report.page import BUDGET_BYTES

pytestmark = pytest.mark.slow
SETTLED = """() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(() =>
  done(performance.now()))))"""
"""Waits until what was loaded has been drawn."""
SENSOR = 3.85
"""Of the example, in V/rad."""
OF_THE_THEME = ("aria-required-attr", "region")
"""Sphinx gives the captions of its table of contents no level, furo an icon no landmark."""
KINDS = ("few records", "record", "recording", "class", "documents")
"""One of each; of few records, or of many, the page has the same parts."""


@contextmanager
def opened(chromium: Any, page: Path, width: int = 1280, **look: Any) -> Iterator[Any]:
    """A page, whose every request beside its own file and every complaint is a fault."""
    if not page.is_file():
        pytest.skip(f"{page.name}: make docs has not been run")
    context = chromium.new_context(
        offline=True, viewport={"width": width, "height": 800}, accept_downloads=True, **look
    )
    tab = context.new_page()
    faults: list[str] = []
    tab.on("console", lambda told: faults.append(f"{told.type}: {told.text}"))
    tab.on("pageerror", lambda error: faults.append(str(error)))
    tab.on("request", lambda asked: asked.url.startswith("http") and faults.append(asked.url))
    tab.goto(page.as_uri())
    tab.evaluate(SETTLED)
    try:
        yield tab
        assert faults == []
    finally:
        context.close()


@pytest.fixture
def campaign_tab(chromium: Any, pages: dict[str, Path]) -> Iterator[Any]:
    with opened(chromium, pages["campaign"]) as tab:
        yield tab


@pytest.mark.parametrize("kind", KINDS)
def test_a_page_opens_without_network_and_axe_finds_nothing(
    chromium: Any, pages: dict[str, Path], kind: str
) -> None:
    """In the dark its colours alone are others."""
    from axe_playwright_python.sync_playwright import Axe

    with opened(chromium, pages[kind], color_scheme="light") as tab:
        tab.evaluate("document.querySelectorAll('details').forEach((d, i) => { d.open = i < 3; })")
        off = OF_THE_THEME if kind == "documents" else ()
        every = {"rules": {name: {"enabled": False} for name in off}}
        for scheme, rules in (("light", every), ("dark", {"runOnly": ["color-contrast"]})):
            tab.emulate_media(color_scheme=scheme)
            # Preloading would ask for style sheets, which no file may.
            found = Axe().run(tab, options={**rules, "preload": False})
            assert found.violations_count == 0, found.generate_report()
            colour = tab.evaluate("getComputedStyle(document.body).backgroundColor")
            brightness = sum(int(v) for v in colour.strip("rgba()").split(",")[:3]) / 3
            assert (brightness < 60) == (scheme == "dark"), colour


@pytest.mark.parametrize("kind", [*KINDS, "campaign", "many records"])
def test_a_phone_needs_not_scroll_sideways(
    chromium: Any, pages: dict[str, Path], kind: str
) -> None:
    with opened(chromium, pages[kind], 390) as tab:
        tab.evaluate("document.querySelectorAll('details').forEach((d) => { d.open = true; })")
        assert tab.evaluate("document.documentElement.scrollWidth") <= 390


@pytest.mark.parametrize("kind", ["campaign", "many records", "record", "recording", "class"])
def test_a_page_keeps_its_bytes_and_its_sheets(
    chromium: Any, pages: dict[str, Path], kind: str
) -> None:
    with opened(chromium, pages[kind]) as tab:
        assert pages[kind].stat().st_size < BUDGET_BYTES
        assert len(re.findall(rb"/Type\s*/Page\b(?!s)", tab.pdf(prefer_css_page_size=True))) <= 10


def names(tab: Any) -> list[str]:
    """The records that the table shows, in its order."""
    return list(tab.locator("#table tbody tr:not([hidden]) th").all_inner_texts())


def test_a_column_s_head_sorts(campaign_tab: Any) -> None:
    head = campaign_tab.get_by_role("button", name="f (Hz)")
    head.click()
    rows = "[...document.querySelectorAll('#table tbody tr')]"
    values = campaign_tab.evaluate(f"{rows}.map((r) => r.querySelector('.n').dataset.v)")
    known = [float(value) for value in values if value]
    assert known == sorted(known)
    assert len(known) == 26
    assert values[-1] == "", "the refused one last"
    head.click()
    assert campaign_tab.locator("th[aria-sort=descending]").count() == 1


@pytest.mark.parametrize(
    ("filter_", "left", "said"),
    [
        ("air", 12, "12 of 27 records"),
        ("air f>0.4", None, "of 27 records"),
        ("qlimit>100", 0, "No column is called qlimit; there are f, a, b, c, q-limit"),
        ("watre", 0, "No row holds watre"),
    ],
)
def test_the_filter_filters_and_says_what_it_does_not_know(
    campaign_tab: Any, filter_: str, left: int | None, said: str
) -> None:
    campaign_tab.get_by_label("Show only").fill(filter_)
    shown = names(campaign_tab)
    assert all(name.startswith("air") for name in shown)
    assert left is None or len(shown) == left
    assert said in campaign_tab.locator("#shown").inner_text()


def saved(tab: Any, button: Any) -> list[list[str]]:
    """The table that a button saves."""
    with tab.expect_download() as download:
        button.click()
    with Path(download.value.path()).open(encoding="utf-8") as stream:
        return list(csv.reader(stream))


def test_the_zoom_by_keys_shows_and_saves_the_readings_to_the_count(
    campaign_tab: Any, campaign: Path
) -> None:
    """The first key press, while the readings are unpacked, counts too."""
    campaign_tab.locator("summary").first.click()
    wave = campaign_tab.locator("[data-view]").first
    whole = wave.locator(".plot").inner_html()
    wave.focus()
    for key in ("+", "+", "ArrowRight"):
        campaign_tab.keyboard.press(key)
    low, high, *_ = (float(v) for v in wave.get_attribute("data-view").split())
    middle, span = 0.5 * (low + high), high - low
    begin, end = middle + np.array([-0.125, 0.125]) * span + 0.0625 * span
    campaign_tab.wait_for_function(
        "([f, a]) => f.dataset.shown && Math.abs(f.dataset.shown.split(' ')[0] - a) < 1e-6",
        arg=[wave.element_handle(), begin],
    )
    head, *rows = saved(campaign_tab, wave.get_by_role("button", name="Save data"))
    assert head == ["Time (s)", "Angle (mrad)"]
    time_s, angle_mrad = np.array(rows, dtype=float).T
    recording = read_plain(campaign / "water-high-1" / "recording.csv")
    inside = (recording.time_s >= begin) & (recording.time_s < end)
    assert time_s == pytest.approx(recording.time_s[inside], abs=1e-6)
    angles = 1e3 / SENSOR * recording.values
    # These have no step, and are kept to 16 bits.
    assert angle_mrad == pytest.approx(angles[inside], abs=0.51 * np.ptp(angles) / 65_535)
    campaign_tab.keyboard.press("Tab")
    wave.focus()
    campaign_tab.keyboard.press("0")
    campaign_tab.wait_for_function(
        "([f, h]) => f.querySelector('.plot').innerHTML === h", arg=[wave.element_handle(), whole]
    )


def test_the_zoom_by_mouse_takes_the_stretch_that_was_drawn_over(campaign_tab: Any) -> None:
    campaign_tab.locator("summary").first.click()
    wave = campaign_tab.locator("[data-view]").first
    box = wave.locator("svg svg").bounding_box()
    wave.scroll_into_view_if_needed()
    box = wave.locator("svg svg").bounding_box()
    y = box["y"] + box["height"] / 2
    campaign_tab.mouse.move(box["x"] + 0.2 * box["width"], y)
    campaign_tab.mouse.down()
    campaign_tab.mouse.move(box["x"] + 0.3 * box["width"], y)
    campaign_tab.mouse.up()
    campaign_tab.wait_for_selector("[data-shown]")
    low, high, *_ = (float(v) for v in wave.get_attribute("data-view").split())
    shown = np.array(wave.get_attribute("data-shown").split(), dtype=float)
    assert (shown - low) / (high - low) == pytest.approx([0.2, 0.3], abs=0.01)


def test_a_figure_and_what_the_table_shows_can_be_saved(campaign_tab: Any) -> None:
    figure = campaign_tab.locator("#fig09")
    rows = saved(campaign_tab, figure.get_by_role("button", name="Save data"))
    assert ["of", "x", "Limiting quality factor $Q$", "sd"] in rows
    assert len(rows) > 100
    campaign_tab.get_by_label("Show only").fill("water-low")
    head, *rows = saved(campaign_tab, campaign_tab.get_by_role("button", name="Download"))
    assert head[0] == "Record"
    assert {row[0].rpartition("-")[0] for row in rows} == {"water-low"}


def test_keys_alone_reach_the_results_and_every_section(campaign_tab: Any) -> None:
    campaign_tab.keyboard.press("Tab")
    assert campaign_tab.evaluate("document.activeElement.className") == "skip"
    campaign_tab.keyboard.press("Enter")
    assert campaign_tab.url.endswith("#main")
    for target in campaign_tab.eval_on_selector_all("nav a", "e => e.map((a) => a.hash)"):
        assert campaign_tab.locator(target).count() == 1


def test_a_row_of_many_leads_to_its_record_s_own_page(
    chromium: Any, pages: dict[str, Path]
) -> None:
    with opened(chromium, pages["many records"]) as tab:
        assert tab.locator("details .record").count() == 2 * 4 + 1, "refused or amiss, four times"
        tab.get_by_role("link", name="water-high-1", exact=True).click()
        assert tab.url.endswith("pages/water-high-1.html")
        assert tab.locator("[data-view]").count() == 1
        tab.get_by_role("link", name="Nonlinear damping").click()
        assert tab.url.endswith("report.html")
