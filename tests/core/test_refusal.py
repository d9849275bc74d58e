"""A record that can't be used leaves its reason and stands in nobody's way."""

import errno
from pathlib import Path

import pytest

from pendpipe.errors import DamagedError, InputError, UnwritableError
from pendpipe.files import read_json, replaced
from pendpipe.stages.refusal import reason_of, run_stage


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
