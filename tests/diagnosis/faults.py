"""Decays, noise of many kinds and faults of the measurement, and all tests of it on a record."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from pendpipe.analysis.noise import noise_rms
from pendpipe.analysis.readings import find_step
from pendpipe.analysis.turning_points.measure import Samples
from pendpipe.arrays import FloatArray
from pendpipe.diagnosis.data import Data
from pendpipe.diagnosis.forensics import FINDERS
from pendpipe.diagnosis.forensics.evidence import Evidence
from pendpipe.diagnosis.found import Finding
from pendpipe.diagnosis.noise import Noise, estimate_noise, white_noise
from pendpipe.diagnosis.refine import Fit, refine
from pendpipe.dynamics.eq8 import OMEGA
from pendpipe.effects.model import Model

from .records import FREQUENCY_HZ

# Decays with known faults, fitted from the truth: quick to make by the hundred.


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


# Noise of many kinds, and faults of the measurement, to be put on a decay.

NOISE = 1e-4
STEP_12, STEP_16 = 1.27e-3, 7.9e-5
AIR = Pendulum()
NULLS = (
    AIR,
    Pendulum(amplitude=0.4),
    Pendulum(amplitude=0.05, quality_factor=3000.0, quadratic=1e-4, coulomb=1e-6),
    Pendulum(quality_factor=40.0, quadratic=0.05, count=900),
)
Generator = np.random.Generator


class Noisy(NamedTuple):
    """How noise is made, and the step to which the sum is rounded (0: none)."""

    make: Callable[[Generator, int], FloatArray]
    step: float = 0.0


def drawn_white(generator: Generator, count: int) -> FloatArray:
    return np.asarray(NOISE * generator.standard_normal(count))


def red(generator: Generator, count: int) -> FloatArray:
    """Twice the white noise's density at 0.05 Hz, and 1/f below and above."""
    frequency = np.fft.rfftfreq(count, 1.0 / AIR.rate_hz)
    frequency[0] = np.inf
    line = np.sqrt(1.0 + 2.0 * 0.05 / frequency)
    return np.asarray(
        NOISE * np.fft.irfft(np.fft.rfft(generator.standard_normal(count)) * line, count)
    )


def remembered(generator: Generator, count: int, memory: float) -> FloatArray:
    """First-order memory: each error keeps part of the one before."""
    from scipy.signal import lfilter

    noise = lfilter([1.0], [1.0, -memory], generator.standard_normal(count + 100))[100:]
    return np.asarray(NOISE * noise)


def student(generator: Generator, count: int) -> FloatArray:
    return np.asarray(NOISE * generator.standard_t(5.0, count))


def normal(size: float) -> Callable[[Generator, int], FloatArray]:
    return lambda generator, count: np.asarray(size * generator.standard_normal(count))


def smoothed(generator: Generator, count: int) -> FloatArray:
    """Noise of which the instrument stored the running mean of five."""
    return np.convolve(drawn_white(generator, count + 4), np.full(5, 0.2), mode="valid")


NOISES = {
    "white": Noisy(drawn_white),
    "red": Noisy(red),
    "memory 0.15": Noisy(lambda generator, count: remembered(generator, count, 0.15)),
    "Student, nu = 5": Noisy(student),
    "16 bit, 1.3 steps": Noisy(drawn_white, STEP_16),
    "16 bit, 0.3 steps": Noisy(normal(0.3 * STEP_16), STEP_16),
    "12 bit, 0.8 steps": Noisy(normal(0.8 * STEP_12), STEP_12),
    "12 bit, 0.3 steps": Noisy(normal(0.3 * STEP_12), STEP_12),
}


def null(seed: int, kind: str, clean: dict[Pendulum, FloatArray]) -> Fitted:
    """A decay with noise and no fault; `clean` keeps the motions."""
    generator = np.random.default_rng(seed)
    pendulum = NULLS[seed % len(NULLS)]
    if pendulum not in clean:
        clean[pendulum] = pendulum.model().reading(pendulum.values())
    noise = NOISES[kind]
    readings = clean[pendulum] + generator.uniform(-1e-3, 1e-3)
    readings = readings + noise.make(generator, pendulum.count)
    return fitted(pendulum, rounded(readings, noise.step) if noise.step else readings)


def wandering(generator: Generator, count: int, density: float) -> FloatArray:
    """What white torque of density S_a (one-sided) does to a linear pendulum."""
    omega, interval = 2.0 * math.pi * FREQUENCY_HZ, 1.0 / AIR.rate_hz
    time = interval * np.arange(count)
    kick = generator.standard_normal(count) * math.sqrt(0.5 * density * interval)
    damped = np.exp(-0.5 * omega / AIR.quality_factor * time) * np.sin(omega * time) / omega
    return np.convolve(kick, damped)[:count]


class Fault(NamedTuple):
    """A fault: readings (or times) of it, and the test that must find it."""

    test: str
    make: Callable[[FloatArray, Generator], Fitted]


