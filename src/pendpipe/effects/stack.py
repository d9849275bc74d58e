"""Several recordings of one pendulum as one model: values are shared, or a recording's own.

The values of each recording follow linearly from those of all: its Jacobian times that matrix is
its part of the Jacobian. So whatever fits, scans and weighs one recording does it for several.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from copy import copy
from dataclasses import dataclass, replace
from typing import Any, Final, Self

import numpy as np

from pendpipe.arrays import FloatArray, IntArray
from pendpipe.dynamics.any_law import NoMotionError, Sampled
from pendpipe.dynamics.eq8 import BASELINE, OFFSET, OMEGA, START, TIME, A, B, C
from pendpipe.effects.effect import Effect, Parameter, Span
from pendpipe.effects.model import Evaluated, Model, Part

MAY_DIFFER: Final = {"a": A, "b": B, "c": C, "frequency": OMEGA}
"""What the recordings of one pendulum share, unless it was changed between them."""


class Differs(Effect):
    """A value that one recording does not share with the others: what it has more than they.

    Parameters
    ----------
    parameter
        Its name in `MAY_DIFFER`.
    recording
        The number of the recording.
    """

    kind = "parameter"
    prior = -15.0
    """As of two names, each one of some forty: who gives the recordings says that it is shared."""
    discriminating_test = "record each of them once more, in another order"

    def __init__(self, parameter: str, recording: int) -> None:
        self.parameter, self.recording = parameter, recording
        self.index = MAY_DIFFER[parameter]
        self.identifier = f"parameter-{parameter}"  # type: ignore[misc]
        self.name = f"another {parameter} in recording {recording + 1}"  # type: ignore[misc]
        self.equation = parameter  # type: ignore[misc]
        self.parameters = (Parameter("difference", "", -math.inf, math.inf),)  # type: ignore[misc]

    @property
    def key(self) -> str:
        """The parameter, and in which recording."""
        return f"{self.identifier}:{self.recording}"


def of_each(effect: Effect, recordings: int) -> Effect:
    """Return an effect with sizes of its own in each recording, and the same shape in all."""
    found = copy(effect)
    sizes = effect.parameters[: effect.sizes]
    found.sizes = recordings * effect.sizes  # type: ignore[misc]
    found.parameters = (  # type: ignore[misc]
        *(
            each._replace(name=f"{each.name} {number + 1}")
            for number in range(recordings)
            for each in sizes
        ),
        *effect.parameters[effect.sizes :],
    )
    found.single = effect  # type: ignore[attr-defined]

    def over(combine: Callable[..., Any], judge: Callable[..., Any]) -> Callable[..., Any]:
        """Judge each recording's own values, and combine what is said of them."""
        blocks = [_block(found, number, 0) for number in range(recordings)]
        return lambda values, *more: combine([judge(block @ values, *more) for block in blocks])

    for name, combine in (("believable", all), ("displacement", max), ("prior_penalty", sum)):
        setattr(found, name, over(combine, getattr(effect, name)))
    return found


def _single(effect: Effect) -> Effect:
    """Return the effect as one recording has it."""
    return getattr(effect, "single", effect)


def _block(effect: Effect, recording: int, size: int) -> FloatArray:
    """Return one recording's values by those of an effect: of the effect's, or of the baseline."""
    single = _single(effect)
    if isinstance(effect, Differs):
        found = np.zeros((size, 1))
        found[effect.index] = effect.recording == recording
        return found
    rows, own = np.arange(single.count), 0 if single is effect else recording * single.sizes
    shifted = np.where(rows < single.sizes, rows + own, rows + effect.sizes - single.sizes)
    return np.eye(effect.count)[shifted]


class _OfSeveral(Part):
    """One recording; an effect may have a size of its own in it."""

    def responses(
        self, effect: Effect, changes: Sequence[tuple[FloatArray, FloatArray]]
    ) -> FloatArray:
        """Change of its readings for each pair of values of an effect, shape (changes, n)."""
        block = _block(effect, self.number, len(self.at.value))
        if isinstance(effect, Differs):
            return np.array([self.own @ (block @ (high - low)) for low, high in changes])
        pairs = [(block @ low, block @ high) for low, high in changes]
        return super().responses(_single(effect), pairs)


