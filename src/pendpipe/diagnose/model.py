"""The baseline and any effects of the catalogue, as one model of the readings."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Final

import numpy as np

from pendpipe.arrays import FloatArray
from pendpipe.dynamics.any_law import Clock, Law, Motion, NoMotionError, Tangent, follow, rates
from pendpipe.dynamics.sampling import Sampled, sample_motion, sample_pieces
from pendpipe.effects import Effect, Kick, Pendulum, Span

BASELINE: Final = ("a", "b", "c", "share", "omega", "start_rad", "start_s", "offset")
"""Eq. 13's rates; the hysteretic share of b; omega; the turning point from which the motion
starts (about the equilibrium) and when; and the reading of the equilibrium."""
A, B, C, SHARE, OMEGA, START, TIME, OFFSET = range(8)
_LOW: Final = (0.0, 0.0, 0.0, 0.0, 1e-9, -math.inf, -math.inf, -math.inf)
_HIGH: Final = (math.inf, math.inf, math.inf, 1.0, math.inf, math.inf, math.inf, math.inf)
_MORE: Final = (1.0, 1.02, 1.12, 1.28)
"""Half cycles that are tried, over those that omega makes: a pendulum may be quicker."""


@dataclass(frozen=True)
class Evaluated:
    """A model at given values."""

    reading: FloatArray
    sampled: Sampled
    tangent: Tangent
    span: Span

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
        scale = (log / then_log)[:, None]
        later = late[:, None] + (by_time - then_time[:, None]) * scale
        sampled = self.sampled
        after = sampled.angle * by_log * scale - sampled.velocity * later
        change[rows] = np.where(sampled.time_s > instants[:, None], after, 0.0)
        return change


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
    """

    time_s: FloatArray
    interval_s: float
    effects: tuple[Effect, ...] = ()
    order: int = 14
    half_cycles: int | None = None
    fold: int = 1
    _last: dict[str, Motion] = field(default_factory=dict, repr=False, compare=False)

    def adding(self, effect: Effect) -> Model:
        """The same with one effect more."""
        return replace(self, effects=(*self.effects, effect), _last=dict(self._last))

    @property
    def size(self) -> int:
        """Number of values."""
        return len(BASELINE) + sum(effect.count for effect in self.effects)

    def places(self) -> list[tuple[Effect, slice]]:
        """Each effect with the place of its values."""
        found, first = [], len(BASELINE)
        for effect in self.effects:
            found.append((effect, slice(first, first + effect.count)))
            first += effect.count
        return found

    def bounds(self) -> tuple[FloatArray, FloatArray]:
        """Lowest and highest values."""
        low, high = list(_LOW), list(_HIGH)
        for effect in self.effects:
            for lowest, highest in effect.bounds():
                low.append(lowest)
                high.append(highest)
        return np.array(low), np.array(high)

    def held(self) -> list[int]:
        """Indices that are never fitted: the sizes of switches."""
        return [place.start for effect, place in self.places() if effect.switch]

    def pendulum(self, value: FloatArray) -> Pendulum:
        """The baseline's constants."""
        return Pendulum(
            float(value[OMEGA]), float(value[A]), float(value[SHARE] * value[B]),
            float((1.0 - value[SHARE]) * value[B]), float(value[C]),
        )  # fmt: skip

    def span(self, value: FloatArray, sampled: Sampled) -> Span:
        """What the scans of effects must know."""
        return Span(
            float(self.time_s[0]), float(self.time_s[-1]), self.interval_s, self.pendulum(value),
            float(sampled.amplitude[0]), float(sampled.amplitude[-1]), float(value[OFFSET]),
        )  # fmt: skip

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
            return self._from_guesses(law, value, Clock(self.half_cycles, self.order))
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
            clock = Clock(count, self.order)
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
        return follow(law, *start, _closed_form(value, clock))

    def evaluate(self, value: FloatArray) -> Evaluated:
        """Return readings, and what the derivatives need."""
        pieces = self.follow(value)
        motion = pieces[-1][1]
        times = self.time_s
        for effect, place in self.places():
            delay = effect.delay(self.time_s, value[place])
            if delay is not None:
                times = times + delay
        sampled = sample_pieces(pieces, times)
        turned = sampled.phase[[0, -1]]
        if not np.all(np.isfinite(sampled.phase)) or np.ptp(turned) > 4.0 * np.pi * len(
            motion.time_s
        ):
            raise NoMotionError("the readings' clock is out of reach")
        pendulum = self.pendulum(value)
        reading = value[OFFSET] + self._averaging(value) * sampled.angle
        for effect, place in self.places():
            extra = effect.reading(sampled, pendulum, value[place])
            if extra is not None:
                reading = reading + extra
        tangent = Tangent(lambda m: self.acceleration(m, value), motion)
        return Evaluated(reading, sampled, tangent, self.span(value, sampled))

    def _averaging(self, value: FloatArray) -> float:
        """What a mean over `fold` neighbouring readings leaves of the fundamental."""
        if self.fold == 1:
            return 1.0
        half = 0.5 * float(value[OMEGA]) * self.interval_s / self.fold
        return math.sin(self.fold * half) / (self.fold * math.sin(half))

    def reading(self, value: FloatArray) -> FloatArray:
        """Return the readings alone, shape (n,)."""
        return self.evaluate(value).reading

    def jacobian(self, value: FloatArray, at: Evaluated) -> FloatArray:
        """Derivatives of the readings by all values, shape (n, size)."""
        sampled, tangent = at.sampled, at.tangent
        pendulum = self.pendulum(value)
        columns = np.empty((len(self.time_s), self.size))
        losses = [A, B, C, SHARE]
        columns[:, losses] = sampled.change(
            *tangent.of_force(np.stack([self._by_loss(value, at, index) for index in losses]))
        ).T
        columns[:, OMEGA] = self._by_omega(value, at)
        columns[:, START] = at.by_start() / value[START]
        columns[:, TIME] = -sampled.velocity
        columns[:, OFFSET] = 1.0
        for effect, place in self.places():
            for index in range(effect.count):
                columns[:, place.start + index] = self.derivative(
                    effect, value[place], index, at, pendulum
                )
        return columns

    def _by_loss(self, value: FloatArray, at: Evaluated, index: int) -> FloatArray:
        """Derivative of the acceleration by one of the baseline's losses; it is linear in them."""
        moved = value.copy()
        moved[index] += max(1e-3 * abs(float(value[index])), 1e-6)
        motion = at.tangent.motion
        change = self.acceleration(motion, moved) - self.acceleration(motion, value)
        return np.asarray(change / (moved[index] - value[index]))

    def _by_omega(self, value: FloatArray, at: Evaluated) -> FloatArray:
        motion, step = at.tangent.motion, 1e-6 * value[OMEGA]
        moved = value.copy()
        moved[OMEGA] += step
        other = Motion(
            motion.clock, float(moved[OMEGA]), motion.log_amplitude, motion.time_s, motion.upwards
        )
        new = rates(lambda m: self.acceleration(m, moved), other)
        old = at.tangent.rates
        loss, pace = (new.loss - old.loss) / step, (new.pace - old.pace) / step
        return at.sampled.change(*at.tangent.of_rates(loss, pace))

    def derivative(
        self, effect: Effect, values: FloatArray, index: int, at: Evaluated, pendulum: Pendulum
    ) -> FloatArray:
        """Derivative of the readings by one value of one effect, along the motion."""
        low, high = values.copy(), values.copy()
        step = self._step(effect, values, index, at.span)
        low[index] -= step
        high[index] += step
        return np.asarray(response(effect, low, high, at, pendulum) / (2.0 * step))

    def _step(self, effect: Effect, values: FloatArray, index: int, span: Span) -> float:
        if index < effect.sizes:
            return max(effect.small(span), 1e-4 * abs(float(values[index])))
        if effect.parameters[index - effect.switch].name == "time":
            # Over several readings, or the one that is crossed decides.
            return min(2.0 * span.interval_s, 0.0625 * span.period_s)
        return max(1e-4 * abs(float(values[index])), 1e-9)