def _avoided(readings: FloatArray, codes: tuple[int, ...]) -> FloatArray:
    code = np.round(readings / STEP_12).astype(np.int64)
    return np.asarray(STEP_12 * (code + np.isin(code, codes)))


def _with(extra: Callable[[FloatArray, Generator], FloatArray]) -> Callable[..., Fitted]:
    return lambda clean, generator: fitted(AIR, extra(clean, generator))


def _stamped(clean: FloatArray, generator: Generator) -> Fitted:
    stamps = AIR.times() + generator.uniform(-4e-4, 4e-4, AIR.count)
    return fitted(AIR, clean + drawn_white(generator, AIR.count), stamps)


def speed(clean: FloatArray) -> FloatArray:
    return np.asarray(np.gradient(clean, 1.0 / AIR.rate_hz))


FAULTS = {
    "one glitch, 9 sd": Fault(
        "glitches",
        _with(
            lambda clean, generator: (
                clean
                + drawn_white(generator, AIR.count)
                + 9.0 * NOISE * (np.arange(AIR.count) == generator.integers(AIR.count))
            )
        ),
    ),
    "20 glitches, 12 sd": Fault(
        "glitches",
        _with(
            lambda clean, generator: (
                clean
                + drawn_white(generator, AIR.count)
                + 12.0
                * NOISE
                * np.isin(np.arange(AIR.count), generator.choice(AIR.count, 20, replace=False))
                * generator.choice([-1.0, 1.0], AIR.count)
            )
        ),
    ),
    "clipped above 0.155 rad": Fault(
        "clipping",
        _with(
            lambda clean, generator: rounded(
                np.minimum(clean + drawn_white(generator, AIR.count), 0.155), STEP_16
            )
        ),
    ),
    "clipped on both sides": Fault(
        "clipping",
        _with(
            lambda clean, generator: np.clip(clean + drawn_white(generator, AIR.count), -0.12, 0.14)
        ),
    ),
    "three codes missing": Fault(
        "missing-codes",
        _with(
            lambda clean, generator: _avoided(
                clean + 10.0 * drawn_white(generator, AIR.count), (-13, 20, 33)
            )
        ),
    ),
    "bit 3 stuck": Fault(
        "missing-codes",
        _with(
            lambda clean, generator: (
                STEP_16
                * (
                    np.round((clean + drawn_white(generator, AIR.count)) / STEP_16).astype(np.int64)
                    & ~8
                )
            )
        ),
    ),
    "step of 10 noises": Fault(
        "coarse-quantisation",
        _with(lambda clean, generator: rounded(clean + drawn_white(generator, AIR.count), STEP_12)),
    ),
    "jitter of 0.2 ms": Fault(
        "jitter",
        _with(
            lambda clean, generator: (
                clean
                + drawn_white(generator, AIR.count)
                + 2e-4 * speed(clean) * generator.standard_normal(AIR.count)
            )
        ),
    ),
    "jitter of 2 ms, 12 bit": Fault(
        "jitter",
        _with(
            lambda clean, generator: rounded(
                clean
                + drawn_white(generator, AIR.count)
                + 2e-3 * speed(clean) * generator.standard_normal(AIR.count),
                STEP_12,
            )
        ),
    ),
    "memory 0.5": Fault(
        "coloured-noise",
        _with(lambda clean, generator: clean + remembered(generator, AIR.count, 0.5)),
    ),
    "torque of 1e-8": Fault(
        "broadband-drive",
        _with(
            lambda clean, generator: (
                clean + drawn_white(generator, AIR.count) + wandering(generator, AIR.count, 1e-8)
            )
        ),
    ),
    "stamps late by 0.4 ms": Fault("time-stamps", _stamped),
}


# All tests of the measurement one after the other, as a search makes them on a record.

_SURE = 1e-3
"""p-value from which a finding's readings are left out of the tests that follow."""


def _made(name: str) -> Callable[..., Finding]:
    """Make the tests for one fault: what the first says that can be made."""
    finds = [finder.find for finder in FINDERS if finder.name == name]

    def make(*given: Any) -> Finding:
        found = (find(Evidence(*given)) for find in finds)
        return next((each for each in found if each is not None), Finding(name, 1.0))

    return make


_NOTES = ("changing-noise", "wandering-zero")
TESTS = {each.name: _made(each.name) for each in FINDERS if each.name not in _NOTES}
"""By name of a fault, its test."""


def examine(record: Fitted) -> list[Finding]:
    """Make every test; what is found and what is not."""
    data, findings = record.data, []
    for find in TESTS.values():
        finding = find(data, record.fit, record.noise, record.samples)
        findings.append(finding)
        if finding.p_value > _SURE:
            continue
        if finding.mask is not None:
            data = data.masked((data.weight == 0.0) | finding.mask)
        if finding.time_s is not None:
            # To first order, the readings that the false stamps' moments would have had.
            late = data.time_s - finding.time_s
            data = replace(data, values=data.values + record.fit.at.sampled.velocity * late)
    return findings
