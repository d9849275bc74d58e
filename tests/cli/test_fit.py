"""The commands that fit and print."""

import csv
import io
import json
import math
import re
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pendpipe as pp
from pendpipe import cli
from pendpipe.dynamics import Eq8, Release, sample
from pendpipe.estimate import Estimate
from pendpipe.quantities import with_error
from pendpipe.recording import write_plain
from pendpipe.report.class_table import _together
from pendpipe.stages.archive import pack

# `pendpipe fit` answers: one recording or many, as a summary, a table, JSON or a figure.

ROOT = Path(__file__).parents[2]
ROD, STRING = (str(ROOT / f"examples/{name}-pendulum.csv") for name in ("rod", "string"))
VISCOUS = {
    "pendulum": {"frequency_hz": 0.7, "quality_factor_viscous": 100.0, "release_angle_rad": 0.1},
    "sampling": {"sample_rate_hz": 50.0, "duration_s": 60.0},
}


def test_the_summary_holds_the_truth_within_its_errors(answer_of: Any) -> None:
    out = answer_of(["fit", ROD]).out
    first, *_, copy, following = out.splitlines()
    assert first.startswith("rod-pendulum.csv: angle, 50 Hz, ")
    assert first.endswith("GREEN")
    assert "dry friction" in out
    assert copy.startswith("Copy: T0 = (1.145")
    assert following.startswith("Next: ")
    assert len(out.splitlines()) <= 12
    fit = pp.fit(ROD)
    # examples/rod-pendulum.toml: Q_v = 240 at 0.873 Hz is b = pi f/Q; c = 4e-4 rad/s; a = 0.
    truth = {"a": 0.0, "b": np.pi * 0.873 / 240.0, "c": 4.0e-4, "frequency": 0.873}
    for name, value in truth.items():
        assert abs(fit[name].value - value) < 4.0 * fit[name].sd


def refused_file(folder: Path) -> Path:
    bad = folder / "bad.csv"
    bad.write_text("time_s,angle_rad\n0,0\n1,0\n", encoding="utf-8")
    return bad


def test_several_recordings_make_one_table_and_a_bad_one_stops_nothing(
    tmp_path: Path, answer_of: Any
) -> None:
    bad = refused_file(tmp_path)
    captured = answer_of(["fit", ROD, str(bad), STRING, "--wide"])
    rows = captured.out.splitlines()
    assert [row.split()[1] for row in rows[1:4]] == ["green", "refused", "green"]
    # Each number has its unit.
    assert "1.14547" in rows[1]
    assert ") s " in rows[1]
    assert "rad⁻¹ s⁻¹" in rows[1]
    assert "4.94°" in rows[1]
    assert "64.6(3.5) % viscous" in rows[1]
    assert rows[-1] == "2 fitted, 0 red, 1 refused"
    assert "mean" not in captured.out, "1.15 and 2.01 s: of two values none is the class's"
    assert str(bad) in captured.err
    assert cli.main(["fit", str(bad), str(bad)]) == 2


@pytest.mark.slow
@pytest.mark.parametrize("form", ["csv", "xlsx", "html", "tex", "json"])
def test_the_suffix_decides_the_form_of_the_table(
    form: str, tmp_path: Path, answer_of: Any
) -> None:
    import pandas as pd

    out = tmp_path / f"class.{form}"
    asked = ["fit", ROD, STRING, str(refused_file(tmp_path)), "--out", str(out)]
    assert cli.main(asked) == 0
    if form in ("csv", "xlsx"):
        table = pd.read_csv(out) if form == "csv" else pd.read_excel(out, engine="openpyxl")
        fit = pp.fit(ROD)
        assert table.loc[0, "T0_s"] == pytest.approx(fit["period"].value, rel=1e-12)
        assert table.loc[0, "T0_sd_s"] == pytest.approx(fit["period"].sd, rel=1e-9)
        assert table.loc[0, "Q"] == pytest.approx(fit.quality_factors[0].quality_factor.value)
        assert table.loc[2, "light"] == "refused"
    elif form == "json":
        assert [each["file"] for each in json.loads(out.read_text())["fits"]][:2] == [ROD, STRING]
    else:
        period = pp.fit(ROD)["period"]
        printed = with_error(period.value, period.sd, "s", short=True)
        assert printed in out.read_text(encoding="utf-8")
    # What pendpipe made it makes again.
    assert cli.main(asked) == 0
    # So it is with one file.
    assert cli.main(["fit", ROD, "--out", str(tmp_path / f"one.{form}")]) == 0
    assert (
        "its format is unknown"
        in answer_of(["fit", ROD, "--out", str(tmp_path / "one.xyz")], 2).err
    )


