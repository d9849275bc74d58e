"""Motion under any law: all half cycles at once on the phase clock, by Picard iteration.

With x = r cos(psi), v = -omega r sin(psi) and x'' = -omega^2 x + f, the motion is

    d ln r/d psi = -g sin(psi)/(1 - g cos(psi)),   g = f/(omega^2 r),
    d t/d psi    = 1/(omega (1 - g cos(psi))),

and its turning points are psi = k pi. Within a half cycle the sign of the velocity is fixed,
so that f is smooth whatever the friction, and a law is a function of whole arrays: it need not be
compiled. Both equations are solved by Newton's method, all half cycles together: a change of
ln r obeys a scalar linear equation, which is integrated exactly, and gives that of t. The motion
is read at given times by what is slow in it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import Final, NamedTuple

import numpy as np
from numpy.polynomial import chebyshev

from pendpipe.arrays import FloatArray, IntArray
from pendpipe.dynamics.chebyshev import analysis, lobatto_integration, lobatto_nodes
from pendpipe.dynamics.kernel import Matrix, kernel


@dataclass(frozen=True)
class Clock:
    """The nodes of the phase: Chebyshev-Lobatto in each half cycle, ends included.

    Parameters
    ----------
    count
        How many half cycles.
    order
        Intervals between the nodes of one half cycle.
    every
        Of so many cycles, an odd number, the middle one has nodes and stands for all.
    """

    count: int
    order: int = 16
    every: int = 1

    @property
    def half_cycles(self) -> IntArray:
        """Numbers of the half cycles with nodes, shape (rows,)."""
        numbers: IntArray = np.arange(self.count)
        if self.every == 1:
            return numbers
        cycle, whole = numbers // 2, self.count // 2 // self.every * self.every
        return np.asarray(numbers[(cycle < whole) & (cycle % self.every == self.every // 2)])

    @property
    def psi(self) -> FloatArray:
        """Phase of each node, shape (rows, order + 1)."""
        return _phases(self)[0]

    @property
    def cosine(self) -> FloatArray:
        """cos(psi), shape (rows, order + 1)."""
        return _phases(self)[1]

    @property
    def sine(self) -> FloatArray:
        """sin(psi), shape (rows, order + 1); exactly zero at the turning points."""
        return _phases(self)[2]

    @property
    def side(self) -> FloatArray:
        """+1 and -1 in turn: the side of the turning point that begins each half cycle."""
        return _phases(self)[3]

    def derivative(self, values: FloatArray) -> FloatArray:
        """Differentiate by the phase within each half cycle; shape as `values`."""
        return np.asarray(values @ _differentiation(self.order).T)

    def integral(self, rate: FloatArray) -> FloatArray:
        """Integrate over the phase from psi = 0; shape (..., rows, order + 1) as `rate`."""
        parts = rate @ _integration(self.order).T
        if self.every == 1:
            parts[..., 1:, :] += np.cumsum(parts[..., :-1, -1], axis=-1)[..., None]
            return np.asarray(parts)
        first = parts[..., ::2, -1].copy()
        cycle = first + parts[..., 1::2, -1]
        before = self.every * (np.cumsum(cycle, axis=-1) - cycle) + self.every // 2 * cycle
        parts[..., ::2, :] += before[..., None]
        parts[..., 1::2, :] += (before + first)[..., None]
        return np.asarray(parts)


@lru_cache(maxsize=8)
def _phases(clock: Clock) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Phase, cosine and sine of each node, and the sign of each half cycle; not to be written."""
    numbers, nodes = clock.half_cycles[:, None], _nodes(clock.order)
    sign = np.asarray(1.0 - 2.0 * (numbers % 2), dtype=np.float64)
    psi: FloatArray = math.pi * (numbers + nodes)
    cosine: FloatArray = sign * np.cos(math.pi * nodes)
    sine = np.sin(math.pi * nodes)
    sine[[0, -1]] = 0.0
    sine = np.asarray(sign * sine)
    for each in (psi, cosine, sine, sign):
        each.flags.writeable = False
    return psi, cosine, sine, sign


