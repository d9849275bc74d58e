"""The README's lines of Python, from arrays to numbers, a table, a figure and a paragraph."""

from pathlib import Path

import matplotlib as mpl
import numpy as np
import pytest

import pendpipe as pp

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
    fit.save(tmp_path / "fit")
    pp.diagnose(names["recording"]).save(tmp_path / "fit")
    made = {path.name for path in (tmp_path / "fit").iterdir()}
    assert {"fit.json", "turning_points.csv", "fit.svg", "diagnosis.json"} <= made
