"""The configuration, results on disk, and places where nothing can be written."""

import copy
import json
import shutil
from collections.abc import Callable
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import numpy as np
import pytest
import yaml
from benchmarks.acquisition import recorded_bytes

from pendpipe.acquisition.raw import lock
from pendpipe.analysis.fit.result import FitResult
from pendpipe.cli import main
from pendpipe.commands import small
from pendpipe.commands.doctor import examine
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
from pendpipe.files import check_writable, replaced, sha256, write_json
from pendpipe.recording import Recording, write_plain
from pendpipe.stages.archive import pack
from pendpipe.stages.results import RecordResult, placed
from pendpipe.stages.separate import common_relative_sd

from ..refusals import refused

# The configuration refuses what it does not know, and says what was meant.

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
        (lambda c: c.update(results=".inj;touch PWNED;"), "';' can't be part of its name"),
        (lambda c: c.update(results="a{record}"), "'{' can't be part of its name"),
        (lambda c: c.update(results="-rf"), "is not a folder"),
        (lambda c: c.update(results=""), "is not a folder"),
        (lambda c: c.update(results="README.md/x"), "README.md is a file"),
        (lambda c: c["fluids"]["water"].update(temperature_c=68.0), "less than or equal to 40"),
    ],
)
def test_what_cannot_be_is_said_in_one_line(
    content: dict[str, Any], change: Callable[[dict[str, Any]], Any], said: str
) -> None:
    change(content)
    with refused(said):
        load_campaign(content, "config.yaml")


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


@pytest.mark.slow
@pytest.mark.parametrize("written", [b"\xff\xfe", b"a: \x01", b"[" * 5000, b"a: [1", b"", b"3"])
def test_a_file_that_is_no_configuration_is_named_in_one_line(
    tmp_path: Path, written: bytes
) -> None:
    path = tmp_path / "config.yaml"
    path.write_bytes(written)
    with refused("", str(path)):
        read_configuration(path)
    with refused("can't be read (Is a directory)"):
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
        (["x\tsimulated", "X\tsimulated"], "record\tsource", "is listed twice"),
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
    faulty = table(tmp_path, *rows, header=header)
    with refused(said, str(faulty)):
        read_records(faulty)


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
    own = {"volts_per_radian": {"value": 2.0, "sd": 0.5}, "shared": False}
    run = {"volts_per_radian": {"value": -3.85, "sd": 0.0077}, "shared": True}
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
    file = jobs.store(load_campaign(content, "--config").configuration, tmp_path)
    stored = read_configuration(file)
    assert stored["simulated"]["drag_factor"] == 1.0
    assert jobs.store(load_campaign(stored, "stored").configuration, tmp_path) == file


