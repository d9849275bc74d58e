"""Readings taken at uncertain moments: noise that follows the speed."""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np

from pendpipe.analysis.turning_points.samples import Samples
from pendpipe.arrays import FloatArray
from pendpipe.diagnose.data import Data
from pendpipe.diagnose.forensics.finding import Finding, Location, nothing
from pendpipe.diagnose.forensics.lattice import (
    find_lattice,
    noise_before_rounding,
    rounding_moments,
    whole_readings,
)
from pendpipe.diagnose.forensics.local import (
    Local,
    local_residual,
    residual_of,
    whitened_in_time,
)
from pendpipe.diagnose.forensics.weighted_chi2 import tail_of_squares
from pendpipe.diagnose.noise import Noise
from pendpipe.diagnose.refine import Fit
from pendpipe.estimate import Estimate

_FAR: Final = 4.5
"""Standard deviations (of the noise that jitter makes) beyond which it is a glitch."""
_AGREE: Final = 2.6
"""Standard deviations by which the part at twice the frequency may fall short."""
_DITHERED: Final = 1.5
"""Noise in steps from which rounding is part of the noise."""


class Squares(NamedTuple):
    """Squared errors, their expectation without jitter and variance, and v^2; shape (n,).

    All in units of the usual variance; v^2 in units of its mean.
    """

    square: FloatArray
    expected: FloatArray
    variance: FloatArray
    speed: FloatArray
    double: FloatArray
    """v^2's part at twice the frequency: -(omega A)^2 cos(2 psi)/2."""


def find(data: Data, fit: Fit, noise: Noise, samples: Samples) -> Finding:
    """Test whether the noise's variance is sigma^2 + sigma_t^2 v^2.

    The score for sigma_t^2 at zero is a weighted sum of squared errors, the weights v^2 less
    their mean; its chance is that of a weighted sum of squares, stretched where tails are
    heavier than normal. Where the step is not dithered, each square is compared with what
    rounding makes of it at that angle. The part of v^2 at twice the frequency must say the
    same as the whole, or it alone counts: a noise that dies with the amplitude is no jitter.
    """
    if data.time_noise or data.used < 60:
        return nothing("jitter")
    local = local_residual(data, fit, whitened_in_time(residual_of(data, fit), noise))
    squares = _squares(data, fit, local, samples)
    if squares is None:
        return nothing("jitter")
    whole = _chance(squares, squares.speed)
    alone = _chance(squares, squares.double, beside=squares.speed - squares.double)
    size, variance = _variance(squares)
    first, second = size[1], size[2]
    spread = math.sqrt(variance[1, 1] + variance[2, 2] - 2.0 * variance[1, 2])
    p_value = whole
    if second - first < -_AGREE * spread:
        p_value = max(whole, alone)
    return _described(data, fit, local, squares, noise, p_value)


def _squares(data: Data, fit: Fit, local: Local, samples: Samples) -> Squares | None:
    used = local.used
    sampled = fit.at.sampled
    omega = sampled.motion.angular_frequency
    top = (0.5 * (omega * sampled.amplitude) ** 2)[used]
    double = -top * np.cos(2.0 * sampled.phase[used])
    mean = float(np.mean(top))
    scaled = local.scaled[used]
    square = scaled**2
    expected, variance = np.ones(len(square)), np.full(len(square), 2.0)
    plain = local_residual(data, fit, residual_of(data, fit))
    lattice = (
        find_lattice(data.values, samples.step)
        if whole_readings(data, samples) and not samples.counts
        else None
    )
    if lattice is not None and plain.rms < _DITHERED * lattice.step:
        before = noise_before_rounding(plain, lattice.step)
        true = lattice.position(data.values - plain.left)[used]
        expected, variance = rounding_moments(true - np.round(true), before / lattice.step)
        unit = (plain.rms / lattice.step) ** 2
        square = (plain.left[used] / plain.rms) ** 2 / np.maximum(1.0 + plain.leverage[used], 0.2)
        expected, variance = expected / unit, variance / unit**2
    # A glitch is nobody's jitter.
    near = square < _FAR**2 * np.maximum(1.0, 3.0 * np.mean(square) * (top + double) / mean)
    if np.count_nonzero(near) < 50:
        return None
    return Squares(
        square[near], expected[near], variance[near], ((top + double) / mean)[near],
        (double / mean)[near],
    )  # fmt: skip


