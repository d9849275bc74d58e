"""A campaign as a table of published numbers: its errors, what is missing, and the answer.

The rows (`pendpipe.campaign.table`) are fitted and searched by the code of a campaign of records.
What a table can't know of itself it says: where no errors are printed, they are the scatter of rows
that the law holds to be equal, or else what the best cause leaves.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import compress
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from scipy.special import chdtri, fdtrc, ndtri, stdtr

from pendpipe.answer import Answer, percent, printed
from pendpipe.arrays import BoolArray, FloatArray
from pendpipe.campaign.fit import JointFit, Measured, candidates, chi2_near, joint_fit, predict
from pendpipe.campaign.search import MOST_LEFT_OUT, CampaignSearch, Found, local_scores, search
from pendpipe.campaign.seen import off
from pendpipe.campaign.table import QUANTITIES, Row, Table, read_table
from pendpipe.configuration.published import CONFIGURATION, Case, Published, load_published
from pendpipe.errors import refuse_if
from pendpipe.estimate import LISTED, chi_square_p_value
from pendpipe.levels import FALSE_ALARM
from pendpipe.quantities import compact, with_error

FEWEST_REPLICATES: Final = 3
"""Degrees of freedom from which a scatter is known to 40 %, better than a choice of the cause."""
DIGIT: Final = 1e-3 / math.sqrt(12.0)
"""Standard deviation of a number that is printed to the third decimal: the least error of a row."""


class Errors(NamedTuple):
    """Standard deviations of each row as it is compared.

    Parameters
    ----------
    sd
        By which rows and causes are weighed.
    judges
        By which chance is judged: larger where `sd` is known from few rows.
    origin
        Where they are from.
    """

    sd: FloatArray
    judges: FloatArray
    origin: str


def errors_of(table: Table, left_out: Sequence[str] = ()) -> Errors:
    """Return the errors that are told; else those of replicates; else what the best cause leaves.

    Rows that are left out don't count.
    """
    told = table.told_sd
    if np.isfinite(told).all():
        return Errors(told, told, "as told")
    table = table.without("record", left_out)
    scatter, freedom = table.replicates
    origin = f"the scatter of rows that should be equal ({freedom} degrees of freedom)"
    if freedom < FEWEST_REPLICATES:
        origin = "what the best cause leaves: none is told, no row repeated"
        plain, rows = table.measured_with(np.ones(len(table.runs))), len(table.runs)
        fits = (joint_fit(table, plain, [one]).residuals[:rows] for one in candidates(table))
        freedom = max(rows - 1 - int(np.sum(~table.has_prior)), 1)
        scatter = math.sqrt(min(float(each @ each) for each in fits) / freedom)
    scatter = max(scatter, DIGIT)
    sd, judges = (
        np.where(np.isfinite(told), told, each)
        for each in (scatter, judged(table, scatter, freedom))
    )
    return Errors(sd, judges, origin)


def judged(table: Table, scatter: float, freedom: int) -> float:
    """Return the error by which a normal distribution judges as Student's t does by a scatter.

    And chi^2 as Fisher's F, whichever is larger; within a per cent.
    """

    def seen(sd: float) -> FloatArray:
        fit = joint_fit(table, table.measured_with(np.full(len(table.runs), sd)))
        return np.array([np.max(np.abs(local_scores(fit, tried)[0])), math.sqrt(fit.chi2)])

    tried, rows = candidates(table), len(table.runs) + int(np.sum(table.has_prior))
    rows -= len(table.nuisances)
    score, root = seen(scatter)
    chi2 = chdtri(rows, fdtrc(rows, freedom, root**2 / rows))
    wanted = np.maximum([-ndtri(stdtr(freedom, -score)), math.sqrt(chi2)], 1e-3)
    # With priors neither falls as the error grows.
    sd = scatter
    while (wider := float(np.max(seen(sd) / wanted))) > 1.01:
        sd *= wider
    return sd


FEW_ROWS: Final = 8
"""A table of so few rows is printed row by row, a longer one by groups."""
COARSE: Final = 0.5
"""Of a logarithm: a larger one is told as a factor."""
OF_RADIUS: Final = ("body-size", "wall-confinement")
"""Causes whose shape is a radius; that of the others is an arc."""
CHANGES: Final[dict[str, Callable[[Row], Row]]] = {
    "the same at a quarter of the period": lambda row: row._replace(period_s=row.period_s / 4.0),
    "bodies of a third of the size": lambda row: row._replace(radius_m=row.radius_m / 3.0),
    "arcs of a quarter": lambda row: row._replace(arc_m=row.arc_m / 4.0, to_m=row.to_m / 4.0),
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
        found = search(table, table.measured_with(errors.judges), level)
        if found.missing:
            weighed = search(table, table.measured_with(errors.sd), level)
            found = replace(weighed, p_value=found.p_value)
        before, left_out = left_out, tuple(far.record for far in found.left_out)
        if left_out == before:
            break
    return found, errors


def answer_of_table(found: CampaignSearch, errors: Errors) -> Answer:
    """Make the answer: whether theory and observation agree, what may be missing, what remains."""
    table = found.whole.design
    agree = "do not agree" if found.missing else "agree"
    left = chi_square_p_value(found.improved.chi2, found.improved.degrees_of_freedom)
    causes = [row for one in found.found for row in _rows(one)]
    silent = found.missing and not causes and not found.left_out
    unchecked = int(table.of("verified", "no").sum())
    rows = [
        ("fluids", ", ".join(_fluids(table)) * any(row.body != "printed" for row in table.runs)),
        ("not to judge by", f"{unchecked} rows, of which the digits are unsure" * bool(unchecked)),
        ("errors", f"{_parts(table, float(np.median(errors.sd)))}: {errors.origin}"),
        ("off the others", ", ".join(map(off, found.left_out))),
        ("causes", "none of the catalogue stands out" if silent else ""),
        *causes,
        ("misfit", ", ".join(_misfits(table, found))),
        ("left", f"more than these explain ({printed(left)})" if left < FALSE_ALARM else ""),
    ]
    head = f"the {len(table.runs)} rows {agree} with theory (global {printed(found.p_value)})"
    return Answer((head,), tuple(row for row in rows if row[1]))


def _parts(table: Table, size: float, names: Sequence[str] = ()) -> str:
    """Print a size on the scale that is compared: of a logarithm in per cent, or as a factor."""
    quantity = QUANTITIES[[*names, table.runs[0].quantity][0]]
    if not quantity.log:
        return compact(size, quantity.unit)
    return f"{100.0 * size:.2g} %" if size < COARSE else f"a factor of {math.exp(size):.2g}"


def _misfits(table: Table, found: CampaignSearch) -> list[str]:
    """Say what theory leaves of each quantity as it is told, and what with what was found."""
    said = []
    values = table.scaled(table.column("value"))
    fits = [numbers_of(table, found.baseline, told=True), numbers_of(table, found.improved)]
    for name in dict.fromkeys(row.quantity for row in table.runs):
        own = table.of("quantity", name) > 0.0
        sizes = [np.sqrt(np.mean((table.scaled(fit) - values)[own] ** 2)) for fit in fits]
        before, after = (_parts(table, float(size), [name]) for size in sizes)
        said.append(f"{before} rms in {name}" + (f", {after} with it" if found.found else ""))
    return said


def numbers_of(table: Table, fit: JointFit, *, told: bool = False) -> FloatArray:
    """Return the numbers of a table's rows by a fit, or as theory has them with inputs as told."""
    fitted = zip(fit.design.nuisances, fit.unknowns, strict=False)
    moved = {each.name: value for each, value in fitted if not (told and math.isfinite(each.sd))}
    inputs = [moved.get(each.name, 0.0) for each in table.nuisances]
    sizes = fit.unknowns[len(fit.design.nuisances) :]
    return table.printed(predict(table, fit.added, np.array([*inputs, *sizes]))[:, 0])


