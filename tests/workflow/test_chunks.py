"""A job does a stage for a chunk of records: what is done stays done, whatever happens."""

import contextlib
import json
import os
import random
import shutil
import signal
import subprocess
import sys
import zipfile
from collections.abc import Callable
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, strategies as st

from pendpipe.cli import main
from pendpipe.configuration.load import Campaign, Record, load_campaign, read_configuration
from pendpipe.stages.archive import gathered, made_in
from pendpipe.stages.chunks import STAGES, Stage, chunks_of, refused, split, tidy

from ..recordings import white

RECORDS = ("one", "two", "three", "four", "five")
ORDER = ("acquire", "calibrate", "turning-points", "fit")

names = st.sets(st.text("abcdefghij0123456789", min_size=1, max_size=6), min_size=1, max_size=80)


def of_names(words: set[str]) -> dict[str, Record]:
    return {word: Record(word, "file.csv") for word in words}


@pytest.mark.slow
@given(names, st.integers(1, 20), st.text("abcdefghij", min_size=1, max_size=6))
def test_an_added_record_changes_one_chunk(words: set[str], batch: int, added: str) -> None:
    before, after = split(of_names(words), batch), split(of_names(words | {added}), batch)
    for chunks, all_words in ((before, words), (after, words | {added})):
        assert sorted(each.record for rows in chunks.values() for each in rows) == sorted(all_words)
        assert max(map(len, chunks.values())) <= batch
    as_sets = [
        {name: {each.record for each in rows} for name, rows in chunks.items()}
        for chunks in (before, after)
    ]
    changed = [name for name, rows in as_sets[0].items() if as_sets[1].get(name) != rows]
    assert len(changed) <= 1


def write_decay(path: Path, seed: int) -> None:
    time_s = np.arange(1200) / 60.0
    angle = 0.05 * np.exp(-time_s / (8.0 + seed)) * np.cos(2.0 * np.pi * time_s) + white(
        seed, len(time_s), 1e-4
    )
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
    """The command of a job, as its rule has it."""
    campaign = loaded()
    before = ORDER[:3] if stage in ("fit", "diagnose") else ORDER[: ORDER.index(stage)]
    reading = [str(STAGES[name].path(campaign, chunk)) for name in before]
    out = str(STAGES[stage].path(campaign, chunk))
    call = ["stage", stage, "--campaign", "config.yaml", "--chunk", chunk, "--out", out]
    return [*call, "--reading", *reading] if reading else call


def run(*stages: str) -> None:
    for stage in stages:
        assert main(words(stage)) == 0


def fits() -> dict[str, bytes]:
    """What the archive of the fits holds of each record."""
    with zipfile.ZipFile(STAGES["fit"].path(loaded(), "all")) as archive:
        return {name: archive.read(f"{name}/fit.json") for name in RECORDS}


@pytest.fixture
def calls(monkeypatch: pytest.MonkeyPatch) -> Callable[[], list[str]]:
    """The records that were fitted since the last question."""
    original, seen = Stage.call, list[str]()

    def counted(stage: Stage, campaign: Campaign, record: Record, *rest: Any) -> list[str]:
        if stage.name == "fit":
            seen.append(record.record)
        return original(stage, campaign, record, *rest)

    monkeypatch.setattr(Stage, "call", counted)

    def since() -> list[str]:
        found, seen[:] = [*seen], []
        return found

    return since


Calls = Callable[[], list[str]]


def test_a_changed_input_is_done_anew_and_no_other(done: Campaign, calls: Calls) -> None:
    before = fits()
    write_decay(Path("two.csv"), 17)
    run(*ORDER)
    assert calls() == ["two"]
    assert [name for name, fit in fits().items() if fit != before[name]] == ["two"]


def test_a_changed_setting_is_done_anew(done: Campaign, calls: Calls) -> None:
    with Path("config.yaml").open("a", encoding="utf-8") as stream:
        stream.write("fit: {method: waveform}\n")
    run("fit")
    assert calls() == list(RECORDS)


def test_what_is_asked_for_once_more_is_done_anew(done: Campaign, calls: Calls) -> None:
    """A job is run only for a reason: where no record has one, it was forced."""
    before = fits()
    run("fit")
    assert calls() == list(RECORDS)
    assert fits() == before


