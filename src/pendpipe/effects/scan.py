"""What the scans and the shapes of several effects have in common."""

import itertools
import math
from collections.abc import Iterable, Sequence
from typing import ClassVar, Final

import numpy as np

from pendpipe.arrays import FloatArray
from pendpipe.dynamics.any_law import Motion
from pendpipe.effects.effect import Effect, Parameter, Pendulum, Span


def rows(*axes: Iterable[float]) -> list[tuple[float, ...]]:
    """Return every combination of the values along several axes."""
    return [tuple(float(value) for value in row) for row in itertools.product(*axes)]


def between(low: float, high: float, count: int) -> FloatArray:
    """Return values in equal ratios; up to twice the lowest at least."""
    return np.geomspace(low, max(high, 2.0 * low), count)


STRAIGHT_S: Final = 1e7
"""A relaxation time that no record can tell from infinity."""
RELAXATION: Final = Parameter("tau", "s", 1e-2, STRAIGHT_S, STRAIGHT_S)


def relaxed(time_s: FloatArray, tau: float) -> FloatArray:
    """Return tau (1 - e^(-t/tau)): how far a drift has come that relaxes; t where tau is long."""
    return np.asarray(-tau * np.expm1(-time_s / tau))


class Relaxing(Effect):
    """A change that relaxes with tau, and is straight where tau is long; tau is the shape."""

    def shapes(self, span: Span) -> list[tuple[float]]:
        """Straight, and over two fifths and a sixth of the record.

        The time that is fitted afterwards starts from the best of them.
        """
        return [(STRAIGHT_S,), (0.4 * span.duration_s,), (span.duration_s / 6.0,)]


USUAL_DRIFT: Final = 1e-3
"""Part by which a frequency or a clock may well change within a record: steel's modulus changes
so in a few kelvin, the clock of a program that times itself so at the worst."""


def unusual_drift(values: FloatArray, span: Span) -> float:
    """Return twice the logarithm by which a drift is larger than usual ones; 0 where it is not.

    A density that falls as 1/change^2 beyond the usual, and is flat in the logarithm within.
    """
    rate, tau = values.tolist()
    change = abs(rate) * float(relaxed(np.asarray(span.duration_s), tau))
    return 2.0 * math.log(max(change / USUAL_DRIFT, 1.0))


_LATE: Final = 0.1
"""Of a half cycle, by which the release may seem to come after the first reading."""


def half_cycle_of_release(motion: Motion, pendulum: Pendulum) -> int:
    """Return the number of the half cycle that begins where the pendulum was let go.

    That is the last turning point before the first reading, or a little behind it: what begins
    with the first reading begins, within its error, at a turning point.
    """
    begins, lasts = motion.time_s[:, 0], math.pi / pendulum.angular_frequency
    before = int(np.searchsorted(begins, pendulum.first_s + _LATE * lasts, side="right"))
    return max(before - 1, 0)


def since_release(motion: Motion, pendulum: Pendulum) -> FloatArray:
    """Return the time since the turning point at which the pendulum was let go, s; 0 before."""
    released = motion.time_s[half_cycle_of_release(motion, pendulum), 0]
    return np.asarray(np.maximum(motion.time_s - released, 0.0))


def phase_since_reversal(motion: Motion) -> FloatArray:
    """Return the phase since the turning point before, 0 to pi, at the nodes, rad."""
    return np.asarray(motion.clock.psi - motion.clock.psi[:, :1])


def smooth_step(motion: Motion, instant_s: float) -> FloatArray:
    """Return a step from 0 to 1 at an instant, at the nodes of a motion.

    It takes about half a period (three tenths from 10 % to 90 %), which no free decay can
    tell from a sharper one, and so stays smooth within the half cycles.
    """
    late = motion.angular_frequency * (motion.time_s - instant_s)
    return np.asarray(0.5 + 0.5 * np.tanh(1.2 * late))


def elapsed(time_s: FloatArray) -> FloatArray:
    """Return the time since the first reading, s."""
    return np.asarray(time_s - time_s[0])


def reading_step(time_s: FloatArray, instant_s: float) -> FloatArray:
    """Return a step from 0 to 1 at an instant, at the readings; it lasts one interval."""
    interval = (time_s[-1] - time_s[0]) / max(len(time_s) - 1, 1)
    return np.asarray(np.clip((time_s - instant_s) / interval + 0.5, 0.0, 1.0))


INSTANT: Final = Parameter("time", "s", -math.inf, math.inf)


class Sudden(Effect):
    """What happens at an instant; the instant is the shape."""

    local = True
    tried: ClassVar[int]
    """Instants of the scan."""
    turn: ClassVar[float] = 0.0
    """Phase in rad between the four instants that are tried about each; 0 where one is enough."""
    refined: ClassVar[bool] = True
    """Whether a fit would get stuck between the scan's instants, so that it needs finer ones."""

    def shapes(self, span: Span) -> list[tuple[float]]:
        """Instants; where the effect depends on the phase at which it comes, at several phases."""
        later = self.turn / span.pendulum.angular_frequency
        phases = range(4 if self.turn else 1)
        return [(float(time + k * later),) for time in span.times(self.tried) for k in phases]

    def finer(self, span: Span, shape: Sequence[float]) -> list[tuple[float]]:
        """Instants from one of the scan's neighbours to the other, an eighth cycle apart."""
        if not self.refined:
            return []
        rough = span.times(self.tried)
        place = int(np.argmin(np.abs(rough - shape[0])))
        low = rough[max(place - 1, 0)]
        high = rough[min(place + 1, self.tried - 1)] + 0.5 * span.period_s
        number = min(int((high - low) / (0.125 * span.period_s)) + 2, 300)
        return [(float(time),) for time in np.linspace(low, high, number)]
