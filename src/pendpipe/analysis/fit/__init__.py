"""a, b, c and the rest of one recording: Eq. 14 on turning points, Eq. 8 on all readings."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Final

import numpy as np

from pendpipe.analysis.angles import arm_of, as_angles, scale_of, seen_along
from pendpipe.analysis.fit.by_points import fit_points
from pendpipe.analysis.fit.by_waveform import (
    ODDS,
    Forms,
    fitted_waveform,
    waveform_result,
)
from pendpipe.analysis.fit.decrement import Light
from pendpipe.analysis.fit.fitted import Baseline, Method, Verdict
from pendpipe.analysis.fit.fixed import check_fixed
from pendpipe.analysis.fit.printed import period_text
from pendpipe.analysis.fit.quality import without_swings
from pendpipe.analysis.fit.result import FitResult, read_fit, with_scale
from pendpipe.analysis.torque import may_be_sine, restoring_of, told_apart
from pendpipe.analysis.turning_points import TurningPoints
from pendpipe.analysis.turning_points.find import turning_points_of
from pendpipe.analysis.turning_points.measure import Samples, prepare
from pendpipe.dynamics.eq8 import OMEGA, Restoring
from pendpipe.errors import NotAnalysableError, refuse_if
from pendpipe.estimate import Estimate
from pendpipe.levels import REFUTED
from pendpipe.quantities import after_number, pretty_unit, with_error
from pendpipe.recording import Recording

__all__ = ["FitResult", "fit_recording", "read_fit"]

_STEP: Final = 1.25
"""By which the least amplitude grows, where the smaller ones contradict every law tried."""
_SURE: Final = 1e9
"""Logarithm of a likelihood ratio beyond which it has no meaning."""
_FARTHEST: Final = 2.0
"""Standard deviations by which the readings may move an arm."""
_MISSED: Final = 0.3
"""Of the first amplitude: a misfit beyond is that of another motion."""
_LEAST: Final = 0.6
"""Of the first amplitude: so much of the decay is kept at least."""
_CERTAIN: Final = 50.0
"""Half of chi^2 between sin x and x from which the other torque need not be fitted."""
_FEWEST: Final = 15
"""Turning points of such a part."""


def fit_recording(
    recording: Recording,
    *,
    method: Method | None = None,
    restoring: Restoring | None = None,
    baseline: Baseline = "eq8",
    fixed: Mapping[str, float] | None = None,
    points: TurningPoints | None = None,
    length: Estimate | None = None,
    place: str | Path = "recording",
) -> FitResult:
    """Fit a, b, c, frequency, amplitude, phase and offset of one free decay.

    Parameters
    ----------
    recording
        Angles, displacements, or volts with a known constant; a free decay, cut already.
    method
        ``"waveform"`` (Eq. 8 on all readings) or ``"turning-points"`` (Eq. 14). By default the
        waveform, and the turning points where the waveform's law contradicts the decay.
    restoring
        The restoring torque, ``"linear"`` or ``"sine"``. By default angles and their rates swing
        by sin x, unless x alone fits better by a likelihood ratio of 1000; displacements by x.
    baseline
        ``"eq8"``, or ``"viscous"`` for Eq. 3.
    fixed
        Parameters that are held, by name (see `fixed.NAMES`).
    points
        Turning points found before; they are found here when they are not given.
    length
        Length of the pendulum whose displacement is read, L sin x; by default that of `arm_of`,
        which is then among the warnings. Its error enters as that of a scale.
    place
        Named in messages.

    Returns
    -------
    FitResult
        Without ``provenance``, and with such ``cuts`` only as the fit makes itself: where the
        law fails at small amplitude, the larger ones are fitted alone. Its ``light`` is red where
        nothing that was tried loses what the decay loses.

    Raises
    ------
    InputError
        If a parameter can't be held, the recording can't be analysed (see `find_turning_points`),
        or the search did not come to its end.
    """
    check_fixed(fixed or {}, baseline)
    readings = points.readings if points is not None else None
    samples = prepare(recording, place) if readings is None else readings
    points = turning_points_of(samples, place) if points is None else points
    position = restoring == "sine" and samples.unit == "m"
    arm = fitted_arm(samples, points, length, scale_of(recording)) if position else None
    points, _ = as_angles(points, arm, position=position)
    if arm and not length:
        size = with_error(arm.value, arm.sd, "m", short=True)
        said = f"read as L sin x: L = {size}, g/ω² and what the period shows (--length)"
        points = replace(points, notes=(*points.notes, said))
    length_m, stated = arm.value if arm else None, recording.unit_is_stated
    result = _fit(samples, method, restoring, baseline, fixed, points, length_m, place, stated)
    result = replace(result, points=replace(points, readings=None))
    if arm and arm.sd:
        result = with_scale(result, 100.0 * arm.sd / arm.value)
    if points.beats:
        # What its turning points lose is no mode's loss, and their period none's.
        why = f"two modes beat: {points.beats}; Eq. 8 has one"
        form, beat = replace(result.form, other_frequency=None), Verdict("red", why, "beat")
        agreement = replace(result.agreement, decrement_check=())
        return replace(result, form=form, agreement=agreement, verdict=beat, shown=None)
    by_points = result.method == "turning-points"
    swing = result["amplitude"].value if by_points else 0.5 * float(np.ptp(samples.values))
    missed = result.residual_rms_rad / abs(swing)
    lost = (result.fit_p_value or 0.0) < REFUTED and missed > _MISSED and result.light != "red"
    refuse_if(
        lost,
        place,
        f"no law describes it: the best fit misses the swings by {100.0 * missed:.0f} %",
        "cut bursts and jumps out with --start and --stop, or see pendpipe diagnose",
        NotAnalysableError,
    )
    if points.mostly_cut:
        light: Light = "red" if result.light == "red" else "amber"
        why = f"most of it was cut: {points.mostly_cut}"
        return replace(result, verdict=Verdict(light, why, "cut"))
    refuse_if(
        not result.agreement.settled,
        place,
        f"the {result.method.replace('-', ' ')} fit did not converge",
        "cut the recording with --start and --stop, or see pendpipe diagnose",
        NotAnalysableError,
    )
    return without_swings(result)


def fitted_arm(
    samples: Samples, points: TurningPoints, length: Estimate | None, scale: float
) -> Estimate:
    """Fit the arm L of a position L sin x to the readings, about what is known of it.

    Parameters
    ----------
    samples, points
        In metres.
    length
        Of the pendulum; by default that of `arm_of`.
    scale
        Relative error of the metre, which is one of L.
    """
    arm = length or arm_of(points)
    sd = math.hypot(arm.sd / arm.value, scale)
    if not sd:
        return arm
    at = arm.value * np.array([1.0, 1.0 + sd, 1.0 - sd])
    middle, *sides = (
        fitted_waveform(samples, seen_along(points, each), restoring="sine", length_m=each)
        for each in at.tolist()
    )
    if middle is None or None in sides:
        return replace(arm, sd=sd * arm.value)
    # The logarithm of the likelihood is a parabola, and so is that of what was known.
    long, short = (middle.fitted.better_by(each.fitted) for each in sides if each)
    curvature = max(long + short, 0.0) + 1.0
    step = min(max(0.5 * (short - long) / curvature, -_FARTHEST), _FARTHEST)
    moved, sd = 1.0 + step * sd, sd / math.sqrt(curvature)
    return replace(arm, value=moved * arm.value, sd=sd * arm.value)


def fit_turning_points(
    points: TurningPoints,
    *,
    length: Estimate | None = None,
    restoring: Restoring | None = None,
    baseline: Baseline = "eq8",
    fixed: Mapping[str, float] | None = None,
) -> FitResult:
    """Fit Eq. 14 to turning points whose readings are not there; see `fit_recording`."""
    position = restoring == "sine" and points.unit == "m"
    points, _ = as_angles(points, length, position=position)
    _check_torque(restoring, points, "turning points")
    torque = restoring or restoring_of(points)
    found = fit_points(points, baseline=baseline, fixed=fixed, restoring=torque)
    return replace(found, points=points, cuts=tuple(cut._asdict() for cut in points.cuts))


def _check_torque(restoring: Restoring | None, points: TurningPoints, place: str | Path) -> None:
    """Refuse sin x where too few turning points lie below its top."""
    refuse_if(
        restoring == "sine" and not may_be_sine(points),
        place,
        "sin x needs three turning points below pi rad (the largest is"
        f" {np.max(points.amplitude_rad):.3g}{after_number(points.unit)})",
        "use --restoring linear",
        NotAnalysableError,
    )


def _fit(
    samples: Samples,
    method: Method | None,
    restoring: Restoring | None,
    baseline: Baseline,
    fixed: Mapping[str, float] | None,
    points: TurningPoints,
    length_m: float | None,
    place: str | Path,
    stated: bool,
) -> FitResult:
    _check_torque(restoring, points, place)
    if method == "turning-points":
        torque = restoring or restoring_of(points, stated=stated)
        return fit_points(points, baseline=baseline, fixed=fixed, restoring=torque)
    result = _waveform(samples, points, baseline, fixed, restoring, length_m, stated=stated)
    restoring = result.restoring
    if method == "waveform" or _stands(result):
        return result
    again = partial(
        fit_points, baseline=baseline, fixed=fixed, restoring=restoring, bent=result.agreement.bent
    )
    by_points = again(points)
    if _stands(by_points):
        # What all readings deny is not quoted.
        kept = tuple(name for name in by_points.quotable if name in ("period", "Q"))
        why = result.light_reason if result.agreement.settled else "the fit did not converge"
        reason = (
            f"don't quote a, b, c: with all readings {why}; period and Q are the turning points'"
        )
        return replace(by_points, verdict=Verdict("amber", reason, quotable=kept))
    for part in _larger_amplitudes(points):
        larger = _waveform(samples, part, baseline, fixed, restoring, length_m, stated=stated)
        if not _stands(larger):
            larger = again(part)
        if _stands(larger):
            return _of_larger(larger, points, part)
    settled = [each for each in (result, by_points) if each.agreement.settled]
    # The largest relative contradiction between the law's loss and the decay's is the least.
    return min(
        settled,
        key=lambda one: max((abs(each.excess) for each in one.decrement_check), default=math.inf),
        default=by_points,
    )


def _waveform(
    samples: Samples,
    points: TurningPoints,
    baseline: Baseline,
    fixed: Mapping[str, float] | None,
    restoring: Restoring | None,
    length_m: float | None,
    *,
    stated: bool,
) -> FitResult:
    """Fit all readings, with the torque that is given, presumed, or that they ask for."""
    fitted = partial(
        fitted_waveform, samples, points, baseline=baseline, fixed=fixed, length_m=length_m
    )

    def result(forms: Forms | None, torque: Restoring) -> FitResult:
        if forms is not None:
            return waveform_result(forms, samples, points, baseline, fixed or {})
        # No motion of the law comes near the readings.
        lost = fit_points(points, baseline=baseline, fixed=fixed, restoring=torque)
        return replace(lost, method="waveform", agreement=replace(lost.agreement, settled=False))

    if restoring is None and not (stated and may_be_sine(points)):
        restoring = restoring_of(points, stated=stated)
    if restoring is not None:
        return result(fitted(restoring=restoring), restoring)
    first = restoring_of(points)
    second: Restoring = "linear" if first == "sine" else "sine"
    forms, others, odds = fitted(restoring=first), None, 0.0
    if forms is None:
        return result(fitted(restoring=second), second)
    own = forms.fitted
    if own.minimum.converged and forms.goodness.misfit == 1.0:
        # What fits to the noise tells by itself how far off the other is.
        odds = 0.5 * told_apart(points, len(samples), forms.goodness.noise_rms)
    if odds < _CERTAIN:
        others = fitted(restoring=second)
        odds = min(max(own.better_by(others.fitted), -_SURE), _SURE) if others else _SURE
    other = others.fitted if others else None
    pendulum, spring = (own, other) if first == "sine" else (other, own)
    for_spring = odds if first == "linear" else -odds
    no_pendulum = pendulum is not None and not pendulum.minimum.converged
    is_spring = for_spring > ODDS or no_pendulum
    if spring is not None and spring.minimum.converged and is_spring:
        found = result(forms if own is spring else others, "linear")
        return replace(found, form=replace(found.form, torque_odds=for_spring))
    found = result(forms if own is pendulum else others, "sine")
    found = replace(found, form=replace(found.form, torque_odds=-for_spring))
    if spring is None or for_spring < -ODDS or not spring.minimum.converged:
        return found
    return _with_other_frequency(found, float(spring.value[OMEGA]) / math.tau)


def _with_other_frequency(found: FitResult, as_spring: float) -> FitResult:
    """Give that of a spring beside the pendulum's, where they differ by more than the error."""
    own = found["frequency"]
    if abs(as_spring - own.value) <= own.sd:
        return found
    other = Estimate(as_spring, own.sd * as_spring / own.value, own.unit)
    said = (
        f"as a pendulum {period_text(own)}; as a spring or torsion wheel {period_text(other)}:"
        " --restoring linear"
    )
    form = replace(found.form, other_frequency=other)
    return replace(found, form=form, warnings=(*found.warnings, said))


