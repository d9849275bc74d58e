"""Everything that can be hidden, each declared once: its law, how it is drawn, its size, its names.

A size has no unit: 1 is about as much as the swing, its losses or the noise. `CATALOGUE` has the
effects of the contract, each by one or several laws; `OUTSIDE` has laws from physics books and from
apparatus that no entry of the contract describes.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np

from pendpipe.arrays import FloatArray as Array
from pendpipe_challenge.torques import BOOK
from pendpipe_challenge.world import Apply, Rng, Scene, Seen, World


@dataclass(frozen=True)
class Law:
    """How an effect acts, and how it is drawn.

    Parameters
    ----------
    effect
        Identifier of the contract; outside the catalogue a name of its own.
    form
        The law in words.
    draw
        From a generator and a scene: how the effect enters a world at a size.
    size, most
        Where the search for a size begins, and what it may reach; equal where it has none.
    signed
        Whether the size may be negative.
    own
        Whether it is the law that the catalogue itself writes.
    also
        Other names that would be true of it, or come near.
    unnamed
        Outside the catalogue: what it is to be called.
    local
        Whether it stands at the scene's place in time or in frequency.
    chance
        Whether its readings scatter: an oracle that knew them would know too much.
    """

    effect: str
    form: str
    draw: Callable[[Rng, Scene], Apply]
    size: float
    most: float
    signed: bool = False
    own: bool = True
    also: tuple[str, ...] = ()
    unnamed: str = ""
    local: bool = False
    chance: bool = False

    @property
    def sizeless(self) -> bool:
        """Whether it is there or not, and no more."""
        return self.size == self.most

    @property
    def names(self) -> tuple[str, ...]:
        """What it may be called, the best name first."""
        return (self.unnamed or self.effect, *self.also)


Reads = Callable[[Seen, Array, float], Array]
"""From what is seen, the reading so far and a size to the reading."""
Course = Callable[[Array], Array]
"""A number that changes in time, or with the reading."""


def log_uniform(rng: Rng, low: float, high: float) -> float:
    """Drawn evenly in its logarithm."""
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def _phase(rng: Rng) -> float:
    return float(rng.uniform(0, 2 * np.pi))


def _law(
    effect: str,
    form: str,
    size: float,
    most: float,
    draw: Callable[[Rng, Scene], Apply],
    **more: Any,
) -> Law:
    """A law whose first size is negative where its sign is free."""
    also = tuple(more.pop("also", "").split())
    return Law(effect, form, draw, abs(size), most, size < 0, also=also, **more)


# ------------------------------------------------------------ the motion

Setting = tuple[str, float, dict[str, float]]
"""A parameter of the motion, its value at size 1, and what else is set."""


def _moved(
    effect: str,
    form: str,
    size: float,
    most: float,
    draw: Callable[[Rng, Scene], Setting],
    **more: Any,
) -> Law:
    """A law whose size is a parameter of the motion."""

    def drawn(rng: Rng, scene: Scene) -> Apply:
        parameter, unit, details = draw(rng, scene)
        return lambda world, size: world.add(parameter, unit * size, **details)

    return _law(effect, form, size, most, drawn, **more)


def _course(rng: Rng, scene: Scene, straight: bool) -> tuple[float, float]:
    """Time constant and rate of a course from 0 at the first reading to 1 at the last."""
    span = scene.duration_s
    tau = 0.0 if straight else span * log_uniform(rng, 0.2, 2.0)
    return tau, 1 / span if straight else 1 / (tau * (1 - np.exp(-span / tau)))


def _drift(
    parameter: str, unit: Callable[[Scene], float], straight: bool
) -> Callable[[Rng, Scene], Setting]:
    def draw(rng: Rng, s: Scene) -> Setting:
        tau, rate = _course(rng, s, straight)
        return parameter, unit(s) * rate, {f"{parameter}_time": tau}

    return draw


def _jump(parameter: str, unit: Callable[[Scene], float]) -> Callable[[Rng, Scene], Setting]:
    return lambda rng, s: (parameter, unit(s), {f"{parameter}_at": s.instant_s})


def _power_law(rng: Rng, s: Scene) -> Setting:
    n = float(rng.choice([0.5, 1.5, 2.5, 3.0]))
    return "power", 2 * s.loss_rate * s.fastest ** (1 - n), {"power_exponent": n}


def _energy_law(rng: Rng, s: Scene) -> Setting:
    n = float(rng.choice([0.25, 0.75]) + rng.uniform(-0.08, 0.08))
    return "energy", 2 * s.loss_rate * s.fastest ** (1 - 2 * n), {"energy_exponent": n}


def _drive(rng: Rng, s: Scene) -> Setting:
    """A fan, a building; never in resonance."""
    ratio = 0.3 + 2.7 * s.place if s.place < 0.2 else 0.7 + 2.5 * s.place
    return "drive", s.torque, {"drive_omega": ratio * s.omega, "drive_phase": _phase(rng)}


def _stribeck(power: float) -> Callable[[Rng, Scene], Setting]:
    return lambda rng, s: (
        *("stribeck", s.loss_rate * s.fastest),
        {"stribeck_speed": log_uniform(rng, 0.05, 0.4) * s.fastest, "stribeck_power": power},
    )


def _lugre(rng: Rng, s: Scene) -> Apply:
    """Bristles with damping, and a static friction above the sliding one."""
    reach, slow = (log_uniform(rng, 0.1, 0.4) * each for each in (s.amplitude, s.fastest))

    def apply(world: World, size: float) -> None:
        damping = 0.1 * size * s.omega
        world.add("dahl", size, dahl_reach=reach, bristle_stribeck=0.3, stribeck_speed=slow)
        world.add("bristle_damping", damping)

    return apply


def _maxwell(rng: Rng, s: Scene) -> Apply:
    """Springs that relax after the pendulum was held aside."""
    tau = rng.uniform(0.03, 0.1) * s.duration_s

    def apply(world: World, size: float) -> None:
        world.add("maxwell", size, maxwell_time=tau)
        world.motion = replace(world.motion, held_rad=world.motion.angle_rad)

    return apply


def _drag_form(rng: Rng, s: Scene) -> Apply:
    def apply(world: World, size: float) -> None:
        moved = size * 0.5 * np.pi * s.rates[0] / s.omega
        world.add("quadratic", -moved)
        world.add("drag", 1.5 * moved)

    return apply


def _broadband(rng: Rng, s: Scene) -> Apply:
    """White acceleration: a random change of v in each interval."""
    seed = int(rng.integers(2**31))

    def apply(world: World, size: float) -> None:
        def kicks(time_s: Array) -> Array:
            unit = np.random.default_rng(seed).normal(size=len(time_s) - 1)
            return np.asarray(size * s.torque * np.sqrt(0.1 * np.diff(time_s) / s.omega) * unit)

        world.kicks = kicks

    return apply


def _second(world: World, scene: Scene, detuning: float, swing: float, phase: float) -> None:
    """Let the other plane swing, a little faster or slower."""
    other = scene.omega * (1 + detuning)
    world.motion = replace(
        world.motion,
        second_rad=swing * np.cos(phase),
        second_rate_rad_s=swing * scene.omega * np.sin(phase),
    ).changed(second=1.0, second_omega=other, second_gamma=2 * scene.loss_rate)


def _detuning(rng: Rng, s: Scene) -> float:
    beats = log_uniform(rng, 1.0, 8.0) * rng.choice([-1, 1])
    return float(beats / s.duration_s / s.frequency_hz)


def _askew(rng: Rng, s: Scene) -> Apply:
    """The sensor lies askew to the two principal axes of the suspension."""
    phase, detuning = _phase(rng), _detuning(rng, s)

    def apply(world: World, size: float) -> None:
        _second(world, s, detuning, size * s.amplitude, phase)
        world.readings.append(lambda seen, y: y + seen.p)

    return apply


def _coupled_planes(rng: Rng, s: Scene) -> Setting:
    """Swing flows into the other plane and back."""
    detuning = _detuning(rng, s)
    other = {"second_omega": s.omega * (1 + detuning), "second_gamma": 2 * s.loss_rate}
    return "coupling", abs(detuning), {"second": 1.0, **other}


def _squared_plane(rng: Rng, s: Scene) -> Apply:
    """The sensor's gap opens with the square of a swing in the other plane."""
    phase, detuning = _phase(rng), _detuning(rng, s)

    def apply(world: World, size: float) -> None:
        _second(world, s, detuning, s.amplitude, phase)
        world.readings.append(lambda seen, y: y + size * seen.p**2 / s.amplitude)

    return apply


