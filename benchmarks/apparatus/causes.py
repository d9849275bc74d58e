"""Effects of pendulums and of their sensors, each drawn for a scene.

The names are those of the catalogue's page (`CATALOGUE`), or those of `OUTSIDE`: laws from physics
books and from apparatus that the catalogue does not hold. `near` is what comes close to such a
law: its name is no error.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np

from benchmarks.apparatus.world import Apply, Scene, Seen, World
from pendpipe.arrays import FloatArray as Array
from pendpipe_challenge.torques import BOOK

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


def _course(rng: Rng, scene: Scene) -> tuple[float, float]:
    """Time constant and rate of a course from 0 at the first reading to 1 at the last.

    It is straight (0), or levels off.
    """
    span = scene.duration_s
    tau = 0.0 if rng.integers(2) else span * _log(rng, 0.3, 2.0)
    return tau, 1 / span if tau == 0.0 else 1 / (tau * (1 - np.exp(-span / tau)))


# ------------------------------------------------------------ the motion

Motion = Callable[[Rng, Scene], tuple[str, float, dict[str, float]]]
"""A parameter of the motion, its value at size 1, and what else is set."""


def _enter_motion(
    table: dict[str, Kind], name: str, size: float, most: float, draw: Motion, *, near: str = ""
) -> None:
    """Enter an effect whose size is a parameter of the motion; a negative size is signed."""

    def drawn(rng: Rng, scene: Scene) -> Apply:
        parameter, unit, details = draw(rng, scene)
        return lambda world, size: world.add(parameter, unit * size, **details)

    table[name] = Kind(drawn, abs(size), most, size < 0, frozenset(near.split()))


def _power_law(rng: Rng, s: Scene) -> tuple[str, float, dict[str, float]]:
    n = float(rng.choice([0.5, 1.5, 2.5, 3.0]))
    return "power", 2 * s.loss_rate * s.fastest ** (1 - n), {"power_exponent": n}


def _drive(rng: Rng, s: Scene) -> tuple[str, float, dict[str, float]]:
    ratio = float(rng.choice([rng.uniform(0.3, 0.9), rng.uniform(1.1, 2.8)]))
    details = {"drive_omega": ratio * s.omega, "drive_phase": rng.uniform(0, 2 * np.pi)}
    return "drive", _torque(s), details


def _parametric(rng: Rng, s: Scene) -> tuple[str, float, dict[str, float]]:
    pace = 2 * s.omega * rng.uniform(0.96, 1.04)
    return "parametric", 1.0, {"parametric_omega": pace, "parametric_phase": rng.uniform(0, 6.28)}


def _drift(parameter: str, unit: Callable[[Scene], float]) -> Motion:
    def draw(rng: Rng, s: Scene) -> tuple[str, float, dict[str, float]]:
        tau, rate = _course(rng, s)
        return parameter, unit(s) * rate, {f"{parameter}_time": tau}

    return draw


def _jump(parameter: str, unit: Callable[[Scene], float]) -> Motion:
    return lambda rng, s: (parameter, unit(s), {f"{parameter}_at": _instant(rng, s)})


def _vortex(rng: Rng, s: Scene) -> tuple[str, float, dict[str, float]]:
    above = rng.uniform(0.3, 0.7) * s.amplitude
    return "shedding", 11.8 * s.omega * s.loss_rate, {"shedding_amplitude": above}


def _loss(scene: Scene) -> float:
    return scene.loss_rate


def _torque(scene: Scene) -> float:
    return scene.omega**2 * scene.amplitude


_MOTIONS: Final[dict[str, tuple[float, float, Motion]]] = {
    "circular-error": (1.0, 1.0, lambda rng, s: ("sine", 1.0, {})),
    "cubic-stiffness": (-0.01, 0.3, lambda rng, s: ("cubic", s.amplitude**-2, {})),
    "quadratic-stiffness": (-0.01, 0.2, lambda rng, s: ("square", 1 / s.amplitude, {})),
    "amplitude-linear-stiffness": (-0.01, 0.3, lambda rng, s: ("sided", 1 / s.amplitude, {})),
    "power-law-damping": (0.3, 2.0, _power_law),
    "cubic-damping": (
        *(0.3, 3.0),
        lambda rng, s: ("rayleigh", 8 / 3 * s.loss_rate / s.fastest**2, {}),
    ),
    "stribeck-friction": (
        *(0.2, 2.0),
        lambda rng, s: (
            *("stribeck", s.loss_rate * s.fastest),
            {"stribeck_speed": _log(rng, 0.05, 0.4) * s.fastest},
        ),
    ),
    "presliding-friction": (
        *(1e-3, 0.05),
        lambda rng, s: ("dahl", 1.0, {"dahl_reach": _log(rng, 0.02, 0.3) * s.amplitude}),
    ),
    "backlash": (0.005, 0.1, lambda rng, s: ("play", 0.5 * s.amplitude, {})),
    "vortex-shedding": (0.3, 3.0, _vortex),
    "periodic-drive": (1e-3, 0.05, _drive),
    "parametric-drive": (1e-3, 0.05, _parametric),
    "frequency-drift": (-1e-4, 0.02, _drift("omega_drift", lambda s: 1.0)),
    "damping-drift": (0.1, 1.5, _drift("gamma_drift", lambda s: 2 * s.loss_rate)),
    "release-transient": (
        *(0.3, 5.0),
        lambda rng, s: (
            *("release", 2 * s.loss_rate),
            {"release_time": _log(rng, 0.03, 0.15) * s.duration_s},
        ),
    ),
    "equilibrium-creep": (
        *(-1e-3, 0.1),
        lambda rng, s: (
            *("creep_log", s.amplitude),
            {"creep_log_time": _log(rng, 0.05, 0.5) * s.duration_s},
        ),
    ),
    "equilibrium-step": (-1e-3, 0.1, _jump("rest_jump", lambda s: s.amplitude)),
    "frequency-step": (-1e-4, 0.02, _jump("omega_jump", lambda s: 1.0)),
    "damping-step": (0.1, 1.5, _jump("gamma_jump", lambda s: 2 * s.loss_rate)),
    "impulse": (-1e-3, 0.1, _jump("impulse", lambda s: s.fastest)),
}
for _name, (_size, _most, _draw) in _MOTIONS.items():
    _enter_motion(CATALOGUE, _name, _size, _most, _draw)


@_enter(CATALOGUE, "drag-form", 1.0, 1.0)
def drag_form(rng: Rng, scene: Scene) -> Apply:
    def apply(world: World, size: float) -> None:
        moved = size * 0.5 * np.pi * scene.rates[0] / scene.omega
        world.add("quadratic", -moved)
        world.add("drag", 1.5 * moved)

    return apply


def _second_plane(world: World, scene: Scene, beats: float, swing: float, phase: float) -> None:
    """Let the other plane swing, a little faster or slower."""
    detuned = scene.omega + 2 * np.pi * beats / scene.duration_s
    world.motion = replace(
        world.motion,
        second_rad=swing * np.cos(phase),
        second_rate_rad_s=swing * scene.omega * np.sin(phase),
    ).changed(second=1.0, second_omega=detuned, second_gamma=2 * scene.loss_rate)


@_enter(CATALOGUE, "plane-coupling", 0.01, 0.3)
def plane(rng: Rng, scene: Scene) -> Apply:
    phase, beats = rng.uniform(0, 2 * np.pi), _log(rng, 1.0, 8.0) * rng.choice([-1, 1])

    def apply(world: World, size: float) -> None:
        _second_plane(world, scene, beats, size * scene.amplitude, phase)
        world.readings.append(lambda seen, y: y + seen.p)

    return apply


@_enter(CATALOGUE, "broadband-drive", 1e-3, 0.05)
def broadband(rng: Rng, scene: Scene) -> Apply:
    seed = int(rng.integers(2**31))

    def apply(world: World, size: float) -> None:
        drawn = np.random.default_rng(seed).normal(size=len(world.grid) - 1)
        kicks = size * _torque(scene) * (world.grid[1] - world.grid[0]) * drawn
        world.motion = replace(world.motion, kicks_rad_s=kicks)

    return apply


# ------------------------------------------------------------ the sensor


def _curve(tau: float, rate: float) -> Callable[[Array], Array]:
    return lambda t: rate * (t if tau == 0.0 else -tau * np.expm1(-t / tau))


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
    course = _curve(*_course(rng, scene))
    return _read(lambda seen, y, size: y + size * scene.amplitude * course(seen.time_s))


@_enter(CATALOGUE, "gain-drift", 1e-3, 0.3, signed=True)
def gain_drift(rng: Rng, scene: Scene) -> Apply:
    course = _curve(*_course(rng, scene))
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


_Shapes = Callable[[Rng, Scene], tuple[float, float]]


def _of_swing(low: float, high: float) -> _Shapes:
    return lambda rng, s: (rng.uniform(low, high) * s.amplitude, 1.0)


def _of_speed(low: float, high: float) -> _Shapes:
    return lambda rng, s: (rng.uniform(low, high) * s.fastest, 1.0)


def _one(scene: Scene) -> float:
    return 1.0


def _none(rng: Rng, scene: Scene) -> tuple[float, float]:
    return 1.0, 1.0


def _beside(low: float, high: float, least: float) -> _Shapes:
    """Frequency and damping of a second oscillator, relative."""
    return lambda rng, s: (rng.uniform(low, high), rng.uniform(least, 0.05))


_BOOKS: Final[dict[str, tuple[float, float, Callable[[Scene], float], _Shapes, str]]] = {
    "winding-string": (0.01, 0.2, _one, _none, "quadratic-stiffness"),
    "rolling-edge": (0.01, 0.3, _one, _none, "cubic-stiffness"),
    "magnet-below": (
        *(0.005, 0.1, _one, _of_swing(0.1, 0.35)),
        "presliding-friction unnamed-restoring",
    ),
    "eddy-peak": (0.5, 4.0, _loss, _of_speed(0.15, 0.5), "stribeck-friction power-law-damping"),
    "local-brake": (0.5, 6.0, _loss, _of_swing(0.1, 0.4), "power-law-damping"),
    "bumper": (0.05, 2.0, _one, _of_swing(0.5, 0.85), ""),
    "wind": (0.2, 1.5, lambda s: s.loss_rate / s.fastest, _of_speed(0.1, 0.4), "drag-form"),
    "one-way-drag": (0.3, 3.0, _loss, _none, ""),
    "ageing-friction": (
        *(0.05, 1.0, lambda s: s.loss_rate * s.fastest, _of_swing(0.03, 0.3)),
        "stribeck-friction presliding-friction vortex-shedding",
    ),
    "cable-hysteresis": (
        *(1e-3, 0.05, _one, _of_swing(0.2, 0.8)),
        "presliding-friction complex-modulus",
    ),
    "elastic-string": (0.3, 1.0, _one, _beside(2.2, 4.5, 0.005), "cubic-stiffness"),
    "sloshing-bob": (
        *(1e-3, 0.05, _one, _beside(1.06, 1.6, 0.01)),
        "second-mode plane-coupling release-transient",
    ),
    "slipping-arm": (3e-3, 0.2, _torque, _of_swing(0.4, 0.75), "vortex-shedding"),
    "cogging": (
        *(1e-3, 0.05, _torque),
        *(lambda rng, s: (rng.uniform(4.0, 12.0) * np.pi / (2 * s.amplitude), 1.0), ""),
    ),
    "vibrated-pivot": (0.01, 0.3, _one, _none, "cubic-stiffness"),
    "squeeze-film": (0.1, 1.0, _loss, _of_swing(1.1, 1.6), ""),
}
"""First and largest size, its unit, the shapes, and what comes near, of each law of `BOOK`."""


def _book(name: str, unit: Callable[[Scene], float], shapes: _Shapes) -> Motion:
    def draw(rng: Rng, scene: Scene) -> tuple[str, float, dict[str, float]]:
        first, second = shapes(rng, scene)
        details = {"book": float(BOOK[name]), "book_shape": first, "book_shape_2": second}
        return "book_size", unit(scene), details

    return draw


for _name, (_size, _most, _unit, _shape, _near) in _BOOKS.items():
    _enter_motion(OUTSIDE, _name, _size, _most, _book(_name, _unit, _shape), near=_near)


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
        _second_plane(world, scene, beats, scene.amplitude, phase)
        world.readings.append(lambda seen, y: y + size * seen.p**2 / scene.amplitude)

    return apply
