"""A small campaign runs end to end, finds what was hidden in it, and reruns only what it must."""

import json
import os
import re
import shutil
from collections import Counter
from collections.abc import Callable, Iterator
from copy import copy
from pathlib import Path
from typing import Any, Self

import pytest
import yaml
from snakemake.utils import update_config

from pendpipe import provenance
from pendpipe.cli import main
from pendpipe.configuration.load import read_records
from pendpipe.files import MARK, check_output, read_json, write_json
from pendpipe.physics import sphere_in_tank
from pendpipe.project import SNAKEFILE
from pendpipe.stages.chunks import split

from .plans import jobs_in, snakemake

pytestmark = pytest.mark.slow
ROOT = Path(__file__).parents[2]
"""What is tested, wherever it is installed."""
SMALL = ROOT / "tests/workflow/small"
NO_DECAY = Path("tests/workflow/small/no-decay.csv")


class Campaign:
    """A campaign that shares no folder with another, not even Snakemake's own notes."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.results = folder / "my results"  # a space, as users have
        self.records = folder / "records.tsv"
        rows = (SMALL / "records.tsv").read_text(encoding="utf-8")
        self.records.write_text(rows.replace(f"{NO_DECAY.parent}/", ""), encoding="utf-8")
        shutil.copy(ROOT / NO_DECAY, folder)
        content, small = (
            yaml.safe_load((at / "config.yaml").read_text(encoding="utf-8"))
            for at in (ROOT / "config", SMALL)
        )
        update_config(content, small)
        content |= {"results": self.results.name, "records": self.records.name, "batch": 8}
        self.configuration = folder / "config/config.yaml"
        self.configuration.parent.mkdir()
        self.configuration.write_text(yaml.safe_dump(content), encoding="utf-8")

    def copied(self, folder: Path) -> Self:
        """Return this campaign in another folder, with all that was run."""
        there = copy(self)
        there.folder = shutil.copytree(self.folder, folder)
        there.results = folder / self.results.name
        return there

    def ask(self, *arguments: str) -> str:
        """What Snakemake says, which must end well."""
        status, said = snakemake(self.folder, "--snakefile", str(SNAKEFILE), *arguments)
        assert status == 0, said
        return said

    def planned(self, *arguments: str) -> dict[str, int]:
        """Count the jobs that Snakemake would run."""
        return jobs_in(self.ask("-n", "--nolock", *arguments))

    @property
    def chunks(self) -> int:
        """In how many jobs a stage does the records."""
        return len(split({each.record: each for each in read_records(self.records)}, 8))

    def summary(self) -> dict[str, Any]:
        """Read campaign.json."""
        content: dict[str, Any] = json.loads((self.results / "campaign.json").read_text())
        return content


@pytest.fixture(scope="module")
def campaign(tmp_path_factory: pytest.TempPathFactory) -> Campaign:
    """The small campaign, run once."""
    campaign = Campaign(tmp_path_factory.mktemp("campaign"))
    campaign.ask("--cores", "2")
    return campaign


@pytest.fixture
def library(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A copy of the library, whose source the rules are said to run."""
    copy = shutil.copytree(provenance.PACKAGE, tmp_path / "src/pendpipe")
    monkeypatch.setattr(provenance, "PACKAGE", copy)
    provenance.code_version.cache_clear()
    yield copy
    provenance.code_version.cache_clear()


def pull(number: dict[str, float], truth: float) -> float:
    return (number["value"] - truth) / number["sd"]


def test_what_was_hidden_is_found(campaign: Campaign) -> None:
    """k, the drag factor, Fig. 7's limit and Q_v,exp, each within five standard deviations."""
    summary = campaign.summary()
    truth = yaml.safe_load((ROOT / "config/config.yaml").read_text(encoding="utf-8"))["simulated"]
    k, tank = truth["hysteretic_coefficient_s2"], truth["tank"]
    walls = sphere_in_tank(
        *(0.019, tank["depth_m"] / 2, 7.9e-4),
        surface_m=tank["depth_m"] / 2,
        **{name: tank[name] for name in ("length_m", "width_m", "off_centre_m")},
    )
    factor = walls.drag_factor
    assert abs(pull(summary["hysteretic_coefficient"], k)) < 5
    assert abs(pull(summary["theory_factor"], factor)) < 5
    assert abs(pull(summary["drag_factor"], factor)) < 5
    # The joint fit and the first table are one: they agree, and the records' 5 % of kappa''
    # between assemblies is in both.
    with_benchmark = summary["joint"]["with_benchmark"]
    assert with_benchmark["drag_factor"]["value"] == summary["drag_factor"]["value"]
    assert abs(pull(summary["theory_factor"], summary["drag_factor"]["value"])) < 2
    water = summary["loss_torque"]["water"]
    assert water["sd"] / water["value"] == pytest.approx(0.05, rel=0.1)
    assert abs(pull(summary["volts_per_radian"], truth["sensor"]["volts_per_radian"])) < 5
    typical = next(entry for entry in summary["records"] if entry["record"] == "water-low-7")
    # The paper's own record: a limit of 136 and Q_v,exp of 156, to its three digits.
    limit, viscous = typical["quality_factor_limit"], typical["quality_factor_viscous"]
    assert abs(limit["value"] - 136) < 0.5 + 5 * limit["sd"]
    assert abs(viscous["value"] - 156) < 0.5 + 5 * viscous["sd"]
    assert 0.5 < viscous["sd"] < 2.0


