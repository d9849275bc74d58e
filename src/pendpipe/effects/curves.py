"""Non-parametric terms: what no entry of the catalogue has the form of, as a curve.

A curve is a sum of triangular basis functions (1 at a knot, 0 at its neighbours), in units of
what may reasonably be there. Which combinations of them a recording can see is worked out along
its own fitted motion (`Curve.reduced`).
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from pendpipe.effects.effect import Effect, Pendulum, Span
from pendpipe.effects.scan import (
    phase_since_reversal,
)

if TYPE_CHECKING:
    from pendpipe.arrays import FloatArray
    from pendpipe.dynamics.any_law import Motion
    from pendpipe.dynamics.sampling import Sampled


class Curve(Effect, ABC):
    """A curve over `argument`, by its values at the knots.

    Parameters
    ----------
    knots
        Where the basis functions have their peaks, rising.
    span
        Of the recording.
    coefficients
        The combinations of the basis functions that are fitted, a column each, shape
        (basis functions, sizes); each function for itself by default.
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

    def __init__(self, span: Span, coefficients: FloatArray | None = None) -> None:
        self.span = span
        self.knots = self.make_knots(span)
        self.basis_size = self.count_basis_functions()
        self.coefficients = np.eye(self.basis_size) if coefficients is None else coefficients
        self.sizes = self.coefficients.shape[1]  # type: ignore[misc]

    @property
    def count(self) -> int:
        """How many combinations are fitted."""
        return self.sizes

    @property
    def key(self) -> str:
        """Identifier and flavour."""
        return f"{self.identifier}:{self.flavour}"

    def bounds(self, duration_s: float = math.inf) -> list[tuple[float, float]]:
        """Any."""
        return [(-np.inf, np.inf)] * self.sizes

    @abstractmethod
    def make_knots(self, span: Span) -> FloatArray:
        """Return where the basis functions have their peaks."""

    def count_basis_functions(self) -> int:
        """Return how many basis functions there are."""
        return len(self.knots)

    def reduced(self, coefficients: FloatArray) -> Curve:
        """Return the same with fewer combinations."""
        return type(self)(self.span, coefficients)

    def curve(self, values: FloatArray, at: FloatArray) -> FloatArray:
        """Return the curve's value, in its reasonable units."""
        return np.asarray(np.interp(at, self.knots, self.coefficients @ values))

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
        return np.asarray(np.interp(np.log(at), np.log(self.knots), self.coefficients @ values))


def _positions(span: Span) -> FloatArray:
    """Knots over the angle: closer at the middle, where every swing passes."""
    half = np.array([0.0, 0.04, 0.1, 0.2, 0.34, 0.52, 0.74, 1.02])
    return np.asarray(span.first_amplitude * np.concatenate([-half[:0:-1], half]))


class RestoringCurve(Curve):
    """A restoring torque that is any function of the angle."""

    identifier = "unnamed-restoring"
    name = "a restoring torque of unknown form"
    equation = r"\omega^2 x \to \omega^2 x + F(x)"
    argument, ordinate = "angle, rad", "extra restoring torque over omega^2, rad"
    discriminating_test = (
        "measure the torque against the angle at rest, or map it with a second pendulum"
    )

    def make_knots(self, span: Span) -> FloatArray:
        """Knots over the angle."""
        return _positions(span)

    def acceleration(self, motion: Motion, pendulum: Pendulum, values: FloatArray) -> FloatArray:
        """Return -omega^2 F(x)."""
        scale = self.scale(pendulum) * pendulum.angular_frequency**2
        return -scale * self.curve(values, motion.angle)

    def scale(self, pendulum: Pendulum) -> float:
        """A tenth of the amplitude."""
        return 0.1 * self.span.first_amplitude


class DampingCurve(AmplitudeCurve):
    """A loss that is any function of the amplitude."""

    identifier = "unnamed-damping"
    name = "a loss that depends on the amplitude in an unknown way"
    equation = r"2 b \dot x \to 2 [b + \beta(y)]\,\dot x"
    argument, ordinate = "amplitude, rad", "extra loss rate, 1/s"
    flavour = "amplitude"
    number = 15
    discriminating_test = (
        "release it from several amplitudes: the loss must follow the amplitude, not the time"
    )

    def acceleration(self, motion: Motion, pendulum: Pendulum, values: FloatArray) -> FloatArray:
        """Return -2 beta(r) v."""
        beta = self.scale(pendulum) * self.curve(values, motion.amplitude)
        return np.asarray(-2.0 * beta * motion.velocity)

    def scale(self, pendulum: Pendulum) -> float:
        """The usual loss rate."""
        return usual_loss_rate(pendulum, self.span)


