"""The model of a table of published numbers: rows, what theory says of each, what it may lack.

A row is a body in a fluid at a period, and one number that was measured of it (`QUANTITIES`). The
rows enter the joint fit and the search of campaigns where records have frequency and b. Stokes's
theory (1850; `pendpipe.physics`) gives the fluid that swings along, k over the displaced mass, and
the loss in half a swing, the logarithm of the ratio of two arcs. Where the mass or the wire was not
printed, an unknown constant multiplies the losses of the rows that share it.
"""

import csv
import io
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, Final, Literal, NamedTuple

import numpy as np

from pendpipe import physics
from pendpipe.arrays import BoolArray, FloatArray
from pendpipe.campaign.design import Nuisance
from pendpipe.campaign.effects import CATALOGUE, CampaignEffect
from pendpipe.campaign.fit import STEP, Candidate, Measured, candidates, predict
from pendpipe.effects.effect import Parameter
from pendpipe.errors import InputError, refuse_if
from pendpipe.files import read_text

BODIES: Final = {
    "sphere": ("radius_m", "period_s"),
    "rod": ("radius_m", "period_s"),
    "disc": ("radius_m", "period_s"),
    "printed": (),
}
"""What theory asks of a body. Of a printed one n is what the table says was calculated."""
NEEDED: Final = ("row", "group", "body", "fluid", "quantity", "value")
"""The columns that every table has."""


class Row(NamedTuple):
    """One printed number; NaN where nothing is told.

    Parameters
    ----------
    record, group
        Its name, and what it was taken with.
    body, radius_m, inertia
        One of `BODIES`; its own mass over that of its volume of fluid, of a disc its moment of
        inertia over ``rho a^5``.
    constant
        Name of the unknown that multiplies the loss, where that inertia is not told.
    fluid, period_s, other_period_s
        Where it swings; with a second period n is Bessel's, from both pendulums.
    arc_m, to_m
        From where to where the arc falls.
    quantity, value, sd
        What was measured: one of `QUANTITIES`.
    more
        What a vessel was held to add to n, or what was taken off a decrement.
    then
        What was calculated at the time.
    verified
        "no" where the digits could not be checked.
    """

    record: str
    group: str
    body: str
    fluid: str
    quantity: str
    value: float
    sd: float = math.nan
    radius_m: float = math.nan
    inertia: float = math.nan
    constant: str = ""
    period_s: float = math.nan
    other_period_s: float = math.nan
    arc_m: float = math.nan
    to_m: float = math.nan
    more: float = math.nan
    then: float = math.nan
    verified: str = ""


_OPTIONAL: Final = dict(Row._field_defaults)


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
        """The fluids' viscosities, and the logarithms of the constants that nobody tells."""
        fluids = dict.fromkeys(row.fluid for row in self.runs)
        constants = dict.fromkeys(row.constant for row in self.runs if row.constant)
        return (
            *(Nuisance(f"viscosity of {name}", "", self.relative_sd) for name in fluids),
            *(Nuisance(f"loss of {name}", "", math.inf) for name in constants),
        )

    @property
    def has_prior(self) -> BoolArray:
        """Which nuisances have a prior; shape (nuisances,)."""
        return np.array([math.isfinite(each.sd) for each in self.nuisances])

    def column(self, name: str) -> FloatArray:
        """Return one column of the rows."""
        return np.array([getattr(row, name) for row in self.runs], dtype=np.float64)

    def of(self, what: str, *names: str) -> FloatArray:
        """Return 1 for the rows that have one of the names in a column, else 0."""
        return np.array([float(getattr(row, what) in names) for row in self.runs])

    def without(self, what: str, names: Sequence[str]) -> "Table":
        """Return the table without the rows that have one of the names in a column."""
        return replace(self, runs=tuple(r for r in self.runs if getattr(r, what) not in names))

    @property
    def logarithmic(self) -> BoolArray:
        """Which rows are compared by their logarithms: numbers of swings, Q and decrements."""
        return self.of("quantity", *(name for name, each in QUANTITIES.items() if each.log)) > 0.0

    @property
    def taken_off(self) -> FloatArray:
        """What was taken off a decrement before it was compared."""
        return np.nan_to_num(self.column("more")) * self.of("quantity", "decrement")

    def scaled(self, values: FloatArray) -> FloatArray:
        """Return what is compared: a number, or its logarithm."""
        positive = np.where(self.logarithmic, values - self.taken_off, 1.0)
        return np.where(self.logarithmic, np.log(positive), values)

    def printed(self, scaled: FloatArray) -> FloatArray:
        """Return the numbers of `scaled`."""
        return (
            np.where(self.logarithmic, np.exp(self.logarithmic * scaled), scaled) + self.taken_off
        )

    @property
    def told_sd(self) -> FloatArray:
        """The errors that are told, on the scale that is compared."""
        whole = np.where(self.logarithmic, self.column("value") - self.taken_off, 1.0)
        return self.column("sd") / whole

    @cached_property
    def replicates(self) -> tuple[float, int]:
        """Scatter of rows that the law holds to be equal, and its degrees of freedom."""
        alike: dict[str, list[float]] = {}
        for row, value in zip(self.runs, self.scaled(self.column("value")).tolist(), strict=True):
            then = row.then if row.body == "printed" else 0.0
            same = row._replace(record="", group="", value=0.0, sd=0.0, then=then, verified="")
            alike.setdefault(str(same), []).append(value)
        squares = sum(np.var(each) * len(each) for each in alike.values())
        freedom = len(self.runs) - len(alike)
        return (math.sqrt(squares / freedom) if freedom else math.nan), freedom

    def measured_with(self, sd: FloatArray) -> Measured:
        """Return what is compared with errors on its scale, for the joint fit."""
        return Measured(self.scaled(self.column("value"))[:, None], 1.0 / sd[:, None, None])