def _fluids(table: Table, factor: float = 1.0) -> list[str]:
    told = table.viscosity_m2_per_s
    return [f"{name} {1e6 * factor * told[name]:.3g} mm²/s" for name in told]


def _rows(one: Found) -> list[tuple[str, str]]:
    """Say a cause with its size, its rivals, and what would decide."""
    last, size, shape = one.leader.last, one.leader.size(), one.leader.added[-1].shape
    said = f"{last.parameter.name.replace('_', ' ')} {size}"
    if isinstance(shape, float):
        where = "of radius" if last.identifier in OF_RADIUS else "of the linear loss at an arc of"
        said = f"{said} {where} {compact(shape, 'm')}"
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


def counts(case: Case, table: Table) -> BoolArray:
    """Which rows count: those that were observed, and of sure digits unless all are asked for."""
    sure = table.of("verified", "no") < 1.0
    return np.isfinite(table.column("value")) & (sure | case.unverified)


class Asked(NamedTuple):
    """A case with its answer; the table holds the rows that don't count as well, errors do not."""

    case: Case
    table: Table
    errors: Errors
    found: CampaignSearch
    answer: Answer

    @property
    def told(self) -> FloatArray:
        """Return the numbers as theory has them with the inputs that are told."""
        return numbers_of(self.table, self.found.baseline, told=True)

    @property
    def best(self) -> FloatArray:
        """Return the numbers with what was found."""
        return numbers_of(self.table, self.found.improved)

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


