"""Results on disk say who made them from what, and what is damaged is noticed."""

import errno
import os
import re
import threading
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from pendpipe import __version__, manifest, provenance
from pendpipe.errors import DamagedError, InputError, UnwritableError
from pendpipe.files import read_json, replaced, write_json
from pendpipe.stages.refusal import reason_of, run_stage

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
    with pytest.raises(DamagedError, match=r"fit\.json: ") as caught:
        read_json(path)
    assert "\n" not in str(caught.value)


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


@pytest.fixture
def home(tmp_path: Path) -> Path:
    """A record whose stage `acquire` wrote a recording, and `fit` a fit made from it."""
    recording, fit = tmp_path / "recording.csv", tmp_path / "fit.json"
    with manifest.job(tmp_path, "acquire") as written:
        recording.write_text("time_s,volts\n0.0,1.0\n0.1,2.0\n")
        written.append(recording)
    with manifest.job(tmp_path, "fit", inputs=[recording]) as written:
        fit.write_text('{"a": 1}\n')
        written.append(fit)
    return tmp_path


def with_its_old_time(path: Path, change: Callable[[bytes], bytes]) -> None:
    """Change a file and put its time of modification back."""
    before = path.stat()
    path.write_bytes(change(path.read_bytes()))
    os.utime(path, ns=(before.st_atime_ns, before.st_mtime_ns))


def cut(content: bytes) -> bytes:
    return content[:-5]


def emptied(_: bytes) -> bytes:
    return b""


def altered(content: bytes) -> bytes:
    return content.replace(b"1", b"7")


def noticed(home: Path) -> list[str]:
    return list(map(str, manifest.look_through(manifest.manifests(home)).damages))


def history(home: Path) -> str:
    return manifest.look_through([manifest.read_manifest(home, "fit")]).repaired


def run_fit(home: Path) -> None:
    with manifest.job(home, "fit", inputs=[home / "recording.csv"]) as written:
        (home / "fit.json").write_text('{"a": 1}\n')
        written.append(home / "fit.json")


@pytest.mark.parametrize(
    ("change", "problem"), [(cut, "torn"), (emptied, "empty"), (altered, "altered")]
)
def test_a_job_sets_a_damaged_input_aside_and_does_not_run(
    home: Path, change: Callable[[bytes], bytes], problem: str
) -> None:
    recording = home / "recording.csv"
    with_its_old_time(recording, change)
    damaged = recording.read_bytes()
    with (
        pytest.raises(DamagedError, match=f"recording.csv: it .*{problem}.* snakemake") as caught,
        manifest.job(home, "fit", inputs=[recording]),
    ):
        raise AssertionError
    assert "\n" not in str(caught.value)
    assert not recording.exists()
    (kept,) = home.glob("recording.csv.damaged-*")
    assert kept.read_bytes() == damaged


