"""No cell that comes from a file or its name is a formula, and each reads back as it was."""

import csv
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given, strategies as st
from openpyxl import load_workbook

import pendpipe as pp
from pendpipe import cli
from pendpipe.analysis.turning_points.table import read_turning_points, write_turning_points
from pendpipe.cells import inert, original
from pendpipe.recording import Recording, read_plain, write_plain
from pendpipe.report.class_table import latex

SIGNS = tuple("=+-@")
NAMES = (
    "=1+1;=2.csv",
    "@SUM(1+1).csv",
    "-2+3+cmd|' C calc'!A0.csv",
    "+1 \x07.csv",
    "'=1.csv",
    "plain.csv",
)


def is_number(text: str) -> bool:
    try:
        return bool(text.strip()) and float(text) == float(text)
    except ValueError:
        return False


def is_formula(cell: str) -> bool:
    return cell.lstrip().startswith(SIGNS) and not is_number(cell)


@given(st.text(alphabet="=+-@'a1.e ,;\t\n", max_size=12))
@example("-0.0012")
@example("-0.0012;=1")
@example("-1+cmd")
def test_no_part_of_a_text_is_a_formula_and_it_reads_back(text: str) -> None:
    """Wherever a spreadsheet splits it."""
    assert original(inert(text)) == text
    assert not any(is_formula(cell) for cell in re.split(r"[,;\t\r\n]", inert(text)))
    assert inert(text) == text or any(
        is_formula(cell.lstrip("' ")) for cell in re.split(r"[,;\t\r\n]", text)
    )


@pytest.fixture(scope="module")
def hostile(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder of recordings whose names and units are formulas."""
    folder = tmp_path_factory.mktemp("hostile")
    time_s = np.arange(900) / 30.0
    swing = 0.1 * np.exp(-0.01 * time_s) * np.cos(4.0 * time_s)
    rows = "".join(f"{t!r},{x!r}\n" for t, x in zip(time_s.tolist(), swing.tolist(), strict=True))
    for name in NAMES:
        (folder / name).write_text("time (s),angle (=1+1)\n" + rows, encoding="utf-8")
    return folder


@pytest.mark.slow
@pytest.mark.parametrize("form", ["csv", "xlsx", "html"])
def test_a_table_of_fits_holds_no_formula(
    hostile: Path, tmp_path: Path, form: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(hostile)
    out = tmp_path / f"class.{form}"
    assert cli.main(["fit", "--out", str(out), "--", *NAMES]) == 0
    if form == "xlsx":
        sheet = load_workbook(out).worksheets[0]
        cells = [cell for row in sheet for cell in row if cell.value is not None]
        assert not [cell for cell in cells if cell.data_type == "f"]
        rows = [[cell.value for cell in row] for row in sheet]
        named = {str(row[0]): row for row in rows}
        assert {name.replace("\x07", "?") for name in NAMES} <= set(named)
        assert named["plain.csv"][7] == "=1+1", "the unit of its head"
        # A sheet has one kind of number; a whole one is read as such.
        kinds = {type(each) for each in named["plain.csv"]}
        assert kinds - {int} == {str, float, type(None)}
    elif form == "csv":
        (head, *rows) = csv.reader(out.read_text(encoding="utf-8").splitlines())
        assert [original(row[0]) for row in rows] == list(NAMES)
        assert [cell for row in rows for cell in row if is_formula(cell)] == []
        assert {original(row[head.index("amplitude_unit")]) for row in rows} == {"=1+1"}
        # A minus sign alone makes no formula of a number.
        assert all(is_number(row[head.index("Q")]) for row in rows)
        # Where a decimal comma is usual, the same file is split at other signs.
        for line in out.read_text(encoding="utf-8").splitlines():
            assert not any(is_formula(cell) for cell in line.split(";"))
    else:
        cells = re.findall(r"<t[dh][^>]*>(.*?)</t[dh]>", out.read_text(encoding="utf-8"))
        assert any("SUM(1+1)" in cell for cell in cells)
        assert [cell for cell in cells if is_formula(re.sub("<.*?>", "", cell))] == []


@pytest.mark.parametrize(
    "text", ["[1] a", r"\input{/etc/passwd}", "a^^5cb", "$x$ & % # _ ~", "a\n\nb"]
)
def test_a_cell_is_no_command_of_latex(text: str) -> None:
    r"""A row that begins with a bracket would be the option of the ``\\`` above."""
    known = r"\\(?:[&%$#_{}]|textbackslash\{\}|textasciitilde\{\}|textasciicircum\{\})|\{\[\}"
    rest = re.sub(known, "", latex(text))
    assert not re.search(r"[\\&%$#_{}~^\[\n]", rest), rest


def test_what_a_head_says_reads_back_and_is_no_formula(tmp_path: Path) -> None:
    """A line of remarks is split like any other."""
    told = {"made with": "x,=1+1", "operator": "-2+3, @SUM(1)", "depth": "-0.0012"}
    time_s = np.arange(900) / 30.0
    swing = 0.1 * np.exp(-0.01 * time_s) * np.cos(4.0 * time_s)
    path, table = tmp_path / "a.csv", tmp_path / "points.csv"
    write_plain(path, Recording(time_s, swing, "angle_rad", metadata=told))
    write_turning_points(table, replace(pp.turning_points(path), metadata=told))
    for file, found in (
        (path, read_plain(path).metadata),
        (table, read_turning_points(table).metadata),
    ):
        cells: list[Any] = re.split("[,\n]", file.read_text(encoding="utf-8"))
        assert [cell for cell in cells if is_formula(cell)] == []
        assert found.items() >= told.items()


def test_two_files_of_one_name_are_told_apart_in_a_table(tmp_path: Path) -> None:
    files = [tmp_path / name / "decay.csv" for name in ("left", "right")]
    time_s = np.arange(900) / 30.0
    for file in files:
        file.parent.mkdir()
        write_plain(
            file, Recording(time_s, np.cos(4.0 * time_s) * np.exp(-0.01 * time_s), "angle_rad")
        )
    page = tmp_path / "class.html"
    assert cli.main(["fit", *map(str, files), "--out", str(page)]) == 0
    assert {"left/decay.csv", "right/decay.csv"} <= set(
        re.findall("<th[^>]*>([^<]*)</th>", page.read_text())
    )