def response(
    effect: Effect, low: FloatArray, high: FloatArray, at: Evaluated, pendulum: Pendulum
) -> FloatArray:
    """Change of the readings when the values of one effect go from `low` to `high`."""
    return np.asarray(responses(effect, [(low, high)], at, pendulum)[0])


def responses(
    effect: Effect, changes: Sequence[tuple[FloatArray, FloatArray]], at: Evaluated,
    pendulum: Pendulum,
) -> FloatArray:  # fmt: skip
    """Change of the readings for each pair of values, shape (changes, n)."""
    sampled, tangent = at.sampled, at.tangent
    total = np.zeros((len(changes), len(sampled.time_s)))
    found = [_force_change(effect, tangent.motion, pendulum, *pair) for pair in changes]
    forces = [force for force in found if force is not None]
    if forces:
        total += sampled.change(*tangent.of_force(np.stack(forces)))
    if effect.kick(changes[0][1]) is not None:
        total += at.after_kicks([effect.kick(high) for _, high in changes])
        total -= at.after_kicks([effect.kick(low) for low, _ in changes])
    for row, (low, high) in enumerate(changes):
        added = effect.reading(sampled, pendulum, high)
        before = effect.reading(sampled, pendulum, low)
        if added is not None and before is not None:
            total[row] += added - before
        late = effect.delay(sampled.time_s, high)
        earlier = effect.delay(sampled.time_s, low)
        if late is not None and earlier is not None:
            total[row] += sampled.velocity * (late - earlier)
    return total


def _force_change(
    effect: Effect, motion: Motion, pendulum: Pendulum, low: FloatArray, high: FloatArray
) -> FloatArray | None:
    before = effect.acceleration(motion, pendulum, low)
    after = effect.acceleration(motion, pendulum, high)
    if before is None or after is None:
        return None
    return np.asarray(after - before)


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


def _closed_form(value: FloatArray, clock: Clock) -> Motion:
    """The motion by Eq. 14, without ripple."""
    from pendpipe.physics.decay import amplitude

    omega = float(value[OMEGA])
    time = value[TIME] + clock.psi / omega
    start = abs(float(value[START]))
    decayed = amplitude(clock.psi / omega, start, *(max(float(value[k]), 0.0) for k in (A, B, C)))
    # Not so small that friction would hold the guess itself.
    stop = 2.0 * math.pi * max(float(value[C]), 0.0) / omega
    kept = np.maximum(decayed, min(max(1e-3 * start, stop), start))
    return Motion(clock, omega, np.log(kept), time, math.copysign(1.0, value[START]))
