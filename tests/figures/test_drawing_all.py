"""All figures of a campaign on disk: complete, reproducible, and honest about what is missing."""

import shutil
import xml.etree.ElementTree as ET
from dataclasses import replace
from pathlib import Path
from typing import Any

import matplotlib as mpl
import pytest

from pendpipe.cli import main
from pendpipe.figures.campaign import draw_all, draw_fig03, draw_fig09
from pendpipe.figures.decays import draw_decay, read_decay
from pendpipe.figures.style import save
from pendpipe.quantities import prefixed, with_error

PAPER = [f"fig{number:02d}" for number in range(3, 11)]


@pytest.fixture
def small(example: Any, tmp_path: Path) -> tuple[dict[str, Any], Path]:
    """Three records of the campaign, in a folder of their own."""
    names = ("water-high-1", "water-low-7", "air-01")
    for name in names:
        shutil.copytree(example.folder / name, tmp_path / name)
    records = [e for e in example.content["records"] if e["record"] in names]
    return {**example.content, "records": records}, tmp_path


def test_every_figure_is_there_as_svg_and_png_however_many_processes_draw(
    small: tuple[dict[str, Any], Path], tmp_path: Path
) -> None:
    content, folder = small
    alone = draw_all(content, folder, tmp_path / "one")
    assert alone.left_out == {"causes": "the records were not diagnosed together"}
    for name in PAPER:
        assert ET.parse(tmp_path / f"one/{name}.svg").getroot().tag.endswith("svg")
        assert (tmp_path / f"one/{name}.png").read_bytes().startswith(b"\x89PNG")
    for entry in content["records"]:
        assert (folder / entry["record"] / "figures/decay.svg").is_file()
    bytes_alone = [(file.name, file.read_bytes()) for file in alone.files]
    together = draw_all(content, folder, tmp_path / "two", processes=2)
    assert [(file.name, file.read_bytes()) for file in together.files] == bytes_alone


def test_the_same_data_give_the_same_bytes(example: Any, tmp_path: Path) -> None:
    first, second = (
        save(draw_fig09(example.content), tmp_path / folder / "fig09") for folder in ("a", "b")
    )
    for one, other in zip(first, second, strict=True):
        assert one.read_bytes() == other.read_bytes()


def test_letters_stay_letters_and_no_axis_has_an_offset(example: Any, tmp_path: Path) -> None:
    svg, _ = save(draw_fig03(example.content["calibration"]), tmp_path / "fig03")
    words = "".join(ET.parse(svg).getroot().itertext())
    assert "Sensor output (V)" in words
    assert "1e" not in words


def test_drawing_leaves_matplotlib_as_it_was(example: Any) -> None:
    before = dict(mpl.rcParams)
    draw_fig09(example.content)
    assert dict(mpl.rcParams) == before


def test_a_name_with_a_dollar_is_no_formula(example: Any, tmp_path: Path) -> None:
    entry = next(e for e in example.content["records"] if e["record"] == "air-01")
    found = read_decay(example.folder, entry)
    hostile = replace(found, record="$\\frac{ & <b>")
    svg, _ = save(draw_decay(hostile), tmp_path / "decay")
    assert "$\\frac{ & <b>" in "".join(ET.parse(svg).getroot().itertext())


def test_recordings_of_others_have_their_decays_only(small: tuple[dict[str, Any], Path]) -> None:
    content, folder = small
    bare = {
        "records": [*content["records"], {"record": "gone", "refused": "gone.csv: no decay"}],
        "has_theory": False,
        "typical_record": None,
        "calibration": None,
    }
    drawn = draw_all(bare, folder, folder / "figures")
    assert not (folder / "figures").exists()
    assert len(drawn.files) == len(content["records"])
    assert "refused" in drawn.left_out["gone, decay"]


def test_the_command_draws_and_says_what_it_left_out(
    small: tuple[dict[str, Any], Path], example: Any, capsys: pytest.CaptureFixture[str]
) -> None:
    from pendpipe.files import write_json

    content, folder = small
    write_json(folder / "c.json", {"results": folder.as_posix()})
    write_json(folder / "comparison.json", {**content, "calibration": None})
    out, comparison = folder.parent / "elsewhere", str(folder / "comparison.json")
    words = ["figures", "--campaign", str(folder / "c.json"), "--out", str(out), "--comparison"]
    assert main([*words, comparison]) == 0
    said = capsys.readouterr().err
    assert "fig03 is not drawn" in said
    # The workflow counts on figures 3 to 10: the reason stands in the place of figure 3.
    assert {path.stem for path in out.glob("*.svg")} == set(PAPER)
    assert "no calibration" in "".join(ET.parse(out / "fig03.svg").getroot().itertext())
    assert (out / "fig04.svg").as_posix() in (out / "drawn.json").read_text()
    assert main([*words, str(folder / "nowhere.json")]) == 2
    assert capsys.readouterr().err.count("\n") == 1


@pytest.mark.parametrize(
    ("value", "sd", "unit", "text"),
    [
        (3.85031, 0.00072, "V/rad", "(3.85031 ± 0.00072) V/rad"),
        (1.4291e-6, 2.6e-8, "rad/s", "(1.429 ± 0.026) × 10⁻⁶ rad/s"),
        (-5.7679, 0.0054, "", "−5.7679 ± 0.0054"),
        (1234.0, 117.0, "", "1230 ± 120"),
        (0.5, 0.0995, "", "0.50 ± 0.10"),
        (136.0, None, "", "136"),
        (float("nan"), 1.0, "Hz", "–"),
    ],
)
def test_numbers_have_two_digits_of_their_error(
    value: float, sd: float | None, unit: str, text: str
) -> None:
    assert with_error(value, sd, unit) == text


def test_axes_have_a_prefix_instead_of_a_power_of_ten() -> None:
    assert prefixed(0.068, "rad") == (1e3, "mrad")
    assert prefixed(1.4e-6, "rad/s") == (1e6, "µrad/s")
    assert prefixed(1.0, "rad") == (1.0, "rad")