def test_the_files_of_a_class_that_agree_are_put_together(tmp_path: Path, answer_of: Any) -> None:
    files = []
    for seed in range(5):
        path = tmp_path / f"{seed}.csv"
        write_plain(path, pp.simulate(VISCOUS | {"noise_rad": 1e-3}, seed=seed))
        files.append(str(path))
    together = {
        each["name"]: each
        for each in json.loads(answer_of(["fit", *files, STRING, "--json"]).out)["together"]
    }
    # The string's pendulum is another one.
    assert (together["T0"]["files"], together["T0"]["of"]) == (5, 6)
    mean = together["T0"]["mean"]
    assert abs(mean["value"] - 1.0 / 0.7) < 4.0 * mean["sd"]
    assert together["T0"]["p_value"] > 1e-3


@pytest.mark.parametrize(("sd", "says"), [(0.1, "they agree"), (0.02, "they differ by more")])
def test_values_agree_where_chance_gives_their_chi_square(sd: float, says: str) -> None:
    """Of three values chi^2 is beyond its value by exp(-chi^2/2): two degrees of freedom."""
    together = _together(
        "T0", [Estimate(value, sd, "s") for value in (0.8, 1.0, 1.2)], 4, mean=True
    )
    assert together.mean.value == pytest.approx(1.0)
    assert together.mean.sd == pytest.approx(sd / math.sqrt(3.0))
    assert together.chi2 == pytest.approx(2.0 * (0.2 / sd) ** 2)
    assert together.p_value == pytest.approx(math.exp(-0.5 * together.chi2))
    assert says in str(together)
    assert "mean of 3 files (1 far from them left out)" in str(together)


TIME = np.arange(0.0, 60.0, 0.02)
NOISE = 1e-3 * np.random.default_rng(1).standard_normal(len(TIME))
OF_A_CLASS = {
    "wheel": Eq8(4.0, 0.0, 0.0, 0.01, 0.0),
    "pendulum": Eq8(4.0, 0.0, 0.0, 0.01, 0.0, "sine"),
    "shorter": Eq8(4.01, 0.0, 0.0, 0.01, 0.0, "sine"),
}


@pytest.fixture
def of_a_class(tmp_path: Path) -> list[str]:
    """A torsion wheel, two pendulums that are not one, and amplitudes read with a ruler."""
    for name, law in OF_A_CLASS.items():
        angle = sample(law, Release(-0.2, 0.6), TIME) + NOISE
        write_plain(tmp_path / f"{name}.csv", pp.Recording(time_s=TIME, angle_rad=angle))
    ruler = "".join(f"{t},{20.0 * math.exp(-0.01 * t):.2f}\n" for t in range(0, 200, 10))
    (tmp_path / "ruler.csv").write_text(f"t (s),A (cm)\n{ruler}")
    return [str(tmp_path / f"{name}.csv") for name in (*OF_A_CLASS, "ruler")]


def test_t_of_a_spring_is_not_called_t0_and_pendulums_that_differ_have_no_mean(
    of_a_class: list[str], tmp_path: Path, answer_of: Any
) -> None:
    out = tmp_path / "class.csv"
    said = answer_of(["fit", *of_a_class, "--out", str(out)]).out.splitlines()
    wheel, pendulum, shorter, ruler = csv.DictReader(out.read_text().splitlines())
    assert (wheel["T0_s"], pendulum["T_s"]) == ("", "")
    assert float(wheel["T_s"]) == pytest.approx(math.tau / 4.0, rel=1e-5)
    assert float(shorter["T0_s"]) == pytest.approx(math.tau / 4.01, rel=1e-5)
    assert float(pendulum["a_limit95"]) > 0.0
    assert [row.split()[2] for row in said[1:4]] == ["T", "T0", "T0"]
    assert "T0: 2 files scatter by" in "\n".join(said)
    assert "mean of" not in "\n".join(said)
    # The ruler's row holds what the fit of the ruler alone says.
    alone = pp.fit(of_a_class[3])
    half = alone.damping()["half_life_s"].value
    assert (ruler["light"], ruler["T0_s"], ruler["Q"]) == (alone.light, "", "")
    assert float(ruler["half_life_s"]) == pytest.approx(half) == pytest.approx(69.3, rel=0.01)
    assert "to 1/2 in 69.3" in said[4]
    asked = answer_of(["fit", *of_a_class, "--mean"]).out
    assert "T0: mean of 2 files" in asked


