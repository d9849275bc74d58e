"""The baseline and any effects of the catalogue, as one model of the readings."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Final, Self

import numpy as np

from pendpipe.arrays import FloatArray
from pendpipe.dynamics.any_law import Clock, Law, Motion, NoMotionError, Tangent, follow
from pendpipe.dynamics.sampling import Sampled, sample_motion, sample_pieces
from pendpipe.effects.baseline import (
    BASELINE,
    HIGH,
    LOW,
    OFFSET,
    OMEGA,
    START,
    TIME,
    B,
    closed_form,
    held_indices,
    pendulum_of,
    with_parts,
)
from pendpipe.effects.effect import Effect, Kick, Pendulum, Span

if TYPE_CHECKING:
    from pendpipe.effects.stack import Part


@dataclass(frozen=True)
class Evaluated:
    """A model at given values."""

    reading: FloatArray
    sampled: Sampled
    tangent: Tangent
    span: Span
    parts: tuple[Part, ...] = ()
    """Of a `pendpipe.effects.stack.Stack`: its recordings."""

    @cached_property
    def _start(self) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Change of ln r and of t by ln r at the start: at the nodes, and at the readings."""
        by_log, by_time = self.tangent.of_start()
        at_readings = self.sampled.at_nodes(np.stack([by_log, by_time]))
        return by_log, by_time, at_readings[0], at_readings[1]

    def by_start(self) -> FloatArray:
        """Change of the readings by ln r at the start."""
        _, _, by_log, by_time = self._start
        return np.asarray(self.sampled.angle * by_log - self.sampled.velocity * by_time)

    def after_kicks(self, kicks: Sequence[Kick | None]) -> FloatArray:
        """Change of the readings by each of several small kicks, shape (kicks, n)."""
        change = np.zeros((len(kicks), len(self.reading)))
        rows = [row for row, kick in enumerate(kicks) if kick is not None and kick.acts]
        acting = [kick for kick in kicks if kick is not None and kick.acts]
        if not acting:
            return change
        instants = np.array([kick.time_s for kick in acting])
        there = sample_motion(self.tangent.motion, instants)
        log, late = kick_sizes(there, acting, there)
        node_log, node_time, by_log, by_time = self._start
        then_log, then_time = there.at_nodes(np.stack([node_log, node_time]))
        scale = log / then_log
        sampled = self.sampled
        first = np.searchsorted(sampled.time_s, instants, side="right")
        angle, velocity = sampled.angle, sampled.velocity
        grown, slowed = angle * by_log, velocity * by_time
        for row, start, size, moved, rest in zip(
            rows, first, scale, late, then_time * scale, strict=True
        ):
            # Nothing before the instant.
            change[row, start:] = size * (grown[start:] - slowed[start:])
            change[row, start:] -= (moved - rest) * velocity[start:]
        return change


def kick_sizes(
    before: Sampled, kicks: Sequence[Kick], now: Sampled
) -> tuple[FloatArray, FloatArray]:
    """What a motion still lacks, in ln r and in t at fixed phase, to be the kicked one.

    `before` is the unkicked motion at each kick's instant, `now` the motion as it is.
    """
    omega = now.motion.angular_frequency
    angle, velocity, grown = np.array(
        [(kick.angle, kick.velocity, kick.log_amplitude) for kick in kicks]
    ).T
    x, v = now.angle, now.velocity / omega
    new_x, new_v = before.angle + angle, (before.velocity + velocity) / omega
    by_log = grown + 0.5 * np.log((new_x**2 + new_v**2) / (x**2 + v**2))
    turned = np.arctan2(-new_v, new_x) - np.arctan2(-v, x)
    turned -= 2.0 * math.pi * np.round(turned / (2.0 * math.pi))
    return by_log, -turned / omega


_MORE: Final = (1.0, 1.02, 1.12, 1.28)
"""Half cycles that are tried, over those that omega makes: a pendulum may be quicker."""


