"""Fit one recording, by either method."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from pendpipe.analysis.fit.by_points import fit_points
from pendpipe.analysis.fit.fixed import check_fixed
from pendpipe.analysis.fit.result import Baseline, FitResult, Method
from pendpipe.analysis.turning_points import TurningPoints
from pendpipe.errors import NotAnalysableError
from pendpipe.recording import Recording


def fit_recording(
    recording: Recording,
    *,
    method: Method | None = None,
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
    baseline
        ``"eq8"``, or ``"viscous"`` for Eq. 3.
    fixed
        Parameters that are held, by name (see `fixed.NAMES`).
    points
        Turning points found before; they are found here when they are not given.
    place
        Named in messages.

    Returns
    -------
    FitResult
        Without ``cuts`` and ``provenance``. Its ``light`` is red where nothing that was tried
        loses what the decay loses.

    Raises
    ------
    InputError
        If a parameter can't be held, the recording can't be analysed (see `find_turning_points`),
        or the search did not come to its end.
    """
    check_fixed(fixed or {}, baseline)
    result = _fit(recording, method, baseline, fixed, points, place)
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
    baseline: Baseline,
    fixed: Mapping[str, float] | None,
    points: TurningPoints | None,
    place: str | Path,
) -> FitResult:
    if method == "turning-points":
        if points is None:
            from pendpipe.analysis.turning_points import find_turning_points

            points = find_turning_points(recording, place)
        return fit_points(points, baseline=baseline, fixed=fixed)
    from pendpipe.analysis.fit.by_waveform import fit_plain_waveform, fit_waveform
    from pendpipe.analysis.turning_points.samples import prepare

    samples = prepare(recording, place)
    if points is None:
        plain = fit_plain_waveform(samples) if baseline == "eq8" and not fixed else None
        if plain is not None and plain.light != "red":
            return plain
        from pendpipe.analysis.turning_points.find import turning_points_of

        points = turning_points_of(samples, place)
    result = fit_waveform(samples, points, baseline=baseline, fixed=fixed)
    if method is None and (result.light == "red" or not result.settled):
        return _from_turning_points(result, points, baseline, fixed)
    return result


def _from_turning_points(
    waveform: FitResult,
    points: TurningPoints,
    baseline: Baseline,
    fixed: Mapping[str, float] | None,
) -> FitResult:
    """Fit the turning points, where the waveform's law contradicts the decay.

    It stands if it is not contradicted itself: else the waveform's is shown.
    """
    result = fit_points(points, baseline=baseline, fixed=fixed)
    if not result.settled or (result.light == "red" and waveform.settled):
        return waveform
    why = waveform.light_reason if waveform.settled else "it did not settle"
    if result.light == "red":
        return result
    return replace(
        result,
        light="amber",
        light_reason="from the turning points, since the waveform can't be fitted: " + why,
    )
