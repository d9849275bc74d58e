"""Which further runs would tell the rivals of a class apart, and what they would read."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np

from pendpipe.arrays import FloatArray
from pendpipe.campaign.design import Design, Run
from pendpipe.campaign.fit import STEP, JointFit, Measured, chi2_near, predict
from pendpipe.estimate import Estimate

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
    lost: tuple[str, ...]
    """Records whose pendulum would turn over."""
    predicted: Mapping[str, tuple[Estimate, Estimate]]
    """Frequency and b of each new record that swings, with what the campaign leaves open."""

    @property
    def worst(self) -> float:
        """The sigma of the rival that is rejected least."""
        return min(self.then.values())


def next_measurements(fit: JointFit, rivals: Sequence[JointFit]) -> list[NextRun]:
    """Rank the candidates by the sigma at which they would reject every rival.

    The campaign with the runs added, as the leader predicts it, is fitted with each rival instead:
    the root of its chi^2 is that sigma. A new record is as good, relative to its b and its
    frequency, as the one whose weights it has; the weights are clamped anew for it.

    Parameters
    ----------
    fit
        With the leader.
    rivals
        The fits with each of the others in its place.
    """
    if not rivals:
        return []
    with np.errstate(invalid="ignore", divide="ignore"):  # without the sphere some turn over
        now, _ = _sigmas(fit, rivals, None)
        found = [
            NextRun(what, now, *_sigmas(fit, rivals, change), _expected(fit, change))
            for what, change in RUNS.items()
        ]
    return sorted(found, key=lambda run: -run.worst)


def _expected(fit: JointFit, change: Callable[[Run], Run]) -> dict[str, tuple[Estimate, Estimate]]:
    """What new records would show, with the errors of the campaign's unknowns and own clamping."""
    design, again = _extended(fit.design, change)
    at, there = _carried(fit, fit, design), fit.design.index
    steps = STEP * np.eye(len(at))
    slopes = (predict(design, fit.added, at + steps) - predict(design, fit.added, at - steps)) / (
        2.0 * STEP
    )
    rows = [there.get(each.name) for each in design.nuisances]
    rows += range(len(fit.unknowns) - len(fit.added), len(fit.unknowns))
    known = [number for number, row in enumerate(rows) if row is not None]
    covariance = np.eye(len(at))
    covariance[np.ix_(known, known)] = fit.covariance[np.ix_(*2 * [[rows[k] for k in known]])]
    variance = np.einsum("irj,ik,krj->rj", slopes, covariance, slopes)
    values, found = predict(design, fit.added, at), {}
    for number in range(len(fit.design.runs), len(again)):
        if np.isfinite(values[number]).all():
            pairs = zip(values[number], np.sqrt(variance[number]), ("Hz", "1/s"), strict=True)
            frequency, b = (Estimate(float(y), float(sd), unit) for y, sd, unit in pairs)
            found[design.runs[number].record] = frequency, b
    return found


def _sigmas(
    fit: JointFit, rivals: Sequence[JointFit], change: Callable[[Run], Run] | None
) -> tuple[dict[str, float], tuple[str, ...]]:
    """How many sigma each rival would be away, and which records would not swing."""
    design, again = _extended(fit.design, change)
    expected = predict(design, fit.added, _carried(fit, fit, design))
    usable = np.asarray(np.isfinite(expected).all(axis=-1))
    # The same relative errors at other values.
    whitening = fit.data.whitening[again] * (fit.data.values[again] / expected)[:, None, :]
    runs = tuple(run for run, good in zip(design.runs, usable.tolist(), strict=True) if good)
    kept, data = replace(design, runs=runs), Measured(expected[usable], whitening[usable])
    sigma = {
        rival.last.identifier: math.sqrt(
            chi2_near(kept, data, rival.added, _carried(rival, fit, kept))
        )
        for rival in rivals
    }
    swings = zip(design.runs, usable.tolist(), strict=True)
    return sigma, tuple(run.record for run, good in swings if not good)


def _extended(design: Design, change: Callable[[Run], Run] | None) -> tuple[Design, list[int]]:
    """The design with changed copies of its records in the fluid, and what each run repeats."""
    every = list(range(len(design.runs)))
    if change is None:
        return design, every
    wet = [number for number in every if design.runs[number].fluid is not None]
    more = [
        replace(
            design.runs[number],
            weights_m={
                name: place + _CLAMPED_ANEW_M
                for name, place in design.runs[number].weights_m.items()
            },
        )
        for number in wet
    ]
    return replace(design, runs=(*design.runs, *map(change, more))), [*every, *wet]


def _carried(fit: JointFit, truth: JointFit, design: Design) -> FloatArray:
    """Unknowns of a fit for another design, where the truth has its inputs as configured."""
    there, count = fit.design.index, len(fit.design.nuisances)
    moved = fit.unknowns[:count] - truth.design.has_prior * truth.unknowns[:count]
    found = [moved[there[each.name]] if each.name in there else 0.0 for each in design.nuisances]
    return np.array([*found, *fit.unknowns[count:]])
