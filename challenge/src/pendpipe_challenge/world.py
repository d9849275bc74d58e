"""A pendulum on its bench: how it moves, what its sensor reads, and what a change of it is worth.

A cause enters a world at a size: it changes the motion, the instants of the readings, or the
readings. Its evidence is (size/sd)^2, had one the law and all others right.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from copy import copy
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from typing import Final, NamedTuple

import numpy as np
from scipy.optimize import least_squares

from pendpipe.arrays import FloatArray as Array
from pendpipe_challenge.motion import Motion
from pendpipe_challenge.torques import of_rates

CORNER_HZ: Final = 0.05
"""Where red noise ends."""
EVENT_JITTER_S: Final = 5e-5
"""Scatter of the instants at which an interrupt notes a count."""
EVENT_EDGE: Final = 0.04
"""Scatter of the angles at which a count changes, in counts."""
Rng = np.random.Generator


class Seen(NamedTuple):
    """What a sensor sees at its instants: motion, second coordinate, last turning point."""

    time_s: Array
    x: Array
    v: Array
    p: Array
    turn: Array


Reading = Callable[[Seen, Array], Array]
"""From what is seen and the reading so far to the reading."""


@dataclass
class World:
    """All that a cause may change.

    Parameters
    ----------
    kicks
        Change of v at the start of each interval between readings; None for none.
    clock
        What is added to the instants that the file states.
    readings
        One after the other, before noise.
    limits
        Of what is written: they act on the noise as well.
    """

    motion: Motion
    kicks: Callable[[Array], Array] | None = None
    clock: list[Callable[[Array], Array]] = field(default_factory=list)
    readings: list[Reading] = field(default_factory=list)
    limits: list[Callable[[Array], Array]] = field(default_factory=list)

    def add(self, name: str, by: float, **details: float) -> None:
        """Add to a parameter of the motion, and set others."""
        self.motion = self.motion.changed(**{name: self.motion.value(name) + by}, **details)


Apply = Callable[[World, float], None]
"""Enter a cause of a size into a world."""


class Cause(NamedTuple):
    """A cause in a scene; its size is a number without unit, 0 where it is absent."""

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
    offset, noise_rms
        Of the reading: the equilibrium's, rad; the white noise's.
    step
        Of the sensor, rad; 0 where it has none.
    time_s
        Of the readings, from 0.
    red
        Steepness of the noise's spectrum below `CORNER_HZ`; 0 for white noise.
    event_driven
        Whether a row is written when the count changes, instead of at fixed times.
    place
        Where a cause is that is local in time or in frequency, 0 to 1.
    baseline
        What the solver may assume: ``eq8``, or ``viscous``.
    bits
        Of a laboratory's converter, whose steps they number.
    """

    apparatus: str
    frequency_hz: float
    rates: tuple[float, float, float, float]
    amplitude: float
    lead_s: float
    offset: float
    noise_rms: float
    step: float
    time_s: Array
    red: float = 0.0
    event_driven: bool = False
    place: float = 0.5
    baseline: str = "eq8"
    bits: int = 0

    @property
    def omega(self) -> float:
        """2 pi times the frequency."""
        return 2 * np.pi * self.frequency_hz

    @property
    def fastest(self) -> float:
        """The first speed, rad/s."""
        return self.omega * self.amplitude

    @property
    def torque(self) -> float:
        """The first restoring torque, rad/s^2."""
        return self.omega**2 * self.amplitude

    @property
    def duration_s(self) -> float:
        """From the first reading to the last."""
        return float(self.time_s[-1])

    @property
    def tick_s(self) -> float:
        """Between two readings."""
        return float(np.median(np.diff(self.time_s)))

    @property
    def sd(self) -> float:
        """White noise and rounding together, rad."""
        return math.hypot(self.noise_rms, self.step / math.sqrt(12))

    @property
    def instant_s(self) -> float:
        """When a cause acts that is local in time."""
        return (0.15 + 0.7 * self.place) * self.duration_s

    @property
    def tone_hz(self) -> float:
        """Where a cause is that is local in frequency."""
        return (0.1 + 0.8 * self.place) * 0.5 / self.tick_s

    @property
    def loss_rate(self) -> float:
        """-d ln(amplitude)/dt by Eq. 13 at half of the first amplitude, 1/s."""
        a, viscous, hysteretic, c = self.rates
        y = self.amplitude / 2
        return a * y + viscous + hysteretic + c / y

    @cached_property
    def slow(self) -> Array:
        """L, shape (readings, 2 frequencies): times unit Gaussians it is the red noise.

        One-sided density 2 noise_rms^2 dt (corner/f)^red.
        """
        width = 0.5 / (self.duration_s + self.tick_s)
        frequency = width * (1 + np.arange(int(CORNER_HZ / width) if self.red > 0 else 0))
        power = 2 * self.noise_rms**2 * self.tick_s * width * (CORNER_HZ / frequency) ** self.red
        angle = 2 * np.pi * np.outer(self.time_s, frequency)
        return np.asarray(np.hstack([np.cos(angle), np.sin(angle)]) * np.sqrt(np.tile(power, 2)))

    def noise(self, rng: Rng) -> Array:
        """One realisation, rad."""
        white = self.noise_rms * rng.standard_normal(len(self.time_s))
        return white + self.slow @ rng.standard_normal(self.slow.shape[1])

    @cached_property
    def _whitening(self) -> tuple[Array, Array]:
        """An orthonormal basis of the red noise, and what C^(-1/2) takes off in it."""
        values, vectors = np.linalg.eigh(self.slow.T @ self.slow)
        kept = values > 1e-10 * values[-1:]
        basis = self.slow @ (vectors[:, kept] / np.sqrt(values[kept]))
        return basis, 1 - 1 / np.sqrt(1 + values[kept] / self.sd**2)

    def whitened(self, columns: Array, speed: Array) -> Array:
        """Columns in units of the noise, its colour taken out; shape (readings, columns).

        A step counts as noise of step/sqrt(12). Rows that are events count as often as readings
        at fixed times would, each with the scatter of the edges and of the instants.
        """
        if self.event_driven:
            sd = np.hypot(EVENT_EDGE * self.step, np.abs(speed) * EVENT_JITTER_S)
            return np.asarray(columns / sd[:, None])
        basis, shrink = self._whitening
        return np.asarray(columns - basis @ (shrink[:, None] * (basis.T @ columns))) / self.sd

    def world(self, causes: list[Cause]) -> World:
        """The scene with its causes."""
        world = World(Motion(of_rates(self.omega, *self.rates), self.amplitude))
        for cause in causes:
            cause.apply(world, cause.size)
        return world

    def reading(
        self,
        causes: list[Cause],
        change: Callable[[World], None] | None = None,
        time_s: Array | None = None,
        noise: Reading | None = None,
    ) -> tuple[Array, Seen]:
        """What a sensor without steps reads, and what it sees.

        Parameters
        ----------
        causes
            What acts.
        change
            A last change of the world, by which parameters are varied.
        time_s
            Other times than those of the readings.
        noise
            What adds noise; without it there is none.
        """
        world = self.world(causes)
        if change:
            change(world)
        stamps = self.time_s if time_s is None else time_s
        at = np.maximum(sum((shift(stamps) for shift in world.clock), stamps), -self.lead_s)
        order = np.argsort(at, kind="stable")
        times = np.r_[-self.lead_s, at[order]]
        if world.kicks:
            world.motion = replace(world.motion, kicks_rad_s=world.kicks(times))
        track = world.motion.run(times)
        seen = Seen(stamps, *(np.empty_like(stamps) for _ in range(4)))
        sampled = (track.angle_rad, track.rate_rad_s, track.second_rad, track.turn_rad)
        for column, values in zip(seen[1:], sampled, strict=True):
            column[order] = values[1:]
        y = seen.x + self.offset
        for read in [*world.readings, *([noise] if noise else [])]:
            y = read(seen, y)
        for limit in world.limits:
            y = limit(y)
        return y, seen


