"""Motion under any law: all half cycles at once on the phase clock, by Picard iteration.

With x = r cos(psi), v = -omega r sin(psi) and x'' = -omega^2 x + f, the motion is

    d ln r/d psi = -g sin(psi)/(1 - g cos(psi)),   g = f/(omega^2 r),
    d t/d psi    = 1/(omega (1 - g cos(psi))),

and its turning points are psi = k pi. Within a half cycle the sign of the velocity is fixed,
so that f is smooth whatever the friction, and a law is a function of whole arrays: nothing is
compiled. The amplitude's equation is solved by Newton's method (a scalar linear equation,
integrated exactly), the time's by iteration, all half cycles together.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import Final

import numpy as np

from pendpipe.arrays import FloatArray

_TOLERANCE: Final = 1e-9
_ROUNDS: Final = 25
_STEP: Final = 1e-6
_STRIDE: Final = 0.7
"""Longest step in ln r."""
_STEEPEST: Final = 0.9
"""Of g cos(psi): beyond, the pendulum hardly turns, or never."""
_LARGEST: Final = 4.0
"""Of g, where it pulls back: the equilibrium is far off for so small an r."""


class NoMotionError(ArithmeticError):
    """The law stops the pendulum, or drives it away, before the end that was asked for."""


@dataclass(frozen=True)
class Clock:
    """The nodes of the phase: Chebyshev-Lobatto in each half cycle, ends included.

    Parameters
    ----------
    count
        How many half cycles.
    order
        Intervals between the nodes of one half cycle.
    """

    count: int
    order: int = 16

    @property
    def psi(self) -> FloatArray:
        """Phase of each node, shape (count, order + 1)."""
        return _phases(self.count, self.order)[0]

    @property
    def cosine(self) -> FloatArray:
        """cos(psi), shape (count, order + 1)."""
        return _phases(self.count, self.order)[1]

    @property
    def sine(self) -> FloatArray:
        """sin(psi), shape (count, order + 1); exactly zero at the turning points."""
        return _phases(self.count, self.order)[2]

    @property
    def _sign(self) -> FloatArray:
        return _phases(self.count, self.order)[3]

    def integral(self, rate: FloatArray) -> FloatArray:
        """Integrate over the phase from psi = 0; shape (..., count, order + 1) as `rate`."""
        parts = rate @ _integration(self.order).T
        parts[..., 1:, :] += np.cumsum(parts[..., :-1, -1], axis=-1)[..., None]
        return np.asarray(parts)


@lru_cache(maxsize=8)
def _phases(count: int, order: int) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Phase, cosine and sine of each node, and the sign of each half cycle; not to be written."""
    sign = np.asarray(1.0 - 2.0 * (np.arange(count) % 2)[:, None], dtype=np.float64)
    psi: FloatArray = math.pi * (np.arange(count)[:, None] + _nodes(order))
    cosine: FloatArray = sign * np.cos(math.pi * _nodes(order))
    sine = np.sin(math.pi * _nodes(order))
    sine[[0, -1]] = 0.0
    sine = np.asarray(sign * sine)
    for each in (psi, cosine, sine, sign):
        each.flags.writeable = False
    return psi, cosine, sine, sign


@lru_cache
def _nodes(order: int) -> FloatArray:
    """Chebyshev-Lobatto points on [0, 1]."""
    return np.asarray(0.5 - 0.5 * np.cos(math.pi * np.arange(order + 1) / order))


@lru_cache
def _integration(order: int) -> FloatArray:
    """The matrix that integrates from the first node to each, over a half turn."""
    # The polynomial through the values is integrated exactly; Chebyshev's basis keeps the
    # matrix well conditioned.
    from numpy.polynomial import chebyshev

    z = 2.0 * _nodes(order) - 1.0
    analysis = np.linalg.inv(chebyshev.chebvander(z, order))
    integrals = np.stack([chebyshev.chebint(column, lbnd=-1.0) for column in analysis.T], axis=1)
    return np.asarray(0.5 * math.pi * chebyshev.chebvander(z, order + 1) @ integrals)


