"""Where nothing can be written, each command says so in one line and ends with status 2."""

import json
import shutil
from pathlib import Path

import pytest

from pendpipe.cli import main
from pendpipe.errors import InputError
from pendpipe.files import check_writable, replaced

ROOT = Path(__file__).parents[2]


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A project whose configuration is the default one, with a file where a folder should be."""
    shutil.copytree(ROOT / "config", tmp_path / "config")
    (tmp_path / "file").write_text("kept")
    (tmp_path / "comparison.json").write_text(json.dumps({"records": []}))
    (tmp_path / "table.csv").write_text("angle_rad,volts\n0,0\n0.1,0.4\n0.2,0.8\n0.3,1.2\n")
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize(
    "call",
    [
        "separate --campaign config/config.yaml --out file/x.json",
        "compare --campaign config/config.yaml --separation s.json --out file/x --summary file/y",
        "figures --campaign campaign.json --comparison comparison.json --out file/figures",
        "report --campaign campaign.json --comparison comparison.json --summary comparison.json"
        " --out file/page.html",
        "calibrate table.csv --out file/sensor.json",
        "acquire --device simulated:di2108 --rate 100 --duration 0.2 --out file/x.csv",
        "acquire --campaign config/config.yaml --caliper --out file/caliper.csv",
        "acquire --campaign config/config.yaml --record air-01 --out file/x.csv",
    ],
)
def test_a_place_that_cannot_be_written_is_one_line(
    folder: Path, call: str, capsys: pytest.CaptureFixture[str]
) -> None:
    (folder / "campaign.json").write_text(json.dumps({"results": "file"}))
    configuration = folder / "config/config.yaml"
    text = configuration.read_text(encoding="utf-8")
    configuration.write_text(text.replace("results: results", "results: r"), encoding="utf-8")
    assert main(call.split()) == 2
    lines = [line for line in capsys.readouterr().err.splitlines() if line.startswith("pendpipe")]
    assert len(lines) == 1
    assert "file" in lines[0]
    assert (folder / "file").read_text() == "kept"


def test_a_full_disk_is_named_and_leaves_no_half_file(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"x\.csv: .*[Nn]o space"), replaced(tmp_path / "x.csv"):
        raise OSError(28, "No space left on device")
    assert list(tmp_path.iterdir()) == []


def test_a_name_that_is_too_long_is_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="too long"), replaced(tmp_path / ("x" * 300)):
        raise AssertionError


def test_results_are_tried_before_a_run(tmp_path: Path) -> None:
    check_writable(tmp_path / "new")
    assert list((tmp_path / "new").iterdir()) == []
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="not a folder"):
        check_writable(tmp_path / "file")
