"""A curve that is drawn, where no entry of the catalogue has the form of what is missing.

A curve is a sum of hats (functions that are 1 at a knot, fall to 0 at its neighbours), in
units of what may reasonably be there. Which of their mixtures a recording can see is worked
out along its own fitted motion (`Curve.reduced`).
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from pendpipe.effects.effect import Effect, Pendulum, Span

if TYPE_CHECKING:
    from pendpipe.arrays import FloatArray


class Curve(Effect, ABC):
    """A curve over `argument`, by its values at the knots.

    Parameters
    ----------
    knots
        Where the hats stand, rising.
    span
        Of the recording.
    mixing
        Which mixtures of the hats are fitted, shape (hats, sizes); all by default.
    """

    kind = "unnamed"
    parameters = ()
    prior = -3.0
    argument: ClassVar[str]
    """What the curve is drawn against, with its unit."""
    ordinate: ClassVar[str]
    """What is drawn."""
    flavour: ClassVar[str] = ""
    of_anything: ClassVar[bool] = False
    """Whether it follows whatever may happen, at whatever time."""

    def __init__(self, span: Span, mixing: FloatArray | None = None) -> None:
        self.span = span
        self.knots = self.make_knots(span)
        self.hats = self.count_hats()
        self.mixing = np.eye(self.hats) if mixing is None else mixing
        self.sizes = self.mixing.shape[1]  # type: ignore[misc]

    @property
    def count(self) -> int:
        """How many mixtures are fitted."""
        return self.sizes

    @property
    def key(self) -> str:
        """Identifier and flavour."""
        return f"{self.identifier}:{self.flavour}"

    def bounds(self, duration_s: float = math.inf) -> list[tuple[float, float]]:
        """Any mixtures."""
        return [(-np.inf, np.inf)] * self.sizes

    @abstractmethod
    def make_knots(self, span: Span) -> FloatArray:
        """Return where the hats stand."""

    def count_hats(self) -> int:
        """Return how many hats there are."""
        return len(self.knots)

    def reduced(self, mixing: FloatArray) -> Curve:
        """Return the same with fewer mixtures."""
        return type(self)(self.span, mixing)

    def curve(self, values: FloatArray, at: FloatArray) -> FloatArray:
        """Return the curve's value, in its reasonable units."""
        return np.asarray(np.interp(at, self.knots, self.mixing @ values))

    @abstractmethod
    def scale(self, pendulum: Pendulum) -> float:
        """Return the reasonable unit in that of `ordinate`."""

    def small(self, span: Span) -> float:
        """A thousandth of what is reasonable."""
        return 1e-3


class AmplitudeCurve(Curve, ABC):
    """A curve over the amplitude, straight between knots that stand in equal ratios."""

    number: ClassVar[int]
    """Of knots."""

    def make_knots(self, span: Span) -> FloatArray:
        """Knots over the amplitude, in equal ratios."""
        last = max(span.last_amplitude, 1e-3 * span.first_amplitude)
        ends = (0.95 * last, 1.05 * span.first_amplitude)
        return np.asarray(np.geomspace(*ends, self.number))

    def curve(self, values: FloatArray, at: FloatArray) -> FloatArray:
        """Return the curve's value: straight between the knots over ln y."""
        return np.asarray(np.interp(np.log(at), np.log(self.knots), self.mixing @ values))
