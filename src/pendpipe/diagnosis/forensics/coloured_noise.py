"""Coloured noise: a density near the pendulum's frequency that differs from the mean."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from pendpipe.analysis.turning_points.samples import Samples
from pendpipe.diagnosis.data import Data
from pendpipe.diagnosis.forensics.tails import upper_tail
from pendpipe.diagnosis.noise import Noise
from pendpipe.diagnosis.refine import Fit
from pendpipe.diagnosis.result import COLOURED_NOISE, Finding, Location, nothing
from pendpipe.estimate import Estimate

_HARMLESS_RATIO: Final = 1.5
"""Ratio of densities below which the colour changes no conclusion."""
_LOWEST: Final = 0.1
"""Lowest frequency used, over the motion's: slower noise is a drift, allowed for elsewhere."""
_MISFIT: Final = 1.3
"""chi^2 per reading from which a misfit of the motion may leak between its harmonics."""
_NEAR_BAND: Final = (0.3, 3.0)


def level_note(noise: Noise) -> str | None:
    """Say by how much the noise's level changes along the record; None where it hardly does."""
    if noise.level is None:
        return None
    first, last = (float(np.sqrt(np.mean(part**2))) for part in np.array_split(noise.level, 2))
    ratio = float(noise.level.max() / noise.level.min())
    if ratio < _HARMLESS_RATIO:
        return None
    how = "larger" if first > last else "smaller"
    return f"the noise changes in time, by a factor of {ratio:.2g}; it is {how} in the first half"


def find(data: Data, fit: Fit, noise: Noise, samples: Samples) -> Finding:
    """Test whether the density near the pendulum's frequency differs from the mean by over 1.5.

    Density and error are those of the spectrum that the readings were weighed with. The null is
    composite: any ratio between 1/1.5 and 1.5. Noise that is red only below a tenth of the
    frequency is not reported.
    """
    if not data.uniform or not noise.coloured or fit.chi2 > _MISFIT * data.used:
        return nothing(COLOURED_NOISE)
    frequency_hz = fit.at.sampled.motion.angular_frequency / (2.0 * math.pi)
    edges = np.append(noise.starts, len(data)) / (2.0 * len(data) * data.interval_s)
    middle, number = 0.5 * (edges[1:] + edges[:-1]), np.diff(np.append(noise.starts, len(data)))
    heard = middle > _LOWEST * frequency_hz
    near = (middle > _NEAR_BAND[0] * frequency_hz) & (middle < _NEAR_BAND[1] * frequency_hz)
    if np.count_nonzero(near) < 3 or np.array_equal(near, heard):
        return nothing(COLOURED_NOISE)
    density = noise.variance[(noise.starts + number // 2).clip(max=len(data) - 1)]
    there = near * number / float(number[near].sum()) * density
    whole = heard * number / float(number[heard].sum()) * density
    # The error of the logarithm of a ratio of two sums of densities.
    part = there / there.sum() - whole / whole.sum()
    ratio = float(there.sum() / whole.sum())
    sd = math.sqrt(float(part @ noise.uncertainty @ part))
    score = (abs(math.log(ratio)) - math.log(_HARMLESS_RATIO)) / max(sd, 1e-9)
    gain = float(number[heard] @ np.log(whole.sum() / density[heard]))
    across = np.log(middle) * near
    across = near * (across - across.sum() / np.count_nonzero(near))
    across /= across @ across
    slope = -float(across @ np.log(density))
    word = "stronger" if ratio > 1.0 else "weaker"
    return Finding(
        COLOURED_NOISE,
        upper_tail(score),
        max(gain, 0.0),
        {
            "slope": Estimate(slope, math.sqrt(float(across @ noise.uncertainty @ across)), ""),
            "density_ratio": Estimate(ratio, ratio * sd, ""),
        },
        Location(
            (float(data.time_s[0]), float(data.time_s[-1])),
            frequency_hz=(_NEAR_BAND[0] * frequency_hz, _NEAR_BAND[1] * frequency_hz),
        ),
        summary=f"the noise about the pendulum's frequency is {max(ratio, 1.0 / ratio):.2g} times"
        f" {word} in power than on average: it is coloured (power as f^{-slope:.2g} there)",
    )
