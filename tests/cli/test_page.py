"""`pendpipe page` writes one file that needs nothing outside itself."""

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
    assert not re.findall(r'(?:src|href)="(?!#|data:image/png)[^"]*"', text)
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
    text = page.read_text(encoding="utf-8")
    assert "Nothing is missing" in text
    assert text.count("How to read it.") >= 3


def test_several_recordings_get_a_page_each_and_a_table_that_links_to_them(tmp_path: Path) -> None:
    bad = tmp_path / "bad.csv"
    bad.write_text("time_s,angle_rad\n0,0\n1,0\n", encoding="utf-8")
    out = tmp_path / "class.html"
    asked = ["page", str(ROD), str(ROD.with_name("string-pendulum.csv")), str(bad)]
    assert cli.main([*asked, "--no-diagnosis", "--out", str(out)]) == 0
    text = out.read_text(encoding="utf-8")
    links = re.findall(r'href="([^"]+)"', text)
    assert len(links) == 2
    assert all((tmp_path / link).is_file() for link in links)
    assert "refused" in text
    assert cli.main(["page", str(ROD), "--out", str(tmp_path / "rod.pdf")]) == 2