@lru_cache
def _nodes(order: int) -> FloatArray:
    """Chebyshev-Lobatto points on [0, 1]."""
    return np.asarray(0.5 + 0.5 * lobatto_nodes(order))


@lru_cache
def _integration(order: int) -> FloatArray:
    """The matrix that integrates from the first node to each, over a half turn."""
    return np.asarray(0.5 * math.pi * lobatto_integration(order))


@lru_cache
def _differentiation(order: int) -> FloatArray:
    """The matrix that differentiates at the nodes, over a half turn."""
    nodes = lobatto_nodes(order)
    slopes = chebyshev.chebder(analysis(nodes))
    return np.asarray(2.0 / math.pi * chebyshev.chebvander(nodes, order - 1) @ slopes)


_TOLERANCE: Final = 1e-9
"""Change of ln r and of the phase at which a solution has settled: ten errors of Eq. 8's."""
_SETTLED: Final = 1e-6
"""Change of a half cycle that will move it no further."""
_PATIENCE, _STILL_OFF = 5, 0.1
"""Rounds that one half cycle may take to come so near, once all before it are settled."""
_ROUNDS: Final = 25
"""Picard's iterations at most."""
_STEP: Final = 1e-6
"""Of ln r in a numerical derivative: its error is 1e-6 of it, that of the rounding 1e-10."""
_LOST: Final = 1e3
"""Of ln r, or rad: an iteration that goes so far does not come back; nor does one that is NaN."""
_STRIDE: Final = 0.7
"""Longest step in ln r."""
_STEEPEST: Final = 0.97
"""Of g cos(psi): beyond, the pendulum hardly turns, or never."""
_LARGEST: Final = 4.0
"""Of g, where it pulls back: the equilibrium is far off for so small an r."""


class NoMotionError(ArithmeticError):
    """The law stops the pendulum, or drives it away, before the end that was asked for."""


class StopsError(NoMotionError):
    """It stops there, wherever the iteration began."""


class Slopes(NamedTuple):
    """How the rates change with ln r, at a motion."""

    by_log: FloatArray
    """d ln r/d psi by ln r, over `grown`."""
    by_time: FloatArray
    """dt/d psi by ln r."""
    grown: FloatArray
    """What a change of ln r at the start has grown to."""


@dataclass(frozen=True)
class Motion:
    """A motion at the nodes of its clock; all arrays of shape (half cycles, order + 1).

    A law is a function of its `angle` x, `velocity` x', `amplitude` r, `direction` and `time_s`.

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
    slopes
        At a motion near it.
    """

    clock: Clock
    angular_frequency: float
    log_amplitude: FloatArray
    time_s: FloatArray
    upwards: float = 1.0
    slopes: Slopes | None = None

    @cached_property
    def amplitude(self) -> FloatArray:
        """r, rad."""
        return np.exp(self.log_amplitude)

    @cached_property
    def angle(self) -> FloatArray:
        """x, rad, from the equilibrium."""
        return self.upwards * self.amplitude * self.clock.cosine

    @cached_property
    def velocity(self) -> FloatArray:
        """x', rad/s."""
        return -self.upwards * self.angular_frequency * self.amplitude * self.clock.sine

    def thinned(self, every: int) -> Motion:
        """The same with one cycle of `every`, which stands for all: where they change slowly."""
        clock = replace(self.clock, every=every)
        rows = clock.half_cycles
        log_amplitude, time_s = self.log_amplitude[rows], self.time_s[rows]
        return Motion(clock, self.angular_frequency, log_amplitude, time_s, self.upwards)

    @property
    def direction(self) -> FloatArray:
        """Sign of the velocity in each half cycle, shape (half cycles, 1)."""
        return -self.upwards * self.clock.side

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
    pull: FloatArray
    """g = f/(omega^2 r) of the law, without a bound."""


