"""The catalogue as signatures in the reading, whitened and without what the baseline absorbs.

An effect may have several shapes (exponents, moments, frequencies): each is a subspace of
one or two directions, and the effect's score is the largest of them.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np

from pendpipe.arrays import FloatArray, IntArray
from pendpipe.challenge.bench import Bench
from pendpipe.challenge.filters import play

BLOCKS: Final = 48
"""Moments at which steps are looked for, over the record."""
PHASES: Final = 8
"""Moments within the cycle at each of them."""


@dataclass(frozen=True)
class Shape:
    """One shape of one effect.

    Parameters
    ----------
    effect
        Identifier of the contract.
    columns
        Orthonormal whitened directions, baseline taken out, shape (kept, 1 or 2).
    parameter
        The motion's parameter that is its strength, where a refit can move it.
    details
        The motion's other parameters of this shape; those in `free` move in a refit.
    free
        Names of shape parameters that a refit may move.
    step
        Step of `parameter` for differences.
    """

    effect: str
    columns: FloatArray
    parameter: str = ""
    details: tuple[tuple[str, float], ...] = ()
    free: tuple[str, ...] = ()
    step: float = 0.0


def laws(bench: Bench) -> Iterator[tuple[str, str, float, dict[str, float], tuple[str, ...]]]:
    """Torques whose signature is integrated: effect, parameter, step, details, free shapes."""
    omega, span = bench.scenario.omega, bench.scenario.span_s
    a = float(np.hypot(bench.track.angle_rad[0], bench.track.rate_rad_s[0] / omega))
    top, cycle = omega * a, 2.0 * np.pi / omega
    rate = bench.sizes["gamma"]
    phase = bench.sizes["omega"]
    yield "circular-error", "sine", phase / a**2 * 16, {}, ()
    yield "cubic-stiffness", "cubic", phase / a**2 * 3, {}, ()
    yield "quadratic-stiffness", "square", 1e-4 / a, {}, ()
    if bench.scenario.baseline == "viscous":
        yield "coulomb-friction", "coulomb", bench.sizes["coulomb"], {}, ()
        yield "quadratic-drag", "quadratic", bench.sizes["quadratic"], {}, ()
    yield "drag-form", "drag", rate / top, {}, ()
    for n in (0.5, 1.5, 2.5):
        step = rate * top ** (1.0 - n)
        yield "power-law-damping", "power", step, {"power_exponent": n}, ("power_exponent",)
    for e in (0.25, 0.75):
        step = rate * top ** (1.0 - 2.0 * e)
        yield "power-law-damping", "energy", step, {"energy_exponent": e}, ("energy_exponent",)
    yield "cubic-damping", "rayleigh", rate / top**2, {}, ()
    yield "cubic-damping", "van_der_pol", rate / a**2, {}, ()
    for share in (0.08, 0.25):
        yield ("stribeck-friction", "stribeck", rate * top, {"stribeck_speed": share * top},
               ("stribeck_speed",))  # fmt: skip
    for share in (0.15, 0.5):
        yield ("presliding-friction", "dahl", 3 * rate / omega, {"dahl_reach": share * a},
               ("dahl_reach",))  # fmt: skip
    yield "history-force", "basset", rate / np.sqrt(omega), {}, ()
    for share in (0.45, 0.7):
        yield ("vortex-shedding", "shedding", rate * omega, {"shedding_amplitude": share * a},
               ("shedding_amplitude",))  # fmt: skip
    for tau in (0.0, span / 3.0):
        yield ("frequency-drift", "omega_drift", phase / span, {"omega_drift_time": tau},
               () if tau == 0.0 else ("omega_drift_time",))  # fmt: skip
        yield ("damping-drift", "gamma_drift", rate / span, {"gamma_drift_time": tau},
               () if tau == 0.0 else ("gamma_drift_time",))  # fmt: skip
    for cycles in (1.0, 2.5, 6.0):
        yield ("release-transient", "release", rate * span / cycle / 10,
               {"release_time": cycles * cycle}, ("release_time",))  # fmt: skip


def integrated(bench: Bench) -> Iterator[Shape]:
    """Signatures by central differences of trajectories."""
    base = bench.truth.motion
    time = bench.scenario.time_s
    for effect, name, step, details, free in laws(bench):
        held = base.value(name)
        up = base.changed(**{name: held + step}, **details).run(time).angle_rad
        down = base.changed(**{name: held - step}, **details).run(time).angle_rad
        column = bench.gain * (up - down)[bench.kept] / (2.0 * step)
        yield from _shape(bench, effect, column, name, details, free, step)
    step = 2e-4 * float(np.abs(bench.track.angle_rad).max())
    moved = base.changed(play=step).run(time).angle_rad - bench.track.angle_rad
    yield from _shape(bench, "backlash", bench.gain * moved[bench.kept] / step, "play")


def instrument(bench: Bench) -> Iterator[Shape]:
    """Signatures of the reading itself: they need no trajectory."""
    kept = bench.kept
    time = bench.scenario.time_s[kept]
    span = bench.scenario.span_s
    x, v = bench.track.angle_rad[kept], bench.track.rate_rad_s[kept]
    relaxing = {tau: -np.expm1(-time / tau) for tau in (span / 30, span / 10, span / 3)}
    yield from _shape(bench, "sensor-quadratic", x**2)
    yield from _shape(bench, "sensor-cubic", x**3)
    width = 2.0 * bench.scenario.sd_rad
    yield from _shape(bench, "sensor-backlash", play(x, width) - x)
    for effect in ("offset-drift", "equilibrium-creep", "ac-coupling"):
        yield from _shape(bench, effect, time)
        for slow in relaxing.values():
            yield from _shape(bench, effect, slow)
    yield from _shape(bench, "offset-drift", time**2)
    yield from _shape(bench, "equilibrium-creep", np.log1p(time / (span / 20)))
    yield from _shape(bench, "gain-drift", time * x)
    yield from _shape(bench, "gain-drift", relaxing[span / 3] * x)
    yield from _shape(bench, "clock-drift", time**2 * v)
    tau = span / 3
    yield from _shape(bench, "clock-drift", (time + tau * np.expm1(-time / tau)) * v)
    high, low = x.max(), x.min()
    for share in (0.01, 0.03, 0.08, 0.18, 0.35):
        upper = np.maximum(x - high * (1 - share), 0.0)
        lower = np.minimum(x - low * (1 - share), 0.0)
        for cut in (upper, lower, upper + lower):
            yield from _shape(bench, "clipping", -cut)


def beats(bench: Bench) -> Iterator[Shape]:
    """A second swing near the pendulum's own frequency, decaying as it does."""
    omega, time = bench.scenario.omega, bench.scenario.time_s[bench.kept]
    track = bench.track
    swing = np.hypot(track.angle_rad, track.rate_rad_s / omega)[bench.kept]
    for number in (*np.arange(0.5, 3.1, 0.5), 4.0, 5.0):
        for sign in (-1.0, 1.0):
            angle = (omega + sign * 2.0 * np.pi * number / bench.scenario.span_s) * time
            yield from _shape(
                bench,
                "plane-coupling",
                swing[:, None] * np.stack([np.cos(angle), np.sin(angle)], 1),
            )


