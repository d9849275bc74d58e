"""Derivatives of whitened readings by the sizes of effects, and their projection.

The part that a model's own parameters can reproduce is projected out; the score is the inner
product of the rest, at unit length, with the whitened residual: the locally most powerful test.

A long record is divided into blocks of cycles, of which the middle one stands for all. What an
effect changes varies slowly from cycle to cycle, so that the harmonics of the motion in
each block of neighbouring cycles tell nearly all of it. The readings enter by their least-squares
harmonics in each block, whitened; what changes them is computed in the middle cycle alone, and
stands for as many readings as the block has. So the scan of a catalogue costs what a thousand
cycles do, however many there are. A test is as exact as with all readings, since any part of
white noise is white; what changes faster than a block lasts (a knock's first cycles, a tone) is
seen less, and tones have their own scan.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from scipy.fft import idct
from scipy.special import betainc, chdtrc

from pendpipe.arrays import FloatArray, IntArray
from pendpipe.diagnosis.noise import Noise
from pendpipe.diagnosis.refine import Fit, pulled, span_of
from pendpipe.diagnosis.released_parameters import ReleasedParameter
from pendpipe.effects import Effect
from pendpipe.effects.model import responses
from pendpipe.score import unit_rows

_KNOWN: Final = 1e-6
"""Variance of ln S below which it is known."""


def tangent_basis(fit: Fit) -> FloatArray:
    """Return an orthonormal basis of the derivatives by the fitted values.

    Values at a bound are included, unless the readings pull them far beyond it.
    """
    known = pulled(fit)
    return span_of(fit.jacobian[:, [index for index in fit.free if index not in known]])


def whitened(
    fit: Fit, noise: Noise, effect: Effect, shapes: Sequence[Sequence[float]]
) -> FloatArray:
    """Derivatives of the whitened readings by each size of each shape, (columns, n + 1)."""
    if isinstance(effect, ReleasedParameter):
        return effect.sensitivity(fit)[None]
    small = effect.small(fit.at.span)
    changes = [_sizes(effect, shape, k, small) for shape in shapes for k in range(effect.sizes)]
    raw = responses(effect, changes, fit.at, fit.model.pendulum(fit.value))
    raw /= small
    raw[~np.isfinite(raw.sum(axis=1))] = 0.0
    rows = np.zeros((len(raw), len(fit.jacobian)))
    rows[:, :-1] = noise.whiten(raw.T).T
    return rows


def _sizes(
    effect: Effect, shape: Sequence[float], index: int, small: float
) -> tuple[FloatArray, FloatArray]:
    low = np.concatenate([np.zeros(effect.sizes), np.asarray(shape, dtype=np.float64)])
    high = low.copy()
    high[index] = small
    return low, high


def scores_and_lengths(
    base: Fit, noise: Noise, effect: Effect, shapes: Sequence[Sequence[float]]
) -> tuple[FloatArray, FloatArray]:
    """Score shapes of an effect's first size on a fit's residual.

    Returns
    -------
    scores, lengths
        Inner products of the residual with the derivative by the size, projected and of unit
        length, and the lengths of that (inf where nothing remains); shape (shapes,). The size is
        score/length, and lowers chi^2 by score^2.
    """
    rows = whitened(base, noise, effect, shapes)[:: effect.sizes]
    units, lengths = unit_rows(rows, tangent_basis(base))
    return units @ base.residual, lengths


def finer_shape(
    base: Fit, noise: Noise, effect: Effect, shape: tuple[float, ...]
) -> tuple[float, ...]:
    """Return the shape of highest score among those near a scan's best (`Effect.finer`).

    A fit alone would end beside it: the response to a knock, say, depends on its phase, so that
    chi^2 has a minimum in each half cycle, while the scan's shapes are farther apart.
    """
    shapes = [tuple(row) for row in effect.finer(base.at.span, shape)] if shape else []
    if not shapes:
        return shape
    shapes.append(shape)
    scores, _ = scores_and_lengths(base, noise, effect, shapes)
    return shapes[int(np.argmax(np.abs(scores)))]


def local_p_values(
    scores: FloatArray, freedom: NDArray[Any], log_scale_variance: FloatArray | None = None
) -> FloatArray:
    """Return the probability that chance alone does better, for each candidate by itself.

    Where the variance of the noise is uncertain, by v in its logarithm, as if it were estimated
    from 2/v squares: by Fisher's distribution instead of chi^2.
    """
    found = np.asarray(chdtrc(freedom, np.maximum(scores, 0.0).T).T)
    if log_scale_variance is not None:
        unsure = log_scale_variance > _KNOWN
        squares = 2.0 / log_scale_variance[unsure]
        share = squares / (squares + scores[unsure])
        found[unsure] = betainc(0.5 * squares, 0.5 * freedom[unsure], share)
    return found


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