@pytest.mark.parametrize("url", ["file:///home/me/pendpipe", "file:///x/pendpipe-1.whl", None])
def test_an_environment_of_conda_installs_what_exists(
    url: str | None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """From where pendpipe was installed; without that, an index has it."""
    installed = Mock(read_text=lambda _: url and json.dumps({"url": url}))
    monkeypatch.setattr(jobs, "distribution", lambda _: installed)
    content = yaml.safe_load(
        Path(jobs.environment(tmp_path, ROOT / "workflow/envs/pendpipe.yaml")).read_text(
            encoding="utf-8"
        )
    )
    (wanted,) = content["dependencies"][-1]["pip"]
    assert wanted == (f"pendpipe @ {url}" if url else f"pendpipe=={version('pendpipe')}")
    assert "pip" in content["dependencies"]


def test_null_on_the_command_line_blanks_a_key(content: dict[str, Any]) -> None:
    """Snakemake hands on `--config typical_record=null` as the text null."""
    assert content["typical_record"]
    blank = load_campaign(content | {"typical_record": "null"}, "--config")
    assert blank.configuration.typical_record is None


def test_a_change_of_the_truth_touches_the_records_it_concerns(content: dict[str, Any]) -> None:
    """Another water changes the water records' acquisition and leaves the air's."""
    before = load_campaign(content, "config.yaml")
    changed = copy.deepcopy(content)
    changed["fluids"]["water"]["viscosity_pa_s"] = 1.1e-3
    after = load_campaign(changed, "config.yaml")
    same = {
        one.record: jobs.acquisition(before, one, sha256) == jobs.acquisition(after, other, sha256)
        for one, other in zip(before.records, after.records, strict=True)
    }
    assert {name for name, kept in same.items() if kept} == {
        record.record for record in before.records if record.fluid == "air"
    }


# Where nothing can be written, each command says so in one line and ends with status 2.


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A project whose configuration is the default one, with a file where a folder should be."""
    shutil.copytree(ROOT / "config", tmp_path / "config")
    (tmp_path / "file").write_text("kept")
    (tmp_path / "comparison.json").write_text(json.dumps({"records": []}))
    (tmp_path / "table.csv").write_text("angle_rad,volts\n0,0\n0.1,0.4\n0.2,0.8\n0.3,1.2\n")
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize(
    "call",
    [
        "separate --campaign config/config.yaml --out file/x.json",
        "compare --campaign config/config.yaml --separation s.json --out file/x --summary file/y",
        "figures --campaign campaign.json --comparison comparison.json --out file/figures",
        "report --campaign campaign.json --comparison comparison.json --summary comparison.json"
        " --out file/page.html",
        "calibrate table.csv --out file/sensor.json",
        "acquire --device simulated:di2108 --rate 100 --duration 0.2 --out file/x.csv",
        "acquire --campaign config/config.yaml --caliper --out file/caliper.csv",
        "acquire --campaign config/config.yaml --record air-01 --out file/x.csv",
    ],
)
def test_a_place_that_cannot_be_written_is_one_line(
    folder: Path, call: str, answer_of: Any
) -> None:
    (folder / "campaign.json").write_text(json.dumps({"results": "file"}))
    configuration = folder / "config/config.yaml"
    text = configuration.read_text(encoding="utf-8")
    configuration.write_text(text.replace("results: results", "results: r"), encoding="utf-8")
    lines = [
        line for line in answer_of(call.split(), 2).err.splitlines() if line.startswith("pendpipe")
    ]
    assert len(lines) == 1
    assert "file" in lines[0]
    assert (folder / "file").read_text() == "kept"


def test_a_full_disk_is_named_and_leaves_no_half_file(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"x\.csv: .*[Nn]o space"), replaced(tmp_path / "x.csv"):
        raise OSError(28, "No space left on device")
    assert list(tmp_path.iterdir()) == []


def test_a_name_that_is_too_long_is_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="too long"), replaced(tmp_path / ("x" * 300)):
        raise AssertionError


def test_results_are_tried_before_a_run(tmp_path: Path) -> None:
    check_writable(tmp_path / "new")
    assert list((tmp_path / "new").iterdir()) == []
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="not a folder"):
        check_writable(tmp_path / "file")


# `pendpipe doctor` names what is wrong with results, and changes nothing.


@pytest.fixture
def results(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Results of one record: archives of a recording and of a fit made from it, and its files."""
    monkeypatch.chdir(tmp_path)
    results = tmp_path / "results"
    for stage, name in (("acquire", "recording.csv"), ("fit", "fit.json")):
        leave(results, "air-01", stage, name)
    write_json(results / "separation.json", {"schema_version": 1, "k": 3940})
    return results


def leave(results: Path, record: str, stage: str, name: str) -> None:
    """Leave what a stage does of a record: its file, and an archive of it."""
    path = results / record / name
    if name.endswith(".csv"):
        write_plain(path, Recording(np.arange(3.0), np.ones(3), "angle_rad"))
    else:
        write_json(path, {"a": 1.0})
    pack(results / f"chunks/{stage}-all.zip", results, [path], {record: {}})


def kinds(results: Path) -> set[tuple[str, str]]:
    return {(found.kind, Path(found.path).name) for found in examine(results)}


def put(name: str, content: str = "x") -> Callable[[Path], object]:
    def change(results: Path) -> None:
        path = results / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(content)

    return change


def test_sound_results_have_no_finding(results: Path, answer_of: Any) -> None:
    assert (
        "as their stages wrote them"
        in answer_of(["doctor", str(results), "--fail-on", "findings"]).out
    )


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        (put("air-01/fit.json", "{}"), ("altered", "fit.json")),
        (put("chunks/fit-all.zip", "{"), ("altered", "fit-all.zip")),
        (put("campaign.json", '{"torn": '), ("altered", "campaign.json")),
        (put("pendulums/steel/diagnosis.json", ""), ("altered", "diagnosis.json")),
        (put("air-01/recording.csv", "time_s,vo"), ("altered", "recording.csv")),
        (put("pages/air-01.html"), ("altered", "air-01.html")),
        (put("air-01/.fit.json.ab120f3c"), ("temporary", ".fit.json.ab120f3c")),
        (put("chunks/.fit-0.zip.ab120f3c"), ("temporary", ".fit-0.zip.ab120f3c")),
        (put("air-01/fit.json.damaged-1a2b3c4d"), ("set-aside", "fit.json.damaged-1a2b3c4d")),
        (put("live/raw/2026.raw"), ("raw", "2026.raw")),
        (put("decay.raw"), ("raw", "decay.raw")),
        (put("../.snakemake/locks/0.input.lock"), ("locked", "locks")),
    ],
)
def test_each_thing_that_is_wrong_is_named(
    results: Path,
    change: Callable[[Path], object],
    expected: tuple[str, str],
    answer_of: Any,
) -> None:
    change(results)
    before = {path: path.stat().st_mtime_ns for path in results.rglob("*")}
    assert expected in kinds(results)
    for line in answer_of(["doctor", str(results), "--fail-on", "findings"], 3).out.splitlines():
        assert line.count("; ") >= 1, "each line ends with what is safe to do"
    assert {path: path.stat().st_mtime_ns for path in results.rglob("*")} == before


