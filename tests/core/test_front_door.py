"""The lines of the README, the pages and the notebook do what they say."""

import json
import os
import re
import shlex
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import matplotlib as mpl
import numpy as np
import pytest

import pendpipe as pp
from pendpipe import cli
from pendpipe.recording import write_plain

README = Path(__file__).parents[2] / "README.md"


def test_the_lines_of_the_readme_answer(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    mpl.use("Agg")
    time_s = np.arange(3000) / 50.0
    noise = 1e-4 * np.random.default_rng(1).standard_normal(3000)
    angle_rad = 0.1 * np.exp(-0.01 * time_s) * np.cos(4.0 * time_s) + noise
    lines = README.read_text().split("```python\n")[1].split("```")[0]
    names = {"time_s": time_s, "angle_rad": angle_rad}
    exec(lines, names)
    printed = capsys.readouterr().out
    assert "period" in printed
    assert "nothing is missing" in printed

    fit = names["fit"]
    assert fit["b"].value == pytest.approx(0.01, abs=4.0 * fit["b"].sd)
    frame = fit.to_frame()
    assert frame.loc["b", "value"] == fit.to_dict()["parameters"]["b"]["value"]
    assert (frame.low95 <= frame.value).all()
    assert (frame.value <= frame.high95).all()
    assert fit.plot().axes[0].get_xlabel() == "Time (s)"
    with pytest.raises(pp.errors.InputError, match=r"plot: .*take that of pendpipe\.fit"):
        replace(fit, drawn_by=None).plot()
    fit.save(tmp_path / "fit")
    pp.diagnose(names["recording"]).save(tmp_path / "fit")
    made = {path.name for path in (tmp_path / "fit").iterdir()}
    assert {"fit.json", "turning_points.csv", "fit.svg", "diagnosis.json"} <= made


SET_UP = re.compile(r"\.venv|pip install|\bmake ")
PAGES = [README, *sorted((README.parent / "docs").glob("*.md"))]
INSTRUMENT = re.compile(r"--port|--anew")


@pytest.mark.parametrize(
    "page", [README, *sorted((README.parent / "docs").glob("*.md"))], ids=lambda page: page.name
)
def test_the_commands_of_the_pages_run(page: Path, tmp_path: Path) -> None:
    """Those that need an instrument have options that there are; CI does what the set-up says."""
    blocks = re.findall(r"```sh\n(.*?)```", page.read_text(encoding="utf-8"), re.DOTALL)
    shutil.copytree(README.parent / "examples", tmp_path / "examples")
    (tmp_path / "data").mkdir()
    time_s = np.arange(600) / 20.0
    noise = 1e-3 * np.random.default_rng(1).standard_normal(600)
    angle_rad = 0.1 * np.exp(-0.02 * time_s) * np.cos(4.0 * time_s) + noise
    for name in ("swing.csv", "data/rod.csv", "data/string.csv"):
        write_plain(tmp_path / name, pp.Recording(time_s, angle_rad, "angle_rad"))
    angles = "\n".join(f"{0.4 * step:g},{0.1 * step:g}" for step in range(-4, 5))
    (tmp_path / "caliper.csv").write_text(f"volts,angle_rad\n{angles}\n", encoding="utf-8")
    heights = "\n".join(f"{1.42 * cycle:g},{20 - 0.8 * cycle:g}" for cycle in range(15))
    (tmp_path / "ruler.csv").write_text(f"time (s),amplitude (cm)\n{heights}\n", encoding="utf-8")
    tools = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    for block in blocks:
        lines = [line for line in block.splitlines() if line.strip() and not SET_UP.search(line)]
        for line in filter(INSTRUMENT.search, lines):
            assert cli.parse(shlex.split(line, comments=True)[1:]).declared
        done = subprocess.run(
            ["bash", "-ec", "\n".join(line for line in lines if not INSTRUMENT.search(line))],
            cwd=tmp_path,
            env=os.environ | {"PATH": tools, "MPLBACKEND": "Agg"},
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == 0, f"{block}\n{done.stderr}"


EXAMPLES = Path(__file__).parents[2] / "examples"


def test_every_cell_of_the_notebook_runs(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(EXAMPLES)
    notebook = json.loads((EXAMPLES / "first_steps.ipynb").read_text(encoding="utf-8"))
    cells = ["".join(cell["source"]) for cell in notebook["cells"] if cell["cell_type"] == "code"]
    assert len(cells) > 5
    names: dict[str, object] = {}
    for source in cells:
        exec(compile(source, "first_steps.ipynb", "exec"), names)
