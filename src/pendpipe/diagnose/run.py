"""The diagnosis of one recording, from its readings to the answer."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from pendpipe.analysis.fit.result import Baseline
from pendpipe.arrays import FloatArray
from pendpipe.diagnose.begin import Beginning, begin, read_samples
from pendpipe.diagnose.curve_values import curve_values
from pendpipe.diagnose.faults import Fault
from pendpipe.diagnose.freed import FreedParameter, freed_parameters
from pendpipe.diagnose.held_out import HeldOut, held_out
from pendpipe.diagnose.location import Location, locate
from pendpipe.diagnose.model import Model
from pendpipe.diagnose.naming import CLASS, Rival, probabilities
from pendpipe.diagnose.progress import Progress, silent
from pendpipe.diagnose.refine import Fit, refine
from pendpipe.diagnose.result import Diagnosis, Judged, Named
from pendpipe.diagnose.search import Search, Step, is_gross, search
from pendpipe.diagnose.statement import statement
from pendpipe.diagnose.values import effect_parameters, parameters_of
from pendpipe.dynamics.any_law import NoMotionError
from pendpipe.effects.curves import Curve
from pendpipe.recording import Recording

LEVEL: Final = 0.01
"""Probability with which a recording that holds nothing is accused."""
_NONE: Final = 4.0
"""Evidence (in chi^2) that it is none of the class's, where the model leaves nothing."""


@dataclass(frozen=True)
class Outcome:
    """The answer, and what its figures are drawn from."""

    diagnosis: Diagnosis
    search: Search
    beginning: Beginning


