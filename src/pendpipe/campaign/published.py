"""A campaign as a table of published numbers: bodies in a fluid, and what was printed of them.

A row is a body (sphere, rod, or one whose theory was printed), a fluid, a period and n, by which
buoyancy must be multiplied to be the whole effect of the fluid on the period: ``n = 1 + k``, k the
added mass over the displaced mass (Stokes 1850; `pendpipe.physics`). The rows enter the joint fit
and the search of campaigns where records have frequency and b. What a table can't know of itself
it says: where no errors are printed, they are the scatter of rows that the law holds to be equal,
or else what the best cause leaves.
"""

import csv
import io
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from pydantic import Field, ValidationError
from scipy.special import ndtri, stdtr

from pendpipe import physics
from pendpipe.answer import Answer, percent, printed
from pendpipe.arrays import BoolArray, FloatArray
from pendpipe.campaign.design import Nuisance
from pendpipe.campaign.diagnose import MOST_LEFT_OUT, CampaignSearch, Found, off, search
from pendpipe.campaign.effects import CATALOGUE, CampaignEffect
from pendpipe.campaign.fit import (
    Candidate,
    JointFit,
    Measured,
    candidates,
    chi2_near,
    joint_fit,
    predict,
)
from pendpipe.configuration.load import as_input_error, read_configuration
from pendpipe.configuration.models import Section
from pendpipe.effects.effect import Parameter
from pendpipe.errors import InputError, refuse_if
from pendpipe.estimate import LISTED, chi_square_p_value
from pendpipe.files import read_text
from pendpipe.levels import FALSE_ALARM
from pendpipe.quantities import with_error

BODIES: Final = ("sphere", "rod", "printed")
"""Of a printed one the theory is what the table says was calculated: its size was not printed."""
COLUMNS: Final = (
    "row",
    "group",
    "body",
    "radius_m",
    "fluid",
    "period_s",
    "n",
    "sd",
    "more",
    "then",
)
"""``more`` is what a vessel was held to add to n, ``then`` what was calculated at the time."""
_WORDS: Final = ("row", "group", "body", "fluid")
_ASKED: Final = {
    "sphere": ("radius_m", "period_s"),
    "rod": ("radius_m", "period_s"),
    "printed": ("then",),
}
"""What the theory of each body needs."""
FEWEST_REPLICATES: Final = 3
"""Degrees of freedom from which a scatter is known to 40 %, better than a choice of the cause."""
NORMAL_MEDIAN: Final = 0.6745
"""Median of the absolute value of a standard normal number."""
DIGIT: Final = 1e-3 / math.sqrt(12.0)
"""Standard deviation of a number that is printed to the third decimal: the least error of a row."""


class Row(NamedTuple):
    """One printed number, its name and the other `COLUMNS`; NaN where nothing is told."""

    record: str
    group: str
    body: str
    radius_m: float
    fluid: str
    period_s: float
    n: float
    sd: float
    more: float
    then: float


@dataclass(frozen=True)
class Table:
    """What was printed, and the fluids as they are told.

    Parameters
    ----------
    runs
        The rows.
    viscosity_m2_per_s
        Kinematic viscosity of each fluid.
    relative_sd
        Its relative standard deviation, for all fluids.
    """

    runs: tuple[Row, ...]
    viscosity_m2_per_s: dict[str, float]
    relative_sd: float

    @cached_property
    def nuisances(self) -> tuple[Nuisance, ...]:
        """The fluids' viscosities."""
        return tuple(
            Nuisance(f"viscosity of {name}", "", self.relative_sd)
            for name in dict.fromkeys(row.fluid for row in self.runs)
        )

    @property
    def has_prior(self) -> BoolArray:
        """Which nuisances have a prior; shape (nuisances,)."""
        return np.ones(len(self.nuisances), dtype=bool)

    def column(self, name: str) -> FloatArray:
        """Return one column of the rows."""
        return np.array([getattr(row, name) for row in self.runs], dtype=np.float64)

    def of(self, what: str, name: str) -> FloatArray:
        """Return 1 for the rows that have a name in a column, else 0."""
        return np.array([float(getattr(row, what) == name) for row in self.runs])

    def without(self, what: str, names: Sequence[str]) -> "Table":
        """Return the table without the rows that have one of the names in a column."""
        return replace(self, runs=tuple(r for r in self.runs if getattr(r, what) not in names))

    @cached_property
    def replicates(self) -> tuple[float, int]:
        """Scatter of rows that the law holds to be equal, and its degrees of freedom."""
        alike: dict[tuple[Any, ...], list[float]] = {}
        for row in self.runs:
            alike.setdefault((row.body, row.radius_m, row.fluid, row.period_s), []).append(row.n)
        squares = sum(np.var(each) * len(each) for each in alike.values())
        freedom = len(self.runs) - len(alike)
        return (math.sqrt(squares / freedom) if freedom else math.nan), freedom


