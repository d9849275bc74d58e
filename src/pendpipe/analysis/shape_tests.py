"""How well a decay's shape is told: Eq. 14 beside a pure exponential, and the trap of tails."""

from dataclasses import dataclass

import numpy as np

from pendpipe.analysis.fit.by_points import fit_envelope, fit_points
from pendpipe.analysis.turning_points import TurningPoints
from pendpipe.arrays import BoolArray
from pendpipe.errors import InputError
from pendpipe.estimate import Estimate

FEWEST_IN_A_TAIL = 8


@dataclass(frozen=True)
class Misfit:
    """What two laws leave of the amplitudes, rms in rad (m)."""

    amplitude_rms_rad: float
    """By Eq. 14: a, b and c together."""
    linear_damping_rms_rad: float
    """By an exponential: b alone, the textbook's linear damping."""
    half_cycles: int


@dataclass(frozen=True)
class Tail:
    """a, b, c from the part of a record after `start_s`."""

    start_s: float
    amplitude_rad: float
    a: Estimate
    b: Estimate
    c: Estimate


def amplitude_misfit(points: TurningPoints) -> Misfit:
    """Fit the amplitudes with and without a and c; the same points, the same weights."""

    def left_by(held: dict[str, float]) -> float:
        return float(np.sqrt(np.mean(fit_envelope(points, held).residual ** 2)))

    return Misfit(left_by({}), left_by({"a": 0.0, "c": 0.0}), len(points))


def tail_fits(points: TurningPoints, count: int = 12) -> list[Tail]:
    """Fit ever later parts of a record: the first is the whole of it.

    The starts are even in the logarithm of the amplitude; the last tail keeps eight
    turning points. A fit to the tail alone depends on where it begins, which the paper
    warns of: its a is hardly told, and what it takes from a it gives to b and c.
    """
    amplitude = np.abs(points.angle_rad)
    last = len(points) - FEWEST_IN_A_TAIL
    if last < 1:
        return []
    levels = np.geomspace(amplitude[0], max(amplitude[last], 1e-3 * amplitude[0]), count)
    place = np.arange(len(points))
    starts = np.unique(np.searchsorted(-amplitude[: last + 1], -levels))
    return [tail for start in starts if (tail := _tail(points, place >= start))]


def _tail(points: TurningPoints, kept: BoolArray) -> Tail | None:
    part = points.chosen(kept)
    try:
        found = fit_points(part).parameters
    except InputError:
        return None  # too little is left of it
    return Tail(
        start_s=float(part.time_s[0] - points.time_s[0]),
        amplitude_rad=float(abs(part.angle_rad[0])),
        a=found["a"],
        b=found["b"],
        c=found["c"],
    )
