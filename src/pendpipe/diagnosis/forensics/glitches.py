"""Glitches: single wrong readings."""

import math
from dataclasses import replace
from typing import Final

import numpy as np
from scipy.ndimage import maximum_filter, maximum_filter1d
from scipy.special import bdtrc

from pendpipe.arrays import BoolArray, FloatArray
from pendpipe.diagnosis.data import Data
from pendpipe.diagnosis.forensics.evidence import FEWEST, Evidence
from pendpipe.diagnosis.forensics.local import Local, local_residual, whitened_in_time
from pendpipe.diagnosis.forensics.tails import Tail, fit_tail
from pendpipe.diagnosis.found import Finding, Location
from pendpipe.diagnosis.noise import TAPS
from pendpipe.diagnosis.refine import is_gross
from pendpipe.estimate import Estimate
from pendpipe.quantities import after_number

_GLITCH_NUMBERS: Final = (*range(1, 31), 40, 53, 71, 95, 126, 168, 200)
"""Numbers that are tried. One glitch that is not counted thickens the tails of the noise."""
_CERTAIN_SD: Final = 4.5
"""Standard deviations of an error that is no noise: one of 150,000 normal readings has it."""
_LARGE_SD: Final = 3.0
"""Standard deviations from which an error is asked for: noise alone gives 3 in a thousand."""
_ROUNDS: Final = 4
"""Times that the errors are whitened anew: a glitch hides smaller ones within its own filter."""
_NEIGHBOURS: Final = 4
"""Readings on either side over which a filter of short memory spreads most of an error."""
_BESIDE: Final = (1, 1, 0, 1, 1)
"""Two readings on either side, and not the one between: what displaces them is no glitch."""
_MOST_ROUNDS: Final = 20
"""Wrong readings that one window may hold: each round takes the largest of every window."""
_FAR_SD: Final = 8.0
"""Standard deviations where the model is wrong: half as much again as the largest of 10^5 normal
errors (5.3), since windows in which the motion is missed scatter more."""
_WINDOW_RAD: Final = 4.0 * math.pi
"""Phase on either side that one window of the local fit shares: two cycles."""
_NOT_RANDOM: Final = 1e-3
"""Chance below which wrong readings are not where they are at random: of a thousand records with
glitches one keeps them as saturated."""
_EXPECTED_BY_CHANCE: Final = 0.05
"""A reading is left out if chance would give fewer than this in the whole record."""


def find(evidence: Evidence) -> Finding | None:
    """Test for readings that neither normal nor heavy-tailed noise explains.

    Each error is compared with its window. For k = 1, 2, 3, ... the
    tail of the noise (Student's distribution, averaged over the posterior of nu) is fitted with
    the k largest errors censored, and the k-th largest of n is tested:

        p_k = P(at least k of n beyond the k-th largest).

    The test uses the smallest p_k, with half of the probability given to k = 1. Readings that
    are too small at the extremes of the motion are left to the tests for saturation. Where a misfit
    of the motion remains in the windows, the test is the one that needs no model.
    """
    data, fit, noise = evidence.data, evidence.fit, evidence.noise
    residual, used = evidence.error, evidence.used
    local = _errors(evidence, ~used)
    if is_gross(fit, data) or local.smooth():
        return find_in_misfit(evidence)
    apart = used
    if noise.coloured:
        # The whitening filter lacks neighbours at the ends: errors there are larger by themselves.
        used = used.copy()
        used[:TAPS] = used[-TAPS:] = False
        if np.count_nonzero(used) < FEWEST:
            return find_in_misfit(evidence)
        # The filter spreads a wrong reading over its neighbours.
        near = _largest_about(np.abs(local.scaled) * used)
        apart = used & ((np.abs(local.scaled) == near) | (near < _CERTAIN_SD))
    error, repeats = np.abs(local.scaled), _chance_of_repeats(data, residual)
    step, ordered = _rounding_in(data, noise.white_rms * local.rms), np.sort(error[apart])
    p_value = smallest_p_value(ordered, step) * repeats[np.argmax(error * used)]
    tail = _noise_tail(ordered, step)
    mask, size = np.zeros(len(data), dtype=bool), np.zeros(len(data))
    for _ in range(_ROUNDS):
        beyond = (error > _LARGE_SD) & used & ~mask & (p_value < _EXPECTED_BY_CHANCE)
        expected = np.count_nonzero(used) * tail.beyond(error[beyond]) * repeats[beyond]
        beyond[beyond] = expected < _EXPECTED_BY_CHANCE
        if noise.coloured:
            # Take the largest first.
            beyond &= error == _largest_about(error)
        if not beyond.any():
            break
        size[beyond] = local.scaled[beyond]
        mask |= beyond
        if not noise.coloured:
            break
        local = _errors(evidence, ~evidence.used | mask)
        error = np.abs(local.scaled)
    ends = bent_ends(data.values - residual, size, mask, used)
    if ends.any():
        mask &= ~ends
        p_value = smallest_p_value(np.sort(error[apart & ~ends]), step)
        p_value *= repeats[np.argmax(error * (used & ~ends))]
    if not mask.any() or p_value > _EXPECTED_BY_CHANCE:
        if noise.coloured:
            # Near the ends, where the filter lacks neighbours, a window needs none.
            alone = find_in_misfit(evidence)
            return alone and replace(alone, p_value=min(2.0 * alone.p_value, 1.0))
        quiet = "no reading exceeds the noise"
        return Finding("glitches", max(p_value, _EXPECTED_BY_CHANCE), summary=quiet)
    return _described(evidence, residual, size, mask, p_value, tail)


