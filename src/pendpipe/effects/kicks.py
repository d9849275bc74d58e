"""A kick that is repeated: how it is found in readings, and what a smooth one leaves of it.

A change of velocity at t_k adds -i (dv/omega) e^(-i omega t_k) to the slow complex amplitude z of
x = Re[z e^(i omega t)], so that F(t) = Re[i e^(i omega t) dz] is dv/omega wherever the kick comes.
Its mean over instants that lie a period apart is largest at the kick's.
"""

import math
from typing import Final, NamedTuple

import numpy as np

from pendpipe.arrays import FloatArray
from pendpipe.effects.two_modes import slow_amplitude

_WIDTH: Final = 0.35
"""Standard deviation of a smooth kick, rad of the motion's phase: eight of them take no half cycle,
and 30 nodes of it carry each to 1e-5."""
_PHASES: Final = 8
"""Instants in a cycle that are tried: to a 16th, where F has lost 8 %."""
_SHORTEST: Final = 4.0
"""Cycles from one kick to the next at least: three windows show it, and one does not."""
_QUIET: Final = 0.2
"""Part of the largest tenth below which that quarter lies: 0.38 of a wave, 0.35 of noise."""
_FEWEST: Final = 4
"""Kicks at least: two instants and a size are fitted, and one is told."""
_AROUND: Final = 15
"""Cycles whose median is the usual change: of four from kick to kick, two have none of it."""
_MOST: Final = 600
"""Cycles that are searched, the first ones: 20,000 periods are tried on them."""
_CLEAR: Final = 5.5
"""Largest mean over its standard deviation: 1e6 periods and instants give 5.2 by chance, and a comb
about (kicks cycles_between)^(1/2), since its own kicks are the scatter."""


class Found(NamedTuple):
    """A comb of kicks in readings, and the motion without it."""

    kick: float
    """rad/s."""
    period_s: float
    first_s: float
    """The first kick after the first reading."""
    omega: float
    """Of small swings, rad/s."""
    loss: float
    """Of the amplitude, 1/s."""
    amplitude: float
    phase_rad: float
    """Both at the first reading."""


def repeated_kick(
    time_s: FloatArray, values: FloatArray, omega: float, *, sine: bool
) -> Found | None:
    """Find kicks a period apart; None where nothing stands out, or readings are too few.

    Parameters
    ----------
    time_s, values
        The readings about the rest position, rad, shape (n,).
    omega
        About that of the motion, rad/s.
    sine
        Whether the torque is that of a pendulum, which swings the slower the wider.
    """
    time, cycle = time_s - time_s[0], 2.0 * math.pi / omega
    edges = np.searchsorted(time, np.arange(0.0, time[-1], cycle)[:_MOST])
    slow = slow_amplitude(omega * time, values, edges.tolist())
    if len(slow) < 2 * _AROUND or not np.all(np.abs(slow) > 0.0):
        return None
    steps = slow[1:] / slow[:-1]
    grown, turned = np.log(np.abs(steps)), np.angle(steps)
    usual = _median(grown) + 1j * _median(turned)
    jumps = slow[1:] - slow[:-1] * np.exp(usual)
    found = _comb(jumps[1:] + jumps[:-1], omega, cycle)
    if found is None:
        return None
    size, period, first = found
    square = np.abs(slow[:-1]) ** 2
    quicker = float(np.median(usual.imag / cycle + (omega * square / 16.0 if sine else 0.0)))
    own = slow[0] * np.exp(-0.5 * usual[0])
    return Found(
        size * omega,
        period,
        float(time_s[0]) + first % period,
        omega + quicker,
        -float(np.median(usual.real)) / cycle,
        float(abs(own)),
        float(np.angle(own)),
    )


def _median(steps: FloatArray) -> FloatArray:
    """The running median; at the ends that of the first and the last."""
    rows = np.lib.stride_tricks.sliding_window_view(steps, _AROUND)
    return np.pad(np.median(rows, axis=1), _AROUND // 2, mode="edge")


def _comb(jumps: FloatArray, omega: float, cycle: float) -> tuple[float, float, float] | None:
    """Return dv/omega, the period and the first instant of the clearest comb.

    `jumps` are those of z over each cycle but the first, its neighbours' halves included.
    """
    quiet, loud = np.quantile(np.abs(jumps), (0.25, 0.9))
    if quiet > _QUIET * loud:
        return None
    step = cycle / _PHASES
    time = cycle + step * (np.arange(_PHASES * len(jumps)) + 0.5)
    force = (1j * np.exp(1j * omega * time) * np.repeat(jumps, _PHASES)).real
    spread = math.sqrt(float(np.mean(force**2)))
    best, lasts = (_CLEAR * spread, 0.0, 0.0, 0.0), float(len(jumps))
    cycles = _SHORTEST
    while cycles <= lasts / _FEWEST:
        period = cycles * cycle
        bins = ((time % period) / step).astype(int)
        number = np.bincount(bins)
        mean = np.bincount(bins, force) / np.maximum(number, 1)
        height = np.abs(mean) * np.sqrt(number)
        at = int(np.argmax(height))
        if height[at] > best[0]:
            best = (float(height[at]), float(mean[at]), period, (at + 0.5) * step)
        # One instant apart at the end of the record.
        cycles += cycles / (_PHASES * lasts)
    return best[1:] if best[2] else None


def between_kicks(time_s: FloatArray, period_s: float, first_s: float) -> FloatArray:
    """Return the time since the nearest kick, negative before it."""
    half = 0.5 * period_s
    return np.asarray((time_s - first_s + half) % period_s - half)


def pulse(late_s: FloatArray, omega: float) -> FloatArray:
    """Return a smooth kick of size 1 that moves an oscillator as a sharp one does, 1/s."""
    phase = omega * late_s / _WIDTH
    height = math.exp(0.5 * _WIDTH**2) * omega / (_WIDTH * math.sqrt(2.0 * math.pi))
    return np.asarray(height * np.exp(-0.5 * phase * phase))


def corner(late_s: FloatArray, omega: float) -> FloatArray:
    """Return by how much the sharp kick's motion differs from the smooth one's about it, s."""
    from scipy.special import erfc

    phase = omega * np.abs(late_s)
    near = phase < 8.0 * _WIDTH
    found, own = np.zeros_like(phase), phase[near]
    turned = np.exp(-1j * own) * erfc((own - 1j * _WIDTH**2) / (_WIDTH * math.sqrt(2.0)))
    found[near] = -0.5 * turned.imag / omega
    return found
