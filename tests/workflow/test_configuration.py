"""The configuration refuses what it does not know, and says what was meant."""

import copy
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import numpy as np
import pytest

from pendpipe.analysis.fit.result import FitResult
from pendpipe.commands import small
from pendpipe.configuration import jobs
from pendpipe.configuration.apparatus import pendulum
from pendpipe.configuration.load import (
    COLUMNS,
    Record,
    load_campaign,
    read_configuration,
    read_records,
)
from pendpipe.errors import InputError
from pendpipe.stages.results import RecordResult, placed
from pendpipe.stages.separate import common_relative_sd

ROOT = Path(__file__).parents[2]


@pytest.fixture
def content(monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    monkeypatch.chdir(ROOT)
    return read_configuration("config/config.yaml")


def test_the_default_campaign_is_the_papers(content: dict[str, Any]) -> None:
    """Fifteen records in water, in two branches, and an air benchmark from 15 s to 2 s."""
    campaign = load_campaign(content, "config/config.yaml")
    branches = [record.branch for record in campaign.records]
    assert {name: branches.count(name) for name in set(branches)} == {
        "high": 8,
        "low": 7,
        "air": 12,
    }
    assert {record.source for record in campaign.records} == {"simulated"}


def test_the_period_in_water_is_that_of_all_parts(content: dict[str, Any]) -> None:
    """By hand: rod, weights, and the sphere with its buoyancy, its water, and its screw."""
    content["apparatus"]["sphere"].update(screw_volume_m3=2e-7)
    campaign = load_campaign(content, "config/config.yaml")
    record = campaign.record("water-low-1")
    where = campaign.geometry(record).weights_m
    weights = {name: content["apparatus"]["weights"][name]["mass_kg"] for name in where}
    volume, gravity = 4.0 / 3.0 * np.pi * 0.019**3, 9.80665
    inertia = 0.0444 * 0.77**2 / 12.0 + 0.0358 * (0.4 * 0.019**2 + 0.452**2)
    inertia += sum(weights[name] * where[name] ** 2 for name in where)
    moment = 0.0358 * 0.452 + sum(weights[name] * where[name] for name in where)
    moment -= 1000.0 * (volume * 0.452 + 2e-7 * 0.43)
    built = pendulum(campaign, record)
    depth = np.sqrt(2.0 * 1.0016e-6 / built.swing.angular_frequency_per_s)
    inertia += (0.5 + 2.25 * depth / 0.019) * 1000.0 * volume * 0.452**2
    assert built.swing.angular_frequency_per_s == pytest.approx(
        np.sqrt(gravity * moment / inertia), rel=1e-9
    )


def renamed(content: dict[str, Any], name: str, wrong: str) -> None:
    content[wrong] = content.pop(name)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda c: renamed(c, "apparatus", "aparatus"), "'aparatus'; did you mean 'apparatus'?"),
        (
            lambda c: renamed(c["apparatus"]["sphere"], "diameter_m", "diametr_m"),
            "unknown key 'diametr_m'; did you mean 'diameter_m'?",
        ),
        (
            lambda c: renamed(c["fluids"]["water"], "density_kg_per_m3", "density"),
            "did you mean 'density_kg_per_m3'?",
        ),
        (lambda c: c.update(sed=2), "did you mean 'seed'?"),
        (lambda c: c["simulated"].update(drag_facto=1.0), "config.yaml, simulated.drag_facto: "),
        (lambda c: c["simulated"].update(drag_facto=1.0), "did you mean 'drag_factor'?"),
        (lambda c: c.update(records="none.tsv"), "there is no such table"),
        (lambda c: c["apparatus"]["rod"].update(mass_kg=-1), "greater than 0"),
        (lambda c: c["apparatus"]["rod"].update(mass_kg="heavy"), "valid number"),
        (lambda c: c["geometries"].pop("low-3"), "unknown geometry 'low-3'"),
        (lambda c: c["fluids"].pop("air"), "unknown fluid 'air'"),
        (lambda c: c["geometries"]["low-1"]["weights_m"].update(uper=0.1), "did you mean 'upper'"),
        (lambda c: c.update(typical_record="water-low-9"), "no record 'water-low-9'"),
        (lambda c: c.pop("simulated"), "a simulated record needs simulated"),
        (lambda c: c["simulated"]["release"].pop("air"), "its release is not described"),
        (lambda c: c["apparatus"]["rod"].update(mass_kg=float("inf")), "finite number"),
        (lambda c: c["geometries"]["low-1"]["weights_m"].update(upper=float("nan")), "finite"),
        (lambda c: c.update(results=".inj;touch PWNED;"), "';' can't stand in its name"),
        (lambda c: c.update(results="a{record}"), "'{' can't stand in its name"),
        (lambda c: c.update(results="-rf"), "is no folder"),
        (lambda c: c.update(results=""), "is no folder"),
        (lambda c: c.update(results="README.md/x"), "README.md is a file"),
        (lambda c: c["fluids"]["water"].update(temperature_c=68.0), "less than or equal to 40"),
    ],
)
def test_what_cannot_be_is_said_in_one_line(
    content: dict[str, Any], change: Callable[[dict[str, Any]], Any], said: str
) -> None:
    change(content)
    with pytest.raises(InputError) as caught:
        load_campaign(content, "config.yaml")
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("celsius", ["68", "-0.5", "293.15"])
def test_a_temperature_outside_waters_table_is_refused_by_row(
    content: dict[str, Any], tmp_path: Path, celsius: str
) -> None:
    """Fahrenheit and kelvin; where a fluid's own values hold for every record they are not read."""
    path = tmp_path / "records.tsv"
    head = "record\tsource\tfluid\tgeometry\ttemperature_c\n"
    row = f"one\tsimulated\twater\tlow-3\t{celsius}\n"
    path.write_text(
        head + row.replace("one", "two").replace("water", "air").replace("low-3", "air-07")
    )
    changed = content | {"records": str(path), "typical_record": None}
    assert load_campaign(changed, "config.yaml").records[0].temperature_c == float(celsius)
    path.write_text(head + row)
    with pytest.raises(InputError, match=rf"record one: {celsius} °C is not between 0 and 40"):
        load_campaign(changed, "config.yaml")


