"""Angles of a pendulum with any effects of the catalogue, to the stop."""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from pendpipe.arrays import FloatArray
from pendpipe.dynamics import Eq8, Release
from pendpipe.dynamics.any_law import Motion, NoMotionError
from pendpipe.dynamics.sampling import sample_pieces
from pendpipe.effects.baseline import BASELINE
from pendpipe.effects.model import Model
from pendpipe.errors import InputError
from pendpipe.simulation.instrument import Given

_ORDER: Final = 64
"""Nodes of a half cycle: with sin x from 2.6 rad the readings are then good to 2e-7 rad."""
Pieces = list[tuple[float, Motion]]


def angles(
    equation: Eq8, release: Release, given: Sequence[Given], time_s: FloatArray, place: str
) -> FloatArray:
    """Return the readings at rising times, in rad: motion, and what effects add to it.

    Where friction ends the motion, the pendulum rests at its last turning point: the last
    swings, of about the friction's own displacement, are not followed.

    Raises
    ------
    InputError
        If the pendulum never turns.
    """
    effects = tuple(one.effect for one in given)
    value = np.zeros(len(BASELINE))
    linear = equation.hysteretic + equation.viscous
    share = equation.hysteretic / linear if linear else 0.0
    value[:7] = (
        equation.quadratic,
        linear,
        equation.coulomb,
        share,
        equation.angular_frequency,
        release.angle_rad,
        release.time_s,
    )
    value = np.concatenate([value, *(one.values for one in given)])
    interval = float(time_s[1] - time_s[0]) if len(time_s) > 1 else 1.0
    model = Model(time_s, interval, effects, _ORDER)
    pieces = _longest(model, value, equation.angular_frequency, place)
    stamps = model.taken_at(value)
    end = float(pieces[-1][1].time_s[-1, -1])
    sampled = replace(sample_pieces(pieces, np.minimum(stamps, end)), time_s=stamps)
    return model.read(sampled, value)


def _longest(model: Model, value: FloatArray, omega: float, place: str) -> Pieces:
    """Follow the motion past the last reading, or as far as friction lets it go."""
    begin, last = float(value[BASELINE.index("start_s")]), float(model.time_s[-1])
    count, good, bad = math.ceil((last - begin) * omega / math.pi) + 1, 0, math.inf
    found: Pieces | None = None
    while good < count < bad:
        try:
            pieces = model.over(count).follow(value)
        except NoMotionError:
            bad = count
        else:
            good, found = count, pieces
            end = float(pieces[-1][1].time_s[-1, -1])
            if end > last:
                return pieces
            count = count + math.ceil(count * (last - end) / (end - begin)) + 1
        if bad < math.inf:
            count = (good + int(bad)) // 2
    if found is None:
        raise InputError(place, "the pendulum does not swing", "weaken its friction or effects")
    return found
