"""Sampling times: gaps, stamps less regular than the readings themselves, and jitter."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np
from scipy.special import ndtr

from pendpipe.arrays import FloatArray
from pendpipe.diagnosis.forensics.codes import read_codes
from pendpipe.diagnosis.forensics.local import whitened_series
from pendpipe.diagnosis.forensics.tails import tail_of_squares
from pendpipe.diagnosis.found import Finding
from pendpipe.estimate import Estimate
from pendpipe.levels import deviations
from pendpipe.quantities import with_error

if TYPE_CHECKING:
    from pendpipe.diagnosis.forensics.evidence import Evidence

_LARGEST_DEVIATION: Final = 0.25
"""Largest deviation from a regular clock, in intervals."""
_IRREGULAR: Final = 1e-4
"""Deviation in intervals from which time stamps count as irregular."""
_GAP_LENGTH: Final = 1.5
"""Length of a gap, in intervals (half periods for an encoder's counts)."""
_CLIP_SD: Final = 3.0
"""Standard deviations at which errors are clipped."""
_CONSTANT: Final = 1e-3
"""Relative variation of the mean of v^2 over a cycle below which it counts as constant."""
_AGREE_SD: Final = deviations(1)
"""Standard deviations by which the part at twice the frequency may be too small."""
_RULED: Final = 0.1
"""Noise before rounding, in steps, below which rounding rules the errors."""
_ROUNDS: Final = 6
"""Times that the weights are made anew: the variance they follow settles to a percent."""
_FAST: Final = 0.25 * math.pi, 0.75 * math.pi
"""Phases at which the motion is fast."""


def gap_note(time_s: FloatArray, half_period_s: float, counts: bool) -> str | None:
    """Describe the gaps of the time stamps in one line; None if there are none.

    Parameters
    ----------
    time_s
        All time stamps of a recording, whether the motion there is analysed or not.
    half_period_s
        Of the motion.
    counts
        Whether each row marks a count of an encoder, which is silent at rest.
    """
    intervals = np.diff(time_s)
    few, usual = np.percentile(intervals, [10, 90]).tolist()
    least = _GAP_LENGTH * (half_period_s if counts else usual)
    if usual > 1.2 * few and not counts:
        # An irregular clock.
        least = max(4.0 * usual, 0.5 * half_period_s)
    found = np.flatnonzero(intervals > least)
    if not len(found):
        return None
    lasts = intervals[found]
    longest = int(np.argmax(lasts))
    first = float(time_s[found[longest]])
    many = "a gap" if len(found) == 1 else f"{len(found)} gaps, the longest"
    note = f"the time stamps have {many} of {lasts[longest]:.4g} s after {first:.5g} s"
    return f"{note} (an encoder that writes its counts is silent at rest)" if counts else note


def find_irregular(evidence: Evidence) -> Finding | None:
    """Test whether the readings were taken more regularly than their time stamps say.

    Time stamps that are rounded or written late differ by d_j from a regular clock. If the
    readings were taken by that clock, the residual contains -v d_j:

        r_j = -k v_j d_j + noise,

    with k = 1 for wrong time stamps and 0 for true ones.
    """
    data, sampled = evidence.data, evidence.sampled
    clock = None if data.time_noise else regular_clock(data.time_s)
    if clock is None:
        return None
    even_s, interval_s = clock
    off_s = data.time_s - even_s
    local = evidence.local(evidence.residual)
    wave = evidence.local(-sampled.velocity * off_s).left
    size = float(wave @ wave)
    if size <= 1e-6 * local.rms**2:
        return None
    share, sd = float(wave @ local.left) / size, local.rms / math.sqrt(size)
    rms = float(np.std(off_s))
    return Finding(
        "time-stamps",
        float(ndtr(-share / sd)) if share > 0.5 else 1.0,
        max(share / sd, 0.0) ** 2,
        {
            "share": Estimate(share, sd, ""),
            "unevenness": Estimate(rms, rms / math.sqrt(2.0 * len(data)), "s"),
            "interval": Estimate(interval_s, rms / len(data), "s"),
        },
        evidence.everywhere(_FAST),
        time_s=even_s,
        summary=f"the time stamps are irregular by {rms:.2g} s and the readings are not: they were"
        f" taken every {interval_s:.6g} s",
        kind="note",
    )


def regular_clock(time_s: FloatArray) -> tuple[FloatArray, float] | None:
    """Fit a regular clock to time stamps; None if there is none, or no difference.

    Returns
    -------
    even_s, interval_s
        Its time at each stamp, and the interval of its ticks.
    """
    intervals = np.diff(time_s)
    usual = float(np.median(intervals))
    number = np.concatenate([[0.0], np.cumsum(np.maximum(np.round(intervals / usual), 1.0))])
    for _ in range(2):
        slope, start = np.polyfit(number, time_s, 1)
        number = np.round((time_s - start) / slope)
    if np.any(np.diff(number) < 1.0):
        return None
    even_s = np.asarray(start + slope * number)
    off = time_s - even_s
    far = float(np.mean(np.abs(off) > _LARGEST_DEVIATION * slope)) > 0.05
    return None if far or float(np.std(off)) < _IRREGULAR * slope else (even_s, float(slope))


class Squares(NamedTuple):
    """Squared errors against the speed; arrays of shape (m,).

    Parameters
    ----------
    square
        In units of the variance of one reading.
    mean, double
        The parts of v^2 that vary with the amplitude, (omega A)^2/2, and at twice the
        frequency, -(omega A)^2 cos(2 psi)/2; over the mean of v^2.
    seconds_squared
        The variance of one reading over the mean of v^2, s^2.
    shared
        Part of the degrees of freedom used by the local fits.
    """

    square: FloatArray
    mean: FloatArray
    double: FloatArray
    seconds_squared: float
    shared: float


def find_jitter(evidence: Evidence) -> Finding | None:
    """Test whether the noise's variance is sigma^2 + sigma_t^2 v^2.

    The score for sigma_t^2 at zero is a sum of squared errors, weighted by v^2 minus its mean; its
    p-value is that of a weighted sum of squares, scaled for heavier tails than normal. Errors that
    rounding rules, with hardly any noise, are no random numbers. The part of v^2 at twice the
    frequency must agree with the whole, or it alone counts: noise that decays with the amplitude is
    not jitter.
    """
    data = evidence.data
    if data.time_noise:
        return None
    coded, squares = read_codes(evidence), _squares(evidence)
    ruled = coded is not None and coded.ratio < _RULED
    if ruled or squares is None or len(squares.square) < 50:
        return None
    speed = squares.mean + squares.double
    p_value = _p_value(squares, speed)
    # At constant amplitude the mean of v^2 can't be distinguished from the variance of the noise.
    if float(np.std(squares.mean)) > _CONSTANT * float(np.mean(squares.mean)):
        size, covariance = _fitted(squares, squares.mean, squares.double)
        spread = math.sqrt(covariance[1, 1] + covariance[2, 2] - 2.0 * covariance[1, 2])
        if size[2] - size[1] < -_AGREE_SD * spread:
            p_value = max(p_value, _p_value(squares, squares.double, squares.mean))
    (base, more), covariance = _fitted(squares, speed)
    (alone,), _ = _fitted(squares)
    model, null = np.maximum(1.0 + base + more * speed, 0.1), max(1.0 + alone, 0.1)
    gain = np.log(null / model) + squares.square * (1.0 / null - 1.0 / model)
    share, sd = max(float(more), 0.0), math.sqrt(covariance[1, 1])
    seconds = math.sqrt(share * squares.seconds_squared)
    # d sigma_t = d(sigma_t^2)/(2 sigma_t); near zero the size of the square root itself.
    error = 0.5 * sd * math.sqrt(squares.seconds_squared / max(share, 0.25 * sd))
    omega = evidence.sampled.motion.angular_frequency
    return Finding(
        "jitter",
        p_value,
        max(float(gain.sum()), 0.0) if share > 0.0 else 0.0,
        {"sigma_t": Estimate(seconds, error, "s")},
        evidence.everywhere(_FAST, (omega / math.pi,)),
        summary="the noise is largest where the motion is fastest, as if the sampling times"
        f" were uncertain by {with_error(seconds, error, 's')}",
    )


def _squares(evidence: Evidence) -> Squares | None:
    """Return squares of normal errors; None if a misfit of the motion remains in them."""
    sampled, used = evidence.sampled, evidence.used
    white, unit = whitened_series(evidence.residual, evidence.noise)
    local = evidence.local(white)
    if local.smooth():
        return None
    top = 0.5 * (sampled.motion.angular_frequency * sampled.amplitude[used]) ** 2
    speed = float(np.mean(top))
    return Squares(
        local.scaled[used] ** 2,
        top / speed,
        -top / speed * np.cos(2.0 * sampled.phase[used]),
        unit**2 * float(np.mean(white[used] ** 2)) / speed,
        float(np.clip(-np.mean(local.leverage[used]), 0.0, 0.5)),
    )


def _p_value(squares: Squares, weight: FloatArray, *beside: FloatArray) -> float:
    """Return the probability of a weighted sum as large, the variance of the noise unknown."""
    capped = np.minimum(squares.square, _CLIP_SD**2)
    # Project out the variance (and `beside`), by least squares.
    basis = np.stack([np.ones(len(weight)), *beside], axis=1)
    rest = weight - basis @ np.linalg.lstsq(basis, weight, rcond=None)[0]
    off = capped - capped.mean()
    # Scatter relative to independent squares of normal numbers.
    share = 0.5 * float(np.mean(off**2)) / (1.0 - squares.shared)
    total = float(rest @ off) / max(math.sqrt(share), 1e-6)
    return tail_of_squares(total + float(rest.sum()), rest)


def _fitted(squares: Squares, *parts: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Fit a constant and parts to the variance; return sizes and their covariance."""
    columns = np.stack([np.ones(len(squares.square)), *parts], axis=1)
    size, off = np.zeros(columns.shape[1]), np.minimum(squares.square, 25.0) - 1.0
    for _ in range(_ROUNDS):
        weight = 0.5 / np.maximum(1.0 + columns @ size, 0.1) ** 2
        matrix = np.asarray(np.linalg.inv(columns.T @ (weight[:, None] * columns)))
        size = matrix @ (columns.T @ (weight * off))
    return size, matrix
