"""Decays with known faults, fitted from the truth: quick to make by the hundred."""

import math
from dataclasses import dataclass

import numpy as np

from pendpipe.analysis.noise import noise_rms
from pendpipe.analysis.turning_points.measure import Samples
from pendpipe.arrays import FloatArray
from pendpipe.diagnosis.data import Data
from pendpipe.diagnosis.noise import Noise, white_noise
from pendpipe.diagnosis.noise_estimate import estimate_noise
from pendpipe.diagnosis.refine import Fit, refine
from pendpipe.effects.baseline import OMEGA
from pendpipe.effects.model import Model
from pendpipe.recording import find_step

FREQUENCY_HZ = 0.9


@dataclass(frozen=True)
class Pendulum:
    """A recorded decay: air's of missing-physics.md (R1) unless told otherwise."""

    amplitude: float = 0.15
    quality_factor: float = 360.0
    rate_hz: float = 20.0
    count: int = 4000
    quadratic: float = 7.2e-3
    coulomb: float = 1.3e-4
    offset: float = 0.01

    def values(self) -> FloatArray:
        omega = 2.0 * math.pi * FREQUENCY_HZ
        linear = 0.5 * omega / self.quality_factor
        return np.array(
            [self.quadratic, linear, self.coulomb, 0.4, omega, self.amplitude, -0.3, self.offset]
        )

    def times(self) -> FloatArray:
        return np.arange(self.count) / self.rate_hz

    def model(self) -> Model:
        return Model(self.times(), 1.0 / self.rate_hz)


@dataclass(frozen=True)
class Fitted:
    """The input of a test of the measurement."""

    data: Data
    fit: Fit
    noise: Noise
    samples: Samples


def fitted(pendulum: Pendulum, readings: FloatArray, time_s: FloatArray | None = None) -> Fitted:
    """Fit the baseline to readings, begun at the truth."""
    times = pendulum.times() if time_s is None else time_s
    step = find_step(readings)
    samples = Samples(times, readings, "rad", step, noise_rms(readings, step))
    interval = float(np.median(np.diff(times)))
    uniform = bool(np.all(np.abs(np.diff(times) - interval) < 0.02 * interval))
    data = Data(times, readings, interval, uniform, np.ones(len(times)), step or 0.0)
    model = Model(times, interval)
    noise = white_noise(data, samples.noise_rms)
    fit = refine(model, data, noise, pendulum.values())
    residual = data.values - fit.at.reading
    noise = estimate_noise(
        data, residual, float(fit.value[OMEGA]) / (2.0 * math.pi), (step or 0.0) / math.sqrt(12.0)
    )
    return Fitted(data, refine(model, data, noise, fit.value), noise, samples)


def rounded(readings: FloatArray, step: float) -> FloatArray:
    return np.asarray(step * np.round(readings / step))
