"""The page of a campaign, and its parts."""

import base64
import copy
import hashlib
import json
import re
import zlib
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from pendpipe import fit, turning_points
from pendpipe.cli import main
from pendpipe.figures.data import Decay, error, number, typical_record
from pendpipe.files import without_folders
from pendpipe.physics import sphere_in_tank
from pendpipe.quantities import with_error
from pendpipe.recording import Recording
from pendpipe.report.charts import (
    Axis,
    Chart,
    areas,
    extremes,
    line,
    pack,
    quality_by_amplitude,
    waveform,
)
from pendpipe.report.page import BUDGET_BYTES, inline_svg, render
from pendpipe.report.tables import (
    STATES,
    as_text,
    findings,
    grouped_warnings,
    headline,
    health,
    table_of_records,
)
from pendpipe.templates import render as filled

# The page is whole, safe, self-contained, and holds every record.

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


@pytest.mark.slow
def test_the_page_is_well_formed_and_its_names_are_unique(page: str) -> None:
    outline = Outline(page)
    assert len(outline.ids) == len(set(outline.ids))
    targets = [ref[1:] for ref in outline.references if ref.startswith("#")]
    assert targets
    assert set(targets) <= set(outline.ids)


def test_the_page_refers_to_nothing_outside_itself(page: str, example: Any) -> None:
    """Nor does it tell a folder of this machine."""
    assert not any(folder in page for folder in (str(example.folder), f"{Path.home()}/"))
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
    for place, entry in enumerate(example.content["records"], start=1):
        assert f'<a href="#record-{place}">{entry["record"]}</a>' in page
        assert f'id="record-{place}"' in page
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
    # More water than is told: 12 % above Eq. 16; (1.1165 - 1.1196)/0.0062 rounds to -0.5.
    assert cells == ["1.1165 ± 0.0062", "1.13 (176/156)", "−1.0 %", "1.12", "−0.5"]
    deeper = sphere_in_tank(
        0.019, 0.0375, 7.9e-4, surface_m=0.0375, length_m=0.23, width_m=0.11, off_centre_m=0.015
    )
    assert deeper.drag_factor == pytest.approx(1.12, abs=0.005)


def test_the_terminal_shows_the_headline_s_numbers(example: Any) -> None:
    """1 + a/δ of the typical record among them, beside the paper's and the hidden truth."""
    rows = headline(example.content, json.loads(example.campaign.read_text()))
    lines = as_text(rows).splitlines()
    assert all(row.found in line for row, line in zip(rows, lines, strict=True))
    drag = next(line for line in lines if line.startswith("Drag measured over Eq. 16"))
    assert re.search(r" 1\.1165 ± 0\.0062 +paper 1\.13 \(176/156\); truth 1\.12$", drag)
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
        "refused": "/home/someone/lab/run.csv, line 7: 'x' is not a number; mend the row",
    }
    text = rendered(example, content)
    assert "run.csv, line 7: &#39;x&#39; is not a number; mend the row" in text
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


