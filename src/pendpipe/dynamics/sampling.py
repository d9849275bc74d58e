"""A motion read at given times."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Final

import numpy as np
from numpy.polynomial import chebyshev

from pendpipe.arrays import FloatArray, IntArray
from pendpipe.dynamics.any_law import Motion
from pendpipe.dynamics.chebyshev import analysis, lobatto_nodes

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

    @property
    def angle(self) -> FloatArray:
        """x, rad, from the equilibrium."""
        return self.motion.upwards * self.amplitude * self.cosine

    @property
    def velocity(self) -> FloatArray:
        """x', rad/s."""
        omega = self.motion.angular_frequency
        return -self.motion.upwards * omega * self.amplitude * self.sine

    @property
    def direction(self) -> FloatArray:
        """Sign of the velocity."""
        return np.asarray(np.where(self.motion.upwards * self.sine > 0.0, -1.0, 1.0))

    def at_nodes(self, values: FloatArray) -> FloatArray:
        """Interpolate what is known at the motion's nodes, shape (..., count, order + 1)."""
        return interpolated(_at_finer(values), self._first, self._weights)

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
    order = _FINER * motion.clock.order
    nodes = _at_finer(motion.time_s)
    behind = np.searchsorted(nodes.reshape(-1), time_s)
    half = np.clip((behind - 1) // (order + 1), 0, len(nodes) - 1)
    left = np.clip(behind - half * (order + 1) - _POINTS // 2, 0, order + 1 - _POINTS)
    first = (half * (order + 1) + left).astype(np.intp)
    weights = lagrange(nodes.reshape(-1), first, time_s)
    omega = motion.angular_frequency
    slow = replace(motion.clock, order=order).psi - omega * (nodes - nodes[0, 0])
    finer = np.stack([slow, _at_finer(motion.log_amplitude)])
    late, log_amplitude = interpolated(finer, first, weights)
    phase = omega * (time_s - nodes[0, 0]) + late
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
    """Interpolate what is known at the nodes, shape (..., count, order + 1), by six of them."""
    index = first + np.arange(_POINTS)[:, None]
    flat = values.reshape(-1, values.shape[-2] * values.shape[-1])
    found = np.empty((len(flat), len(first)))
    # A row at a time stays in the processor's cache.
    for row, out in zip(flat, found, strict=True):
        np.einsum("pn,pn->n", row.take(index, mode="clip"), weights, out=out)
    return found.reshape(*values.shape[:-2], -1)


def lagrange(nodes: FloatArray, first: IntArray, time_s: FloatArray) -> FloatArray:
    """Weights of the six nodes from `first` on at each time, shape (6, n).

    The nodes at the ends of a motion lie close together: beyond, only three are used.
    """
    weights = _through(nodes, first, time_s, range(_POINTS))
    half = _POINTS // 2
    for outside, points in (
        (time_s < nodes[0], range(half)),
        (time_s > nodes[-1], range(half, _POINTS)),
    ):
        if outside.any():
            weights[:, outside] = 0.0
            near = _through(nodes, first[outside], time_s[outside], points)
            weights[points.start : points.stop, outside] = near
    return weights


def _through(
    nodes: FloatArray, first: IntArray, time_s: FloatArray, points: Sequence[int]
) -> FloatArray:
    """Lagrange's weights of some nodes behind `first`."""
    near = [nodes[first + point] for point in points]
    weights = np.empty((len(near), len(time_s)))
    for own, node in enumerate(near):
        product = np.ones_like(time_s)
        for other in (*near[:own], *near[own + 1 :]):
            product = product * (time_s - other) / (node - other)
        weights[own] = product
    return weights