@pytest.mark.parametrize("written", [b"\xff\xfe", b"a: \x01", b"[" * 5000, b"a: [1", b"", b"3"])
def test_a_file_that_is_no_configuration_is_named_in_one_line(
    tmp_path: Path, written: bytes
) -> None:
    path = tmp_path / "config.yaml"
    path.write_bytes(written)
    with pytest.raises(InputError, match=r"config\.yaml") as caught:
        read_configuration(path)
    assert "\n" not in str(caught.value)
    with pytest.raises(InputError, match=r"can't be read \(Is a directory\)"):
        read_configuration(tmp_path)


def test_a_table_that_is_no_text_is_named_in_one_line(tmp_path: Path) -> None:
    path = tmp_path / "records.tsv"
    path.write_bytes(b"record\tsource\n\xff\tsimulated\n")
    for place in (path, tmp_path):
        with pytest.raises(InputError, match="can't be read"):
            read_records(place)


def test_schema_and_manual_are_those_of_the_models() -> None:
    """Both are made by `pendpipe config`; whoever changes a model makes them anew."""
    committed = ROOT / "workflow/schemas/configuration.schema.json"
    assert committed.read_text(encoding="utf-8") == small.schema()
    assert small.configuration_manual() in (ROOT / "config/README.md").read_text(encoding="utf-8")


def table(folder: Path, *rows: str, header: str = "\t".join(COLUMNS)) -> Path:
    path = folder / "records.tsv"
    path.write_text("\n".join([header, *rows]) + "\n", encoding="utf-8")
    return path