def _rocking(rng: Rng, s: Scene) -> Apply:
    """A bob that rocks, set off at the release by the pendulum's own acceleration."""
    omega = min(rng.uniform(3, 8) * s.omega, 0.8 * np.pi / s.tick_s)
    gamma = 2 * s.frequency_hz / rng.uniform(5, 30)

    def apply(world: World, size: float) -> None:
        world.add("second", 1.0, second_omega=omega, second_gamma=gamma, inertial=1.0)
        world.readings.append(lambda seen, y: y + size * seen.p)

    return apply


def _loss(s: Scene) -> float:
    return s.loss_rate


def _rub(s: Scene) -> float:
    return s.loss_rate * s.fastest


def _swing(s: Scene) -> float:
    return s.amplitude


def _cycles(rng: Rng, s: Scene, low: float, high: float) -> float:
    return float(rng.uniform(low, high) / s.frequency_hz)


MOTIONS: Final = (
    _moved("circular-error", "sin x", 1.0, 1.0, lambda r, s: ("sine", 1.0, {})),
    _moved("cubic-stiffness", "x^3", -0.01, 0.3, lambda r, s: ("cubic", s.amplitude**-2, {})),
    _moved(
        *("cubic-stiffness", "sinh flexure", 0.01, 0.3),
        lambda r, s: (
            *("stiffening", s.amplitude**-2),
            {"stiffening_scale": s.amplitude * r.uniform(0.7, 1.5)},
        ),
        own=False,
    ),
    _moved("quadratic-stiffness", "x^2", -0.01, 0.2, lambda r, s: ("square", 1 / s.amplitude, {})),
    # The phase, which the odd part of a magnet on one side moves, is often the first to show.
    _moved(
        *("quadratic-stiffness", "exponential", -0.01, 0.2),
        lambda r, s: (
            *("lopsided", 1 / s.amplitude),
            {"lopsided_scale": s.amplitude * r.uniform(1, 3)},
        ),
        own=False,
        also="cubic-stiffness",
    ),
    _moved(
        *("amplitude-linear-stiffness", "x|x|", -0.01, 0.3),
        lambda r, s: ("sided", 1 / s.amplitude, {}),
    ),
    _law("drag-form", "v|v|", 1.0, 1.0, _drag_form),
    _moved("power-law-damping", "|v|^n", 0.3, 2.0, _power_law),
    _moved("power-law-damping", "E^lambda", 0.3, 2.0, _energy_law),
    # A sphere, by Schiller and Naumann.
    _moved(
        *("power-law-damping", "C_D(Re)", 0.2, 2.0),
        lambda r, s: (
            "reynolds",
            _loss(s),
            {"reynolds_speed": s.fastest / log_uniform(r, 20, 600)},
        ),
        own=False,
    ),
    _moved(
        *("cubic-damping", "v^3", 0.3, 3.0),
        lambda r, s: ("rayleigh", 8 / 3 * s.loss_rate / s.fastest**2, {}),
    ),
    _moved(
        *("cubic-damping", "x^2 v", 0.3, 3.0),
        lambda r, s: ("van_der_pol", 8 * s.loss_rate / s.amplitude**2, {}),
    ),
    # An eddy-current brake whose magnet leaves its plate.
    _moved(
        *("cubic-damping", "brake's edge", 0.3, 3.0),
        lambda r, s: ("eddy", _loss(s), {"eddy_width": s.amplitude * r.uniform(1.2, 2.0)}),
        own=False,
    ),
    _moved("stribeck-friction", "Gaussian", 0.2, 2.0, _stribeck(2.0)),
    _moved("stribeck-friction", "exponential", 0.2, 2.0, _stribeck(1.0), own=False),
    _moved(
        *("presliding-friction", "Dahl", 1e-3, 0.05),
        lambda r, s: ("dahl", 1.0, {"dahl_reach": log_uniform(r, 0.02, 0.8) * s.amplitude}),
    ),
    _law("presliding-friction", "LuGre", 1e-3, 0.05, _lugre, own=False),
    _moved(
        *("presliding-friction", "Iwan", 1e-3, 0.05),
        lambda r, s: ("iwan", 1.0, {"iwan_reach": s.amplitude * r.uniform(0.1, 0.5)}),
        own=False,
    ),
    _moved("backlash", "dead zone", 0.005, 0.1, lambda r, s: ("play", 0.5 * s.amplitude, {})),
    _moved(
        "history-force", "Basset", 0.1, 2.0, lambda r, s: ("basset", _loss(s) / s.omega**0.5, {})
    ),
    _moved(
        *("vortex-shedding", "burst after reversal", 0.3, 3.0),
        lambda r, s: (
            *("shedding", 11.8 * s.omega * s.loss_rate),
            {"shedding_amplitude": r.uniform(0.3, 0.7) * s.amplitude},
        ),
    ),
    _law("plane-coupling", "askew sensor", 0.01, 0.3, _askew),
    _moved("plane-coupling", "coupled planes", 0.1, 1.0, _coupled_planes, own=False),
    _moved("periodic-drive", "cosine", 1e-3, 0.05, _drive, local=True),
    _law("broadband-drive", "white", 1e-3, 0.05, _broadband, chance=True),
    _moved(
        *("parametric-drive", "cosine", 1e-3, 0.05),
        lambda r, s: (
            *("parametric", 1.0),
            {
                "parametric_omega": 2 * s.omega * r.uniform(0.96, 1.04),
                "parametric_phase": _phase(r),
            },
        ),
    ),
    *(
        _moved(effect, form, size, most, _drift(parameter, unit, form == "straight"))
        for form in ("straight", "relaxing")
        for effect, size, most, parameter, unit in (
            ("frequency-drift", -1e-4, 0.02, "omega_drift", lambda s: 1.0),
            ("damping-drift", 0.1, 1.5, "gamma_drift", lambda s: 2 * s.loss_rate),
        )
    ),
    _moved(
        *("release-transient", "damping", 0.3, 5.0),
        lambda r, s: ("release", 2 * _loss(s), {"release_time": _cycles(r, s, 1.0, 6.0)}),
    ),
    # A finger that rubs on the first swings.
    _moved(
        *("release-transient", "rubbing", 0.3, 5.0),
        lambda r, s: ("release_finger", _rub(s), {"release_time": _cycles(r, s, 1.0, 4.0)}),
        own=False,
    ),
    _moved(
        *("equilibrium-creep", "straight", -1e-3, 0.1),
        lambda r, s: ("creep", s.amplitude / s.duration_s, {}),
    ),
    _moved(
        *("equilibrium-creep", "logarithmic", -1e-3, 0.1),
        lambda r, s: (
            *("creep_log", s.amplitude),
            {"creep_log_time": log_uniform(r, 0.03, 0.5) * s.duration_s},
        ),
    ),
    _law("equilibrium-creep", "Maxwell elements", 1e-3, 0.1, _maxwell, own=False),
    _moved("equilibrium-step", "jump", -1e-3, 0.1, _jump("rest_jump", _swing), local=True),
    _moved("amplitude-step", "instant", -1e-3, 0.1, _jump("scaling", lambda s: 1.0), local=True),
    # A touch, for a swing or two.
    _moved(
        *("amplitude-step", "a touch", 1e-3, 0.1),
        lambda r, s: (
            *("rub", s.frequency_hz),
            {"rub_at": s.instant_s, "rub_width": _cycles(r, s, 0.3, 2.0)},
        ),
        own=False,
        local=True,
    ),
    _moved("frequency-step", "jump", -1e-4, 0.02, _jump("omega_jump", lambda s: 1.0), local=True),
    _moved(
        *("damping-step", "jump", 0.1, 1.5),
        _jump("gamma_jump", lambda s: 2 * s.loss_rate),
        local=True,
    ),
    _moved("impulse", "sudden", -1e-3, 0.1, _jump("impulse", lambda s: s.fastest), local=True),
    # It lasts a part of a swing.
    _moved(
        *("impulse", "half sine", -1e-3, 0.1),
        lambda r, s: (
            *("impulse", s.fastest),
            {"impulse_at": s.instant_s, "impulse_width": _cycles(r, s, 0.05, 0.3)},
        ),
        own=False,
        local=True,
    ),
    _law("second-mode", "rocking", 1e-3, 0.1, _rocking, own=False),
    # Inside Eq. 8: hidden from Eq. 3 alone.
    _moved("coulomb-friction", "sgn v", 0.1, 2.0, lambda r, s: ("coulomb", _rub(s), {})),
    _moved(
        *("coulomb-friction", "short bristles", 0.1, 2.0),
        lambda r, s: (
            *("dahl", s.loss_rate / s.omega / 0.03),
            {"dahl_reach": 0.03 * s.amplitude},
        ),
        own=False,
        also="presliding-friction",
    ),
    _moved(
        *("quadratic-drag", "Eq. 8", 0.1, 2.0),
        lambda r, s: ("quadratic", s.loss_rate / s.fastest, {}),
    ),
    _moved(
        *("quadratic-drag", "v|v|", 0.1, 2.0),
        lambda r, s: ("drag", s.loss_rate / s.fastest, {}),
        own=False,
    ),
)


