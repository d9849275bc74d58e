"""`snakemake -n` on a clean checkout: no port, no recordings, the campaign's jobs counted."""

import re
import subprocess
import sys
from pathlib import Path

from pendpipe.configuration.load import read_records
from pendpipe.stages.chunks import batch_for, split

ROOT = Path(__file__).parents[2]


def dry_run(
    results: Path, *arguments: str, override: str = "seed=1"
) -> subprocess.CompletedProcess[str]:
    """Ask Snakemake what it would do, with an empty folder of results."""
    command = [sys.executable, "-m", "snakemake", "-n", "--nolock", *arguments]
    return subprocess.run(
        [*command, "--config", f"results={results.as_posix()}", override],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )


def jobs(output: str) -> dict[str, int]:
    """The table of jobs that Snakemake prints."""
    return {name: int(n) for name, n in re.findall(r"^(\w+) +(\d+)$", output, flags=re.MULTILINE)}


def chunks(table: Path) -> int:
    """In how many jobs a stage does the records of a table."""
    records = read_records(table)
    return len(split({each.record: each for each in records}, batch_for(len(records))))


def test_the_default_campaign_has_a_job_a_chunk_in_each_of_its_stages(tmp_path: Path) -> None:
    done = dry_run(tmp_path / "results")
    assert done.returncode == 0, done.stdout + done.stderr
    counted = jobs(done.stdout + done.stderr)
    total = counted.pop("total")
    jobs_of_stage = chunks(ROOT / "config/records.tsv")
    assert jobs_of_stage >= 2, "a job a core"
    for stage in ("acquire", "calibrate", "turning_points", "fit", "diagnose"):
        assert counted.pop(stage) == jobs_of_stage
    assert set(counted.values()) == {1}, "the other stages are the campaign's"
    assert {"separate", "compare", "figures", "report"} <= set(counted)
    assert total == 5 * jobs_of_stage + len(counted)


def test_records_of_one_pendulum_have_a_job_together(tmp_path: Path) -> None:
    header, *rows = (ROOT / "tests/workflow/small/records.tsv").read_text().splitlines()
    width = header.count("\t")
    names = ["brass", "brass", "alone", *[""] * (len(rows) - 3)]
    lines = [
        row + "\t" * (width - row.count("\t") + 1) + name
        for row, name in zip(rows, names, strict=True)
    ]
    table = tmp_path / "records.tsv"
    table.write_text("\n".join([f"{header}\tpendulum", *lines]) + "\n")
    done = dry_run(
        tmp_path / "results",
        *("--configfile", "tests/workflow/small/config.yaml"),
        override=f"records={table.as_posix()}",
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert jobs(done.stdout + done.stderr)["diagnose_pendulum"] == 1


def test_a_source_of_any_name_stops_no_other_record(tmp_path: Path) -> None:
    """Its own job reads it, or refuses the record."""
    (tmp_path / "folder").mkdir()
    names = ["a{b}.csv", "{.csv", "b{.csv", "folder", "x" * 300, "none.csv"]
    names += [] if sys.platform == "win32" else ["a<b>.csv", "a*b.csv"]
    for name in names[:3] + names[6:]:
        (tmp_path / name).write_text("time_s,angle_rad\n0.0,0.1\n")
    table, configuration = tmp_path / "records.tsv", tmp_path / "config.yaml"
    rows = (f"record-{n}\t{tmp_path.as_posix()}/{name}\n" for n, name in enumerate(names))
    table.write_text("record\tsource\n" + "".join(rows))
    configuration.write_text(
        f"title: Odd\nrecords: {table.as_posix()}\nresults: x\napparatus: null\n"
        "calibration: null\nsimulated: null\ntypical_record: null\n"
    )
    done = dry_run(tmp_path / "results", "--configfile", str(configuration))
    assert done.returncode == 0, done.stdout + done.stderr
    assert jobs(done.stdout + done.stderr)["acquire"] == chunks(table)


def test_recordings_of_others_need_no_file_for_a_dry_run(tmp_path: Path) -> None:
    """On a clean checkout there is no ../shared; the records are then refused, one by one."""
    done = dry_run(tmp_path / "results", "--configfile", "benchmarks/shared_recordings.yaml")
    assert done.returncode == 0, done.stdout + done.stderr
    table = ROOT / "benchmarks/shared_recordings.tsv"
    assert jobs(done.stdout + done.stderr)["acquire"] == chunks(table)


def test_a_faulty_configuration_stops_before_any_job(tmp_path: Path) -> None:
    done = dry_run(tmp_path / "results", override="simulated={drag_facto: 1}")
    assert done.returncode != 0
    lines = (done.stdout + done.stderr).splitlines()
    assert any("did you mean 'drag_factor'?" in line for line in lines), lines
    assert not any("Traceback" in line for line in lines)