def find_in_misfit(evidence: Evidence) -> Finding | None:
    """Test for single wrong readings where the model itself is wrong.

    This needs no model: the smooth motion is subtracted window by window. Only deviations of eight
    standard deviations count, and only without deviating neighbours: lost samples, a jump or a
    corner of the motion displace several readings.
    """
    data, used, phase = evidence.data, evidence.used, evidence.sampled.phase
    if data.time_noise:
        return None
    values = data.values - float(np.median(data.values[used]))
    mask = np.zeros(len(data), dtype=bool)
    for _ in range(_MOST_ROUNDS):
        # A wrong reading biases its window: take the largest first.
        local = evidence.local(values, leave_out=mask)
        error = np.where(mask | ~used, 0.0, np.abs(local.scaled))
        beyond = (error > _FAR_SD) & (error == _largest_about(error))
        if not beyond.any():
            break
        mask |= beyond
    error = np.abs(local.scaled)
    single = mask & (maximum_filter(error, footprint=_BESIDE, mode="constant") < _LARGE_SD)
    # Several displaced readings bias their window, so that others there seem wrong.
    bent = phase[mask & ~single]
    single[single] = [np.all(np.abs(bent - at) > _WINDOW_RAD) for at in phase[single]]
    single &= ~bent_ends(values - local.left, local.scaled, single, used)
    if not single.any():
        return None
    step, ordered = _rounding_in(data, local.rms), np.sort(error[used & (single | ~mask)])
    repeats = _chance_of_repeats(data, local.left)[np.argmax(error * single)]
    p_value = smallest_p_value(ordered, step) * repeats
    tail = _noise_tail(ordered, step)
    return _described(evidence, values, local.scaled, single, p_value, tail)


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


def _errors(evidence: Evidence, out: BoolArray) -> Local:
    """Return each reading's error, whitened; a filter spreads it where the noise is coloured."""
    white = whitened_in_time(np.where(out, 0.0, evidence.error), evidence.noise)
    return local_residual(evidence.sampled.phase, white, ~out)


def _largest_about(error: FloatArray) -> FloatArray:
    """Return the largest of each reading and its neighbours on both sides."""
    return maximum_filter1d(error, 2 * _NEIGHBOURS + 1, mode="constant")


def _rounding_in(data: Data, error_rms: float) -> float:
    """Return the step in standard deviations of an error (smaller for means of readings)."""
    return data.step / math.sqrt(data.fold) / error_rms


def smallest_p_value(sorted_error: FloatArray, step: float) -> float:
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
    evidence: Evidence,
    residual: FloatArray,
    sizes: FloatArray,
    mask: BoolArray,
    p_value: float,
    tail: Tail,
) -> Finding:
    data, local = evidence.data, evidence.local(residual, leave_out=mask)
    reading, when, rms = local.left[mask], data.time_s[mask], local.rms
    largest, number = int(np.argmax(np.abs(reading))), int(np.count_nonzero(mask))
    own = math.sqrt(float(np.mean(reading**2)))
    error = max(own / math.sqrt(2.0 * number), rms / math.sqrt(number))
    parameters = {
        "number": Estimate(float(number), 0.0, ""),
        "share": Estimate(number / data.used, math.sqrt(number) / data.used, ""),
        "rms": Estimate(own, error, data.unit),
        "largest": Estimate(float(reading[largest]), rms, data.unit),
        "largest_time": Estimate(float(when[largest]), 0.0, "s"),
    }
    wrong = f"by {reading[0]:.3g}{after_number(data.unit)}"
    summary = f"one reading, at {when[0]:.6g} s, is wrong {wrong}"
    row = int(np.flatnonzero(mask)[0])
    if number > 1:
        summary = (
            f"{number} single readings between {when[0]:.4g} and {when[-1]:.4g} s are wrong"
            f" by up to {abs(reading[largest]):.3g}{after_number(data.unit)}"
        )
    elif row and data.values[row] == data.values[row - 1]:
        summary += ": it repeats the one before"
    if tail.inverse_freedom > 0.03:
        summary += (
            f" (the noise of the others has Student tails, nu = {1.0 / tail.inverse_freedom:.2g})"
        )
    return Finding(
        "glitches",
        p_value,
        float(np.sum(sizes[mask] ** 2)),
        parameters,
        Location.over(when, evidence.sampled.amplitude[mask]),
        mask=mask,
        summary=summary,
    )
