"""Results on disk say who made them from what, and what is damaged is noticed."""

import errno
import os
import threading
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from pendpipe import provenance
from pendpipe.errors import DamagedError, InputError, UnwritableError
from pendpipe.files import read_json, replaced, write_json
from pendpipe.stages import watch as watch_module
from pendpipe.stages.archive import made_in, members, pack, unpack
from pendpipe.stages.refusal import reason_of, run_stage
from pendpipe.stages.watch import Watch

from ..refusals import refused

# A result is whole and undamaged, or absent; a refusal says why, and a damage is mended.


def test_a_failure_leaves_the_old_file_and_nothing_else(tmp_path: Path) -> None:
    path = tmp_path / "result.csv"
    path.write_text("# made_by: pendpipe 0\n")
    with pytest.raises(RuntimeError), replaced(path) as stream:
        stream.write("half")
        raise RuntimeError
    assert path.read_text() == "# made_by: pendpipe 0\n"
    assert list(tmp_path.iterdir()) == [path]


def test_json_has_null_where_there_is_no_finite_value(tmp_path: Path) -> None:
    content = {"a": np.float64("nan"), "b": [1.0, float("inf")], "c": np.arange(2)}
    write_json(tmp_path / "x.json", content)
    assert read_json(tmp_path / "x.json") == {"a": None, "b": [1.0, None], "c": [0, 1]}


@pytest.mark.parametrize("content", ["", '{"a": 1', "[" * 100_000, "\x00"])
def test_a_torn_json_is_named_in_one_line(tmp_path: Path, content: str) -> None:
    path = tmp_path / "fit.json"
    path.write_text(content)
    with refused("fit.json: "):
        read_json(path)


def test_a_pipe_is_written_to_and_not_replaced(tmp_path: Path) -> None:
    if not hasattr(os, "mkfifo"):
        pytest.skip("this system has no named pipes")
    pipe = tmp_path / "pipe.csv"
    os.mkfifo(pipe)
    got: list[str] = []
    reader = threading.Thread(target=lambda: got.append(pipe.read_text(encoding="utf-8")))
    reader.start()
    with replaced(pipe) as stream:
        stream.write("time_s,volts\n")
    reader.join(10)
    assert got == ["time_s,volts\n"]
    assert pipe.is_fifo()
    assert list(tmp_path.iterdir()) == [pipe]


def with_its_old_time(path: Path, change: Callable[[bytes], bytes]) -> None:
    """Change a file and put its time of modification back."""
    before = path.stat()
    path.write_bytes(change(path.read_bytes()))
    os.utime(path, ns=(before.st_atime_ns, before.st_mtime_ns))


CHANGES = {
    "torn": lambda content: content[:-5],
    "empty": lambda content: content[:0],
    "torn or altered": lambda content: content.replace(b"1", b"7"),
}


@pytest.fixture
def fit(tmp_path: Path) -> Path:
    path = tmp_path / "fit.json"
    write_json(path, {"schema_version": 1, "a": 1})
    return path


def planned(path: Path) -> Watch:
    """A plan that looks at a file, and keeps what it saw beside it."""
    watch = Watch(path.with_name("seen.json"))
    watch.history(str(path))
    watch.keep()
    return watch


@pytest.mark.parametrize("problem", CHANGES)
def test_a_plan_notices_a_change_under_the_old_time_and_asks_for_one_run(
    fit: Path, problem: str
) -> None:
    """The history of damages is a rule's parameter: it changes once, and stays when all is well."""
    whole = fit.read_bytes()
    assert planned(fit).damages == planned(fit).damages == []
    with_its_old_time(fit, CHANGES[problem])
    for _ in range(2):  # a dry run, and the run
        watch = planned(fit)
        (damage,) = watch.damages
        assert problem in str(damage)
        assert watch.history(str(fit)) == damage.found
    assert damage.set_aside() == f"set aside as fit.json.damaged-{damage.found}"
    assert planned(fit).damages == []  # Snakemake sees that it is missing
    fit.write_bytes(whole)
    after = planned(fit)
    assert (after.damages, after.history(str(fit))) == ([], damage.found)