def rates(law: Law, motion: Motion, largest: float = _LARGEST) -> Rates:
    """Return the rates of a law along a motion, with g bounded by `largest`.

    So they are finite along a motion that is wrong: for a search on its way, and after the time
    until which a motion was followed.
    """
    omega, _, cosine, sine, _ = motion.angular_frequency, *_phases(motion.clock)
    pull = np.asarray(motion.upwards * law(motion) / (omega * omega * motion.amplitude))
    g = np.clip(np.where(np.isnan(pull), 0.0, pull), -largest, largest)
    steep = g * cosine > _STEEPEST
    if steep.any():
        g = np.where(steep, np.copysign(_STEEPEST, g), g)
    free = 1.0 - g * cosine
    return Rates(-g * sine / free, 1.0 / (omega * free), pull)


def follow(
    law: Law,
    angular_frequency: float,
    start_rad: float,
    start_s: float,
    guess: Motion,
    reset: tuple[FloatArray, FloatArray] | None = None,
    until_s: float = math.inf,
) -> Motion:
    """Solve the motion from a turning point.

    A half cycle depends on those before it alone, so that what the iteration makes of those after
    `until_s` is of no consequence.

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
    until_s
        When the motion may end; by default it is that of all the clock's half cycles.

    Raises
    ------
    NoMotionError
        If the pendulum stops or runs away before.
    """
    clock, upwards = guess.clock, math.copysign(1.0, start_rad)
    origin = math.log(abs(start_rad))
    log_amplitude = guess.log_amplitude + (origin - guess.log_amplitude[0, 0])
    time = guess.time_s + (start_s - guess.time_s[0, 0])
    motion = Motion(clock, angular_frequency, log_amplitude, time, upwards, guess.slopes)
    jumps, delays = (0.0, 0.0) if reset is None else reset
    # Larger g are but on the way, and lead astray, unless the equilibrium is far off.
    for largest in (_STEEPEST, _LARGEST):
        motion, pull = _solved(law, motion, origin + jumps, start_s + delays, largest, until_s)
        g = pull[: _followed(motion, until_s)]
        if np.all(np.abs(g) <= largest):
            break
    if not np.all(np.abs(g) <= _LARGEST) or np.max(g * clock.cosine[: len(g)]) > _STEEPEST:
        raise NoMotionError("the pendulum does not turn")
    return motion


def _followed(motion: Motion, until_s: float) -> int:
    """How many half cycles begin before a time; those after it may be in any order."""
    after = np.append(motion.time_s[:-1, -1] >= until_s, True)
    return int(np.argmax(after)) + 1


def _solved(
    law: Law,
    motion: Motion,
    log_start: FloatArray | float,
    start_s: FloatArray | float,
    largest: float,
    until_s: float,
) -> tuple[Motion, FloatArray]:
    """Iterate a motion until it is that of the law with bounded g; or until that stops it.

    Returns
    -------
    motion, pull
        The motion, and G of the law along it without the bound; beyond any bound where it stops.
    """
    clock, omega = motion.clock, motion.angular_frequency
    before, front, waits = math.inf, -1, 0
    for _ in range(_ROUNDS):
        now = rates(law, motion, largest)
        slopes = motion.slopes or _slopes(law, motion, now, largest)
        # The change y of ln r is off, and the integral of its slope times y.
        off = log_start + clock.integral(now.loss) - motion.log_amplitude
        change = off + slopes.grown * clock.integral(slopes.by_log * off)
        change = np.clip(change, -_STRIDE, _STRIDE, out=change)
        late = start_s + clock.integral(now.pace + slopes.by_time * change) - motion.time_s
        errors = np.maximum(np.abs(change), omega * np.abs(late)).max(axis=1)
        errors = errors[: _followed(motion, until_s)]
        error = float(np.max(errors))
        change += motion.log_amplitude
        late += motion.time_s
        motion = Motion(clock, omega, change, late, motion.upwards, slopes)
        # The next change will be smaller by what this one is smaller than the last; with slopes of
        # a motion near it, hardly by more than ten.
        smaller = min(max(error / before, 0.1), 1.0) if before < math.inf else 1.0
        if error * smaller < _TOLERANCE:
            return motion, now.pull
        # Half cycles before the first that still changes will change no more.
        last, front = front, int(np.argmax(errors > _SETTLED))
        waits = waits + 1 if front == last else 0
        stuck = waits >= _PATIENCE and errors[front] > _STILL_OFF
        if stuck or np.any((now.pull * clock.cosine)[:front] > _STEEPEST):
            if largest == _LARGEST:
                raise StopsError("the pendulum stops")
            return motion, np.full_like(now.pull, np.inf)
        if not error < _LOST:
            break
        if error > 0.5 * before:
            motion = replace(motion, slopes=None)
        before = error
    raise NoMotionError("the motion can't be followed")