def test_a_chunk_that_is_split_or_alone_takes_over_what_is_done(
    done: Campaign, calls: Calls
) -> None:
    for extra in ("batch: 3", "batch: 3\nonly: [two]"):
        Path("config.yaml").write_text(f"title: Five\nrecords: records.tsv\n{extra}\n", "utf-8")
        for chunk, stage in product(chunks_of(loaded()), ORDER):
            assert main(words(stage, chunk)) == 0
    assert calls() == []
    tidy(done)
    left = {path.name for path in Path("results/chunks").iterdir()}
    assert left == {f"{stage}-all.zip" for stage in ORDER}


def test_one_records_fault_fails_its_chunk_alone_and_names_it(
    campaign: Campaign, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
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
    said = capsys.readouterr().err
    assert "two: ZeroDivisionError: a fault of the program" in said
    assert "Traceback" in said
    assert not STAGES["fit"].path(campaign, "all").exists(), "whole or absent"
    run("fit")
    assert set(fits()) == set(RECORDS)


def test_a_refused_record_stops_no_chunk_and_its_refusal_ends_with_its_fault(
    campaign: Campaign, calls: Calls
) -> None:
    """Its files are stubs with the reason, and one says it in a line."""
    whole = Path("two.csv").read_text(encoding="utf-8")
    Path("two.csv").write_text("".join(whole.splitlines(keepends=True)[:40]), encoding="utf-8")
    run(*ORDER)
    tidy(campaign)
    refusal = Path("results/two/refused.json")
    reason = json.loads(refusal.read_text(encoding="utf-8"))["reason"]
    assert json.loads(fits()["two"])["refused"] == reason
    assert refused(campaign) == ["two"]
    Path("two.csv").write_text(whole, encoding="utf-8")
    calls()
    run(*ORDER)
    tidy(campaign)
    assert calls() == ["two"]
    assert refused(campaign) == []
    assert not refusal.exists()


def test_a_torn_archive_is_set_aside_and_made_again(
    done: Campaign, capsys: pytest.CaptureFixture[str]
) -> None:
    path, before = STAGES["fit"].path(done, "all"), fits()
    path.write_bytes(path.read_bytes()[:-5])
    assert made_in(path) == {}
    run("fit")
    assert "set aside as fit-all.zip.damaged-" in capsys.readouterr().err
    assert fits() == before


def test_records_of_an_instrument_have_a_chunk_each(campaign: Campaign) -> None:
    with Path("records.tsv").open("a", encoding="utf-8") as table:
        table.write("live\tdataq:/dev/none\n")
    assert set(chunks_of(loaded())) == {"all", "record.live"}
    with Path("config.yaml").open("a", encoding="utf-8") as stream:
        stream.write("only: [two]\n")
    assert set(chunks_of(loaded())) == {"record.two"}


@pytest.mark.slow
def test_chunks_of_any_size_give_the_same_results(campaign: Campaign) -> None:
    """With ``batch: 1`` a job a record: every file of a record, byte for byte."""

    def results() -> dict[str, bytes]:
        with gathered(Path("results"), *(stage.output for stage in STAGES.values())) as folder:
            paths = [path for path in folder.rglob("*") if path.is_file()]
            return {str(path.relative_to(folder)): path.read_bytes() for path in paths}

    order = (*ORDER, "diagnose")
    run(*order)
    together = results()
    assert len(together) == 5 * len(RECORDS)
    shutil.rmtree("results")
    Path("config.yaml").write_text("title: Five\nrecords: records.tsv\nbatch: 1\n", "utf-8")
    for chunk, stage in product(chunks_of(loaded()), order):
        assert main(words(stage, chunk)) == 0
    assert results() == together


@pytest.mark.slow
def test_a_chunk_that_is_killed_ends_the_same(done: Campaign) -> None:
    """Killed -9 wherever it is: its archive is whole or absent, and all ends as undisturbed."""
    undisturbed, path = fits(), STAGES["fit"].path(done, "all")
    draw = random.Random(1)
    for _ in range(5):
        path.unlink(missing_ok=True)
        command = [sys.executable, "-m", "pendpipe.cli", *words("fit")]
        job = subprocess.Popen(command, start_new_session=True)
        with contextlib.suppress(subprocess.TimeoutExpired):
            job.wait(draw.uniform(0.2, 2.0))
        if job.poll() is None:
            os.killpg(job.pid, signal.SIGKILL)
        job.wait()
        assert not path.exists() or fits() == undisturbed
    run("fit")
    assert fits() == undisturbed
