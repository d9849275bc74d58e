"""Campaigns given as tables of published numbers: what Stokes calculated, and what was missing."""

import json
from dataclasses import replace
from pathlib import Path

import mpmath
import numpy as np
import pytest

from pendpipe import physics
from pendpipe.campaign.fit import Candidate, predict
from pendpipe.campaign.published import (
    OF_TABLES,
    Asked,
    Row,
    Table,
    ask,
    diagnose_table,
    errors_of,
    read_table,
)
from pendpipe.cli import main
from pendpipe.errors import InputError
from pendpipe.project import PROJECT

PUBLISHED = PROJECT / "examples" / "published"
EFFECTS = {each.identifier: each for each in OF_TABLES}


def table_of(n: np.ndarray | None = None, sd: float = 0.002) -> Table:
    """Three spheres and three rods at four periods in air, with n by theory or as given."""
    bodies = [("sphere", each) for each in (0.01, 0.02, 0.04)]
    bodies += [("rod", each) for each in (0.001, 0.003, 0.01)]
    rows = tuple(
        Row(f"{body} {radius} {period}", body, body, radius, "air", period, 0.0, sd, 0.0, np.nan)
        for body, radius in bodies
        for period in (1.0, 2.0, 4.0, 8.0)
    )
    table = Table(rows, {"air": 1.46e-5}, 0.02)
    values = predict(table, (), np.zeros(1))[:, 0] if n is None else n
    return replace(
        table, runs=tuple(row._replace(n=one) for row, one in zip(rows, values, strict=True))
    )


@pytest.mark.parametrize("m", [0.1, 0.5, 1.5556, 5.8493])
def test_the_added_mass_of_a_rod_is_stokes_k(m: float) -> None:
    """At m = (b/2) sqrt(omega/nu), by Bessel functions of thirty digits."""
    with mpmath.workdps(30):
        z = 2 * mpmath.mpf(m) * mpmath.sqrt(mpmath.mpc(0, 1))
        k = mpmath.re(1 + 4 * mpmath.besselk(1, z) / (z * mpmath.besselk(0, z)))
    found = physics.cylinder_added_mass_coefficient(2.0 * m, 1.0, 1.0, 1.0)
    assert float(found) == pytest.approx(float(k), rel=1e-12)


@pytest.mark.parametrize(
    ("folder", "case", "digits"), [("dubuat-1786", 0, 1e-3), ("baily-1832-rods", 0, 2e-3)]
)
def test_what_stokes_calculated_is_calculated_anew(folder: str, case: int, digits: float) -> None:
    asked = ask(PUBLISHED / folder)[1][case]
    np.testing.assert_allclose(asked.told, asked.table.column("then"), atol=digits)


def test_the_two_experiments_that_baily_doubted_are_named() -> None:
    (asked,) = ask(PUBLISHED / "baily-1832-spheres")[1]
    assert {far.record for far in asked.found.left_out} == {"No. 50", "No. 51"}


def first(asked: Asked) -> tuple[str, float]:
    """The leading cause and its size."""
    found = asked.found.found[0]
    return found.leader.last.identifier, found.leader.size().value


def test_air_that_is_off_leads_in_baily_s_rods() -> None:
    """With today's air the rods ask for the constant that Stokes took from them."""
    stokes, today = ask(PUBLISHED / "baily-1832-rods")[1]
    assert not stokes.found.missing
    identifier, size = first(today)
    assert identifier == "viscosity-temperature"
    assert 14.6 * np.exp(size) == pytest.approx(8.68, rel=0.05)


def test_in_dubuat_s_water_a_smaller_viscosity_explains_a_part() -> None:
    """The constant explains a part; of the small spheres n is lower than any viscosity allows."""
    stokes, today, small = ask(PUBLISHED / "dubuat-1786")[1]
    assert first(stokes)[0] == "viscosity-temperature"
    assert first(stokes)[1] < np.log(1.3 / 2.05)
    misfits = [np.mean(one.table.column("n") - one.told) for one in (stokes, today)]
    assert misfits[0] < misfits[1] < 0.0
    identifier, size = first(small)
    assert (identifier, size < 0.0) == ("added-mass", True)


