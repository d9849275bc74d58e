"""The diagnosis of one recording, from its readings to the answer."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from pendpipe.analysis.angles import scale_of
from pendpipe.analysis.fit.fitted import Baseline
from pendpipe.analysis.fit.fixed import check_fixed
from pendpipe.analysis.fit.quality import small_frequency
from pendpipe.analysis.fit.result import FitResult
from pendpipe.analysis.noise import scatter
from pendpipe.analysis.readings import motion_of
from pendpipe.analysis.turning_points import TurningPoints
from pendpipe.analysis.turning_points.measure import Samples, prepare
from pendpipe.arrays import FloatArray
from pendpipe.diagnosis import Progress, silent
from pendpipe.diagnosis.begin import begin
from pendpipe.diagnosis.cycles import small_swings
from pendpipe.diagnosis.data import with_scatter
from pendpipe.diagnosis.forensics.codes import with_true_step
from pendpipe.diagnosis.forensics.sampling_times import gap_note
from pendpipe.diagnosis.forensics.slips import loss_confirmed
from pendpipe.diagnosis.found import FittedModel, FoundEffect, Location, verdict_of
from pendpipe.diagnosis.held_out import held_out
from pendpipe.diagnosis.hypothesis import Hypothesis, Task, catalogue_beside
from pendpipe.diagnosis.projection import whitened
from pendpipe.diagnosis.quoted import quoted
from pendpipe.diagnosis.refine import Fit, remainder_of, with_errors
from pendpipe.diagnosis.released_parameters import ReleasedParameter
from pendpipe.diagnosis.result import Diagnosis
from pendpipe.diagnosis.search import baseline_fitted, run_search
from pendpipe.diagnosis.seen import Seen, seen_of
from pendpipe.diagnosis.summary import causes_of, class_of, jumps, test_of
from pendpipe.diagnosis.values import parameters_of
from pendpipe.diagnosis.weighing import effect_named, fault_named
from pendpipe.dynamics.any_law import NoMotionError, sample_pieces
from pendpipe.dynamics.eq8 import Restoring
from pendpipe.effects.catalogue.losses import drag_form
from pendpipe.effects.catalogue.restoring import circular_error
from pendpipe.errors import NotAnalysableError, refuse_if
from pendpipe.estimate import NAMED, Estimate
from pendpipe.levels import FALSE_ALARM
from pendpipe.quantities import stretch, with_error
from pendpipe.recording import Recording


# Trial models far from the motion overflow; they are computed and rejected.
@np.errstate(over="ignore", divide="ignore", invalid="ignore")
def diagnose_recording(
    recording: Recording,
    *,
    baseline: Baseline = "eq8",
    fixed: Mapping[str, float] | None = None,
    seed: int = 0,
    level: float = FALSE_ALARM,
    restoring: Restoring | None = None,
    length: Estimate | None = None,
    place: str | Path = "recording",
    provenance: Mapping[str, Any] | None = None,
    progress: Progress = silent,
    points: TurningPoints | None = None,
    whole: Recording | None = None,
) -> Diagnosis:
    """Find where Eq. 8 and a recording differ, and what effect is missing.

    Parameters
    ----------
    recording
        Angles, displacements, or volts with a known constant; the free decay in it is found.
    baseline
        ``"eq8"``, or ``"viscous"`` for Eq. 3.
    fixed
        Parameters that are held, by name, so that a prediction is tested.
    seed
        Of the random draws that count the trials of the scans.
    level
        The false-alarm probability: an effect is reported where the global p-value is below it.
    restoring
        The torque, where it is known: ``"linear"`` for a torsion wheel or a mass on a spring, for
        which sin x is no candidate. By default that of the fit.
    length
        Of a pendulum whose position is read.
    place
        Named in error messages.
    provenance
        Goes into the result.
    progress
        Receives one line for each step.
    points
        Those of the recording, where it is a free decay that is measured already.
    whole
        The recording that this decay was cut from; only its time stamps are used.

    Raises
    ------
    InputError
        If a parameter can't be held, or the recording can't be analysed.

    Examples
    --------
    >>> import numpy as np
    >>> from pendpipe.recording import Recording
    >>> time_s = np.arange(900) / 15.0
    >>> noise = 1e-4 * np.random.default_rng(1).standard_normal(900)
    >>> angle_rad = 0.2 * np.exp(-0.02 * time_s) * np.cos(5.6 * time_s) + noise
    >>> found = diagnose_recording(Recording(time_s, angle_rad, "angle_rad"))
    >>> found.verdict
    'consistent'
    >>> print(str(found)[:18])
    nothing is missing
    """
    from pendpipe.analysis.free_decay import measure_recording

    fixed, part = fixed or {}, recording
    check_fixed(fixed, baseline)
    if points is None:
        progress("finding the free decay and its turning points")
        motion = motion_of(recording, place=place)
        points, part = measure_recording(motion, place, length_m=length.value if length else None)
        refuse_if(
            points.mostly_cut,
            place,
            f"most of it was cut: {points.mostly_cut}, of which nothing is said",
            "cut it with --start and --stop, or see pendpipe inspect",
            NotAnalysableError,
        )
        for cut in points.cuts:
            progress(f"left out: {stretch(cut.start_s, cut.stop_s)}, {cut.reason}")
    if restoring == "sine" and part.unit == "m":
        # The search reads angles, whoever has measured the position.
        angles, part = measure_recording(_angle_of(part, points, length, place), place)
        points = replace(angles, cuts=points.cuts)
    samples = with_true_step(points.readings or prepare(part, place))
    progress("fitting Eq. 8 to all readings")
    fit = _fit_of(part, points, baseline, fixed, restoring, place)
    try:
        beginning = begin(
            samples, points, fit, baseline=baseline, fixed=fixed, stated=part.unit_is_stated
        )
        released = [ReleasedParameter(name) for name in fixed]
        catalogue = catalogue_beside(restoring)
        task = Task(catalogue, released, baseline, level, seed, progress, samples)
        # No name holds a fit that is left behind: of a long recording it is large.
        found = _with_scatter(run_search(baseline_fitted(beginning, task), task), samples)
    except NoMotionError as error:
        remedy = "cut it with --start and --stop, or change what is held with --fix"
        raise NotAnalysableError(place, f"the model can't follow it ({error})", remedy) from error
    named = [effect_named(found, step) for step in found.steps]
    named = [replace(each, discriminating_test=test_of(each)) for each in named]
    effects, predicted = _in_order(found, named, samples), None
    if verdict_of(effects, found.p_value, level) != "consistent" and not _adds_nothing(found):
        progress("predicting cycles that are left out of the fit")
        both = found.baseline, found.fit
        predicted = held_out(*both, found.data, found.noise, beginning.held, found.held)
    # A part of b that is held bounds b here alone.
    before, after = _models(found, None if beginning.model.parts else fit, baseline, level)
    gap = gap_note((whole or recording).time_s, 0.5 / points.apparent_frequency_hz, samples.counts)
    law = ""
    if restoring == "sine" and found.baseline.model.restoring != "sine":
        law = f"sin x is left out: it is of angles, for which {part.unit} need a length"
        progress(law)
    stamps = tuple(note for note in (law, gap, *found.notes.values()) if note)
    return Diagnosis(
        before,
        after,
        (*presumed(found), *effects),
        predicted,
        *_seen(found, named, level),
        warnings=(*points.notes, *stamps),
        provenance=dict(provenance or {}),
        name=Path(place).name if str(place) != "recording" else "",
        search=found,
        level=level,
    )


def _angle_of(
    part: Recording, points: TurningPoints, length: Estimate | None, place: str | Path
) -> Recording:
    """The angle arcsin((s - s0)/L) of a pendulum's position s, with the s0 and L of its fit."""
    from pendpipe.analysis.fit import fit_recording, fitted_arm

    arm = fitted_arm(points.readings or prepare(part, place), points, length, scale_of(part))
    fit = fit_recording(part, points=points, restoring="sine", length=arm, place=place)
    sine = (part.values - fit.value("offset")) / arm.value
    step = None if part.resolution is None else part.resolution / arm.value
    note = f"read as arcsin(s/L): L = {with_error(arm.value, arm.sd, 'm', short=True)}"
    return replace(
        part,
        values=np.arcsin(np.clip(sine, -1.0, 1.0)),
        quantity="angle_rad",
        resolution=step,
        notes=(*part.notes, note),
    )