# ------------------------------------------------------------ the reading


def _read(
    effect: str,
    form: str,
    size: float,
    most: float,
    draw: Callable[[Rng, Scene], Reads],
    **more: Any,
) -> Law:
    """A law that changes the reading only."""

    def drawn(rng: Rng, scene: Scene) -> Apply:
        function = draw(rng, scene)

        def apply(world: World, size: float) -> None:
            world.readings.append(lambda seen, y: function(seen, y, size))

        return apply

    return _law(effect, form, size, most, drawn, **more)


def _clock(
    effect: str,
    form: str,
    size: float,
    most: float,
    draw: Callable[[Rng, Scene], Course],
    **more: Any,
) -> Law:
    """A law that changes when the reading is taken, in proportion to its size."""

    def drawn(rng: Rng, scene: Scene) -> Apply:
        late = draw(rng, scene)
        return lambda world, size: world.clock.append(lambda t: size * late(t))

    return _law(effect, form, size, most, drawn, **more)


def _limit(effect: str, form: str, draw: Callable[[Rng, Scene], Course]) -> Law:
    """A law about what is written, noise included; it is there or not."""

    def drawn(rng: Rng, scene: Scene) -> Apply:
        limit = draw(rng, scene)
        return lambda world, size: world.limits.append(lambda y: y + size * (limit(y) - y))

    return _law(effect, form, 1.0, 1.0, drawn)