@dataclass(frozen=True)
class Stack(Model):
    """A model of several recordings.

    Parameters
    ----------
    members
        Each recording's model, the effects of all in it.
    base
        Where each recording's values (the baseline's, and of what happened in it alone) stand among
        the first values of all.
    same_sensor
        Whether errors of the sensor have the same sizes in all.
    """

    members: tuple[Model, ...] = ()
    base: tuple[IntArray, ...] = ()
    same_sensor: bool = False

    @classmethod
    def of(cls, members: Sequence[Model], own: Sequence[str], *, same_sensor: bool) -> Stack:
        """Stack models: start and offset are each one's own, and what `own` names."""
        apart = {TIME, START, OFFSET, *(MAY_DIFFER[name] for name in own)}
        places, count = [], 0
        for number, member in enumerate(members):
            shared = {k for k in range(len(BASELINE)) if number and k not in apart}
            here = np.arange(member.size)
            fresh = [k for k in range(member.size) if k not in shared]
            here[fresh] = count + np.arange(len(fresh))
            places.append(here)
            count += len(fresh)
        time_s = np.concatenate([member.time_s for member in members])
        return cls(
            time_s,
            members[0].interval_s,
            restoring=members[0].restoring,
            drag=members[0].drag,
            members=tuple(members),
            base=tuple(places),
            same_sensor=same_sensor,
        )

    @property
    def first(self) -> int:
        """Where the values of effects begin."""
        return 1 + max(int(base.max()) for base in self.base)

    def admitted(self, effects: Sequence[Effect]) -> list[Effect]:
        """Return what may be common: no instant, no tone, nothing drawn against the time.

        Two sizes are an amplitude and a phase, which each release sets anew; so does each
        recording with the errors of its sensor, unless that was left alone.
        """
        found = []
        for effect in effects:
            sensor = "measurement" in (effect.kind, effect.identifier.removeprefix("unnamed-"))
            own = sensor and not self.same_sensor
            drawn = effect.kind == "unnamed"
            if effect.local or effect.spectral or effect.in_time or (own and drawn):
                continue
            own |= effect.sizes > 1 and not drawn
            found.append(of_each(effect, len(self.members)) if own else effect)
        return found

    def adding(self, effect: Effect) -> Self:
        """The same with one effect more, in each recording."""
        members = self.members
        if not isinstance(effect, Differs):
            members = tuple(member.adding(_single(effect)) for member in members)
        return replace(self, effects=(*self.effects, effect), members=members)

    def dropping(self, effect: Effect, value: FloatArray) -> tuple[Self, FloatArray]:
        """The same without one effect, and the values that are left."""
        _, kept = super().dropping(effect, value)
        members = tuple(m.dropping(_single(effect), np.zeros(m.size))[0] for m in self.members)
        effects = tuple(other for other in self.effects if other is not effect)
        return replace(self, effects=effects, members=members), kept

    def bare(self) -> Self:
        """The baseline, with what happened in each recording alone."""
        found = self
        for effect in self.effects:
            found, _ = found.dropping(effect, np.zeros(found.size))
        return found

    def guessing(self, at: Evaluated) -> Self:
        """The same, its next motions solved from those of an evaluation."""
        known = [{"motion": part.at.tangent.motion} for part in at.parts]
        pairs = zip(self.members, known, strict=True)
        return replace(self, members=tuple(replace(m, _last=last) for m, last in pairs))

    def at_times(self, time_s: FloatArray) -> Self:
        """Several recordings have no times in common."""
        raise NoMotionError("several recordings have no times in common")

    def mixings(self) -> list[FloatArray]:
        """Return each recording's values by those of all, shape (own values, values of all)."""
        found = []
        for number, (member, base) in enumerate(zip(self.members, self.base, strict=True)):
            matrix = np.zeros((member.size, self.size))
            matrix[np.arange(len(base)), base] = 1.0
            places = {id(effect): place for effect, place in member.places()}
            for effect, place in self.places():
                rows = slice(None) if isinstance(effect, Differs) else places[id(_single(effect))]
                matrix[rows, place] = _block(effect, number, member.size)
            found.append(matrix)
        return found

    def bounds(self) -> tuple[FloatArray, FloatArray]:
        """Lowest and highest values."""
        ends = [np.zeros(self.size), np.zeros(self.size)]
        for member, base in zip(self.members, self.base, strict=True):
            for end, own in zip(ends, member.bounds(), strict=True):
                end[base] = own[: len(base)]
        duration = max(float(np.ptp(member.time_s)) for member in self.members)
        for effect, place in self.places():
            limits = effect.limits(duration, max(member.scale for member in self.members))
            ends[0][place], ends[1][place] = limits.T
        return ends[0], ends[1]

    def held(self) -> list[int]:
        """Indices that are never fitted."""
        return [*super().held(), *self.held_of([member.held() for member in self.members])]

    def held_of(self, own: Sequence[Sequence[int]]) -> list[int]:
        """Return where values stand that each recording holds, of those before the effects'."""
        pairs = zip(self.base, own, strict=True)
        return [int(base[k]) for base, held in pairs for k in held if k < len(base)]

    def evaluate(self, value: FloatArray) -> Evaluated:
        """Return the readings of all, one recording after the other, by one form of the drag."""
        parts = []
        for number, (member, mixing) in enumerate(zip(self.members, self.mixings(), strict=True)):
            own = np.clip(mixing @ value, *member.bounds())
            parts.append(_OfSeveral(number, replace(member, drag=self.drag).evaluate(own), mixing))
        spans = [part.at.span for part in parts]
        loudest = max(parts, key=lambda part: part.at.span.first_amplitude).at
        span = Span(
            min(each.start_s for each in spans),
            max(each.stop_s for each in spans),
            loudest.span.interval_s,
            loudest.span.pendulum,
            loudest.span.first_amplitude,
            min(each.last_amplitude for each in spans),
            loudest.span.offset,
            loudest.span.fold,
        )
        reading = np.concatenate([part.at.reading for part in parts])
        return Evaluated(self, value, reading, _sampled(parts), loudest.tangent, span, tuple(parts))


def _sampled(parts: Sequence[Part]) -> Sampled:
    """Return the motions one after the other, each in cycles of its own."""
    samples = [part.at.sampled for part in parts]
    first = samples[0]
    signs = [one.motion.upwards * first.motion.upwards for one in samples]
    omegas = [one.motion.angular_frequency for one in samples]
    phases = [first.phase]
    for one, sign in zip(samples[1:], signs[1:], strict=True):
        phase = one.phase + (0.0 if sign > 0.0 else math.pi)
        turns = math.ceil((phases[-1][-1] - phase[0]) / (2.0 * math.pi))
        phases.append(phase + 2.0 * math.pi * turns)
    each = list(zip(samples, signs, omegas, strict=True))
    return replace(
        first,
        time_s=np.concatenate([one.time_s for one in samples]),
        phase=np.concatenate(phases),
        amplitude=np.concatenate([one.amplitude for one in samples]),
        cosine=np.concatenate([sign * one.cosine for one, sign, _ in each]),
        sine=np.concatenate([sign * pace / omegas[0] * one.sine for one, sign, pace in each]),
    )