class Terms(NamedTuple):
    """n of every row and its parts; arrays of shape (..., rows).

    Parameters
    ----------
    radius_m, viscosity_m2_per_s
        Of the rows' bodies and fluids.
    potential
        k without viscosity.
    history
        By what the viscous part of k is multiplied.
    added
        What is added to n.
    """

    radius_m: FloatArray
    viscosity_m2_per_s: FloatArray
    potential: FloatArray
    history: FloatArray
    added: FloatArray


@predict.register(Table)
def _predict(design: Table, added: Sequence[Candidate], unknowns: FloatArray) -> FloatArray:
    """Return n, shape (..., rows, 1)."""
    count = len(design.nuisances)
    told = np.array([design.viscosity_m2_per_s[row.fluid] for row in design.runs])
    names = [each.name.removeprefix("viscosity of ") for each in design.nuisances]
    moved = sum(
        unknowns[..., at, None] * design.relative_sd * design.of("fluid", name)
        for at, name in enumerate(names)
    )
    sphere, rod = (design.of("body", each) for each in BODIES[:2])
    then = np.where(sphere + rod > 0.0, 0.0, design.column("then") - 1.0)
    none = np.zeros_like(told + moved)
    terms = Terms(
        none + design.column("radius_m"),
        told * (1.0 + moved),
        none + physics.POTENTIAL_FLOW_ADDED_MASS * sphere + rod + np.nan_to_num(then),
        none + sphere + rod,
        none + np.nan_to_num(design.column("more")),
    )
    for at, one in enumerate(added):
        size = unknowns[..., count + at, None] * one.effect.expected
        terms = one.effect.put(terms, size, design, one.shape)
    around = 2.0 * np.pi / design.column("period_s"), terms.viscosity_m2_per_s, 1.0
    radius = np.where(sphere + rod > 0.0, terms.radius_m, 1.0)
    with np.errstate(invalid="ignore"):  # a printed theory has no size and no period
        free = np.where(
            rod > 0.0,
            physics.cylinder_added_mass_coefficient(radius, *around) - 1.0,
            physics.added_mass_coefficient(radius, *around) - physics.POTENTIAL_FLOW_ADDED_MASS,
        )
    viscous = terms.history * np.where(sphere + rod > 0.0, free, 0.0)
    return np.asarray((1.0 + terms.potential + viscous + terms.added)[..., None])


def _viscosity(terms: Terms, size: FloatArray) -> Terms:
    return terms._replace(viscosity_m2_per_s=terms.viscosity_m2_per_s * np.exp(size))


def _history(terms: Terms, size: FloatArray) -> Terms:
    return terms._replace(history=terms.history * (1.0 + size))


def _added_mass(terms: Terms, size: FloatArray) -> Terms:
    return terms._replace(added=terms.added + size)


def _walls(terms: Terms, size: FloatArray, design: Table) -> Terms:
    """A closed vessel about each body: a sphere's or a rod's potential flow in a concentric one."""
    sphere, rod = (design.of("body", each) for each in BODIES[:2])
    share = terms.radius_m / np.nanmax(np.where(sphere + rod > 0.0, terms.radius_m, np.nan))
    near = np.where(sphere > 0.0, size * share**3, np.where(rod > 0.0, size * share**2, 0.0))
    return terms._replace(added=terms.added + (1.5 * sphere + 2.0 * rod) * near / (1.0 - near))


def _size(terms: Terms, size: FloatArray, design: Table, shape: float) -> Terms:
    there = design.column("radius_m") == shape
    return terms._replace(radius_m=terms.radius_m * (1.0 + size * there))


def _group(terms: Terms, size: FloatArray, design: Table, shape: str) -> Terms:
    return terms._replace(added=terms.added + size * design.of("group", shape))


def _sizes(design: Table) -> Sequence[Any]:
    """The radii of bodies whose theory can be computed, where there are several."""
    found = sorted({row.radius_m for row in design.runs if math.isfinite(row.radius_m)})
    return found if len(found) > 1 else ()


def _groups(design: Table) -> Sequence[Any]:
    found = list(dict.fromkeys(row.group for row in design.runs))
    return found if len(found) > 1 else ()