def _ringing(rng: Rng, s: Scene) -> Reads:
    """A quick mode of the rod, seen by the sensor and dying out."""
    tone = min(log_uniform(rng, 2.3, 8.0) * s.frequency_hz, 0.4 / s.tick_s)
    tau, phase = _cycles(rng, s, 3.0, 25.0), _phase(rng)

    def ring(seen: Seen, y: Array, size: float) -> Array:
        sway = np.exp(-seen.time_s / tau) * np.cos(2 * np.pi * tone * seen.time_s + phase)
        return y + size * s.amplitude * sway

    return ring


def _camera(rng: Rng, s: Scene) -> Reads:
    # The sine of first order is a gain, which no decay shows.
    e1, e2, e3 = (float(each) for each in rng.normal(size=3))

    def turned(seen: Seen, y: Array, size: float) -> Array:
        x = seen.x
        return y + size * (e1 * (np.cos(x) - 1) + e2 * np.sin(2 * x) + e3 * (np.cos(2 * x) - 1))

    return turned


def _play(rng: Rng, s: Scene) -> Reads:
    """The reading follows when the play of full width b is used up."""

    def play(seen: Seen, y: Array, size: float) -> Array:
        b = size * s.amplitude
        return y - np.sign(seen.v) * (b / 2 - np.maximum(0, b - np.abs(seen.x - seen.turn)))

    return play


