"""A pendulum in a laboratory before anything is hidden: motion, chain, noise, clock.

The noise is white (perhaps heavy-tailed) plus red below a corner. The red part is a sum of
slow cosines and sines with Gaussian amplitudes, so that the covariance is
sigma^2 I + L L^T exactly, and whitening is exact as well.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from pendpipe.arrays import FloatArray, IntArray
from pendpipe_challenge.chain import Chain
from pendpipe_challenge.motion import Motion, Track

CORNER_HZ = 0.05


@dataclass(frozen=True)
class Noise:
    """One-sided density S(f) = 2 sd^2 dt [1 + (corner/f)^alpha below the corner].

    Parameters
    ----------
    white_sd
        Of one sample, rad.
    alpha
        Steepness below the corner; 0 leaves the white part alone.
    corner_hz
        Where the red part ends.
    freedom
        Degrees of freedom of Student's t (scaled to `white_sd`); 0 for Gaussian noise.
    """

    white_sd: float
    alpha: float = 0.0
    corner_hz: float = CORNER_HZ
    freedom: float = 0.0

    def slow(self, time_s: FloatArray) -> FloatArray:
        """L, shape (samples, 2 frequencies): columns times unit Gaussians are the red part."""
        span = time_s[-1] - time_s[0] + (time_s[1] - time_s[0])
        count = int(self.corner_hz * 2.0 * span)
        if self.alpha <= 0.0 or count < 1:
            return np.empty((len(time_s), 0))
        width = 0.5 / span
        frequency = width * (np.arange(count) + 1.0)
        density = 2.0 * self.white_sd**2 * (time_s[1] - time_s[0])
        density = density * (self.corner_hz / frequency) ** self.alpha
        angle = 2.0 * np.pi * np.outer(time_s, frequency)
        weight = np.sqrt(np.tile(density * width, 2))
        return np.asarray(np.hstack([np.cos(angle), np.sin(angle)]) * weight)

    def draw(self, time_s: FloatArray, random: np.random.Generator) -> FloatArray:
        """One realisation, rad."""
        slow = self.slow(time_s)
        if self.freedom > 2.0:
            unit = random.standard_t(self.freedom, len(time_s))
            unit = unit * np.sqrt((self.freedom - 2.0) / self.freedom)
        else:
            unit = random.standard_normal(len(time_s))
        return self.white_sd * unit + slow @ random.standard_normal(slow.shape[1])


class Whitening:
    """The symmetric C^(-1/2) for C = sd^2 I + L L^T, applied and never formed."""

    def __init__(self, white_sd: float, slow: FloatArray) -> None:
        self.white_sd = white_sd
        if slow.shape[1] == 0:
            self.basis, self.shrink = slow, np.empty(0)
            return
        values, vectors = np.linalg.eigh(slow.T @ slow)
        kept = values > 1e-10 * values[-1]
        self.basis = slow @ (vectors[:, kept] / np.sqrt(values[kept]))
        self.shrink = 1.0 - 1.0 / np.sqrt(1.0 + values[kept] / white_sd**2)

    def __call__(self, columns: FloatArray) -> FloatArray:
        """Whiten a series, or each column of several."""
        slow = self.basis @ ((self.shrink * (self.basis.T @ columns).T).T)
        return np.asarray((columns - slow) / self.white_sd)


SAMPLES = 4000


@dataclass(frozen=True)
class Scenario:
    """Everything that makes one recording; `baseline` is what the solver may assume."""

    motion: Motion
    chain: Chain
    noise: Noise
    samples: int
    interval_s: float
    baseline: str = "eq8"

    @cached_property
    def time_s(self) -> FloatArray:
        """The times that the file states."""
        return np.asarray(self.interval_s * np.arange(self.samples, dtype=np.float64))

    @property
    def omega(self) -> float:
        """Angular frequency of the restoring torque, rad/s."""
        return self.motion.value("omega")

    @property
    def span_s(self) -> float:
        """Length of the record."""
        return self.samples * self.interval_s

    @property
    def sd_rad(self) -> float:
        """White noise and rounding together, of one sample."""
        coarse = self.chain.step_rad * 2.0**self.chain.dead_bits
        return math.hypot(self.noise.white_sd, coarse / math.sqrt(12.0))

    def with_motion(self, **parameters: float) -> Scenario:
        """The same with other torques."""
        return replace(self, motion=self.motion.changed(**parameters))

    def with_chain(self, **values: object) -> Scenario:
        """The same with another measurement chain."""
        return replace(self, chain=self.chain.changed(**values))

    def track(self) -> Track:
        """The motion at the moments when samples are taken."""
        return self.motion.run(self.chain.grid(self.samples, self.interval_s))

    def reading_rad(self, random: np.random.Generator | None = None) -> FloatArray:
        """What an ideal converter would show without noise, in nominal angle."""
        volts = self.chain.volts(self.track(), self.samples, random)
        return np.asarray(volts / self.chain.nominal_volts_per_radian)

    def record(self, random: np.random.Generator) -> IntArray:
        """One recording: the converter's codes, with noise."""
        angle = self.reading_rad(random) + self.noise.draw(self.time_s, random)
        return self.chain.codes(angle * self.chain.nominal_volts_per_radian)


def stop_s(scenario: Scenario, track: Track, reach: float = 10.0) -> float:
    """When the amplitude comes near the friction's dead band: from there nobody judges.

    Parameters
    ----------
    reach
        Amplitude in widths f_c/omega^2 at which the masked end begins.
    """
    p = scenario.motion
    width = (abs(p.value("coulomb")) + abs(p.value("stribeck"))) / scenario.omega**2
    if width <= 0.0:
        return float(track.time_s[-1]) + 1.0
    swing = np.hypot(track.angle_rad, track.rate_rad_s / scenario.omega)
    late = np.flatnonzero(swing < reach * width)
    return float(track.time_s[late[0]]) if len(late) else float(track.time_s[-1]) + 1.0


