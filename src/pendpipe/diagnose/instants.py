"""How well an instant is known: chi^2 has a minimum in each half cycle about it."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace
from statistics import NormalDist
from typing import Final, NamedTuple

import numpy as np

from pendpipe.arrays import FloatArray
from pendpipe.diagnose.data import Data
from pendpipe.diagnose.noise import Noise
from pendpipe.diagnose.refine import Fit, misfit, refine
from pendpipe.diagnose.scores import products_and_lengths
from pendpipe.dynamics.any_law import NoMotionError
from pendpipe.effects import Effect
from pendpipe.effects.catalogue.time_base import DroppedSamples
from pendpipe.estimate import Estimate

_TAILS: Final = (0.025, 0.975)
_SD: Final = 1.959963984540054
_NEAR: Final = 24.0
"""chi^2 by which the rows of a scan may lie behind, for what is between them to be looked at."""
_A_CYCLE: Final = 16
"""Instants in a cycle, where it matters."""
_MOST: Final = 400
"""Instants between two rows of a scan, at most."""
_POINTS: Final = np.array([NormalDist().inv_cdf((k + 0.5) / 41) for k in range(41)])
"""A normal distribution in points of equal probability."""


def with_instants(
    told: dict[str, Estimate], effect: Effect, without: Fit, noise: Noise, spread: float = 1.0
) -> dict[str, Estimate]:
    """Widen the intervals of an effect's size and instant over all instants that may be it.

    Parameters
    ----------
    told
        Estimates by name, from the curvature at the best instant.
    effect
        What happened at an instant: its first parameter is the size, its last the instant.
    without
        The model without it, fitted.
    noise
        The readings'.
    spread
        Factor of all standard deviations, for what is left beyond the noise.

    Returns
    -------
    dict of str to Estimate
        With equal-tailed intervals of the posterior over all instants, each as likely
        beforehand, the size integrated out: p(t) ~ exp(S(t)/2)/|column(t)|, where S is what an
        effect at t takes off chi^2, to first order in its size. Where they are wider than the
        curvature's, sd is their half width over 1.96.
    """
    if not effect.local or len(effect.parameters) != 2 or effect.sizes != 1:
        return told
    size, instant = (told[parameter.name] for parameter in effect.parameters)
    span = without.at.span
    rows = [*effect.shapes(span), *effect.finer(span, (instant.value,))]
    rough = np.unique([*(float(row[0]) for row in rows), instant.value])
    time_s, spacing = _between(
        rough, _scored(without, noise, effect, rough).scores, span.period_s / _A_CYCLE, spread
    )
    found = _scored(without, noise, effect, time_s)
    weight = np.exp(0.5 * (found.scores - found.scores.max()) / spread**2)
    weight *= spacing / found.lengths
    sizes = found.sizes[:, None] + spread / found.lengths[:, None] * _POINTS
    shared = np.repeat(weight, len(_POINTS))
    return {
        **told,
        effect.parameters[0].name: _widened(size, _quantiles(sizes.ravel(), shared)),
        effect.parameters[1].name: _widened(instant, _quantiles(time_s, weight)),
    }


class _Scored(NamedTuple):
    """The best size at each instant, and the length of what a unit of it does."""

    sizes: FloatArray
    lengths: FloatArray

    @property
    def scores(self) -> FloatArray:
        return np.asarray((self.sizes * self.lengths) ** 2)


def _scored(without: Fit, noise: Noise, effect: Effect, time_s: FloatArray) -> _Scored:
    products, lengths = products_and_lengths(without, noise, effect, time_s[:, None].tolist())
    lengths = np.where(lengths > 0.0, lengths, np.inf)
    return _Scored(products / lengths**2, lengths)


def _between(
    rough: FloatArray, scores: FloatArray, step: float, spread: float
) -> tuple[FloatArray, FloatArray]:
    """Instants between the rows that are near the best, with the time that each stands for."""
    near = scores > scores.max() - _NEAR * spread**2
    times, spacings = [], []
    for place in np.flatnonzero(near[:-1] | near[1:]).tolist():
        low, high = float(rough[place]), float(rough[place + 1])
        number = min(max(math.ceil((high - low) / step), 1), _MOST)
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
    """Take an interval, and the standard deviation with it where it is the wider."""
    low, high = min(interval[0], estimate.value), max(interval[1], estimate.value)
    sd = max(estimate.sd, 0.5 * (high - low) / _SD)
    return replace(estimate, sd=sd, interval95=(low, high))


_WIDTHS: Final = (2.0, 0.125)
"""How far about an instant is looked, in intervals between readings: then again, closer."""
_SHIFTS: Final = np.linspace(-1.0, 1.0, 33)
_WORTH: Final = 1.0
"""By how much chi^2 must be lower beside an instant, for the fit to go on from there."""


def with_better_instants(fit: Fit, data: Data, noise: Noise, held: Iterable[int]) -> Fit:
    """Try the instants about each loss of samples, and refine from the best.

    Parameters
    ----------
    fit
        A model at its best values, as far as a fit went.
    data, noise
        The readings.
    held
        Indices of what is not fitted.
    """
    fixed = tuple(held)
    for effect, place in fit.model.places():
        if not isinstance(effect, DroppedSamples):
            continue  # others change little from one reading to the next
        for width in _WIDTHS:
            start = _best_beside(fit, data, noise, place.stop - 1, width * data.interval_s)
            if start is None:
                continue
            better = refine(fit.model, data, noise, start, held=fixed)
            fit = better if better.chi2 < fit.chi2 else fit
    return fit


def _best_beside(
    fit: Fit, data: Data, noise: Noise, instant: int, width_s: float
) -> FloatArray | None:
    """The values with one instant moved to where chi^2 is least; None where it stays."""
    least, best = fit.chi2 - _WORTH, None
    for shift in _SHIFTS:
        value = fit.value.copy()
        value[instant] += shift * width_s
        try:
            there = misfit(fit.model, data, noise, value)
        except NoMotionError:
            continue
        if there < least:
            least, best = there, value
    return best
