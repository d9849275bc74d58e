"""A model at given values, and what small changes of the motion do to its readings."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from pendpipe.arrays import FloatArray
from pendpipe.dynamics.any_law import Tangent
from pendpipe.dynamics.sampling import Sampled, sample_motion
from pendpipe.effects.effect import Kick, Span


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
