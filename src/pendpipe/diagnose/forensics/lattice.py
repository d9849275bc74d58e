"""The converter's codes, and how rounding to them distributes a reading."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from pendpipe.analysis.distributions import normal_below
from pendpipe.analysis.noise import noise_rms
from pendpipe.analysis.turning_points.samples import Samples
from pendpipe.arrays import FloatArray, IntArray
from pendpipe.diagnose.data import Data
from pendpipe.diagnose.forensics.local import Local

_RATIOS: Final = (0.03, 0.05, 0.07, 0.1, 0.13, 0.16, 0.2, 0.24, 0.28, 0.33, 0.38, 0.44, 0.5, 0.56)
"""Noise before rounding, in steps."""
_PLAINLY: Final = 0.6
"""Rms of the readings' errors in steps, from which rounding is plainly dithered."""
_LOOK: Final = 256
_LEVELS: Final = 16
"""Different codes from which chance (2^-16 at most) puts no more on a coarser lattice."""
_ROUNDS: Final = 4
_OFF: Final = 0.05
"""Part of a step by which readings may be off their codes."""
_ROUNDED: Final = 0.6
"""Steps of the converter by which it moves a coarser step's readings: half of one, and a bit."""


@dataclass(frozen=True)
class Lattice:
    """Readings as whole multiples of a step.

    Parameters
    ----------
    step
        In the unit of the readings.
    code
        Of each reading: its value is ``step code + origin``; shape (n,).
    origin
        The value of code 0: within half a step of zero.
    """

    step: float
    code: IntArray
    origin: float

    def position(self, value: FloatArray) -> FloatArray:
        """Return values in steps from code 0."""
        return np.asarray((value - self.origin) / self.step)


def find_lattice(values: FloatArray, step: float | None, slack: float = _OFF) -> Lattice | None:
    """Number the codes of readings; None where they lie on no lattice, but for a `slack`.

    The step is refined over the whole range, so that codes far from zero are counted right.
    """
    if step is None or not step > 0.0:
        return None
    levels, inverse = np.unique(values, return_inverse=True)
    if len(levels) < 3:
        return None
    gaps = np.round(np.diff(levels) / step).astype(np.int64)
    number = np.concatenate([[0], np.cumsum(gaps)])
    if number[-1] < 2:
        return None
    centred = number - number.mean()
    refined = float(centred @ levels / (centred @ centred))
    origin = float(np.mean(levels - refined * number))
    if np.max(np.abs(levels - origin - refined * number)) > slack * refined:
        return None
    shift = round(origin / refined)
    return Lattice(refined, (number + shift)[inverse], origin - shift * refined)


def lattice_of(values: FloatArray, samples: Samples) -> Lattice | None:
    """Number the codes of a recording's readings (or some of them), as `find_lattice`.

    A coarser step that something has before the converter is rounded to the converter's own.
    """
    if samples.step is None or samples.promised_step is None:
        return find_lattice(values, samples.step)
    rounded = _ROUNDED * samples.promised_step / samples.step
    return find_lattice(values, samples.step, max(rounded, _OFF))


def with_true_step(samples: Samples) -> Samples:
    """Take the step of the codes that come, where it is larger than the converter's.

    A converter whose lowest k bits do not move gives every 2^k-th code: its step is 2^k
    times what its bits promise. Where something before it has a step of its own, of any size,
    the codes that come are that step's multiples, each rounded to the nearest code.
    """
    if samples.counts or samples.step is None:
        return samples
    codes = (samples.values - samples.values[0]) / samples.step
    whole = np.rint(codes)
    if np.max(np.abs(codes[:_LOOK] - whole[:_LOOK])) > _OFF:
        return samples
    if np.diff(np.unique(whole[:_LOOK])).min(initial=np.inf) < 2.0:
        return samples
    levels = np.unique(whole)
    times = spacing_of(levels) if len(levels) >= _LEVELS else None
    if times is None:
        return samples
    step = times * samples.step
    noise = max(samples.noise_rms, noise_rms(samples.values, step))
    return replace(samples, step=step, noise_rms=noise, promised_step=samples.step)


