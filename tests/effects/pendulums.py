"""Pendulums of the catalogue's tests, without any effect and with one."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pendpipe.effects.catalogue import by_identifier
from pendpipe.effects.evaluated import Evaluated
from pendpipe.effects.model import Model

Floats = NDArray[np.float64]
OMEGA = 2.0 * math.pi * 0.9

VALUES: dict[str, tuple[float, ...]] = {
    "circular-error": (1.0,),
    "cubic-stiffness": (0.1,),
    "quadratic-stiffness": (0.05,),
    "coulomb-friction": (1e-4,),
    "quadratic-drag": (0.01,),
    "drag-form": (1.0,),
    "power-law-damping": (1e-3, 1.5, 0.3),
    "cubic-damping": (0.5, 0.4),
    "stribeck-friction": (1e-3, 0.1),
    "presliding-friction": (1e-3, 0.02),
    "backlash": (1e-3,),
    "history-force": (0.01,),
    "vortex-shedding": (0.01, 0.1, 0.6),
    "second-mode": (1e-3, 2e-3, 4.3, 3.0),
    "plane-coupling": (1e-3, 5e-4, 0.02),
    "periodic-drive": (5e-4, 3e-4, 1.2),
    "frequency-drift": (1e-5, 30.0),
    "damping-drift": (1e-4, 25.0),
    "equilibrium-creep": (1e-3, 10.0, 0.5),
    "equilibrium-step": (1e-3, 21.03),
    "amplitude-step": (0.01, 21.03),
    "frequency-step": (1e-4, 21.03),
    "damping-step": (0.3, 21.03),
    "impulse": (5e-3, 21.03),
    "release-transient": (0.01, 5.0),
    "sensor-quadratic": (0.05,),
    "sensor-cubic": (0.05,),
    "sensor-backlash": (1e-3,),
    "offset-drift": (1e-5, 25.0),
    "gain-drift": (1e-4, 20.0),
    "ac-coupling": (1e-3, 5.0),
    "tone-pickup": (1e-3, 5e-4, 3.3),
    "clock-drift": (1e-5, 15.0),
    "dropped-samples": (1e-2, 21.03),
}
"""Values at which each effect with a template is plain to see."""


def baseline(
    *, a: float = 0.0, b: float = 0.0, c: float = 0.0, share: float = 0.0, start: float = 0.15,
    offset: float = 0.0, omega: float = OMEGA,
) -> Floats:  # fmt: skip
    """Values of the baseline; released at t = 0."""
    return np.array([a, b, c, share, omega, start, 0.0, offset])


def times(duration_s: float, interval_s: float = 0.05) -> Floats:
    return np.arange(0.0, duration_s, interval_s)


def evaluated(
    identifier: str, values: Sequence[float], base: Floats, time_s: Floats, order: int = 14
) -> Evaluated:
    """One effect on a baseline."""
    model = Model(time_s, float(time_s[1] - time_s[0]), (by_identifier(identifier),), order=order)
    return model.evaluate(np.append(base, values))


def reading(
    identifier: str, values: Sequence[float], base: Floats, time_s: Floats, order: int = 14
) -> Floats:
    return evaluated(identifier, values, base, time_s, order).reading


def plain(base: Floats, time_s: Floats) -> Floats:
    """The readings of the baseline alone."""
    return Model(time_s, float(time_s[1] - time_s[0])).reading(base)