def _as(
    identifier: str, parameter: Parameter, expected: float, acts: Callable[..., Any], name: str = ""
) -> CampaignEffect:
    """An effect of campaigns that a table shares."""
    return replace(
        CATALOGUE[identifier],
        name=name or CATALOGUE[identifier].name,
        parameter=parameter,
        expected=expected,
        on="terms",
        acts=acts,
        shapes=(None,),
    )


OF_TABLES: Final[tuple[CampaignEffect, ...]] = (
    # Stokes's constants were off by factors of 1.4 and 1.7.
    _as(
        "viscosity-temperature",
        Parameter("log_ratio", "", -3.0, 3.0),
        0.5,
        _viscosity,
        "another viscosity than is told",
    ),
    _as("history-term", Parameter("C_H - 1", "", -1.0, 3.0), 0.1, _history),
    _as("added-mass", Parameter("added_mass", "", -0.5, 20.0), 0.1, _added_mass),
    _as("wall-confinement", Parameter("closeness", "", 0.0, 0.5), 0.1, _walls),
    CampaignEffect(
        "body-size",
        "another size of one body",
        r"a \to (1 + \epsilon)\, a",
        Parameter("excess", "", -0.5, 1.0),
        0.05,
        "terms",
        _size,
        _sizes,
    ),
    CampaignEffect(
        "group-offset",
        "a group of rows that was taken otherwise",
        r"n \to n + \Delta n \text{ in one group}",
        Parameter("offset", "", -10.0, 10.0),
        0.1,
        "terms",
        _group,
        _groups,
    ),
)
"""What a table of n may lack, by the identifiers of campaigns where the cause is the same."""


@candidates.register(Table)
def _candidates(design: Table) -> list[Candidate]:
    sized = any(row.body in BODIES[:2] for row in design.runs)
    shared = OF_TABLES if sized else OF_TABLES[2:3] + OF_TABLES[5:]
    return [Candidate(each, shape) for each in shared for shape in each.shapes_in(design)]


def read_table(path: Path, viscosity_m2_per_s: dict[str, float], relative_sd: float) -> Table:
    """Read a table of tab-separated columns (`COLUMNS`); an empty cell is told by nobody.

    Raises
    ------
    InputError
        A column is missing, a cell is no number, or a body or fluid is unknown.
    """
    text = read_text(path, "see docs/published.md", absent="table")
    lines = list(csv.DictReader(io.StringIO(text, newline=""), delimiter="\t"))
    if not lines or (missing := [name for name in COLUMNS if name not in lines[0]]):
        what = f"it lacks the column {missing[0]}" if lines else "it has no row"
        raise InputError(path, what, f"give the columns {', '.join(COLUMNS)}")
    rows = []
    for number, line in enumerate(lines, 2):
        try:
            cells = [
                line[name] if name in _WORDS else float(line[name] or "nan") for name in COLUMNS
            ]
        except ValueError as fault:
            raise InputError(f"{path}, line {number}", f"{fault}", "give a number") from None
        row, where = Row._make(cells), f"{path}, line {number}"
        for name, names in {"body": BODIES, "fluid": tuple(viscosity_m2_per_s)}.items():
            unknown = f"the {name} {getattr(row, name)!r} is unknown"
            refuse_if(getattr(row, name) not in names, where, unknown, f"give {' or '.join(names)}")
        for name in ("n", *_ASKED[row.body]):
            lost = not 0.0 < getattr(row, name) < math.inf
            refuse_if(lost, where, f"{name} is no positive number", f"a {row.body} needs it")
        wrong = not (math.isnan(row.sd) or 0.0 < row.sd < math.inf)
        refuse_if(wrong, where, "sd is no positive number", "leave it empty where none is printed")
        rows.append(row)
    return Table(tuple(rows), viscosity_m2_per_s, relative_sd)


class Errors(NamedTuple):
    """Standard deviation of each row, and where it is from."""

    sd: FloatArray
    origin: str


def errors_of(table: Table, left_out: Sequence[str] = ()) -> Errors:
    """Return the errors that are told; else those of replicates; else what the best cause leaves.

    Rows that are left out don't count. The last is known from the rows alone: its size is such that
    the best cause is worth as much by a normal distribution as Student's t makes it.
    """
    told = table.column("sd")
    table = table.without("record", left_out)
    scatter, freedom = table.replicates
    origin = f"the scatter of rows that should be equal ({freedom} degrees of freedom)"
    if np.isfinite(told).all():
        return Errors(told, "as told")
    if freedom < FEWEST_REPLICATES:
        origin = "what the best cause leaves, by Student's t: none is told, and no row repeated"
        plain, many = measured_with(table, np.ones(len(table.runs))), len(table.runs) - 1
        none, best = (
            min(_scatter(joint_fit(table, plain, one)) for one in causes)
            for causes in ([()], [[one] for one in candidates(table)])
        )
        student = math.sqrt(many * max((none / best) ** 2 - 1.0, 0.0))
        normal = -float(ndtri(stdtr(many, -student)))
        scatter = best * student / normal if normal > 0.0 else best
    return Errors(np.where(np.isfinite(told), told, max(scatter, DIGIT)), origin)


