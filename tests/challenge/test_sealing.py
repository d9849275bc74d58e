"""Sealed sets, from the command to the page."""
# ruff: noqa: ARG005

import importlib.metadata
import json
import os
import shutil
import sys
import tomllib
from collections.abc import Callable
from importlib.metadata import EntryPoint
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pendpipe import cli
from pendpipe.errors import InputError
from pendpipe_challenge import causes, command, items, sets
from pendpipe_challenge.items import Item, make_item
from pendpipe_challenge.sets import Places, answer_path, make_set, open_set, process_pool, solve_set

# Sealing: the solver sees recordings and nothing else; nothing can be changed unseen.

ENTER = sets.enter
NULL = {"family": "null", "effects": [], "delta_chi2": []}


def make_null(recipe: object, random: np.random.Generator) -> Item:
    """A viscous decay, whatever the recipe."""
    time_s = np.arange(600) / 20.0
    volts = np.exp(-0.02 * time_s) * np.cos(5.0 * time_s) + 1e-3 * random.normal(size=600)
    truth = {"family": "null", "baseline": "eq8", "effects": [], "oracle": None}
    return Item({"time_s": time_s, "volts": volts}, {"volts_per_radian": "3.85"}, truth)


STUB = """
import json, os, pathlib, sys
from pathlib import Path

seen = []
def watch(event, arguments):
    if event == "open" and isinstance(arguments[0], (str, bytes)):
        seen.append(os.fsdecode(arguments[0]))
sys.addaudithook(watch)
here = Path.cwd()
answer = Path(sys.argv[sys.argv.index("--out") + 1])
answer.mkdir()
Path(sys.argv[1]).read_text()
report = {
    "argv": sys.argv, "environment": dict(os.environ), "cwd": str(here),
    "files": sorted(str(p.relative_to(here)) for p in here.rglob("*")), "opened": seen,
}
(answer / "diagnosis.json").write_text(json.dumps({
    "verdict": "consistent", "p_value": 0.5, "effects": [], "report": report,
}))
"""


# The released diagnosis, with everything that it opens written into its answer.
WATCHED = """
import json, os, sys
from pathlib import Path

seen = []
def watch(event, arguments):
    if event in ("open", "os.listdir", "os.scandir") and isinstance(arguments[0], (str, bytes)):
        seen.append(os.path.abspath(os.fsdecode(arguments[0])))
sys.addaudithook(watch)
from pendpipe.cli import main
main(["diagnose", "--figures", "none", *sys.argv[1:]])
path = Path(sys.argv[sys.argv.index("--out") + 1]) / "diagnosis.json"
path.write_text(json.dumps({**json.loads(path.read_text()), "opened": seen}))
"""


@pytest.fixture(scope="module")
def solved(tmp_path_factory: pytest.TempPathFactory) -> Places:
    """A set of nulls, solved by a stub that tells all that it could see."""
    root = tmp_path_factory.mktemp("challenge")
    places = Places(root / "open" / "set", root / "hidden" / "truth")
    patch = pytest.MonkeyPatch()
    patch.setattr(sets, "make_item", make_null)
    patch.setattr(sets, "plan", lambda count, random: [NULL] * count)
    patch.setattr(sets, "process_pool", Alone)
    make_set(places, 3, seed=7)
    patch.undo()
    stub = root / "elsewhere" / "solver.py"
    stub.parent.mkdir()
    stub.write_text(STUB)
    solve_set(places.folder, solver=[sys.executable, str(stub)])
    return places


class Alone:
    """A pool of nobody: what is patched here holds in a worker too."""

    def __init__(self, workers: int) -> None:
        assert workers == 1

    def __enter__(self) -> "Alone":
        return self

    def __exit__(self, *_: object) -> None:
        return None

    map = staticmethod(map)


def test_the_solver_sees_one_recording_and_no_path_of_the_set(solved: Places) -> None:
    for name in ("item-0001", "item-0002", "item-0003"):
        content = json.loads(answer_path(solved.folder, name).read_text())["diagnosis"]["report"]
        assert content["files"] == ["answer", "recording.csv"]
        assert content["argv"][1:] == ["recording.csv", "--out", "answer", "--baseline", "eq8"]
        told = json.dumps([content["argv"], content["environment"], content["cwd"]])
        for secret in (solved.sealed, solved.folder, name):
            assert str(secret) not in told
        assert any(path.endswith("recording.csv") for path in content["opened"])
        assert not any(str(solved.sealed) in path for path in content["opened"])
        cwd = Path(content["cwd"])
        assert solved.sealed not in cwd.parents
        assert not cwd.exists()


