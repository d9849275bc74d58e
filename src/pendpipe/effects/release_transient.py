"""An extra loss in the first swings."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from pendpipe.effects.effect import Effect, Parameter, Pendulum, Span
from pendpipe.effects.scan import rows, since_release

if TYPE_CHECKING:
    from pendpipe.arrays import FloatArray
    from pendpipe.dynamics.any_law import Motion


class ReleaseTransient(Effect):
    """Damping gamma e^(-t/tau) on top, after the release: hand, wake, other modes."""

    identifier = "release-transient"
    name = "transient of the release"
    kind = "dynamics"
    equation = r"\ddot x \mathrel{+}= -2 \gamma\, e^{-t/\tau}\, \dot x"
    parameters = (
        Parameter("gamma", "1/s", -10.0, 10.0),
        Parameter("tau", "s", 1e-2, 1e5),
    )
    local = True
    lasts: ClassVar[float] = 0.12
    """Part of the record within which it has to fade."""
    deciding = "leave the first swings out: the rest must agree without it"

    def bounds(self, duration_s: float = math.inf) -> list[tuple[float, float]]:
        """Release means the first swings: what takes longer is a drift of the damping."""
        size, (shortest, longest) = super().bounds(duration_s)
        return [size, (shortest, max(min(longest, self.lasts * duration_s), 10.0 * shortest))]

    def acceleration(self, motion: Motion, pendulum: Pendulum, values: FloatArray) -> FloatArray:
        """Return -2 gamma e^(-t/tau) v."""
        fading = np.exp(-since_release(motion, pendulum) / values[1])
        return np.asarray(-2.0 * values[0] * fading * motion.velocity)

    def shapes(self, span: Span) -> list[tuple[float, ...]]:
        """From two periods to an eighth of the record."""
        short = 2.0 * span.period_s
        return rows(np.geomspace(short, max(self.lasts * span.duration_s, 2.0 * short), 4))