def test_a_table_in_latex_keeps_losses_and_remarks(
    of_a_class: list[str], tmp_path: Path, answer_of: Any
) -> None:
    out = tmp_path / "class.tex"
    answer_of(["fit", *of_a_class, str(refused_file(tmp_path)), "--out", str(out)])
    text = out.read_text(encoding="utf-8")
    assert "viscous or internal" in text
    assert "loses most by" in text
    assert " & refused & " in text
    assert "samples only" in text
    assert r"\par T0: 2 files scatter by" in text
    assert "…" not in text, "a remark is whole where there is room"


def test_each_pendulum_of_a_class_has_its_length(
    of_a_class: list[str], tmp_path: Path, answer_of: Any
) -> None:
    """By a small table; the others have that of all."""
    table, out = tmp_path / "lengths.csv", tmp_path / "class.csv"
    own, other = of_a_class[1], of_a_class[2]
    table.write_text(f"{Path(own).name};0,613(1)\n")  # as a spreadsheet may write it
    asked = ["fit", own, other, "--lengths", str(table), "--length", "0.5", "--out", str(out)]
    answer_of(asked)
    with out.open() as stream:
        rows = list(csv.DictReader(stream))
    for row, length in zip(rows, (pp.Estimate(0.613, 0.001, "m"), 0.5), strict=True):
        g = pp.fit(row["file"], length_m=length)["g"]
        assert (float(row["g_m_per_s2"]), float(row["g_sd_m_per_s2"])) == (g.value, g.sd)
    for content, said in (
        ("other.csv,0.6\n", "line 1: no FILE is called 'other.csv'"),
        (f"file,m\n{own},long\n", "line 2: 'long'"),
        (f"{own},60 cm\n", "line 1: '60 cm'"),
        (f'"{own},0.6\n', "it has no length"),
        (f"Datei;Länge\n{own};0.6\n", "it can't be read"),
    ):
        table.write_text(content, encoding="latin-1")
        assert said in answer_of(asked, 2).err


def test_a_file_says_what_follows_from_it(tmp_path: Path, answer_of: Any) -> None:
    """Volts with their sensor's constant are angles, as in a fit."""
    volts = answer_of(["inspect", str(ROOT / "examples" / "rod-pendulum.csv")]).out
    assert "gives       T0, the period of small swings" in volts
    time_s = np.arange(0, 40, 0.05)
    for unit, said in (
        ("m", "with --length angle, T0 and g"),
        ("rad/s", "the angle by the motion"),
        ("m/s^2", "no angle"),
        ("deg", "T0, the period of small swings"),
    ):
        swing = np.exp(-0.01 * time_s) * np.cos(5 * time_s)
        file = tmp_path / "swing.csv"
        table = np.column_stack([time_s, swing])
        np.savetxt(file, table, delimiter=",", header=f"t (s),swing ({unit})", comments="")
        (line,) = [
            each for each in answer_of(["inspect", str(file)]).out.splitlines() if "gives" in each
        ]
        assert said in line
        # The header as it stands is a name.
        answer_of(["inspect", str(file), "--column", f"swing ({unit})"])


def test_q_is_one_number_in_text_json_table_and_python(answer_of: Any) -> None:
    """That at the release."""
    fit = pp.fit(STRING)
    written = json.loads(answer_of(["fit", STRING, "--json"]).out)["quality_factors"][0]
    assert written["value"] == fit["Q"].value == fit.quality_factor(fit["amplitude"].value).value
    number = with_error(fit["Q"].value, fit["Q"].sd, short=True)
    assert f"  Q                     {number} at " in str(fit)
    assert f"  {number}  " in answer_of(["fit", STRING, ROD]).out


