"""A job does a stage for a chunk of records: what is done stays done, whatever happens."""

import contextlib
import json
import os
import random
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, strategies as st

from pendpipe import manifest
from pendpipe.cli import main
from pendpipe.configuration.load import Campaign, Record, load_campaign, read_configuration
from pendpipe.files import sha256
from pendpipe.stages.chunks import STAGES, chunks_of, plan, split

RECORDS = ("one", "two", "three", "four", "five")
ORDER = ("acquire", "calibrate", "turning-points", "fit")

names = st.sets(st.text("abcdefghij0123456789", min_size=1, max_size=6), min_size=1, max_size=80)


def of_names(words: set[str]) -> dict[str, Record]:
    return {word: Record(word, "file.csv") for word in words}


@given(names, st.integers(1, 20), st.text("abcdefghij", min_size=1, max_size=6))
def test_an_added_record_changes_one_chunk(words: set[str], batch: int, added: str) -> None:
    before, after = split(of_names(words), batch), split(of_names(words | {added}), batch)
    for chunks, members in ((before, words), (after, words | {added})):
        assert sorted(each.record for rows in chunks.values() for each in rows) == sorted(members)
        assert max(map(len, chunks.values())) <= batch
    as_sets = [
        {name: {each.record for each in rows} for name, rows in chunks.items()}
        for chunks in (before, after)
    ]
    changed = [name for name, rows in as_sets[0].items() if as_sets[1].get(name) != rows]
    assert len(changed) <= 1


def write_decay(path: Path, seed: int) -> None:
    time_s = np.arange(1200) / 60.0
    noise = 1e-4 * np.random.default_rng(seed).standard_normal(len(time_s))
    angle = 0.05 * np.exp(-time_s / (8.0 + seed)) * np.cos(2.0 * np.pi * time_s) + noise
    rows = zip(time_s.tolist(), angle.tolist(), strict=True)
    text = "time_s,angle_rad\n" + "".join(f"{t:.6f},{y:.7f}\n" for t, y in rows)
    path.write_text(text, encoding="utf-8")