def _elastic_slip(rng: Rng, s: Scene) -> Reads:
    """A coupling that gives before it slips (Dahl's)."""

    def slip(seen: Seen, y: Array, size: float) -> Array:
        half = size * s.amplitude / 2
        gone = np.exp(-np.abs(seen.x - seen.turn) / max(half, 1e-12))
        return np.asarray(y - np.sign(seen.v) * half * (1 - 2 * gone))

    return slip


def _shutter(rng: Rng, s: Scene) -> Reads:
    """A camera's rows are read one after the other: the higher the mark, the later."""

    def rows(seen: Seen, y: Array, size: float) -> Array:
        late = seen.x
        for _ in range(6):
            ahead = size / s.amplitude * late
            late = seen.x * np.cos(ahead) + seen.v / s.omega * np.sin(ahead)
        return y + late - seen.x

    return rows


def _level(straight: bool) -> Callable[[Rng, Scene], Course]:
    def draw(rng: Rng, s: Scene) -> Course:
        tau, rate = _course(rng, s, straight)
        return lambda t: rate * (t if straight else -tau * np.expm1(-t / tau))

    return draw


def _offset(straight: bool) -> Callable[[Rng, Scene], Reads]:
    def draw(rng: Rng, s: Scene) -> Reads:
        course = _level(straight)(rng, s)
        return lambda seen, y, size: y + size * s.amplitude * course(seen.time_s)

    return draw


def _gain(straight: bool) -> Callable[[Rng, Scene], Reads]:
    def draw(rng: Rng, s: Scene) -> Reads:
        course = _level(straight)(rng, s)
        return lambda seen, y, size: y * (1 + size * course(seen.time_s))

    return draw


def _wandering(rng: Rng, s: Scene) -> Reads:
    knots, at = np.cumsum(rng.normal(size=6)), np.linspace(0, s.duration_s, 6)
    return lambda seen, y, size: y + size * s.amplitude * np.interp(seen.time_s, at, knots)


def _capacitor(rng: Rng, s: Scene) -> Reads:
    """A capacitor in the way of a level that is not zero."""
    tau = log_uniform(rng, 0.02, 0.2) * s.duration_s
    return lambda seen, y, size: y + size * s.amplitude * np.exp(-seen.time_s / tau)


def _tone(second: float) -> Callable[[Rng, Scene], Reads]:
    def draw(rng: Rng, s: Scene) -> Reads:
        pitch, phase = 2 * np.pi * s.tone_hz, _phase(rng)

        def hum(seen: Seen, y: Array, size: float) -> Array:
            angle = pitch * seen.time_s + phase
            return y + size * s.amplitude * (np.cos(angle) + second * np.cos(2 * angle))

        return hum

    return draw


def _glitches(rng: Rng, s: Scene) -> Reads:
    """One to eight wild readings."""
    places = rng.choice(np.arange(20, len(s.time_s) - 20), int(rng.integers(1, 9)), replace=False)
    jumps = rng.choice([-1, 1], len(places)) * rng.uniform(0.7, 1.3, len(places)) * s.sd

    def wild(seen: Seen, y: Array, size: float) -> Array:
        y = y.copy()
        y[places] += size * jumps
        return y

    return wild


def _jitter(rng: Rng, s: Scene) -> Reads:
    unit = rng.normal(size=len(s.time_s))
    return lambda seen, y, size: y + size * s.sd * seen.v / s.fastest * unit


def _staircase(rng: Rng, s: Scene, number: int) -> Callable[[Array], Array]:
    """A level that changes by a whole number at several instants, both ways."""
    instants = np.sort(rng.uniform(0, s.duration_s, number))
    whole = np.r_[0, np.cumsum(rng.choice([-1, 1], number))]
    return lambda t: whole[np.searchsorted(instants, t, side="right")].astype(float)


def _count_slips(rng: Rng, s: Scene) -> Reads:
    level = _staircase(rng, s, int(rng.integers(5, 40)))
    return lambda seen, y, size: y + size * s.step * level(seen.time_s)


def _clock_slips(rng: Rng, s: Scene) -> Course:
    level = _staircase(rng, s, int(rng.integers(6, 40)))
    return lambda t: s.tick_s * level(t)


def _dropped(rng: Rng, s: Scene) -> Course:
    """One to three readings lost at one place, or one repeated."""
    lost = float(rng.choice([1, 1, 2, 3, -1])) * s.tick_s
    return lambda t: np.where(t >= s.instant_s, lost, 0.0)


