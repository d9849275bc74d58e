"""The page of `pendpipe open` in a real browser: from a dropped file to its sheet."""

import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from benchmarks.open import EXAMPLES, by_keys, drop, look, opened, said, serving

from pendpipe.commands.open import Door

pytestmark = pytest.mark.slow
STRING = EXAMPLES[1]
CUT = """[...document.querySelectorAll("[placeholder]")].filter((field) => {
  const style = getComputedStyle(field), pen = document.createElement("canvas").getContext("2d");
  pen.font = style.font;
  const room = field.clientWidth - parseFloat(style.paddingLeft) - parseFloat(style.paddingRight);
  return pen.measureText(field.placeholder).width > room;
}).map((field) => field.name)"""
"""Fields whose placeholder has no room."""


@pytest.fixture(scope="module")
def door(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Door]:
    with serving(tmp_path_factory.mktemp("open")) as door:
        yield door


def test_what_is_dropped_becomes_a_sheet_and_a_click_takes_a_part(
    chromium: Any, door: Door
) -> None:
    with opened(chromium, door) as tab:
        drop(tab, {STRING.name: STRING})
        assert tab.locator("#sheet h1").inner_text() == "string-pendulum.csv"
        assert tab.evaluate(CUT) == []
        assert "T0 = (2.00601" in tab.locator("#sheet .copy").inner_text()
        tab.locator("#picture").scroll_into_view_if_needed()
        box = tab.locator("#picture").bounding_box()
        left, width = box["x"] + box["width"] * 86 / 800, box["width"] * 706 / 800
        tab.mouse.click(left + 0.25 * width, box["y"] + 40)
        said(tab, "Now click where the part ends.")
        tab.mouse.click(left + 0.75 * width, box["y"] + 40)
        said(tab, "Read again.")
        words = tab.locator("#command").inner_text().split()
        times = [float(word.partition("=")[2]) for word in words if "st" in word and "=" in word]
        assert times == pytest.approx([0.25 * 119.967, 0.75 * 119.967], abs=0.3)
        assert tab.locator("#picture rect").count() == 2
        tab.get_by_label("Length, m").fill("1.0")
        tab.get_by_label("Length, m").press("Enter")
        said(tab, "Read again.")
        gravity = tab.locator("#sheet dl").first.get_by_text("g", exact=True)
        assert gravity.locator("xpath=../dd").inner_text().startswith("9.81")
        with tab.expect_download() as download:
            tab.get_by_role("link", name="Save this sheet").click()
        assert download.value.suggested_filename == "string-pendulum.html"
        assert b"string-pendulum.csv" in Path(download.value.path()).read_bytes()


def test_the_last_choice_stands_however_late_an_earlier_one_is_answered(
    chromium: Any, door: Door, monkeypatch: pytest.MonkeyPatch
) -> None:
    made, go = door._made, threading.Event()

    def slow(folder: Path | None, words: list[str], file: str) -> Any:
        if "--no-diagnosis" not in words:
            assert go.wait(60)
        return made(folder, ["--no-diagnosis", "--length=0.3"], file)

    with opened(chromium, door) as tab:
        drop(tab, {STRING.name: STRING})
        monkeypatch.setattr(door, "_made", slow)
        tab.get_by_label("with a diagnosis").check()
        tab.get_by_role("button", name="Read again").click()
        tab.get_by_label("with a diagnosis").uncheck()
        tab.get_by_label("Length, m").fill("0.3")
        tab.get_by_role("button", name="Read again").click()
        said(tab, "Read again.")
        with tab.expect_response(lambda answer: "/read/" in answer.url) as late:
            go.set()
        late.value.finished()
        tab.wait_for_timeout(200)
        assert "--no-diagnosis --length=0.3" in tab.locator("#command").inner_text()


def test_a_class_by_keys_alone(chromium: Any, door: Door) -> None:
    """Choose files, open a row, set a time, go back, save the table, take one out."""
    with opened(chromium, door) as tab:
        by_keys(tab)
        tab.get_by_role("link", name="rod-pendulum.csv").press("Enter")
        tab.get_by_role("button", name="Take this one out").press("Enter")
        said(tab, "1 of 1 read.")
        assert tab.locator("#sheet h1").inner_text() == "string-pendulum.csv"


def test_axe_finds_nothing_and_a_phone_needs_not_scroll(chromium: Any, door: Door) -> None:
    """Empty, with a sheet, with a table; in the light and in the dark."""
    with opened(chromium, door, 390) as tab:
        assert look(tab, "", widths=[390]) == []
        tab.get_by_label("Drop recordings").set_input_files(EXAMPLES)
        said(tab, "2 of 2 read.")
        assert look(tab, "", widths=[390]) == []
        tab.get_by_role("link", name="rod-pendulum.csv").click()
        assert look(tab, "", widths=[390]) == []
        tab.emulate_media(media="print")
        assert not tab.locator(".door-only").first.is_visible()
        assert not tab.locator("#sheet footer").is_visible()
        assert tab.locator("#sheet .copy").is_visible()


def test_a_recording_is_shown_while_it_is_made(chromium: Any, tmp_path: Path) -> None:
    from pendpipe.acquisition.recorder import acquire_simulated, example_signal

    raw = tmp_path / "live.raw"
    options = {"channels": (1,), "rate_hz": 110.0, "duration_s": 90.0, "raw_path": raw}
    with serving(tmp_path, raw) as door, opened(chromium, door, 390) as tab:
        assert tab.locator("#now").inner_text() == "Nothing has come yet."
        acquire_simulated("di2108", example_signal(1, 3.85), clock_scale=200.0, **options)
        tab.locator("#now", has_text="of 1 min 30 s").wait_for()
        assert len(tab.locator("#last path").last.get_attribute("d")) > 1000
        assert look(tab, "live", widths=[390]) == []


def test_what_is_refused_is_said_with_its_reason(chromium: Any, door: Door, tmp_path: Path) -> None:
    (tmp_path / "no.csv").write_text("nothing\n")
    with opened(chromium, door) as tab:
        drop(tab, {"<i>no.csv": tmp_path / "no.csv"})
        assert tab.locator("#sheet h1").inner_text() == "<i>no.csv"
        assert "Refused: no reader knows this file" in tab.locator("#sheet").inner_text()
        assert not tab.locator("#picture").is_visible()