@pytest.mark.slow
def test_the_released_diagnosis_opens_nothing_of_the_set(solved: Places, tmp_path: Path) -> None:
    again = tmp_path / "set"
    (again / "recordings").mkdir(parents=True)
    manifest = json.loads(solved.manifest.read_text())
    manifest["items"] = {"item-0001": manifest["items"]["item-0001"]}
    (again / "manifest.json").write_text(json.dumps(manifest))
    shutil.copy(solved.recording("item-0001"), again / "recordings")
    solve_set(again, solver=[sys.executable, "-c", WATCHED])
    answer = json.loads(answer_path(again, "item-0001").read_text())
    assert answer["diagnosis"] is not None, answer["stderr"]
    opened = answer["diagnosis"]["opened"]
    assert any(path.endswith("recording.csv") for path in opened)
    for place in (solved.sealed, solved.folder, again):
        assert not [path for path in opened if path.startswith(str(place))]


def test_the_manifest_was_sealed_before_any_answer(solved: Places) -> None:
    manifest = json.loads(solved.manifest.read_text())
    answers = [json.loads(answer_path(solved.folder, n).read_text()) for n in manifest["items"]]
    assert all(manifest["sealed_at"] <= answer["solved_at"] for answer in answers)
    text = solved.manifest.read_text()
    assert "seed" not in text
    assert "null" not in text.replace("null,", "")


def test_a_set_opens_once_and_every_hash_is_checked(solved: Places) -> None:
    truth = solved.truth("item-0002")
    kept = truth.read_text()
    truth.write_text(kept.replace('"null"', '"single"'))
    with pytest.raises(InputError, match="not what was sealed"):
        open_set(solved)
    truth.write_text(kept)
    answer = answer_path(solved.folder, "item-0003")
    said = answer.read_text()
    answer.write_text(said.replace("consistent", "missing-physics"))
    with pytest.raises(InputError, match="changed after it was hashed"):
        open_set(solved)
    answer.write_text(said)
    opened = json.loads(open_set(solved).read_text())
    assert opened["seed"] == 7
    assert opened["answered_by"] == sets.code_of_the_solver()
    assert opened["sets_before"] == "none"
    assert set(opened["items"]) == {"item-0001", "item-0002", "item-0003"}
    with pytest.raises(InputError, match="opened before"):
        open_set(solved)


def test_the_ledger_holds_every_item_and_no_line_can_go(solved: Places, tmp_path: Path) -> None:
    ledger = solved.folder.parent / "ledger.jsonl"
    assert sets.check_ledger(ledger) == 3
    copy = tmp_path / "ledger.jsonl"
    lines = ledger.read_text().splitlines(keepends=True)
    copy.write_text("".join([lines[0], lines[2]]))
    with pytest.raises(InputError, match="chain of hashes"):
        sets.check_ledger(copy)


def test_the_page_can_tell_which_sets_were_made_before(tmp_path: Path) -> None:
    ledger = tmp_path / "ledger.jsonl"
    assert sets.sets_before(ledger, "third") == "not recorded"
    for name in ("first", "first", "second", "third"):
        sets.enter(ledger, {"set": name, "item": "item-0001"})
    assert sets.sets_before(ledger, "first") == "none"
    assert sets.sets_before(ledger, "third") == "2 (first, second)"
    ledger.write_text("".join(ledger.read_text().splitlines(keepends=True)[1:]))
    assert "chain of hashes" in sets.sets_before(ledger, "third")


def interrupted(*_: object) -> None:
    raise KeyboardInterrupt


def test_an_interrupted_set_goes_on_and_the_ledger_misses_nothing(tmp_path: Path) -> None:
    places = Places(tmp_path / "set", tmp_path / "truth")
    ledger = tmp_path / "ledger.jsonl"
    recipes = [NULL] * 3
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sets, "make_item", make_null)
        patch.setattr(sets, "plan", lambda count, random: recipes[:count])
        patch.setattr(sets, "process_pool", Alone)
        # As if it had stopped between two items: made, and not entered.
        patch.setattr(sets, "enter", interrupted)
        with pytest.raises(KeyboardInterrupt):
            make_set(places, 3, seed=7)
        made = places.recording("item-0001").read_bytes()
        patch.setattr(sets, "enter", ENTER)
        make_set(places, 3, seed=7)
    assert places.recording("item-0001").read_bytes() == made
    assert sets.check_ledger(ledger) == 3
    assert sets.entered(ledger, "set") == {"item-0001", "item-0002", "item-0003"}
    assert sets.entered(ledger, "another") == set()


@pytest.mark.slow
def test_the_same_seed_makes_the_same_file_of_what_a_laboratory_knows_and_no_more() -> None:
    first, second = (make_item(NULL, np.random.default_rng([7, 1])) for _ in range(2))
    assert first.text == second.text
    assert first.truth == second.truth
    lines = first.text.splitlines()
    keys = {line.removeprefix("# ").split(":")[0] for line in lines if line.startswith("#")}
    assert keys == {"volts_per_radian", "bits", "range_volts"}
    assert lines[3] == "time_s,volts"
    assert len(lines) <= 4 + 4000


