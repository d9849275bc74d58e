"""The page is whole, safe, self-contained, and holds every record."""

import base64
import copy
import hashlib
import json
import re
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import pytest
import yaml

from pendpipe.cli import main
from pendpipe.figures.data import typical_record
from pendpipe.report.page import BUDGET_BYTES, render
from pendpipe.report.tables import as_text, headline

VOID = {"meta", "link", "br", "hr", "img", "input", "path", "use", "rect", "image", "line"}


class Outline(HTMLParser):
    """Reads a page strictly: tags must close in order; keeps what the tests ask for."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.ids: list[str] = []
        self.references: list[str] = []
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.feed(text)
        self.close()
        assert self.open == []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        values = dict(attrs)
        self.tags.append((tag, values))
        if values.get("id"):
            self.ids.append(str(values["id"]))
        self.references += [str(values[key]) for key in ("href", "src") if values.get(key)]
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.handle_starttag(tag, attrs)
        if tag not in VOID:
            self.open.pop()

    def handle_endtag(self, tag: str) -> None:
        if tag in VOID:
            return
        assert self.open, f"</{tag}> closes nothing"
        assert self.open.pop() == tag, f"</{tag}> closes another element"


def rendered(example: Any, content: dict[str, Any], **configuration: Any) -> str:
    return render(configuration, content, {}, example.folder, example.folder / "figures")


def test_the_page_is_well_formed_and_its_names_are_unique(page: str) -> None:
    outline = Outline(page)
    assert len(outline.ids) == len(set(outline.ids))
    targets = [ref[1:] for ref in outline.references if ref.startswith("#")]
    assert targets
    assert set(targets) <= set(outline.ids)


def test_the_page_refers_to_nothing_outside_itself(page: str) -> None:
    outline = Outline(page)
    assert all(ref.startswith(("#", "data:")) for ref in outline.references)
    assert not re.findall(r"url\((?!#)", page)
    assert not re.findall(r"@import|<link|<iframe|<object|<form", page)
    # The only addresses are the names of XML's namespaces, which nobody fetches.
    names = {"http://www.w3.org/2000/svg", "http://www.w3.org/1998/Math/MathML"}
    assert set(re.findall(r"https?://[^\s\"'<)]+", page)) <= names


def test_the_policy_forbids_all_but_the_page_s_own_script(page: str) -> None:
    policy = re.search(r'Content-Security-Policy" content="([^"]+)"', page)
    assert "default-src 'none'" in policy.group(1)
    scripts = re.findall(r"<script>(.*?)</script>", page, re.DOTALL)
    assert len(scripts) == 1
    digest = base64.b64encode(hashlib.sha256(scripts[0].encode()).digest()).decode()
    assert f"script-src 'sha256-{digest}'" in policy.group(1)
    assert not re.findall(r"<[^>]* on[a-z]+=", page)


def test_every_record_has_a_row_and_a_section(page: str, example: Any) -> None:
    for number, entry in enumerate(example.content["records"], start=1):
        assert f'<a href="#record-{number}">{entry["record"]}</a>' in page
        assert f'id="record-{number}"' in page
    table = page[page.index('<table id="table"') :]
    assert table[: table.index("</table>")].count("<tr>") == 1 + len(example.content["records"])


def test_the_page_keeps_its_budget(page: str, example: Any) -> None:
    assert len(page.encode()) < BUDGET_BYTES
    assert len(re.search(r"<script>(.*?)</script>", page, re.DOTALL).group(1)) < 11_000


def test_headline_has_campaign_paper_and_hidden_truth(page: str) -> None:
    assert "(3938.0 ± 6.0) s²" in page
    assert "3940 s²" in page
    row = re.search(r"<tr><th[^>]*>Drag measured over Eq. 16.*?</tr>", page, re.DOTALL)
    cells = re.findall(r"<td[^>]*>(.*?)</td>", row.group())
    # (1.1165 - 1.117)/0.0062 rounds to -0.1.
    assert cells == ["1.1165 ± 0.0062", "1.13 (176/156)", "−1.0 %", "1.117", "−0.1"]


def test_the_terminal_shows_the_headline_s_numbers(example: Any) -> None:
    """1 + a/δ of the typical record among them, beside the paper's and the hidden truth."""
    rows = headline(example.content, {"drag_factor": 1.117})
    lines = as_text(rows).splitlines()
    assert all(row.found in line for row, line in zip(rows, lines, strict=True))
    drag = next(line for line in lines if line.startswith("Drag measured over Eq. 16"))
    assert re.search(r" 1\.1165 ± 0\.0062 +paper 1\.13 \(176/156\); truth 1\.117$", drag)
    typical = typical_record(example.content)
    shown = next(line for line in lines if "1 + a/δ" in line)
    assert float(shown.split()[-1]) == pytest.approx(1.0 + typical["a_over_delta"], abs=0.05)


