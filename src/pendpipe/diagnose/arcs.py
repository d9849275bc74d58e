"""Where in the cycle an effect shows: one arc, or two that face each other."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from pendpipe.arrays import FloatArray

_BINS: Final = 24
_HALF: Final = _BINS // 2
_STEP: Final = 2.0 * math.pi / _BINS
_OPPOSITE: Final = 0.75
"""Part that two facing quarters of the cycle must hold to be named: a misfit of the phase
leaves there 1/2 + 1/pi = 0.82, a power that is the same everywhere 0.5."""


def powers_of_cycle(phase: FloatArray, power: FloatArray) -> FloatArray:
    """Add up a power over the cycle, in equal steps of the phase from 0 to 2 pi."""
    number = (np.mod(phase, 2.0 * math.pi) / _STEP).astype(int) % _BINS
    return np.asarray(np.bincount(number, weights=power, minlength=_BINS), dtype=np.float64)


def one_arc(powers: FloatArray, most: float) -> tuple[float, float] | None:
    """The shortest arc that holds the part `most`, where it is clearly shorter than the circle."""
    total = float(powers.sum())
    if not total > 0.0:
        return None
    for width in range(1, _HALF):
        sums = _arc_sums(powers, width)
        start = int(np.argmax(sums))
        if sums[start] > most * total:
            return start * _STEP, (start + width) * _STEP
    return None


def facing_arcs(powers: FloatArray) -> str:
    """Name two facing quarters of the cycle that hold three quarters of it; "" if none do.

    What shifts the phase shows at the crossings, what changes the amplitude at the turning
    points: twice a cycle, so that no single arc says it.
    """
    halves = powers[:_HALF] + powers[_HALF:]
    sums = _arc_sums(halves, _HALF // 2)
    start = int(np.argmax(sums))
    if not sums[start] > _OPPOSITE * float(halves.sum()):
        return ""
    # The middle of the arc to the nearest of eight phases: a bin to either side is no matter.
    centre = (start + _HALF // 4) % _HALF
    if abs(centre - _HALF // 2) <= 1:
        return "mostly at both crossings"
    if min(centre, _HALF - centre) <= 1:
        return "mostly at the turning points of both sides"
    first, last = start * _STEP, (start + _HALF // 2) * _STEP
    return f"mostly at phases from {first:.2f} to {last:.2f} rad of the cycle and half a cycle on"


def _arc_sums(powers: FloatArray, width: int) -> FloatArray:
    """Sum over `width` neighbours from each step on, around the circle."""
    return np.array([np.roll(powers, -start)[:width].sum() for start in range(len(powers))])
