"""Parts of the page: charts, tables, numbers."""

import base64
import re
import zlib
from typing import Any

import numpy as np
import pytest

from pendpipe.figures.data import error, number
from pendpipe.files import without_folders
from pendpipe.quantities import with_error
from pendpipe.recording import Recording
from pendpipe.report.charts import extremes, line, pack
from pendpipe.report.page import inline_svg
from pendpipe.report.tables import (
    STATES,
    findings,
    grouped_warnings,
    health,
    table_of_records,
)
from pendpipe.templates import render


def part_of_the_page(template: str, comparison: dict[str, Any]) -> str:
    words = {"number": number, "error": error, "with_error": with_error}
    return render("pendpipe.report", template, comparison=comparison, **words)


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
    assert [line["cells"][column].text for line in lines] == ["1.00(10) m/s", "2.00(10) rad/s"]


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
    _, _, high = extremes(time, swing, int(200 / periods_a_bucket))
    assert bool(np.all(np.diff(high) < 0.0)) is falls


def test_a_gap_interrupts_the_line() -> None:
    path = line(np.arange(5.0), np.array([1.0, 2.0, np.nan, 3.0, 4.0]))
    assert path == "M0.0,1.0L1.0,2.0M3.0,3.0L4.0,4.0"
