"""Campaigns given as tables of published numbers: what Stokes calculated, and what was missing."""

import json
import math
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import mpmath
import numpy as np
import pytest

from pendpipe import physics
from pendpipe.campaign.fit import Candidate, predict
from pendpipe.campaign.published import Asked, ask, counts, diagnose_table, errors_of
from pendpipe.campaign.table import OF_TABLES, Row, Table, read_table
from pendpipe.cli import main
from pendpipe.errors import InputError
from pendpipe.project import PROJECT

from ..recordings import white

PUBLISHED = PROJECT / "examples" / "published"
EFFECTS = {each.identifier: each for each in OF_TABLES}


def filled(table: Table, values: np.ndarray | None = None) -> Table:
    """The table with its numbers as given, or as theory has them."""
    if values is None:
        values = table.printed(predict(table, (), np.zeros(len(table.nuisances)))[:, 0])
    rows = zip(table.runs, values.tolist(), strict=True)
    return replace(table, runs=tuple(row._replace(value=one) for row, one in rows))


def table_of(n: np.ndarray | None = None, sd: float = 0.002) -> Table:
    """Three spheres and three rods at four periods in air, with n by theory or as given."""
    bodies = [("sphere", each) for each in (0.01, 0.02, 0.04)]
    bodies += [("rod", each) for each in (0.001, 0.003, 0.01)]
    row = Row("", "", "", "air", "n", 0.0, sd)
    rows = tuple(
        row._replace(record=f"{body} {a} {t}", group=body, body=body, radius_m=a, period_s=t)
        for body, a in bodies
        for t in (1.0, 2.0, 4.0, 8.0)
    )
    return filled(Table(rows, {"air": 1.46e-5}, 0.02), n)


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


@pytest.mark.slow
def test_in_dubuat_s_water_a_smaller_viscosity_explains_a_part() -> None:
    """The constant explains a part; of the small spheres n is lower than any viscosity allows."""
    stokes, today, small = ask(PUBLISHED / "dubuat-1786")[1]
    assert first(stokes)[0] == "viscosity-temperature"
    assert first(stokes)[1] < np.log(1.3 / 2.05)
    misfits = [np.mean(one.table.column("value") - one.told) for one in (stokes, today)]
    assert misfits[0] < misfits[1] < 0.0
    identifier, size = first(small)
    assert (identifier, size < 0.0) == ("added-mass", True)


def losses(sd: float = 0.01) -> Table:
    """Spheres and rods of known density, whose Q is told, and a ball whose loss is not: arcs."""
    row = Row("", "", "sphere", "air", "Q", 1.0, math.nan, inertia=500.0)
    bodies = [("sphere", 0.01), ("sphere", 0.04), ("rod", 0.001), ("rod", 0.01)]
    rows = [
        row._replace(record=f"{body} {a} {t}", group=body, body=body, radius_m=a, period_s=t)
        for body, a in bodies
        for t in (1.0, 4.0)
    ]
    ball = Row("", "ball", "printed", "air", "half swings", 1.0, constant="the ball")
    rows += [
        ball._replace(record=f"{arc} m", arc_m=arc, to_m=0.875 * arc)
        for arc in (0.05, 0.1, 0.2, 0.4, 0.8, 1.6)
    ]
    table = filled(Table(tuple(rows), {"air": 1.46e-5}, 0.02))
    return replace(table, runs=tuple(each._replace(sd=sd * each.value) for each in table.runs))


@pytest.mark.parametrize(
    ("of_losses", "identifier", "shape", "size"),
    [
        (False, "viscosity-temperature", None, 0.3),
        (False, "history-term", None, -0.2),
        (False, "added-mass", None, 0.02),
        (False, "wall-confinement", 0.04, 0.05),
        (False, "body-size", 0.003, 0.08),
        (False, "group-offset", "rod", -0.03),
        (True, "quadratic-drag", 0.04375, 0.5),
        (True, "power-law-damping", 0.04375, 0.5),
        (True, "coulomb-friction", 0.04375, 0.5),
        (True, "uniform-drag-excess", None, 0.13),
        (True, "hysteretic-damping", None, 0.002),
    ],
)
def test_a_cause_that_was_hidden_in_a_table_is_in_the_class(
    of_losses: bool, identifier: str, shape: float | str | None, size: float
) -> None:
    table, hidden = losses() if of_losses else table_of(), Candidate(EFFECTS[identifier], shape)
    unknowns = np.array([*[0.0] * (1 + of_losses), size / hidden.effect.expected])
    n = predict(table, (hidden,), unknowns)[:, 0]
    n += white(3, len(n), 0.01) if of_losses else white(1, len(n), 0.002)
    asked = filled(table, table.printed(n)) if of_losses else table_of(n)
    found = diagnose_table(asked)[0].found
    rivals = [found[0].leader, *(fit for fit, _ in found[0].rivals)]
    (own,) = [fit for fit in rivals if fit.last.identifier == identifier]
    assert of_losses or own.added[-1].shape == shape
    assert abs(own.size().value - size) < 3.0 * own.size().sd


