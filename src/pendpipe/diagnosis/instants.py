"""Instants of sudden effects: chi^2 has a minimum in each half cycle about the true one."""

import math
from collections.abc import Iterable
from dataclasses import replace
from statistics import NormalDist
from typing import Final

import numpy as np

from pendpipe.arrays import FloatArray
from pendpipe.diagnosis.data import Data
from pendpipe.diagnosis.noise import Noise
from pendpipe.diagnosis.projection import scores_and_lengths
from pendpipe.diagnosis.refine import Fit, best_fit, better
from pendpipe.effects import Effect
from pendpipe.effects.catalogue.reading import DroppedSamples, OffsetStep
from pendpipe.estimate import Z95, Estimate

_TAILS: Final = (0.025, 0.975)
"""Of a 95 % interval."""
_NEAR_CHI2: Final = 24.0
"""Largest deficit in chi^2 of scanned instants between which more are computed."""
_PER_CYCLE: Final = 16
"""Instants computed in a cycle."""
_MOST_BETWEEN: Final = 400
"""Largest number of instants between two of a scan."""
_NORMAL_POINTS: Final = np.array([NormalDist().inv_cdf((k + 0.5) / 41) for k in range(41)])
"""Quantiles of a normal distribution, of equal probability."""


def with_instants(
    estimates: dict[str, Estimate],
    effect: Effect,
    without: Fit,
    noise: Noise,
    error_scale: float = 1.0,
) -> dict[str, Estimate]:
    """Widen the intervals of an effect's size and instant to all possible instants.

    Parameters
    ----------
    estimates
        By name, from the curvature at the best instant.
    effect
        A sudden effect: its first parameter is the size, its last the instant.
    without
        The fit without it.
    noise
        Of the readings.
    error_scale
        Factor on all standard deviations, for a misfit beyond the noise.

    Returns
    -------
    dict of str to Estimate
        With intervals that hold those of the curvature and the equal-tailed ones of the posterior
        over all instants, for a uniform prior and with the size integrated out:
        p(t) ~ exp(S(t)/2)/|column(t)|, where S is the fall of chi^2 by an effect at t, to first
        order in its size: its centre is off by the second. sd is at least their half width over
        1.96.
    """
    if not effect.local or len(effect.parameters) != 2 or effect.sizes != 1:
        return estimates
    size, instant = (estimates[parameter.name] for parameter in effect.parameters)
    span = without.at.span
    rows = [*effect.shapes(span), *effect.finer(span, (instant.value,))]
    rough = np.unique([*(float(row[0]) for row in rows), instant.value])
    scores, _ = scores_and_lengths(without, noise, effect, rough[:, None].tolist())
    time_s, spacing = _between(rough, scores**2, span.period_s / _PER_CYCLE, error_scale)
    scores, lengths = scores_and_lengths(without, noise, effect, time_s[:, None].tolist())
    weight = np.exp(0.5 * (scores**2 - np.max(scores**2)) / error_scale**2) * spacing / lengths
    sizes = (scores[:, None] + error_scale * _NORMAL_POINTS) / lengths[:, None]
    shared = np.repeat(weight, len(_NORMAL_POINTS))
    return {
        **estimates,
        effect.parameters[0].name: _widened(size, _quantiles(sizes.ravel(), shared)),
        effect.parameters[1].name: _widened(instant, _quantiles(time_s, weight)),
    }


def _between(
    rough: FloatArray, scores: FloatArray, step: float, error_scale: float
) -> tuple[FloatArray, FloatArray]:
    """Return instants near the best of a scan, with the interval that each represents."""
    near = scores > scores.max() - _NEAR_CHI2 * error_scale**2
    times, spacings = [], []
    for position in np.flatnonzero(near[:-1] | near[1:]).tolist():
        low, high = float(rough[position]), float(rough[position + 1])
        number = min(max(math.ceil((high - low) / step), 1), _MOST_BETWEEN)
        edges = np.linspace(low, high, number + 1)
        times.append(0.5 * (edges[1:] + edges[:-1]))
        spacings.append(np.diff(edges))
    return np.concatenate(times), np.concatenate(spacings)


def _quantiles(values: FloatArray, weights: FloatArray) -> tuple[float, float]:
    order = np.argsort(values)
    below = np.cumsum(weights[order])
    low, high = np.interp(
        np.array(_TAILS) * below[-1], below - 0.5 * weights[order], values[order]
    ).tolist()
    return float(low), float(high)


def _widened(estimate: Estimate, interval: tuple[float, float]) -> Estimate:
    """Return the estimate with both intervals, and a larger standard deviation if it is wider."""
    ends = estimate.bounds95
    low, high = min(interval[0], ends[0]), max(interval[1], ends[1])
    sd = max(estimate.sd, 0.5 * (high - low) / Z95)
    return replace(estimate, sd=sd, interval95=(low, high))


_SEARCH_WIDTHS: Final = (2.0, 0.125)
"""Range about an instant that is searched, in intervals between readings; the second is finer."""
_SHIFTS: Final = np.linspace(-1.0, 1.0, 33)
"""Places in the range that are tried: an eighth of an interval apart at first, then 1/128."""


def with_better_instants(fit: Fit, data: Data, noise: Noise, held: Iterable[int]) -> Fit:
    """Try instants about each loss of samples and jump of the reading, and refine from the best.

    After lost samples a reading may lie beyond the turning point. How far the jump reaches into
    the neighbouring interval then has several solutions; Gauss-Newton finds the nearest only.

    Parameters
    ----------
    fit
        A fitted model.
    data, noise
        The readings.
    held
        Indices of what is not fitted.
    """
    fixed = tuple(held)
    for effect, position in fit.model.places():
        if not isinstance(effect, DroppedSamples | OffsetStep):
            continue  # other effects change little from one reading to the next
        for width in _SEARCH_WIDTHS:
            instant = np.arange(len(fit.value)) == position.stop - 1
            starts = [fit.value + shift * width * data.interval_s * instant for shift in _SHIFTS]
            fit = better(fit, best_fit(fit.model, data, noise, starts, held=fixed)) or fit
    return fit
