"""The workflow runs in any folder, and plans what it says."""

import contextlib
import json
import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from pendpipe.cli import main
from pendpipe.configuration.jobs import prepare_environment
from pendpipe.configuration.load import load_campaign, read_configuration, read_records
from pendpipe.project import SNAKEFILE
from pendpipe.stages.chunks import SMALL, STAGES, batch_for, split

from .plans import campaign, jobs_in, planned, snakemake

# The workflow runs in any folder: begun by `init`, run by `campaign`, or used as a module.

pytestmark = pytest.mark.slow
ROOT = Path(__file__).parents[2]
RECORDS_STAGES = ("acquire", "calibrate", "turning_points", "fit", "decay")
ORDER = [name.replace("_", "-") for name in RECORDS_STAGES]


def call(folder: Path, *command: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", *command],
        cwd=folder,
        env=os.environ | {"PYTHONPATH": str(ROOT / "src")},
        capture_output=True,
        text=True,
        check=False,
    )


def begin(folder: Path) -> Path:
    """Begin a campaign of the two examples, without their diagnoses."""
    with contextlib.chdir(folder):
        assert main(["init", "mine"]) == 0
    configuration = folder / "mine/config/config.yaml"
    text = configuration.read_text(encoding="utf-8")
    assert "enabled: true" in text
    configuration.write_text(text.replace("enabled: true", "enabled: false"), encoding="utf-8")
    return folder / "mine"


