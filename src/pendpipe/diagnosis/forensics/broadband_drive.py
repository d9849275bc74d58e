"""Random torques: amplitude and phase perform a random walk."""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np

from pendpipe.analysis.turning_points.samples import Samples
from pendpipe.arrays import FloatArray
from pendpipe.diagnosis.data import Data
from pendpipe.diagnosis.forensics.local import residual_of
from pendpipe.diagnosis.forensics.tails import tail_of_squares
from pendpipe.diagnosis.noise import Noise
from pendpipe.diagnosis.refine import Fit
from pendpipe.diagnosis.result import Finding, Location, nothing
from pendpipe.diagnosis.scores import tangent_basis
from pendpipe.estimate import Estimate

_KICKS: Final = 64
_SIZES: Final = np.geomspace(1e-4, 1e6, 101)
"""Variances of a kick, times the largest eigenvalue, at which the likelihood is computed."""
_SMALLEST_EIGENVALUE: Final = 1e-3
"""Smallest eigenvalue used, over the largest: rougher shapes contain no information."""
_LARGEST_PHASE_ERROR: Final = 0.15
"""Phase error of the model in rad above which the test makes no sense."""
_LARGEST_RATIO: Final = 4.0
"""Ratio of S_a from slow and fast fluctuations that a random walk may have."""
_SMOOTH_GAIN: Final = 6.0
"""Gain in -2 ln L with squared eigenvalues from which it is not a random walk."""
_SUSPECT: Final = 0.05
_LARGEST_IMBALANCE: Final = 2.5
"""Largest ratio of the total gain to that of the quadrature with the smaller one."""


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


def find(data: Data, fit: Fit, noise: Noise, samples: Samples) -> Finding:
    """Test for a random torque of white density S_a.

    In a time dt it adds to both quadratures of the angle independent steps of variance
    S_a dt/(4 omega^2), which then decay with the motion: the residual has the covariance
    sigma^2 1 + S_a F F', with a column of F for the response after each instant. The score
    for S_a at zero, |F' r|^2 with the model's own freedom projected out, is a weighted
    sum of squares. It must show in amplitude and in phase, which a missing term of the law of
    motion seldom does: p = max(p_amplitude, p_phase)^2.
    """
    if data.used < 100 or fit.max_phase_error_rad > _LARGEST_PHASE_ERROR:
        return nothing("broadband-drive")
    amplitude, phase, per_kick = _fluctuations(data, fit, noise)
    if min(len(amplitude.weight), len(phase.weight)) < 5:
        return nothing("broadband-drive")
    if not (_may_walk(amplitude) and _may_walk(phase)):
        # A missing term of the law of motion, or a tone: not a random walk.
        return nothing("broadband-drive")
    p_value = max(amplitude.chance, phase.chance) ** 2
    both = Shapes(
        np.append(amplitude.weight, phase.weight), np.append(amplitude.square, phase.square)
    )
    size, sd, gain = _likelihood(both)
    less = min(_likelihood(amplitude)[2], _likelihood(phase)[2])
    gain = min(gain, _LARGEST_IMBALANCE * less) if p_value < _SUSPECT else 0.0
    return _described(data, fit, p_value, size / per_kick, sd / per_kick, gain)


