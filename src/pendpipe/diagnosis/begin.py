"""From a recording to the readings and the start values of the baseline."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from pendpipe.analysis.fit.by_points import held_values, start_of
from pendpipe.analysis.fit.by_waveform import start_values, usable_span
from pendpipe.analysis.fit.period import swing_phase
from pendpipe.analysis.fit.result import Baseline
from pendpipe.analysis.turning_points import BEAT, TurningPoints
from pendpipe.analysis.turning_points.measure import Samples
from pendpipe.analysis.two_modes import two_modes
from pendpipe.arrays import FloatArray
from pendpipe.diagnosis.data import Data, gather
from pendpipe.diagnosis.unwrapped import anchored
from pendpipe.dynamics.any_law import NoMotionError
from pendpipe.effects import Effect
from pendpipe.effects.baseline import OFFSET, OMEGA, SHARE, START, TIME, A, B, C, with_parts
from pendpipe.effects.catalogue.in_time import BEATING_MODE
from pendpipe.effects.catalogue.restoring import CIRCULAR_ERROR_IN, circular_error
from pendpipe.effects.model import Evaluated, Model
from pendpipe.physics.decay import time_at

LARGE_PHASE_ERROR: Final = 0.1
"""Phase error in rad from which a model has lost the motion."""
SINE: Final = "circular-error"
"""The effect that turns x into sin x."""
_FEWEST_READINGS: Final = 24
_ROUNDS: Final = 4
"""In which the frequency of small swings and their angles settle."""
_DEAD_BANDS: Final = 10.0
"""Distance from the end in half widths of the Coulomb dead band: nearer to it the rest position
jumps with the parameters."""


@dataclass(frozen=True)
class Beginning:
    """Readings, baseline and start values of a diagnosis.

    Parameters
    ----------
    data
        The readings of the free decay, without those near its end at rest.
    model
        The baseline.
    value
        Its start values.
    held
        Indices of values that are not fitted.
    noise_rms
        First estimate of one reading's noise.
    points
        The turning points.
    known
        An effect that the half swings ask for, sin x or a second mode, with start values of the
        model with it.
    """

    data: Data
    model: Model
    value: FloatArray
    held: tuple[int, ...]
    noise_rms: float
    points: TurningPoints
    known: tuple[Effect, FloatArray] | None = None


def begin(
    samples: Samples,
    points: TurningPoints,
    *,
    baseline: Baseline,
    fixed: Mapping[str, float],
    stated: bool = True,
    linear: bool = False,
) -> Beginning:
    """Choose the readings that are compared, and the start values of the search.

    `stated` is whether it is known that the readings are angles; `linear`, that there is no sin x.
    """
    held_rates, parts = held_values(fixed, baseline, points.apparent_frequency_hz)
    start = start_values(points, held_rates, fixed, baseline)
    span = usable_span(samples, points, start)
    value = start.value.copy()
    if "offset" in fixed:
        value[OFFSET] = fixed["offset"]
    sine = known = None
    if not fixed and any(note.startswith(BEAT) for note in points.notes):
        # The turning points of a beat tell nothing of either mode.
        span = slice(None)
        value, second = _modes_start(samples, value)
        known = BEATING_MODE, np.append(value, second)
    elif not (fixed or linear) and samples.unit in ("rad", "rad/s"):
        laws = start_of(points if samples.unit == "rad" else _of_the_angle(points), stated=stated)
        asked = laws.coefficient.agrees or laws.linear.slip_rad > LARGE_PHASE_ERROR
        if laws.sine and laws.favoured == "sine" and asked:
            # Both laws begin at the first turning point, so that they count the same half cycles.
            value, sine = laws.linear.value, laws.sine.value
            if samples.unit == "rad/s":
                value, sine = (_of_the_rate(each) for each in (value, sine))
            value[TIME] = sine[TIME]
            if baseline == "viscous":
                value[[A, C]] = sine[[A, C]] = 0.0
            first = int(np.searchsorted(samples.time_s, laws.sine.time_s))
            span = slice(max(first, span.start), span.stop)
    omega, angle = float(value[OMEGA]), float(value[START])
    data = gather(
        samples.time_s[span],
        samples.values[span],
        step=samples.step,
        unit=samples.unit,
        counts=samples.counts,
        period_s=2.0 * math.pi / omega,
        noise_rms=points.noise_rms_rad,
    )
    value = with_parts(value, parts)
    data = _far_from_the_stop(data, value)
    model = Model(
        data.time_s,
        data.interval_s,
        order=order_for(abs(angle) / (omega if samples.unit == "rad/s" else 1.0), samples.unit),
        fold=data.fold,
        first_s=float(data.time_s[0]),
        parts=parts,
        scale=1.0 if samples.unit in ("rad", "rad/s") else abs(angle),
    )
    data, model, at = _before_the_stop(data, model, value)
    if sine is not None:
        known = CIRCULAR_ERROR_IN.get(samples.unit, circular_error), np.append(sine, 1.0)
        data, _, at = _before_the_stop(data, model.adding(known[0]), known[1])
        model = model.at_times(data.time_s)
    if sine is not None or known is None:
        data = replace(data, anchor=anchored(data, at))
    held = _held(held_rates, fixed, parts, baseline)
    return Beginning(data, model, value, held, data.noise_rms, points, known)


def _of_the_angle(points: TurningPoints) -> TurningPoints:
    """Turning points of the angle from those of its rate: the largest is 2 omega sin(A/2)."""
    rate, half = points.angle_rad, np.diff(points.half_cycle)
    paces = np.diff(points.time_s) / half
    omega = math.pi / float(np.median(paces))
    for _ in range(_ROUNDS):
        angle = 2.0 * np.arcsin(np.clip(0.5 * rate / omega, -1.0, 1.0))
        omega = float(np.median(swing_phase(np.abs(angle), "sine") / paces))
    slope = 1.0 / (omega * np.cos(0.5 * angle))
    return replace(
        points,
        angle_rad=angle,
        angle_sd_rad=points.angle_sd_rad * slope,
        level_rad=points.level_rad / omega,
        noise_rms_rad=points.noise_rms_rad / omega,
        step_rad=points.step_rad / omega,
        unit="rad",
    )


def _of_the_rate(value: FloatArray) -> FloatArray:
    """Values of Eq. 8 for the angle's rate u from those for the angle."""
    omega, found = value[OMEGA], value.copy()
    found[A], found[C], found[OFFSET] = value[A] / omega, value[C] * omega, value[OFFSET] * omega
    found[START] = 2.0 * omega * math.sin(0.5 * value[START])
    return found


