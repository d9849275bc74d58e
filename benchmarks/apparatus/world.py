"""A scene: a pendulum, its sensor, and what acts on both; and what the sensor reads of it.

The motion is the challenge's own (`pendpipe_challenge.motion`); nothing is taken from the library.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Final, NamedTuple

import numpy as np
from scipy.interpolate import CubicHermiteSpline, CubicSpline
from scipy.signal import lfilter

from pendpipe.arrays import FloatArray as Array
from pendpipe_challenge.chain import with_turns
from pendpipe_challenge.motion import Motion
from pendpipe_challenge.torques import of_rates

IN_CYCLE: Final = 200
TANGENT: Final = ("omega", "quadratic", "gamma", "coulomb", "release")
"""Parameters of the baseline that any fit would adjust, beside instant and offset."""


@dataclass
class Seen:
    """What a sensor sees at its instants: motion, second coordinate, last turning point."""

    time_s: Array
    angle: Callable[[Array], Array]
    x: Array
    v: Array
    p: Array
    turn: Array


Reading = Callable[[Seen, Array], Array]
"""From what is seen and the reading so far to the reading."""


@dataclass
class World:
    """All that an effect may change; what is drawn of a scene before an effect is none."""

    motion: Motion
    grid: Array
    clock: list[Callable[[Array], Array]] = field(default_factory=list)
    readings: list[Reading] = field(default_factory=list)

    def add(self, name: str, by: float, **details: float) -> None:
        """Add to a parameter of the motion, and set others."""
        self.motion = self.motion.changed(**{name: self.motion.value(name) + by}, **details)


Apply = Callable[[World, float], None]
"""Enter an effect of a size into a world."""


class Cause(NamedTuple):
    """An effect of a scene; its size is a number without unit, 0 where it is absent."""

    name: str
    apply: Apply
    size: float


@dataclass(frozen=True)
class Scene:
    """A pendulum with its sensor, as it stands on the bench.

    Parameters
    ----------
    frequency_hz
        Of small swings.
    rates
        a, b_v, b_h, c: 1/(rad s), 1/s, 1/s, rad/s.
    amplitude, lead_s
        At the release, which is that long before the first reading.
    offset, noise_rms, memory
        Of the reading: the equilibrium's, rad; the noise's, and phi of AR(1).
    step
        Of the sensor, rad; 0 where it has none.
    event_driven
        Whether a row is written when the count changes, instead of at fixed times.
    time_s
        Of the readings, from 0.
    """

    apparatus: str
    frequency_hz: float
    rates: tuple[float, float, float, float]
    amplitude: float
    lead_s: float
    offset: float
    noise_rms: float
    memory: float
    step: float
    event_driven: bool
    time_s: Array

    @property
    def omega(self) -> float:
        """2 pi times the frequency."""
        return 2 * np.pi * self.frequency_hz

    @property
    def fastest(self) -> float:
        """The first speed, rad/s."""
        return self.omega * self.amplitude

    @property
    def duration_s(self) -> float:
        """From the first reading to the last."""
        return float(self.time_s[-1])

    @property
    def loss_rate(self) -> float:
        """-d ln(amplitude)/dt by Eq. 13 at half of the first amplitude, 1/s."""
        a, viscous, hysteretic, c = self.rates
        y = self.amplitude / 2
        return a * y + viscous + hysteretic + c / y

    def world(self) -> World:
        """The scene without any effect."""
        h = 1 / (IN_CYCLE * self.frequency_hz)
        grid = np.arange(int((self.lead_s + self.duration_s) / h) + 8) * h - self.lead_s
        a, viscous, hysteretic, c = self.rates
        return World(Motion(of_rates(self.omega, a, viscous, hysteretic, c), self.amplitude), grid)

    def reading(
        self,
        causes: list[Cause],
        change: Callable[[World], None] | None = None,
        time_s: Array | None = None,
    ) -> tuple[Array, Seen]:
        """What a sensor without noise and without steps reads, and what it sees.

        Parameters
        ----------
        causes
            The effects.
        change
            A last change of the world, by which parameters are varied.
        time_s
            Other times than those of the readings.
        """
        world = self.world()
        for cause in causes:
            cause.apply(world, cause.size)
        if change:
            change(world)
        track = world.motion.run(world.grid)
        x, v = track.angle_rad, track.rate_rad_s
        angle = CubicHermiteSpline(world.grid, x, v, extrapolate=True)
        stamps = self.time_s if time_s is None else time_s
        at = stamps.copy()
        for shift in world.clock:
            at = at + shift(stamps)
        turned, sampled = with_turns(world.grid, x, v)
        before = np.flatnonzero(v[:-1] * v[1:] < 0)
        share = v[before] / (v[before] - v[before + 1])
        instants = world.grid[before] + share * (world.grid[1] - world.grid[0])
        turns = np.r_[x[0], turned[~sampled]][np.searchsorted(instants, at)]
        other = CubicSpline(world.grid, track.second_rad)(at)
        seen = Seen(stamps, angle, angle(at), angle(at, 1), other, turns)
        y = seen.x.copy()
        for read in world.readings:
            y = read(seen, y)
        return y + self.offset, seen


def whitened(scene: Scene, columns: Array, speed: Array) -> Array:
    """Columns in units of the noise, its memory taken out; shape (readings, columns).

    A step counts as noise of step/sqrt(12). Rows that are events count as often as readings at
    fixed times would, each with the scatter of the edges and of the instants.
    """
    sd = np.full(len(speed), np.hypot(scene.noise_rms, scene.step / 12**0.5))
    if scene.event_driven:
        sd = np.hypot(EVENT_EDGE * scene.step, np.abs(speed) * EVENT_JITTER_S)
    phi = scene.memory
    scaled = columns / sd[:, None]
    return lfilter([1.0, -phi], [1.0], scaled, axis=0) / np.sqrt(1 - phi**2)


EVENT_JITTER_S: Final = 5e-5
"""Scatter of the instants at which an interrupt notes a count."""
EVENT_EDGE: Final = 0.04
"""Scatter of the angles at which a count changes, in counts."""


def evidence(scene: Scene, causes: list[Cause]) -> list[float]:
    """(size/sd)^2 of each cause, had one the law and all others right: an oracle's Delta chi^2.

    All parameters of the baseline and the sizes of all causes are fitted together, linearised at
    the truth.
    """

    def shifted(name: str, by: float) -> Callable[[World], None]:
        def change(world: World) -> None:
            if name == "release":
                start = world.motion.angle_rad + by
                world.motion = replace(world.motion, angle_rad=start)
            else:
                world.add(name, by)

        return change

    there, seen = scene.reading(causes)
    columns = [np.ones_like(there), seen.v]
    loss = scene.loss_rate
    sizes = {
        "omega": 1e-5 * scene.omega,
        "quadratic": 0.015 * loss / scene.amplitude / scene.omega,
        "gamma": 0.02 * loss,
        "coulomb": 0.005 * loss * scene.amplitude * scene.omega,
        "release": 1e-4 * scene.amplitude,
    }
    columns += [
        (scene.reading(causes, shifted(name, sizes[name]))[0] - there) / sizes[name]
        for name in TANGENT
    ]
    for number, cause in enumerate(causes):
        less = cause._replace(size=0.98 * cause.size)
        without = [*causes[:number], less, *causes[number + 1 :]]
        columns.append((there - scene.reading(without)[0]) / 0.02)
    white = whitened(scene, np.column_stack(columns), seen.v)
    norms = np.linalg.norm(white, axis=0)
    norms[norms == 0] = 1.0
    values, vectors = np.linalg.eigh((white / norms).T @ (white / norms))
    inverse = (vectors / np.maximum(values, 1e-13)) @ vectors.T
    of_all = norms**2 / np.diag(inverse)
    return [float(found) for found in of_all[len(columns) - len(causes) :]]