def test_a_simulated_campaign_says_so_and_a_real_one_does_not(example: Any, page: str) -> None:
    assert "27 of 27 records come from the simulated instrument" in page
    content = copy.deepcopy(example.content)
    for entry in content["records"]:
        entry["source"] = "run.csv"
    assert "simulated instrument" not in rendered(example, content)


def test_refused_records_stand_with_their_line_and_without_folders(example: Any) -> None:
    content = copy.deepcopy(example.content)
    content["records"][3] = {
        "record": "water-high-4",
        "source": "run.csv",
        "fluid": "",
        "branch": "",
        "geometry": "",
        "temperature_c": None,
        "refused": "/home/someone/lab/run.csv, line 7: 'x' is no number; mend the row",
    }
    text = rendered(example, content)
    assert "run.csv, line 7: &#39;x&#39; is no number; mend the row" in text
    assert "someone" not in text
    assert re.search(r'class="light none"><span aria-hidden="true">○</span> refused', text)
    Outline(text)


def test_hostile_names_stay_text(example: Any) -> None:
    content = copy.deepcopy(example.content)
    evil = '</title><script>alert(1)</script><img src=x onerror="alert(2)">'
    content["title"] = evil
    content["records"][0]["record"] = evil
    content["records"][1]["warnings"] = [evil]
    content["records"][2]["cuts"] = [{"start_s": 0.0, "stop_s": 1.0, "reason": evil}]
    content["provenance"]["packages"] = {evil: evil}
    text = rendered(example, content)
    outline = Outline(text)
    assert "<script>alert" not in text
    assert not [tag for tag, values in outline.tags if tag == "img" or "onerror" in values]
    assert text.count("<script>") == 1


def test_without_theory_only_the_records_are_told(example: Any, tmp_path: Path) -> None:
    bare = {
        "title": "Others",
        "has_theory": False,
        "typical_record": None,
        "calibration": None,
        "records": example.content["records"][:2],
        "curves": {},
        "tail": [],
        "provenance": example.content["provenance"],
        **dict.fromkeys(
            (
                "hysteretic_coefficient",
                "viscous_exponents",
                "theory_factor",
                "budget",
                "history_coefficient",
                "steady_stokes_percent",
                "checks",
            )
        ),
    }
    text = render({}, bare, {}, example.folder, tmp_path / "none")
    Outline(text)
    assert 'id="figures"' not in text
    assert "Linear misfit" in text
    assert "1.90 mrad" in text


def test_svgs_speak(page: str) -> None:
    drawings = [values for tag, values in Outline(page).tags if tag == "svg"]
    ids = set(Outline(page).ids)
    figures = [values for values in drawings if values.get("class") == "figure"]
    charts = [values for values in drawings if values.get("viewbox") == "0 0 640 190"]
    assert (len(figures), len(charts)) == (3, 28)  # 27 times Q(A), and one recording is there
    for values in figures:
        assert values["role"] == "img"
        assert set(str(values["aria-labelledby"]).split()) <= ids
    assert all(values["role"] == "img" and values["aria-label"] for values in charts)


