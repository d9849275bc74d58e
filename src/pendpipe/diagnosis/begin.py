"""From a recording to the readings and the start values of the baseline."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from pendpipe.analysis.angles import as_angles
from pendpipe.analysis.fit.fitted import Baseline
from pendpipe.analysis.fit.fixed import Held
from pendpipe.analysis.fit.result import FitResult
from pendpipe.analysis.fit.start import start_values, usable_span
from pendpipe.analysis.torque import restoring_of
from pendpipe.analysis.turning_points import TurningPoints
from pendpipe.analysis.turning_points.measure import Samples
from pendpipe.arrays import FloatArray
from pendpipe.diagnosis.data import Data, gather
from pendpipe.diagnosis.refine import anchored
from pendpipe.dynamics.any_law import NoMotionError
from pendpipe.dynamics.eq8 import BASELINE, OFFSET, OMEGA, SHARE, START, TIME, A, B, C
from pendpipe.dynamics.eq8_model import Eq8Model, Seen, values_of
from pendpipe.effects.catalogue import CATALOGUE
from pendpipe.effects.effect import Start
from pendpipe.effects.model import Evaluated, Model, pendulum_of
from pendpipe.physics.decay import time_at

_FEWEST_READINGS: Final = 24
"""Readings of what is left: three for each of the eight values of the baseline."""
_DEAD_BANDS: Final = 10.0
"""Distance from the end in half widths of the Coulomb dead band: nearer to it the rest position
jumps with the parameters."""
_FAR_BEYOND: Final = 10.0
"""Spans of the readings: a sensor that clips shows a part of the swing, hardly a tenth of it."""


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
    starts
        What effects declare where the turning points beat.
    fit
        That of the recording, with which it begins.
    """

    data: Data
    model: Model
    value: FloatArray
    held: tuple[int, ...]
    starts: tuple[Start, ...] = ()
    fit: FitResult | None = None


def begin(
    samples: Samples,
    points: TurningPoints,
    fit: FitResult | None = None,
    *,
    baseline: Baseline,
    fixed: Mapping[str, float],
    stated: bool = True,
) -> Beginning:
    """Choose the readings that are compared, and the start values of the search.

    It begins with the model that `fit` has and its values; where its light is red, which has lost
    the motion, with its torque alone. `stated` is whether it is known that the readings are angles.
    """
    held = Held(fixed, baseline, points.apparent_frequency_hz)
    angles, _ = as_angles(points)
    beats = not fixed and bool(points.beats)
    seen: Seen = "rate" if samples.unit == "rad/s" else "angle"
    law, span = Eq8Model(samples.time_s, seen=seen, parts=held.parts), slice(None)
    starts: tuple[Start, ...] = ()
    if fit is not None and fit.minimum and fit.light != "red":
        (law, value), at_release = fit.minimum, bool(fit.minimum[1][TIME] >= samples.time_s[0])
    else:
        torque = fit.restoring if fit else restoring_of(angles, stated=stated)
        law = replace(law, restoring="linear" if beats else torque)
        start = start_values(angles, held, law.restoring, samples=samples)
        value, at_release = start.value[: len(BASELINE)], start.before == 0
    if beats:
        # The turning points of a beat tell nothing of either mode, nor of the torque.
        law = replace(law, restoring="linear")
        readings = samples.time_s, samples.values, 2.0 * math.pi / float(value[OMEGA])
        found = [each for effect in CATALOGUE if (each := effect.start(*readings))]
        torques = {"linear"} if samples.unit != "rad" else {"linear", "sine"}
        starts = tuple(each for each in found if each.law.restoring in torques)
        if starts:
            value = values_of(starts[0].law, starts[0].release, float(value[OFFSET]))
    else:
        span = usable_span(samples, angles, value, at_release=at_release)
    omega, angle = float(value[OMEGA]), float(value[START])
    value = law.settled(value)
    own = replace(pendulum_of(value), restoring=law.restoring, drag=law.drag)
    data = gather(
        samples.time_s[span],
        samples.values[span],
        step=samples.step,
        unit=samples.unit,
        counts=samples.counts,
        period_s=2.0 * math.pi / omega,
        noise_rms=points.noise_rms_rad,
        friction_jump=2.0 * abs(float(own.friction(value[START], *np.array([0.0, 1.0])))),
        third=abs(angle) ** 3 / 192.0 if law.restoring == "sine" else 0.0,
    )
    row = span.indices(len(samples.time_s))[0]
    data = replace(data, row=row, turn_s=float(angles.time_s[0]))
    data = _far_from_the_stop(data, value)
    is_angle = samples.unit in ("rad", "rad/s")
    forms = vars(law) | {"time_s": data.time_s}
    model = Model(
        interval_s=data.interval_s,
        order=order_for(abs(angle), "rad" if is_angle else samples.unit),
        fold=data.fold,
        first_s=float(data.time_s[0]),
        scale=1.0 if is_angle else abs(angle),
        **forms,
    )
    data, model, at = _before_the_stop(data, model, value)
    if not np.ptp(at.reading) < _FAR_BEYOND * np.ptp(data.values):
        raise NoMotionError("it would swing far beyond the readings")
    if not starts:
        data = replace(data, anchor=anchored(data, at))
    # Held parts of b are handled by the model.
    of_model = (B, SHARE) if held.parts else ()
    places = tuple(place for place in held.places if place not in of_model)
    return Beginning(data, model, value, places, starts, fit)


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


_NODES: Final = (
    *((0.4, 14), (0.8, 16), (1.2, 18), (1.6, 20)),
    *((2.0, 24), (2.4, 32), (2.6, 36), (2.8, 44)),
)
"""Nodes up to an amplitude, with which sin x is solved to 3e-7 of the motion."""


def order_for(amplitude: float, unit: str) -> int:
    """Return the number of nodes in a half cycle: more where sin x differs more from x.

    `amplitude` is that of the angle, rad, or of the angular velocity over omega.
    """
    if unit not in ("rad", "rad/s"):
        return _NODES[0][1]
    return next((nodes for up_to, nodes in _NODES if amplitude < up_to), 60)