def _chance(squares: Squares, weight: FloatArray, beside: FloatArray | None = None) -> float:
    """Chance of a weighted sum of squares as large, the noise's own level unknown."""
    columns = [squares.expected]
    if beside is not None:
        columns.append(beside)
    # Weighed least squares: what the level (and what stands beside) can do is taken off.
    basis = np.stack(columns, axis=1)
    inverse = 1.0 / np.maximum(squares.variance, 0.05 * float(np.mean(squares.variance)))
    solved = np.linalg.solve(basis.T @ (inverse[:, None] * basis), basis.T @ (inverse * weight))
    rest = (weight - basis @ solved) * inverse
    level = float(np.sum(squares.square * squares.expected * inverse)) / float(
        np.sum(squares.expected**2 * inverse)
    )
    off = squares.square - level * squares.expected
    total = float(rest @ off)
    # How much wider than for normal noise: heavy tails, or rounding that is seldom between.
    usual = 2.0 * float(np.sum(rest**2 * squares.expected**2)) * level**2
    found = float(np.sum(rest**2 * squares.variance)) * level**2
    heavy = float(np.mean(off**2 / np.maximum(squares.variance, 1e-3))) / level**2
    stretch = math.sqrt(max(found, 1e-30) / usual * max(heavy, 1.0))
    weights = rest * squares.expected * level
    return tail_of_squares(total / stretch + float(weights.sum()), weights)


def _variance(squares: Squares) -> tuple[FloatArray, FloatArray]:
    """Fit the variance as level + parts that follow v^2's mean and double frequency."""
    columns = np.stack([squares.expected, squares.speed - squares.double, squares.double], axis=1)
    spread = np.maximum(squares.variance, 0.05 * float(np.mean(squares.variance)))
    size = np.array([1.0, 0.0, 0.0])
    matrix = np.eye(3)
    for _ in range(4):
        model = np.maximum(columns @ size, 0.1 * squares.expected)
        weight = 1.0 / (spread * (model / squares.expected) ** 2)
        matrix = np.linalg.inv(columns.T @ (weight[:, None] * columns))
        size = matrix @ (columns.T @ (weight * squares.square))
    return size, matrix


def _together(squares: Squares) -> tuple[float, float, float, float]:
    """Level, size of the part that follows v^2, its sd, and twice the gain in likelihood."""
    columns = np.stack([squares.expected, squares.speed], axis=1)
    spread = np.maximum(squares.variance, 0.05 * float(np.mean(squares.variance)))
    size, matrix = np.array([1.0, 0.0]), np.eye(2)
    for _ in range(6):
        model = np.maximum(columns @ size, 0.1 * squares.expected)
        weight = 1.0 / (spread * (model / squares.expected) ** 2)
        matrix = np.linalg.inv(columns.T @ (weight[:, None] * columns))
        size = matrix @ (columns.T @ (weight * squares.square))
    level = float(np.mean(squares.square)) / float(np.mean(squares.expected))
    model = np.maximum(columns @ size, 0.1 * squares.expected)
    plain = level * squares.expected
    gain = float(
        np.sum(np.log(plain) + squares.square / plain - np.log(model) - squares.square / model)
    )
    return float(size[0]), float(size[1]), math.sqrt(float(matrix[1, 1])), max(gain, 0.0)


def _described(
    data: Data, fit: Fit, local: Local, squares: Squares, noise: Noise, p_value: float
) -> Finding:
    level, size, spread, gain = _together(squares)
    sampled = fit.at.sampled
    omega = sampled.motion.angular_frequency
    used = local.used
    mean = float(np.mean(0.5 * (omega * sampled.amplitude[used]) ** 2))
    rms = _plain_rms(data, fit)
    seconds = math.sqrt(max(size, 0.0) * rms**2 / mean)
    error = spread * rms**2 / mean / (2.0 * max(seconds, rms / math.sqrt(mean) * 0.1))
    speed = sampled.velocity**2
    frequency = omega / (2.0 * math.pi)
    return Finding(
        "jitter", p_value, gain if size > 0.0 else 0.0,
        {"sigma_t": Estimate(seconds, error, "s")},
        Location(
            (float(data.time_s[0]), float(data.time_s[-1])),
            (float(sampled.amplitude.min()), float(sampled.amplitude.max())),
            (0.25 * math.pi, 0.75 * math.pi), (2.0 * frequency,),
        ),
        variance=1.0 + max(size, 0.0) / max(level, 0.1) * speed / mean,
        summary=f"the noise is largest where the motion is fastest, as if the moments of"
        f" reading were uncertain by {seconds:.2g} s",
    )  # fmt: skip


def _plain_rms(data: Data, fit: Fit) -> float:
    return local_residual(data, fit, residual_of(data, fit)).rms