def _models(
    found: Hypothesis, fit: FitResult | None, name: str, level: float
) -> tuple[FittedModel, FittedModel]:
    """Return the baseline as it is printed, and the model with what is missing.

    The baseline's numbers are those of the fit, where that stands; the others are averages over
    the descriptions that share the probability.
    """
    bare = with_errors(found.baseline, found.data, found.noise)
    before = _fitted_model(bare, found, name)
    if fit:
        law, small = before, {"frequency": small_frequency(fit)}
        if fit.light != "red":
            law = FittedModel.of_fit(fit)
        of_all = fit.method == "waveform" and not fit.cuts and fit.zero_drift is None
        # What it leaves of other readings, or beside a zero that drifts, compares with nothing.
        before = replace(law if of_all else before, parameters={**law.parameters, **small})
    if _adds_nothing(found) and found.fit.error_scale == 1.0:
        return before, before
    said = quoted(found, fit, level)
    leading, swings, after = said.leading, None, before
    # One law has one noise and one error of each number, whatever it leaves.
    if not _adds_nothing(found):
        parameters = {**parameters_of(leading, found.data), **said.constants}
        after = replace(_fitted_model(found.fit, found, name), parameters=parameters)
    if remainder_of(leading, found.data, found.noise).systematic:
        swings = small_swings(leading, found.data, found.noise)
    after = replace(
        after,
        quality_factors=said.quality_factors,
        period_span_s=said.period_span_s,
        small_swings=swings if swings and swings.significant else None,
    )
    return before, after