def diagnose_recording(
    recording: Recording, *, baseline: Baseline = "eq8", fixed: Mapping[str, float] | None = None,
    seed: int = 0, level: float = LEVEL, place: str | Path = "recording",
    provenance: Mapping[str, Any] | None = None, progress: Progress = silent,
) -> Outcome:  # fmt: skip
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
        Named in messages.
    provenance
        Goes into the result.
    progress
        Is told each step in a line.

    Raises
    ------
    InputError
        If the recording can't be analysed.
    """
    from pendpipe.analysis.turning_points.recorded import measure_recording

    progress("finding the free decay and its turning points")
    points, part = measure_recording(recording.as_motion(), place)
    return diagnose_decay(
        part, points, baseline=baseline, fixed=fixed, seed=seed, level=level, place=place,
        provenance=provenance, progress=progress,
    )  # fmt: skip


# Trials far from any motion overflow; they are looked at, and thrown away.
@np.errstate(over="ignore", divide="ignore", invalid="ignore")
def diagnose_decay(
    part: Recording, points: Any, *, baseline: Baseline = "eq8",
    fixed: Mapping[str, float] | None = None, seed: int = 0, level: float = LEVEL,
    place: str | Path = "recording", provenance: Mapping[str, Any] | None = None,
    progress: Progress = silent,
) -> Outcome:  # fmt: skip
    """The same for a free decay whose turning points are known."""
    from pendpipe.effects.catalogue import CATALOGUE

    fixed = fixed or {}
    samples = read_samples(part, place)
    beginning = begin(samples, points, baseline=baseline, fixed=fixed)
    found = search(
        beginning, samples, CATALOGUE, baseline=baseline, level=level, seed=seed,
        freed=freed_parameters(fixed), progress=progress,
    )  # fmt: skip
    named = (
        *(_fault(found, fault) for fault in found.faults),
        *(_named(found, beginning, step) for step in found.steps),
    )
    rms = max(found.noise.rms, found.data.step / 12.0**0.5)
    before = _judged(found.baseline, found)
    after = _judged(found.improved, found)
    if named:
        progress("predicting held-out blocks")
    held = _held_out(found, beginning) if named else None
    diagnosis = Diagnosis(
        baseline, before, after, rms,
        "missing-physics" if named else "consistent", found.p_value, named, held,
        after.residual_rms_rad, found.unexplained,
        statement(
            baseline, before, after, named, held, rms, found.unexplained, level
        ),
        warnings=points.notes, provenance=dict(provenance or {}),
    )  # fmt: skip
    return Outcome(diagnosis, found, beginning)


def _judged(fit: Fit, found: Search) -> Judged:
    data = found.data
    residual = data.residual(fit.at.reading)[data.weight > 0.0]
    dof = max(data.used - len(fit.free), 1)
    return Judged(
        parameters_of(fit, data.unit), float(np.sqrt(np.mean(residual**2))), fit.chi2 / dof
    )


def _held_out(found: Search, beginning: Beginning) -> HeldOut:
    return held_out(
        found.baseline, found.improved, found.data, found.noise, beginning.held, found.held
    )


def _named(found: Search, beginning: Beginning, step: Step) -> Named:
    """One effect, weighed against its rivals with all the others in the model."""
    effect = step.winner.lead.effect
    without, rivals = _rivalry(found, beginning, step)
    gain = without.chi2 - found.improved.chi2
    mates = [
        rival for rival in rivals
        if rival.lead.effect.kind != "unnamed" and rival.identifier != effect.identifier
        and gain - rival.gain < CLASS
    ]  # fmt: skip
    own = next((rival for rival in rivals if rival.lead.effect.key == effect.key), step.winner)
    weights = probabilities([own, *mates], own.evidence - _NONE - _misfit(found))
    return Named(
        effect.identifier, effect.name, effect.kind, effect.equation,
        effect_parameters(found.improved, effect, found.data.unit), gain, step.p_value,
        float(weights[0]),
        tuple((mate.identifier, float(weight)) for mate, weight in
              zip(mates, weights[1:], strict=False)),
        effect.deciding, locate(without, found.improved, found.data, effect),
        curve_values(found.improved, effect, found.data.unit)
        if isinstance(effect, Curve) else None,
    )  # fmt: skip


def _fault(found: Search, fault: Fault) -> Named:
    """A fault of the measurement that a test of its own has found."""
    from pendpipe.effects.catalogue import by_identifier

    finding = fault.finding
    effect = by_identifier(finding.identifier)
    place = finding.location
    doubt = math.exp(-0.5 * (_NONE + _misfit(found)))
    return Named(
        effect.identifier, effect.name, effect.kind, effect.equation, finding.parameters,
        finding.delta_chi2, fault.p_value, 1.0 / (1.0 + doubt), (), effect.deciding,
        Location(
            place.time_s, place.amplitude_rad, place.phase_rad, place.frequency_hz, (),
            place.adc_codes, finding.summary,
        ),
    )  # fmt: skip


def _misfit(found: Search) -> float:
    """How much of the doubt a model that leaves nothing takes away."""
    return 4.0 if found.unexplained > 0.01 else 0.0


def _rivalry(found: Search, beginning: Beginning, step: Step) -> tuple[Fit, Sequence[Rival]]:
    """The model without one effect, and who else could take its place in it."""
    effect = step.winner.lead.effect
    held = list(found.held)
    model, value = beginning.model, found.improved.value[:8].copy()
    if isinstance(effect, FreedParameter):
        held.append(effect.index)
        value[effect.index] = beginning.value[effect.index]
    for other, place in found.improved.model.places():
        if other is not effect:
            model = model.adding(other)
            value = np.append(value, found.improved.value[place])
    without = _refined(model, found, value, held) or step.before
    alone = len(found.steps) == 1 and not is_gross(without, found.data)
    if alone:
        return without, step.rivals
    rivals = []
    for rival in step.rivals:
        if rival.lead.effect.key == effect.key:
            fit, lead = found.improved, rival.lead
        else:
            lead = rival.lead
            again = refit_one(without, found, lead, held, rival)
            if again is None:
                continue
            fit = again
        gain = without.chi2 - fit.chi2
        rivals.append(Rival(lead, fit, gain, rival.evidence + gain - rival.gain))
    return without, rivals


def _refined(model: Model, found: Search, value: FloatArray, held: Sequence[int]) -> Fit | None:
    """The fit of a model, from values that may be far from its own; None if it can't move so."""
    for start in (value, np.concatenate([found.baseline.value, value[8:]])):
        try:
            return refine(model, found.data, found.noise, start, held=held)
        except (NoMotionError, np.linalg.LinAlgError):
            continue
    return None


def refit_one(
    without: Fit, found: Search, lead: Any, held: Sequence[int], rival: Rival
) -> Fit | None:
    """Refit a rival in the final model, from where it ended before."""
    effect = lead.effect
    if isinstance(effect, FreedParameter):
        held = [index for index in held if index != effect.index]
    own = rival.fit.value[len(rival.fit.value) - effect.count :]
    start = np.concatenate([without.value, own])
    return _refined(without.model.adding(effect), found, start, held)