def _slopes(law: Law, motion: Motion, now: Rates, largest: float = _LARGEST) -> Slopes:
    """Return how the rates change with ln r, by differences."""
    larger = replace(motion, log_amplitude=motion.log_amplitude + _STEP)
    more = rates(law, larger, largest)
    by_log = (more.loss - now.loss) / _STEP
    grown = np.exp(motion.clock.integral(by_log))
    return Slopes(by_log / grown, (more.pace - now.pace) / _STEP, grown)


class Tangent:
    """What small changes of a law do to its motion.

    Parameters
    ----------
    law, motion
        The law and its motion (`follow`).
    """

    def __init__(self, law: Law, motion: Motion) -> None:
        self.motion, self._law = motion, law

    @cached_property
    def force(self) -> FloatArray:
        """What the law says along the motion, f."""
        return self._law(self.motion)

    @cached_property
    def rates(self) -> Rates:
        """The rates of the law along the motion."""
        return rates(lambda _: self.force, self.motion)

    @cached_property
    def _slopes(self) -> Slopes:
        return _slopes(self._law, self.motion, self.rates)

    def of_start(self) -> tuple[FloatArray, FloatArray]:
        """Change of ln r and t by ln r at the start."""
        by_log = self._slopes.grown.copy()
        return by_log, self.motion.clock.integral(self._slopes.by_time * by_log)

    def of_rates(self, loss: FloatArray, pace: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Change of ln r and t at fixed phase by a change of the rates."""
        clock = self.motion.clock
        by_log = clock.integral(loss / self._slopes.grown)
        by_log *= self._slopes.grown
        by_time = self._slopes.by_time * by_log
        by_time += pace
        return by_log, clock.integral(by_time)

    def of_force(self, acceleration: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Change of ln r and t at fixed phase by a small extra acceleration (rad/s^2)."""
        motion = self.motion
        omega = motion.angular_frequency
        # g/(1 - g0 cos psi)^2, by psi and by t; the pace is 1/(omega (1 - g0 cos psi)).
        scaled = acceleration * (motion.upwards * self.rates.pace**2 / motion.amplitude)
        return self.of_rates(-motion.clock.sine * scaled, (motion.clock.cosine / omega) * scaled)


_POINTS: Final = 6
"""Neighbouring nodes that a value is interpolated from."""
_FINER: Final = 3
"""Nodes that are interpolated from, over those of the motion."""


def _at_finer(values: FloatArray) -> FloatArray:
    """Read the polynomial of each half cycle at more nodes, shape (..., count, nodes)."""
    return np.asarray(values @ _to_finer(values.shape[-1] - 1))


@lru_cache
def _to_finer(order: int) -> FloatArray:
    finer = chebyshev.chebvander(lobatto_nodes(_FINER * order), order)
    return np.ascontiguousarray((finer @ analysis(lobatto_nodes(order))).T)


@dataclass(frozen=True)
class Sampled:
    """A motion at given times; arrays of shape (n,).

    Parameters
    ----------
    motion
        What was sampled.
    time_s, phase, amplitude
        Times, psi and r.
    """

    motion: Motion
    time_s: FloatArray
    phase: FloatArray
    amplitude: FloatArray
    cosine: FloatArray
    sine: FloatArray
    _first: IntArray
    _weights: FloatArray
    _slope: FloatArray | None = None

    @property
    def angle(self) -> FloatArray:
        """x, rad, from the equilibrium."""
        return self.motion.upwards * self.amplitude * self.cosine

    @property
    def velocity(self) -> FloatArray:
        """x', rad/s."""
        if self._slope is not None:
            return self._slope
        omega = self.motion.angular_frequency
        return -self.motion.upwards * omega * self.amplitude * self.sine

    @property
    def direction(self) -> FloatArray:
        """Sign of the velocity."""
        return np.asarray(np.where(self.motion.upwards * self.sine > 0.0, -1.0, 1.0))

    def as_rate(self, acceleration: FloatArray) -> Sampled:
        """Return what a gyroscope sees: x' in the place of x, and x'' in that of x'.

        -omega r sin(psi) is omega r cos(psi + pi/2). `acceleration` is x'' at the readings.
        """
        return replace(
            self,
            phase=self.phase + 0.5 * math.pi,
            amplitude=self.motion.angular_frequency * self.amplitude,
            cosine=-self.sine,
            sine=self.cosine,
            _slope=acceleration,
        )

    @property
    def half_cycle(self) -> IntArray:
        """The row of the motion that each time lies in, shape (n,)."""
        return np.asarray(self._first // (_FINER * self.motion.clock.order + 1))

    def thinned(self, motion: Motion, rows: IntArray) -> Sampled:
        """Return some of the readings, on a thinned motion (`Motion.thinned`) with their cycles."""
        half, length = self.half_cycle[rows], _FINER * motion.clock.order + 1
        row = np.searchsorted(motion.clock.half_cycles, half)
        return replace(
            self,
            motion=motion,
            time_s=self.time_s[rows],
            phase=self.phase[rows],
            amplitude=self.amplitude[rows],
            cosine=self.cosine[rows],
            sine=self.sine[rows],
            _first=self._first[rows] + (row - half) * length,
            _weights=np.ascontiguousarray(self._weights[:, rows]),
            _slope=None if self._slope is None else self._slope[rows],
        )

    def at_nodes(self, values: FloatArray) -> FloatArray:
        """Interpolate what is known at the motion's nodes, shape (..., rows, order + 1)."""
        return interpolated(values, self._first, self._weights)

    def moved(self, by_log: FloatArray, by_time: FloatArray) -> Sampled:
        """Return a motion with slightly other ln r and t at fixed phase, at the same times."""
        motion = self.motion
        moved = replace(
            motion, log_amplitude=motion.log_amplitude + by_log, time_s=motion.time_s + by_time
        )
        phase = self.phase - motion.angular_frequency * self.at_nodes(by_time)
        amplitude = self.amplitude * np.exp(self.at_nodes(by_log))
        cosine, sine = np.cos(phase), np.sin(phase)
        return replace(
            self, motion=moved, phase=phase, amplitude=amplitude, cosine=cosine, sine=sine
        )

    def change(self, by_log: FloatArray, by_time: FloatArray) -> FloatArray:
        """Change of the angle, rad, from changes of ln r and of t at fixed phase."""
        return np.asarray(
            self.angle * self.at_nodes(by_log) - self.velocity * self.at_nodes(by_time)
        )


def sample_motion(motion: Motion, time_s: FloatArray) -> Sampled:
    """Read a motion at times within its clock.

    psi - omega t and ln r are slow; each is interpolated by the polynomial through six
    neighbouring nodes of its half cycle, close enough for 3e-7 of the motion.
    """
    length = _FINER * motion.clock.order + 1
    nodes = _at_finer(motion.time_s)
    # Half cycles after the time up to which it was followed may go back in time.
    behind = np.searchsorted(np.maximum.accumulate(nodes.reshape(-1)), time_s)
    half = np.clip((behind - 1) // length, 0, len(nodes) - 1)
    left = np.clip(behind - half * length - _POINTS // 2, 0, length - _POINTS)
    first = (half * length + left).astype(np.intp)
    weights = lagrange(nodes.reshape(-1), first, time_s)
    omega, start_s = motion.angular_frequency, motion.time_s[0, 0]
    slow = motion.clock.psi - omega * (motion.time_s - start_s)
    late, log_amplitude = interpolated(np.stack([slow, motion.log_amplitude]), first, weights)
    phase = omega * (time_s - start_s) + late
    return Sampled(
        motion, time_s, phase, np.exp(log_amplitude), np.cos(phase), np.sin(phase), first, weights
    )


def sample_pieces(pieces: Sequence[tuple[float, Motion]], time_s: FloatArray) -> Sampled:
    """Read motions on one clock, each from its time on (the first from ever)."""
    if len(pieces) == 1:
        return sample_motion(pieces[0][1], time_s)
    starts = np.array([start for start, _ in pieces[1:]])
    which = np.searchsorted(starts, time_s)
    parts = [
        (which == index, sample_motion(motion, time_s[which == index]))
        for index, (_, motion) in enumerate(pieces)
    ]

    def joined(name: str) -> FloatArray:
        whole = np.empty((*getattr(parts[0][1], name).shape[:-1], len(time_s)))
        for here, part in parts:
            whole[..., here] = getattr(part, name)
        return whole

    first = np.rint(joined("_first")).astype(np.intp)
    return Sampled(
        pieces[-1][1],
        time_s,
        joined("phase"),
        joined("amplitude"),
        joined("cosine"),
        joined("sine"),
        first,
        joined("_weights"),
    )


def interpolated(values: FloatArray, first: IntArray, weights: FloatArray) -> FloatArray:
    """Interpolate what is known at the nodes, shape (..., rows, order + 1), by six finer ones."""
    flat = values.reshape(-1, *values.shape[-2:])
    found = np.empty((len(flat), len(first)))
    _interpolate(_at_finer(flat).reshape(len(flat), -1), first, weights, found)
    return found.reshape(*values.shape[:-2], -1)


def _all_interpolated(nodes: Matrix, first: IntArray, weights: Matrix, found: Matrix) -> None:
    near = first + np.arange(_POINTS)[:, None]
    for row, out in zip(nodes, found, strict=True):
        np.einsum("pn,pn->n", row.take(near, mode="clip"), weights, out=out)


@kernel(arrays=_all_interpolated)
def _interpolate(nodes: Matrix, first: IntArray, weights: Matrix, found: Matrix) -> None:
    """Interpolate each row of `nodes` by six of them from `first` on."""
    last = nodes.shape[1] - 1
    for row in range(nodes.shape[0]):
        for i in range(first.size):
            total = 0.0
            for p in range(_POINTS):
                total += nodes[row, min(first[i] + p, last)] * weights[p, i]
            found[row, i] = total


def lagrange(nodes: FloatArray, first: IntArray, time_s: FloatArray) -> FloatArray:
    """Weights of the six nodes from `first` on at each time, shape (6, n).

    The nodes at the ends of a motion lie close together: beyond, only three are used.
    """
    weights = np.empty((_POINTS, len(time_s)))
    _weigh(nodes, first, np.ascontiguousarray(time_s), weights)
    return weights


def _all_weighed(nodes: FloatArray, first: IntArray, time_s: FloatArray, weights: Matrix) -> None:
    half = _POINTS // 2
    for part, points in (
        (slice(None), range(_POINTS)),
        (time_s < nodes[0], range(half)),
        (time_s > nodes[-1], range(half, _POINTS)),
    ):
        near, at = nodes[first[part] + np.arange(_POINTS)[:, None]], time_s[part]
        for own in range(_POINTS):
            others = [near[k] for k in points if k != own]
            shares = (((at - other) / (near[own] - other)) for other in others)
            weights[own, part] = math.prod(shares) if own in points else 0.0


@kernel(arrays=_all_weighed)
def _weigh(nodes: FloatArray, first: IntArray, time_s: FloatArray, weights: Matrix) -> None:
    """Write Lagrange's weights."""
    half, last = _POINTS // 2, nodes.size - 1
    for i in range(time_s.size):
        at, start = time_s[i], first[i]
        low, high = half if at > nodes[last] else 0, half if at < nodes[0] else _POINTS
        for own in range(_POINTS):
            over, under = 1.0 if low <= own < high else 0.0, 1.0
            for other in range(low, high):
                if other != own:
                    over *= at - nodes[start + other]
                    under *= nodes[start + own] - nodes[start + other]
            weights[own, i] = over / under
