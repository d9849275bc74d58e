"""The colour of what is random: of the noise, and of the motion under a random torque.

Under a random torque amplitude and phase perform a random walk, which colours the residual about
the pendulum's frequency; the density of coloured noise there differs from its mean.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np
from scipy.fft import dct
from scipy.special import ndtr

from pendpipe.analysis.noise import quantisation_rms
from pendpipe.arrays import FloatArray
from pendpipe.diagnosis.forensics.evidence import Evidence
from pendpipe.diagnosis.forensics.tails import tail_of_squares
from pendpipe.diagnosis.found import COLOURED_NOISE, WANDERING_ZERO, Finding, Location
from pendpipe.diagnosis.projection import blocks_of, tangent_basis
from pendpipe.diagnosis.refine import CLEAN
from pendpipe.estimate import Estimate
from pendpipe.quantities import after_number, compact

_HARMLESS_RATIO: Final = 1.5
"""Ratio of densities below which the colour changes no conclusion."""
_LOWEST: Final = 0.1
"""Lowest frequency used, over the motion's: slower noise is a drift, allowed for elsewhere."""
_SLOWER: Final = 0.5
"""Frequency below which noise is a wander of the zero, over the motion's."""
_NEAR_BAND: Final = (0.3, 3.0)
"""Frequencies, over that of the motion, by whose noise its phase and amplitude are disturbed."""
_KICKS: Final = 64
"""Windows of a random torque: as many as the shapes that amplitude and phase resolve."""
_SIZES: Final = np.geomspace(1e-4, 1e6, 801)
"""Variances of a kick, times the largest eigenvalue, at which the likelihood is computed."""
_SMALLEST_EIGENVALUE: Final = 1e-3
"""Smallest eigenvalue used, over the largest: rougher shapes contain no information."""
_LARGEST_RATIO: Final = 4.0
"""Ratio of S_a from slow and fast fluctuations that a random walk may have."""
_SMOOTH_GAIN: Final = 6.0
"""Gain in -2 ln L with squared eigenvalues from which it is not a random walk."""
_SUSPECT: Final = 0.05
"""Chance below which the fluctuations are worth a gain: the step to one in twenty."""
_LARGEST_IMBALANCE: Final = 2.5
"""Largest ratio of the total gain to that of the quadrature with the smaller one."""


def note_level(evidence: Evidence) -> Finding | None:
    """Say by how much the noise's level changes along the record, where it does and is seen."""
    data, level = evidence.data, evidence.noise.level
    # Of noise below that of rounding nothing is seen.
    if level is None or data.time_noise or evidence.noise.rms <= quantisation_rms(data.step):
        return None
    first, last = (float(np.sqrt(np.mean(part**2))) for part in np.array_split(level, 2))
    ratio = float(level.max() / level.min())
    if ratio < _HARMLESS_RATIO:
        return None
    how = "larger" if first > last else "smaller"
    said = f"the noise changes in time, by a factor of {ratio:.2g}; it is {how} in the first half"
    return Finding("changing-noise", 1.0, summary=said, kind="note")


def note_wander(evidence: Evidence) -> Finding | None:
    """Say how far the zero wanders if most of what is left is noise slower than the motion."""
    data, fit = evidence.data, evidence.fit
    count, omega = len(data), fit.at.sampled.motion.angular_frequency
    slower = max(int(_SLOWER * omega / math.pi * count * data.interval_s), 1)
    power = dct(data.residual(fit.at.reading) * data.weight, norm="ortho") ** 2 / count
    slow, fast = float(power[:slower].sum()), float(power[slower:].sum())
    if data.time_noise or not evidence.noise.coloured or slow < fast:
        return None
    wander, rest = (compact(math.sqrt(part), data.unit) for part in (slow, fast))
    said = (
        f"most of what is left is slower than the motion: the zero wanders by {wander} rms,"
        f" and what is faster is {rest} rms"
    )
    return Finding(WANDERING_ZERO, 1.0, summary=said, kind="note")


def find_coloured_noise(evidence: Evidence) -> Finding | None:
    """Test whether the density near the pendulum's frequency differs from the mean by over 1.5.

    Density and error are those of the spectrum that the readings were weighed with. The null is
    composite: any ratio between 1/1.5 and 1.5. Noise that is red only below a tenth of the
    frequency is not reported.
    """
    data, fit, noise = evidence.data, evidence.fit, evidence.noise
    if not data.uniform or not noise.coloured or fit.chi2 > CLEAN * data.used:
        return None
    frequency_hz = fit.at.sampled.motion.angular_frequency / (2.0 * math.pi)
    edges = np.append(noise.starts, len(data)) / (2.0 * len(data) * data.interval_s)
    middle, number = 0.5 * (edges[1:] + edges[:-1]), np.diff(np.append(noise.starts, len(data)))
    heard = middle > _LOWEST * frequency_hz
    near = (middle > _NEAR_BAND[0] * frequency_hz) & (middle < _NEAR_BAND[1] * frequency_hz)
    if np.count_nonzero(near) < 3 or np.array_equal(near, heard):
        return None
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
        float(ndtr(-score)),
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