def test_a_plan_reads_only_what_has_changed(fit: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    source = fit.with_name("decay.csv")
    source.write_text("0,1\n")
    first = planned(fit)
    before = first.sha256(source)
    first.keep()
    with monkeypatch.context() as patched:
        for name in ("sha256", "damage_of"):
            patched.setattr(watch_module, name, breaks)
        again = planned(fit)
        assert (again.sha256(source), again.damages) == (before, [])
    with_its_old_time(source, lambda content: content.replace(b"1", b"7"))
    assert planned(fit).sha256(source) not in (before, None)
    assert planned(fit).sha256(fit.with_name("none.csv")) is None


def test_an_archive_gives_back_what_was_put_in_and_the_same_bytes(
    tmp_path: Path, fit: Path
) -> None:
    paths = [tmp_path / f"{name}.zip" for name in "ab"]
    record = tmp_path / "air-01/fit.json"
    record.parent.mkdir()
    for path in paths:
        record.write_bytes(fit.read_bytes())
        pack(path, tmp_path, [record], {"air-01": {"code": "1"}})
        record.unlink()
    assert paths[0].read_bytes() == paths[1].read_bytes()
    assert made_in(paths[0]) == {"air-01": {"code": "1"}}
    assert members(paths[0]) == ["air-01/fit.json"]
    unpack(paths[0], tmp_path)
    assert record.read_bytes() == fit.read_bytes()


@pytest.mark.parametrize("problem", CHANGES)
def test_a_job_reads_no_archive_that_is_not_as_it_was_written(
    tmp_path: Path, fit: Path, problem: str
) -> None:
    """With its length and all its times as before, too."""
    path = tmp_path / "fit-all.zip"
    pack(path, tmp_path, [fit], {})
    path.write_bytes(CHANGES[problem](path.read_bytes()))
    with pytest.raises(DamagedError, match=r"set aside as fit-all\.zip\.damaged-.*run snakemake"):
        unpack(path, tmp_path / "out")
    assert not path.exists()
    assert not (tmp_path / "out").exists()


def fails() -> None:
    raise InputError("a.csv", "there is no decay", "record one")


def breaks(*_: object) -> None:
    raise ZeroDivisionError


def test_a_refused_record_leaves_one_line_and_whole_stubs(tmp_path: Path) -> None:
    refused, out = tmp_path / "refused.json", tmp_path / "fit.json"
    run_stage("fit", "x", fails, outputs=[out], refused=refused)
    assert read_json(refused) == {
        "schema_version": 1,
        "record": "x",
        "stage": "fit",
        "reason": "a.csv: there is no decay; record one",
    }
    assert read_json(out)["refused"] == "a.csv: there is no decay; record one"


@pytest.mark.parametrize(
    "folder",
    [
        "/home/me/data",
        "/home/my data",
        "/home/a,b/c  d (1)",
        "C:/Users/R. D. P",
        "/home/été/\u202eabc;",
    ],
)
def test_a_refusal_names_no_folder_however_it_is_called(tmp_path: Path, folder: str) -> None:
    source = Path(folder, "run 7.csv")

    def fails_there() -> None:
        raise InputError(f"{source}, line 3", "no number", f"fix {source}")

    refused = tmp_path / "x/refused.json"
    outputs = [tmp_path / "x/recording.csv"]
    run_stage("acquire", "x", fails_there, outputs=outputs, refused=refused, sources=[source])
    assert read_json(refused)["reason"] == "run 7.csv, line 3: no number; fix run 7.csv"


def test_the_stages_after_a_refusal_pass_it_on_until_the_record_is_mended(tmp_path: Path) -> None:
    refused, out = tmp_path / "refused.json", tmp_path / "fit.json"
    recording = tmp_path / "recording.csv"
    run_stage("acquire", "x", fails, outputs=[recording], refused=refused)
    run_stage("fit", "x", breaks, outputs=[out], refused=refused)
    assert "no decay" in read_json(out)["refused"]
    run_stage("acquire", "x", lambda: write(recording, ""), outputs=[recording], refused=refused)
    assert reason_of(refused) is None


def is_torn() -> None:
    raise DamagedError(Path("recording.csv"), "it is torn", "run again")


def has_no_room() -> None:
    with replaced(Path("fit.json")):
        raise OSError(errno.EFBIG, "File too large")


@pytest.mark.parametrize(
    ("fault", "kind"),
    [
        (fails, InputError),
        (breaks, ZeroDivisionError),
        (is_torn, DamagedError),
        (has_no_room, UnwritableError),
    ],
)
def test_what_is_no_refusal_ends_the_program(
    fault: Callable[[], None],
    kind: type[Exception],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Without a place for refusals; of the program; a damaged input; a full disk."""
    monkeypatch.chdir(tmp_path)
    refused = None if fault is fails else Path("refused.json")
    with pytest.raises(kind):
        run_stage("fit", "x", fault, outputs=[Path("fit.json")], refused=refused)
    assert list(tmp_path.iterdir()) == []


def write(path: Path, text: str) -> None:
    path.write_text(text)


# Another version of pendpipe makes the results anew.


@pytest.mark.parametrize(
    ("edited", "changes"),
    [
        ("commands/fit.py", True),
        ("formats/dialects/windaq.py", True),
        ("report/templates/page.html", True),
        ("figures/pendpipe.mplstyle", True),
        # (It counts commits.)
        ("_version.py", False),
        # What Python makes of the source.
        ("__pycache__/api.cpython-311.pyc", False),
    ],
)
def test_the_version_of_the_code_is_that_of_its_source(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, edited: str, changes: bool
) -> None:
    found = []
    for number in range(2):
        package = tmp_path / str(number)
        for name in ("api.py", edited):
            (package / name).parent.mkdir(parents=True, exist_ok=True)
        (package / "api.py").write_text("")
        (package / edited).write_text(f"x = {number}\n")
        monkeypatch.setattr(provenance, "PACKAGE", package)
        provenance.code_version.cache_clear()
        found.append(provenance.code_version())
    provenance.code_version.cache_clear()
    assert (found[0] != found[1]) == changes
