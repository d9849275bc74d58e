"""Curves that are drawn only where something is known to be missing.

What they bend (amplitude and frequency of the motion) the scanned curves bend as well, so that
they would find nothing more; but they may be what it really is.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from pendpipe.effects.curve import AmplitudeCurve, Curve
from pendpipe.effects.curves import FrictionCurve, usual_loss_rate
from pendpipe.effects.scan import phase_since_reversal

if TYPE_CHECKING:
    from pendpipe.arrays import FloatArray
    from pendpipe.dynamics.any_law import Motion
    from pendpipe.dynamics.sampling import Sampled
    from pendpipe.effects.effect import Pendulum, Span


class MemoryCurve(FrictionCurve):
    """A friction that is any function of the way since the last turning point.

    Contacts that creep before they slide do so (Iwan's and Masing's loops): each half cycle
    they lose, and stiffen, by the amplitude.
    """

    name = "a friction that remembers the last turning point"
    equation = r"\ddot x \to \ddot x + g(|x - x_\mathrm{turn}|)\,\mathrm{sgn}\,\dot x"
    argument, ordinate = "way since the turning point, rad", "extra friction, rad/s^2"
    flavour = "memory"
    deciding = (
        "turn it back in mid swing, by hand and slowly: the friction must start anew from there"
    )

    def make_knots(self, span: Span) -> FloatArray:
        """Knots from a turning point to the next, closer where the way begins."""
        shares = np.array([0.0, 0.03, 0.08, 0.16, 0.28, 0.44, 0.66, 1.02])
        return np.asarray(2.0 * span.first_amplitude * shares)

    def believable(self, values: FloatArray) -> bool:
        """A contact that is pushed on resists the more the farther it has crept."""
        first, *_, last = self.mixing @ values
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
    deciding = "release it again with the same amplitude: what depends on the time is not the same"

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
    deciding = "film the swing: a second sensor must see the same amplitudes"

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
    deciding = "pass a light barrier at the middle: its times must show the same frequency"

    def reading(self, sampled: Sampled, pendulum: Pendulum, values: FloatArray) -> FloatArray:
        """Return -tau(r) v."""
        delay = self.scale(pendulum) * self.curve(values, sampled.amplitude)
        return np.asarray(-delay * sampled.velocity)

    def scale(self, pendulum: Pendulum) -> float:
        """A hundredth of the time of a radian."""
        return 0.01 / pendulum.angular_frequency


CLOSER_CURVES: Sequence[type[Curve]] = (MemoryCurve, DampingInTimeCurve, GainCurve, DelayCurve)