def _fluctuations(data: Data, fit: Fit, noise: Noise) -> tuple[Shapes, Shapes, float]:
    """Return the shapes in amplitude and in phase, and the variance of a kick for S_a = 1."""
    sampled, time = fit.at.sampled, data.time_s
    edges = np.linspace(time[0], time[-1], _KICKS + 1)
    spacing = float(edges[1] - edges[0])
    instants = edges[:-1] + 0.5 * spacing
    growth = sampled.at_nodes(fit.at.tangent.of_start()[0])
    # A kick's random steps are spread over its window.
    after = np.clip((time[:, None] - edges[:-1]) / spacing, 0.0, 1.0)
    there = np.interp(instants, time, sampled.amplitude)
    grown = there * np.interp(instants, time, growth)
    basis = tangent_basis(fit)
    residual = np.append(noise.whiten(residual_of(data, fit)), fit.residual[-1])
    residual -= basis @ (basis.T @ residual)
    found = []
    for quadrature, scale in (
        (sampled.amplitude * sampled.cosine * growth, grown),
        (sampled.amplitude * sampled.sine, there),
    ):
        columns = after * quadrature[:, None] / scale
        tall = np.zeros((len(time) + 1, _KICKS))
        tall[:-1] = noise.whiten(columns)
        tall -= basis @ (basis.T @ tall)
        found.append(_shapes(tall, residual))
    return found[0], found[1], spacing / (4.0 * sampled.motion.angular_frequency**2)


def _shapes(columns: FloatArray, residual: FloatArray) -> Shapes:
    weight, vectors = np.linalg.eigh(columns.T @ columns)
    keep = weight > _SMALLEST_EIGENVALUE * weight[-1]
    weight, vectors = weight[keep][::-1], vectors[:, keep][:, ::-1]
    return Shapes(weight, (vectors.T @ (columns.T @ residual)) ** 2 / weight)


def _likelihood(shapes: Shapes) -> tuple[float, float, float]:
    """Return the variance of a kick, its error, and twice the gain in log-likelihood."""
    sizes = np.append(0.0, _SIZES) / shapes.weight.max()
    twice = _twice(shapes, sizes)
    best = int(np.argmin(twice))
    if 0 < best < len(sizes) - 1:
        sizes = np.append(0.0, np.geomspace(sizes[max(best - 1, 1)], sizes[best + 1], 25))
        twice = _twice(shapes, sizes)
        best = int(np.argmin(twice))
    size = float(sizes[best])
    relative = shapes.weight / (1.0 + size * shapes.weight)
    return size, math.sqrt(2.0 / float(relative @ relative)), float(twice[0] - twice[best])


def _may_walk(shapes: Shapes) -> bool:
    """Whether it may be a random walk: no smoother than one, and of one strength at all scales."""
    smoother = Shapes(shapes.weight**2, shapes.square)
    if _likelihood(smoother)[2] > _likelihood(shapes)[2] + _SMOOTH_GAIN:
        return False
    half = len(shapes.weight) // 2
    slow = Shapes(shapes.weight[:half], shapes.square[:half])
    fast = Shapes(shapes.weight[half:], shapes.square[half:])
    logs, sds = [], []
    for part in (slow, fast):
        size, sd, gain = _likelihood(part)
        if gain < _SMOOTH_GAIN:
            return True
        logs.append(math.log(size))
        sds.append(sd / size)
    return abs(logs[0] - logs[1]) < math.log(_LARGEST_RATIO) + 3.0 * math.hypot(*sds)


def _twice(shapes: Shapes, sizes: FloatArray) -> FloatArray:
    """-2 ln L at each variance of a kick."""
    variance = 1.0 + sizes[:, None] * shapes.weight
    return np.asarray(np.sum(np.log(variance) + shapes.square / variance, axis=1))


def _described(
    data: Data, fit: Fit, p_value: float, best: float, sd: float, gain: float
) -> Finding:
    sampled = fit.at.sampled
    omega = sampled.motion.angular_frequency
    pendulum = fit.model.pendulum(fit.value)
    linear = max(pendulum.linear, 1e-12)
    floor = math.sqrt(best / (8.0 * omega**2 * linear))
    return Finding(
        "broadband-drive",
        p_value,
        gain,
        {"acceleration_density": Estimate(best, sd, f"({data.unit}/s^2)^2/Hz")},
        Location.over(data.time_s, sampled.amplitude, frequency_hz=(omega / (2.0 * math.pi),)),
        summary="amplitude and phase fluctuate as under a random torque"
        f" ({best:.2g} (rad/s^2)^2/Hz; it would sustain {floor:.2g} {data.unit} rms)",
    )
