"""Effects of pendulums and of their sensors, each drawn for a scene.

The names are those of the catalogue's page (`CATALOGUE`), or those of `OUTSIDE`: laws from physics
books and from apparatus that the catalogue does not hold. `near` is what comes close to such a
law: its name is no error.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final, NamedTuple

import numpy as np

from benchmarks.apparatus.motion import Array, Law, P, T
from benchmarks.apparatus.world import Apply, Scene, Seen, World

Rng = np.random.Generator


class Kind(NamedTuple):
    """How an effect is drawn.

    Parameters
    ----------
    draw
        From a generator and a scene: how an effect of a size enters a world.
    size, most
        Where the search for a size begins, and what it may reach; equal where a rule sets it.
    signed
        Whether the size may be negative.
    near
        Names that come close.
    """

    draw: Callable[[Rng, Scene], Apply]
    size: float
    most: float
    signed: bool = False
    near: frozenset[str] = frozenset()


CATALOGUE: Final[dict[str, Kind]] = {}
OUTSIDE: Final[dict[str, Kind]] = {}


def _enter(
    table: dict[str, Kind],
    name: str,
    size: float,
    most: float,
    signed: bool = False,
    near: str = "",
) -> Callable[[Callable[[Rng, Scene], Apply]], Callable[[Rng, Scene], Apply]]:
    def entered(draw: Callable[[Rng, Scene], Apply]) -> Callable[[Rng, Scene], Apply]:
        table[name] = Kind(draw, size, most, signed, frozenset(near.split()))
        return draw

    return entered


def _log(rng: Rng, low: float, high: float) -> float:
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def _instant(rng: Rng, scene: Scene) -> float:
    return float(rng.uniform(0.15, 0.85) * scene.duration_s)


def _half_steps(world: World) -> Array:
    return np.linspace(world.grid[0], world.grid[-1], len(world.times))


def _course(rng: Rng, scene: Scene) -> Callable[[Array], Array]:
    """From 0 at the first reading to 1 at the last: straight, or levelling off."""
    span = scene.duration_s
    tau = span * (1e3 if rng.integers(2) else _log(rng, 0.3, 2.0))

    def course(t: Array) -> Array:
        return (1 - np.exp(-np.maximum(t, 0) / tau)) / (1 - np.exp(-span / tau))

    return course


# ------------------------------------------------------------ the motion


def _law_parameter(name: str, size: float, most: float, place: P, power: int) -> None:
    """A parameter that is its size over a power of the amplitude."""

    def draw(rng: Rng, scene: Scene) -> Apply:
        def apply(world: World, size: float) -> None:
            world.k[place] += size / scene.amplitude**power

        return apply

    CATALOGUE[name] = Kind(draw, size, most, signed=True)


_law_parameter("cubic-stiffness", 0.01, 0.3, P.K3, 2)
_law_parameter("quadratic-stiffness", 0.01, 0.2, P.K2, 1)
_law_parameter("amplitude-linear-stiffness", 0.01, 0.3, P.K_ABS, 1)


@_enter(CATALOGUE, "circular-error", 1.0, 1.0)
def circular(rng: Rng, scene: Scene) -> Apply:
    def apply(world: World, size: float) -> None:
        world.k[P.SINE] = size

    return apply


@_enter(CATALOGUE, "drag-form", 1.0, 1.0)
def drag_form(rng: Rng, scene: Scene) -> Apply:
    def apply(world: World, size: float) -> None:
        world.k[P.VELOCITY_FORM] = size

    return apply


@_enter(CATALOGUE, "power-law-damping", 0.3, 2.0)
def power_law(rng: Rng, scene: Scene) -> Apply:
    exponent = float(rng.choice([0.5, 1.5, 2.5, 3.0]))
    fastest = scene.omega * scene.amplitude

    def apply(world: World, size: float) -> None:
        world.k[P.EXPONENT] = exponent
        world.k[P.POWER] = size * 2 * scene.loss_rate * fastest * (0.1 / fastest) ** exponent

    return apply


@_enter(CATALOGUE, "cubic-damping", 0.3, 3.0)
def cubic_damping(rng: Rng, scene: Scene) -> Apply:
    def apply(world: World, size: float) -> None:
        world.k[P.CUBIC] = size * 8 * scene.loss_rate / scene.amplitude**2

    return apply


@_enter(CATALOGUE, "stribeck-friction", 0.2, 2.0)
def stribeck(rng: Rng, scene: Scene) -> Apply:
    slow = _log(rng, 0.05, 0.4)

    def apply(world: World, size: float) -> None:
        fastest = scene.omega * scene.amplitude
        world.k[P.STRIBECK] = size * scene.loss_rate * fastest
        world.k[P.STRIBECK_V] = slow * fastest

    return apply


@_enter(CATALOGUE, "presliding-friction", 1e-3, 0.05)
def presliding(rng: Rng, scene: Scene) -> Apply:
    depth = _log(rng, 0.02, 0.3) * scene.amplitude

    def apply(world: World, size: float) -> None:
        world.k[P.DAHL], world.k[P.DAHL_Z] = size, depth
        world.start[4] = depth

    return apply


@_enter(CATALOGUE, "backlash", 0.005, 0.1)
def backlash(rng: Rng, scene: Scene) -> Apply:
    def apply(world: World, size: float) -> None:
        world.k[P.PLAY] = max(size, 0) * scene.amplitude

    return apply


@_enter(CATALOGUE, "vortex-shedding", 0.3, 3.0)
def vortex(rng: Rng, scene: Scene) -> Apply:
    above = rng.uniform(0.3, 0.7) * scene.amplitude

    def apply(world: World, size: float) -> None:
        world.k[P.VORTEX], world.k[P.VORTEX_FROM] = size * scene.loss_rate, above

    return apply


@_enter(CATALOGUE, "plane-coupling", 0.01, 0.3)
def plane(rng: Rng, scene: Scene) -> Apply:
    phase, beats = rng.uniform(0, 2 * np.pi), _log(rng, 1.0, 8.0) * rng.choice([-1, 1])

    def apply(world: World, size: float) -> None:
        world.k[P.PLANE_DETUNING] = 2 * np.pi * beats / scene.duration_s
        world.start[2] = size * scene.amplitude * np.cos(phase)
        world.start[3] = size * scene.amplitude * scene.omega * np.sin(phase)
        world.readings.append(lambda seen, y: y + seen.p)

    return apply


@_enter(CATALOGUE, "periodic-drive", 1e-3, 0.05)
def drive(rng: Rng, scene: Scene) -> Apply:
    ratio = float(rng.choice([rng.uniform(0.3, 0.9), rng.uniform(1.1, 2.8)]))
    phase = rng.uniform(0, 2 * np.pi)

    def apply(world: World, size: float) -> None:
        at = ratio * scene.omega * _half_steps(world) + phase
        world.times[:, T.PUSH] += size * scene.omega**2 * scene.amplitude * np.cos(at)

    return apply


@_enter(CATALOGUE, "broadband-drive", 1e-3, 0.05)
def broadband(rng: Rng, scene: Scene) -> Apply:
    seed = int(rng.integers(2**31))

    def apply(world: World, size: float) -> None:
        steps = np.random.default_rng(seed).normal(size=len(world.kicks))
        random = size * scene.omega**2 * scene.amplitude * np.repeat(steps, 2)[: len(world.times)]
        world.times[:, T.PUSH] += random

    return apply


@_enter(CATALOGUE, "parametric-drive", 1e-3, 0.05)
def parametric(rng: Rng, scene: Scene) -> Apply:
    pace, phase = 2 * scene.omega * rng.uniform(0.96, 1.04), rng.uniform(0, 2 * np.pi)

    def apply(world: World, size: float) -> None:
        world.times[:, T.STIFF] += size * np.cos(pace * _half_steps(world) + phase)

    return apply


@_enter(CATALOGUE, "frequency-drift", 1e-4, 0.02, signed=True)
def frequency_drift(rng: Rng, scene: Scene) -> Apply:
    course = _course(rng, scene)

    def apply(world: World, size: float) -> None:
        world.times[:, T.STIFF] += 2 * size * course(_half_steps(world))

    return apply


@_enter(CATALOGUE, "damping-drift", 0.1, 1.5)
def damping_drift(rng: Rng, scene: Scene) -> Apply:
    course = _course(rng, scene)

    def apply(world: World, size: float) -> None:
        world.times[:, T.BRAKE] += size * scene.loss_rate * course(_half_steps(world))

    return apply


@_enter(CATALOGUE, "release-transient", 0.3, 5.0)
def release(rng: Rng, scene: Scene) -> Apply:
    tau = _log(rng, 0.03, 0.15) * scene.duration_s

    def apply(world: World, size: float) -> None:
        since = np.maximum(_half_steps(world), 0)
        world.times[:, T.BRAKE] += size * scene.loss_rate * np.exp(-since / tau)

    return apply


@_enter(CATALOGUE, "equilibrium-creep", 1e-3, 0.1, signed=True)
def creep(rng: Rng, scene: Scene) -> Apply:
    tau = _log(rng, 0.05, 0.5) * scene.duration_s

    def apply(world: World, size: float) -> None:
        since = np.maximum(_half_steps(world), 0)
        world.times[:, T.REST] += size * scene.amplitude * np.log1p(since / tau)

    return apply


def _step_in(name: str, size: float, most: float, row: T, factor: float, of_swing: bool) -> None:
    def draw(rng: Rng, scene: Scene) -> Apply:
        at = _instant(rng, scene)

        def apply(world: World, size: float) -> None:
            height = factor * size * (scene.amplitude if of_swing else 1.0)
            world.times[:, row] += height * (_half_steps(world) >= at)

        return apply

    CATALOGUE[name] = Kind(draw, size, most, signed=row != T.LOSS)


_step_in("equilibrium-step", 1e-3, 0.1, T.REST, 1.0, of_swing=True)
_step_in("frequency-step", 1e-4, 0.02, T.STIFF, 2.0, of_swing=False)
_step_in("damping-step", 0.1, 1.5, T.LOSS, 1.0, of_swing=False)


@_enter(CATALOGUE, "impulse", 1e-3, 0.1, signed=True)
def impulse(rng: Rng, scene: Scene) -> Apply:
    at = _instant(rng, scene)

    def apply(world: World, size: float) -> None:
        place = int(np.searchsorted(world.grid, at))
        world.kicks[place] += size * scene.omega * scene.amplitude

    return apply


# ------------------------------------------------------------ the sensor


def _read(function: Callable[[Seen, Array, float], Array]) -> Apply:
    """An effect that changes the reading only."""

    def apply(world: World, size: float) -> None:
        world.readings.append(lambda seen, y: function(seen, y, size))

    return apply


@_enter(CATALOGUE, "second-mode", 1e-3, 0.1)
def second_mode(rng: Rng, scene: Scene) -> Apply:
    nyquist = 0.5 / float(np.median(np.diff(scene.time_s)))
    tone = min(_log(rng, 2.3, 8.0) * scene.frequency_hz, 0.8 * nyquist)
    tau, phase = _log(rng, 3.0, 20.0) / scene.frequency_hz, rng.uniform(0, 2 * np.pi)

    def ring(seen: Seen, y: Array, size: float) -> Array:
        t = seen.time_s
        sway = np.exp(-t / tau) * np.cos(2 * np.pi * tone * t + phase)
        return y + size * scene.amplitude * sway

    return _read(ring)


@_enter(CATALOGUE, "sensor-quadratic", 1e-3, 0.1, signed=True)
def quadratic(rng: Rng, scene: Scene) -> Apply:
    return _read(lambda seen, y, size: y + size * seen.x**2 / scene.amplitude)


@_enter(CATALOGUE, "sensor-cubic", 1e-3, 0.1, signed=True)
def cubic(rng: Rng, scene: Scene) -> Apply:
    return _read(lambda seen, y, size: y + size * seen.x**3 / scene.amplitude**2)


@_enter(CATALOGUE, "camera-geometry", 1e-3, 0.05)
def camera(rng: Rng, scene: Scene) -> Apply:
    # The sine of first order is a gain, which no decay shows.
    e1, e2, e3 = (float(each) for each in rng.normal(size=3))

    def turned(seen: Seen, y: Array, size: float) -> Array:
        x = seen.x
        return y + size * (e1 * (np.cos(x) - 1) + e2 * np.sin(2 * x) + e3 * (np.cos(2 * x) - 1))

    return _read(turned)


@_enter(CATALOGUE, "sensor-backlash", 1e-3, 0.1)
def coupling(rng: Rng, scene: Scene) -> Apply:
    def play(seen: Seen, y: Array, size: float) -> Array:
        b = size * scene.amplitude
        behind = b / 2 - np.maximum(0, b - np.abs(seen.x - seen.turn))
        return y - np.sign(seen.v) * behind

    return _read(play)


@_enter(CATALOGUE, "sensor-dead-band", 1e-3, 0.1)
def dead_band(rng: Rng, scene: Scene) -> Apply:
    def dead(seen: Seen, y: Array, size: float) -> Array:
        half = size * scene.amplitude / 2
        return y - np.clip(seen.x, -half, half)

    return _read(dead)


@_enter(CATALOGUE, "rolling-shutter", 0.003, 0.1, signed=True)
def shutter(rng: Rng, scene: Scene) -> Apply:
    def rows(seen: Seen, y: Array, size: float) -> Array:
        kappa = size / (scene.omega * scene.amplitude)
        late = seen.x
        for _ in range(6):
            late = seen.angle(seen.time_s + kappa * late)
        return y + late - seen.x

    return _read(rows)


@_enter(CATALOGUE, "offset-drift", 1e-3, 0.1, signed=True)
def offset_drift(rng: Rng, scene: Scene) -> Apply:
    course = _course(rng, scene)
    return _read(lambda seen, y, size: y + size * scene.amplitude * course(seen.time_s))


@_enter(CATALOGUE, "gain-drift", 1e-3, 0.3, signed=True)
def gain_drift(rng: Rng, scene: Scene) -> Apply:
    course = _course(rng, scene)
    return _read(lambda seen, y, size: y * (1 + size * course(seen.time_s)))


@_enter(CATALOGUE, "ac-coupling", 1e-3, 0.2, signed=True)
def coupled(rng: Rng, scene: Scene) -> Apply:
    tau = _log(rng, 0.02, 0.2) * scene.duration_s
    return _read(lambda seen, y, size: y + size * scene.amplitude * np.exp(-seen.time_s / tau))


@_enter(CATALOGUE, "tone-pickup", 1e-3, 0.05)
def tone(rng: Rng, scene: Scene) -> Apply:
    nyquist = 0.5 / float(np.median(np.diff(scene.time_s)))
    pitch, phase = rng.uniform(0.1, 0.9) * nyquist, rng.uniform(0, 2 * np.pi)

    def hum(seen: Seen, y: Array, size: float) -> Array:
        return y + size * scene.amplitude * np.cos(2 * np.pi * pitch * seen.time_s + phase)

    return _read(hum)


def _clock(function: Callable[[Array, float], Array]) -> Apply:
    """An effect that changes when the reading is taken."""

    def apply(world: World, size: float) -> None:
        world.clock.append(lambda t: function(t, size))

    return apply


@_enter(CATALOGUE, "clock-drift", 1e-4, 0.02, signed=True)
def clock_drift(rng: Rng, scene: Scene) -> Apply:
    return _clock(lambda t, size: size * t**2 / (2 * scene.duration_s))


@_enter(CATALOGUE, "dropped-samples", 1.0, 1.0)
def dropped(rng: Rng, scene: Scene) -> Apply:
    at, lost = _instant(rng, scene), float(rng.integers(1, 4) * np.median(np.diff(scene.time_s)))
    return _clock(lambda t, size: size * lost * (t >= at))


def _staircase(rng: Rng, scene: Scene, number: int) -> Callable[[Array], Array]:
    """A level that changes by a whole number at several instants, both ways."""
    instants = np.sort(rng.uniform(0, scene.duration_s, number))
    whole = np.r_[0, np.cumsum(rng.choice([-1, 1], number))]
    return lambda t: whole[np.searchsorted(instants, t, side="right")].astype(float)


@_enter(CATALOGUE, "clock-slips", 1.0, 1.0)
def clock_slips(rng: Rng, scene: Scene) -> Apply:
    level = _staircase(rng, scene, int(rng.integers(6, 40)))
    tick = float(np.median(np.diff(scene.time_s)))
    return _clock(lambda t, size: size * tick * level(t))


@_enter(CATALOGUE, "count-slips", 1.0, 1.0)
def count_slips(rng: Rng, scene: Scene) -> Apply:
    level = _staircase(rng, scene, int(rng.integers(5, 40)))
    return _read(lambda seen, y, size: y + size * scene.step * level(seen.time_s))


@_enter(CATALOGUE, "differential-nonlinearity", 0.5, 1.0)
def widths(rng: Rng, scene: Scene) -> Apply:
    errors = rng.normal(size=4096)

    def uneven(seen: Seen, y: Array, size: float) -> Array:
        code = np.floor(y / scene.step).astype(int)
        return y + size * scene.step * errors[code % 4096]

    return _read(uneven)


# ------------------------------------------------------------ out of the catalogue


def _book(
    name: str,
    law: Law,
    size: float,
    most: float,
    shapes: Callable[[Rng, Scene], tuple[float, float]] = lambda rng, scene: (1.0, 1.0),
    scale: Callable[[Scene], float] = lambda scene: 1.0,
    near: str = "",
) -> None:
    """A law of `Law`: its size in units of `scale`, and its two shapes."""

    def draw(rng: Rng, scene: Scene) -> Apply:
        first, second = shapes(rng, scene)
        unit = scale(scene)

        def apply(world: World, size: float) -> None:
            world.law = law
            world.k[P.SIZE], world.k[P.SHAPE], world.k[P.SHAPE_2] = size * unit, first, second

        return apply

    OUTSIDE[name] = Kind(draw, size, most, near=frozenset(near.split()))


def _loss(scene: Scene) -> float:
    return scene.loss_rate


def _torque(scene: Scene) -> float:
    return scene.omega**2 * scene.amplitude


_book("winding-string", Law.WINDING_STRING, 0.01, 0.2, near="quadratic-stiffness")
_book("rolling-edge", Law.ROLLING_EDGE, 0.01, 0.3, near="cubic-stiffness")
_book(
    *("magnet-below", Law.MAGNET_BELOW, 0.005, 0.1),
    shapes=lambda rng, scene: (rng.uniform(0.1, 0.35) * scene.amplitude, 0.0),
    near="presliding-friction unnamed-restoring",
)
_book(
    *("eddy-peak", Law.EDDY_PEAK, 0.5, 4.0),
    shapes=lambda rng, scene: (rng.uniform(0.15, 0.5) * scene.omega * scene.amplitude, 0.0),
    scale=_loss,
    near="stribeck-friction power-law-damping",
)
_book(
    *("local-brake", Law.LOCAL_BRAKE, 0.5, 6.0),
    shapes=lambda rng, scene: (rng.uniform(0.1, 0.4) * scene.amplitude, 0.0),
    scale=_loss,
    near="power-law-damping",
)
_book(
    *("bumper", Law.BUMPER, 0.05, 2.0),
    shapes=lambda rng, scene: (rng.uniform(0.5, 0.85) * scene.amplitude, 0.0),
)
_book(
    *("wind", Law.WIND, 0.2, 1.5),
    shapes=lambda rng, scene: (rng.uniform(0.1, 0.4) * scene.omega * scene.amplitude, 0.0),
    scale=lambda scene: scene.loss_rate / (scene.omega * scene.amplitude),
    near="drag-form",
)
_book("one-way-drag", Law.ONE_WAY, 0.3, 3.0, scale=_loss)
_book(
    *("ageing-friction", Law.AGEING, 0.05, 1.0),
    shapes=lambda rng, scene: (rng.uniform(0.03, 0.3) * scene.amplitude, 0.0),
    scale=lambda scene: scene.loss_rate * scene.omega * scene.amplitude,
    near="stribeck-friction presliding-friction vortex-shedding",
)
_book(
    *("cable-hysteresis", Law.BOUC_WEN, 1e-3, 0.05),
    shapes=lambda rng, scene: (rng.uniform(0.2, 0.8) * scene.amplitude, 0.0),
    near="presliding-friction complex-modulus",
)
_book(
    *("elastic-string", Law.ELASTIC, 0.3, 1.0),
    shapes=lambda rng, scene: (rng.uniform(2.2, 4.5), rng.uniform(0.005, 0.05)),
    near="cubic-stiffness",
)
_book(
    *("sloshing-bob", Law.SLOSHING, 1e-3, 0.05),
    shapes=lambda rng, scene: (rng.uniform(1.06, 1.6), rng.uniform(0.01, 0.05)),
    near="second-mode plane-coupling release-transient",
)
_book(
    *("slipping-arm", Law.SLIPPING_ARM, 3e-3, 0.2),
    shapes=lambda rng, scene: (rng.uniform(0.4, 0.75) * scene.amplitude, 0.0),
    scale=_torque,
    near="vortex-shedding",
)
_book(
    *("cogging", Law.COGGING, 1e-3, 0.05),
    shapes=lambda rng, scene: (rng.uniform(4.0, 12.0) * np.pi / (2 * scene.amplitude), 0.0),
    scale=_torque,
)
_book("vibrated-pivot", Law.VIBRATED, 0.01, 0.3, near="cubic-stiffness")
_book(
    *("squeeze-film", Law.SQUEEZE_FILM, 0.1, 1.0),
    shapes=lambda rng, scene: (rng.uniform(1.1, 1.6) * scene.amplitude, 0.0),
    scale=_loss,
)


@_enter(OUTSIDE, "subdivision", 1e-3, 0.02)
def subdivision(rng: Rng, scene: Scene) -> Apply:
    """Interpolation within a line of the scale: an error that repeats every few counts."""
    pitch, phase = scene.amplitude / rng.uniform(3, 12), rng.uniform(0, 2 * np.pi)
    wave = 2 * np.pi / pitch
    return _read(lambda seen, y, size: y + size * scene.amplitude * np.sin(wave * seen.x + phase))


@_enter(OUTSIDE, "interleave", 1e-3, 0.05, near="tone-pickup")
def interleave(rng: Rng, scene: Scene) -> Apply:
    """Every second reading is taken late."""
    tick = float(np.median(np.diff(scene.time_s)))
    return _clock(lambda t, size: size / scene.omega * (np.round(t / tick) % 2))


@_enter(OUTSIDE, "packet-times", 1e-3, 0.05, near="jitter")
def packets(rng: Rng, scene: Scene) -> Apply:
    """Readings come in packets, whose stamps are spread wrongly."""
    tick, many = float(np.median(np.diff(scene.time_s))), int(rng.integers(5, 30))

    def late(t: Array, size: float) -> Array:
        return size / scene.omega * ((np.round(t / tick) % many) / many - 0.5)

    return _clock(late)


@_enter(OUTSIDE, "slow-pen", 0.05, 0.5, near="clipping")
def slow_pen(rng: Rng, scene: Scene) -> Apply:
    """A recorder whose pen can follow no more than a part 1 - s of the first speed."""

    def follow(seen: Seen, y: Array, size: float) -> Array:
        most = (1 - size) * scene.omega * scene.amplitude * np.diff(seen.time_s, prepend=0.0)
        pen, at = np.empty_like(y), float(y[0])
        for place, (goal, reach) in enumerate(zip(y, most, strict=True)):
            at += min(max(goal - at, -reach), reach)
            pen[place] = at
        return pen

    return _read(follow)


@_enter(OUTSIDE, "second-plane-squared", 0.02, 0.4, near="plane-coupling")
def squared(rng: Rng, scene: Scene) -> Apply:
    """The sensor's gap opens with the square of a swing in the other plane."""
    phase, beats = rng.uniform(0, 2 * np.pi), _log(rng, 2.0, 10.0)

    def apply(world: World, size: float) -> None:
        world.k[P.PLANE_DETUNING] = 2 * np.pi * beats / scene.duration_s
        world.start[2] = scene.amplitude * np.cos(phase)
        world.start[3] = scene.amplitude * scene.omega * np.sin(phase)
        world.readings.append(lambda seen, y: y + size * seen.p**2 / scene.amplitude)

    return apply
