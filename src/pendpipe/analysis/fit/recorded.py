"""Fit one recording, by either method."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from pendpipe.analysis.fit.by_points import fit_points
from pendpipe.analysis.fit.fixed import check_fixed
from pendpipe.analysis.fit.result import Baseline, FitResult, Method
from pendpipe.analysis.turning_points import TurningPoints
from pendpipe.recording import Recording


def fit_recording(
    recording: Recording,
    *,
    method: Method = "waveform",
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
        ``"waveform"`` (Eq. 8 on all readings) or ``"turning-points"`` (Eq. 14).
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
        Without ``cuts`` and ``provenance``.

    Raises
    ------
    InputError
        If a parameter can't be held, or the recording can't be analysed; see `find_turning_points`.
    """
    check_fixed(fixed or {}, baseline)
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
        if plain is not None:
            return plain
        from pendpipe.analysis.turning_points.find import turning_points_of

        points = turning_points_of(samples, place)
    return fit_waveform(samples, points, baseline=baseline, fixed=fixed)