def test_the_summary_has_the_contracts_keys(campaign: Campaign) -> None:
    summary = campaign.summary()
    for name in (
        "hysteretic_coefficient",
        "reference_inertia",
        "theory_factor",
        "theory_factor_in_tank",
        "drag_factor",
        "history_coefficient",
        "volts_per_radian",
    ):
        assert set(summary[name]) == {"value", "sd", "unit"}
    assert set(summary["viscous_exponents"]) == {"low", "high"}
    names = {"record", "fluid", "branch", "frequency", "moment_of_inertia", "a", "b", "c"}
    names |= {f"quality_factor_{part}" for part in ("limit", "hysteretic", "viscous")}
    assert all(names <= set(record) for record in summary["records"])


def test_every_result_states_the_first_form_of_its_contract(campaign: Campaign) -> None:
    paths = [path for path in campaign.results.rglob("*.json") if ".snakemake" not in path.parts]
    assert {path.parent.name for path in paths} >= {"water-low-7", "diagnosis", "broken"}
    stated = {path: json.loads(path.read_text())["schema_version"] for path in paths}
    assert set(stated.values()) == {1}


def test_the_inertia_has_the_errors_of_its_frequency_and_of_its_torque(campaign: Campaign) -> None:
    """I = K/(2 pi f)^2, with K from distances of 0.1 mm and masses: per mille to some per cent."""
    comparison = json.loads((campaign.results / "comparison.json").read_text())
    measured = [entry for entry in comparison["records"] if not entry["refused"]]
    for entry in measured:
        inertia, frequency = entry["moment_of_inertia_from_frequency"], entry["frequency"]
        relative = frequency["sd"] / frequency["value"]
        of_torque = (inertia["sd"] / inertia["value"]) ** 2 - (2.0 * relative) ** 2
        assert 0.0 < of_torque < 0.15**2
    assert measured


def test_every_result_says_inside_who_made_it(campaign: Campaign) -> None:
    """That is how it may be replaced; a user's own file may not, nor what he has edited."""
    made = [path for path in campaign.results.rglob("*") if path.is_file()]
    made = [path for path in made if path.suffix != ".log"]
    assert {path.suffix for path in made} >= {".csv", ".json", ".svg", ".parquet", ".html", ".zip"}
    for path in made:
        check_output(path)


def test_a_refused_record_is_told_of_and_stops_nobody(campaign: Campaign) -> None:
    refused = json.loads((campaign.results / "broken/refused.json").read_text())
    assert refused["record"] == "broken"
    assert "\n" not in refused["reason"]
    assert refused["reason"] in (campaign.results / "report.html").read_text(encoding="utf-8")
    assert "broken" not in {record["record"] for record in campaign.summary()["records"]}


def test_the_table_of_the_records_says_what_their_results_say(campaign: Campaign) -> None:
    """A row a record, in both forms alike: numbers of the fit, verdict, or the refusal."""
    from pyarrow import csv, parquet

    rows = parquet.read_table(campaign.results / "records.parquet").to_pylist()
    spread = csv.read_csv(campaign.results / "records.csv").drop_columns("made_by").to_pylist()
    assert [{name: cell or None for name, cell in row.items()} for row in spread] == rows
    table = campaign.records.read_text(encoding="utf-8").splitlines()[1:]
    assert [row["record"] for row in rows] == [line.partition("\t")[0] for line in table]
    for row in rows:
        folder = campaign.results / row["record"]
        fit = json.loads((folder / "fit.json").read_text())
        verdict = json.loads((folder / "diagnosis/diagnosis.json").read_text())["verdict"]
        assert row["verdict"] == verdict
        assert row["refusal"] == fit.get("refused")
        if not row["refusal"]:
            assert row["b"] == fit["parameters"]["b"]["value"]
            assert row["T0_s"] == pytest.approx(1.0 / fit["parameters"]["frequency"]["value"])
            assert row["Q_sd"] > 0.0