def _widths(rng: Rng, s: Scene) -> Reads:
    errors = rng.normal(size=4096)
    return lambda seen, y, size: y + size * s.step * errors[np.floor(y / s.step).astype(int) % 4096]


def _clipped(rng: Rng, s: Scene) -> Course:
    """A limit below the first peaks, on one side or on both."""
    level = (1 - log_uniform(rng, 0.003, 0.25)) * s.amplitude
    low = -np.inf if rng.random() < 0.4 else -level
    return lambda y: np.asarray(np.clip(y, s.offset + low, s.offset + level), np.float64)


def _saturated(rng: Rng, s: Scene) -> Course:
    """An amplifier that rounds the peaks on one side."""
    level, soft = (1 - log_uniform(rng, 0.003, 0.25)) * s.amplitude, 0.02 * s.amplitude
    return lambda y: level - soft * np.logaddexp(0, (level - y) / soft)


def _missing(*, comb: bool) -> Callable[[Rng, Scene], Course]:
    """Codes that the converter never gives; the next one gets their readings."""

    def draw(rng: Rng, s: Scene) -> Course:
        spacing = 2 ** int(rng.integers(1, 8)) if comb else 1
        top = s.amplitude / s.step
        some = np.unique(rng.uniform(-top, top, int(rng.integers(3, 20))).astype(int))

        def write(y: Array) -> Array:
            code = np.rint(y / s.step).astype(int)
            gone = (code - some[0]) % spacing == 0 if comb else np.isin(code, some)
            return s.step * (code + gone)

        return write

    return draw


def _coarse(rng: Rng, s: Scene) -> Course:
    """Low bits that do not move."""
    step = s.step * 2 ** int(rng.integers(2, 5))
    return lambda y: step * np.rint(y / step)


def _pen(rng: Rng, s: Scene) -> Reads:
    """A recorder whose pen can follow no more than a part 1 - size of the first speed."""

    def follow(seen: Seen, y: Array, size: float) -> Array:
        most = (1 - size) * s.fastest * np.diff(seen.time_s, prepend=0.0)
        pen, at = np.empty_like(y), float(y[0])
        for place, (goal, reach) in enumerate(zip(y, most, strict=True)):
            at += min(max(goal - at, -reach), reach)
            pen[place] = at
        return pen

    return follow


READINGS: Final = (
    _read("second-mode", "ringing", 1e-3, 0.1, _ringing),
    _read(
        *("sensor-quadratic", "x^2", -1e-3, 0.1),
        lambda r, s: lambda seen, y, size: y + size * seen.x**2 / s.amplitude,
    ),
    # A capacitor of one plate.
    _read(
        *("sensor-quadratic", "plate", -1e-3, 0.1),
        lambda r, s: lambda seen, y, size: y + seen.x / (1 - size * seen.x / s.amplitude) - seen.x,
        own=False,
    ),
    _read(
        *("sensor-cubic", "x^3", -1e-3, 0.1),
        lambda r, s: lambda seen, y, size: y + size * seen.x**3 / s.amplitude**2,
    ),
    # (C1 - C2)/(C1 + C2) with parallel plates and strays; a field that weakens off its centre.
    _read(
        *("sensor-cubic", "plates", 1e-3, 0.1),
        lambda r, s: (
            lambda seen, y, size: y + seen.x / (1 - size * (seen.x / s.amplitude) ** 2) - seen.x
        ),
        own=False,
    ),
    _read(
        *("sensor-cubic", "saturation", 1e-3, 0.1),
        lambda r, s: (
            lambda seen, y, size: (
                y + seen.x / np.sqrt(1 + 2 * size * (seen.x / s.amplitude) ** 2) - seen.x
            )
        ),
        own=False,
    ),
    _read("camera-geometry", "pivot and obliquity", 1e-3, 0.05, _camera),
    _read("sensor-backlash", "play", 1e-3, 0.1, _play),
    _read("sensor-backlash", "elastic slip", 1e-3, 0.1, _elastic_slip, own=False),
    _read("rolling-shutter", "rows", -0.003, 0.1, _shutter),
    _read("offset-drift", "straight", -1e-3, 0.1, _offset(True)),
    _read("offset-drift", "warm-up", -1e-3, 0.1, _offset(False), own=False),
    _read("offset-drift", "wandering", 1e-3, 0.1, _wandering, own=False),
    _read("gain-drift", "straight", -1e-3, 0.3, _gain(True)),
    _read("gain-drift", "relaxing", -1e-3, 0.3, _gain(False)),
    _read("ac-coupling", "RC", -1e-3, 0.2, _capacitor),
    _read("tone-pickup", "cosine", 1e-3, 0.05, _tone(0.0), local=True),
    _read("tone-pickup", "with harmonic", 1e-3, 0.05, _tone(0.3), own=False, local=True),
    _clock(
        *("clock-drift", "straight", -1e-4, 0.02),
        lambda r, s: lambda t: t**2 / (2 * s.duration_s),
    ),
    # A crystal that warms up.
    _clock(
        *("clock-drift", "relaxing", -1e-4, 0.02),
        lambda r, s: lambda t: t + s.duration_s / 3 * np.expm1(-3 * t / s.duration_s),
    ),
    _clock("dropped-samples", "lost or repeated", 1.0, 1.0, _dropped, local=True),
    _clock("clock-slips", "whole samples", 1.0, 1.0, _clock_slips),
    _read("count-slips", "whole counts", 1.0, 1.0, _count_slips),
    _read("glitches", "single readings", 5.0, 80.0, _glitches),
    _read("jitter", "Gaussian", 0.5, 20.0, _jitter, chance=True),
    _limit("clipping", "hard", _clipped),
    _limit("clipping", "soft", _saturated),
    _limit("missing-codes", "skipped", _missing(comb=False)),
    _limit("missing-codes", "comb", _missing(comb=True)),
    _limit("coarse-quantisation", "dead bits", _coarse),
)