def moments(bench: Bench) -> IntArray:
    """Indices of samples at which steps are looked for: blocks, and phases in each."""
    per_cycle = 2.0 * np.pi / bench.scenario.omega / bench.scenario.interval_s
    edge = max(3, int(0.02 * bench.count))
    blocks = np.linspace(edge, bench.count - edge - per_cycle, BLOCKS)
    found = (blocks[:, None] + per_cycle * np.arange(PHASES) / PHASES).astype(int)
    return np.asarray(np.clip(found, 1, bench.count - 5))


def steps(bench: Bench) -> Iterator[tuple[str, FloatArray]]:
    """Signatures of sudden changes, by the propagator: effect and columns (kept, moments)."""
    kept, at = bench.kept, moments(bench)
    motion = bench.propagator[kept]
    time = np.arange(bench.count)

    def after(places: IntArray, state: FloatArray, more: FloatArray | float) -> FloatArray:
        """H(t - t0)·(response to a change of state at t0, plus more)."""
        start = np.einsum("pij,pj->pi", bench.back[kept][places], state)
        response: FloatArray = motion[:, 0, :] @ start.T + more
        return np.asarray(bench.gain * np.where(time[:, None] >= places, response, 0.0))

    every, first = at.ravel(), at[:, 0]
    ones, zeros = np.ones(len(every)), np.zeros(len(every))
    yield "impulse", after(every, np.stack([zeros, ones], 1), 0.0)
    yield "equilibrium-step", after(every, np.stack([-ones, zeros], 1), 1.0)
    state = np.column_stack([bench.track.angle_rad, bench.track.rate_rad_s])[kept]
    yield "amplitude-step", after(first, state[first], 0.0)
    for effect, name in (("frequency-step", "omega"), ("damping-step", "gamma")):
        change = bench.state_change(name)[kept]
        yield effect, after(first, -change[first], change[:, :1])


def _shape(
    bench: Bench,
    effect: str,
    columns: FloatArray,
    parameter: str = "",
    details: dict[str, float] | None = None,
    free: tuple[str, ...] = (),
    step: float = 0.0,
) -> Iterator[Shape]:
    """Whiten, project, normalise; nothing where the baseline absorbs it."""
    columns = columns.reshape(bench.count, -1)
    white = bench.whiten(columns)
    if not np.isfinite(white).all():
        return
    left = bench.off(white)
    size = np.linalg.norm(left, axis=0)
    if (size <= 1e-7 * np.linalg.norm(white, axis=0)).any():
        return
    unit = left / size
    if unit.shape[1] == 2:
        unit = np.linalg.qr(unit)[0]
    pairs = tuple(sorted((details or {}).items()))
    yield Shape(effect, unit, parameter, pairs, free, step)
