"""`pendpipe doctor` names what is wrong with results, and changes nothing."""

import json
from collections.abc import Callable
from pathlib import Path

import pytest
from benchmarks.acquisition import recorded_bytes

from pendpipe import manifest
from pendpipe.acquisition.raw import lock
from pendpipe.cli import main
from pendpipe.commands.doctor import examine
from pendpipe.files import sha256, write_json


@pytest.fixture
def results(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Results of one record: a recording, a fit made from it, and a separation."""
    monkeypatch.chdir(tmp_path)
    record = tmp_path / "results/air-01"
    record.mkdir(parents=True)
    recording, fit = record / "recording.csv", record / "fit.json"
    with manifest.job(record, "acquire") as written:
        recording.write_text("time_s,volts\n0.0,1.0\n")
        written.append(recording)
    with manifest.job(record, "fit", inputs=[recording]) as written:
        write_json(fit, {"a": 1, "provenance": {"input_sha256": sha256(recording)}})
        written.append(fit)
    with manifest.job(record.parent, "separate", inputs=[fit]) as written:
        write_json(record.parent / "separation.json", {"k": 3940})
        written.append(record.parent / "separation.json")
    return record.parent


def kinds(results: Path) -> set[tuple[str, str]]:
    return {(found.kind, Path(found.path).name) for found in examine(results)}


def put(name: str, content: str = "x") -> Callable[[Path], object]:
    def change(results: Path) -> None:
        path = results / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(content)

    return change


def other_recording(results: Path) -> None:
    with manifest.job(results / "air-01", "acquire") as written:
        (results / "air-01/recording.csv").write_text("time_s,volts\n0.0,2.0\n")
        written.append(results / "air-01/recording.csv")


def killed_stage(results: Path) -> None:
    with pytest.raises(KeyboardInterrupt), manifest.job(results / "air-01", "calibrate"):
        raise KeyboardInterrupt


def test_sound_results_have_no_finding(results: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["doctor", str(results), "--fail-on", "findings"]) == 0
    assert "as their stages wrote them" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        (put("air-01/fit.json", "{}"), ("altered", "fit.json")),
        (put("air-01/manifest/fit.json", "{"), ("altered", "fit.json")),
        (lambda results: (results / "air-01/fit.json").unlink(), ("incomplete", "fit.json")),
        (killed_stage, ("incomplete", "air-01")),
        (other_recording, ("stale", "fit.json")),
        (put("air-01/notes.csv"), ("orphaned", "notes.csv")),
        (put("notes.json"), ("orphaned", "notes.json")),
        (put("air-01/.notes.20240101"), ("orphaned", ".notes.20240101")),
        (put("air-01/.fit.json.ab120f3c"), ("temporary", ".fit.json.ab120f3c")),
        (put("air-01/fit.json.damaged-1a2b3c4d"), ("set-aside", "fit.json.damaged-1a2b3c4d")),
        (put("live/raw/2026.raw"), ("raw", "2026.raw")),
        (put("decay.raw"), ("raw", "decay.raw")),
        (put("../.snakemake/locks/0.input.lock"), ("locked", "locks")),
        (put("../.snakemake/incomplete/YQ=="), ("incomplete", "incomplete")),
    ],
)
def test_each_thing_that_is_wrong_is_named(
    results: Path,
    change: Callable[[Path], object],
    expected: tuple[str, str],
    capsys: pytest.CaptureFixture[str],
) -> None:
    change(results)
    before = {path: path.stat().st_mtime_ns for path in results.rglob("*")}
    assert expected in kinds(results)
    assert main(["doctor", str(results), "--fail-on", "findings"]) == 3
    for line in capsys.readouterr().out.splitlines():
        assert line.count("; ") >= 1, "each line ends with what is safe to do"
    assert {path: path.stat().st_mtime_ns for path in results.rglob("*")} == before


def other_campaign(results: Path) -> None:
    """Results of another campaign in a folder of these, as config/recordings.yaml has them."""
    record = results / "recordings/steel"
    with manifest.job(record, "fit") as written:
        for name in ("fit.json", "diagnosis/diagnosis.json"):
            write_json(record / name, {})
            written.append(record / name)
    with manifest.job(record.parent, "compare") as written:
        write_json(record.parent / "comparison.json", {})
        written.append(record.parent / "comparison.json")
    put("recordings/steel/logs/fit.log")(results)
    put("recordings/steel/raw/README.md")(results)
    put("recordings/report-of-mine/notes.txt")(results)


def record_named_raw(results: Path) -> None:
    with manifest.job(results / "raw", "fit") as written:
        write_json(results / "raw/fit.json", {})
        written.append(results / "raw/fit.json")


@pytest.mark.parametrize("change", [other_campaign, record_named_raw, put("my notes/plan.txt")])
def test_other_campaigns_and_the_users_own_folders_are_no_findings(
    results: Path, change: Callable[[Path], object]
) -> None:
    change(results)
    assert examine(results) == []


@pytest.mark.parametrize(
    ("change", "damaged"),
    [
        (other_campaign, "recordings/steel/fit.json"),
        (other_campaign, "recordings/comparison.json"),
        (record_named_raw, "raw/fit.json"),
    ],
)
def test_what_is_damaged_is_named_in_every_folder(
    results: Path, change: Callable[[Path], object], damaged: str
) -> None:
    change(results)
    put(damaged, "torn")(results)
    assert kinds(results) == {("altered", Path(damaged).name)}


def test_the_diagnosis_of_a_pendulum_is_a_result_as_all_others(results: Path) -> None:
    files = []
    for name in ("air-01", "air-02"):
        put(f"{name}/refused.json", '{"reason": "short", "stage": "acquire"}')(results)
        put(f"{name}/swing.csv", "time_s,angle_rad\n0.0,0.1\n")(results)
        files.append(str(results / name / "swing.csv"))
    out = results / "pendulums/steel"
    words = ["diagnose", *files, "--record", "steel", "--out", str(out), "--refused", "-"]
    assert main(words) == 0
    assert "pendulums" not in "".join(each.path for each in examine(results))
    for content in ("", '{"torn": ', '{"schema_version": 1}'):
        put("pendulums/steel/diagnosis.json", content)(results)
        assert ("altered", "diagnosis.json") in kinds(results)
        found = manifest.look_through(manifest.manifests(out))
        assert "diagnosis.json" in found.repaired
        assert "makes it again" in str(found.damages[0])


def test_nothing_sound_is_called_deletable(results: Path) -> None:
    """Only what a killed process had not finished may be deleted."""
    for change in (
        other_recording,
        put("air-01/mine.csv"),
        put("air-01/fit.json.damaged-1a2b3c4d"),
    ):
        change(results)
    put("air-01/raw/1.raw")(results)
    assert len(found := examine(results)) >= 3
    assert not [each for each in found if "delete" in f"{each.problem} {each.safe}"]


def test_a_folder_without_results_is_the_users_error(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    put("holiday/picture.svg")(tmp_path)
    assert [main(["doctor", folder]) for folder in ("holiday", "none")] == [2, 2]
    assert "no stage has left results here" in capsys.readouterr().err


def test_programs_get_json(results: Path, capsys: pytest.CaptureFixture[str]) -> None:
    put("air-01/fit.json", "")(results)
    assert main(["doctor", str(results), "--json"]) == 0
    findings = json.loads(capsys.readouterr().out)["findings"]
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
