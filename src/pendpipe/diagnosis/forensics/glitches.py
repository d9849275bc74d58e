"""Glitches: single wrong readings."""

import math
from dataclasses import replace
from typing import Final

import numpy as np
from scipy.special import bdtrc

from pendpipe.analysis.turning_points.measure import Samples
from pendpipe.arrays import BoolArray, FloatArray
from pendpipe.diagnosis.data import Data
from pendpipe.diagnosis.forensics.local import (
    Local,
    error_of,
    local_residual,
    whitened_in_time,
)
from pendpipe.diagnosis.forensics.tails import Tail, fit_tail
from pendpipe.diagnosis.noise import TAPS, Noise
from pendpipe.diagnosis.refine import GROSS, LARGE_PHASE_ERROR, Fit
from pendpipe.diagnosis.result import Finding, Location
from pendpipe.estimate import Estimate
from pendpipe.quantities import after_number

_GLITCH_NUMBERS: Final = (*range(1, 31), 40, 53, 71, 95, 126, 168, 200)
"""Numbers that are tried. One glitch that is not counted thickens the tails of the noise."""
_CERTAIN_SD: Final = 4.5
_LARGE_SD: Final = 3.0
_ROUNDS: Final = 4
_NEIGHBOURS: Final = 4
_MOST_ROUNDS: Final = 20
_FAR_SD: Final = 8.0
_WINDOW_RAD: Final = 4.0 * math.pi
_NOT_RANDOM: Final = 1e-3
_FEWEST: Final = 60
"""Readings that show the tail of their noise."""
_EXPECTED_BY_CHANCE: Final = 0.05
"""A reading is left out if chance would give fewer than this in the whole record."""


def find(data: Data, fit: Fit, noise: Noise, samples: Samples) -> Finding | None:
    """Test for readings that neither normal nor heavy-tailed noise explains.

    Each error is compared with its window. For k = 1, 2, 3, ... the
    tail of the noise (Student's distribution, averaged over the posterior of nu) is fitted with
    the k largest errors censored, and the k-th largest of n is tested:

        p_k = P(at least k of n beyond the k-th largest).

    The test uses the smallest p_k, with half of the probability given to k = 1. Readings that
    are too small at the extremes of the motion are left to the tests for saturation. Where a misfit
    of the motion remains in the windows, the test is the one that needs no model.
    """
    if data.used < _FEWEST:
        return None
    residual, used = error_of(data, fit), data.weight > 0.0
    local = _errors(fit, noise, residual, ~used)
    lost = fit.chi2 > GROSS * data.used or fit.max_phase_error_rad > LARGE_PHASE_ERROR
    if lost or local.smooth():
        return find_in_misfit(data, fit, noise, samples)
    if noise.coloured:
        # The whitening filter lacks neighbours at the ends: errors there are larger by themselves.
        used = used.copy()
        used[:TAPS] = used[-TAPS:] = False
        if np.count_nonzero(used) < _FEWEST:
            return find_in_misfit(data, fit, noise, samples)
    error, repeats = np.abs(local.scaled), _chance_of_repeats(data, residual)
    count, step = int(np.count_nonzero(used)), _rounding_in(data, noise.white_rms * local.rms)
    apart = used
    if noise.coloured:
        # The filter spreads a wrong reading over its neighbours.
        near = _about(error * used, _NEIGHBOURS).max(axis=1)
        apart = used & ((error == near) | (near < _CERTAIN_SD))
    ordered = np.sort(error[apart])
    p_value, tail = _smallest_p_value(ordered, step), _noise_tail(ordered, step)
    p_value *= repeats[np.argmax(error * used)]
    mask = np.zeros(len(data), dtype=bool)
    size = np.zeros(len(data))
    for _ in range(_ROUNDS):
        beyond = (error > 3.0) & used & ~mask & (p_value < _EXPECTED_BY_CHANCE)
        expected = count * tail.beyond(error[beyond]) * repeats[beyond]
        beyond[beyond] = expected < _EXPECTED_BY_CHANCE
        if noise.coloured:
            # Take the largest first.
            beyond &= error == _about(error, _NEIGHBOURS).max(axis=1)
        if not beyond.any():
            break
        size[beyond] = local.scaled[beyond]
        mask |= beyond
        if not noise.coloured:
            break
        local = _errors(fit, noise, residual, (data.weight == 0.0) | mask)
        error = np.abs(local.scaled)
    ends = bent_ends(data.values - residual, size, mask, used)
    if ends.any():
        mask &= ~ends
        p_value = _smallest_p_value(np.sort(error[apart & ~ends]), step)
        p_value *= repeats[np.argmax(error * (used & ~ends))]
    if not mask.any() or p_value > _EXPECTED_BY_CHANCE:
        if noise.coloured:
            # Near the ends, where the filter lacks neighbours, a window needs none.
            alone = find_in_misfit(data, fit, noise, samples)
            return alone and replace(alone, p_value=min(2.0 * alone.p_value, 1.0))
        quiet = "no reading exceeds the noise"
        return Finding("glitches", max(p_value, _EXPECTED_BY_CHANCE), summary=quiet)
    return _described(data, fit, residual, size, mask, p_value, tail)


