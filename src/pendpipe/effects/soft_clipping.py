"""An amplifier or a sensor that saturates smoothly near its ends."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from pendpipe.effects.effect import Effect, Parameter, Pendulum, Span
from pendpipe.effects.scan import rows

if TYPE_CHECKING:
    from pendpipe.arrays import FloatArray
    from pendpipe.dynamics.sampling import Sampled

_WIDTHS: Final = (0.01, 0.03, 0.1)
"""Of the first amplitude: from an edge to what bends like a cubic sensor."""
_HARD: Final = 30.0


class SoftClipping(Effect):
    """The form of `clipping` that has a template: near the ends readings fall behind.

    With a level L and a width w the upper end reads y = L - w ln(1 + e^((L - x)/w)). The size
    is what the largest angle loses, d = w ln(1 + e^((x_top - L)/w)), by which

        y = x - w ln[1 + (e^(d/w) - 1) e^((x - x_top)/w)]:

    at d << w an exponential, at d >> w a flat top at x_top - d.
    """

    identifier = "clipping"
    name = "soft clipping"
    kind = "measurement"
    equation = r"y = x - w \ln\left[1 + (e^{d/w} - 1)\, e^{(x - x_\mathrm{top})/w}\right]"
    parameters = (
        Parameter("upper_loss", "rad", 0.0, 10.0), Parameter("lower_loss", "rad", 0.0, 10.0),
        Parameter("width", "rad", 1e-7, 10.0),
    )  # fmt: skip
    sizes = 2
    deciding = "widen the range, or release it with less amplitude"

    @property
    def key(self) -> str:
        """Beside the hard clipping, which a test of its own finds."""
        return "clipping:soft"

    def reading(self, sampled: Sampled, pendulum: Pendulum, values: FloatArray) -> FloatArray:
        """Return what both ends take off."""
        upper, lower, width = values
        angle = sampled.angle
        return np.asarray(
            _lost(angle.min() - angle, lower, width) - _lost(angle - angle.max(), upper, width)
        )

    def shapes(self, span: Span) -> list[tuple[float, ...]]:
        """Widths."""
        return rows(span.first_amplitude * np.array(_WIDTHS))


def _lost(beyond: FloatArray, depth: float, width: float) -> FloatArray:
    """Return w ln[1 + (e^(d/w) - 1) e^(beyond/w)]; no angle is `beyond` the largest."""
    near = beyond / width
    if depth > _HARD * width:
        return np.asarray(width * np.logaddexp(0.0, near + depth / width))
    return np.asarray(width * np.log1p(np.expm1(depth / width) * np.exp(near)))