def named_by(table: Table) -> str:
    """Return the column by whose names a table is printed and drawn."""
    return "record" if len(table.runs) <= FEW_ROWS else "group"


def by_group(asked: Sequence[Asked]) -> list[tuple[str, ...]]:
    """Return means of each group, heads first: observed, then, by each case, with what it found."""
    whole = max((one.table for one in asked), key=lambda table: len(table.runs))
    columns = [("observed", whole, whole.column("value")), ("then", whole, whole.column("then"))]
    for one in asked:
        columns.append((one.case.title, one.table, one.told))
        columns += [("found", one.table, one.best)] if one.found.found else []
    what = named_by(whole)
    rows = [
        ("row" if what == "record" else what, "rows", "quantity", *(head for head, _, _ in columns))
    ]
    for name, quantity in dict.fromkeys((getattr(row, what), row.quantity) for row in whole.runs):
        means, form = [], QUANTITIES[quantity].form
        for _, table, each in columns:
            own = each[table.of(what, name) * table.of("quantity", quantity) > 0.0]
            # An exponential decay has 0 in the middle but for rounding.
            mean = round(float(own.mean()), 12) or 0.0 if own.size else math.nan
            means.append("" if math.isnan(mean) else format(mean, form))
        count = whole.of(what, name) @ whole.of("quantity", quantity)
        rows.append((name, f"{count:.0f}", quantity, *means))
    # Neither an empty column nor one of ones says anything.
    shown = [{*column[1:]} not in ({""}, {"1"}) for column in zip(*rows, strict=True)]
    return [tuple(cell for cell, show in zip(row, shown, strict=True) if show) for row in rows]


def ask(folder: Path, published: Published | None = None) -> tuple[Published, list[Asked]]:
    """Ask a folder's table all its questions, by its own configuration or another."""
    published = published or load_published(folder / CONFIGURATION)
    return published, [_asked(folder / published.table, case) for case in published.cases]


def _asked(path: Path, case: Case) -> Asked:
    table = read_table(path, case.viscosity_m2_per_s, case.relative_sd)
    table = table.without("group", case.without)
    counted = replace(table, runs=tuple(compress(table.runs, counts(case, table))))
    none = f"no row counts in {case.title!r}"
    refuse_if(not counted.runs, path, none, "give values; see docs/published.md")
    found, errors = diagnose_table(counted)
    return Asked(case, table, errors, found, answer_of_table(found, errors))