# ------------------------------------------------------------ out of the catalogue

RESTORING, DAMPING = "unnamed-restoring", "unnamed-damping"
DRIVE, READING = "unnamed-drive", "unnamed-measurement"
Shapes = Callable[[Rng, Scene], tuple[float, float]]


def _book(
    name: str, size: float, most: float, unit: Callable[[Scene], float], shapes: Shapes, **more: Any
) -> Law:
    """A law of `BOOK`."""

    def draw(rng: Rng, scene: Scene) -> Setting:
        first, second = shapes(rng, scene)
        details = {"book": float(BOOK[name]), "book_shape": first, "book_shape_2": second}
        return "book_size", unit(scene), details

    return _moved(name, name.replace("-", " "), size, most, draw, own=False, **more)


def _of(low: float, high: float, unit: Callable[[Scene], float]) -> Shapes:
    return lambda rng, s: (rng.uniform(low, high) * unit(s), 1.0)


def _one(scene: Scene) -> float:
    return 1.0


def _none(rng: Rng, scene: Scene) -> tuple[float, float]:
    return 1.0, 1.0


def _beside(low: float, high: float, least: float) -> Shapes:
    """Frequency and damping of a second oscillator, relative."""
    return lambda rng, s: (rng.uniform(low, high), rng.uniform(least, 0.05))


def _subdivision(rng: Rng, s: Scene) -> Reads:
    """Interpolation within a line of the scale: an error that repeats every few counts."""
    wave, phase = 2 * np.pi * rng.uniform(3, 12) / s.amplitude, _phase(rng)
    return lambda seen, y, size: y + size * s.amplitude * np.sin(wave * seen.x + phase)


def _packets(rng: Rng, s: Scene) -> Course:
    """Readings come in packets, whose stamps are spread wrongly."""
    many = int(rng.integers(5, 30))
    return lambda t: ((np.round(t / s.tick_s) % many) / many - 0.5) / s.omega


def _ripple(rng: Rng, s: Scene) -> Reads:
    """A gain that ripples with the logarithm of the amplitude."""
    count = rng.uniform(6, 14)

    def rippled(seen: Seen, y: Array, size: float) -> Array:
        swing = np.hypot(seen.x, seen.v / s.omega) + 1e-9
        return y * (1 + size * np.cos(count * np.log(swing)))

    return rippled


def _swing_delay(rng: Rng, s: Scene) -> Reads:
    """A reading that lags more the wider the swing."""

    def late(seen: Seen, y: Array, size: float) -> Array:
        swing = np.hypot(seen.x, seen.v / s.omega) / s.amplitude
        return y - size / s.omega * swing**2 * seen.v

    return late