def test_simulated_records_are_consistent_and_a_refused_one_is_not_analysable(
    campaign: Campaign,
) -> None:
    """The simulated apparatus moves by Eq. 8: at 1 % each, eleven records lack nothing."""
    verdicts = [
        json.loads(path.read_text())["verdict"]
        for path in sorted(campaign.results.glob("*/diagnosis/diagnosis.json"))
    ]
    records = len(campaign.records.read_text(encoding="utf-8").splitlines()) - 1
    assert len(verdicts) == records
    assert verdicts.count("not-analysable") == 1
    assert verdicts.count("consistent") >= records - 2


HEAD = "record\tsource\tfluid\tbranch\tgeometry\tstart_s\ttemperature_c\n"
BY_HAND = """
acquire --campaign config/config.yaml --caliper --out results/calibration/caliper.csv
calibrate results/calibration/caliper.csv --arm-m 0.3 --out results/calibration/sensor.json
stage acquire --campaign config/config.yaml --chunk all --out results/chunks/acquire-all.zip
stage calibrate --campaign config/config.yaml --chunk all --out results/chunks/calibrate-all.zip \
 --reading results/chunks/acquire-all.zip
stage turning-points --campaign config/config.yaml --chunk all \
 --out results/chunks/turning-points-all.zip \
 --reading results/chunks/acquire-all.zip results/chunks/calibrate-all.zip
stage fit --campaign config/config.yaml --chunk all --out results/chunks/fit-all.zip --reading \
 results/chunks/acquire-all.zip results/chunks/calibrate-all.zip \
 results/chunks/turning-points-all.zip
separate --campaign config/config.yaml --out results/separation.json
compare --campaign config/config.yaml --separation results/separation.json \
 --out results/comparison.json --summary results/campaign.json
"""


def run_by_hand(folder: Path, rows: str) -> Path:
    """Run the stages up to the comparison for other records of the same apparatus."""
    campaign = Campaign(folder)
    campaign.records.write_text(HEAD + rows, encoding="utf-8")
    content = yaml.safe_load(campaign.configuration.read_text(encoding="utf-8"))
    content |= {"results": "results", "typical_record": rows.partition("\t")[0]}
    content["simulated"]["release"].pop("water-low-7")
    campaign.configuration.write_text(yaml.safe_dump(content), encoding="utf-8")
    for call in BY_HAND.strip().splitlines():
        assert main(call.split()) == 0, call
    return folder / "results"