@dataclass(frozen=True)
class Motion:
    """A motion at the nodes of its clock; all arrays of shape (half cycles, order + 1).

    Parameters
    ----------
    clock
        The nodes.
    angular_frequency
        omega of the clock, rad/s.
    log_amplitude
        ln r, r in rad.
    time_s
        When.
    upwards
        +1 where the first turning point is positive, else -1.
    """

    clock: Clock
    angular_frequency: float
    log_amplitude: FloatArray
    time_s: FloatArray
    upwards: float = 1.0

    def __post_init__(self) -> None:
        amplitude = np.exp(self.log_amplitude)
        side = self.upwards * self.clock._sign
        put = object.__setattr__
        put(self, "amplitude", amplitude)
        put(self, "angle", self.upwards * amplitude * self.clock.cosine)
        put(
            self,
            "velocity",
            -self.upwards * self.angular_frequency * amplitude * self.clock.sine,
        )
        put(self, "direction", -side)

    amplitude: FloatArray = None  # type: ignore[assignment]
    """r, rad."""
    angle: FloatArray = None  # type: ignore[assignment]
    """x, rad, from the equilibrium."""
    velocity: FloatArray = None  # type: ignore[assignment]
    """x', rad/s."""
    direction: FloatArray = None  # type: ignore[assignment]
    """Sign of the velocity in each half cycle, shape (half cycles, 1)."""

    @property
    def turning_angle(self) -> FloatArray:
        """The angle from which each half cycle started, shape (half cycles, 1)."""
        return self.angle[:, :1]


Law = Callable[[Motion], FloatArray]
"""f = x'' + omega^2 x, rad/s^2, at the nodes of a motion."""


@dataclass(frozen=True)
class Rates:
    """d ln r/d psi and dt/d psi at the nodes."""

    loss: FloatArray
    pace: FloatArray


def rates(law: Law, motion: Motion, *, largest: float | None = None) -> Rates:
    """Return the rates of a law along a given (perhaps wrong) motion.

    `largest` bounds g, and g cos(psi) where the pendulum would not turn, for a search on its way.
    """
    omega, clock = motion.angular_frequency, motion.clock
    g = motion.upwards * law(motion) / (omega * omega * motion.amplitude)
    free = 1.0 - g * clock.cosine
    if largest is not None:
        g = np.nan_to_num(np.clip(g, -largest, largest))
        least = 1.0 - _STEEPEST
        steep = 1.0 - g * clock.cosine < least
        g = np.where(steep, np.copysign(_STEEPEST, g), g)
        free = np.maximum(1.0 - g * clock.cosine, least)
    elif not np.all(np.abs(g) <= _LARGEST) or np.min(free) < 1.0 - _STEEPEST:
        raise NoMotionError("the pendulum does not turn")
    return Rates(-g * clock.sine / free, 1.0 / (omega * free))