@pytest.fixture
def begun(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder of a campaign that was begun, in the working folder."""
    monkeypatch.chdir(tmp_path)
    return begin(tmp_path)


def set_traps(folder: Path) -> Path:
    """Lay what a folder must not run or configure; what does says so in the file returned."""
    sprung = folder / "sprung"
    for module in ("signal", "csv", "random", "calendar", "snakemake_logger_plugin_other"):
        code = (
            f"with open({str(sprung)!r}, 'a') as out: out.write('{module}, ')\nraise SystemExit(9)"
        )
        (folder / f"{module}.py").write_text(code, encoding="utf-8")
    # As Snakemake evaluates it.
    trap = f"open({str(sprung)!r}, 'a').write('profile, ')"
    for name in ("default", "slurm"):
        (folder / name).mkdir()
        profile = f"executor: nowhere\ndefault-resources:\n- mem_mb={trap}\n"
        (folder / name / "config.yaml").write_text(profile, encoding="utf-8")
    (folder / "matplotlibrc").write_bytes(b"text.usetex: True\n# \xff\n")
    return sprung


def test_jobs_of_snakemake_run_nothing_of_their_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Those that Snakemake begins by ``python -m snakemake``, whoever called it."""
    for variable in ("PYTHONSAFEPATH", "PATH"):
        monkeypatch.setenv(variable, "")
    sprung = set_traps(tmp_path)
    prepare_environment()
    done = call(tmp_path, "calendar")
    assert not sprung.exists()
    assert done.returncode == 0


def test_a_folder_that_the_user_names_is_a_profile(begun: Path) -> None:
    """Ours goes by its name, whatever lies in the working folder."""
    set_traps(begun)
    assert "nowhere" in campaign(begun, "-n", "--profile", "./default")[1]


@pytest.fixture(scope="module")
def ended(
    tmp_path_factory: pytest.TempPathFactory,
) -> tuple[Path, subprocess.CompletedProcess[str]]:
    """A campaign among traps that has run to its end: its folder, and what was said."""
    folder = begin(tmp_path_factory.mktemp("ended"))
    set_traps(folder)
    with (folder / "config/records.tsv").open("a", encoding="utf-8") as table:
        table.write("lost\trecordings/rod-pendulun.csv\n")
    return folder, call(folder, "pendpipe", "campaign", "--cores", "2")


def test_a_campaign_that_was_begun_runs_to_its_report(
    ended: tuple[Path, subprocess.CompletedProcess[str]],
) -> None:
    folder, done = ended
    assert done.returncode == 0, done.stdout + done.stderr
    assert (folder / "results/report.html").is_file()
    fit = json.loads((folder / "results/rod/fit.json").read_text(encoding="utf-8"))
    assert fit["light"] == "green"
    lines = done.stderr.splitlines()
    assert any("did you mean 'rod-pendulum.csv'?" in line for line in lines), "of the lost file"
    assert "fit: 1 done" in lines
    assert "1 of 3 records were refused" in lines[-1]
    status, said = campaign(folder, "-n", "--record", "rod", "--", "--forcerun", "fit")
    assert status == 0
    files = {f"{name}_files_{number}": 1 for number, name in enumerate(RECORDS_STAGES)}
    assert jobs_in(said) == dict.fromkeys(RECORDS_STAGES, 1) | files | {"all": 1, "total": 11}
    assert not (folder / "sprung").exists(), "neither the run nor the plan uses them"


def test_a_line_a_stage_hides_no_fault(begun: Path) -> None:
    """Where a job fails, its rule and its log are printed."""
    (begun / "recordings/rod-pendulum.csv").write_text("no recording\n", encoding="utf-8")
    with (begun / "config/config.yaml").open("a", encoding="utf-8") as configuration:
        configuration.write("strict: true\n")
    status, said = campaign(begun, "--record", "rod")
    assert status == 1
    assert "Error in rule acquire" in said
    assert "pendpipe: recordings/rod-pendulum.csv" in said


def test_the_workflow_is_a_module_of_others(
    ended: tuple[Path, subprocess.CompletedProcess[str]], tmp_path: Path
) -> None:
    """Rules under other names, of a campaign that has ended; no hook of a workflow is run."""
    traps = shutil.ignore_patterns("*.py", "default", "slurm", "matplotlibrc")
    folder = shutil.copytree(ended[0], tmp_path / "mine", ignore=traps)
    folder.joinpath("Snakefile").write_text(
        f"""
configfile: "config/config.yaml"
module pendpipe:
    snakefile: "{SNAKEFILE.as_posix()}"
    config: config
use rule * from pendpipe as pendpipe_*
rule all:
    default_target: True
    input: rules.pendpipe_all.input
""",
        encoding="utf-8",
    )
    assert planned(folder) == {}, "all is done"
    targets = ("results/rod/fit.json", "results/records.csv")
    names = ("turning_points", "fit", "fit_files_3", "records")
    for path in (paths := [folder / name for name in targets]):
        path.write_bytes(path.read_bytes()[:-5])
    words = ("--cores", "2", *targets, "--forcerun", "pendpipe_turning_points")
    status, said = snakemake(folder, *words)
    assert status == 0, said
    assert set(jobs_in(said)) == {f"pendpipe_{name}" for name in names} | {"total"}
    for path in paths:
        assert path.read_bytes() == (ended[0] / path.relative_to(folder)).read_bytes()
    assert len(list(paths[0].parent.glob("fit.json.damaged-*"))) == 1


def test_an_archive_has_all_that_a_campaign_is_made_of(begun: Path, tmp_path: Path) -> None:
    """Where it is unpacked the same is planned, and runs; no conda is asked."""
    with (begun / "config/records.tsv").open("a", encoding="utf-8") as table:
        table.write("live\tdataq:simulated:di2108\n")
    (raw := begun / "results/live/raw/1.raw").parent.mkdir(parents=True)
    raw.write_bytes(b"what cannot be measured again")
    words = ("--snakefile", str(SNAKEFILE))
    archive, there = tmp_path / "all.tar", tmp_path / "there"
    status, said = snakemake(begun, *words, "--archive", str(archive))
    assert status == 0, said
    shutil.unpack_archive(archive, there, filter="data")
    assert (there / raw.relative_to(begun)).read_bytes() == raw.read_bytes()
    assert planned(there, *words) == planned(begun, *words) != {}
    status, said = snakemake(there, *words, "--cores", "1", "results/rod/fit.json")
    assert status == 0, said
    assert (there / "results/rod/fit.json").is_file()


def test_conda_is_asked_where_the_user_asks_for_it(
    begun: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """By a conda that makes nothing: this tells what Snakemake would have it make, no more."""
    (begun / "bin").mkdir()
    info = '{"conda_prefix": "/", "platform": "linux-64", "get": {"channel_priority": "strict"}}'
    (conda := begun / "bin/conda").write_text(
        f"#!/bin/sh\n[ $1 = --version ] && echo conda 24.9.0 || echo '{info}'\n", encoding="utf-8"
    )
    conda.chmod(0o755)
    monkeypatch.setenv("PATH", f"{conda.parent}{os.pathsep}{os.environ['PATH']}")
    words = ("--snakefile", str(SNAKEFILE), "--sdm", "conda", "--list-conda-envs")
    status, said = snakemake(begun, *words)
    assert (status, said.count(".snakemake/pendpipe/environment-")) == (0, 1), said


def test_init_replaces_nothing(
    begun: Path, monkeypatch: pytest.MonkeyPatch, answer_of: Any
) -> None:
    before = {path: path.read_bytes() for path in begun.rglob("*") if path.is_file()}
    (begun / "config/records.tsv").unlink()
    (line,) = answer_of(["init", str(begun)], 2).err.splitlines()
    assert "config.yaml" in line
    assert "records.tsv" not in line
    del before[begun / "config/records.tsv"]
    assert {path: path.read_bytes() for path in begun.rglob("*") if path.is_file()} == before


def test_init_lists_recordings_of_ones_own(tmp_path: Path) -> None:
    """Two files of one name, and names that are none for a folder, have records of their own."""
    files = [tmp_path / "data/group 1.csv", tmp_path / "data/Größe.csv", tmp_path / "group-1.csv"]
    (tmp_path / "data").mkdir()
    for path in files:
        path.write_text("", encoding="utf-8")
    folder = tmp_path / "mine"
    assert main(["init", str(folder), *map(str, files)]) == 0
    records = read_records(folder / "config/records.tsv")
    assert [record.record for record in records] == ["group-1", "Gr-e", "group-1-2"]
    found = [(folder / record.source).resolve() for record in records]
    assert found == [path.resolve() for path in files]
    assert main(["init", str(tmp_path / "other"), str(tmp_path / "none.csv")]) == 2
    assert not (tmp_path / "other").exists()


@pytest.mark.parametrize(
    "name",
    [
        *("calibration", "figures", "logs", "chunks", "pages", "pendulums"),
        *("con", "con.a", "nul.b"),
        *(
            "n" * 150,
            "tab\there",
            "line\nbreak",
            'say "so"',
            "#1",
            "simulated",
            "-",
            "été",
            "a\u2028b",
        ),
    ],
)
@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no such names")
def test_what_init_writes_a_campaign_accepts(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Names of the campaign's own folders, of Windows, too long twice, with signs of tables."""
    monkeypatch.chdir(tmp_path)
    files = [Path(folder, f"{name}.csv") for folder in ("x", "y")]
    for path in files:
        path.parent.mkdir()
        path.write_text("", encoding="utf-8")
    assert main(["init", "mine", *map(str, files)]) == 0
    records = read_records("mine/config/records.tsv")
    found = [Path("mine", record.source).resolve() for record in records]
    assert found == [path.resolve() for path in files]


def test_init_refuses_a_name_that_a_table_cannot_hold(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, answer_of: Any
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("decay.csv ").write_text("", encoding="utf-8")
    (line,) = answer_of(["init", "mine", "decay.csv "], 2).err.splitlines()
    assert "rename the file" in line
    assert not Path("mine").exists()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ([], "pendpipe init writes one"),
        (["--config", "none.yaml"], "there is no such configuration"),
        (["--record", "rd"], "did you mean 'rod'?"),
        (["--profile", "nowhere"], "known are default, slurm"),
    ],
)
def test_what_is_wrong_is_said_before_snakemake_starts(
    begun: Path,
    words: list[str],
    said: str,
    monkeypatch: pytest.MonkeyPatch,
    answer_of: Any,
) -> None:
    if words:
        monkeypatch.chdir(begun)
    (line,) = answer_of(["campaign", *words], 2).err.splitlines()[-1:]
    assert said in line


def test_a_table_of_published_numbers_is_a_campaign_of_one_job(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, answer_of: Any
) -> None:
    folder = tmp_path / "newton"
    shutil.copytree(ROOT / "examples/published/newton-1687", folder)
    words = ("--snakefile", str(SNAKEFILE))
    assert planned(folder, *words) == {"published": 1, "all": 1, "total": 2}
    status, said = campaign(folder, "--cores", "1")
    assert status == 0, said
    content = json.loads((folder / "results/campaign_diagnosis.json").read_text("utf-8"))
    (case,) = content["cases"]
    assert case["statement"] in (folder / "results/campaign_diagnosis.txt").read_text("utf-8")
    assert (folder / "results/figures/left.svg").is_file()
    assert planned(folder, *words) == {}
    table = folder / "config/table.tsv"
    table.write_text(table.read_text("utf-8").replace("164", "165"), "utf-8")
    assert planned(folder, *words)["published"] == 1
    monkeypatch.chdir(folder)
    assert "in order" in answer_of(["config"], 0).out
    refused = answer_of(["campaign", "-n", "--record", "from 2 inches"], 2).err
    assert "a table of numbers has no records" in refused
    (folder / "config/config.yaml").write_text("title: Newton\ncases: 3\n", "utf-8")
    status, said = snakemake(folder, *words, "-n")
    assert status
    assert "config.yaml, source" in said


def test_a_row_says_how_its_file_is_read(begun: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A comma, a unit and a part that the reader is told of; the fit's torque too."""
    lines = (begun / "recordings/rod-pendulum.csv").read_text(encoding="utf-8").splitlines()
    rows = [line.split(",") for line in lines if line[:1].isdigit()]
    text = "t;reading\n" + "".join(f"{t};{y}\n".replace(".", ",") for t, y, *_ in rows)
    (begun / "recordings/comma.csv").write_text(text, encoding="utf-8")
    (begun / "config/records.tsv").write_text(
        "record\tsource\tunit\tdecimal\tstop_s\trestoring\n"
        "comma\trecordings/comma.csv\tmm\t,\t20\tlinear\n",
        encoding="utf-8",
    )
    monkeypatch.chdir(begun)
    campaign = load_campaign(read_configuration("config/config.yaml"), "config/config.yaml")
    archives = [STAGES[stage].path(campaign, "all") for stage in ORDER]
    for number, (stage, out) in enumerate(zip(ORDER, archives, strict=True)):
        words = ["stage", stage, "--campaign", "config/config.yaml", "--chunk", "all"]
        assert main([*words, "--out", str(out), "--reading", *map(str, archives[:number])]) == 0
    for path in archives:
        assert main(["unpack", str(path), "results"]) == 0
    fit = json.loads((begun / "results/comma/fit.json").read_text(encoding="utf-8"))
    assert fit["parameters"]["amplitude"]["unit"] == "m"
    assert fit["restoring"] == "linear"
    recording = (begun / "results/comma/recording.csv").read_text(encoding="utf-8")
    assert 19.0 < float(recording.splitlines()[-1].split(",")[0]) <= 20.0


# `snakemake -n` on a clean checkout: no port, no recordings, the campaign's jobs counted.


def empty(results: Path, override: str = "seed=1") -> list[str]:
    """The plan of this repository's campaign with an empty folder of results."""
    return ["--config", f"results={results.as_posix()}", override]


def chunks(table: Path) -> int:
    """In how many jobs a stage does the records of a table."""
    records = read_records(table)
    return len(split({each.record: each for each in records}, batch_for(len(records))))


def test_the_default_campaign_has_a_job_a_chunk_in_each_of_its_stages(tmp_path: Path) -> None:
    counted = planned(ROOT, *empty(tmp_path / "results"))
    total = counted.pop("total")
    jobs_of_stage = chunks(ROOT / "config/records.tsv")
    assert jobs_of_stage >= 2, "a job a core"
    for stage in (*RECORDS_STAGES, "diagnose"):
        assert counted.pop(stage) == jobs_of_stage
    assert set(counted.values()) == {1}, "the other stages are the campaign's"
    assert {"separate", "compare", "figures", "report"} <= set(counted)
    assert total == 6 * jobs_of_stage + len(counted)


def test_a_source_of_any_name_stops_no_other_record(tmp_path: Path) -> None:
    """Its own job reads it, or refuses the record. Records of one pendulum have a job together."""
    (tmp_path / "folder").mkdir()
    names = ["a{b}.csv", "{.csv", "b{.csv", "folder", "x" * 300, "none.csv"]
    names += [] if sys.platform == "win32" else ["a<b>.csv", "a*b.csv"]
    for name in names[:3] + names[6:]:
        (tmp_path / name).write_text("time_s,angle_rad\n0.0,0.1\n")
    table, configuration = tmp_path / "records.tsv", tmp_path / "config.yaml"
    pendulums = ["brass", "brass", "alone", *[""] * len(names)]
    rows = (
        f"record-{n}\t{tmp_path.as_posix()}/{name}\t{pendulum}\n"
        for n, (name, pendulum) in enumerate(zip(names, pendulums, strict=False))
    )
    table.write_text("record\tsource\tpendulum\n" + "".join(rows))
    configuration.write_text(
        f"title: Odd\nrecords: {table.as_posix()}\nresults: x\napparatus: null\n"
        "calibration: null\nsimulated: null\ntypical_record: null\n"
    )
    words = ("--configfile", str(configuration))
    counted = planned(ROOT, *words, *empty(tmp_path / "results"))
    assert counted["acquire"] == chunks(table)
    assert counted["diagnose_pendulum"] == 1


def test_recordings_of_others_need_no_file_for_a_plan(tmp_path: Path) -> None:
    """On a clean checkout there is no ../shared; the records are then refused, one by one."""
    words = ("--configfile", str(ROOT / "benchmarks/shared_recordings.yaml"))
    counted = planned(ROOT, *words, *empty(tmp_path / "results"))
    assert counted["acquire"] == chunks(ROOT / "benchmarks/shared_recordings.tsv")


def test_a_record_of_many_has_its_files_when_they_are_asked_for(tmp_path: Path) -> None:
    """Ten thousand are planned in chunks; a job brings out a file that is asked for."""
    rows = "".join(f"r{number}\tdecay.csv\n" for number in range(SMALL + 1))
    (tmp_path / "records.tsv").write_text(f"record\tsource\n{rows}", encoding="utf-8")
    (tmp_path / "config.yaml").write_text("title: Many\nrecords: records.tsv\n", encoding="utf-8")
    words = ("--snakefile", str(SNAKEFILE), "--configfile", "config.yaml")
    everything = planned(tmp_path, *words)
    assert not any("files" in name for name in everything)
    one = planned(tmp_path, *words, "--", "results/r7/fit.json")
    assert one == dict.fromkeys((*RECORDS_STAGES[:4], "record_file"), 1) | {"total": 5}


def test_a_faulty_configuration_stops_before_any_job(tmp_path: Path) -> None:
    words = empty(tmp_path / "results", override="simulated={drag_facto: 1}")
    status, said = snakemake(ROOT, "-n", *words)
    assert status
    assert any("did you mean 'drag_factor'?" in line for line in said.splitlines()), said
    assert "Traceback" not in said