def find_in_misfit(data: Data, fit: Fit, noise: Noise, samples: Samples) -> Finding | None:
    """Test for single wrong readings where the model itself is wrong.

    This needs no model: the smooth motion is subtracted window by window. Only deviations of eight
    standard deviations count, and only without deviating neighbours: lost samples, a jump or a
    corner of the motion displace several readings.
    """
    if data.used < _FEWEST or data.time_noise:
        return None
    used, phase = data.weight > 0.0, fit.at.sampled.phase
    values = data.values - float(np.median(data.values[used]))
    mask = np.zeros(len(data), dtype=bool)
    for _ in range(_MOST_ROUNDS):
        # A wrong reading biases its window: take the largest first.
        local = local_residual(phase, values, used, leave_out=mask)
        error = np.where(mask | ~used, 0.0, np.abs(local.scaled))
        beyond = (error > _FAR_SD) & (error == _about(error, _NEIGHBOURS).max(axis=1))
        if not beyond.any():
            break
        mask |= beyond
    beside = np.delete(_about(np.abs(local.scaled), 2), 2, axis=1)
    single = mask & (beside.max(axis=1) < _LARGE_SD)
    # Several displaced readings bias their window, so that others there seem wrong.
    bent = phase[mask & ~single]
    single[single] = [np.all(np.abs(bent - at) > _WINDOW_RAD) for at in phase[single]]
    single &= ~bent_ends(values - local.left, local.scaled, single, used)
    if not single.any():
        return None
    ordered = np.sort(np.abs(local.scaled)[used & (single | ~mask)])
    step = _rounding_in(data, local.rms)
    p_value, tail = _smallest_p_value(ordered, step), _noise_tail(ordered, step)
    p_value *= _chance_of_repeats(data, local.left)[np.argmax(np.abs(local.scaled) * single)]
    return _described(data, fit, values, local.scaled, single, p_value, tail)


def bent_ends(angle: FloatArray, size: FloatArray, mask: BoolArray, used: BoolArray) -> BoolArray:
    """Return which wrong readings lie too near an extreme of the motion to be random.

    Of m readings at random, k or more all lie above a threshold exceeded by the fraction f of all
    readings with a probability of at most C(m, k) f^k. A saturating sensor makes its errors
    there, and towards the middle.

    Parameters
    ----------
    angle, size
        The motion's, and the readings' errors; shape (n,).
    mask, used
        Which are wrong, and which count; shape (n,).
    """
    found = np.zeros(len(angle), dtype=bool)
    for sign in (1.0, -1.0):
        wrong = np.flatnonzero(mask & (sign * size < 0.0))
        wrong = wrong[np.argsort(-sign * angle[wrong])]
        share = [float(np.mean(sign * angle[used] >= sign * angle[at])) for at in wrong]
        chances = [
            math.comb(int(np.count_nonzero(mask)), k) * part**k for k, part in enumerate(share, 1)
        ]
        if chances and min(chances) < _NOT_RANDOM:
            found[wrong[: int(np.argmin(chances)) + 1]] = True
    return found