def _adds_nothing(found: Hypothesis) -> bool:
    return found.fit.value is found.baseline.value


def _seen(
    found: Hypothesis, named: Sequence[FoundEffect], level: float
) -> tuple[tuple[Seen, ...], tuple[Seen, ...]]:
    """Return what the baseline does not show, and what the model with all names does not.

    Where nothing was found that is asked only of what chance does not explain.
    """
    if not named and found.unexplained >= level:
        return (), ()
    readings, causes = (found.data, found.noise), causes_of(named)
    with np.errstate(all="ignore"):
        likely = [each for each in named if class_of(each)[0][0] >= NAMED]
        sudden = [each.location.time_s for each in likely if jumps(class_of(each)[0][2])]
        lines = [
            each.parameters[name]
            for each in likely
            if each.location.frequency_hz and not each.location.harmonics
            for name in list(each.parameters)
            if each.parameters[name].unit == "Hz"
        ]
        bare: Fit | None = found.baseline
        if not np.array_equal(found.baseline.model.time_s, found.fit.model.time_s):
            # Time stamps that were wrong are told as such.
            bare = found.without(*found.steps) if found.steps else None
        at, line = next(iter(sudden), None), next(iter(lines), None)
        seen = seen_of(bare, found.fit, *readings, instant_s=at, line_hz=line) if bare else ()
        others = [step for step, cause in zip(found.steps, causes, strict=True) if not cause.text]
        open_still = others or found.remainder.systematic
        if len(others) == len(found.steps) or not open_still:
            return seen, ()
        best = found.without(*others) if others else found.fit
        return seen, seen_of(best, found.fit, *readings) if best else ()