def test_the_command_writes_the_page_whole_or_not_at_all(
    example: Any, tmp_path: Path, answer_of: Any
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
    assert answer_of([*words, str(tmp_path / "missing.json")], 2).err.count("\n") == 1
    assert not out.exists()
    said = answer_of([*words, str(example.summary)]).err
    Outline(out.read_text(encoding="utf-8"))
    assert f"{out}: {out.stat().st_size / 1e6:.1f} MB" in said


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
    for words in (f"missing: circular error in {found}", "looked for, not found", "second mode"):
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


@pytest.mark.slow
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
    assert '<a href="pages/record%200119.html">record 0119</a>' in page
    outline = Outline(own["record 0014"])
    assert "data-times" in own["record 0014"], "an own page zooms"
    assert "../report.html" in outline.references
    assert "../record%200014/fit.json" in outline.references


@pytest.mark.slow
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


# Parts of the page: charts, tables, numbers.


def part_of_the_page(template: str, comparison: dict[str, Any]) -> str:
    words = {"number": number, "error": error, "with_error": with_error}
    return filled("pendpipe.report", template, comparison=comparison, **words)


def entry(**changes: Any) -> dict[str, Any]:
    value = {"value": 1.0, "sd": 0.1, "unit": "", "at_bound": False}
    names = ("frequency", "a", "b", "c", "amplitude", "quality_factor_limit")
    return {
        "record": "r",
        "refused": None,
        "light": "green",
        "light_reason": "right",
        "turning_points": 9,
        **dict.fromkeys(names, value),
        **changes,
    }


@pytest.mark.parametrize(
    ("changes", "word"),
    [
        ({}, "green"),
        ({"light": "amber", "light_reason": "don't quote Q"}, "amber"),
        ({"light": "red", "light_reason": "the law contradicts the decay"}, "red"),
        ({"b": {"value": None, "sd": None}}, "red"),
        # Amplitudes by hand have no period; their light is that of the fit all the same.
        ({"frequency": {"value": None, "sd": None}}, "green"),
        ({"refused": "no decay"}, "refused"),
    ],
)
def test_the_page_shows_the_light_of_the_fit(changes: dict[str, Any], word: str) -> None:
    found = health(entry(**changes))
    assert found.word == word
    assert (found.symbol, found.colour) == STATES[word]
    assert found.reason


def test_states_differ_in_word_symbol_and_colour() -> None:
    assert len({symbol for symbol, _ in STATES.values()}) == len(STATES)
    assert len({colour for _, colour in STATES.values()}) == len(STATES)


@pytest.mark.parametrize(
    ("text", "kept"),
    [
        ("/home/rdp/data/a.csv, line 3: bad", "a.csv, line 3: bad"),
        (r"C:\lab\a.csv: bad", "a.csv: bad"),
        ("../shared/recordings/x/a.mat: bad", "a.mat: bad"),
        ("3.85 V/rad and 1/(rad s)", "3.85 V/rad and 1/(rad s)"),
        ("a.csv: volts and/or angle_rad", "a.csv: volts and/or angle_rad"),
    ],
)
def test_folders_are_left_out_and_units_are_not(text: str, kept: str) -> None:
    assert without_folders(text) == kept


def test_a_rate_at_its_bound_is_shown_as_a_limit() -> None:
    bound = {"value": 0.0, "sd": 0.1, "unit": "rad/s", "at_bound": True, "interval95": [0.0, 0.196]}
    columns, lines = table_of_records([entry(c=bound)], has_theory=True)
    assert lines[0]["cells"][[c.quantity for c in columns].index("c")].text == "< 0.2"


def test_angles_and_lengths_in_one_table_carry_their_own_units() -> None:
    lengths = {"value": 1.0, "sd": 0.1, "unit": "m/s"}
    angles = {"value": 2.0, "sd": 0.1, "unit": "rad/s"}
    columns, lines = table_of_records([entry(c=lengths), entry(c=angles)], has_theory=True)
    column = [c.quantity for c in columns].index("c")
    assert columns[column].unit == ""
    cells = [line["cells"][column] for line in lines]
    assert [cell.text for cell in cells] == ["1.00(10) m/s", "2.00(10) rad/s"]
    # What can be saved has all digits.
    assert [(cell.value, cell.sd) for cell in cells] == [("1.0", "0.1"), ("2.0", "0.1")]


def test_what_eq_17_leaves_of_nothing_is_not_printed() -> None:
    noise = {"value": 1e6, "sd": 9e5, "unit": ""}
    columns, _ = table_of_records([entry(quality_factor_viscous=noise)], has_theory=True)
    assert "quality_factor_viscous" not in [column.quantity for column in columns]


def test_two_figures_in_a_page_share_no_name_and_numbers_in_words_stay_whole() -> None:
    text = (
        '<?xml version="1.0"?><!DOCTYPE svg><svg xmlns:xlink="x" viewBox="0 0 9 9" width="9pt">'
        '<metadata>http://somewhere</metadata><defs><style type="text/css">*{}</style>'
        '<clipPath id="p"><path d="M 1.23456 2"/></clipPath></defs>'
        '<use xlink:href="#p" clip-path="url(#p)"/><text>3.84950</text></svg>'
    )
    one, two = (str(inline_svg(text, prefix, "A & B", "<what>")) for prefix in ("x", "y"))
    assert 'id="x-p"' in one
    assert 'href="#x-p"' in one
    assert "url(#x-p)" in one
    assert 'id="y-p"' in two
    assert "somewhere" not in one
    assert "<style" not in one
    assert "3.84950" in one
    assert 'd="M 1.23 2"' in one
    assert "A &amp; B" in one
    assert "&lt;what&gt;" in one


def test_warnings_that_differ_in_numbers_are_told_once() -> None:
    records = [
        entry(record=str(n), warnings=[f"chi^2 is {n}.5e+03 times the noise"]) for n in range(3)
    ]
    ((_, names),) = grouped_warnings(records)
    assert names == ["0", "1", "2"]


def test_shares_of_the_budget_are_of_the_variance() -> None:
    parts = [{"source": "small", "relative_sd": 0.03}, {"source": "large", "relative_sd": 0.04}]
    unknown = {"source": "hysteresis of one record", "relative_sd": None}
    text = part_of_the_page("budget.html", {"budget": [*parts, unknown]})
    rows = re.findall(r'<th scope="row">(\w+)</th>.* (\d+) %</td></tr>', text)
    assert rows == [("large", "64"), ("small", "36")]
    assert "hysteresis of one record" not in text


def test_findings_follow_the_numbers() -> None:
    exponent = {"value": 2.001, "sd": 0.001}
    factor = {"value": 1.002, "sd": 0.004, "unit": ""}
    comparison = {
        "hysteretic_coefficient": {"value": 1.0, "free_exponent": exponent},
        "theory_factor": factor,
    }
    air, water = findings(comparison)
    assert "internal friction of the structure gives" in air
    assert "is that of Eq. 16" in water
    exponent["value"], factor["value"] = 1.9, 1.12
    air, water = findings(comparison)
    assert "standard deviations from the square" in air
    assert "30 standard deviations from 1" in water


def test_two_records_of_one_frequency_have_no_local_exponent() -> None:
    """Between them comparison.json has null."""
    found = {"value": 0.5, "sd": 0.1, "local_slopes": [0.53, None, -0.2]}
    text = part_of_the_page("exponents.html", {"viscous_exponents": {"low": found}})
    assert "0.53, –, −0.20" in text


def unpack(text: str, kind: str) -> Any:
    """Undo the packing, as the script does: counts are ``"<i2"``, times ``"<i4"``."""
    numbers = np.frombuffer(zlib.decompress(base64.b64decode(text)), kind)
    for _ in range(2):
        numbers = np.cumsum(numbers, dtype=numbers.dtype)
    return numbers


def test_counts_of_a_converter_survive_the_packing_to_the_bit() -> None:
    random = np.random.default_rng(2)
    counts = random.integers(-32_768, 32_768, 5000)
    counts[:2] = -32_768, 32_767
    step = 20.0 / 2**16
    time = np.cumsum(random.uniform(0.5, 1.5, 5000)) / 60.0
    packed = pack(Recording(time, step * counts, "volts", resolution=step), 1.0)
    values = packed["origin"] + packed["step"] * unpack(packed["counts"], "<i2")
    assert np.array_equal(np.rint(values / step), counts)
    times = packed["begin"] + packed["tick"] * unpack(packed["times"], "<i4")
    assert times == pytest.approx(time, abs=1e-8 * (time[-1] - time[0]))


def test_readings_without_a_step_keep_sixteen_bits() -> None:
    angle = np.random.default_rng(3).normal(size=1000)
    packed = pack(Recording(np.arange(1000.0), angle, "angle_rad"), 1e3)
    values = packed["origin"] + packed["step"] * unpack(packed["counts"], "<i2")
    assert values == pytest.approx(1e3 * angle, abs=1e3 * np.ptp(angle) / 2**16)


@pytest.mark.parametrize(("periods_a_bucket", "falls"), [(1.0, True), (0.8, False)])
def test_the_band_of_a_pure_decay_falls_as_the_decay(periods_a_bucket: float, falls: bool) -> None:
    """Buckets of 1.6 s on a swing of 2 s would show notches that look like beats."""
    time = np.linspace(0.0, 400.0, 40_001)
    swing = np.exp(-0.004 * time) * np.cos(np.pi * time)
    middle, _, high = extremes(time, swing, int(200 / periods_a_bucket))
    assert bool(np.all(np.diff(high) < 0.0)) is falls
    # The middles of buckets: evenly spaced, half a bucket from either end.
    assert middle == pytest.approx((np.arange(len(middle)) + 0.5) * 400.0 / len(middle))


@pytest.mark.parametrize(
    ("low", "high", "logarithmic", "numbers"),
    [
        (0.0, 10.0, False, ["0", "2", "4", "6", "8", "10"]),
        (0.9, 110.0, True, ["1", "2", "5", "10", "20", "50", "100"]),
        (2.0, 19.0, True, ["5", "10", "15"]),
        (-4.0, 4.0, False, ["\N{MINUS SIGN}4", "\N{MINUS SIGN}2", "0", "2", "4"]),
        (2.0, 6.0, True, ["2", "3", "4", "5", "6"]),
    ],
)
def test_an_axis_has_round_numbers_where_they_lie(
    low: float, high: float, logarithmic: bool, numbers: list[str]
) -> None:
    """By 1, 2, 5 over more than a decade of a logarithmic axis; evenly else."""
    axis = Axis(low, high, 100.0, 300.0, "", logarithmic)
    places, texts = zip(*axis.ticks(), strict=True)
    assert list(texts) == numbers
    values = np.array([float(text.replace("\N{MINUS SIGN}", "-")) for text in texts])
    turned = [np.log(each) if logarithmic else each for each in (values, low, high)]
    expected = 100.0 + 200.0 * (turned[0] - turned[1]) / (turned[2] - turned[1])
    assert places == pytest.approx(expected, abs=0.05)


@pytest.mark.parametrize(("periods", "kind"), [(40, "thin"), (4000, "band")])
def test_readings_of_many_periods_are_drawn_as_a_band(periods: int, kind: str) -> None:
    """A line of each reading, or the area between the least and the largest of a period.

    It has a point in each pixel of the width, and the axis of Q holds every amplitude.
    """
    time = np.linspace(0.0, 2.0 * periods, 20 * periods)
    angle = 0.1 * np.exp(-time / time[-1]) * np.cos(np.pi * time)
    recording = Recording(time_s=time, angle_rad=angle)
    points = turning_points(recording)
    decay = Decay("a", points, fit(recording, points=points))
    name, path = waveform(recording, decay, np.nan).paths[0]
    assert name == kind
    assert path.count("L") + path.count("M") > 1000
    quality = quality_by_amplitude(decay)
    assert quality is not None
    milliradians = 1e3 * decay.amplitude_rad
    assert 0.9 * milliradians.min() < quality.x.low < milliradians.min()
    assert milliradians.max() < quality.x.high < 1.1 * milliradians.max()


def test_a_gap_interrupts_the_line() -> None:
    path = line(np.arange(5.0), np.array([1.0, 2.0, np.nan, 3.0, 4.0]))
    assert path == "M0.0,1.0L1.0,2.0M3.0,3.0L4.0,4.0"


def test_a_band_is_a_closed_area_for_each_stretch_without_a_gap() -> None:
    low = np.array([0.0, 0.0, np.nan, 1.0, 1.0, 1.0])
    found = list(areas(np.arange(6.0), low, low + 2.0))
    assert found == [
        "M0.0,2.0L1.0,2.0L1.0,0.0L0.0,0.0Z",
        "M3.0,3.0L4.0,3.0L5.0,3.0L5.0,1.0L4.0,1.0L3.0,1.0Z",
    ]


def test_a_chart_takes_the_bytes_of_its_table_and_of_its_paths() -> None:
    axis = Axis(0.0, 1.0, 0.0, 1.0, "")
    empty = Chart(axis, axis, []).size
    assert Chart(axis, axis, [("law", "M0,0"), ("dots", "M1,1L2")], csv="a,b").size == empty + 13