def test_two_records_of_one_frequency_have_a_drag_factor_with_its_error(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Few records, and no exponent: what can be said has its error all the same."""
    rows = (
        "one\tsimulated\twater\thigh\thigh-4\t\t20.0\n" * 2
        + "air\tsimulated\tair\tair\tair-07\t\t20\n"
    )
    monkeypatch.chdir(tmp_path)
    results = run_by_hand(tmp_path, rows.replace("one", "two", 1))
    comparison = json.loads((results / "comparison.json").read_text())
    factor = comparison["theory_factor"]
    assert 0.0 < factor["sd"] < 0.1 * factor["value"]
    budget = {part["source"]: part["relative_sd"] for part in comparison["budget"]}
    assert 0.0 < budget["distances of the weights"] < 0.1
    assert abs(comparison["viscous_exponents"]["high"]["sd"]) > 10.0


def test_a_campaign_of_refused_records_ends_with_its_figures_places(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    source = NO_DECAY.name
    monkeypatch.chdir(tmp_path)
    rows = f"water\t{source}\twater\thigh\thigh-4\t\t20\nair\t{source}\tair\tair\tair-07\t\t20\n"
    results = run_by_hand(tmp_path, rows)
    for call in (
        "diagnose-campaign results --out results/campaign_diagnosis.json",
        "separate --out results/other.json --diagnosis results/campaign_diagnosis.json",
        "figures --comparison results/comparison.json --out results/figures",
    ):
        assert main([*call.split(), "--campaign", "config/config.yaml"]) == 0
    drawn = json.loads((results / "figures/drawn.json").read_text())
    assert "figures/fig09.svg" in drawn["files"]
    assert "fig09" in drawn["left_out"]
    assert json.loads((results / "campaign.json").read_text())["theory_factor"] is None


def test_an_added_row_and_a_changed_library_rerun_what_they_concern(
    campaign: Campaign, library: Path
) -> None:
    """A row its chunk and the campaign's jobs; another version of the library all."""
    before = campaign.records.read_text(encoding="utf-8")
    row = "water-high-3\tsimulated\twater\thigh\thigh-3\t\t\t\t\t20.0\n"
    unsplit = campaign.chunks
    campaign.records.write_text(before + row, encoding="utf-8")
    try:
        planned, chunks = campaign.planned(), campaign.chunks
    finally:
        campaign.records.write_text(before, encoding="utf-8")
    for stage in STAGE_NAMES:
        assert planned[stage] == 1 + chunks - unsplit < chunks
    for stage in ("separate", "compare", "figures", "report"):
        assert planned[stage] == 1
    assert "caliper" not in planned
    with (library / "analysis/fit/by_waveform.py").open("a") as source:
        source.write("# changed\n")
    provenance.code_version.cache_clear()
    planned = campaign.planned()
    assert [planned[name] for name in ("caliper", *STAGE_NAMES)] == [1, *[unsplit] * 6]


def test_every_figure_of_a_campaign_with_theory_is_drawn(campaign: Campaign) -> None:
    """Also those that need the readings of the typical record."""
    assert read_json(campaign.results / "figures/drawn.json")["left_out"] == {}


def test_the_results_name_no_path_of_the_machine(campaign: Campaign) -> None:
    for path in (campaign.results / "report.html", campaign.results / "campaign.json"):
        text = path.read_text(encoding="utf-8")
        assert str(ROOT) not in text
        assert str(campaign.results) not in text


def damage(path: Path, change: Callable[[bytes], bytes]) -> None:
    """Change a file and put its old time back."""
    before = path.stat()
    path.write_bytes(change(path.read_bytes()))
    os.utime(path, ns=(before.st_atime_ns, before.st_mtime_ns))


def test_damaged_results_are_named_and_made_again_and_nothing_else_is(
    campaign: Campaign, library: Path, tmp_path: Path
) -> None:
    """Torn, emptied, lost, altered with their old times: they are as the first run left them.

    The run makes these alone; what follows from the campaign's numbers is planned as ever.
    """
    campaign = campaign.copied(tmp_path / "copy")
    damages: dict[str, Callable[[bytes], bytes]] = {
        "water-low-5/diagnosis/diagnosis.json": lambda content: content[:0],
        "water-high-4/figures/decay.svg": lambda content: content[:100],
        "chunks/fit-0.zip": lambda content: content[:-3],
        "separation.json": lambda content: content.replace(b"1", b"2", 1),
        "campaign.json": lambda content: content[:-2],
    }
    lost = ("water-low-4/diagnosis/diagnosis.json",)
    before = {name: (campaign.results / name).read_bytes() for name in (*damages, *lost)}
    source = campaign.folder / NO_DECAY.name
    source_before = (source.read_bytes(), source.stat().st_mtime_ns)
    for name, change in damages.items():
        damage(campaign.results / name, change)
    for name in lost:
        (campaign.results / name).unlink()
    planned = campaign.ask("-n")
    assert not list(campaign.results.rglob("*.damaged-*")), "a dry run moves nothing"
    assert jobs_in(planned)["fit"] == 1
    assert not {"acquire", "diagnose"} & jobs_in(planned).keys()
    wanted = [f"{campaign.results.name}/{name}" for name in before]
    ran = campaign.ask("--cores", "2", "--", *wanted)
    for name in damages:
        assert f"{campaign.results.name}/{name}: " in planned
        assert f"{campaign.results.name}/{name}: " in ran
        assert len(list(campaign.results.glob(f"{name}.damaged-*"))) == 1
    for name, content in before.items():
        assert (campaign.results / name).read_bytes() == content
    assert (source.read_bytes(), source.stat().st_mtime_ns) == source_before
    # A copy of the library is the same library.
    said = campaign.ask("-n", "--", *wanted)
    assert not jobs_in(said), said


STAGE_NAMES = ("acquire", "calibrate", "turning_points", "fit", "decay", "diagnose")
OF_THE_CAMPAIGN = {
    *("separate", "compare", "diagnose_campaign", "records", "figures", "report", "all")
}


def rules_of(planned: dict[str, int]) -> dict[str, int]:
    """The jobs of each rule; those that bring out the files of a stage's records together."""
    found = Counter[str]()
    for name, number in planned.items():
        found[re.sub(r"_files_\d+$", "_files", name)] += number
    del found["total"]
    return dict(found)


def test_what_is_asked_for_is_planned_and_no_more(campaign: Campaign, tmp_path: Path) -> None:
    """A record's file, a stage of all by its target, ``--until``, ``--forcerun``, ``only``."""
    new, n = Campaign(tmp_path), campaign.chunks
    up_to_fit = dict.fromkeys(STAGE_NAMES[:4], 1)
    one = rules_of(new.planned(f"{new.results.name}/air-07/fit.json"))
    assert one == up_to_fit | {"caliper": 1, "fit_files": 1}
    of_all = dict.fromkeys(STAGE_NAMES[:4], n) | {"caliper": 1}
    assert rules_of(new.planned("all_fit")) == of_all | {"fit_files": n, "all_fit": 1}
    assert rules_of(new.planned("--until", "fit")) == of_all
    alone = ("--config", "only=[air-07]")
    files = {f"{name}_files": 1 for name in STAGE_NAMES}
    stages = dict.fromkeys(STAGE_NAMES, 1)
    assert rules_of(new.planned(*alone)) == stages | files | {"caliper": 1, "all": 1}
    # Of a finished campaign.
    forced = dict.fromkeys(OF_THE_CAMPAIGN, 1) | dict.fromkeys(("fit", "fit_files"), n)
    forced |= dict.fromkeys(("decay", "decay_files"), n)
    for words in (("--forcerun", "fit"), ("-R", "fit")):
        assert rules_of(campaign.planned(*words)) == forced
    file = f"{campaign.results.name}/air-07/fit.json"
    assert rules_of(campaign.planned("--forcerun", "fit", "--", file)) == {"fit": 1, "fit_files": 1}


def test_snakemake_knows_every_file_of_a_finished_campaign(campaign: Campaign) -> None:
    """But its configuration."""
    listed = campaign.ask("--list-untracked").splitlines()
    assert [name for name in listed if name.startswith(f"{campaign.results.name}/")] == []
    assert "config/config.yaml" in listed, "so it does list"


PLACES = ("air", "water", "low", "high")
"""Keys that say where a number holds: the key above says what it is."""
HELD = ("quality_factor_hysteretic", "quality_factor_viscous")
"""In fit.json what ``--fix`` has held: one recording can't tell them."""


def numbers_in(
    content: Any, record: str | None, path: tuple[str, ...] = ("",)
) -> Iterator[tuple[str | None, str, bool]]:
    """Of each number with an error, and each null: whose it is, its name, and if it stands."""
    name = "/".join(path[-2:] if path[-1] in PLACES else path[-1:])
    if isinstance(content, list):
        for each in content:
            own = each.get("record") if isinstance(each, dict) else None
            yield from numbers_in(each, own or record, path)
    elif isinstance(content, dict):
        if {"value", "sd"} <= content.keys():
            yield record, name, True
        for key, each in content.items():
            yield from numbers_in(each, record, (*path, key))
    elif content is None:
        yield record, name, False


@pytest.mark.parametrize("kind", ["sound", "bad", "foreign"])
def test_no_number_is_null_where_another_file_has_it(
    kind: str, campaign: Campaign, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also with a record that was refused, and with one whose loss is that of no such pendulum."""
    there = campaign.copied(tmp_path / "copy")
    monkeypatch.chdir(there.folder)
    results = Path(there.results.name)
    # Without archives the files of the records count.
    shutil.rmtree(results / "chunks")
    if kind == "sound":
        rows = Path(there.records.name).read_text(encoding="utf-8")
        Path(there.records.name).write_text(rows.partition("broken")[0], encoding="utf-8")
    if kind == "foreign":
        fit = json.loads((results / "water-high-8/fit.json").read_text())
        fit["parameters"]["b"]["value"] *= 1.5
        del fit[MARK]
        write_json(results / "water-high-8/fit.json", fit)
    together, table = results / "campaign_diagnosis.json", results / "separation.json"
    both = f"--out={results}/comparison.json", f"--summary={results}/campaign.json"
    for call in (
        ("diagnose-campaign", str(results)),
        ("separate", f"--diagnosis={together}", f"--out={table}"),
        ("compare", f"--separation={table}", *both),
    ):
        assert main([*call, "--campaign", "config/config.yaml"]) == 0
    assert len(read_json(table)["left_out"]) == (kind == "foreign")
    assert len(read_json(results / "campaign.json")["refused"]) == (kind != "sound")
    found = {True: set[tuple[str | None, str]](), False: set[tuple[str | None, str]]()}
    for path in (*results.glob("*.json"), *results.glob("*/[cf]*.json")):
        record = None if path.parent == results else path.parent.name
        for owner, name, stands in numbers_in(read_json(path), record):
            if path.name != "fit.json" or name not in HELD:
                found[stands].add((owner, name))
    assert (None, "loss_torque/water") in found[True]
    rows = read_json(results / "campaign.json")["records"]
    assert min(row["moment_of_inertia"]["sd"] for row in rows) > 0.0
    assert not found[True] & found[False]