def other_campaign(results: Path) -> None:
    """Results of another campaign in a folder of these, as config/recordings.yaml has them."""
    for stage, name in (("acquire", "recording.csv"), ("fit", "fit.json")):
        leave(results / "recordings", "steel", stage, name)
    write_json(results / "recordings/comparison.json", {})
    put("recordings/steel/logs/fit.log")(results)
    put("recordings/steel/raw/README.md")(results)
    put("recordings/report-of-mine/notes.txt")(results)


def record_named_raw(results: Path) -> None:
    for stage, name in (("acquire", "recording.csv"), ("fit", "fit.json")):
        leave(results, "raw", stage, name)


@pytest.mark.parametrize(
    ("change", "damaged"),
    [
        (other_campaign, "recordings/steel/fit.json"),
        (other_campaign, "recordings/comparison.json"),
        (record_named_raw, "raw/fit.json"),
        (put("my notes/plan.txt"), "campaign.json"),
    ],
)
def test_what_is_damaged_is_named_in_every_folder_and_nothing_of_the_users(
    results: Path, change: Callable[[Path], object], damaged: str
) -> None:
    change(results)
    put(damaged, "torn")(results)
    assert kinds(results) == {("altered", Path(damaged).name)}


def test_records_that_were_refused_are_left_out_of_a_pendulums_diagnosis(
    results: Path, answer_of: Any
) -> None:
    for name in ("air-01", "air-02"):
        put(f"{name}/recording.csv", "# refused: short\n")(results)
    files = [str(results / name / "recording.csv") for name in ("air-01", "air-02")]
    out = results / "pendulums/steel"
    words = ["diagnose", *files, "--record", "steel", "--out", str(out), "--refused", "-"]
    said = answer_of(words).err
    assert said.count("refused, and left out") == 2
    assert "fewer than two recordings" in (out / "diagnosis.json").read_text(encoding="utf-8")


def test_nothing_sound_is_called_deletable(results: Path) -> None:
    """Only what a killed process had not finished may be deleted."""
    for name in ("air-01/fit.json", "air-01/fit.json.damaged-1a2b3c4d", "live/raw/1.raw"):
        put(name)(results)
    assert len(found := examine(results)) == 3
    assert not [each for each in found if "delete" in f"{each.problem} {each.safe}"]