@pytest.mark.parametrize(
    ("rows", "header", "said"),
    [
        (["x\tsimulated"], "record\tsorce", "the column 'source' is missing"),
        (["x\tsimulated\t1"], "record\tsource\tfuid", "did you mean 'fluid'?"),
        (["a b\tsimulated"], "record\tsource", "no name for a folder"),
        (["x\tsimulated", "X\tsimulated"], "record\tsource", "stands twice"),
        (
            ["x\tfile.csv\tnine"],
            "record\tsource\tstart_s",
            "line 2, start_s: input should be a valid number",
        ),
        (["figures\tsimulated"], "record\tsource", "of its own"),
        (["campaign.json\tsimulated"], "record\tsource", "of its own"),
        (["CON\tsimulated"], "record\tsource", "Windows keeps the name"),
        (["nul.txt\tsimulated"], "record\tsource", "Windows keeps the name"),
        (["x.\tsimulated"], "record\tsource", "no dot at the end"),
        (["x" * 300 + "\tsimulated"], "record\tsource", "300 characters"),
        (["x\t"], "record\tsource", "the source is blank"),
        ([], "record\tsource", "no records"),
    ],
)
def test_a_faulty_table_is_refused_with_its_line(
    tmp_path: Path, rows: list[str], header: str, said: str
) -> None:
    with pytest.raises(InputError, match=r"records\.tsv") as caught:
        read_records(table(tmp_path, *rows, header=header))
    assert said in str(caught.value)


@pytest.mark.parametrize("stop_s", ["2.9", "3", "3.1"])
def test_a_part_of_a_record_ends_after_it_has_begun(
    content: dict[str, Any], tmp_path: Path, stop_s: str
) -> None:
    header = "record\tsource\tstart_s\tstop_s"
    rows = table(tmp_path, f"x\tfile.csv\t3\t{stop_s}", header=header)
    content = {"title": "one part", "records": str(rows)}
    if stop_s == "3.1":
        assert load_campaign(content, "here").record("x").stop_s == 3.1
        return
    with pytest.raises(InputError, match=r"record x: stop_s is not after start_s"):
        load_campaign(content, "here")


def test_records_share_the_relative_error_of_their_sensor() -> None:
    """One caliper run, one error of the scale: no record averages it away."""
    own = {"volts_per_radian": {"value": 2.0, "sd": 0.5}, "from": "the table of records"}
    run = {"volts_per_radian": {"value": -3.85, "sd": 0.0077}, "from": "the caliper run"}
    record = Record("x", "simulated")
    results = [RecordResult(record, None, calibration) for calibration in (own, run, run)]
    assert common_relative_sd(results) == pytest.approx(0.002)
    assert common_relative_sd(results[:1]) == 0.0


def test_only_a_usable_record_in_a_fluid_of_a_known_apparatus_has_a_place_in_the_theory(
    content: dict[str, Any],
) -> None:
    campaign = load_campaign(content, "config/config.yaml")
    record = campaign.record("water-low-1")
    fits = {light: Mock(FitResult, light=light) for light in ("green", "yellow", "red")}
    good, fair, bad = (RecordResult(record, fit, {}) for fit in fits.values())
    refused = RecordResult(record, None, {}, "no motion")
    dry = RecordResult(replace(record, fluid=""), fits["green"], {})
    assert placed(campaign, [good, bad, refused, dry, fair]) == [good, fair]
    unknown = campaign.configuration.model_copy(update={"apparatus": None})
    assert placed(replace(campaign, configuration=unknown), [good]) == []


def test_the_jobs_get_numbers_where_the_command_line_gave_text(
    content: dict[str, Any], tmp_path: Path
) -> None:
    """Snakemake's --config hands on a number within braces as text."""
    content["simulated"]["drag_factor"] = "1.0"
    stored = read_configuration(jobs.store(load_campaign(content, "--config"), tmp_path))
    assert stored["simulated"]["drag_factor"] == 1.0
    again = load_campaign(stored, "stored")
    assert jobs.store(again, tmp_path) == jobs.store(load_campaign(content, "--config"), tmp_path)


def test_a_change_of_the_truth_touches_the_records_it_concerns(content: dict[str, Any]) -> None:
    """Another water changes the water records' acquisition and leaves the air's."""
    before = load_campaign(content, "config.yaml")
    changed = copy.deepcopy(content)
    changed["fluids"]["water"]["viscosity_pa_s"] = 1.1e-3
    after = load_campaign(changed, "config.yaml")
    same = {
        one.record: jobs.acquisition(before, one) == jobs.acquisition(after, other)
        for one, other in zip(before.records, after.records, strict=True)
    }
    assert {name for name, kept in same.items() if kept} == {
        record.record for record in before.records if record.fluid == "air"
    }
