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
    fit_envelope,
    numbers_of,
)
from pendpipe.analysis.fit.damping import fast_beside
from pendpipe.analysis.fit.fixed import Held
from pendpipe.analysis.fit.goodness import Goodness
from pendpipe.analysis.fit.period import Period
from pendpipe.analysis.fit.result import PARAMETERS, result_of
from pendpipe.analysis.noise import quantisation_rms
from pendpipe.analysis.turning_points import TurningPoints
from pendpipe.errors import NotAnalysableError, refuse_if
from pendpipe.estimate import Estimate
from pendpipe.physics.pendulum import STANDARD_GRAVITY_M_PER_S2
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
    points = _points_of(recording, length_m, place)
    first, step, unit = float(points.angle_rad[0]), points.step_rad, points.unit
    fixed = dict(fixed or {})
    if "frequency" in fixed and period is None:
        period = Estimate(1.0 / fixed["frequency"], 0.0, "s")
    turning = math.tau / period.value if period else math.nan
    held = Held(fixed, baseline, 0.5 * turning / math.pi)
    freedom = max(len(points) - 4 + len(held.envelope.keys() - {"offset"}), 1)
    rough = fit_envelope(points, held.envelope).residual
    scatter = max(math.sqrt(float(rough @ rough) / freedom), quantisation_rms(step))
    sd = max(scatter, _FINEST * first) * _students(freedom)
    points = replace(points, angle_sd_rad=np.full(len(points), sd))
    envelope = fit_envelope(points, held.envelope)
    a, b, c = envelope.value[:3].tolist()
    spread = turning * period.sd / period.value if period else math.nan
    times = Period(turning, points.start_s, np.diag([spread**2, 0.0]), math.nan, np.empty(0))
    value, matrix, intervals = numbers_of(points, envelope, times, 1.0)
    phase = PARAMETERS.index("phase")
    value[phase] = matrix[phase] = matrix[:, phase] = math.nan
    law = held.law(turning if period else fast_beside(a, b, c, first), (a, b, c))
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
        samples=len(points),
        turning_points=len(points),
        settled=envelope.converged,
    )
    quantities: dict[str, Quantity] = {"rad": "angle_rad", "m": "displacement_m"}
    shown = Recording(
        points.time_s,
        points.angle_rad,
        quantities.get(unit, "reading"),
        metadata={"unit": unit},
        resolution=step or None,
    )
    return replace(result, points=points, decay=shown)


def _students(freedom: int) -> float:
    """By how much wider Student's 95 % interval is than that of a known scatter."""
    from scipy.special import stdtrit

    return float(stdtrit(freedom, 0.975)) / 1.959964


def _points_of(recording: Recording, length_m: float | None, place: str | Path) -> TurningPoints:
    """The amplitudes, as angles where a length makes them so, each known to a hundredth or so."""
    time = recording.time_s[recording.usable]
    sizes, unit = sizes_of(recording.values[recording.usable]), recording.unit
    refuse_if(
        len(time) < _FEWEST,
        place,
        f"{len(time)} amplitudes are too few for a, b and c",
        f"give {_FEWEST} or more",
        NotAnalysableError,
    )
    scale = 1.0
    if length_m is not None and unit in ("m", "m/s"):
        # x = l sin y, and v = 2 sqrt(g l) sin(y/2).
        scale, part = (
            (length_m, 1.0)
            if unit == "m"
            else (math.sqrt(STANDARD_GRAVITY_M_PER_S2 * length_m), 2.0)
        )
        sizes = part * np.arcsin(np.clip(sizes / (part * scale), -1.0, 1.0))
        unit = "rad"
    step = (recording.resolution or 0.0) / scale
    return TurningPoints(
        half_cycle=2 * np.arange(len(time)),
        time_s=time,
        time_sd_s=np.full(len(time), np.nan),
        angle_rad=sizes,
        angle_sd_rad=np.full(len(time), max(quantisation_rms(step), 0.01 * float(sizes[0]))),
        level_rad=np.zeros(len(time)),
        step_rad=step,
        start_s=float(time[0]),
        stop_s=float(time[-1]),
        samples=len(time),
        unit=unit,
    )