def _chance_of_repeats(data: Data, error: FloatArray) -> FloatArray:
    """Return how probable it is that a wrong reading equals the one before it, 1 where it does not.

    One that is wrong by e for another reason lies anywhere within about 2 e, in steps. A stale row
    or a repeated picture is the same.
    """
    again = np.append(False, np.diff(data.values) == 0.0) & (data.fold == 1)
    step = max(data.step, 1e-6 * float(np.ptp(data.values)))
    return np.where(again, np.minimum(step / np.maximum(2.0 * np.abs(error), 1e-300), 1.0), 1.0)


def _errors(fit: Fit, noise: Noise, residual: FloatArray, out: BoolArray) -> Local:
    """Return each reading's error, whitened; a filter spreads it where the noise is coloured."""
    white = whitened_in_time(np.where(out, 0.0, residual), noise)
    return local_residual(fit.at.sampled.phase, white, ~out)


def _about(error: FloatArray, neighbours: int) -> FloatArray:
    """Return each reading with its neighbours on both sides, shape (n, 2 neighbours + 1)."""
    padded = np.pad(error, neighbours)
    return np.lib.stride_tricks.sliding_window_view(padded, 2 * neighbours + 1)


def _rounding_in(data: Data, error_rms: float) -> float:
    """Return the step in standard deviations of an error (smaller for means of readings)."""
    return data.step / math.sqrt(data.fold) / error_rms


def _smallest_p_value(sorted_error: FloatArray, step: float) -> float:
    """Return the p-value over all numbers of glitches."""
    count = len(sorted_error)
    numbers = [k for k in _GLITCH_NUMBERS if k <= count // 30]
    best = 1.0
    for k in numbers:
        largest = sorted_error[count - k]
        if largest < _LARGE_SD:
            break  # not larger than noise
        chance = min(float(fit_tail(sorted_error, k, step=step).beyond(largest)), 1.0)
        share = 0.5 if k == 1 else 0.5 / (len(numbers) - 1)
        best = min(float(bdtrc(k - 1, count, chance)) / share, best)
    return best


def _noise_tail(sorted_error: FloatArray, step: float) -> Tail:
    """Fit the tail of the noise where the largest errors are glitches."""
    foreign = int(np.count_nonzero(sorted_error > _CERTAIN_SD))
    most = min(max(foreign, 1), len(sorted_error) // 10)
    return fit_tail(sorted_error, most, foreign=True, step=step)


def _described(
    data: Data,
    fit: Fit,
    residual: FloatArray,
    sizes: FloatArray,
    mask: BoolArray,
    p_value: float,
    tail: Tail,
) -> Finding:
    sampled = fit.at.sampled
    local = local_residual(sampled.phase, residual, data.weight > 0.0, leave_out=mask)
    reading, when, rms = local.left[mask], data.time_s[mask], local.rms
    largest, number = int(np.argmax(np.abs(sizes[mask]))), int(np.count_nonzero(mask))
    own = math.sqrt(float(np.mean(reading**2)))
    parameters = {
        "number": Estimate(float(number), 0.0, ""),
        "share": Estimate(number / data.used, math.sqrt(number) / data.used, ""),
        "rms": Estimate(
            own, max(own / math.sqrt(2.0 * number), rms / math.sqrt(number)), data.unit
        ),
        "largest": Estimate(float(reading[largest]), rms, data.unit),
        "largest_time": Estimate(float(when[largest]), 0.0, "s"),
    }
    if number == 1:
        summary = (
            f"one reading, at {when[0]:.6g} s, is wrong by"
            f" {reading[0]:.3g}{after_number(data.unit)}"
        )
        row = int(np.flatnonzero(mask)[0])
        if row and data.values[row] == data.values[row - 1]:
            summary += ": it repeats the one before"
    else:
        summary = (
            f"{number} single readings between {when[0]:.4g} and {when[-1]:.4g} s are wrong"
            f" by up to {abs(reading[largest]):.3g}{after_number(data.unit)}"
        )
    if tail.inverse_freedom > 0.03:
        summary += (
            f" (the noise of the others has Student tails, nu = {1.0 / tail.inverse_freedom:.2g})"
        )
    return Finding(
        "glitches",
        p_value,
        float(np.sum(sizes[mask] ** 2)),
        parameters,
        Location.over(when, sampled.amplitude[mask]),
        mask=mask,
        summary=summary,
    )