def _stands(result: FitResult) -> bool:
    """Whether it settled, and does not contradict the decay."""
    return result.agreement.settled and result.light != "red"


def _larger_amplitudes(points: TurningPoints) -> Iterator[TurningPoints]:
    """Fewer and fewer of the turning points: at small amplitude bearings have other laws."""
    amplitude = points.amplitude_rad
    # Noise may have made the last ones negative.
    least = max(float(np.median(amplitude[-5:])), 1e-4 * float(amplitude[0]))
    while (least := _STEP * least) < _LEAST * float(amplitude[0]):
        part = points.first(int(np.flatnonzero(amplitude >= least)[-1]) + 1)
        if len(part) >= _FEWEST:
            yield part


def _of_larger(result: FitResult, points: TurningPoints, part: TurningPoints) -> FitResult:
    least = float(part.amplitude_rad[-1])
    size = f"{least:.2g} {pretty_unit(points.unit)}".rstrip()
    below = f"below {size} the decay does not follow the fitted law"
    cut = {"start_s": float(part.time_s[-1]), "stop_s": points.stop_s, "reason": below}
    why = f"don't quote anything below {size}: there the decay does not follow the fitted law"
    verdict = replace(result.verdict, light="amber", light_reason=why)
    return replace(result, verdict=verdict, cuts=(*result.cuts, cut))