def draw_scenario(
    random: np.random.Generator,
    *,
    amplitude_rad: float | None = None,
    stop: bool | None = None,
    colour: bool | None = None,
    bits: int | None = None,
    drag: bool = True,
) -> Scenario:
    """Draw what a laboratory might have: Q 30 to 5000, 0.4 to 2 Hz, 0.02 to 0.5 rad.

    Parameters
    ----------
    amplitude_rad
        Given instead of drawn.
    stop
        Whether friction ends the motion within the record; drawn (one in six) if None.
    colour
        Whether the noise is red below 0.05 Hz; drawn (a half) if None.
    bits
        12 or 16; drawn if None.
    drag
        Whether quadratic drag may be present.
    """
    log_uniform = _log_uniform(random)
    omega = 2.0 * np.pi * log_uniform(0.4, 2.0)
    amplitude = amplitude_rad if amplitude_rad is not None else log_uniform(0.02, 0.5)
    quality = log_uniform(30.0, 5000.0)
    stops = random.random() < 1 / 6 if stop is None else stop
    if bits is None:
        bits = 16 if random.random() < 0.65 else 12
    chain = _converter(random, amplitude, bits)
    noise = Noise(
        white_sd=log_uniform(0.3, 3.0) * chain.step_rad,
        alpha=random.uniform(0.3, 1.5)
        if (random.random() < 0.5 if colour is None else colour)
        else 0.0,
        freedom=random.uniform(6.0, 12.0) if random.random() < 0.15 else 0.0,
    )
    # Cycles: enough to lose a good part, and never more than the samples can follow.
    decays = random.uniform(0.6, 3.0)
    cycles = float(np.clip(decays * quality / np.pi, 15.0, 250.0))
    per_cycle = max(12.0, SAMPLES / cycles * random.uniform(0.7, 1.0))
    per_cycle = min(per_cycle, 120.0)
    samples = int(min(SAMPLES, cycles * per_cycle))
    # A laboratory sets a round rate.
    interval = 1.0 / float(f"{per_cycle * omega / (2.0 * np.pi):.2g}")
    parameters = _losses(random, omega, amplitude, quality, samples * interval, stops, drag)
    return Scenario(
        motion=_released(random, parameters, amplitude),
        chain=chain,
        noise=noise,
        samples=samples,
        interval_s=interval,
    )


def _log_uniform(random: np.random.Generator):  # type: ignore[no-untyped-def]
    return lambda low, high: float(np.exp(random.uniform(np.log(low), np.log(high))))


def _converter(random: np.random.Generator, amplitude: float, bits: int) -> Chain:
    """A range that holds the swing; a sensor that is known to one per cent."""
    nominal = 3.85
    fitting = [r for r in (1.25, 2.5, 5.0, 10.0) if r > 1.15 * nominal * amplitude + 0.1]
    if bits == 12:
        # A 12-bit step is coarse: a laboratory takes the narrowest range.
        fitting = fitting[:1]
    true = nominal * (1.0 + 0.01 * random.standard_normal())
    offset = float(random.uniform(-0.05, 0.05))
    return Chain(
        volts_per_radian=true,
        nominal_volts_per_radian=nominal,
        offset_volts=offset,
        bits=bits,
        range_volts=float(random.choice(fitting)),
    )


def _losses(
    random: np.random.Generator,
    omega: float,
    amplitude: float,
    quality: float,
    span: float,
    stops: bool,
    drag: bool,
) -> dict[str, float]:
    """Shares of the first cycles' loss: linear (two kinds), quadratic, Coulomb."""
    rate = omega / (2.0 * quality)  # of ln A at the start
    fluid = random.uniform(0.0, 0.6) if drag and random.random() < 0.8 else 0.0
    solid = random.uniform(0.0, 0.1) if random.random() < 0.7 else 0.0
    if stops:
        solid, fluid = 0.0, 0.3 * fluid
    linear = rate * (1.0 - fluid - solid)
    share = random.choice([0.0, 1.0, random.random()])
    parameters = {
        "omega": omega,
        "gamma": 2.0 * linear * (1.0 - share),
        "hysteretic": 0.5 * np.pi * linear * share,
        "quadratic": 0.5 * np.pi * rate * fluid / (omega * amplitude),
        "coulomb": 0.5 * np.pi * omega * rate * solid * amplitude,
    }
    if stops:
        parameters["coulomb"] = _stopping(random.uniform(0.6, 0.9) * span, parameters, amplitude)
    return {name: float(value) for name, value in parameters.items()}


def _stopping(at_s: float, parameters: dict[str, float], amplitude: float) -> float:
    """Coulomb friction that ends the motion near `at_s`: -dA/dt = b A + c, drag set aside."""
    b = 0.5 * parameters["gamma"] + 2.0 / np.pi * parameters["hysteretic"]
    b += 0.3 * 2.0 / np.pi * parameters["omega"] * parameters["quadratic"] * amplitude
    c = b * amplitude / np.expm1(min(b * at_s, 30.0))
    return float(0.5 * np.pi * parameters["omega"] * c)


def _released(
    random: np.random.Generator, parameters: dict[str, float], amplitude: float
) -> Motion:
    """The record begins at any phase of a swing, on either side."""
    phase = random.uniform(0.0, 2.0 * np.pi)
    return Motion(
        parameters,
        angle_rad=float(amplitude * np.cos(phase)),
        rate_rad_s=float(-parameters["omega"] * amplitude * np.sin(phase)),
    )
