"""A long record as blocks of cycles, of which the middle one stands for all.

What an effect changes varies slowly from cycle to cycle, so that the harmonics of the motion in
each block of neighbouring cycles tell nearly all of it. The readings enter by their least-squares
harmonics in each block, whitened; what changes them is computed in the middle cycle alone, and
stands for as many readings as the block has. So the scan of a catalogue costs what a thousand
cycles do, however many there are. A test is as exact as with all readings, since any part of
white noise is white; what changes faster than a block lasts (a knock's first cycles, a tone) is
seen less, and tones have their own scan.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray
from scipy.fft import idct

from pendpipe.arrays import FloatArray, IntArray
from pendpipe.diagnosis.noise import Noise

if TYPE_CHECKING:
    from pendpipe.diagnosis.refine import Fit

_MANY: Final = 16_000
"""Readings from which on they are compared in blocks."""
_SHORTEST: Final = 100.0
"""Cycles over the square of those in a block: longer records have longer blocks, and more."""
_HARMONICS: Final = 12
"""Of the motion that a block keeps: the thirteenth has 5e-10 of a swing of 90 degrees."""
_REGULAR: Final = 1e-9
"""Part of a block's readings that is added to its Gram matrix, for the blocks that are masked."""


@dataclass(frozen=True, kw_only=True)
class BlockNoise(Noise):
    """The noise of the numbers of blocks, which `Noise` is of the readings.

    Parameters
    ----------
    phase, edges
        The phase of each reading, shape (n,), and the first reading of each block and of what
        follows it, shape (2, blocks).
    factor
        Triangular factors of the Gram matrices of the harmonics, shape (blocks, numbers, numbers).
    mixing
        From the readings of a middle cycle to its block's numbers, shape (blocks, numbers, length).
    order
        The numbers of all blocks, those of low frequencies first, shape (m,).
    cosine
        The cosine of the whole record that each of these lies at, shape (m,).
    """

    phase: FloatArray
    edges: IntArray
    factor: FloatArray
    mixing: FloatArray
    order: IntArray
    cosine: IntArray

    def whiten(self, columns: FloatArray) -> FloatArray:
        """Turn readings of the middle cycles (or columns of them) into the blocks' numbers."""
        blocks, numbers, length = self.mixing.shape
        found = self.mixing @ columns.reshape(blocks, length, -1)
        return np.asarray(found.reshape(blocks * numbers, *columns.shape[1:])[self.order])

    def numbers_of(self, residual: FloatArray) -> FloatArray:
        """Return the numbers of all whitened readings, with the prior's entry behind."""
        white = idct(residual[:-1], norm="ortho") if self.coloured else residual[:-1]
        most = self.factor.shape[1] // 2
        sums = _harmonic_sums(self.phase, self.weight * white, self.edges, most)
        parts = np.concatenate([sums.real, sums.imag[:, 1:]], axis=1)
        found = np.linalg.solve(self.factor, parts[..., None]).reshape(-1)
        return np.append(found[self.order], residual[-1])

    def energy_in_bins(self, rows: FloatArray) -> FloatArray:
        """Return the squares of unit columns in each bin of S, shape (k, bins)."""
        power = rows[:, : len(self.cosine)] ** 2
        sums = np.cumsum(np.pad(power, ((0, 0), (1, 0))), axis=1, dtype=np.float64)
        edges = np.searchsorted(self.cosine, [*self.starts, len(self.variance)])
        return np.asarray(np.diff(sums[:, edges], axis=1))


def blocks_of(fit: Fit, noise: Noise) -> tuple[Fit, Noise]:
    """Divide a long record into blocks: a fit with residual and derivatives in their numbers."""
    sampled = fit.at.sampled
    cycle = sampled.half_cycle // 2
    if fit.at.parts or len(cycle) < _MANY:
        return fit, noise
    counts = np.bincount(cycle)
    every = 2 * int(0.5 * math.sqrt(len(counts) / _SHORTEST)) + 1
    middle = np.arange(every // 2, len(counts) - every // 2, every)
    length = int(np.median(counts[middle])) - 1
    most = min(_HARMONICS, (length - 2) // 2)
    # At the ends of the record a cycle is not whole.
    middle = middle[counts[middle] >= length]
    if most < 1 or len(middle) < 2:
        return fit, noise
    first = np.searchsorted(cycle, middle)
    rows = first[:, None] + np.arange(length)
    edges = np.searchsorted(cycle, [middle - every // 2, middle + every // 2 + 1])
    factor = _factor(sampled.phase, noise.weight, edges, most)
    harmonic = np.concatenate([np.arange(most + 1), np.arange(1, most + 1)])
    turned = sampled.phase[rows][..., None] * harmonic
    waves = np.where(np.arange(len(harmonic)) <= most, np.cos(turned), np.sin(turned))
    pace = np.ptp(sampled.phase[rows], axis=1) / (length - 1)
    cosine = np.rint(len(cycle) / math.pi * pace[:, None] * harmonic).astype(np.int64)
    cosine = np.minimum(cosine, len(cycle) - 1)
    scale = np.ones(rows.shape) if noise.level is None else 1.0 / noise.level[rows]
    gain = 1.0 / np.sqrt(noise.variance[cosine])
    mixing = np.swapaxes(factor, 1, 2) @ (gain[..., None] * np.linalg.pinv(waves))
    order = np.argsort(cosine.reshape(-1), kind="stable")
    own = BlockNoise(
        **vars(noise),
        phase=sampled.phase,
        edges=edges,
        factor=factor,
        mixing=mixing * scale[:, None],
        order=order,
        cosine=cosine.reshape(-1)[order],
    )
    model, value = fit.model, fit.value
    at = fit.at.thinned(every, rows.reshape(-1), model.law(value))
    compared = replace(fit.evaluation, at=at, residual=own.numbers_of(fit.residual), noise=own)
    return replace(fit, evaluation=compared), own


def _harmonic_sums(
    phase: FloatArray, values: FloatArray, edges: IntArray, most: int
) -> NDArray[np.complex128]:
    """Sum values e^(i k phase) over each block, k from 0 to `most`; shape (blocks, most + 1)."""
    turn = np.exp(1j * phase)
    wave = values.astype(np.complex128)
    found = np.empty((edges.shape[1], most + 1), dtype=np.complex128)
    for k in range(most + 1):
        total = np.append(0.0, np.cumsum(wave))
        found[:, k] = total[edges[1]] - total[edges[0]]
        wave *= turn
    return found


def _factor(phase: FloatArray, weight: FloatArray, edges: IntArray, most: int) -> FloatArray:
    """Return the triangular factors of the Gram matrices of 1, cos k psi, sin k psi."""
    sums = _harmonic_sums(phase, weight**2, edges, 2 * most)
    k = np.arange(most + 1)
    apart, together = k - k[:, None], k + k[:, None]
    near = sums[:, np.abs(apart)]
    far = sums[:, together]
    both = 0.5 * (near.real + far.real)
    sines = 0.5 * (near.real - far.real)[:, 1:, 1:]
    mixed = 0.5 * (far.imag + np.sign(apart) * near.imag)[:, :, 1:]
    gram = np.concatenate(
        [
            np.concatenate([both, mixed], axis=2),
            np.concatenate([np.swapaxes(mixed, 1, 2), sines], axis=2),
        ],
        axis=1,
    )
    size = (edges[1] - edges[0])[:, None, None]
    return np.asarray(np.linalg.cholesky(gram + _REGULAR * size * np.eye(gram.shape[1])))