def _modes_start(samples: Samples, value: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Start values of Eq. 8 for the stronger of two modes that beat, and of the other beside it."""
    modes = two_modes(samples.time_s, samples.values, math.pi / float(value[OMEGA]))
    assert modes is not None
    own, other = modes
    omega = 2.0 * math.pi * own.frequency.value
    turn = (-own.phase_rad % (2.0 * math.pi)) / omega
    start = value.copy()
    start[[A, B, C, OMEGA]] = 0.0, own.loss.value, 0.0, omega
    start[START] = own.amplitude.value * math.exp(-own.loss.value * turn)
    start[TIME] = samples.time_s[0] + turn
    size, phase = other.amplitude.value, other.phase_rad
    sizes = size * math.cos(phase), -size * math.sin(phase)
    return start, np.array([*sizes, other.frequency.value, 1.0 / other.loss.value])


def _far_from_the_stop(data: Data, value: FloatArray) -> Data:
    """Leave out readings whose amplitude is within a few widths of the Coulomb dead band."""
    rates = [max(float(value[k]), 0.0) for k in (A, B, C)]
    width = 0.5 * math.pi * rates[2] / value[OMEGA]
    start = abs(float(value[START]))
    if not 0.0 < _DEAD_BANDS * width < 0.5 * start:
        return data
    last = value[TIME] + float(time_at(_DEAD_BANDS * width, start, *rates))
    keep = int(np.searchsorted(data.time_s, last))
    return data.first(keep) if _FEWEST_READINGS < keep < len(data) else data


def _before_the_stop(data: Data, model: Model, value: FloatArray) -> tuple[Data, Model, Evaluated]:
    """Leave out readings at the end until the model with the start values moves throughout."""
    while True:
        try:
            return data, model, model.evaluate(value)
        except NoMotionError:
            keep = int(0.97 * len(data))
            if keep < _FEWEST_READINGS:
                raise
            data = data.first(keep)
            model = model.at_times(data.time_s)


_NODES: Final = ((0.4, 14), (0.8, 16), (1.6, 20), (2.4, 28))
"""Nodes up to an amplitude, with which sin x is solved to 3e-7 of the motion."""


def order_for(amplitude: float, unit: str) -> int:
    """Return the number of nodes in a half cycle: more where sin x differs more from x.

    `amplitude` is that of the angle, rad, or of the angular velocity over omega.
    """
    if unit not in ("rad", "rad/s"):
        return _NODES[0][1]
    return next((nodes for up_to, nodes in _NODES if amplitude < up_to), 48)


def _held(
    held_rates: Mapping[str, float],
    fixed: Mapping[str, float],
    parts: Mapping[str, float],
    baseline: Baseline,
) -> tuple[int, ...]:
    index = {"a": A, "b": B, "c": C, "amplitude": START, "offset": OFFSET}
    # Held parts of b are handled by the model.
    held = [index[name] for name in held_rates if name != "b" or not parts]
    if "frequency" in fixed:
        held.append(OMEGA)
    if baseline == "viscous" or held_rates.get("b") == 0.0:
        held.append(SHARE)
    return tuple(held)