class FrictionCurve(Curve):
    """A friction that is any function of the angle."""

    identifier = "unnamed-damping"
    name = "a friction that depends on the angle in an unknown way"
    equation = r"\ddot x \to \ddot x + g(x)\,\mathrm{sgn}\,\dot x"
    argument, ordinate = "angle, rad", "extra friction, rad/s^2"
    flavour = "angle"
    discriminating_test = "turn the bearing by a few degrees: a rough spot goes with it"

    def make_knots(self, span: Span) -> FloatArray:
        """Knots over the angle."""
        return _positions(span)

    def acceleration(self, motion: Motion, pendulum: Pendulum, values: FloatArray) -> FloatArray:
        """Return -g(x) sgn(v)."""
        friction = self.scale(pendulum) * self.curve(values, motion.angle)
        return np.asarray(-motion.direction * friction)

    def scale(self, pendulum: Pendulum) -> float:
        """The usual friction."""
        usual = usual_loss_rate(pendulum, self.span) * pendulum.angular_frequency
        return usual * self.span.first_amplitude


class ProfileCurve(Curve):
    """A friction in proportion to the amplitude, of any form along the half swing."""

    identifier = "unnamed-damping"
    name = "a friction of unknown form along each half swing"
    equation = r"\ddot x \to \ddot x + y\,h(\psi)\,\mathrm{sgn}\,\dot x"
    argument, ordinate = (
        "phase since the last turning point, rad",
        "extra friction over amplitude, 1/s^2",
    )
    flavour = "profile"
    discriminating_test = (
        "sample the swing faster, and look at the velocity about the turning points"
    )

    def make_knots(self, span: Span) -> FloatArray:
        """Knots over the half swing."""
        return np.linspace(0.0, np.pi, 9)

    def acceleration(self, motion: Motion, pendulum: Pendulum, values: FloatArray) -> FloatArray:
        """Return -r h(psi) sgn(v)."""
        phase = phase_since_reversal(motion)
        profile = self.scale(pendulum) * self.curve(values, phase)
        return np.asarray(-motion.direction * motion.amplitude * profile)

    def scale(self, pendulum: Pendulum) -> float:
        """The usual friction over the amplitude."""
        return usual_loss_rate(pendulum, self.span) * pendulum.angular_frequency


class DriveCurve(Curve):
    """A torque that comes and goes with the time, in step with the motion."""

    in_time = of_anything = True
    prior = -6.0
    identifier = "unnamed-drive"
    name = "a torque that depends on the time in an unknown way"
    equation = r"\ddot x \to \ddot x + p(t)\,\omega^2 x + q(t)\,\omega \dot x"
    argument, ordinate = "time, s", "extra torque over omega^2 y"
    discriminating_test = "repeat the run: what depends on the time of day does not come again"

    def make_knots(self, span: Span) -> FloatArray:
        """Knots over the time."""
        return np.linspace(span.start_s, span.stop_s, 10)

    def count_basis_functions(self) -> int:
        """In phase and in quadrature."""
        return 2 * len(self.knots)

    def acceleration(self, motion: Motion, pendulum: Pendulum, values: FloatArray) -> FloatArray:
        """Return p(t) omega^2 x + q(t) omega v."""
        both = self.coefficients @ values
        count, omega = len(self.knots), pendulum.angular_frequency
        in_phase = np.interp(motion.time_s, self.knots, both[:count])
        quadrature = np.interp(motion.time_s, self.knots, both[count:])
        force = in_phase * omega * motion.angle + quadrature * motion.velocity
        return np.asarray(self.scale(pendulum) * omega * force)

    def scale(self, pendulum: Pendulum) -> float:
        """A hundredth."""
        return 0.01


class ReadingCurve(Curve):
    """A sensor whose reading is any function of the angle."""

    identifier = "unnamed-measurement"
    name = "a sensor curve of unknown form"
    equation = r"y = x + s(x)"
    argument, ordinate = "angle, rad", "reading minus angle, rad"
    flavour = "angle"
    discriminating_test = "calibrate the sensor at rest over the whole range"

    def make_knots(self, span: Span) -> FloatArray:
        """Knots over the angle."""
        return _positions(span)

    def reading(self, sampled: Sampled, pendulum: Pendulum, values: FloatArray) -> FloatArray:
        """Return s(x)."""
        return self.scale(pendulum) * self.curve(values, sampled.angle)

    def scale(self, pendulum: Pendulum) -> float:
        """A twentieth of the amplitude."""
        return 0.05 * self.span.first_amplitude


class OffsetCurve(Curve):
    """An offset that wanders in time."""

    in_time = of_anything = True
    identifier = "unnamed-measurement"
    name = "a wandering offset"
    equation = r"y = x + s(t)"
    argument, ordinate = "time, s", "offset, rad"
    flavour = "time"
    discriminating_test = "record the pendulum at rest for as long"

    def make_knots(self, span: Span) -> FloatArray:
        """Knots over the time."""
        return np.linspace(span.start_s, span.stop_s, 14)

    def reading(self, sampled: Sampled, pendulum: Pendulum, values: FloatArray) -> FloatArray:
        """Return s(t)."""
        return self.scale(pendulum) * self.curve(values, sampled.time_s)

    def scale(self, pendulum: Pendulum) -> float:
        """A twentieth of the amplitude."""
        return 0.05 * self.span.first_amplitude