SHARE: Final = 0.02
"""Of a size, by which its derivative is taken."""
FAR: Final = 1e15
"""In standard deviations: no pendulum is there."""
LATER: Final = 1e-4
"""Radians of phase by which the readings are shifted at a time."""
EVALUATIONS: Final = 120
"""Fifteen steps of a search among seven numbers, one of which is far away."""


class Bench:
    """What a scene's readings change by with each cause, beyond what the baseline absorbs.

    All is linear about the truth, and whitened: the baseline's parameters, and each cause's size.

    Parameters
    ----------
    scene, causes
        The truth.

    Attributes
    ----------
    changes
        What each parameter of the baseline is varied by.
    tangent
        What these and then each cause's size, by its own, change of the readings, (readings,
        parameters); an offset of the reading and of the times go before.

    Raises
    ------
    FloatingPointError
        Where the motion runs away, or there is none.
    """

    def __init__(self, scene: Scene, causes: list[Cause]) -> None:
        self.scene, self.causes = scene, causes
        self.there, self.seen = scene.reading(causes)
        loss = scene.loss_rate
        steps = {
            "omega": 1e-5 * scene.omega,
            "gamma": 0.02 * loss,
            "quadratic": 0.015 * loss / scene.fastest,
            "coulomb": 0.005 * loss * scene.fastest,
        }
        names = list(steps)[: 4 if scene.baseline == "eq8" else 2]
        self.changes: list[Callable[..., None]] = [
            *(lambda world, by, name=name: world.add(name, by * steps[name]) for name in names),
            self._higher,
        ]
        moved = [
            scene.reading(causes, partial(each, by=1.0))[0] - self.there for each in self.changes
        ]
        columns = [np.ones_like(self.there), self.seen.v, *moved]
        tangent = scene.whitened(np.column_stack(columns), self.seen.v)
        norms = np.linalg.norm(tangent, axis=0)
        if not ((norms > 0) & (norms < FAR)).all():
            raise FloatingPointError("the motion runs away, or there is none")
        u, sizes, _ = np.linalg.svd(tangent / norms, full_matrices=False)
        self.basis = u[:, sizes > 1e-7 * sizes[0]]
        shares = [
            scene.whitened(
                (scene.reading(self.less(number))[0] - self.there)[:, None] / -SHARE, self.seen.v
            )
            for number in range(len(causes))
        ]
        self.tangent = np.hstack([tangent, *shares])
        self.columns = self.off(self.tangent[:, tangent.shape[1] :])

    def less(self, number: int) -> list[Cause]:
        """The causes, one of them smaller by `SHARE`."""
        causes = list(self.causes)
        causes[number] = causes[number]._replace(size=(1 - SHARE) * causes[number].size)
        return causes

    def refined(self) -> Bench:
        """The same with what the nearest baseline leaves of each cause, however far that lies.

        About the truth a cause is a direction. One that moves the frequency much is mostly taken up
        by the baseline, along a curve whose bend may be more than what is left.
        """
        bench = copy(self)
        bench.columns = self.columns.copy()
        for number in range(len(self.causes)):
            bench.columns[:, number] = self._nearest(number)
        return bench

    def _nearest(self, number: int) -> Array:
        scene, linear = self.scene, self.columns[:, number]
        others = [cause for at, cause in enumerate(self.causes) if at != number]

        def left(by: Array) -> Array:
            def change(world: World) -> None:
                for each, size in zip(self.changes, by[2:], strict=True):
                    each(world, size)
                world.clock.append(lambda t: np.full_like(t, by[1] * LATER / scene.omega))

            there = self.there - scene.reading(others, change)[0] - by[0] * scene.noise_rms
            return np.asarray(scene.whitened(there[:, None], self.seen.v)[:, 0])

        start = np.zeros(2 + len(self.changes))
        try:
            found = least_squares(
                left, start, method="lm", diff_step=np.full(len(start), 1e-3), max_nfev=EVALUATIONS
            )
        except FloatingPointError:
            return linear
        return found.fun if 2 * found.cost < linear @ linear else linear

    def _higher(self, world: World, by: float) -> None:
        """Release the pendulum a little higher."""
        released = (1 + by * 1e-4) * world.motion.angle_rad
        world.motion = replace(world.motion, angle_rad=released)

    def off(self, white: Array) -> Array:
        """Take what the baseline absorbs out of whitened columns."""
        return np.asarray(white - self.basis @ (self.basis.T @ white))

    def left(self, readings: Array) -> Array:
        """Whitened readings, (readings, columns), less what the baseline absorbs."""
        return self.off(self.scene.whitened(readings, self.seen.v))

    def change(self, causes: list[Cause]) -> Array:
        """What other causes change, whitened, beyond the baseline."""
        return self.left((self.scene.reading(causes)[0] - self.there)[:, None])[:, 0]

    @property
    def alone(self) -> Array:
        """Delta chi^2 of each cause with the others known."""
        return np.asarray(np.sum(self.columns**2, axis=0))

    @property
    def evidence(self) -> Array:
        """Delta chi^2 of each cause with the sizes of the others fitted too."""
        norms = np.sqrt(self.alone)
        norms[norms == 0] = 1.0
        unit = self.columns / norms
        values, vectors = np.linalg.eigh(unit.T @ unit)
        inverse = (vectors / np.maximum(values, 1e-13)) @ vectors.T
        return np.asarray(self.alone / np.diag(inverse))