def test_a_folder_without_results_is_the_users_error(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    put("holiday/picture.svg")(tmp_path)
    assert [main(["doctor", folder]) for folder in ("holiday", "none")] == [2, 2]
    assert "no stage has left results here" in capsys.readouterr().err


def test_programs_get_json(results: Path, answer_of: Any) -> None:
    put("air-01/fit.json", "")(results)
    findings = json.loads(answer_of(["doctor", str(results), "--json"]).out)["findings"]
    assert {"kind", "path", "problem", "safe"} == set(findings[0])


def test_a_raw_file_is_decoded_left_alone_or_deleted(
    results: Path,
) -> None:
    """What is safe depends on whether it holds a scan, and on whether it still grows."""
    pytest.importorskip("fcntl", reason="this system has no such lock")
    raw = results / "decay.raw"

    def advice() -> str:
        (found,) = (each for each in examine(results) if each.kind == "raw")
        return str(found)

    raw.write_bytes(recorded_bytes("di2108"))
    assert f"pendpipe acquire --recover {raw}" in advice()
    with raw.open("ab") as stream:
        lock(stream)
        assert "wait for its end" in advice()
    raw.write_bytes(raw.read_bytes().partition(b"\n")[0] + b"\n")
    assert "it holds no scan; no stage reads it: keep it" in advice()


def test_a_lock_is_named_before_there_are_results(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    put(".snakemake/locks/0.input.lock")(tmp_path)
    (found,) = examine(Path("results"))
    assert found.kind == "locked"
    assert "--unlock" in found.safe


@pytest.mark.parametrize(
    ("key", "value", "said"),
    [
        ("apparatus.sphere.diameter_m", 38, "is it 38 mm? write 0.038"),
        ("apparatus.sphere.diameter_sd_m", 50.0, "is it 50 mm? write 0.05"),
        ("apparatus.sphere.mass_kg", 250, "is it 250 g? write 0.25"),
        ("apparatus.sphere.screw_volume_m3", "20", "is it 20 cm³? write 2e-05"),
        ("apparatus.rod.length_m", 77.0, "is it 77 mm? write 0.077 (77 cm: 0.77)"),
        ("geometries.low-2.weights_m.upper", -26.5, "write -0.0265 (-26.5 cm: -0.265)"),
        ("apparatus.tank.depth_m", 5e3, "is it 5000 mm? write 5"),
        ("apparatus.gravity_m_per_s2", 981, "is it 981 cm/s²? write 9.81"),
        ("apparatus.weights.upper.frontal_area_m2", 16, "is it 16 cm²? write 0.0016"),
        ("geometries.low-1.weights_m.upper", 267.07, "is it 267.07 mm? write 0.26707"),
        ("fluids.water.viscosity_pa_s", 1.0016, "is it 1.0016 mPa s? write 0.0010016"),
        ("simulated.release.water.angle_rad", 30, "is it 30°? write 0.523599"),
    ],
)
def test_a_number_in_another_unit_is_asked_about(key: str, value: object, said: str) -> None:
    """What no laboratory has, with the factor to the unit that was meant."""
    content = read_configuration(ROOT / "config/config.yaml")
    *sections, last = key.split(".")
    part = content
    for section in sections:
        part = part[section]
    assert abs(float(part[last])) < abs(float(value))  # type: ignore[arg-type]
    part[last] = value
    with refused(said, f"config.yaml, {key}: "):
        load_campaign(content, "config.yaml")


def test_a_number_below_its_bound_has_no_other_unit() -> None:
    content = read_configuration(ROOT / "config/config.yaml")
    content["apparatus"]["sphere"]["diameter_m"] = -0.038
    with pytest.raises(InputError, match="greater than 0") as caught:
        load_campaign(content, "config.yaml")
    assert "is it" not in str(caught.value)


def test_a_table_that_ends_in_a_row_is_torn(tmp_path: Path) -> None:
    """A last row that is whole needs no line end: not every editor writes one."""
    table = tmp_path / "records.tsv"
    whole = "record\tsource\tstop_s\na\ta.csv\t100\nb\tb.csv\t200"
    for text in (whole, whole + "\n", whole.replace("\t200", "") + "\n"):
        table.write_text(text)
        assert len(read_records(table)) == 2
    for cut in range(len("b\tb.csv\t200") - len("b\tb"), len("b\tb.csv\t200") - 1):
        table.write_text(whole[:-cut] if cut > 3 else whole.removesuffix("\t200"))
        with pytest.raises(InputError, match=r"line 3: the table ends in the middle of a row"):
            read_records(table)


def test_a_file_called_simulated_is_a_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """And two of one name are told apart."""
    monkeypatch.chdir(tmp_path)
    files = ["simulated", "x/decay.csv", "y/decay.csv", "z/other.csv"]
    for name in files:
        Path(name).parent.mkdir(exist_ok=True)
        Path(name).write_text("time_s,angle_rad\n0,0\n")
    assert main(["init", ".", *files]) == 0
    campaign = load_campaign(read_configuration("config/config.yaml"), "config/config.yaml")
    assert [str(record.file) for record in campaign.records] == files
    shown = ["./simulated", "x/decay.csv", "y/decay.csv", "other.csv"]
    assert [*campaign.shown_sources.values()] == shown
