"""Two modes that beat: their frequencies and losses, from the readings."""

import math
from itertools import pairwise
from typing import Final, NamedTuple

import numpy as np

from pendpipe.arrays import AnyArray, FloatArray, of_neighbours
from pendpipe.estimate import Estimate
from pendpipe.solve import Bounds, NoStartError, minimise, squares

_WINDOWS: Final = 120
"""Of a record at most: fifteen beats of eight each."""
_FEWEST: Final = 10
"""Windows, each of a period or more, that two modes need: they have eight numbers."""
_STEPS: Final = 12
"""Undamped Newton steps at most."""
_APART: Final = 0.3
"""Of the frequency: farther apart they do not beat, and the half period says little."""
_EXPLAINED: Final = 0.9
"""Part of the variance that two modes must explain: of the motion, of what one mode leaves, and in
each third of the record where it swings."""
_THIRDS: Final = 3
"""Parts of a record that two modes must each explain: one mode and a jump explain two."""
_STILL: Final = 0.01
"""Part of the variance below which a third of the record does not count."""


class Mode(NamedTuple):
    """One damped mode."""

    frequency: Estimate
    """Hz."""
    loss: Estimate
    """Relative loss of amplitude, 1/s."""
    amplitude: Estimate
    """At the first reading, in the unit of the readings."""
    phase_rad: float
    """At the first reading; 0 at a turning point on the positive side."""

    @property
    def driven(self) -> bool:
        """Whether it does not decay."""
        return self.loss.value < 3.0 * self.loss.sd


def two_modes(
    time_s: FloatArray,
    values: FloatArray,
    half_period_s: float,
    *,
    may_be_one: bool = False,
    decay_s: tuple[float, float] = (math.inf, math.inf),
) -> tuple[Mode, Mode] | None:
    """Fit two damped modes and a level to readings.

    Parameters
    ----------
    time_s, values
        The readings, shape (n,); times may be uneven.
    half_period_s
        The half period, roughly.
    may_be_one
        Whether one decay might explain the readings as well: then two modes must explain most of
        what one leaves, and each third of the record.

    Returns
    -------
    tuple of Mode or None
        The stronger first; None where two modes leave more than a tenth of the variance.

    Notes
    -----
    The motion's slow complex amplitude is the sum of two complex exponentials. These are the
    eigenvalues of the step from one part of its strongest two-dimensional signal space to the next
    (ESPRIT), at which a fit of all readings begins.
    """
    found = _fitted(time_s, values, half_period_s, 2)
    if found is None or not _explained(found[-1], values):
        return None
    rates, size, design, residual = found
    decay = slice(*np.searchsorted(time_s, decay_s))
    alone = _fitted(time_s[decay], values[decay], half_period_s, 1)
    if alone and _explained(alone[-1], residual[decay]):
        return None
    if may_be_one:
        one = _fitted(time_s, values, half_period_s, 1)
        thirds = [np.array_split(each, _THIRDS) for each in (residual, values)]
        still = _STILL * float(np.var(values))
        if one and not _explained(residual, one[-1]):
            return None
        if not all(
            _explained(*third) for third in zip(*thirds, strict=True) if np.var(third[1]) > still
        ):
            return None
    inverse = np.linalg.pinv(design)
    # What two modes leave is smooth: its neighbours tell the same.
    scale = math.sqrt(float(np.var(residual)) * of_neighbours(residual, 0.98))
    error = scale * np.linalg.norm(inverse, axis=1)
    modes = [
        Mode(
            Estimate(float(rates[k].imag) / (2.0 * math.pi), error[7 + k] / (2.0 * math.pi), "Hz"),
            Estimate(-float(rates[k].real), float(error[5 + k]), "1/s"),
            Estimate(float(abs(size[k])), float(error[1 + k]), ""),
            float(np.angle(size[k])),
        )
        for k in np.argsort(-np.abs(size))
    ]
    return modes[0], modes[1]


def _explained(residual: FloatArray, values: FloatArray) -> bool:
    return bool(np.var(residual) < (1.0 - _EXPLAINED) * np.var(values))