def test_all_numbers_can_be_saved_without_a_script(page: str) -> None:
    found = re.search(r'download="campaign.json" href="data:application/json;base64,([^"]+)"', page)
    assert json.loads(base64.b64decode(found.group(1))) == {"schema_version": 1}


def test_the_same_results_make_the_same_page(page: str, example: Any) -> None:
    configuration = json.loads(example.campaign.read_text())
    again = render(
        configuration,
        example.content,
        {"schema_version": 1},
        example.folder,
        example.folder / "figures",
    )
    assert again == page


def test_no_folder_of_this_machine_is_told(page: str, example: Any) -> None:
    assert str(example.folder) not in page
    assert str(Path.home()) + "/" not in page


def test_the_command_writes_the_page_whole_or_not_at_all(
    example: Any, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "report.html"
    words = [
        "report",
        "--campaign",
        str(example.campaign),
        "--comparison",
        str(example.comparison),
        "--out",
        str(out),
        "--summary",
    ]
    assert main([*words, str(tmp_path / "missing.json")]) == 2
    assert capsys.readouterr().err.count("\n") == 1
    assert not out.exists()
    assert main([*words, str(example.summary)]) == 0
    Outline(out.read_text(encoding="utf-8"))


def test_the_configuration_alone_is_enough_for_the_command(example: Any, tmp_path: Path) -> None:
    """In YAML, as the campaign has it; comparison and numbers are those of its results."""
    configuration = tmp_path / "config.yaml"
    configuration.write_text(yaml.safe_dump(json.loads(example.campaign.read_text())))
    out = tmp_path / "report.html"
    assert main(["report", "--campaign", str(configuration), "--out", str(out)]) == 0
    Outline(out.read_text(encoding="utf-8"))


def diagnosed(name: str) -> dict[str, Any]:
    """A diagnosis that has found one of two effects which it can't tell apart."""
    model = {
        "parameters": {"amplitude": {"value": 0.25, "unit": "rad"}},
        "residual_rms_rad": 2.36e-3,
        "chi2_per_dof": 569.0,
    }
    effect = {
        "id": "circular-error",
        "name": "circular error",
        "equation": r"\ddot x = -\omega^2 \sin x",
        "probability": 0.7,
        "indistinguishable_from": [{"id": "cubic-stiffness", "probability": 0.25}],
    }
    before, after = (
        {"value": value, "sd": 0.0001, "unit": "1/s", "at_bound": False}
        for value in (0.0123, 0.0117)
    )
    change = {"quantity": "b", "amplitude_rad": None, "fitted": before, "with_missing": after}
    summary = {
        **dict.fromkeys(("where", "certainty", "candidates", "decide_by", "quote", "sentence"), ""),
        "headline": f"missing: circular error in {name}",
        "candidates": "cubic torque (25 %)",
        "missing": ["circular error"],
        "matters": "the fit misses the readings by 2.36 mrad",
        "consequence": [change],
        "excluded": ["second mode"],
    }
    return {
        "verdict": "missing-physics",
        "p_value": 1e-9,
        "noise_rms_rad": 1e-4,
        "baseline": model,
        "improved": {**model, "residual_rms_rad": 1e-4, "chi2_per_dof": 1.01},
        "effects": [effect],
        "statement": f"Eq. 8 leaves 2.36 mrad in {name}.",
        "summary": summary,
    }


def test_a_diagnosis_is_told_before_and_after_on_the_page(example: Any, tmp_path: Path) -> None:
    from pendpipe.diagnosis.result import not_analysable
    from pendpipe.files import write_json

    found, refused, none = (entry["record"] for entry in example.content["records"][:3])
    write_json(tmp_path / found / "diagnosis/diagnosis.json", diagnosed(found))
    empty = not_analysable("eq8", "two half cycles are too few")
    write_json(tmp_path / refused / "diagnosis/diagnosis.json", empty)
    page = render({}, example.content, {}, tmp_path, tmp_path)
    Outline(page)
    section = page[page.index('id="diagnosis"') : page.index('id="records"')]
    assert "<td>circular error; candidates: cubic torque (25 %)</td>" in section
    assert "2.36 mrad → 100 µrad" in section
    assert "missing physics" in section
    assert "not analysable" in section
    assert none not in section
    own = page[page.index('id="record-1"') : page.index('id="record-2"')]
    for words in (f"missing: circular error in {found}", "looked for and not it", "second mode"):
        assert words in own
    cells = r'<th scope="row">b</th><td>0\.01230\(10\) s⁻¹</td><td>0\.01170\(10\) s⁻¹</td>'
    assert re.search(cells, own)
    assert '<math xmlns="http://www.w3.org/1998/Math/MathML"' in own
    silent = render({"diagnose": {"enabled": False}}, example.content, {}, tmp_path, tmp_path)
    assert 'id="diagnosis"' not in silent


def many(example: Any, count: int) -> dict[str, Any]:
    """The campaign with its records over and over; the first misses values, the second failed."""
    entries = [
        {**example.content["records"][index % 27], "record": f"record {index:04}"}
        for index in range(count)
    ]
    entries[0] = {**entries[0], "refused": "no decay"}
    entries[1] = {**entries[1], "light": "red", "light_reason": "the law contradicts the decay"}
    return {**example.content, "records": entries, "typical_record": "record 0014"}


@pytest.mark.parametrize("relative", [False, True])
def test_beyond_a_hundred_records_only_those_that_need_a_look_are_drawn(
    example: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, relative: bool
) -> None:
    """The workflow gives paths below the folder that it runs in."""
    from pendpipe.files import write_json

    monkeypatch.chdir(tmp_path)
    folder = Path() if relative else tmp_path
    content, own = many(example, 120), {}
    for entry, like in zip(content["records"], example.content["records"] * 5, strict=False):
        if not entry.get("refused"):
            (tmp_path / entry["record"]).symlink_to(example.folder / like["record"])
    found = tmp_path / "record 0002"
    found.unlink()
    write_json(found / "diagnosis/diagnosis.json", diagnosed("record 0002"))
    home = folder / "report.html"
    page = render({}, content, {}, folder, folder, home=home, own_page=own.__setitem__)
    assert len(page.encode()) < BUDGET_BYTES
    assert re.findall(r'class="record" id="record-(\d+)"', page) == ["1", "2", "3"]
    assert list(own) == [f"record {index:04}" for index in range(1, 120)]
    assert '<a href="record%200119/record.html">record 0119</a>' in page
    outline = Outline(own["record 0014"])
    assert "data-times" in own["record 0014"], "an own page zooms"
    assert "../report.html" in outline.references
    assert "fit.json" in outline.references


def test_the_page_links_to_the_files_of_its_records(example: Any, tmp_path: Path) -> None:
    """Where they lie below it, and to nothing elsewhere."""
    places = example.folder / "report.html", tmp_path / "report.html"
    beside, apart = (
        render({}, example.content, {}, example.folder, example.folder / "figures", home=home)
        for home in places
    )
    linked = [ref for ref in Outline(beside).references if not ref.startswith(("#", "data:"))]
    assert "water-high-1/fit.json" in linked
    assert "comparison.json" in linked
    assert all((example.folder / ref).is_file() for ref in linked)
    assert all(ref.startswith(("#", "data:")) for ref in Outline(apart).references)


def test_equations_are_mathml(page: str) -> None:
    section = page[page.index('id="equations"') : page.index('id="glossary"')]
    assert section.count("<math") == 5
    assert "\\frac" not in section


def test_every_effect_s_equation_can_be_shown() -> None:
    from pendpipe.effects.catalogue import CATALOGUE
    from pendpipe.report.page import formula

    assert all("<math" in formula(effect.equation) for effect in CATALOGUE)