def usual_loss_rate(pendulum: Pendulum, span: Span) -> float:
    """The usual loss rate, 1/s: that of the middle amplitude."""
    middle = math.sqrt(span.first_amplitude * span.last_amplitude)
    return (
        pendulum.quadratic * middle + pendulum.linear + pendulum.coulomb / middle
    ) + 1e-4 * pendulum.angular_frequency


CURVES: Sequence[type[Curve]] = (
    RestoringCurve,
    DampingCurve,
    FrictionCurve,
    ProfileCurve,
    DriveCurve,
    ReadingCurve,
    OffsetCurve,
)


class MemoryCurve(FrictionCurve):
    """A friction that is any function of the way since the last turning point.

    Contacts that creep before they slide do so (Iwan's and Masing's loops): each half cycle
    they lose, and stiffen, by the amplitude.
    """

    name = "a friction that remembers the last turning point"
    equation = r"\ddot x \to \ddot x + g(|x - x_\mathrm{turn}|)\,\mathrm{sgn}\,\dot x"
    argument, ordinate = "way since the turning point, rad", "extra friction, rad/s^2"
    flavour = "memory"
    discriminating_test = (
        "turn it back in mid swing, by hand and slowly: the friction must start anew from there"
    )

    def make_knots(self, span: Span) -> FloatArray:
        """Knots from a turning point to the next, closer where the way begins."""
        shares = np.array([0.0, 0.03, 0.08, 0.16, 0.28, 0.44, 0.66, 1.02])
        return np.asarray(2.0 * span.first_amplitude * shares)

    def believable(self, values: FloatArray) -> bool:
        """A contact that is pushed on resists the more the farther it has crept."""
        first, *_, last = self.coefficients @ values
        return bool(last > first)

    def acceleration(self, motion: Motion, pendulum: Pendulum, values: FloatArray) -> FloatArray:
        """Return -g(r (1 - cos psi)) sgn(v), psi from the last turning point."""
        phase = phase_since_reversal(motion)
        way = motion.amplitude * (1.0 - np.cos(phase))
        return np.asarray(-motion.direction * self.scale(pendulum) * self.curve(values, way))


class DampingInTimeCurve(Curve):
    """A loss that is any function of the time."""

    in_time = True
    identifier = "unnamed-damping"
    name = "a loss that depends on the time in an unknown way"
    equation = r"2 b \dot x \to 2 [b + \beta(t)]\,\dot x"
    argument, ordinate = "time, s", "extra loss rate, 1/s"
    flavour = "time"
    discriminating_test = (
        "release it again with the same amplitude: what depends on the time is not the same"
    )

    def make_knots(self, span: Span) -> FloatArray:
        """Knots over the time."""
        return np.linspace(span.start_s, span.stop_s, 25)

    def acceleration(self, motion: Motion, pendulum: Pendulum, values: FloatArray) -> FloatArray:
        """Return -2 beta(t) v."""
        beta = self.scale(pendulum) * self.curve(values, motion.time_s)
        return np.asarray(-2.0 * beta * motion.velocity)

    def scale(self, pendulum: Pendulum) -> float:
        """The usual loss rate."""
        return usual_loss_rate(pendulum, self.span)


class GainCurve(AmplitudeCurve):
    """A sensor whose gain is any function of the swing."""

    identifier = "unnamed-measurement"
    name = "a gain that depends on the swing in an unknown way"
    equation = r"y = x\,[1 + g(y)]"
    argument, ordinate = "amplitude, rad", "gain less 1"
    flavour = "gain"
    number = 13
    discriminating_test = "film the swing: a second sensor must see the same amplitudes"

    def reading(self, sampled: Sampled, pendulum: Pendulum, values: FloatArray) -> FloatArray:
        """Return g(r) x."""
        gain = self.scale(pendulum) * self.curve(values, sampled.amplitude)
        return np.asarray(gain * sampled.angle)

    def scale(self, pendulum: Pendulum) -> float:
        """A hundredth."""
        return 0.01


class DelayCurve(GainCurve):
    """A reading that comes later by any function of the swing."""

    name = "a delay that depends on the swing in an unknown way"
    equation = r"y = x(t - \tau(y))"
    argument, ordinate = "amplitude, rad", "delay, s"
    flavour = "delay"
    discriminating_test = (
        "pass a light barrier at the middle: its times must show the same frequency"
    )

    def reading(self, sampled: Sampled, pendulum: Pendulum, values: FloatArray) -> FloatArray:
        """Return -tau(r) v."""
        delay = self.scale(pendulum) * self.curve(values, sampled.amplitude)
        return np.asarray(-delay * sampled.velocity)

    def scale(self, pendulum: Pendulum) -> float:
        """A hundredth of the time of a radian."""
        return 0.01 / pendulum.angular_frequency


FOLLOW_UP_CURVES: Sequence[type[Curve]] = (MemoryCurve, DampingInTimeCurve, GainCurve, DelayCurve)