def _scatter(fit: JointFit) -> float:
    """Return the scatter of rows about a fit of unit errors, by its median: a few may be wrong."""
    return float(np.median(np.abs(fit.residuals[: len(fit.data.values)]))) / NORMAL_MEDIAN


def measured_with(table: Table, sd: FloatArray) -> Measured:
    """Return the rows' n with their errors, for the joint fit."""
    return Measured(table.column("n")[:, None], 1.0 / sd[:, None, None])


CHANGES: Final[dict[str, Callable[[Row], Row]]] = {
    "the same at a quarter of the period": lambda row: row._replace(period_s=row.period_s / 4.0),
    "bodies of a third of the size": lambda row: row._replace(radius_m=row.radius_m / 3.0),
    "the same rows once more": lambda row: row,
}
"""Rows that might be measured next."""


def next_rows(found: Found) -> list[tuple[str, float]]:
    """Rank what might be measured next by the sigma at which it would reject every rival."""
    fit, ranked = found.leader, []
    for what, change in CHANGES.items():
        more = replace(fit.design, runs=(*fit.design.runs, *map(change, fit.design.runs)))
        expected = predict(more, fit.added, fit.unknowns)
        data = Measured(expected, np.tile(fit.data.whitening, (2, 1, 1)))
        away = [chi2_near(more, data, one.added, one.unknowns) for one, _ in found.rivals]
        ranked.append((what, math.sqrt(min(away))))
    return sorted(ranked, key=lambda each: -each[1])


def diagnose_table(table: Table, level: float = FALSE_ALARM) -> tuple[CampaignSearch, Errors]:
    """Search for what the theory lacks, as in a campaign of records.

    Where errors come from the rows, those that disagree with the rest are kept out of them.
    """
    left_out: tuple[str, ...] = ()
    for _ in range(MOST_LEFT_OUT):
        errors = errors_of(table, left_out)
        found = search(table, measured_with(table, errors.sd), level)
        before, left_out = left_out, tuple(far.record for far in found.left_out)
        if left_out == before:
            break
    return found, errors


def answer_of_table(table: Table, found: CampaignSearch, errors: Errors) -> Answer:
    """Make the answer: whether theory and observation agree, what may be missing, what remains."""
    agree = "do not agree" if found.missing else "agree"
    left = chi_square_p_value(found.improved.chi2, found.improved.degrees_of_freedom)
    told = _n(table, found.baseline, np.zeros(len(table.nuisances)))
    before, after = (
        float(np.sqrt(np.mean((n - table.column("n")) ** 2)))
        for n in (told, _n(table, found.improved))
    )
    causes = [row for one in found.found for row in _rows(one)]
    silent = found.missing and not causes and not found.left_out
    rows = [
        ("fluids", ", ".join(_fluids(table))),
        ("errors", f"{np.median(errors.sd):.2g}: {errors.origin}"),
        ("off the others", ", ".join(map(off, found.left_out))),
        ("causes", "none of the catalogue stands out" if silent else ""),
        *causes,
        ("misfit", f"{before:.3g} rms in n" + (f", {after:.3g} with it" if causes else "")),
        ("left", f"more than these explain ({printed(left)})" if left < FALSE_ALARM else ""),
    ]
    head = f"the {len(table.runs)} rows {agree} with theory (global {printed(found.p_value)})"
    return Answer((head,), tuple(row for row in rows if row[1]))


def _n(table: Table, fit: JointFit, inputs: FloatArray | None = None) -> FloatArray:
    """Return n of all rows by a fit's causes, with other inputs than the fitted ones."""
    count = len(table.nuisances)
    moved = fit.unknowns[:count] if inputs is None else inputs
    return predict(table, fit.added, np.concatenate([moved, fit.unknowns[count:]]))[:, 0]


def _fluids(table: Table, factor: float = 1.0) -> list[str]:
    told = table.viscosity_m2_per_s
    return [f"{name} {1e6 * factor * told[name]:.3g} mm²/s" for name in told]