@pytest.mark.parametrize(
    ("identifier", "shape", "size"),
    [
        ("viscosity-temperature", None, 0.3),
        ("history-term", None, -0.2),
        ("added-mass", None, 0.02),
        ("wall-confinement", None, 0.05),
        ("body-size", 0.003, 0.08),
        ("group-offset", "rod", -0.03),
    ],
)
def test_a_cause_that_was_hidden_in_a_table_is_in_the_class(
    identifier: str, shape: float | str | None, size: float
) -> None:
    hidden = Candidate(EFFECTS[identifier], shape)
    n = predict(table_of(), (hidden,), np.array([0.0, size / hidden.effect.expected]))[:, 0]
    n += 0.002 * np.random.default_rng(1).standard_normal(len(n))
    found = diagnose_table(table_of(n))[0].found
    rivals = [found[0].leader, *(fit for fit, _ in found[0].rivals)]
    (own,) = [fit for fit in rivals if fit.last.identifier == identifier]
    assert own.added[-1].shape == shape
    assert abs(own.size().value - size) < 3.0 * own.size().sd


@pytest.mark.slow
def test_of_tables_that_lack_nothing_few_raise_an_alarm() -> None:
    """One in a hundred by design: of sixty more than four come once in a thousand."""
    random, n = np.random.default_rng(4), table_of().column("n")
    missing = [
        diagnose_table(table_of(n + 0.002 * random.standard_normal(len(n))))[0].missing
        for _ in range(60)
    ]
    assert sum(missing) <= 4


def test_errors_that_nobody_tells_are_the_scatter_of_repeated_rows() -> None:
    random = np.random.default_rng(2)
    once = table_of(sd=np.nan)
    rows = [
        row._replace(record=f"{row.record} {turn}", n=row.n + 0.03 * random.standard_normal())
        for turn in range(20)
        for row in once.runs
    ]
    sd, origin = errors_of(replace(once, runs=tuple(rows)))
    # 456 degrees of freedom know a standard deviation to 3.3 %.
    assert sd == pytest.approx(0.03, rel=0.1)
    assert "456 degrees of freedom" in origin


@pytest.mark.parametrize(
    ("column", "text", "said"),
    [
        ("body", "cube", "line 2: the body 'cube' is unknown; give sphere or rod or printed"),
        ("fluid", "mercury", "line 2: the fluid 'mercury' is unknown; give air"),
        ("radius_m", "", "line 2: radius_m is no positive number; a rod needs it"),
        ("period_s", "-2", "line 2: period_s is no positive number; a rod needs it"),
        ("n", "", "line 2: n is no positive number; a rod needs it"),
        ("sd", "0", "line 2: sd is no positive number; leave it empty where none is printed"),
        ("n", "2,29", "line 2: could not convert string to float: '2,29'; give a number"),
    ],
)
def test_a_cell_that_is_wrong_is_refused_in_a_line(
    tmp_path: Path, column: str, text: str, said: str
) -> None:
    lines = (PUBLISHED / "baily-1832-rods/table.tsv").read_text().splitlines()
    cells = dict(zip(lines[0].split("\t"), lines[1].split("\t"), strict=True)) | {column: text}
    path = tmp_path / "table.tsv"
    path.write_text("\n".join([lines[0], "\t".join(cells.values()), *lines[2:]]))
    with pytest.raises(InputError) as refused:
        read_table(path, {"air": 1e-5}, 0.1)
    assert str(refused.value) == f"{path}, {said}"


def test_a_folder_without_a_table_is_refused_in_a_line(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="there is no such configuration"):
        ask(tmp_path)
    (tmp_path / "published.yaml").write_bytes(
        (PUBLISHED / "baily-1832-rods/published.yaml").read_bytes()
    )
    with pytest.raises(InputError, match="there is no such table"):
        ask(tmp_path)


@pytest.mark.slow
def test_the_command_prints_what_its_json_holds(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["published", str(PUBLISHED / "baily-1832-rods")]
    assert main([*words, "--json"]) == 0
    content = json.loads(capsys.readouterr().out)
    assert main([*words, "--figure", str(tmp_path / "rods.png")]) == 0
    said = capsys.readouterr().out
    assert (tmp_path / "rods.svg").exists()
    for case in content["cases"]:
        assert case["statement"].splitlines()[0] in said
    assert max(map(len, said.splitlines())) <= 120
    assert content["cases"][1]["effects"][0]["id"] == "viscosity-temperature"