class Terms(NamedTuple):
    """What theory says of every row; arrays of shape (..., rows).

    Parameters
    ----------
    radius_m, viscosity_m2_per_s
        Of the rows' bodies and fluids.
    potential
        k without viscosity.
    history
        By what the viscous part of k is multiplied, and the part of the drag that goes with it.
    added
        What is added to n.
    drag, constant
        By what the loss is multiplied.
    beside
        What is added to the loss in half a swing.
    powers
        Losses that go with another power of the arc: over the linear one, at an arc of 1 m.
    offset
        What is added to the number that is compared.
    """

    radius_m: FloatArray
    viscosity_m2_per_s: FloatArray
    potential: FloatArray
    history: FloatArray
    added: FloatArray
    drag: FloatArray
    constant: FloatArray
    beside: FloatArray
    powers: dict[float, FloatArray]
    offset: FloatArray

    def around(self, period_s: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return angular frequency, kinematic viscosity and a density of 1, for `physics`."""
        return 2.0 * np.pi / period_s, self.viscosity_m2_per_s, np.ones_like(period_s)


def _viscous(table: Table, terms: Terms, period_s: FloatArray) -> FloatArray:
    """The part of k that viscosity adds, shape (..., rows); 0 where theory is what was printed."""
    around = terms.around(period_s)
    rod, sphere = (table.of("body", each) > 0.0 for each in ("rod", "sphere"))
    radius = np.where(rod | sphere, terms.radius_m, 1.0)
    free = np.where(
        rod,
        physics.cylinder_added_mass_coefficient(radius, *around) - 1.0,
        physics.added_mass_coefficient(radius, *around) - physics.POTENTIAL_FLOW_ADDED_MASS,
    )
    return np.where(rod | sphere, terms.history * free, 0.0)


def _n(table: Table, terms: Terms) -> FloatArray:
    """``n = 1 + k``; of pendulums of two periods Bessel's, as if k were the same in both."""
    first, second = table.column("period_s"), table.column("other_period_s")
    one, other = (_viscous(table, terms, period) for period in (first, second))
    both = (second**2 * other - first**2 * one) / (second**2 - first**2)
    return 1.0 + terms.potential + terms.added + np.where(np.isnan(second), one, both)


def _loss(table: Table, terms: Terms) -> FloatArray:
    """Logarithm of the ratio of two arcs half a swing apart.

    ``pi k'/(2 (s + k))`` of a sphere or rod of s times the fluid's density, k' being its drag over
    ``omega`` times the displaced mass (for a sphere ``(9/4) (delta/a) (1 + delta/a)``, Stokes's
    Eq. 172); Eq. 163 of a disc. Where the inertia is not told a constant stands for it; the
    inertia of discs on one wire goes as the square of their period.
    """
    period, radius = table.column("period_s"), terms.radius_m
    around = terms.around(period)
    rod, disc, printed = (table.of("body", each) > 0.0 for each in ("rod", "disc", "printed"))
    sphere = physics.harmonic_drag(1.0, radius, *around, terms.history)
    sphere = sphere / (around[0] * physics.sphere_volume(radius))
    cylinder = terms.history * physics.cylinder_drag(radius, *around)
    cylinder = cylinder / (around[0] * np.pi * radius**2)
    swings_along = terms.potential + _viscous(table, terms, period)
    told = table.of("constant", "") > 0.0
    body = np.where(told, table.column("inertia") + swings_along, 1.0)
    of_disc = physics.disc_drag(radius, *around)
    own = table.column("inertia") * radius**5 + of_disc / around[0]
    body = np.where(disc, np.where(told, own, period**2) * around[0], body)
    drag = np.where(disc, of_disc, np.where(rod, cylinder, sphere))
    loss = np.where(printed, 1.0, 0.5 * np.pi * drag / body)
    return np.asarray(terms.constant * terms.drag * loss + terms.beside)


def _half_swings(table: Table, terms: Terms) -> FloatArray:
    """Half swings in which the arc falls from `arc_m` to `to_m`."""
    loss, more = _loss(table, terms), terms.powers
    rates = {1.0: loss} | {power: loss * share for power, share in more.items()}
    return physics.time_by_powers(table.column("to_m"), table.column("arc_m"), rates)


def _middle(table: Table, terms: Terms) -> FloatArray:
    """Arc in the middle of a run less the geometric mean of its ends, in m."""
    first, last = table.column("arc_m"), table.column("to_m")
    rates = {1.0: np.ones_like(first)} | terms.powers
    return physics.amplitude_halfway(last, first, rates) - np.sqrt(first * last)


class Quantity(NamedTuple):
    """What may be measured of a row.

    Parameters
    ----------
    law
        The number from what theory says of the rows.
    asks
        The columns that it needs, beside those of the body.
    log
        Whether it is compared by its logarithm: its errors are parts of it.
    theory
        What it needs of the body: its k, its loss, or nothing.
    unit, form
        Of the number, and how it is printed.
    """

    law: Callable[[Table, Terms], FloatArray]
    asks: tuple[str, ...] = ()
    log: bool = True
    theory: Literal["k", "loss", ""] = "loss"
    unit: str = "1"
    form: str = ".3g"


QUANTITIES: Final = {
    "n": Quantity(_n, log=False, theory="k", form=".3f"),
    # As Coulomb has it: the common logarithm for one oscillation, which is half a swing.
    "decrement": Quantity(
        lambda table, terms: _loss(table, terms) / math.log(10.0) + table.taken_off
    ),
    "Q": Quantity(lambda table, terms: 0.5 * np.pi / _loss(table, terms)),
    "half swings": Quantity(_half_swings, ("arc_m", "to_m")),
    "middle": Quantity(_middle, ("arc_m", "to_m"), log=False, theory="", unit="m"),
}


@predict.register(Table)
def _predict(design: Table, added: Sequence[Candidate], unknowns: FloatArray) -> FloatArray:
    """Return what is compared (`Table.scaled`), shape (..., rows, 1)."""
    count = len(design.nuisances)
    none = np.zeros((*unknowns.shape[:-1], len(design.runs)))
    moved, constant = none + 1.0, none
    for at, (name, _, sd, _) in enumerate(design.nuisances):
        what, _, whose = name.partition(" of ")
        size = unknowns[..., at, None]
        if what == "viscosity":
            moved = moved + size * sd * design.of("fluid", whose)
        else:
            constant = constant + size * design.of("constant", whose)
    then = np.nan_to_num(design.column("then") - 1.0) * design.of("body", "printed")
    terms = Terms(
        none + design.column("radius_m"),
        moved * np.array([design.viscosity_m2_per_s[row.fluid] for row in design.runs]),
        none
        + physics.POTENTIAL_FLOW_ADDED_MASS * design.of("body", "sphere")
        + design.of("body", "rod")
        + then,
        none + 1.0,
        none + np.nan_to_num(design.column("more")),
        none + 1.0,
        np.exp(constant),
        none,
        {},
        none,
    )
    for at, one in enumerate(added):
        size = unknowns[..., count + at, None] * one.effect.expected
        terms = one.effect.put(terms, size, design, one.shape)
    found = none
    with np.errstate(all="ignore"):  # laws of numbers that a row does not have
        for name, quantity in QUANTITIES.items():
            if design.of("quantity", name).any():
                found = np.where(design.of("quantity", name), quantity.law(design, terms), found)
        return np.asarray((design.scaled(found) + terms.offset)[..., None])


def _size_of(field: str) -> Callable[[Terms, FloatArray], Terms]:
    """Return an effect that multiplies a field by one more than its size."""

    def acts(terms: Terms, size: FloatArray) -> Terms:
        return terms._replace(**{field: getattr(terms, field) * (1.0 + size)})

    return acts


def _more(field: str) -> Callable[[Terms, FloatArray], Terms]:
    """Return an effect that adds its size to a field."""

    def acts(terms: Terms, size: FloatArray) -> Terms:
        return terms._replace(**{field: getattr(terms, field) + size})

    return acts


def _power(power: float) -> Callable[..., Terms]:
    """Return an effect that adds a loss of another power of the arc.

    Its size is what that loses of the linear loss, at the arc that is the shape.
    """

    def acts(terms: Terms, size: FloatArray, shape: float) -> Terms:
        return terms._replace(powers=terms.powers | {power: size * shape ** (1.0 - power)})

    return acts


def _viscosity(terms: Terms, size: FloatArray) -> Terms:
    return terms._replace(viscosity_m2_per_s=terms.viscosity_m2_per_s * np.exp(size))


def _walls(terms: Terms, size: FloatArray, design: Table, shape: float) -> Terms:
    """A closed vessel about each body: a sphere's or a rod's potential flow in a concentric one.

    The fluid passes faster by ``1/(1 - s^3)`` or ``1/(1 - s^2)``, of which a thin layer
    loses the square.
    """
    sphere, rod = (design.of("body", each) for each in ("sphere", "rod"))
    share = np.nan_to_num(terms.radius_m) / shape
    near = size * (sphere * share**3 + rod * share**2)
    return terms._replace(
        added=terms.added + (1.5 * sphere + 2.0 * rod) * near / (1.0 - near),
        drag=terms.drag / (1.0 - near) ** 2,
    )


def _size(terms: Terms, size: FloatArray, design: Table, shape: float) -> Terms:
    there = design.column("radius_m") == shape
    return terms._replace(radius_m=terms.radius_m * (1.0 + size * there))


def _group(terms: Terms, size: FloatArray, design: Table, shape: str) -> Terms:
    return terms._replace(offset=terms.offset + size * design.of("group", shape))


def _largest(design: Table) -> Sequence[Any]:
    """The largest radius, if there is one: of it the closeness of walls is told."""
    found = [row.radius_m for row in design.runs if row.body in ("sphere", "rod")]
    return [max(found)] if found else ()


def _least_arc(design: Table) -> Sequence[Any]:
    found = [row.to_m for row in design.runs if math.isfinite(row.to_m)]
    return [min(found)] if found else ()


def _sizes(design: Table) -> Sequence[Any]:
    """The radii of bodies whose theory can be computed, where there are several."""
    found = sorted({row.radius_m for row in design.runs if math.isfinite(row.radius_m)})
    return found if len(found) > 1 else ()


def _groups(design: Table) -> Sequence[Any]:
    found = list(dict.fromkeys(row.group for row in design.runs))
    return found if len(found) > 1 else ()


def _as(
    identifier: str,
    parameter: Parameter,
    expected: float,
    acts: Callable[..., Any],
    name: str = "",
    shapes: Any = (None,),
) -> CampaignEffect:
    """An effect of campaigns that a table shares."""
    return replace(
        CATALOGUE[identifier],
        name=name or CATALOGUE[identifier].name,
        parameter=parameter,
        expected=expected,
        on="terms",
        acts=acts,
        shapes=shapes,
    )


def _arcs(identifier: str, name: str, power: float, equation: str) -> CampaignEffect:
    """An effect on the law of the arcs: at the least arc of the table as large as the linear."""
    parameter = Parameter("share", "", 0.0, 1e3)
    acts, shapes = _power(power), _least_arc
    return CampaignEffect(identifier, name, equation, parameter, 1.0, "terms", acts, shapes)


OF_TABLES: Final[tuple[CampaignEffect, ...]] = (
    # Stokes's constants were off by factors of 1.4 and 1.7.
    _as(
        "viscosity-temperature",
        Parameter("log_ratio", "", -3.0, 3.0),
        0.5,
        _viscosity,
        "another viscosity than is told",
    ),
    _as("history-term", Parameter("C_H - 1", "", -1.0, 3.0), 0.1, _size_of("history")),
    _as("added-mass", Parameter("added_mass", "", -0.5, 20.0), 0.1, _more("added")),
    _as("wall-confinement", Parameter("closeness", "", 0.0, 0.5), 0.1, _walls, "", _largest),
    _as("uniform-drag-excess", Parameter("excess", "", -0.5, 1.0), 0.1, _size_of("drag")),
    _as(
        "hysteretic-damping",
        Parameter("loss", "", -1.0, 1.0),
        0.01,
        _more("beside"),
        "a loss beside the fluid's, the same in every swing",
    ),
    _arcs("quadratic-drag", "quadratic drag", 2.0, r"\dot y \mathrel{-}= a y^2"),
    _arcs("power-law-damping", "a loss as the arc's 3/2", 1.5, r"\dot y \mathrel{-}= a_n y^{3/2}"),
    _arcs("coulomb-friction", "dry friction", 0.0, r"\dot y \mathrel{-}= c"),
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
"""What a table may lack, by the identifiers of campaigns and records for the same cause."""


@candidates.register(Table)
def _candidates(design: Table) -> list[Candidate]:
    """Return the causes that move a row."""
    every = [Candidate(each, shape) for each in OF_TABLES for shape in each.shapes_in(design)]
    none = np.zeros(len(design.nuisances))
    plain = predict(design, (), none)
    return [one for one in every if np.any(predict(design, (one,), np.append(none, STEP)) != plain)]


def read_table(path: Path, viscosity_m2_per_s: dict[str, float], relative_sd: float) -> Table:
    """Read a table of tab-separated columns (`Row`); an empty cell is told by nobody.

    Raises
    ------
    InputError
        A column is missing or unknown, a cell is no number, a body, fluid or quantity is unknown,
        or a row lacks what its theory needs.
    """
    text = read_text(path, "see docs/published.md", absent="table")
    lines = list(csv.DictReader(io.StringIO(text, newline=""), delimiter="\t", restkey=""))
    give = f"give the columns {', '.join(NEEDED)}, and of {', '.join(_OPTIONAL)} what is told"
    refuse_if(not lines, path, "it has no row", give)
    heads = [name for name in lines[0] if name]
    for name in {**dict.fromkeys(NEEDED), **dict.fromkeys(heads)}:
        refuse_if(name not in heads, path, f"it lacks the column {name}", give)
        known = name in (*NEEDED, *_OPTIONAL)
        refuse_if(not known, path, f"no column is called {name!r}", give)
    return Table(
        tuple(
            _row(line, f"{path}, line {number}", tuple(viscosity_m2_per_s))
            for number, line in enumerate(lines, 2)
        ),
        viscosity_m2_per_s,
        relative_sd,
    )


def _row(line: dict[str, str], where: str, fluids: tuple[str, ...]) -> Row:
    """Check a line of a table."""
    refuse_if("" in line, where, "it has more cells than the table columns", "take some out")
    words = {name for name, kind in Row.__annotations__.items() if kind is str}
    line = {"record" if name == "row" else name: cell or "" for name, cell in line.items()}
    try:
        cells: dict[str, Any] = {
            name: cell if name in words else float(cell or "nan") for name, cell in line.items()
        }
        row = Row(**cells)
    except ValueError as fault:
        raise InputError(where, f"{fault}", "give a number") from None
    for name, names in {"body": BODIES, "fluid": fluids, "quantity": QUANTITIES}.items():
        unknown = f"the {name} {getattr(row, name)!r} is unknown"
        refuse_if(getattr(row, name) not in names, where, unknown, f"give {' or '.join(names)}")
    quantity, printed = QUANTITIES[row.quantity], row.body == "printed"
    asks = [*quantity.asks, *(BODIES[row.body] if quantity.theory else ())]
    asks += ["value"] if quantity.theory and not math.isnan(row.value) else []
    asks += ["then"] if printed and quantity.theory == "k" else []
    if quantity.theory == "loss" and not row.constant:
        refuse_if(printed, where, "it has no constant", "name the one that multiplies its loss")
        asks.append("inertia")
    for name in asks:
        lost = not 0.0 < getattr(row, name) < math.inf
        needs = f"the {row.quantity} of a {row.body} needs it"
        refuse_if(lost, where, f"{name} is no positive number", needs)
    wrong = not (math.isnan(row.sd) or 0.0 < row.sd < math.inf)
    refuse_if(wrong, where, "sd is no positive number", "leave it empty where none is printed")
    return row
