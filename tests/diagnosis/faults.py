"""Noise of many kinds, and faults of the measurement, to be put on a decay."""

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from pendpipe.arrays import FloatArray

from .decays import FREQUENCY_HZ, Fitted, Pendulum, fitted, rounded

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


def white(generator: Generator, count: int) -> FloatArray:
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
    return np.convolve(white(generator, count + 4), np.full(5, 0.2), mode="valid")


NOISES = {
    "white": Noisy(white),
    "red": Noisy(red),
    "memory 0.15": Noisy(lambda generator, count: remembered(generator, count, 0.15)),
    "Student, nu = 5": Noisy(student),
    "16 bit, 1.3 steps": Noisy(white, STEP_16),
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
    return fitted(AIR, clean + white(generator, AIR.count), stamps)


def speed(clean: FloatArray) -> FloatArray:
    return np.asarray(np.gradient(clean, 1.0 / AIR.rate_hz))


FAULTS = {
    "one glitch, 9 sd": Fault(
        "glitches",
        _with(
            lambda clean, generator: (
                clean
                + white(generator, AIR.count)
                + 9.0 * NOISE * (np.arange(AIR.count) == generator.integers(AIR.count))
            )
        ),
    ),
    "20 glitches, 12 sd": Fault(
        "glitches",
        _with(
            lambda clean, generator: (
                clean
                + white(generator, AIR.count)
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
                np.minimum(clean + white(generator, AIR.count), 0.155), STEP_16
            )
        ),
    ),
    "clipped on both sides": Fault(
        "clipping",
        _with(lambda clean, generator: np.clip(clean + white(generator, AIR.count), -0.12, 0.14)),
    ),
    "three codes missing": Fault(
        "missing-codes",
        _with(
            lambda clean, generator: _avoided(
                clean + 10.0 * white(generator, AIR.count), (-13, 20, 33)
            )
        ),
    ),
    "bit 3 stuck": Fault(
        "missing-codes",
        _with(
            lambda clean, generator: (
                STEP_16
                * (np.round((clean + white(generator, AIR.count)) / STEP_16).astype(np.int64) & ~8)
            )
        ),
    ),
    "step of 10 noises": Fault(
        "coarse-quantisation",
        _with(lambda clean, generator: rounded(clean + white(generator, AIR.count), STEP_12)),
    ),
    "jitter of 0.2 ms": Fault(
        "jitter",
        _with(
            lambda clean, generator: (
                clean
                + white(generator, AIR.count)
                + 2e-4 * speed(clean) * generator.standard_normal(AIR.count)
            )
        ),
    ),
    "jitter of 2 ms, 12 bit": Fault(
        "jitter",
        _with(
            lambda clean, generator: rounded(
                clean
                + white(generator, AIR.count)
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
                clean + white(generator, AIR.count) + wandering(generator, AIR.count, 1e-8)
            )
        ),
    ),
    "stamps late by 0.4 ms": Fault("time-stamps", _stamped),
}
