"""Pendulums of the catalogue's tests, without any effect and with one."""

import math
from collections.abc import Sequence

import numpy as np

from pendpipe.arrays import FloatArray
from pendpipe.effects.catalogue import CATALOGUE, by_identifier
from pendpipe.effects.model import Evaluated, Model

OMEGA = 2.0 * math.pi * 0.9

VALUES: dict[str, tuple[float, ...]] = {
    effect.identifier: effect.example for effect in CATALOGUE if effect.has_signature
}
"""Values at which each effect with a signature in the readings is plain to see."""


def baseline(
    *,
    a: float = 0.0,
    b: float = 0.0,
    c: float = 0.0,
    share: float = 0.0,
    start: float = 0.15,
    offset: float = 0.0,
    omega: float = OMEGA,
) -> FloatArray:
    """Values of the baseline; released at t = 0."""
    return np.array([a, b, c, share, omega, start, 0.0, offset])


def times(duration_s: float, interval_s: float = 0.05) -> FloatArray:
    return np.arange(0.0, duration_s, interval_s)


def evaluated(
    identifier: str, values: Sequence[float], base: FloatArray, time_s: FloatArray, order: int = 14
) -> Evaluated:
    """One effect on a baseline."""
    model = Model(time_s, float(time_s[1] - time_s[0]), (by_identifier(identifier),), order=order)
    return model.evaluate(np.append(base, values))


def reading(
    identifier: str, values: Sequence[float], base: FloatArray, time_s: FloatArray, order: int = 14
) -> FloatArray:
    return evaluated(identifier, values, base, time_s, order).reading


def plain(base: FloatArray, time_s: FloatArray) -> FloatArray:
    """The readings of the baseline alone."""
    return Model(time_s, float(time_s[1] - time_s[0])).reading(base)
