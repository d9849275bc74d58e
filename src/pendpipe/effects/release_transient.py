"""An extra loss in the first swings."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pendpipe.effects.effect import Effect, Parameter, Pendulum, Span
from pendpipe.effects.scan import rows, since_start

if TYPE_CHECKING:
    from pendpipe.arrays import FloatArray
    from pendpipe.dynamics.any_law import Motion


class ReleaseTransient(Effect):
    """Damping gamma e^(-t/tau) on top, after the motion's start: hand, wake, other modes."""

    identifier = "release-transient"
    name = "transient of the release"
    kind = "dynamics"
    equation = r"\ddot x \mathrel{+}= -2 \gamma\, e^{-t/\tau}\, \dot x"
    parameters = (
        Parameter("gamma", "1/s", -10.0, 10.0),
        Parameter("tau", "s", 1e-2, 1e5),
    )
    local = True
    deciding = "leave the first swings out: the rest must agree without it"

    def acceleration(self, motion: Motion, pendulum: Pendulum, values: FloatArray) -> FloatArray:
        """Return -2 gamma e^(-t/tau) v."""
        fading = np.exp(-since_start(motion) / values[1])
        return np.asarray(-2.0 * values[0] * fading * motion.velocity)

    def shapes(self, span: Span) -> list[tuple[float, ...]]:
        """From two periods to a sixth of the record."""
        short = 2.0 * span.period_s
        return rows(np.geomspace(short, max(span.duration_s / 6.0, 2.0 * short), 4))