def test_a_page_takes_the_options_of_the_fit(
    of_a_class: list[str], tmp_path: Path, answer_of: Any
) -> None:
    out = tmp_path / "sheet.html"
    asked = ["page", of_a_class[1], "--length", "0.613", "--clock-ppm", "1000", "--no-diagnosis"]
    answer_of([*asked, "--out", str(out)])
    fit = pp.fit(of_a_class[1], length_m=0.613, clock_ppm=1000.0)
    assert with_error(fit["g"].value, fit["g"].sd, "m/s^2", short=True) in out.read_text("utf-8")


@pytest.mark.parametrize("period", [[], ["--period", "1.7"]])
def test_a_ruler_s_amplitudes_make_a_page(
    of_a_class: list[str], period: list[str], tmp_path: Path, answer_of: Any
) -> None:
    """Their curve is that of the pendulum that was fitted."""
    out = tmp_path / "ruler.html"
    answer_of(["page", of_a_class[3], "--length", "0.6", *period, "--out", str(out)])
    assert "viscous or internal" in out.read_text("utf-8")
    fit = pp.fit(of_a_class[3], length_m=0.6)
    left = fit.points.angle_rad - fit.predict(fit.points.time_s)
    assert np.sqrt(np.mean(left**2)) < 1.1 * fit.residual_rms_rad


def test_a_length_with_its_error_makes_g_with_its_error(
    answer_of: Any,
) -> None:
    line = next(
        row
        for row in answer_of(["fit", STRING, "--length", "1.000(1)"]).out.splitlines()
        if row.startswith("  g ")
    )
    value, sd = line.split()[1].rstrip(")").split("(")
    # Of a length known to 1e-3; of 2.006018(3) s.
    assert float(value) == pytest.approx(9.8105, rel=2e-3)
    assert sd == "98"
    assert "buoyancy" in line
    with pytest.raises(SystemExit, match="2"):
        cli.main(["fit", STRING, "--length", "0"])


def test_standard_input_is_a_file(monkeypatch: pytest.MonkeyPatch, answer_of: Any) -> None:
    stream = io.TextIOWrapper(io.BytesIO(Path(ROD).read_bytes()))
    monkeypatch.setattr(sys, "stdin", stream)
    piped = json.loads(answer_of(["fit", "-", "--json"]).out)
    assert piped["parameters"] == pp.fit(ROD).to_dict()["parameters"]
    both = json.loads(answer_of(["fit", ROD, ROD, "--json"]).out)["fits"]
    assert [entry["parameters"] for entry in both] == [piped["parameters"]] * 2


def test_a_figure_is_drawn_where_it_is_asked_for(tmp_path: Path, answer_of: Any) -> None:
    figure = tmp_path / "rod.svg"
    assert cli.main(["fit", ROD, "--figure", str(figure)]) == 0
    text = figure.read_text(encoding="utf-8")
    assert "Amplitude" in text
    assert ">Q<" in text
    assert (
        "format is unknown" in answer_of(["fit", ROD, "--figure", str(tmp_path / "rod.bmp")], 2).err
    )
    assert "--figure" in answer_of(["fit", ROD, STRING, "--figure", str(figure)], 2).err


def test_a_law_at_its_bound_is_printed_as_an_upper_limit(tmp_path: Path) -> None:
    path = tmp_path / "viscous.csv"
    fits = []
    for seed in range(6):
        write_plain(path, pp.simulate(VISCOUS | {"noise_rad": 1e-4}, seed=seed))
        fits.append(pp.fit(path))
    at_bound = [fit for fit in fits if fit["a"].at_bound or fit["c"].at_bound]
    assert at_bound, "no fit of a purely viscous pendulum lies at the bound"
    assert all(" < " in str(fit) for fit in at_bound)


