"""The diagnosis of one recording, from its readings to the answer."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from pendpipe.analysis.fit.fixed import check_fixed
from pendpipe.analysis.fit.result import Baseline
from pendpipe.analysis.turning_points import TurningPoints
from pendpipe.analysis.turning_points.samples import Samples, prepare
from pendpipe.diagnose import Progress, silent
from pendpipe.diagnose.begin import Beginning, begin
from pendpipe.diagnose.forensics.lattice import with_true_step
from pendpipe.diagnose.forensics.time_stamps import gap_note
from pendpipe.diagnose.held_out import HeldOut, held_out
from pendpipe.diagnose.likelier import swap_in_likelier
from pendpipe.diagnose.refine import Fit
from pendpipe.diagnose.released_parameters import released_parameters
from pendpipe.diagnose.result import Diagnosis, FittedModel, FoundEffect
from pendpipe.diagnose.search import Search, search
from pendpipe.diagnose.small_swings import SmallSwings, small_swings
from pendpipe.diagnose.statement import statement
from pendpipe.diagnose.values import parameters_of
from pendpipe.diagnose.weighing import Weighed, effect_named, fault_named
from pendpipe.dynamics.any_law import NoMotionError
from pendpipe.errors import NotAnalysableError
from pendpipe.recording import Recording

LEVEL: Final = 0.01
"""Probability with which a recording that holds nothing is accused."""


@dataclass(frozen=True)
class Outcome:
    """The answer, and what its figures are drawn from."""

    diagnosis: Diagnosis
    search: Search
    beginning: Beginning


def diagnose_recording(
    recording: Recording,
    *,
    baseline: Baseline = "eq8",
    fixed: Mapping[str, float] | None = None,
    seed: int = 0,
    level: float = LEVEL,
    place: str | Path = "recording",
    provenance: Mapping[str, Any] | None = None,
    progress: Progress = silent,
) -> Outcome:
    """Say where Eq. 8 and a recording differ, and what was left out.

    Parameters
    ----------
    recording
        Angles, displacements, or volts with a known constant; the free decay in it is found.
    baseline
        ``"eq8"``, or ``"viscous"`` for Eq. 3.
    fixed
        Parameters that are held, by name, so that a prediction is compared.
    seed
        Of the draws that count the trials of the scans.
    level
        Global p-value below which something is said to be missing.
    place
        FoundEffect in messages.
    provenance
        Goes into the result.
    progress
        Is told each step in a line.

    Raises
    ------
    InputError
        If a parameter can't be held, or the recording can't be analysed.
    """
    from pendpipe.analysis.turning_points.recorded import measure_recording

    check_fixed(fixed or {}, baseline)
    progress("finding the free decay and its turning points")
    points, part = measure_recording(recording.as_motion(place=place), place)
    return diagnose_decay(
        part,
        points,
        baseline=baseline,
        fixed=fixed,
        seed=seed,
        level=level,
        place=place,
        provenance=provenance,
        progress=progress,
        whole=recording,
    )


# Trials far from any motion overflow; they are looked at, and thrown away.
@np.errstate(over="ignore", divide="ignore", invalid="ignore")
def diagnose_decay(
    part: Recording,
    points: TurningPoints,
    *,
    baseline: Baseline = "eq8",
    fixed: Mapping[str, float] | None = None,
    seed: int = 0,
    level: float = LEVEL,
    place: str | Path = "recording",
    provenance: Mapping[str, Any] | None = None,
    progress: Progress = silent,
    whole: Recording | None = None,
) -> Outcome:
    """The same for a free decay whose turning points are known.

    Of the `whole` recording that it was cut from only the time stamps are looked at.
    """
    fixed = fixed or {}
    check_fixed(fixed, baseline)
    samples = with_true_step(prepare(part, place))
    try:
        found, weighed, beginning = _searched(
            samples, points, baseline, fixed, level, seed, progress
        )
    except NoMotionError as fault:
        remedy = "cut it with --start and --stop, or change what is held with --fix"
        raise NotAnalysableError(place, f"the model can't follow it ({fault})", remedy) from fault
    named = _as_added(found, weighed)
    gap = gap_note((whole or part).time_s, 0.5 / points.apparent_frequency_hz, samples.counts)
    stamps = (*([gap] if gap else []), *found.said)
    notes = (*points.notes, *stamps)
    rms = max(found.noise.rms, found.data.step / 12.0**0.5)
    before = _judged(found.baseline, found)
    same = found.improved.value is found.baseline.value and found.improved.error_scale == 1.0
    after = before if same else _judged(found.improved, found)
    if named:
        progress("predicting held-out blocks")
    held = _held_out(found, beginning) if named else None
    swings = _small_swings(found)
    diagnosis = Diagnosis(
        baseline,
        before,
        after,
        rms,
        "missing-physics" if named else "consistent",
        found.p_value,
        named,
        held,
        after.residual_rms_rad,
        found.unexplained,
        statement(
            baseline,
            before,
            after,
            named,
            held,
            rms,
            found.unexplained,
            level,
            unit=found.data.unit,
            remainder=found.remainder,
            swings=swings,
            notes=stamps,
        ),
        warnings=notes,
        remainder=found.remainder,
        small_swings=swings,
        provenance=dict(provenance or {}),
    )
    return Outcome(diagnosis, found, beginning)


def _searched(
    samples: Samples,
    points: TurningPoints,
    baseline: Baseline,
    fixed: Mapping[str, float],
    level: float,
    seed: int,
    progress: Progress,
) -> tuple[Search, tuple[Weighed, ...], Beginning]:
    from pendpipe.effects.catalogue import CATALOGUE

    beginning = begin(samples, points, baseline=baseline, fixed=fixed)
    found = search(
        beginning,
        samples,
        CATALOGUE,
        baseline=baseline,
        level=level,
        seed=seed,
        freed=released_parameters(fixed),
        progress=progress,
    )
    return *swap_in_likelier(found, beginning), beginning


def _as_added(found: Search, weighed: Sequence[Weighed]) -> tuple[FoundEffect, ...]:
    """Name effects and faults in the order in which they were added."""
    effects = [
        (place, effect_named(found, step, each))
        for place, (step, each) in enumerate(zip(found.steps, weighed, strict=True))
    ]
    faults = [(fault.behind, fault_named(found, fault)) for fault in found.faults]
    # Sorting keeps the order of equals: a fault goes before the effect that followed it.
    return tuple(name for _, name in sorted([*faults, *effects], key=lambda pair: pair[0]))


def _small_swings(found: Search) -> SmallSwings | None:
    """What the names leave open there; a curve that is drawn over it would hide it."""
    if not found.named.remainder.systematic:
        return None
    swings = small_swings(found.named.fit, found.data, found.noise)
    return swings if swings is not None and swings.sure else None


def _judged(fit: Fit, found: Search) -> FittedModel:
    data = found.data
    residual = data.residual(fit.at.reading)[data.weight > 0.0]
    dof = max(data.used - len(fit.free), 1)
    return FittedModel(
        parameters_of(fit, data.unit), float(np.sqrt(np.mean(residual**2))), fit.chi2 / dof
    )


def _held_out(found: Search, beginning: Beginning) -> HeldOut:
    return held_out(
        found.baseline, found.improved, found.data, found.noise, beginning.held, found.held
    )
