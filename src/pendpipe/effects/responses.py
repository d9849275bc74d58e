"""What a change of an effect's values does to the readings, along a fitted motion."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from pendpipe.arrays import FloatArray
from pendpipe.dynamics.any_law import Motion
from pendpipe.effects.effect import Effect, Pendulum
from pendpipe.effects.evaluated import Evaluated

_AT_ONCE: Final = 4


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
    # A few at a time stay in the processor's cache.
    for first in range(0, len(forces), _AT_ONCE):
        part = slice(first, first + _AT_ONCE)
        total[part] += sampled.change(*tangent.of_force(np.stack(forces[part])))
    if effect.kick(changes[0][1]) is not None:
        total += at.after_kicks([effect.kick(high) for _, high in changes])
        total -= at.after_kicks([effect.kick(low) for low, _ in changes])
    for row, (low, high) in enumerate(changes):
        added = effect.reading(sampled, pendulum, high)
        if added is not None:
            total[row] += added
            if not _absent(effect, low):
                total[row] -= _some(effect.reading(sampled, pendulum, low))
        late = effect.delay(sampled.time_s, high)
        if late is not None:
            if not _absent(effect, low):
                late = late - _some(effect.delay(sampled.time_s, low))
            total[row] += sampled.velocity * late
    return total


def _absent(effect: Effect, values: FloatArray) -> bool:
    """Whether an effect changes nothing: all its sizes are zero."""
    return not np.any(values[: effect.sizes])


def _some(found: FloatArray | None) -> FloatArray | float:
    return 0.0 if found is None else found


def _force_change(
    effect: Effect, motion: Motion, pendulum: Pendulum, low: FloatArray, high: FloatArray
) -> FloatArray | None:
    after = effect.acceleration(motion, pendulum, high)
    if after is None or _absent(effect, low):
        return after
    return np.asarray(after - _some(effect.acceleration(motion, pendulum, low)))