@pytest.fixture(scope="module")
def fitted(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a campaign that was fitted, once a run: five decays in one chunk."""
    home = tmp_path_factory.mktemp("five")
    rows = "".join(f"{name}\t{name}.csv\n" for name in RECORDS)
    (home / "records.tsv").write_text(f"record\tsource\n{rows}", encoding="utf-8")
    (home / "config.yaml").write_text("title: Five\nrecords: records.tsv\n", encoding="utf-8")
    with contextlib.chdir(home):
        for seed, name in enumerate(RECORDS):
            write_decay(Path(f"{name}.csv"), seed)
        run(*ORDER)
    return home


@pytest.fixture
def done(fitted: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Campaign:
    """A copy of it, with its times."""
    monkeypatch.chdir(shutil.copytree(fitted, tmp_path / "five"))
    return loaded()


@pytest.fixture
def campaign(done: Campaign) -> Campaign:
    """The same before its first job."""
    shutil.rmtree("results")
    return done


def loaded() -> Campaign:
    return load_campaign(read_configuration("config.yaml"), "config.yaml")


def words(stage: str, chunk: str = "all") -> list[str]:
    out = STAGES[stage].path(loaded(), chunk)
    return ["stage", stage, "--campaign", "config.yaml", "--chunk", chunk, "--out", str(out)]


def run(*stages: str) -> None:
    for stage in stages:
        assert main(words(stage)) == 0


def fits() -> dict[str, Path]:
    return {name: Path("results", name, "fit.json") for name in RECORDS}


def written(paths: dict[str, Path]) -> dict[str, int]:
    return {name: path.stat().st_mtime_ns for name, path in paths.items() if path.exists()}


def changed(before: dict[str, int]) -> list[str]:
    """The records whose file was written again."""
    after = written(fits())
    return [name for name in RECORDS if after[name] != before[name]]


@pytest.fixture
def before(done: Campaign) -> dict[str, int]:
    """When the fit of each record was written."""
    return written(fits())


def test_what_is_done_is_not_done_again(done: Campaign, before: dict[str, int]) -> None:
    assert set(before) == set(RECORDS)
    STAGES["fit"].path(done, "all").unlink()  # as Snakemake does before the job
    run("fit")
    assert written(fits()) == before


def test_a_changed_input_is_done_anew_and_no_other(before: dict[str, int]) -> None:
    write_decay(Path("two.csv"), 17)
    run(*ORDER)
    assert changed(before) == ["two"]


def test_a_changed_setting_is_done_anew(before: dict[str, int]) -> None:
    with Path("config.yaml").open("a", encoding="utf-8") as stream:
        stream.write("fit: {method: waveform}\n")
    run("fit")
    assert changed(before) == list(RECORDS)


def test_a_forced_stage_is_done_anew(
    before: dict[str, int], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(manifest.RUN, "")
    manifest.hand_on(anew=["fit"], repaired={})
    run("fit")
    assert changed(before) == list(RECORDS)


def test_one_records_fault_is_its_own(
    campaign: Campaign, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The others are done, the chunk's job fails, and the next ends what is left."""
    run(*ORDER[:3])
    from pendpipe.arguments import COMMANDS
    from pendpipe.commands import fit

    real = fit.run

    def faulty(arguments: object) -> int:
        if getattr(arguments, "record", None) == "two":
            raise ZeroDivisionError("a fault of the program")
        return real(arguments)  # type: ignore[arg-type]

    with monkeypatch.context() as patched:
        patched.setitem(COMMANDS, real, COMMANDS[real]._replace(run=faulty))
        assert main(words("fit")) == 1
    assert "two: ZeroDivisionError: a fault of the program" in capsys.readouterr().err
    assert "Traceback" in Path("results/two/logs/fit.log").read_text(encoding="utf-8")
    before = written(fits())
    assert set(before) == set(RECORDS) - {"two"}
    assert not STAGES["fit"].path(campaign, "all").exists()
    run("fit")
    assert {name: number for name, number in written(fits()).items() if name != "two"} == before


def test_a_refused_record_stops_no_chunk(campaign: Campaign) -> None:
    Path("two.csv").write_text("no recording\n", encoding="utf-8")
    run(*ORDER)
    assert json.loads(fits()["two"].read_text(encoding="utf-8"))["refused"]
    before = written(fits())
    run(*ORDER)
    assert written(fits()) == before


def cut(path: Path) -> None:
    path.write_bytes(path.read_bytes()[:-5])


def altered(path: Path) -> None:
    before = path.stat()
    path.write_bytes(path.read_bytes().replace(b"1", b"7"))
    os.utime(path, ns=(before.st_atime_ns, before.st_mtime_ns))


def in_the_future(path: Path) -> None:
    """Altered while the manifest's time lies in the future."""
    later = time.time() + 1e6
    os.utime(path.parent / "manifest/fit.json", (later, later))
    altered(path)


@pytest.mark.parametrize(
    ("change", "name"),
    [
        (Path.unlink, "fit.json"),
        (cut, "fit.json"),
        (altered, "fit.json"),
        (in_the_future, "fit.json"),
        (altered, "manifest/fit.json"),
        (cut, "manifest/fit.json"),
        (cut, "recording.csv"),
        (Path.unlink, "calibration.json"),
        (altered, "turning_points.csv"),
    ],
)
def test_a_plan_notices_what_a_job_then_makes_again(
    done: Campaign,
    change: Callable[[Path], None],
    name: str,
    capsys: pytest.CaptureFixture[str],
) -> None:
    output = Path(name).name
    (stage,) = (each for each in STAGES.values() if each.output == output)
    files, records = [Path("results", each, output) for each in RECORDS], chunks_of(done)["all"]
    sound = plan(done, stage, "all", records).found
    assert (sound.repaired, sound.damages) == ("", ())
    before, times = [sha256(path) for path in files], [path.stat().st_mtime_ns for path in files]
    change(Path("results/two", name))
    found = plan(done, stage, "all", records).found
    (damage,) = found.damages
    assert damage.path == Path("results/two", name)
    assert found.repaired != sound.repaired, "a changed parameter runs the job"
    run(stage.name)
    assert ("; set aside as " in capsys.readouterr().err) == (damage.found != "missing")
    assert [sha256(path) for path in files] == before
    after = plan(done, stage, "all", records).found
    assert (after.damages, after.repaired) == ((), found.repaired), "and runs it once"
    anew = [path.stat().st_mtime_ns != time_ns for path, time_ns in zip(files, times, strict=True)]
    assert anew == [name == "two" for name in RECORDS]


def test_a_torn_refusal_is_made_again(campaign: Campaign) -> None:
    refused, stage = Path("results/two/refused.json"), STAGES["turning-points"]
    Path("two.csv").write_text(
        "time_s,angle_rad\n" + "".join(f"{n},1\n" for n in range(400)), "utf-8"
    )
    run(*ORDER)
    before = refused.read_bytes()
    refused.write_bytes(before[:20])
    found = plan(campaign, stage, "all", chunks_of(campaign)["all"]).found
    run(*ORDER)
    assert refused.read_bytes() == before
    after = plan(campaign, stage, "all", chunks_of(campaign)["all"]).found
    assert (after.damages, after.repaired) == ((), found.repaired)
    assert found.repaired.startswith("refused.json:")


def test_a_refusal_that_is_over_is_no_damage(campaign: Campaign) -> None:
    """A stage refused a record, and its file was changed: acquire takes the refusal back."""
    two = Path("two.csv")
    whole, fit = two.read_text(encoding="utf-8"), STAGES["fit"]
    two.write_text("".join(whole.splitlines(keepends=True)[:40]), encoding="utf-8")
    run(*ORDER)
    refused = json.loads(Path("results/two/refused.json").read_text(encoding="utf-8"))
    assert refused["stage"] != "acquire"
    two.write_text(whole, encoding="utf-8")
    before = plan(campaign, fit, "all", chunks_of(campaign)["all"])
    run(*ORDER)
    after = plan(campaign, fit, "all", chunks_of(campaign)["all"])
    assert (before.found, after.found) == (manifest.Findings(), manifest.Findings())


def test_what_a_chunk_says_when_it_is_torn_is_made_again(
    campaign: Campaign, monkeypatch: pytest.MonkeyPatch
) -> None:
    run("acquire")
    acquire, records = STAGES["acquire"], chunks_of(campaign)["all"]
    path = acquire.path(campaign, "all")
    whole = path.read_bytes()
    sound = plan(campaign, acquire, "all", records).found
    path.write_bytes(whole[:100])
    torn = plan(campaign, acquire, "all", records)
    (damage,) = torn.found.damages
    assert damage.path == path
    assert torn.found.repaired != sound.repaired, "a changed parameter runs the job"
    monkeypatch.setenv(manifest.RUN, "")
    manifest.hand_on(anew=[], repaired={str(path): torn.own})
    damage.set_aside()  # as when a run starts
    run("acquire")
    after = plan(campaign, acquire, "all", records).found
    assert (after.damages, after.repaired) == ((), torn.found.repaired), "and runs it once"


def test_records_of_an_instrument_have_a_chunk_each(campaign: Campaign) -> None:
    with Path("records.tsv").open("a", encoding="utf-8") as table:
        table.write("live\tdataq:/dev/none\n")
    assert set(chunks_of(loaded())) == {"all", "record.live"}
    with Path("config.yaml").open("a", encoding="utf-8") as stream:
        stream.write("only: [two]\n")
    assert set(chunks_of(loaded())) == {"record.two"}


@pytest.mark.slow
def test_a_chunk_that_is_killed_ends_the_same_and_repeats_nothing(done: Campaign) -> None:
    """Killed -9 four times, anywhere: what was finished stays, and all ends as undisturbed."""
    undisturbed = {name: sha256(path) for name, path in fits().items()}
    draw = random.Random(1)
    for _ in range(4):
        for name, path in fits().items():
            path.unlink()
            (path.parent / "manifest/fit.json").unlink()
            assert not written({name: path})
        command = [sys.executable, "-m", "pendpipe.cli", *words("fit")]
        job = subprocess.Popen(command, start_new_session=True)
        wanted = draw.randrange(len(RECORDS))
        while job.poll() is None and len(written(fits())) < wanted:
            time.sleep(0.001)
        time.sleep(draw.uniform(0.0, 0.03))
        if job.poll() is None:
            os.killpg(job.pid, signal.SIGKILL)
        job.wait()
        keyed = {
            name: number
            for name, number in written(fits()).items()
            if manifest.read_manifest(Path("results", name), "fit").key
        }
        run("fit")
        assert {name: sha256(path) for name, path in fits().items()} == undisturbed
        assert {name: written(fits())[name] for name in keyed} == keyed
