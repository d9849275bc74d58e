"""What changes of a model's values do to its readings, along the motion: responses, Jacobian."""

from collections.abc import Callable, Sequence
from typing import Final

import numpy as np

from pendpipe.arrays import FloatArray
from pendpipe.dynamics.any_law import Motion, rates
from pendpipe.effects.baseline import OFFSET, OMEGA, SHARE, START, TIME, A, B, C
from pendpipe.effects.curves import Curve
from pendpipe.effects.effect import Effect, Pendulum, Span
from pendpipe.effects.model import Evaluated, Model

_AT_ONCE: Final = 4


def response(
    effect: Effect, low: FloatArray, high: FloatArray, at: Evaluated, pendulum: Pendulum
) -> FloatArray:
    """Change of the readings when the values of one effect go from `low` to `high`."""
    return np.asarray(responses(effect, [(low, high)], at, pendulum)[0])


def responses(
    effect: Effect,
    changes: Sequence[tuple[FloatArray, FloatArray]],
    at: Evaluated,
    pendulum: Pendulum,
) -> FloatArray:
    """Change of the readings for each pair of values, shape (changes, n)."""
    if at.parts:
        return np.concatenate([part.responses(effect, changes) for part in at.parts], axis=1)
    sampled, tangent = at.sampled, at.tangent
    total = np.zeros((len(changes), len(sampled.time_s)))
    found = [
        _change(effect, *pair, lambda values: effect.acceleration(tangent.motion, pendulum, values))
        for pair in changes
    ]
    forces = [force for force in found if force is not None]
    # A few at a time stay in the processor's cache.
    for first in range(0, len(forces), _AT_ONCE):
        part = slice(first, first + _AT_ONCE)
        total[part] += sampled.change(*tangent.of_force(np.stack(forces[part])))
    if effect.kick(changes[0][1]) is not None:
        total += at.after_kicks([effect.kick(high) for _, high in changes])
        total -= at.after_kicks([effect.kick(low) for low, _ in changes])
    for row, pair in enumerate(changes):
        added = _change(effect, *pair, lambda values: effect.reading(sampled, pendulum, values))
        if added is not None:
            total[row] += added
        late = _change(effect, *pair, lambda values: effect.delay(sampled.time_s, values))
        if late is not None:
            total[row] += sampled.velocity * late
    return total


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


def jacobian(model: Model, value: FloatArray, at: Evaluated) -> FloatArray:
    """Derivatives of the readings by all values, shape (n, size)."""
    if at.parts:
        return np.concatenate([part.own @ part.mixing for part in at.parts])
    sampled, tangent = at.sampled, at.tangent
    pendulum = model.pendulum(value)
    columns = np.empty((len(model.time_s), model.size))
    losses = [A, B, C, SHARE]
    columns[:, losses] = sampled.change(
        *tangent.of_force(np.stack([_by_loss(model, value, at, index) for index in losses]))
    ).T
    columns[:, OMEGA] = _by_omega(model, value, at)
    columns[:, START] = at.by_start() / value[START]
    columns[:, TIME] = -sampled.velocity
    columns[:, OFFSET] = 1.0
    for effect, place in model.places():
        if isinstance(effect, Curve):
            columns[:, place] = _by_coefficients(effect, at, pendulum).T
            continue
        for index in range(effect.count):
            columns[:, place.start + index] = _derivative(effect, value[place], index, at, pendulum)
    return columns


def _by_coefficients(curve: Curve, at: Evaluated, pendulum: Pendulum) -> FloatArray:
    """Derivatives by a curve's values, shape (values, n): it is linear in them."""
    small = curve.small(at.span)
    none = np.zeros(curve.count)
    one_each = [(none, row) for row in small * np.eye(curve.count)]
    return responses(curve, one_each, at, pendulum) / small


def _by_loss(model: Model, value: FloatArray, at: Evaluated, index: int) -> FloatArray:
    """Derivative of the acceleration by one of the baseline's losses; it is linear in them."""
    moved = value.copy()
    moved[index] += max(1e-3 * abs(float(value[index])), 1e-6)
    motion = at.tangent.motion
    change = model.acceleration(motion, moved) - model.acceleration(motion, value)
    return np.asarray(change / (moved[index] - value[index]))


def _by_omega(model: Model, value: FloatArray, at: Evaluated) -> FloatArray:
    motion, step = at.tangent.motion, 1e-6 * value[OMEGA]
    moved = value.copy()
    moved[OMEGA] += step
    other = Motion(
        motion.clock, float(moved[OMEGA]), motion.log_amplitude, motion.time_s, motion.upwards
    )
    new = rates(lambda m: model.acceleration(m, moved), other)
    old = at.tangent.rates
    loss, pace = (new.loss - old.loss) / step, (new.pace - old.pace) / step
    return at.sampled.change(*at.tangent.of_rates(loss, pace))


def _derivative(
    effect: Effect, values: FloatArray, index: int, at: Evaluated, pendulum: Pendulum
) -> FloatArray:
    """Derivative of the readings by one value of one effect, along the motion."""
    low, high = values.copy(), values.copy()
    step = _step(effect, values, index, at.span)
    low[index] -= step
    high[index] += step
    return np.asarray(response(effect, low, high, at, pendulum) / (2.0 * step))


def _step(effect: Effect, values: FloatArray, index: int, span: Span) -> float:
    if index < effect.sizes:
        return max(effect.small(span), 1e-4 * abs(float(values[index])))
    if effect.parameters[index - effect.parameter_free].name == "time":
        # Over several readings, or the one that is crossed decides.
        return min(2.0 * span.interval_s, 0.0625 * span.period_s)
    return max(1e-4 * abs(float(values[index])), 1e-9)
