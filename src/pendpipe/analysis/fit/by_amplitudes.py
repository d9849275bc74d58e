"""Eq. 14 on amplitudes alone: a ruler's, or the speeds at a gate, against time.

Their times are those at which somebody looked, and show no period: it is given, or there is none.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np

from pendpipe.analysis.fit.by_points import (
    GRAVITY,
    fit_envelope,
    numbers_of,
)
from pendpipe.analysis.fit.fixed import Held
from pendpipe.analysis.fit.goodness import Goodness
from pendpipe.analysis.fit.period import Period
from pendpipe.analysis.fit.result import PARAMETERS, fast_beside, result_of
from pendpipe.analysis.turning_points import TurningPoints
from pendpipe.arrays import FloatArray
from pendpipe.dynamics import Eq8
from pendpipe.errors import NotAnalysableError, refuse_if
from pendpipe.estimate import Estimate
from pendpipe.recording import Quantity, Recording, sizes_of

if TYPE_CHECKING:
    from pendpipe.analysis.fit.result import Baseline, FitResult

_FEWEST: Final = 5
"""Amplitudes: a, b, c and the first are four numbers."""
_FINEST: Final = 1e-6
"""Of the first amplitude: no ruler or gate is better."""


def fit_amplitudes(
    recording: Recording,
    *,
    period: Estimate | None = None,
    length_m: float | None = None,
    baseline: Baseline = "eq8",
    fixed: Mapping[str, float] | None = None,
    place: str | Path = "recording",
) -> FitResult:
    """Fit a, b, c and the first amplitude of Eq. 14 to amplitudes against time.

    Parameters
    ----------
    recording
        Amplitudes, or turning points on both sides in turn.
    period
        Of small swings, s; without it Q and the period are NaN.
    length_m
        Of a simple pendulum: speeds in m/s become the angles ``2 arcsin(v/(2 sqrt(g l)))``, and
        positions in m ``arcsin(x/l)``.
    baseline, fixed
        As for `fit_recording`.
    place
        Named in messages.

    Raises
    ------
    NotAnalysableError
        If there are fewer than five.
    """
    usable = recording.usable
    time, sizes = recording.time_s[usable], sizes_of(recording.values[usable])
    refuse_if(
        len(time) < _FEWEST,
        place,
        f"{len(time)} amplitudes tell no a, b and c",
        f"give {_FEWEST} or more",
        NotAnalysableError,
    )
    sizes, unit, step = _angles(sizes, recording.unit, recording.resolution or 0.0, length_m)
    first = float(sizes[0])

    def points_of(sd: float) -> TurningPoints:
        return TurningPoints(
            half_cycle=2 * np.arange(len(time)),
            time_s=time,
            time_sd_s=np.full(len(time), np.nan),
            angle_rad=sizes,
            angle_sd_rad=np.full(len(time), sd),
            level_rad=np.zeros(len(time)),
            step_rad=step,
            start_s=float(time[0]),
            stop_s=float(time[-1]),
            samples=len(time),
            unit=unit,
        )

    fixed = dict(fixed or {})
    if "frequency" in fixed and period is None:
        period = Estimate(1.0 / fixed["frequency"], 0.0, "s")
    turning = math.tau / period.value if period else math.nan
    held = Held(fixed, baseline, 0.5 * turning / math.pi)
    free = 4 - len([name for name in held.envelope if name != "offset"])
    freedom = max(len(time) - free, 1)
    least = max(step / math.sqrt(12.0), _FINEST * first)
    rough = fit_envelope(points_of(max(least, 0.01 * first)), held.envelope)
    scatter = math.sqrt(float(rough.residual @ rough.residual) / freedom)
    points = points_of(max(scatter, least) * _students(freedom))
    envelope = fit_envelope(points, held.envelope)
    a, b, c = (float(rate) for rate in envelope.value[:3])
    share = held.share(b)
    hysteretic = (0.5 if share is None else share) * b
    spread = turning * period.sd / period.value if period else math.nan
    times = Period(turning, float(time[0]), np.diag([spread**2, 0.0]), math.nan, np.empty(0))
    value, matrix, intervals = numbers_of(points, envelope, times, 1.0)
    phase = PARAMETERS.index("phase")
    value[phase] = matrix[phase] = matrix[:, phase] = math.nan
    law = Eq8(turning if period else fast_beside(a, b, c, first), a, hysteretic, b - hysteretic, c)
    null = "phase and noise_rms_rad" if period else "frequency, phase and noise_rms_rad"
    said = [
        f"{null} have no finite value: amplitudes show none",
        *(["the speeds stay in m/s: --length makes them angles"] if unit == "m/s" else []),
    ]
    result = result_of(
        value,
        matrix,
        intervals,
        envelope.held,
        points,
        law,
        goodness=Goodness(math.nan, math.nan, (), 1.0),
        said=said,
        fixed=fixed,
        method="amplitudes",
        baseline=baseline,
        residual_rms_rad=float(np.sqrt(np.mean(envelope.residual**2))),
        samples=len(time),
        turning_points=len(time),
        settled=envelope.converged,
    )
    quantities: dict[str, Quantity] = {"rad": "angle_rad", "m": "displacement_m"}
    shown = Recording(
        time,
        sizes,
        quantities.get(unit, "reading"),
        metadata={"unit": unit},
        resolution=step or None,
    )
    return replace(result, points=points, decay=shown)


def _students(freedom: int) -> float:
    """By how much wider Student's 95 % interval is than that of a known scatter."""
    from scipy.special import stdtrit

    return float(stdtrit(freedom, 0.975)) / 1.959964


def _angles(
    values: FloatArray, unit: str, step: float, length_m: float | None
) -> tuple[FloatArray, str, float]:
    """Amplitudes as angles where a length makes them so; their unit and step."""
    if length_m is None or unit not in ("m", "m/s"):
        return values, unit, step
    if unit == "m":
        scale = length_m
        angle = np.arcsin(np.clip(values / scale, -1.0, 1.0))
    else:
        scale = math.sqrt(GRAVITY * length_m)
        angle = 2.0 * np.arcsin(np.clip(0.5 * values / scale, -1.0, 1.0))
    return np.asarray(angle), "rad", step / scale
