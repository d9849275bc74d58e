"""Which further runs would tell the rivals of a class apart, and by how many sigma."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np

from pendpipe.arrays import FloatArray
from pendpipe.campaign.design import Design, Run
from pendpipe.campaign.fit import JointFit, Measured, chi2_near, predict

_CLAMPED_ANEW_M: Final = 1e-9
"""A place this far away is the same place with an error of its own."""
_GLYCEROL: Final = {"viscosity_pa_s": 5.6e-3, "density_kg_per_m3": 1122.0}
"""Half glycerol, half water by mass at 20 C: about 5 mm^2/s."""


def _fluid(run: Run, changes: dict[str, float]) -> Run:
    return replace(run, fluid=run.fluid.model_copy(update=changes) if run.fluid else None)


RUNS: Final[dict[str, Callable[[Run], Run]]] = {
    "a large and deep tank": lambda run: replace(run, tank=False),
    "half glycerol, half water": lambda run: _fluid(run, _GLYCEROL),
    "half glycerol, half water in a large and deep tank": lambda run: replace(
        _fluid(run, _GLYCEROL), tank=False
    ),
    "the bare screw in the water": lambda run: replace(run, sphere=False),
    "the same settings without water": lambda run: replace(run, fluid=None),
    "releases at 10 mrad": lambda run: replace(run, release_rad=0.010),
    "a lid on the water": lambda run: replace(run, open_surface=False),
    "the reversed order": lambda run: replace(run, order=-run.order),
    "water at 35 °C": lambda run: replace(run, temperature_c=35.0),
    "the same records once more": lambda run: run,
}
"""Candidates: what each does to every record in the fluid."""


class NextRun(NamedTuple):
    """One candidate: the sigma at which it would reject each rival, before and with it."""

    what: str
    now: dict[str, float]
    then: dict[str, float]

    @property
    def worst(self) -> float:
        """The sigma of the rival that is rejected least."""
        return min(self.then.values())


def next_measurements(fit: JointFit, rivals: Mapping[str, JointFit]) -> list[NextRun]:
    """Rank the candidates by the sigma at which they would reject every rival.

    The campaign with the runs added, as the leader predicts it, is fitted with each rival instead:
    the root of its chi^2 is that sigma. A new record is as good, relative to its b and its
    frequency, as the one whose weights it has; the weights are clamped anew for it.

    Parameters
    ----------
    fit
        With the leader.
    rivals
        The fits with each of the others in its place, by identifier.
    """
    if not rivals:
        return []
    with np.errstate(invalid="ignore", divide="ignore"):  # without the sphere some turn over
        now = _sigmas(fit, rivals, None)
        found = [NextRun(what, now, _sigmas(fit, rivals, change)) for what, change in RUNS.items()]
    return sorted(found, key=lambda run: -run.worst)


def _sigmas(
    fit: JointFit, rivals: Mapping[str, JointFit], change: Callable[[Run], Run] | None
) -> dict[str, float]:
    """How many sigma each rival would be away."""
    design, again = _extended(fit.design, change)
    expected = predict(design, fit.added, _carried(fit, fit, design))
    usable = np.asarray(np.isfinite(expected).all(axis=-1))
    # The same relative errors at other values.
    whitening = fit.data.whitening[again] * (fit.data.values[again] / expected)[:, None, :]
    runs = tuple(run for run, good in zip(design.runs, usable.tolist(), strict=True) if good)
    kept, data = replace(design, runs=runs), Measured(expected[usable], whitening[usable])
    return {
        name: math.sqrt(chi2_near(kept, data, rival.added, _carried(rival, fit, kept)))
        for name, rival in rivals.items()
    }


def _extended(design: Design, change: Callable[[Run], Run] | None) -> tuple[Design, list[int]]:
    """The design with changed copies of its records in the fluid, and what each run repeats."""
    every = list(range(len(design.runs)))
    if change is None:
        return design, every
    wet = [number for number in every if design.runs[number].fluid is not None]
    more = []
    for number in wet:
        run = design.runs[number]
        places = {name: place + _CLAMPED_ANEW_M for name, place in run.weights_m.items()}
        more.append(change(replace(run, weights_m=places)))
    return replace(design, runs=(*design.runs, *more)), [*every, *wet]


def _carried(fit: JointFit, truth: JointFit, design: Design) -> FloatArray:
    """Unknowns of a fit for another design, where the truth has its inputs as configured."""
    there = {each.name: number for number, each in enumerate(fit.design.nuisances)}
    count = len(fit.design.nuisances)
    moved = fit.unknowns[:count] - truth.design.has_prior * truth.unknowns[:count]
    found = [moved[there[each.name]] if each.name in there else 0.0 for each in design.nuisances]
    return np.array([*found, *fit.unknowns[count:]])
