"""Losses of amplitudes alone: a ruler's, or the speeds at a gate, against time.

Their times are those at which somebody looked, and show no period: it is given, or there is none.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Final

import numpy as np

from pendpipe.analysis.fit.by_points import Decay, EnvelopeFit, Period, fit_envelope, numbers_of
from pendpipe.analysis.fit.fitted import PARAMETERS, Agreement, Baseline, Form, fast_beside
from pendpipe.analysis.fit.fixed import Held
from pendpipe.analysis.fit.goodness import Goodness
from pendpipe.analysis.fit.prediction import pendulum_decay
from pendpipe.analysis.fit.quality import without_swings
from pendpipe.analysis.fit.result import FitResult, result_of
from pendpipe.analysis.noise import scatter
from pendpipe.analysis.readings import sizes_of
from pendpipe.analysis.torque import TOP
from pendpipe.analysis.turning_points import TurningPoints
from pendpipe.arrays import FloatArray
from pendpipe.dynamics.eq8 import Drag, Restoring
from pendpipe.errors import NotAnalysableError, refuse_if
from pendpipe.estimate import Estimate
from pendpipe.facts import SWINGS
from pendpipe.physics.decay import amplitude_and_gradient
from pendpipe.physics.pendulum import STANDARD_GRAVITY_M_PER_S2
from pendpipe.quantities import after_number
from pendpipe.recording import Quantity, Recording

_FEWEST: Final = 5
"""Amplitudes: a, b, c and the first are four numbers."""
_FINEST: Final = 1e-6
"""Of the first amplitude: no ruler or gate is better."""
_DRAGS: Final[tuple[Drag, ...]] = ("energy", "speed")
_SLIGHT: Final = 0.05
"""Probability below which a description does not widen an interval."""
PLACES: Final = [0, 1, 2, 4]
"""Of a, b, c and the amplitude among `PARAMETERS`."""


def in_seconds(recording: Recording, period: Estimate | None, place: str | Path) -> Recording:
    """Amplitudes against time, from those against a number of swings, which last a period each.

    Raises
    ------
    InputError
        If the swings are counted, and no period is given.
    """
    unit = recording.fact("unit of time")
    if unit is None or unit.value != SWINGS:
        return recording
    refuse_if(period is None, place, f"{unit.said}, not seconds", "give --period")
    assert period is not None
    return replace(recording, time_s=period.value * recording.time_s)


def fit_amplitudes(
    recording: Recording,
    *,
    period: Estimate | None = None,
    length: Estimate | None = None,
    restoring: Restoring | None = None,
    baseline: Baseline = "eq8",
    fixed: Mapping[str, float] | None = None,
    place: str | Path = "recording",
) -> FitResult:
    """Fit a, b, c and the first amplitude to amplitudes against time.

    Eq. 14, which is first order in the amplitude, where the torque is linear. A pendulum loses in
    a swing what `pendulum_decay` says, by the division of b and the form of its drag: the numbers
    are averages over these, and their errors cover what they differ by.

    Parameters
    ----------
    recording
        Amplitudes, or turning points on both sides in turn.
    period
        Of small swings, s; without it Q and the period are NaN.
    length
        Of a simple pendulum: speeds in m/s become the angles ``2 arcsin(v/(2 omega l))``, and
        positions in m ``arcsin(x/l)``. By default g/omega^2 of what swings by sin x.
    restoring
        The torque; by default that of sin x for angles.
    baseline, fixed
        As for `fit_recording`.
    place
        Named in messages.

    Raises
    ------
    NotAnalysableError
        If there are fewer than five.
    """
    fixed = dict(fixed or {})
    if "frequency" in fixed and period is None:
        period = Estimate(1.0 / fixed["frequency"], 0.0, "s")
    turning = math.tau / period.value if period else math.nan
    arm, speed = math.nan, math.nan
    if length or (restoring == "sine" and period):
        arm = length.value if length else STANDARD_GRAVITY_M_PER_S2 / turning**2
        speed = arm * turning if period else math.sqrt(STANDARD_GRAVITY_M_PER_S2 * arm)
    points = _points_of(recording, arm, speed, place)
    first, step, unit = float(points.angle_rad[0]), points.step_rad, points.unit
    sine = restoring != "linear" and unit == "rad" and float(np.max(points.angle_rad)) < TOP
    refuse_if(
        restoring == "sine" and not sine,
        place,
        f"sin x needs angles below pi (the first is {first:.3g}{after_number(unit)})",
        "give --length with --unit cm, or --restoring linear",
        NotAnalysableError,
    )
    held = Held(fixed, baseline, 0.5 * turning / math.pi)
    freedom = max(len(points) - 4 + len(held.envelope.keys() - {"offset"}), 1)
    share = held.share(fixed.get("b", 0.0))
    shares = (0.0, 1.0) if share is None else (share,)
    decays: list[tuple[Drag, Decay]] = [("energy", amplitude_and_gradient)]
    if sine:
        decays = [(drag, partial(pendulum_decay, s, drag)) for drag in _DRAGS for s in shares]
    rough = min((fit_envelope(points, held.envelope, each) for _, each in decays), key=_misfit)
    square = float(rough.residual @ rough.residual)
    sd = scatter(square, freedom, step, _FINEST * first) * _students(freedom)
    points = replace(points, angle_sd_rad=np.full(len(points), sd))
    fits = [(drag, fit_envelope(points, held.envelope, decay)) for drag, decay in decays]
    drag, envelope = min(fits, key=lambda each: _misfit(each[1]))
    spread = turning * period.sd / period.value if period else math.nan
    times = Period(turning, points.start_s, np.diag([spread**2, 0.0]), math.nan, np.empty(0))
    value, matrix, intervals = _averaged(
        [numbers_of(points, each, times) for _, each in fits],
        np.exp(-0.5 * np.array([_misfit(each) - _misfit(envelope) for _, each in fits])),
    )
    phase = PARAMETERS.index("phase")
    value[phase] = matrix[phase] = matrix[:, phase] = math.nan
    a, b, c = value[:3].tolist()
    omega = turning if period else fast_beside(a, b, c, first)
    law = replace(held.law(omega, (a, b, c), "sine" if sine else "linear"), drag=drag)
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
        form=Form(baseline, drag_form="undecided" if sine else "energy"),
        agreement=Agreement(
            residual_rms_rad=float(np.sqrt(np.mean(envelope.residual**2))),
            samples=len(points),
            turning_points=len(points),
            settled=envelope.converged,
        ),
        method="amplitudes",
    )
    quantities: dict[str, Quantity] = {"rad": "angle_rad", "m": "displacement_m"}
    shown = Recording(
        points.time_s,
        points.angle_rad,
        quantities.get(unit, "reading"),
        metadata={"unit": unit},
        resolution=step or None,
    )
    return without_swings(replace(result, points=points, decay=shown))


def _misfit(fit: EnvelopeFit) -> float:
    return fit.quadratic.chi2


Numbers = tuple[FloatArray, FloatArray, list[tuple[float, float]]]


def _averaged(each: Sequence[Numbers], weight: FloatArray) -> Numbers:
    """Average over descriptions: the mean variance, and the spread between them."""
    weight = weight / weight.sum()
    values = np.array([value for value, *_ in each])
    value = weight @ values
    apart = (values - value)[:, PLACES]
    matrix = np.einsum("i,ijk->jk", weight, np.array([matrix for _, matrix, _ in each]))
    matrix[np.ix_(PLACES, PLACES)] += np.einsum("i,ij,ik->jk", weight, apart, apart)
    kept = [ends for (*_, ends), w in zip(each, weight, strict=True) if w > _SLIGHT]
    both = [list(zip(*one, strict=True)) for one in zip(*kept, strict=True)]
    return value, matrix, [(min(low), max(high)) for low, high in both]


def _students(freedom: int) -> float:
    """By how much wider Student's 95 % interval is than that of a known scatter."""
    from scipy.special import stdtrit

    return float(stdtrit(freedom, 0.975)) / 1.959964


def _points_of(
    recording: Recording, length: float, speed: float, place: str | Path
) -> TurningPoints:
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
    # x = l sin y, and v = 2 omega l sin(y/2).
    scale, part = {"m": (length, 1.0), "m/s": (speed, 2.0)}.get(unit, (math.nan, 1.0))
    if math.isfinite(scale):
        sizes = part * np.arcsin(np.clip(sizes / (part * scale), -1.0, 1.0))
        unit = "rad"
    else:
        scale = 1.0
    step = (recording.resolution or 0.0) / scale
    return TurningPoints(
        half_cycle=2 * np.arange(len(time)),
        time_s=time,
        time_sd_s=np.full(len(time), np.nan),
        angle_rad=sizes,
        angle_sd_rad=np.full(len(time), scatter(0.0, 1.0, step, 0.01 * float(sizes[0]))),
        level_rad=np.zeros(len(time)),
        step_rad=step,
        start_s=float(time[0]),
        stop_s=float(time[-1]),
        samples=len(time),
        unit=unit,
    )
