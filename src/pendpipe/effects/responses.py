"""What a change of an effect's values does to the readings, along a fitted motion."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pendpipe.arrays import FloatArray
from pendpipe.dynamics.any_law import Motion
from pendpipe.effects.effect import Effect, Pendulum
from pendpipe.effects.evaluated import Evaluated


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