def follow(
    law: Law, angular_frequency: float, start_rad: float, start_s: float, guess: Motion,
    reset: tuple[FloatArray, FloatArray] | None = None,
) -> Motion:  # fmt: skip
    """Solve the motion from a turning point.

    Parameters
    ----------
    law
        f = x'' + omega^2 x of a motion.
    angular_frequency
        omega, rad/s: of the clock, and of the law's linear part.
    start_rad, start_s
        The turning point from which it starts, at psi = 0.
    guess
        Where the iteration begins: another law's motion, on the wanted clock.
    reset
        Sudden changes of ln r and t at the nodes, given as what they add up to.

    Raises
    ------
    NoMotionError
        If the pendulum stops or runs away within the clock's half cycles.
    """
    clock, upwards = guess.clock, math.copysign(1.0, start_rad)
    origin = math.log(abs(start_rad))
    log_amplitude = guess.log_amplitude + (origin - guess.log_amplitude[0, 0])
    time = guess.time_s + (start_s - guess.time_s[0, 0])
    jumps, delays = (0.0, 0.0) if reset is None else reset
    motion = Motion(clock, angular_frequency, log_amplitude, time, upwards)
    steepness: FloatArray | None = None
    before = math.inf
    # Where the equilibrium is not far off, larger g are but on the way, and lead astray.
    largest = _STEEPEST
    for _ in range(_ROUNDS):
        now = rates(law, motion, largest=largest)
        if steepness is None:
            steepness = _steepness(law, motion, now, largest)
        off = origin + jumps + clock.integral(now.loss) - motion.log_amplitude
        change = np.clip(_linear(clock, steepness, off), -_STRIDE, _STRIDE)
        late = start_s + delays + clock.integral(now.pace) - motion.time_s
        error = max(float(np.max(np.abs(change))), angular_frequency * float(np.max(np.abs(late))))
        motion = Motion(
            clock, angular_frequency, motion.log_amplitude + change, motion.time_s + late, upwards
        )
        if error < _TOLERANCE:
            there = rates(law, motion)
            if np.allclose(there.pace, rates(law, motion, largest=largest).pace, rtol=1e-12):
                return motion
            largest, steepness, error = _LARGEST, None, math.inf
            before = error
            continue
        if not error < 1e3:
            break
        if error > 0.5 * before:
            steepness = None
        before = error
    raise NoMotionError("the motion can't be followed")


def _steepness(law: Law, motion: Motion, now: Rates, largest: float) -> FloatArray:
    """Derivative of d ln r/d psi by ln r."""
    moved = Motion(
        motion.clock, motion.angular_frequency, motion.log_amplitude + _STEP, motion.time_s,
        motion.upwards,
    )  # fmt: skip
    return np.asarray((rates(law, moved, largest=largest).loss - now.loss) / _STEP)


def _linear(clock: Clock, steepness: FloatArray, source: FloatArray) -> FloatArray:
    """Solve y = source + integral of (steepness y) over the phase."""
    growth = clock.integral(steepness)
    return np.asarray(
        source + np.exp(growth) * clock.integral(np.exp(-growth) * steepness * source)
    )


class Tangent:
    """What small changes of a law do to its motion.

    Parameters
    ----------
    law, motion
        The law and its motion (`follow`).
    """

    def __init__(self, law: Law, motion: Motion) -> None:
        self.motion, self.rates = motion, rates(law, motion)
        moved = Motion(
            motion.clock, motion.angular_frequency, motion.log_amplitude + _STEP, motion.time_s,
            motion.upwards,
        )  # fmt: skip
        other = rates(law, moved)
        self._steepness = (other.loss - self.rates.loss) / _STEP
        self._pace = (other.pace - self.rates.pace) / _STEP
        growth = motion.clock.integral(self._steepness)
        self._grown, self._shrunk = np.exp(growth), np.exp(-growth)

    def of_start(self) -> tuple[FloatArray, FloatArray]:
        """Change of ln r and t by ln r at the start."""
        by_log = self._grown.copy()
        return by_log, self.motion.clock.integral(self._pace * by_log)

    def of_rates(self, loss: FloatArray, pace: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Change of ln r and t at fixed phase by a change of the rates."""
        clock = self.motion.clock
        by_log = clock.integral(self._shrunk * loss)
        by_log *= self._grown
        by_time = self._pace * by_log
        by_time += pace
        return by_log, clock.integral(by_time)

    def of_force(self, acceleration: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Change of ln r and t at fixed phase by a small extra acceleration (rad/s^2)."""
        motion = self.motion
        omega = motion.angular_frequency
        # g/(1 - g0 cos psi)^2, by psi and by t; the pace is 1/(omega (1 - g0 cos psi)).
        scaled = acceleration * (motion.upwards * self.rates.pace**2 / motion.amplitude)
        return self.of_rates(-motion.clock.sine * scaled, (motion.clock.cosine / omega) * scaled)

    def of_reset(self, by_log: FloatArray, by_time: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Change of ln r and t by sudden changes of them, given as what they add up to."""
        grown = _linear(self.motion.clock, self._steepness, by_log)
        return grown, by_time + self.motion.clock.integral(self._pace * grown)
