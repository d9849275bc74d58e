"""The baseline and any effects as one model of the readings, and what its values do to them."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import accumulate
from typing import Any, Final, Self

import numpy as np

from pendpipe.arrays import FloatArray, IntArray
from pendpipe.dynamics.any_law import (
    Clock,
    Law,
    Motion,
    NoMotionError,
    Sampled,
    StopsError,
    Tangent,
    follow,
    rates,
    sample_motion,
    sample_pieces,
)
from pendpipe.dynamics.eq8 import BASELINE, OFFSET, OMEGA, SHARE, START, TIME, A, B, C
from pendpipe.dynamics.eq8_model import LOWER, UPPER, Eq8Model
from pendpipe.effects.curves import Curve
from pendpipe.effects.effect import Effect, Kick, Pendulum, Span


def pendulum_of(value: FloatArray) -> Pendulum:
    """The baseline's constants from its values."""
    return Pendulum(
        float(value[OMEGA]),
        float(value[A]),
        float(value[SHARE] * value[B]),
        float((1.0 - value[SHARE]) * value[B]),
        float(value[C]),
    )


def closed_form(value: FloatArray, clock: Clock) -> Motion:
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


@dataclass(frozen=True)
class Evaluated:
    """A model at given values, by the engine of any law."""

    model: Model
    value: FloatArray
    reading: FloatArray
    sampled: Sampled
    tangent: Tangent
    span: Span
    parts: tuple[Part, ...] = ()
    """Of a `pendpipe.effects.stack.Stack`: its recordings."""
    whole: Evaluated | None = None
    """What these readings were taken from (`thinned`)."""

    def thinned(self, every: int, rows: IntArray, law: Law) -> Evaluated:
        """Return some readings, of the middle one of every so many cycles, which stands for all.

        What is small changes the motion alike in all of them; an instant is known to them.
        """
        motion = self.tangent.motion.thinned(every)
        sampled = self.sampled.thinned(motion, rows)
        reading = self.reading[rows]
        tangent = Tangent(law, motion)
        return replace(self, reading=reading, sampled=sampled, tangent=tangent, whole=self)

    @property
    def jacobian(self) -> FloatArray:
        """Derivatives of the readings by all values, shape (n, size)."""
        if self.parts:
            return np.concatenate([part.own @ part.mixing for part in self.parts])
        return _jacobian(self)

    @cached_property
    def start(self) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Change of ln r and of t by ln r at the start: at the nodes, and at the readings."""
        by_log, by_time = self.tangent.of_start()
        at_readings = self.sampled.at_nodes(np.stack([by_log, by_time]))
        return by_log, by_time, at_readings[0], at_readings[1]

    def after_kicks(self, kicks: Sequence[Kick | None]) -> FloatArray:
        """Change of the readings by each of several small kicks, shape (kicks, n)."""
        change = np.zeros((len(kicks), len(self.reading)))
        # What jumps stands behind the instant.
        acting = {row: kick for row, kick in enumerate(kicks) if kick is not None and any(kick[1:])}
        if not acting:
            return change
        instants = np.array([kick.time_s for kick in acting.values()])
        whole = self.whole or self
        there = sample_motion(whole.tangent.motion, instants)
        log, late = kick_sizes(there, list(acting.values()), there)
        node_log, node_time, _, _ = whole.start
        _, _, by_log, by_time = self.start
        then_log, then_time = there.at_nodes(np.stack([node_log, node_time]))
        scale = log / then_log
        first = np.searchsorted(self.sampled.time_s, instants, side="right")
        angle, velocity = self.sampled.angle, self.sampled.velocity
        grown, slowed = angle * by_log, velocity * by_time
        for row, start, size, moved, rest in zip(
            acting, first, scale, late, then_time * scale, strict=True
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


@dataclass(frozen=True)
class Part:
    """One recording of several (`pendpipe.effects.stack`), evaluated.

    Parameters
    ----------
    number
        Of the recording.
    at
        Its own model, at its values.
    mixing
        Its values by those of all, shape (own values, values of all).
    """

    number: int
    at: Evaluated
    mixing: FloatArray

    @cached_property
    def own(self) -> FloatArray:
        """Derivatives of its readings by its own values."""
        return self.at.jacobian

    def responses(
        self, effect: Effect, changes: Sequence[tuple[FloatArray, FloatArray]]
    ) -> FloatArray:
        """Change of its readings for each pair of values of an effect, shape (changes, n)."""
        return responses(effect, changes, self.at, self.at.span.pendulum)


_MOST: Final = 2e5
"""Half cycles that a motion is followed for: with 15 nodes each a number of all takes 24 MB."""
_MORE: Final = (1.0, 1.02, 1.12, 1.28)
"""Half cycles that are tried, over those that omega makes: a pendulum may be quicker."""


@dataclass(frozen=True)
class Model(Eq8Model):
    """Eq. 8 with effects.

    Parameters
    ----------
    interval_s
        Between the readings, usually.
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
    scale
        The amplitude where readings are no angles: what effects are bounded by is for 1 rad.

    Notes
    -----
    An effect may change the forms of Eq. 8 (`Effect.form`), and set a held part of b free.
    """

    interval_s: float
    effects: tuple[Effect, ...] = ()
    order: int = 14
    half_cycles: int | None = None
    fold: int = 1
    first_s: float = -math.inf
    scale: float = 1.0
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

    def rest(self) -> None:
        """Keep no more of the last motion than what the next one begins with."""
        self._last.update({name: replace(last, slopes=None) for name, last in self._last.items()})

    @property
    def size(self) -> int:
        """Number of values."""
        return self.first + sum(effect.count for effect in self.effects)

    def places(self) -> list[tuple[Effect, slice]]:
        """Each effect with the place of its values."""
        starts = accumulate((effect.count for effect in self.effects), initial=self.first)
        pairs = zip(self.effects, starts, strict=False)
        return [(effect, slice(start, start + effect.count)) for effect, start in pairs]

    def bounds(self) -> tuple[FloatArray, FloatArray]:
        """Lowest and highest values."""
        duration = float(self.time_s[-1] - self.time_s[0])
        limits = [effect.limits(duration, self.scale) for effect in self.effects]
        low, high = np.concatenate([np.transpose([LOWER, UPPER]), *limits]).T.copy()
        low[B] = sum(self.held_parts().values())
        return low, high

    def held(self) -> list[int]:
        """Indices that are never fitted: sizes of switches, and what held parts of b settle."""
        switches = [place.start for effect, place in self.places() if effect.parameter_free]
        # With one part, b moves the share.
        return [*switches, *([], [SHARE], [B, SHARE])[len(self.held_parts())]]

    def held_parts(self) -> dict[str, float]:
        """The parts of b that are held, without those that an effect sets free."""
        free = {effect.frees for effect in self.effects}
        return {part: rate for part, rate in self.parts.items() if part not in free}

    def pendulum(self, value: FloatArray) -> Pendulum:
        """Eq. 8 in its forms, and when the first reading was taken."""
        form: dict[str, Any] = {"restoring": self.restoring, "drag": self.drag}
        for effect, place in self.places():
            if effect.form and value[place.start]:
                form |= effect.form
        return replace(pendulum_of(value), first_s=self.first_s, **form)

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
            sampled,
        )

    def law(self, value: FloatArray) -> Law:
        """Return x'' + omega^2 x of the baseline and of all effects, as a function of a motion."""
        pendulum = self.pendulum(value)
        # Another form is in the pendulum already.
        others = [(effect, value[place]) for effect, place in self.places() if not effect.form]

        def acceleration(motion: Motion) -> FloatArray:
            total = pendulum.along(motion)
            for effect, own in others:
                extra = effect.acceleration(motion, pendulum, own)
                if extra is not None:
                    total = total + extra
            return total

        return acceleration

    def _added(
        self,
        total: FloatArray,
        value: FloatArray,
        of: Callable[[Effect, FloatArray], FloatArray | None],
    ) -> FloatArray:
        """Return a total with what each effect adds to it by its own values."""
        for effect, place in self.places():
            extra = of(effect, value[place])
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
        law = self.law(value)
        motion = self._smooth(law, value)
        self._last["motion"] = motion
        pieces = [(-math.inf, motion)]
        by_log, by_time = np.zeros_like(motion.time_s), np.zeros_like(motion.time_s)
        for kick in self._kicks(value):
            before = sample_motion(motion, np.array([kick.time_s]))
            # It takes effect before the instant, so that what follows is smooth there.
            whole = max(int(before.phase[0] // math.pi) - 1, 0)
            # Followed to the kick's half cycle, the motion shows what the kick still lacks.
            for until_s in (kick.time_s, self._until_s):
                log, late = kick_sizes(before, [kick], sample_motion(motion, before.time_s))
                by_log[whole:] += log[0]
                by_time[whole:] += late[0]
                reset = (by_log, by_time)
                motion = follow(law, omega, start, begin, motion, reset, until_s=until_s)
            pieces.append((kick.time_s, motion))
        return pieces

    @property
    def _until_s(self) -> float:
        """When the motion may end: after the last reading, unless half cycles are asked for."""
        return math.inf if self.half_cycles is not None else float(self.time_s[-1])

    def _kicks(self, value: FloatArray) -> list[Kick]:
        """The sudden changes within the record, as they come."""
        kicks = [effect.kick(value[place]) for effect, place in self.places()]
        inside = [k for k in kicks if k is not None and value[TIME] < k.time_s < self.time_s[-1]]
        return sorted(inside, key=lambda kick: kick.time_s)

    def _smooth(self, law: Law, value: FloatArray) -> Motion:
        """The motion without kicks, on as many half cycles as it takes."""
        nodes = max([self.order, *(effect.nodes for effect in self.effects)])
        if self.half_cycles is not None:
            return self._from_guesses(law, value, Clock(self.half_cycles, nodes))
        omega, begin = float(value[OMEGA]), float(value[TIME])
        needed = (self.time_s[-1] - begin) * omega / math.pi
        # Before its first turning point a motion is carried on by a cycle, and no further.
        if not (1.0 <= needed < _MOST and (begin - self.time_s[0]) * omega < 2.0 * math.pi):
            raise NoMotionError("the frequency or the start is out of reach")
        last = self._last.get("motion")
        known = [] if last is None else [last.clock.count]
        for count in [*known, *(math.ceil(needed * more) + 1 for more in _MORE)]:
            if needed - 1.0 < count < 1.3 * needed + 4.0:
                motion = self._from_guesses(law, value, Clock(count, nodes))
                if np.max(motion.time_s[:, -1]) >= self.time_s[-1]:
                    return motion
        raise NoMotionError("the frequency is out of reach")

    def _from_guesses(self, law: Law, value: FloatArray, clock: Clock) -> Motion:
        """Begin with the last motion, if it was on this clock; else with the closed form."""
        start = (float(value[OMEGA]), float(value[START]), float(value[TIME]))
        last = self._last.get("motion")
        if last is not None and last.clock == clock:
            try:
                return follow(law, *start, last, until_s=self._until_s)
            except StopsError:
                raise
            except NoMotionError:
                pass
        return follow(law, *start, closed_form(value, clock), until_s=self._until_s)

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
        tangent = Tangent(self.law(value), motion)
        span, seen = self.span(value, sampled), self.as_seen(sampled, value)
        return Evaluated(self, value, self.read(seen, value), seen, tangent, span)

    def as_seen(self, sampled: Sampled, value: FloatArray) -> Sampled:
        """What is read of the sampled motion: the angle, or its rate."""
        if self.seen == "angle":
            return sampled
        extra = sampled.at_nodes(self.law(value)(sampled.motion))
        return sampled.as_rate(extra - float(value[OMEGA]) ** 2 * sampled.angle)

    def taken_at(self, value: FloatArray) -> FloatArray:
        """When the readings are really taken, shape (n,)."""
        return self._added(self.time_s, value, lambda effect, own: effect.delay(self.time_s, own))

    def read(self, sampled: Sampled, value: FloatArray) -> FloatArray:
        """What the sensor makes of the sampled motion, shape (n,)."""
        pendulum = self.pendulum(value)
        # What a mean over `fold` neighbouring readings leaves of the fundamental.
        half = 0.5 * float(value[OMEGA]) * self.interval_s / self.fold
        left = math.sin(self.fold * half) / (self.fold * math.sin(half))
        reading = np.asarray(value[OFFSET] + left * sampled.angle)
        if self.fold > 1:
            # A mean of neighbours is x + k x''; x'' = -omega^2 x + f, and -k omega^2 x is above.
            law = self.law(value)
            bent = law(sampled.motion)
            if self.seen == "rate":
                pace = rates(law, sampled.motion).pace
                bent = sampled.motion.clock.derivative(bent) / pace
            reading = reading + (1.0 - left) / float(value[OMEGA]) ** 2 * sampled.at_nodes(bent)
        return self._added(
            reading, value, lambda effect, own: effect.reading(sampled, pendulum, own)
        )

    def reading(self, value: FloatArray) -> FloatArray:
        """Return the readings alone, shape (n,)."""
        return self.evaluate(value).reading


_AT_ONCE: Final = 4
"""Forces whose motions are solved together: see `_NUMBERS_AT_ONCE`."""
_NUMBERS_AT_ONCE: Final = 1 << 16
"""Accelerations whose responses are computed together."""


def responses(
    effect: Effect,
    changes: Sequence[tuple[FloatArray, FloatArray]],
    at: Evaluated,
    pendulum: Pendulum,
) -> FloatArray:
    """Change of the readings when an effect's values go from the first of each pair to the second.

    Returns
    -------
    FloatArray
        Shape (changes, n).
    """
    if at.parts:
        return np.concatenate([part.responses(effect, changes) for part in at.parts], axis=1)
    sampled, tangent = at.sampled, at.tangent
    total = np.zeros((len(changes), len(sampled.time_s)))
    found = [
        _change(effect, *pair, lambda values: effect.acceleration(tangent.motion, pendulum, values))
        for pair in changes
    ]
    forces = [force for force in found if force is not None]
    for part in _a_few(range(len(forces)), tangent):
        total[part] += sampled.change(*tangent.of_force(np.stack([forces[k] for k in part])))
    if effect.kick(changes[0][1]) is not None:
        before = at.after_kicks([effect.kick(low) for low, _ in changes])
        total += at.after_kicks([effect.kick(high) for _, high in changes]) - before
    for change, pair in zip(total, changes, strict=True):
        added = _change(effect, *pair, lambda values: effect.reading(sampled, pendulum, values))
        late = _change(effect, *pair, lambda values: effect.delay(sampled.time_s, values))
        change += 0.0 if added is None else added
        change += 0.0 if late is None else sampled.velocity * late
    return total


def _a_few(indices: Sequence[int], tangent: Tangent) -> Iterator[list[int]]:
    """Yield some at a time, of which the accelerations stay in the processor's cache."""
    at_once = max(min(_AT_ONCE, _NUMBERS_AT_ONCE // tangent.motion.time_s.size), 1)
    for first in range(0, len(indices), at_once):
        yield list(indices[first : first + at_once])


def _change(
    effect: Effect,
    low: FloatArray,
    high: FloatArray,
    what: Callable[[FloatArray], FloatArray | None],
) -> FloatArray | None:
    """By how much something changes with the values; None where the effect leaves it alone.

    What is absent at `low`, with all its sizes zero, need not be asked there.
    """
    after = what(high)
    if after is None or not np.any(low[: effect.sizes]):
        return after
    before = what(low)
    return after if before is None else np.asarray(after - before)


def _jacobian(at: Evaluated) -> FloatArray:
    """Derivatives of one recording's readings, shape (n, size)."""
    model, value, pendulum = at.model, at.value, at.span.pendulum
    sampled, tangent = at.sampled, at.tangent
    columns = np.empty((len(at.reading), model.size), order="F")
    changes = {OMEGA: _by_omega(at)}
    columns[:, OMEGA] = sampled.change(*changes[OMEGA])
    for part in _a_few((A, B, C, SHARE), tangent):
        by_loss = tangent.of_force(np.stack([_by_loss(at, index) for index in part]))
        changes |= dict(zip(part, zip(*by_loss, strict=True), strict=True))
        for index, change in zip(part, sampled.change(*by_loss), strict=True):
            columns[:, index] = change
    if model.seen == "rate":
        # At the same amplitude and phase it is larger.
        columns[:, OMEGA] += sampled.angle / float(value[OMEGA])
    node_log, node_time, by_log, by_time = at.start
    columns[:, START] = (sampled.angle * by_log - sampled.velocity * by_time) / value[START]
    columns[:, TIME] = -sampled.velocity
    columns[:, OFFSET] = 1.0
    if any(effect.carried for effect in model.effects):
        changes[START] = node_log / value[START], node_time / value[START]
        changes[TIME] = np.zeros_like(node_log), np.ones_like(node_time)
        for index, change in changes.items():
            columns[:, index] += _carried(at, index, *change)
    for effect, place in model.places():
        if isinstance(effect, Curve):
            # It is linear in its values.
            small = effect.small(at.span)
            pairs = [(np.zeros(effect.count), row) for row in small * np.eye(effect.count)]
            columns[:, place] = responses(effect, pairs, at, pendulum).T / small
            continue
        for index in range(effect.count):
            columns[:, place.start + index] = _derivative(effect, value[place], index, at, pendulum)
    return columns


def _by_loss(at: Evaluated, index: int) -> FloatArray:
    """Derivative of the acceleration by one of the baseline's losses; it is linear in them."""
    model, value, moved = at.model, at.value, at.value.copy()
    moved[index] += max(1e-3 * abs(float(value[index])), 1e-6)
    change = model.law(moved)(at.tangent.motion) - at.tangent.force
    return np.asarray(change / (moved[index] - value[index]))


def _carried(at: Evaluated, index: int, by_log: FloatArray, by_time: FloatArray) -> FloatArray:
    """Derivative of what the motion carries by one value of the baseline."""
    model, value, moved = at.model, at.value, at.value.copy()
    largest = max(np.abs(by_log).max(), value[OMEGA] * np.abs(by_time).max())
    step = _CARRIED / max(float(largest), 1e-300)
    moved[index] += step
    motion = at.sampled.moved(step * by_log, step * by_time)
    change = np.zeros_like(at.reading)
    for effect, place in model.places():
        if effect.carried:
            there = effect.reading(motion, model.pendulum(moved), value[place])
            here = effect.reading(at.sampled, at.span.pendulum, value[place])
            change += np.asarray(there) - np.asarray(here)
    return change / step


_CARRIED: Final = 1e-4
"""Step in ln r or in phase: between what rounds off, 1e-11 of it, and its square."""


def _by_omega(at: Evaluated) -> tuple[FloatArray, FloatArray]:
    """Change of ln r and of t at fixed phase by omega."""
    model, value = at.model, at.value
    motion, step = at.tangent.motion, 1e-6 * value[OMEGA]
    moved = value.copy()
    moved[OMEGA] += step
    other = Motion(
        motion.clock, float(moved[OMEGA]), motion.log_amplitude, motion.time_s, motion.upwards
    )
    new = rates(model.law(moved), other)
    old = at.tangent.rates
    loss, pace = (new.loss - old.loss) / step, (new.pace - old.pace) / step
    return at.tangent.of_rates(loss, pace)


def _derivative(
    effect: Effect, values: FloatArray, index: int, at: Evaluated, pendulum: Pendulum
) -> FloatArray:
    """Derivative of the readings by one value of one effect, along the motion."""
    low, high = values.copy(), values.copy()
    step = _step(effect, values, index, at.span)
    low[index] -= step
    high[index] += step
    return np.asarray(responses(effect, [(low, high)], at, pendulum)[0] / (2.0 * step))


def _step(effect: Effect, values: FloatArray, index: int, span: Span) -> float:
    if index < effect.sizes:
        return max(effect.small(span), 1e-4 * abs(float(values[index])))
    if effect.parameters[index - effect.parameter_free].name == "time":
        # Over several readings, or the one that is crossed decides.
        return min(2.0 * span.interval_s, 0.0625 * span.period_s)
    return max(1e-4 * abs(float(values[index])), 1e-9)