_OUTSIDE: Final = (
    _book("winding-string", -0.01, 0.2, _one, _none, unnamed=RESTORING, also="quadratic-stiffness"),
    _book("rolling-edge", -0.01, 0.3, _one, _none, unnamed=RESTORING, also="cubic-stiffness"),
    _book(
        *("magnet-below", 0.005, 0.1, _one, _of(0.1, 0.35, _swing)),
        unnamed=RESTORING,
        also="presliding-friction",
    ),
    _book(
        *("eddy-peak", 0.5, 4.0, _loss, _of(0.15, 0.5, lambda s: s.fastest)),
        unnamed=DAMPING,
        also="stribeck-friction power-law-damping",
    ),
    _book(
        *("local-brake", 0.5, 6.0, _loss, _of(0.1, 0.4, _swing)),
        unnamed=DAMPING,
        also="power-law-damping",
    ),
    _book("bumper", 0.05, 2.0, _one, _of(0.5, 0.85, _swing), unnamed=RESTORING),
    _book(
        *("wind", 0.2, 1.5, lambda s: s.loss_rate / s.fastest),
        _of(0.1, 0.4, lambda s: s.fastest),
        unnamed=DAMPING,
        also="drag-form",
    ),
    _book("one-way-drag", 0.3, 3.0, _loss, _none, unnamed=DAMPING),
    _book(
        *("ageing-friction", 0.05, 1.0, _rub, _of(0.03, 0.3, _swing)),
        unnamed=DAMPING,
        also="stribeck-friction presliding-friction vortex-shedding",
    ),
    _book(
        *("cable-hysteresis", 1e-3, 0.05, _one, _of(0.2, 0.8, _swing)),
        unnamed=DAMPING,
        also="presliding-friction complex-modulus",
    ),
    _book(
        *("elastic-string", 0.3, 1.0, _one, _beside(2.2, 4.5, 0.005)),
        unnamed=RESTORING,
        also="cubic-stiffness",
    ),
    _book(
        *("sloshing-bob", 1e-3, 0.05, _one, _beside(1.06, 1.6, 0.01)),
        unnamed=RESTORING,
        also="second-mode plane-coupling release-transient",
    ),
    _book(
        *("slipping-arm", 3e-3, 0.2, lambda s: s.torque, _of(0.4, 0.75, _swing)),
        unnamed=DRIVE,
        also="vortex-shedding",
    ),
    _book(
        *("cogging", 1e-3, 0.05, lambda s: s.torque),
        lambda rng, s: (rng.uniform(4, 12) * np.pi / (2 * s.amplitude), 1.0),
        unnamed=RESTORING,
    ),
    _book("vibrated-pivot", 0.01, 0.3, _one, _none, unnamed=RESTORING, also="cubic-stiffness"),
    _book("squeeze-film", 0.1, 1.0, _loss, _of(1.1, 1.6, _swing), unnamed=DAMPING),
    _moved(
        *("rough-spot", "rough spot off centre", 0.1, 3.0),
        lambda r, s: (
            *("rough", _rub(s)),
            {
                "rough_place": s.amplitude * float(r.choice([-1, 1]) * r.uniform(0.25, 0.7)),
                "rough_width": s.amplitude * r.uniform(0.03, 0.12),
            },
        ),
        unnamed=DAMPING,
    ),
    _moved(
        *("pulsed-damping", "damping periodic in time", 0.1, 0.9),
        lambda r, s: (
            *("pulsed", 2 * _loss(s)),
            {
                "pulsed_omega": 2 * np.pi / (s.duration_s * r.uniform(0.08, 0.3)),
                "pulsed_phase": _phase(r),
            },
        ),
        unnamed=DAMPING,
    ),
    _moved(
        *("kinked-damping", "kink of 1/Q", 0.3, 6.0),
        lambda r, s: (
            *("kink", 2 * _loss(s) / s.amplitude),
            {"kink_amplitude": s.amplitude * r.uniform(0.5, 0.8)},
        ),
        unnamed=DAMPING,
    ),
    _read("rippled-gain", "log-periodic gain", 1e-3, 0.1, _ripple, unnamed=READING),
    _read("swing-delay", "delay that grows", -1e-3, 0.1, _swing_delay, unnamed=READING),
    _read("subdivision", "error within a line", 1e-3, 0.02, _subdivision, unnamed=READING),
    _clock(
        *("interleave", "every second reading late", 1e-3, 0.05),
        lambda r, s: lambda t: (np.round(t / s.tick_s) % 2) / s.omega,
        unnamed=READING,
        also="tone-pickup",
    ),
    _clock("packet-times", "packets", 1e-3, 0.05, _packets, unnamed=READING, also="jitter"),
    # In the contract's list, and not built.
    _read(
        *("sensor-dead-band", "dead band", 1e-3, 0.1),
        lambda r, s: (
            lambda seen, y, size: (
                y - np.clip(seen.x, -size * s.amplitude / 2, size * s.amplitude / 2)
            )
        ),
        unnamed=READING,
        also="sensor-dead-band",
    ),
    _read(
        *("differential-nonlinearity", "widths", 1.0, 1.0, _widths),
        unnamed=READING,
        also="differential-nonlinearity",
    ),
    _read("slow-pen", "slow pen", 0.05, 0.5, _pen, unnamed=READING, also="clipping"),
    _law(
        *("second-plane-squared", "the other plane squared", 0.02, 0.4, _squared_plane),
        unnamed=READING,
        also="plane-coupling",
    ),
)


def _by_effect(laws: tuple[Law, ...]) -> dict[str, list[Law]]:
    return {law.effect: [each for each in laws if each.effect == law.effect] for law in laws}


CATALOGUE: Final = _by_effect((*MOTIONS, *READINGS))
OUTSIDE: Final = _by_effect(_OUTSIDE)
MEASUREMENT: Final = frozenset(law.effect for law in READINGS) - {"second-mode"}
"""Effects that change the reading and not the motion."""
ONLY_VISCOUS: Final = frozenset({"coulomb-friction", "quadratic-drag"})
"""Inside the eq8 baseline: hidden only from the viscous one."""


def kind_of(effect: str) -> str:
    """``dynamics``, ``measurement`` or ``unnamed``."""
    if effect.startswith("unnamed-"):
        return "unnamed"
    return "measurement" if effect in MEASUREMENT else "dynamics"