def _rows(one: Found) -> list[tuple[str, str]]:
    """Say a cause with its size, its rivals, and what would decide."""
    last, size, shape = one.leader.last, one.leader.size(), one.leader.added[-1].shape
    said = f"{last.parameter.name.replace('_', ' ')} {size}"
    if isinstance(shape, float):
        said = f"of radius {1e3 * shape:.3g} mm, {said}"
    elif shape is not None:
        said = f"{shape}, {said}"
    if last.identifier == "viscosity-temperature":
        factor = math.exp(size.value)
        times = with_error(factor, factor * size.sd)
        said = f"{times} times the told one ({', '.join(_fluids(one.leader.design, factor))})"
    rivals = [(r.last.name, share) for r, share in one.rivals if share >= LISTED]
    decides = next_rows(one)[0] if rivals else ("", 0.0)
    return [
        ("most probable", f"{last.name} {percent(one.probability)}, {said}"),
        ("or", ", ".join(f"{name} {percent(share)}" for name, share in rivals)),
        ("decide by", f"{decides[0]}: {decides[1]:.1f} sigma" if decides[1] >= 1.0 else ""),
    ]


class Case(Section):
    """One question to a table: the fluids as they are held to be, and which rows count."""

    title: str = Field(description="what is asked")
    viscosity_m2_per_s: dict[str, float] = Field(description="kinematic viscosity of each fluid")
    relative_sd: float = Field(gt=0.0, description="its relative standard deviation")
    without: list[str] = Field([], description="groups of rows that do not count")


class Published(Section):
    """The file ``published.yaml`` of a folder, beside its ``table.tsv``."""

    title: str = Field(description="who measured what, and when")
    source: str = Field(description="where it is printed")
    cases: list[Case] = Field(min_length=1, description="the questions")


class Asked(NamedTuple):
    """A case with its answer."""

    case: Case
    table: Table
    errors: Errors
    found: CampaignSearch
    answer: Answer

    @property
    def told(self) -> FloatArray:
        """Return n as theory has it with the inputs that are told."""
        return _n(self.table, self.found.baseline, np.zeros(len(self.table.nuisances)))

    @property
    def best(self) -> FloatArray:
        """Return n with what was found."""
        return _n(self.table, self.found.improved)

    def as_json(self) -> dict[str, Any]:
        """Return the case: rows, causes with their probabilities, what is left."""
        found, told, best = self.found, self.told.tolist(), self.best.tolist()
        return {
            **self.case.model_dump(),
            "verdict": "missing-physics" if found.missing else "consistent",
            "p_value": found.p_value,
            "errors_from": self.errors.origin,
            "effects": [
                {
                    "id": one.leader.last.identifier,
                    "of": one.leader.added[-1].shape,
                    "probability": one.probability,
                    "size": one.leader.size().as_json(),
                    "delta_chi2": one.delta_chi2,
                    "indistinguishable_from": [
                        {"id": rival.last.identifier, "probability": share}
                        for rival, share in one.rivals
                    ],
                }
                for one in found.found
            ],
            "left_out": [far._asdict() for far in found.left_out],
            "statement": "\n".join(self.answer.lines(width=math.inf)),
            "rows": [
                {**row._asdict(), "calculated": one, "with_missing": other}
                for row, one, other in zip(self.table.runs, told, best, strict=True)
            ],
        }


def by_group(asked: Sequence[Asked]) -> list[tuple[str, ...]]:
    """Return the means of each group: observed, calculated then, and by each case; heads first."""
    whole = max((one.table for one in asked), key=lambda table: len(table.runs))
    heads = ("group", "rows", "observed", "then", *(one.case.title for one in asked))
    rows = [heads]
    for group in dict.fromkeys(row.group for row in whole.runs):
        numbers = [
            table.of("group", group) @ n / max(table.of("group", group).sum(), 1.0)
            for table, n in (
                (whole, whole.column("n")),
                (whole, whole.column("then")),
                *((one.table, one.told) for one in asked),
            )
        ]
        count = f"{whole.of('group', group).sum():.0f}"
        rows.append((group, count, *(f"{value:.3f}" if value else "" for value in numbers)))
    return rows


def ask(folder: Path) -> tuple[Published, list[Asked]]:
    """Ask a folder's table all its questions."""
    place = folder / "published.yaml"
    try:
        published = Published.model_validate(read_configuration(place))
    except ValidationError as fault:
        raise as_input_error(place, fault, Published) from None
    asked = []
    for case in published.cases:
        table = read_table(folder / "table.tsv", case.viscosity_m2_per_s, case.relative_sd)
        table = table.without("group", case.without)
        found, errors = diagnose_table(table)
        asked.append(Asked(case, table, errors, found, answer_of_table(table, found, errors)))
    return published, asked