@pytest.mark.parametrize("content", ["{}", "[1, 2]", '{"volts": 3}'])
def test_a_file_that_is_no_calibration_is_refused_in_a_line(
    content: str, tmp_path: Path, answer_of: Any
) -> None:
    recording, calibration = tmp_path / "decay.csv", tmp_path / "calibration.json"
    rows = (f"{0.01 * k:.2f},{math.exp(-k / 900) * math.cos(0.05 * k):.6f}" for k in range(3000))
    recording.write_text("time_s,volts\n" + "\n".join(rows) + "\n")
    calibration.write_text(content)
    said = answer_of(
        ["fit", str(recording), "--calibration", str(calibration)], 2
    ).err.splitlines()[-1]
    assert said == f"pendpipe: {calibration}: this is not a calibration; run pendpipe calibrate"


# Every command that answers prints one JSON object where it is asked to.


@pytest.mark.parametrize(
    ("command", "key"),
    [
        (["inspect", ROD], "sample_rate_hz"),
        (["fit", ROD], "decrement_check"),
        (["diagnose", ROD], "verdict"),
        (["effects"], "effects"),
        (["doctor", "{folder}"], "findings"),
        (["calibrate", "{table}"], "volts_per_radian"),
    ],
)
def test_a_commands_answer_is_one_json_object(
    command: list[str], key: str, tmp_path: Path, answer_of: Any
) -> None:
    table = tmp_path / "caliper.csv"
    rows = [f"{0.01 * step},{0.0385 * step + 0.001 * (step % 2)}" for step in range(-5, 6)]
    table.write_text("angle_rad,volts\n" + "\n".join(rows) + "\n", encoding="utf-8")
    results = tmp_path / "results"
    results.mkdir()
    pack(results / "chunks/fit-all.zip", results, [], {})
    words = [word.format(folder=results, table=table) for word in command]
    assert key in json.loads(answer_of([*words, "--json"]).out)


# `pendpipe page` writes one file that needs nothing outside itself.

ROD_FILE = Path(__file__).parents[2] / "examples/rod-pendulum.csv"


@pytest.mark.slow
def test_one_page_holds_the_fit_and_refers_to_nothing_outside(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    page = tmp_path / "rod.html"
    assert cli.main(["page", str(ROD_FILE), "--out", str(page), "--no-diagnosis"]) == 0
    text = page.read_text(encoding="utf-8")
    assert "dry friction" in text
    assert "<svg" in text
    assert re.search(r"T0? = \(1\.14547\d+ ± 0\.0+\d+\) s", text)
    assert not re.findall(r'(?:src|href)="(?!#|data:image/png)[^"]*"', text)
    assert str(tmp_path) not in text
    assert str(ROD_FILE.parent) not in text
    assert re.findall(r"<h2>[^<]*</h2>\s*<ul>\s*</ul>", text) == [], "a heading of nothing"


def test_a_name_in_the_page_is_text_and_no_markup(tmp_path: Path, answer_of: Any) -> None:
    odd = tmp_path / "<b>rod&.csv"
    odd.write_bytes(ROD_FILE.read_bytes())
    assert (
        "&lt;b&gt;rod&amp;.csv" in answer_of(["page", str(odd), "--out", "-", "--no-diagnosis"]).out
    )


@pytest.mark.slow
def test_a_diagnosis_stands_on_the_page_unless_it_is_not_wanted(tmp_path: Path) -> None:
    page = tmp_path / "rod.html"
    assert cli.main(["page", str(ROD_FILE), "--out", str(page)]) == 0
    text = page.read_text(encoding="utf-8")
    assert "Nothing is missing" in text
    assert text.count("How to read it.") >= 3


@pytest.mark.slow
def test_several_recordings_get_a_page_each_and_a_table_that_links_to_them(tmp_path: Path) -> None:
    bad = tmp_path / "bad.csv"
    bad.write_text("time_s,angle_rad\n0,0\n1,0\n", encoding="utf-8")
    out = tmp_path / "class.html"
    asked = ["page", str(ROD_FILE), str(ROD_FILE.with_name("string-pendulum.csv")), str(bad)]
    assert cli.main([*asked, "--no-diagnosis", "--out", str(out)]) == 0
    text = out.read_text(encoding="utf-8")
    links = re.findall(r'href="([^"]+)"', text)
    assert len(links) == 2
    assert all((tmp_path / link).is_file() for link in links)
    assert "refused" in text
    assert cli.main(["page", str(ROD_FILE), "--out", str(tmp_path / "rod.pdf")]) == 2