def _fitted(
    time_s: FloatArray, values: FloatArray, half_period_s: float, count: int
) -> tuple[AnyArray, AnyArray, FloatArray, FloatArray] | None:
    """Fit some modes and a level.

    None where the readings are few, or one of the modes does not beat with the motion.

    Returns
    -------
    rates, size
        Complex, shape (k,).
    design, residual
        The derivatives of the readings, and what is left of these, shape (n,).
    """
    if len(time_s) == 0:
        return None
    slow, time = math.pi / half_period_s, time_s - time_s[0]
    width = max(2.0 * half_period_s, float(time[-1]) / _WINDOWS)
    edges = np.searchsorted(time, np.arange(0.0, time[-1], width))
    amplitude = slow_amplitude(slow * time, values, edges.tolist())
    if len(amplitude) < _FEWEST:
        return None
    rows = np.lib.stride_tricks.sliding_window_view(amplitude, len(amplitude) // 2 + 1)
    space = np.linalg.svd(rows, full_matrices=False)[2][:count].T
    step = np.linalg.lstsq(space[:-1], space[1:], rcond=None)[0]
    rates = np.log(np.linalg.eigvals(step)) / width + 1j * slow
    waves = np.exp(np.outer(time, rates))
    columns = np.stack([np.ones_like(time), *waves.real.T, *waves.imag.T], axis=1)
    level_and_sizes = np.linalg.lstsq(columns, values, rcond=None)[0]
    start = np.array([*level_and_sizes, *rates.real, *rates.imag])
    # Each number's own chance is small against the scatter of what the start leaves.
    scale = math.sqrt(max(float(np.mean((values - columns @ level_and_sizes) ** 2)), 1e-300))

    def residual(value: FloatArray) -> FloatArray:
        rates, size = _complex(value, count)
        waves = np.exp(np.outer(time, rates))
        return np.asarray((values - value[0] - (waves * size).real.sum(axis=1)) / scale)

    def derivatives(value: FloatArray) -> FloatArray:
        rates, size = _complex(value, count)
        waves = np.exp(np.outer(time, rates))
        by_rate = time[:, None] * waves * size
        parts = waves.real, waves.imag, by_rate.real, -by_rate.imag
        return np.concatenate([np.ones((len(time), 1)), *parts], axis=1) / scale

    low, high = bounds = Bounds.none(len(start))
    low[-2 * count : -count], high[-2 * count : -count] = -_APART * slow, _APART * slow
    low[-count:], high[-count:] = (1.0 - _APART) * slow, (1.0 + _APART) * slow
    try:
        found = minimise(squares(residual, derivatives, bounds), start, rounds=_STEPS)
    except NoStartError:
        return None
    if not np.all((low < found.value) & (found.value < high)):
        return None
    design, left = scale * derivatives(found.value), scale * residual(found.value)
    return *_complex(found.value, count), design, left


def _complex(value: FloatArray, count: int) -> tuple[AnyArray, AnyArray]:
    """The complex rates and sizes of modes, from a level and their real and imaginary parts."""
    _, cosine, sine, grown, turned = np.split(value, np.cumsum([1, count, count, count]))
    return grown + 1j * turned, cosine - 1j * sine


def slow_amplitude(
    phase: FloatArray, values: FloatArray, edges: list[int], *, slopes: bool = False
) -> AnyArray:
    """Complex amplitude between neighbouring edges, each about its own level.

    With `slopes` it may change within; without, a loss of g a cycle turns it by g/(2 pi).
    """
    found, numbers = [], 5 if slopes else 3
    for first, last in pairwise(edges):
        own = phase[first:last]
        wave = np.exp(-1j * own)
        # Twice the numbers of a level and a wave, which are told from as many readings.
        if last - first < 2 * numbers:
            break
        columns = [np.ones(len(wave)), wave.real, wave.imag]
        if slopes:
            late = own - 0.5 * (own[0] + own[-1])
            columns += [late * wave.real, late * wave.imag]
        design = np.stack(columns, axis=1)
        _, cosine, sine, *_ = np.linalg.lstsq(design, values[first:last], rcond=None)[0]
        found.append(cosine + 1j * sine)
    return np.array(found)