def spacing_of(levels: FloatArray) -> float | None:
    """How many steps the codes that come lie apart; None where they may lie anywhere.

    Parameters
    ----------
    levels
        Codes (whole numbers) that came, rising.

    Returns
    -------
    float or None
        Whole where all codes are its multiples (from one of them on); else the spacing of a
        lattice of which they are the roundings.
    """
    gaps = np.diff(levels)
    if len(gaps) < 2 or gaps.min() < 2.0:
        return None
    common = int(np.gcd.reduce(gaps.astype(np.int64)))
    if common > 1:
        return float(common)
    # One spacing between neighbours, rounded down or up; further on two, three, ...
    spacing = float(np.mean(gaps[gaps <= 1.5 * gaps.min()]))
    number = np.append(0.0, np.cumsum(np.round(gaps / spacing)))
    for _ in range(_ROUNDS):
        centred = number - number.mean()
        spacing = float(centred @ levels / (centred @ centred))
        off = levels - spacing * number
        if float(np.ptp(off)) < 2.0 * _ROUNDED:
            return spacing
        # A gap may have been counted wrong: the line through all of them counts better.
        number = np.round((levels - off.mean()) / spacing)
    return None


def whole_readings(data: Data, samples: Samples) -> slice | None:
    """Find which of the samples the data are; None where they are means of several.

    They have the samples' times, or, where the clock has been mended, their values.
    """
    first = int(np.searchsorted(samples.time_s, data.time_s[0] - 1e-9))
    part = slice(first, first + len(data))
    if part.stop > len(samples):
        return None
    if np.allclose(samples.time_s[part], data.time_s, rtol=0.0, atol=1e-9):
        return part
    same = samples.values[part] == data.values
    return part if np.count_nonzero(same) > 0.5 * len(data) else None


def noise_before_rounding(local: Local, step: float) -> float:
    """Maximum likelihood of the noise that was there before rounding, from P(code).

    The likelihood is that of `analysis.fit.rounding`, but here the true angle is no model's:
    it is drawn through the neighbours, whose own noise it carries. So each reading has a
    spread of its own, and those that are no noise at all (glitches) have no say.

    Parameters
    ----------
    local
        Readings less what is smooth; the smooth part stands for the true angle.
    step
        Of the readings.
    """
    if local.rms > _PLAINLY * step:
        # Rounding is dithered: variances add.
        return math.sqrt(local.rms**2 - step**2 / 12.0)
    left = local.left[local.used] / step
    near = np.abs(left) < 5.0 * local.rms / step + 1.0
    left = left[near]
    extra = np.maximum(local.leverage[local.used][near], -0.9)
    best, most = 0.0, -np.inf
    for ratio in _RATIOS:
        spread = ratio * np.sqrt(1.0 + extra)
        chance = normal_below((left + 0.5) / spread) - normal_below((left - 0.5) / spread)
        likelihood = float(np.sum(np.log(np.maximum(chance, 1e-12))))
        if likelihood > most:
            best, most = ratio, likelihood
    return best * step


def rounding_moments(fraction: FloatArray, ratio: float) -> tuple[FloatArray, FloatArray]:
    """Mean square, and its variance, of what rounding and noise add to a value.

    Parameters
    ----------
    fraction
        The value's place between codes, in steps: 0 at a code; shape (n,).
    ratio
        Noise before rounding, in steps.

    Returns
    -------
    square, variance
        E[e^2] in steps^2 and Var[e^2] in steps^4, e = code - value; shape (n,).
    """
    grid = np.linspace(-0.5, 0.5, 65)
    reach = int(np.ceil(5.0 * ratio)) + 1
    codes = np.arange(-reach, reach + 1)
    chance = normal_below((codes + 0.5 - grid[:, None]) / ratio) - normal_below(
        (codes - 0.5 - grid[:, None]) / ratio
    )
    error = codes - grid[:, None]
    square = np.sum(chance * error**2, axis=1)
    fourth = np.sum(chance * error**4, axis=1)
    place = fraction - np.round(fraction)
    return (
        np.interp(place, grid, square),
        np.interp(place, grid, np.maximum(fourth - square**2, 0.0)),
    )