def test_q_of_a_sphere_is_eq_16_with_the_fluid_that_swings_along() -> None:
    table = losses()
    (row, *_), omega, volume = table.runs, 2.0 * np.pi, physics.sphere_volume(0.01)
    k = physics.added_mass_coefficient(0.01, omega, 1.46e-5, 1.0)
    mass = (500.0 + k) * volume
    expected = physics.viscous_quality_factor(mass, omega, 0.01, 1.0, 1.46e-5, 1.0)
    assert row.value == pytest.approx(float(expected), rel=1e-12)


def test_of_a_disc_q_and_decrement_are_stokes_s_eq_163() -> None:
    a, tau, nu, inertia = 0.0975, 24.25, 1.3e-6, 0.3
    row = Row("", "", "disc", "water", "decrement", 1.0, radius_m=a, period_s=2.0 * tau)
    table = Table((row._replace(inertia=inertia),), {"water": nu}, 0.1)
    table = Table((*table.runs, table.runs[0]._replace(quantity="Q")), {"water": nu}, 0.1)
    decrement, quality = (each.value for each in filled(table).runs)
    along = np.pi * a**4 * np.sqrt(nu * tau / (2.0 * np.pi))
    eq163 = np.pi**1.5 / (2.0 * np.sqrt(2.0)) * a**4 * np.sqrt(nu * tau)
    assert decrement * np.log(10.0) == pytest.approx(eq163 / (inertia * a**5 + along), rel=1e-12)
    assert quality * decrement == pytest.approx(0.5 * np.pi / np.log(10.0), rel=1e-12)


def test_coulomb_s_discs_follow_from_the_largest() -> None:
    """0.0208 and 0.0136 by a^4 tau^(-3/2) from 0.057, 0.0058 being taken off; they agree."""
    (asked,) = ask(PUBLISHED / "coulomb-1801")[1]
    found = asked.told - 0.0058
    np.testing.assert_allclose(
        found * 0.0512 / found[0] + 0.0058, [0.057, 0.0208, 0.0136], atol=5e-5
    )
    assert not asked.found.missing


@pytest.mark.slow
def test_bessel_s_k_is_calculated_anew_and_his_arcs_are_not_judged_unasked() -> None:
    (asked,) = ask(PUBLISHED / "bessel-1826")[1]
    np.testing.assert_allclose(asked.told[:3], [1.694, 1.755, 1.786], atol=5e-4)
    assert not counts(asked.case.model_copy(update={"unverified": False}), asked.table).any()
    # B/A is 0.0142 per line of 2.2558 mm (Stokes's Eq. 173).
    share = asked.found.found[0].leader.size().value
    assert share / asked.found.found[0].leader.added[-1].shape * 2.2558e-3 == pytest.approx(
        0.0142, rel=0.02
    )


def test_newton_s_ball_loses_by_the_square_of_the_arc_beside_the_arc() -> None:
    """In inches and half swings 3.5e-4 A + 2.2e-4 A^2 leaves -6 to +7 %."""
    (asked,) = ask(PUBLISHED / "newton-1687")[1]
    (found,) = asked.found.found
    assert found.leader.last.identifier == "quadratic-drag"
    inch = 0.0254 / found.leader.added[-1].shape
    loss = math.exp(found.leader.unknowns[1])
    assert loss == pytest.approx(3.5e-4, rel=0.1)
    assert loss * found.leader.size().value * inch == pytest.approx(2.2e-4, rel=0.05)


@pytest.mark.slow
def test_of_tables_that_lack_nothing_few_raise_an_alarm() -> None:
    """One in a hundred by design: of sixty more than four come once in a thousand."""
    random, n = np.random.default_rng(4), table_of().column("value")
    missing = [
        diagnose_table(table_of(n + 0.002 * random.standard_normal(len(n))))[0].missing
        for _ in range(60)
    ]
    assert sum(missing) <= 4


