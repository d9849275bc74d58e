"""`pendpipe page` writes one file that needs nothing outside itself."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from pendpipe import cli

ROD = Path(__file__).parents[2] / "examples/rod-pendulum.csv"


def test_one_page_holds_the_fit_and_refers_to_nothing_outside(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    page = tmp_path / "rod.html"
    assert cli.main(["page", str(ROD), "--out", str(page), "--no-diagnosis"]) == 0
    text = page.read_text(encoding="utf-8")
    assert "dry friction" in text
    assert "<svg" in text
    assert re.search(r"T0? = \(1\.14547\d+ ± 0\.0+\d+\) s", text)
    outside = re.findall(r'(?:src|href)="(?!#|data:image/png)[^"]*"', text)
    assert not outside
    assert str(tmp_path) not in text
    assert str(ROD.parent) not in text


def test_a_name_in_the_page_is_text_and_no_markup(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    odd = tmp_path / "<b>rod&.csv"
    odd.write_bytes(ROD.read_bytes())
    assert cli.main(["page", str(odd), "--out", "-", "--no-diagnosis"]) == 0
    assert "&lt;b&gt;rod&amp;.csv" in capsys.readouterr().out


def test_a_diagnosis_stands_on_the_page_unless_it_is_not_wanted(tmp_path: Path) -> None:
    page = tmp_path / "rod.html"
    assert cli.main(["page", str(ROD), "--out", str(page)]) == 0
    assert "What physics is missing" in page.read_text(encoding="utf-8")
