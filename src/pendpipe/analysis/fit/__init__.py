"""a, b, c and the rest of one recording: Eq. 14 on turning points, Eq. 8 on all readings."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Final

import numpy as np

from pendpipe.analysis.fit.by_points import (
    SEEN,
    check_fixed,
    fit_points,
    may_be_sine,
    restoring_of,
    sine_coefficient,
)
from pendpipe.analysis.fit.by_waveform import fit_waveform
from pendpipe.analysis.fit.result import Baseline, FitResult, Method, Restoring, read_fit
from pendpipe.analysis.turning_points import BEAT, TurningPoints
from pendpipe.analysis.turning_points.find import turning_points_of
from pendpipe.analysis.turning_points.measure import prepare
from pendpipe.errors import NotAnalysableError, refuse_if
from pendpipe.quantities import after_number, pretty_unit
from pendpipe.recording import Recording

__all__ = ["FitResult", "fit_recording", "read_fit"]

_STEP: Final = 1.25
"""By which the least amplitude grows, where the smaller ones contradict every law tried."""
_LEAST: Final = 0.6
"""Of the first amplitude: so much of the decay is kept at least."""
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
        The restoring torque, ``"linear"`` or ``"sine"``. By default sin x where the turning
        points of a recording in radians favour it (`by_points.restoring_of`).
    baseline
        ``"eq8"``, or ``"viscous"`` for Eq. 3.
    fixed
        Parameters that are held, by name (see `by_points.NAMES`).
    points
        Turning points found before; they are found here when they are not given.
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
    refuse_if(
        restoring == "sine" and recording.quantity == "displacement_m",
        place,
        "a displacement in metres has no sine",
        "leave --restoring out, or give --unit",
    )
    result = _fit(recording, method, restoring, baseline, fixed, points, place)
    beats = [note for note in points.notes if note.startswith(BEAT)] if points else []
    if beats:
        # What its turning points lose is no mode's loss.
        why = f"{beats[0]}; Eq. 8 has one"
        return replace(result, light="red", light_reason=why, decrement_check=())
    if result.settled:
        return result
    raise NotAnalysableError(
        place,
        f"the {result.method.replace('-', ' ')} fit did not settle",
        "cut the recording with --start and --stop, or see pendpipe diagnose",
    )


def _fit(
    recording: Recording,
    method: Method | None,
    restoring: Restoring | None,
    baseline: Baseline,
    fixed: Mapping[str, float] | None,
    points: TurningPoints | None,
    place: str | Path,
) -> FitResult:
    samples = prepare(recording, place)
    if points is None:
        points = turning_points_of(samples, place)
    presumed = False
    if restoring is None:
        coefficient = sine_coefficient(points)
        restoring = restoring_of(points, coefficient, stated=recording.unit_is_stated)
        presumed = restoring == "sine" and not coefficient.agrees
    elif restoring == "sine" and not may_be_sine(points):
        largest = float(np.max(points.amplitude_rad))
        raise NotAnalysableError(
            place,
            f"sin x needs six turning points below pi rad (the largest is"
            f" {largest:.3g}{after_number(points.unit)})",
            "use --restoring linear",
        )
    if method == "turning-points":
        return fit_points(points, baseline=baseline, fixed=fixed, restoring=restoring)
    result = fit_waveform(samples, points, baseline=baseline, fixed=fixed, restoring=restoring)
    if presumed:
        linear = fit_waveform(samples, points, baseline=baseline, fixed=fixed, restoring="linear")
        # All readings may exclude the sin x that few or noisy half cycles do not.
        more = result.samples * (result.chi2_per_dof - linear.chi2_per_dof)
        if _stands(linear) and more > SEEN**2 * max(linear.chi2_per_dof, 1.0):
            result, restoring = linear, "linear"
    if method == "waveform" or _stands(result):
        return result
    by_points = fit_points(points, baseline=baseline, fixed=fixed, restoring=restoring)
    if _stands(by_points):
        why = result.light_reason if result.settled else "it did not settle"
        return _amber(by_points, f"from the turning points, because for the waveform {why}")
    for part in _larger_amplitudes(points):
        larger = fit_waveform(samples, part, baseline=baseline, fixed=fixed, restoring=restoring)
        if not _stands(larger):
            larger = fit_points(part, baseline=baseline, fixed=fixed, restoring=restoring)
        if _stands(larger):
            return _of_larger(larger, points, part)
    settled = [each for each in (result, by_points) if each.settled]
    return min(settled, key=_worst, default=by_points)


def _worst(result: FitResult) -> float:
    """The largest relative contradiction between the law's loss and the decay's."""
    return max((abs(check.excess) for check in result.decrement_check), default=math.inf)


def _stands(result: FitResult) -> bool:
    """Whether it settled, and does not contradict the decay."""
    return result.settled and result.light != "red"


def _amber(result: FitResult, reason: str) -> FitResult:
    return replace(result, light="amber", light_reason=reason)


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
    below = f"below {size} the decay is not that of the fitted law"
    cut = {"start_s": float(part.time_s[-1]), "stop_s": points.stop_s, "reason": below}
    return replace(_amber(result, f"{below}: that is left out"), cuts=(*result.cuts, cut))