class Shapes(NamedTuple):
    """Independent shapes of the fluctuations, the smoothest first.

    Parameters
    ----------
    weight
        Variance of each shape's square for kicks of unit variance; shape (k,).
    square
        Observed squares, of mean 1 + s weight for kicks of variance s; shape (k,).
    """

    weight: FloatArray
    square: FloatArray

    @property
    def chance(self) -> float:
        """Probability that noise alone gives such squares."""
        return tail_of_squares(float(self.weight @ self.square), self.weight)

    def walk(self, which: slice = slice(None), power: int = 1) -> tuple[float, float, float]:
        """Return the variance of a kick, its error, and twice the gain in log-likelihood.

        With a `power` of 2 of fluctuations that are smoother than a random walk.
        """
        weight, square = self.weight[which] ** power, self.square[which]
        sizes = np.append(0.0, _SIZES) / weight.max()
        variance = 1.0 + sizes[:, None] * weight
        # -2 ln L.
        twice = np.sum(np.log(variance) + square / variance, axis=1)
        best = int(np.argmin(twice))
        relative = weight / variance[best]
        sd = math.sqrt(2.0 / float(relative @ relative))
        return float(sizes[best]), sd, float(twice[0] - twice[best])

    @property
    def may_walk(self) -> bool:
        """Whether it is no smoother than a random walk, and of one strength at all scales."""
        if self.walk(power=2)[2] > self.walk()[2] + _SMOOTH_GAIN:
            return False
        half = len(self.weight) // 2
        slow, slow_sd, slow_gain = self.walk(slice(half))
        fast, fast_sd, fast_gain = self.walk(slice(half, None))
        if min(slow_gain, fast_gain) < _SMOOTH_GAIN:
            return True
        sd = math.hypot(slow_sd / slow, fast_sd / fast)
        return abs(math.log(slow / fast)) < math.log(_LARGEST_RATIO) + 3.0 * sd


def find_random_torque(evidence: Evidence) -> Finding | None:
    """Test for a random torque of white density S_a.

    In a time dt it adds to both quadratures of the angle independent steps of variance
    S_a dt/(4 omega^2), which then decay with the motion: the residual has the covariance
    sigma^2 1 + S_a F F', with a column of F for the response after each instant. The score
    for S_a at zero, |F' r|^2 with the model's own freedom projected out, is a weighted
    sum of squares. It must show in amplitude and in phase, which a missing term of the law of
    motion seldom does: p = max(p_amplitude, p_phase)^2.
    """
    data, fit, sampled = evidence.data, evidence.fit, evidence.sampled
    amplitude, phase, per_kick = _fluctuations(evidence)
    few = min(len(amplitude.weight), len(phase.weight)) < 5
    # A missing term of the law of motion, or a tone, is not a random walk.
    if few or not (amplitude.may_walk and phase.may_walk):
        return None
    p_value = max(amplitude.chance, phase.chance) ** 2
    both = Shapes(*(np.append(*pair) for pair in zip(amplitude, phase, strict=True)))
    size, sd, gain = both.walk()
    # What a law lacks changes amplitude and phase too, and more smoothly than kicks do.
    margin = gain - both.walk(power=2)[2]
    less = min(amplitude.walk()[2], phase.walk()[2])
    omega, density = sampled.motion.angular_frequency, size / per_kick
    linear = max(fit.model.pendulum(fit.value).linear, 1e-12)
    floor = math.sqrt(density / (8.0 * omega**2 * linear))
    unit = f"({data.unit}/s^2)^2/Hz"
    return Finding(
        "broadband-drive",
        p_value,
        min(gain, _LARGEST_IMBALANCE * less) if p_value < _SUSPECT else 0.0,
        {"acceleration_density": Estimate(density, sd / per_kick, unit)},
        evidence.everywhere(frequency_hz=(omega / (2.0 * math.pi),)),
        summary="amplitude and phase fluctuate as under a random torque"
        f" ({density:.2g} {unit}; it would sustain {floor:.2g}{after_number(data.unit)} rms)",
        margin=margin,
    )


def _fluctuations(evidence: Evidence) -> tuple[Shapes, Shapes, float]:
    """Return the shapes in amplitude and in phase, and the variance of a kick for S_a = 1."""
    data, whole = evidence.data, evidence.fit
    edges = np.linspace(data.time_s[0], data.time_s[-1], _KICKS + 1)
    residual = np.append(evidence.noise.whiten(evidence.residual), whole.residual[-1])
    fit, noise = blocks_of(whole, evidence.noise)
    residual = noise.numbers_of(residual)
    sampled = fit.at.sampled
    time = sampled.time_s
    spacing = float(edges[1] - edges[0])
    instants = edges[:-1] + 0.5 * spacing
    growth = sampled.at_nodes(fit.at.tangent.of_start()[0])
    there = np.interp(instants, time, sampled.amplitude)
    grown = there * np.interp(instants, time, growth)
    basis = tangent_basis(fit)
    residual -= basis @ (basis.T @ residual)
    # A kick's random steps are spread over its window.
    after = np.clip((time[:, None] - edges[:-1]) / spacing, 0.0, 1.0)

    def shapes(quadrature: FloatArray, scale: FloatArray) -> Shapes:
        # The last entry is the prior's.
        columns = np.pad(noise.whiten(after * quadrature[:, None] / scale), ((0, 1), (0, 0)))
        columns -= basis @ (basis.T @ columns)
        weight, vectors = np.linalg.eigh(columns.T @ columns)
        keep = weight > _SMALLEST_EIGENVALUE * weight[-1]
        weight, vectors = weight[keep][::-1], vectors[:, keep][:, ::-1]
        return Shapes(weight, (vectors.T @ (columns.T @ residual)) ** 2 / weight)

    amplitude = shapes(sampled.amplitude * sampled.cosine * growth, grown)
    phase = shapes(sampled.amplitude * sampled.sine, there)
    return amplitude, phase, spacing / (4.0 * sampled.motion.angular_frequency**2)