def _in_order(
    found: Hypothesis, named: Sequence[FoundEffect], samples: Samples
) -> tuple[FoundEffect, ...]:
    """List effects and measurement faults in the order in which they were added."""
    effects = list(enumerate(named))
    faults = [(fault.after, fault_named(found, fault)) for fault in found.faults]
    # The sort is stable: a fault goes before the effect that followed it.
    order = [each for _, each in sorted([*faults, *effects], key=lambda pair: pair[0])]
    return tuple(_checked(each, found, samples) for each in order)


def _checked(effect: FoundEffect, found: Hypothesis, samples: Samples) -> FoundEffect:
    """Test a loss of samples in the readings as they are."""
    if effect.identifier != "dropped-samples" or effect.location.time_s is None:
        return effect
    when, period_s = effect.location.time_s, found.fit.at.span.period_s
    at = effect.parameters["time"].value if "time" in effect.parameters else when[0]
    return replace(effect, confirmed=loss_confirmed(samples, at, period_s))


def _fit_of(
    part: Recording,
    points: TurningPoints,
    baseline: Baseline,
    fixed: Mapping[str, float],
    restoring: Restoring | None,
    place: str | Path,
) -> FitResult | None:
    """Return what ``pendpipe fit`` prints; None where it refuses."""
    from pendpipe.analysis.fit import fit_recording

    try:
        return fit_recording(
            part, points=points, baseline=baseline, fixed=fixed, restoring=restoring, place=place
        )
    except NotAnalysableError:
        return None


def presumed(found: Hypothesis) -> tuple[FoundEffect, ...]:
    """List what the baseline has that Eq. 8 has not: sin x, and v|v| where that was fitted.

    What each explains is told to first order beside the baseline's other numbers.
    """
    fit = found.baseline
    dragged = (drag_form,) if found.drag_form == "speed" else ()
    law = fit.at.span.pendulum
    everywhere = replace(
        Location.over(found.data.time_s, fit.at.sampled.amplitude),
        summary="it is fitted, throughout the record",
    )
    effects = list[FoundEffect]()
    for effect in (circular_error, *dragged):
        if not law.has(effect.form):
            continue
        (column,) = whitened(fit, found.noise, effect, [()])
        worth = float(np.sum(fit.beside(column, ()) ** 2))
        effects.append(
            FoundEffect(
                effect.identifier,
                effect.name,
                effect.kind,
                effect.equation,
                {},
                worth,
                math.erfc(math.sqrt(0.5 * worth)),
                1.0 / (1.0 + math.exp(-0.5 * min(worth + effect.prior, 1e3))),
                (),
                effect.discriminating_test,
                everywhere,
                presumed=True,
            )
        )
    return tuple(effects)


def _fitted_model(fit: Fit, found: Hypothesis, name: str) -> FittedModel:
    """Return a fit's residual and parameters.

    Residual, chi^2 and noise are those of a reading.
    """
    data = found.data
    left, by_baseline = (data.rms_left(each.at.reading) for each in (fit, found.baseline))
    return FittedModel(
        name,
        parameters_of(fit, data),
        data.rms_of_reading(left),
        data.chi2_per_dof(fit.chi2, len(fit.free)),
        # What is left holds all noise, whatever the model.
        data.rms_of_reading(scatter(min(found.noise.rms, left, by_baseline) ** 2, 1.0, data.step)),
    )


def _with_scatter(found: Hypothesis, samples: Samples) -> Hypothesis:
    """Measure the scatter of the readings that were averaged."""
    data, fit = found.data, found.fit
    if data.fold == 1:
        return found
    pieces = fit.model.follow(fit.value)
    single = replace(fit.model, fold=1, interval_s=data.interval_s / data.fold)

    def reading(time_s: FloatArray) -> FloatArray:
        return single.read(single.as_seen(sample_pieces(pieces, time_s), fit.value), fit.value)

    return replace(found, data=with_scatter(data, samples, reading))
