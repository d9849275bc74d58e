"""The equilibrium level under the half cycles: a constant, or a slow wander."""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np

from pendpipe.arrays import FloatArray

_WINDOWS: Final = (6, 10, 16, 26, 42, 68)
"""Half-widths in half cycles of the local lines that may follow a wander."""


class Level(NamedTuple):
    """The level at each half cycle, with its standard deviation."""

    value: FloatArray
    sd: FloatArray
    wanders: bool


def estimate_level(information: FloatArray, score: FloatArray, noise: float, start: float) -> Level:
    """Estimate the level from what each half cycle says of it beside its own amplitude.

    A half cycle alone hardly tells its level from its amplitude (they correlate by 0.9):
    opposite half cycles do. A constant is kept unless local lines explain the scatter
    better by more than chance.

    Parameters
    ----------
    information, score
        Per half cycle: inverse variance of its level with the amplitude free (for unit
        noise), and that times the level it would choose, counted from `start`; (k,).
    noise
        Rms of one reading.
    start
        The level that the readings were counted from.
    """
    total = float(information.sum())
    mean = float(score.sum()) / total
    own = score / information
    sd = noise / math.sqrt(total)
    constant = Level(np.full(len(score), start + mean), np.full(len(score), sd), wanders=False)
    if len(score) < 3 * _WINDOWS[0]:
        return constant
    # Neighbours average out the even errors of opposite half cycles (harmonics, decay).
    pairs = _paired(information, score)
    if _steady(*pairs, mean, noise):
        return constant
    # The wander must be smooth against the scatter of neighbours, noise or not.
    narrow, used = _local_lines(*pairs, 4)
    freedom = max(len(pairs[0]) - used, 1.0)
    excess = _criterion(*pairs, narrow, 0.0, noise) / freedom
    noise *= math.sqrt(max(excess, 1.0))
    best, chosen = _criterion(*pairs, np.full(len(pairs[0]), mean), 1.0, noise), None
    for window in _WINDOWS:
        if 3 * window > len(own):
            break
        line, used = _local_lines(*pairs, window)
        criterion = _criterion(*pairs, line, used, noise)
        if criterion < best - 12.0:
            best, chosen = criterion, window
    if chosen is None:
        return constant
    line, used = _local_lines(information, score, chosen)
    local = np.full(len(score), noise * math.sqrt(used / total))
    return Level(start + line, local, wanders=True)


def _steady(information: FloatArray, score: FloatArray, mean: float, noise: float) -> bool:
    """Whether blocks of a dozen half cycles agree with one level, as chance would have it."""
    blocks = len(score) // 6
    if blocks < 4:
        return False
    used = slice(0, 6 * blocks)
    weight = information[used].reshape(blocks, 6).sum(1)
    own = score[used].reshape(blocks, 6).sum(1) / weight
    chi2 = float(np.sum(weight * (own - mean) ** 2)) / noise**2
    # Neighbouring blocks that depart together are a slow wander, small as it may be.
    pull = np.sqrt(weight) * (own - mean) / noise
    together = float(np.sum(pull[1:] * pull[:-1]))
    return chi2 < blocks + 3.0 * math.sqrt(2.0 * blocks) and together < 3.0 * math.sqrt(blocks)


def _paired(information: FloatArray, score: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Join half cycles two by two."""
    even = len(score) // 2 * 2
    return information[:even].reshape(-1, 2).sum(1), score[:even].reshape(-1, 2).sum(1)


def _criterion(
    information: FloatArray, score: FloatArray, line: FloatArray, used: float, noise: float
) -> float:
    """Akaike's: chi^2 of the levels about a line, and twice the freedom it used."""
    own = score / information
    chi2 = float(np.sum(information * (own - line) ** 2)) / noise**2
    return chi2 + 2.0 * used


def _local_lines(
    information: FloatArray, score: FloatArray, window: int
) -> tuple[FloatArray, float]:
    """Fit a weighted line about each half cycle; return it and the freedom it uses."""
    k = np.arange(len(score), dtype=np.float64)
    sums = [
        _box(column, window)
        for column in (information, information * k, information * k * k, score, score * k)
    ]
    w, wk, wkk, s, sk = sums
    centre = wk / w
    spread = wkk - wk * centre
    slope = (sk - s * centre) / np.maximum(spread, 1e-300)
    offset = k - centre
    leverage = information * (1.0 / w + offset**2 / np.maximum(spread, 1e-300))
    return s / w + slope * offset, float(leverage.sum())


def _box(column: FloatArray, window: int) -> FloatArray:
    """Sum over the neighbours within `window` of each entry (fewer at the ends)."""
    running = np.concatenate([[0.0], np.cumsum(column)])
    k = np.arange(len(column))
    upper, lower = np.minimum(k + window + 1, len(column)), np.maximum(k - window, 0)
    return np.asarray(running[upper] - running[lower])