def test_truth_within_reach_of_the_solver_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="apart"):
        make_set(Places(tmp_path / "set", tmp_path / "set" / "truth"), 1)


def test_an_unsolved_set_is_not_opened(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="not all there"):
        open_set(Places(tmp_path / "set", tmp_path / "truth"))


def test_a_salt_hides_what_was_hashed() -> None:
    assert sets.salted({"a": 1}, "x") != sets.salted({"a": 1}, "y")
    assert sets.salted({"a": 1, "b": 2}, "x") == sets.salted({"b": 2, "a": 1}, "x")


def test_the_plan_has_a_third_nulls_and_many_instrument_decoys() -> None:
    recipes = items.plan(600, np.random.default_rng(0))
    assert len(recipes) == 600
    count = {f: sum(r["family"] == f for r in recipes) for f in items.SHARES}
    assert count["null"] >= 200
    assert all(count[family] >= 25 for family in items.SHARES)
    singles = [r for r in recipes if r["family"] == "single"]
    decoys = [r for r in singles if r["effects"][0] in causes.MEASUREMENT]
    assert len(decoys) >= 0.35 * len(singles)
    assert {size for r in singles for size in r["delta_chi2"]} == set(items.SIZES)
    assert any(r["cancelling"] for r in recipes if r["family"] == "combination")


def test_the_command_says_what_is_missing(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    import argparse

    parser = argparse.ArgumentParser()
    command.add_arguments(parser)
    arguments = parser.parse_args(["score", str(tmp_path), "--out", str(tmp_path)])
    with pytest.raises(InputError, match="not opened"):
        command.run(arguments)


# The makers of items stand beside each other: each keeps to one thread.

TASKS = Path("/proc/self/task")


@pytest.mark.skipif(not TASKS.exists(), reason="no /proc to count a process's threads in")
def test_linear_algebra_in_a_worker_takes_one_thread(monkeypatch: pytest.MonkeyPatch) -> None:
    # As Snakemake has it for a rule of four threads.
    monkeypatch.setenv("OPENBLAS_NUM_THREADS", "4")
    monkeypatch.setenv("OMP_NUM_THREADS", "4")
    monkeypatch.delenv("MKL_NUM_THREADS", raising=False)
    with process_pool(1) as pool:
        pool.submit(np.linalg.inv, np.eye(400)).result()
        assert len(pool.submit(os.listdir, str(TASKS)).result()) == 1
    assert os.environ["OPENBLAS_NUM_THREADS"] == "4"
    assert "MKL_NUM_THREADS" not in os.environ


# `pendpipe challenge` comes with the package beside the library, and only with it.

ROOT = Path(__file__).parents[2]
GROUP = "pendpipe.commands"
Install = Callable[..., None]


@pytest.fixture
def install(monkeypatch: pytest.MonkeyPatch) -> Install:
    """Have exactly these commands come from other packages."""

    def only(*found: EntryPoint) -> None:
        def entry_points(*, group: str) -> tuple[EntryPoint, ...]:
            assert group == GROUP
            return found

        monkeypatch.setattr(importlib.metadata, "entry_points", entry_points)

    return only


def declared() -> EntryPoint:
    """The challenge's command as its own package declares it."""
    with (ROOT / "challenge" / "pyproject.toml").open("rb") as stream:
        (entry,) = tomllib.load(stream)["project"]["entry-points"][GROUP].items()
    return EntryPoint(*entry, GROUP)


def test_without_its_package_the_command_says_what_installs_it(
    install: Install, refusal_of: Any
) -> None:
    install()
    said = refusal_of(["challenge", "make", "set"])
    assert "not installed" in said
    assert "pip install --editable ./challenge" in said


def test_help_lists_the_command_where_it_is_installed_and_nowhere_else(
    install: Install, capsys: pytest.CaptureFixture[str]
) -> None:
    for found in ((), (declared(),)):
        install(*found)
        with pytest.raises(SystemExit, match="0"):
            cli.main(["--help"])
        assert ("\n  challenge " in capsys.readouterr().out) == bool(found)


def test_a_call_that_cannot_be_understood_is_one_line(install: Install, refusal_of: Any) -> None:
    install(declared())
    words = ["challenge", "make", "d", "--sealed", "s", "--items", "x"]
    assert "'x' is not a whole number" in refusal_of(words)


def test_the_wheel_of_the_library_leaves_the_challenge_out() -> None:
    assert not list((ROOT / "src").rglob("*challenge*.py"))