@dataclass(frozen=True)
class Model:
    """Eq. 8 with effects.

    Parameters
    ----------
    time_s
        When the readings were taken, shape (n,).
    interval_s
        Between them, usually.
    effects
        What is added; their values follow the baseline's in the vector of parameters.
    order
        Intervals between the nodes of a half cycle.
    half_cycles
        How many are followed; None for as many as the readings may need, and some more.
    fold
        How many readings each is the mean of, `interval_s` apart.
    first_s
        When the first reading was taken, where the start is a virtual turning point before the
        release: the pendulum was let go at the last turning point before it. By default, at
        the start.
    parts
        The parts of b that are held (``"hysteretic"``, ``"viscous"``), with their rates in 1/s.
    """

    time_s: FloatArray
    interval_s: float
    effects: tuple[Effect, ...] = ()
    order: int = 14
    half_cycles: int | None = None
    fold: int = 1
    first_s: float = -math.inf
    parts: Mapping[str, float] = field(default_factory=dict)
    _last: dict[str, Motion] = field(default_factory=dict, repr=False, compare=False)

    @property
    def first(self) -> int:
        """Where the values of effects begin."""
        return len(BASELINE)

    def admitted(self, effects: Sequence[Effect]) -> Sequence[Effect]:
        """Return the effects that may be added; in one recording, all."""
        return effects

    def adding(self, effect: Effect) -> Self:
        """The same with one effect more."""
        return replace(self, effects=(*self.effects, effect), _last=dict(self._last))

    def dropping(self, effect: Effect, value: FloatArray) -> tuple[Self, FloatArray]:
        """The same without one effect (if it is in it), and the values that are left."""
        others = [(other, place) for other, place in self.places() if other is not effect]
        kept = [value[: self.first], *(value[place] for _, place in others)]
        effects = tuple(other for other, _ in others)
        return replace(self, effects=effects, _last=dict(self._last)), np.concatenate(kept)

    def at_times(self, time_s: FloatArray) -> Self:
        """The same for readings at other times."""
        return replace(self, time_s=time_s, _last={})

    def bare(self) -> Self:
        """The baseline alone."""
        return replace(self, effects=(), _last={})

    def over(self, half_cycles: int) -> Model:
        """The same, followed over so many half cycles."""
        return replace(self, half_cycles=half_cycles, _last={})

    @property
    def size(self) -> int:
        """Number of values."""
        return self.first + sum(effect.count for effect in self.effects)

    def places(self) -> list[tuple[Effect, slice]]:
        """Each effect with the place of its values."""
        found, first = [], self.first
        for effect in self.effects:
            found.append((effect, slice(first, first + effect.count)))
            first += effect.count
        return found

    def bounds(self) -> tuple[FloatArray, FloatArray]:
        """Lowest and highest values."""
        low, high = list(LOW), list(HIGH)
        low[B] = sum(self.held_parts().values())
        duration = float(self.time_s[-1] - self.time_s[0])
        for effect in self.effects:
            for lowest, highest in effect.bounds(duration):
                low.append(lowest)
                high.append(highest)
        return np.array(low), np.array(high)

    def held(self) -> list[int]:
        """Indices that are never fitted: sizes of switches, and what held parts of b settle."""
        switches = [place.start for effect, place in self.places() if effect.parameter_free]
        return [*switches, *held_indices(self.held_parts())]

    def held_parts(self) -> dict[str, float]:
        """The parts of b that are held, without those that an effect sets free."""
        free = {effect.frees for effect in self.effects}
        return {part: rate for part, rate in self.parts.items() if part not in free}

    def settled(self, value: FloatArray) -> FloatArray:
        """The values with what follows from held parts of b."""
        return with_parts(value, self.held_parts())

    def pendulum(self, value: FloatArray) -> Pendulum:
        """The baseline's constants, and when the first reading was taken."""
        return replace(pendulum_of(value), first_s=self.first_s)

    def span(self, value: FloatArray, sampled: Sampled) -> Span:
        """What the scans of effects must know."""
        return Span(
            float(self.time_s[0]),
            float(self.time_s[-1]),
            self.interval_s,
            self.pendulum(value),
            float(sampled.amplitude[0]),
            float(sampled.amplitude[-1]),
            float(value[OFFSET]),
            self.fold,
        )

    def acceleration(self, motion: Motion, value: FloatArray) -> FloatArray:
        """Return x'' + omega^2 x of the baseline and of all effects."""
        pendulum = self.pendulum(value)
        total = pendulum.acceleration(motion)
        for effect, place in self.places():
            extra = effect.acceleration(motion, pendulum, value[place])
            if extra is not None:
                total = total + extra
        return total

    def follow(self, value: FloatArray) -> list[tuple[float, Motion]]:
        """Solve the motion: from the start, and anew from each kick on, on one clock.

        Raises
        ------
        NoMotionError
            If it stops, or runs away, before the last reading.
        """
        omega, start, begin = float(value[OMEGA]), float(value[START]), float(value[TIME])
        law: Law = lambda m: self.acceleration(m, value)  # noqa: E731
        motion = self._smooth(law, value)
        self._last["motion"] = motion
        pieces = [(-math.inf, motion)]
        by_log, by_time = np.zeros_like(motion.time_s), np.zeros_like(motion.time_s)
        for kick in self._kicks(value):
            before = sample_motion(motion, np.array([kick.time_s]))
            # It takes effect before the instant, so that what follows is smooth there.
            whole = max(int(before.phase[0] // math.pi) - 1, 0)
            for _ in range(2):
                log, late = kick_sizes(before, [kick], sample_motion(motion, before.time_s))
                by_log[whole:] += log[0]
                by_time[whole:] += late[0]
                motion = follow(law, omega, start, begin, motion, (by_log, by_time))
            pieces.append((kick.time_s, motion))
        return pieces

    @property
    def _nodes(self) -> int:
        return max([self.order, *(effect.nodes for effect in self.effects)])

    def _kicks(self, value: FloatArray) -> list[Kick]:
        """The sudden changes within the record, as they come."""
        kicks = [effect.kick(value[place]) for effect, place in self.places()]
        inside = [k for k in kicks if k is not None and value[TIME] < k.time_s < self.time_s[-1]]
        return sorted(inside, key=lambda kick: kick.time_s)

    def _smooth(self, law: Law, value: FloatArray) -> Motion:
        """The motion without kicks, on as many half cycles as it takes, and hardly more.

        More would ask for motion beyond the stop.
        """
        if self.half_cycles is not None:
            return self._from_guesses(law, value, Clock(self.half_cycles, self._nodes))
        omega, begin = float(value[OMEGA]), float(value[TIME])
        needed = (self.time_s[-1] - begin) * omega / math.pi
        if not 1.0 <= needed < 2e5:
            raise NoMotionError("the frequency is out of reach")
        last = self._last.get("motion")
        known = [] if last is None else [last.clock.count]
        stops = math.inf
        for count in [*known, *(math.ceil(needed * more) + 1 for more in _MORE)]:
            if not needed - 1.0 < count < min(1.3 * needed + 4.0, stops):
                continue
            clock = Clock(count, self._nodes)
            try:
                motion = self._from_guesses(law, value, clock)
            except NoMotionError:
                # So many half cycles are too many; fewer may do.
                stops = count
                continue
            if motion.time_s[-1, -1] >= self.time_s[-1]:
                return motion
        raise NoMotionError("it stops, or the frequency is out of reach")

    def _from_guesses(self, law: Law, value: FloatArray, clock: Clock) -> Motion:
        """Begin with the last motion, if it was on this clock; else with the closed form."""
        start = (float(value[OMEGA]), float(value[START]), float(value[TIME]))
        last = self._last.get("motion")
        if last is not None and last.clock == clock:
            try:
                return follow(law, *start, last)
            except NoMotionError:
                pass
        return follow(law, *start, closed_form(value, clock))

    def evaluate(self, value: FloatArray) -> Evaluated:
        """Return readings, and what the derivatives need."""
        pieces = self.follow(value)
        motion = pieces[-1][1]
        sampled = sample_pieces(pieces, self.taken_at(value))
        turned = sampled.phase[[0, -1]]
        if not np.all(np.isfinite(sampled.phase)) or np.ptp(turned) > 4.0 * np.pi * len(
            motion.time_s
        ):
            raise NoMotionError("the readings' clock is out of reach")
        tangent = Tangent(lambda m: self.acceleration(m, value), motion)
        return Evaluated(self.read(sampled, value), sampled, tangent, self.span(value, sampled))

    def taken_at(self, value: FloatArray) -> FloatArray:
        """When the readings are really taken, shape (n,)."""
        times = self.time_s
        for effect, place in self.places():
            delay = effect.delay(self.time_s, value[place])
            if delay is not None:
                times = times + delay
        return times

    def read(self, sampled: Sampled, value: FloatArray) -> FloatArray:
        """What the sensor makes of the sampled motion, shape (n,)."""
        pendulum = self.pendulum(value)
        left = self._averaging(value)
        reading = np.asarray(value[OFFSET] + left * sampled.angle)
        if self.fold > 1:
            # A mean of neighbours is x + k x''; x'' = -omega^2 x + f, and -k omega^2 x is above.
            bent = sampled.at_nodes(self.acceleration(sampled.motion, value))
            reading = reading + (1.0 - left) / float(value[OMEGA]) ** 2 * bent
        for effect, place in self.places():
            extra = effect.reading(sampled, pendulum, value[place])
            if extra is not None:
                reading = reading + extra
        return reading

    def _averaging(self, value: FloatArray) -> float:
        """What a mean over `fold` neighbouring readings leaves of the fundamental."""
        if self.fold == 1:
            return 1.0
        half = 0.5 * float(value[OMEGA]) * self.interval_s / self.fold
        return math.sin(self.fold * half) / (self.fold * math.sin(half))

    def reading(self, value: FloatArray) -> FloatArray:
        """Return the readings alone, shape (n,)."""
        return self.evaluate(value).reading
