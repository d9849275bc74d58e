"""What no entry of the catalogue explains: curves, that are drawn rather than named."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from pendpipe.effects.curve import AmplitudeCurve, Curve
from pendpipe.effects.scan import phase_since_reversal

if TYPE_CHECKING:
    from pendpipe.arrays import FloatArray
    from pendpipe.dynamics.any_law import Motion
    from pendpipe.dynamics.sampling import Sampled
    from pendpipe.effects.effect import Pendulum, Span


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
    deciding = "measure the torque against the angle at rest, or map it with a second pendulum"

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
    deciding = (
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
    deciding = "turn the bearing by a few degrees: a rough spot goes with it"

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
    deciding = "sample the swing faster, and look at the velocity about the turning points"

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
    deciding = "repeat the run: what depends on the time of day does not come again"

    def make_knots(self, span: Span) -> FloatArray:
        """Knots over the time."""
        return np.linspace(span.start_s, span.stop_s, 10)

    def count_hats(self) -> int:
        """In phase and in quadrature."""
        return 2 * len(self.knots)

    def acceleration(self, motion: Motion, pendulum: Pendulum, values: FloatArray) -> FloatArray:
        """Return p(t) omega^2 x + q(t) omega v."""
        both = self.mixing @ values
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
    deciding = "calibrate the sensor at rest over the whole range"

    def make_knots(self, span: Span) -> FloatArray:
        """Knots over the angle."""
        return _positions(span)

    def reading(self, sampled: Sampled, pendulum: Pendulum, values: FloatArray) -> FloatArray:
        """Return s(x)."""
        return self.scale(pendulum) * self.curve(values, sampled.angle)

    def scale(self, pendulum: Pendulum) -> float:
        """A twentieth of the amplitude."""
        return 0.05 * self.span.first_amplitude


class BaselineCurve(Curve):
    """A level that wanders in time."""

    in_time = of_anything = True
    identifier = "unnamed-measurement"
    name = "a level that wanders"
    equation = r"y = x + s(t)"
    argument, ordinate = "time, s", "level, rad"
    flavour = "time"
    deciding = "record the pendulum at rest for as long"

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
    RestoringCurve, DampingCurve, FrictionCurve, ProfileCurve, DriveCurve, ReadingCurve,
    BaselineCurve,
)  # fmt: skip