def test_a_clock_that_was_set_back_hides_no_damage(
    home: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Then the time of a change says nothing, and everything is hashed."""
    (home / "fit.json").write_text('{"a": 2}\n')
    monkeypatch.setattr(manifest, "_changed_ns", lambda _: 0)
    assert noticed(home) == []
    monkeypatch.setattr("pendpipe.manifest.time.time_ns", lambda: 0)
    (line,) = noticed(home)
    assert "fit.json" in line


def test_a_damage_changes_the_rules_parameter_once(home: Path) -> None:
    """It is new when the damage is noticed, and the same after the repair."""
    assert history(home) == ""
    with_its_old_time(home / "fit.json", emptied)
    planned = history(home)
    assert planned == "fit.json:e3b0c442"
    run_fit(home)
    assert history(home) == planned
    assert noticed(home) == []
    with_its_old_time(home / "fit.json", emptied)
    assert history(home) == f"{planned} {planned}"


def test_a_damage_that_snakemake_deletes_before_the_job_runs_it_once(
    home: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The job inherits what planning found, and no start of the same run adds to it."""
    with_its_old_time(home / "fit.json", emptied)
    planned = history(home)
    path = manifest.read_manifest(home, "fit").path
    monkeypatch.setenv(manifest.RUN, "")
    manifest.hand_on(anew=[], repaired={str(path): planned})
    for _ in range(2):
        (home / "fit.json").unlink()
        run_fit(home)
        assert (history(home), noticed(home)) == (planned, [])


def test_a_change_of_any_byte_of_a_manifest_is_damage_and_runs_the_stage_once(
    home: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = home / "manifest/fit.json"
    whole = path.read_bytes()
    flipped = [whole[:n] + bytes([whole[n] ^ 1]) + whole[n + 1 :] for n in range(len(whole))]
    for content in (b"", whole[:-1], *flipped):
        path.write_bytes(content)
        assert len(noticed(home)) == 1, content
    planned = history(home)
    run_fit(home)
    assert "this list of results is torn or altered; set aside" in capsys.readouterr().err
    assert (history(home), noticed(home)) == (planned, [])


def test_a_manifest_of_an_earlier_version_is_none(home: Path) -> None:
    """It had another check. The code is another, so its stage runs again; nothing is damaged."""
    path = home / "manifest/fit.json"
    path.write_text(re.sub(" sha256:[0-9a-f]*", "", path.read_text()))
    assert not manifest.read_manifest(home, "fit").outputs
    assert noticed(home) == []


def test_a_manifest_states_its_form_its_stage_and_who_wrote_it(home: Path) -> None:
    path = manifest.read_manifest(home, "fit").path
    stated = {name: read_json(path)[name] for name in ("schema_version", "stage", "version")}
    assert stated == {"schema_version": 1, "stage": "fit", "version": __version__}


def test_a_sound_copy_of_the_results_is_sound(home: Path) -> None:
    """A copy has new times of change: its files are hashed, and found as they were."""
    for path in [*home.glob("*.*"), *home.glob("manifest/*")]:
        path.write_bytes(path.read_bytes())
    assert noticed(home) == []


def test_a_result_made_from_another_recording_is_not_read(home: Path) -> None:
    with manifest.job(home, "acquire") as written:
        (home / "recording.csv").write_text("time_s,volts\n0.0,3.0\n")
        written.append(home / "recording.csv")
    with pytest.raises(DamagedError, match=r"made from another recording\.csv"):
        manifest.check([home / "fit.json"])


def test_a_result_from_before_there_were_manifests_is_read(home: Path) -> None:
    for path in home.glob("manifest/*"):
        path.unlink()
    with_its_old_time(home / "recording.csv", cut)
    assert home / "recording.csv" in manifest.check([home / "recording.csv"])


def test_a_source_is_recorded_and_never_touched(home: Path, tmp_path: Path) -> None:
    source = tmp_path / "run 7.csv"
    source.write_text("mine\n")
    with manifest.job(home, "acquire", sources=[source]):
        pass
    before = manifest.source_sha256(manifest.read_manifest(home, "acquire"), source)
    with_its_old_time(source, bytes)  # written again as it was
    assert manifest.source_sha256(manifest.read_manifest(home, "acquire"), source) == before
    with_its_old_time(source, cut)
    assert manifest.source_sha256(manifest.read_manifest(home, "acquire"), source) != before
    assert noticed(home) == []
    assert source.exists()


def test_a_stage_that_fails_leaves_no_claim_about_its_results(home: Path) -> None:
    with pytest.raises(ZeroDivisionError), manifest.job(home, "fit"):
        raise ZeroDivisionError
    assert read_json(home / "manifest/fit.json")["outputs"] == {}


def fails() -> None:
    raise InputError("a.csv", "there is no decay", "record one")


def breaks() -> None:
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


@pytest.mark.parametrize(("fault", "kind"), [("fails", InputError), ("breaks", ZeroDivisionError)])
def test_what_is_no_refusal_ends_the_program(
    fault: str, kind: type[Exception], tmp_path: Path
) -> None:
    """A fault of the program's own, and one without a place for refusals."""
    refused = tmp_path / "refused.json" if fault == "breaks" else None
    with pytest.raises(kind):
        run_stage("fit", "x", globals()[fault], outputs=[tmp_path / "fit.json"], refused=refused)
    assert not (tmp_path / "refused.json").exists()


def test_a_damaged_result_refuses_no_record(tmp_path: Path) -> None:
    recording, fit = tmp_path / "recording.csv", tmp_path / "fit.json"
    refused = tmp_path / "refused.json"
    run_stage(
        "acquire", "x", lambda: write(recording, "whole"), outputs=[recording], refused=refused
    )
    write(recording, "torn")
    with pytest.raises(DamagedError):
        run_stage("fit", "x", fails, outputs=[fit], refused=refused, inputs=[recording])
    assert not refused.exists()
    assert not fit.exists()


def write(path: Path, text: str) -> None:
    path.write_text(text)


def test_a_full_disk_refuses_no_record(tmp_path: Path) -> None:
    refused, out = tmp_path / "x/refused.json", tmp_path / "x/recording.csv"

    def has_no_room() -> None:
        with replaced(out):
            raise OSError(errno.EFBIG, "File too large")

    with pytest.raises(UnwritableError, match="too large"):
        run_stage("acquire", "x", has_no_room, outputs=[out], refused=refused)
    assert not refused.exists()
    assert not out.exists()


# Editing the library changes the version of what depends on it, and of nothing else.


@pytest.fixture
def library(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A library of three modules: `stage` uses `used`, inside a function; `other` stands alone."""
    package = tmp_path / "pendpipe"
    package.mkdir()
    (package / "__init__.py").write_text("")
    (package / "stage.py").write_text("def run():\n    from pendpipe.used import x\n    return x\n")
    (package / "used.py").write_text("x = 1\n")
    (package / "other.py").write_text("y = 1\n")
    monkeypatch.setattr(provenance, "PACKAGE", package)
    return package


def version() -> str:
    for kept in (provenance._imports, provenance._files):
        kept.cache_clear()
    return provenance.code_version("pendpipe.stage")


BY_NAME = "import importlib\nkind = 'text'\nx = importlib.import_module({})\n"
OWN = 'import importlib\nfound = [importlib.import_module(f"{__name__}.{n}") for n in ["text"]]\n'


@pytest.mark.parametrize(
    ("stage", "edited", "changes"),
    [
        ("", "used.py", True),
        ("", "stage.py", True),
        ("", "other.py", False),
        ("from pendpipe._version import version\n", "_version.py", False),
        ("from pendpipe.readers import draw\n", "readers/templates/page.html", True),
        # Which reader a file needs is known only at run time: each of them counts.
        (BY_NAME.format('"pendpipe.readers.text"'), "readers/text.py", True),
        (BY_NAME.format('f"pendpipe.readers.{kind}"'), "readers/text.py", True),
        # A package that imports its own modules.
        ("from pendpipe import readers\n", "readers/text.py", True),
    ],
)
def test_the_version_follows_what_is_imported(
    library: Path, stage: str, edited: str, changes: bool
) -> None:
    (library / "readers/templates").mkdir(parents=True)
    (library / "readers/__init__.py").write_text(OWN if "import readers" in stage else "draw = 1\n")
    (library / "readers/text.py").write_text("x = 1\n")
    (library / "readers/templates/page.html").write_text("before")
    if stage:
        (library / "stage.py").write_text(stage)
    before = version()
    (library / edited).write_text("x = y = 2\n")
    assert (version() != before) == changes


def test_the_readers_of_files_count() -> None:
    """They are imported by name, each when a file needs it."""
    dialects = "pendpipe.formats.dialects"
    assert dialects in provenance._imports("pendpipe.formats.reading")
    assert {f"{dialects}.windaq", f"{dialects}.octave"} <= provenance._imports(dialects)
    assert "pendpipe.formats.trees" in provenance._imports(f"{dialects}.arrays")


@pytest.mark.parametrize(
    ("stage", "other"),
    [
        ("commands.calibrate", "analysis.fit"),
        ("commands.turning_points", "diagnosis.search"),
        ("commands.turning_points", "figures.style"),
        ("commands.fit", "acquisition.recorder"),
        ("commands.diagnose", "acquisition.recorder"),
        ("commands.acquire", "diagnosis.search"),
        ("stages.compare", "figures.style"),
    ],
)
def test_editing_what_a_stage_does_not_run_reruns_nothing(stage: str, other: str) -> None:
    assert f"pendpipe.{other}" not in provenance.imported(f"pendpipe.{stage}")


def test_the_versions_of_all_commands_can_be_found() -> None:
    """An import that can't be followed would keep the workflow from starting."""
    for path in (provenance.PACKAGE / "commands").glob("*.py"):
        assert len(provenance.code_version(f"pendpipe.commands.{path.stem}")) == 12