def test_errors_that_nobody_tells_are_the_scatter_of_repeated_rows() -> None:
    random = np.random.default_rng(2)
    once = table_of(sd=np.nan)
    rows = [
        row._replace(
            record=f"{row.record} {turn}", value=row.value + 0.03 * random.standard_normal()
        )
        for turn in range(20)
        for row in once.runs
    ]
    sd, judges, origin = errors_of(replace(once, runs=tuple(rows)))
    # 456 degrees of freedom know a standard deviation to 3.3 %.
    assert sd == pytest.approx(0.03, rel=0.1)
    assert "456 degrees of freedom" in origin
    assert judges == pytest.approx(sd, rel=0.05)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["baily-1832-rods", "newton-1687"])
def test_of_tables_without_errors_that_lack_nothing_few_raise_an_alarm(name: str) -> None:
    """One in a hundred by design, however few the rows: of fifty, three come twice in a hundred."""
    random, told = np.random.default_rng(5), {"air": 1.46e-5}
    table = read_table(PUBLISHED / name / "config/table.tsv", told, 0.02)
    unknowns = np.where(table.has_prior, 0.0, -5.0)
    scaled = predict(table, (), unknowns)[:, 0]
    missing = [
        diagnose_table(
            filled(table, table.printed(scaled + 0.05 * random.standard_normal(len(scaled))))
        )[0].missing
        for _ in range(50)
    ]
    assert sum(missing) <= 2


@pytest.mark.parametrize(
    ("column", "text", "said"),
    [
        (
            "body",
            "cube",
            "line 2: the body 'cube' is unknown; give sphere or rod or disc or printed",
        ),
        ("fluid", "mercury", "line 2: the fluid 'mercury' is unknown; give air"),
        ("radius_m", "", "line 2: radius_m is no positive number; the n of a rod needs it"),
        ("period_s", "-2", "line 2: period_s is no positive number; the n of a rod needs it"),
        (
            "quantity",
            "m",
            "line 2: the quantity 'm' is unknown; give n or decrement or Q or "
            "half swings or middle",
        ),
        ("value", "-1", "line 2: value is no positive number; the n of a rod needs it"),
        ("quantity", "Q", "line 2: inertia is no positive number; the Q of a rod needs it"),
        ("sd", "0", "line 2: sd is no positive number; leave it empty where none is printed"),
        ("value", "2,29", "line 2: could not convert string to float: '2,29'; give a number"),
    ],
)
def test_a_cell_that_is_wrong_is_refused_in_a_line(
    tmp_path: Path, column: str, text: str, said: str
) -> None:
    lines = (PUBLISHED / "baily-1832-rods/config/table.tsv").read_text().splitlines()
    cells = dict(zip(lines[0].split("\t"), lines[1].split("\t"), strict=True)) | {column: text}
    path = tmp_path / "table.tsv"
    path.write_text("\n".join(["\t".join(cells), "\t".join(cells.values()), *lines[2:]]))
    with pytest.raises(InputError) as refused:
        read_table(path, {"air": 1e-5}, 0.1)
    assert str(refused.value) == f"{path}, {said}"


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda text: text.replace("quantity", "what"), ": it lacks the column quantity; give"),
        (lambda text: text.replace("more", "extra"), ": no column is called 'extra'; give"),
        (lambda text: text.replace("2.364", "2.364\t1"), ", line 2: it has more cells than"),
        (lambda text: text.splitlines()[0], ": it has no row; give the columns row, group"),
    ],
)
def test_a_table_that_is_none_is_refused_in_a_line(
    tmp_path: Path, change: Callable[[str], str], said: str
) -> None:
    path = tmp_path / "table.tsv"
    path.write_text(change((PUBLISHED / "baily-1832-rods/config/table.tsv").read_text()))
    with pytest.raises(InputError) as refused:
        read_table(path, {"air": 1e-5}, 0.1)
    assert str(refused.value).startswith(f"{path}{said}")


def test_a_case_in_which_no_row_counts_is_refused(tmp_path: Path) -> None:
    copied = tmp_path / "bessel"
    shutil.copytree(PUBLISHED / "bessel-1826", copied)
    path = copied / "config/config.yaml"
    path.write_text(path.read_text("utf-8").replace("unverified: true", ""), "utf-8")
    with pytest.raises(InputError, match='no row counts in "Stokes\'s air"'):
        ask(copied)


def test_a_folder_without_a_table_is_refused_in_a_line(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="there is no such configuration"):
        ask(tmp_path)
    (tmp_path / "config").mkdir()
    shutil.copy(PUBLISHED / "baily-1832-rods/config/config.yaml", tmp_path / "config")
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
