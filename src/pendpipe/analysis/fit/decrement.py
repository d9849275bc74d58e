"""Whether a fitted law loses what the decay loses.

A law may follow the readings badly and still be printed with small errors. So its loss is
compared with the decrement of the turning points, which needs no model, at the largest, a
middle and the smallest amplitude that was analysed.
"""

import math
from functools import lru_cache
from typing import Final, Literal, NamedTuple

import numpy as np

from pendpipe.analysis.turning_points import TurningPoints
from pendpipe.arrays import FloatArray, of_neighbours
from pendpipe.dynamics import Eq8, Release, turning_points, turning_points_with_jacobian
from pendpipe.levels import REFUTED, deviations
from pendpipe.quantities import compact, with_error

Light = Literal["green", "amber", "red"]
TOLERANCE: Final = 0.05
"""Part of the decrement by which a law may miss it whatever the errors are."""
CONFIRMED: Final = 0.10
"""A decrement known worse than this confirms nothing."""
_CERTAIN: Final = deviations(12, REFUTED)
"""Standard deviations, 3.9, from which a difference contradicts: three such questions are asked
among the dozen that share one level."""
_FEWEST: Final = 5
"""Turning points of a window: a parabola, the level's error, and one to judge the scatter."""
SIDES: Final = 4
"""Turning points, two of each side, of which the level's error is told apart."""
_FALL: Final = 0.4
"""Of ln amplitude in a window; beyond, a parabola does not follow Coulomb's straight line."""
_OF_A_CYCLE: Final = 3
"""Turning points, its beginning and its end among them."""
_STEEP: Final = 0.5
"""The same over the fewest turning points: of Coulomb's straight line they show 2 % too little, and
ever less nearer to the stop."""
CLEAR: Final = 8.0
"""Standard deviations that a turning point must stand out."""
_MISSED: Final = 1e-6
"""Part of an amplitude by which the cycle about it may miss it."""
_STEPS: Final = 4.0
"""Steps of the readings within which rounding moves all turning points alike."""


class Check(NamedTuple):
    """What the turning points about one amplitude show without a law, and what the law has.

    The relative loss -d ln y/dt in 1/s, the law's averaged over a cycle of its own motion; or the
    period of small swings in s (`consequence`).
    """

    amplitude_rad: float
    fitted: float
    seen: float
    seen_sd: float
    scatter: float = 1.0
    """Variance of the turning points about a smooth decay, or a steady period, over their own."""
    overruled: str = ""
    """Why a contradiction is no reason to doubt the law, where there is one."""

    @property
    def excess(self) -> float:
        """By what part of what is seen the law has more."""
        return (self.fitted - self.seen) / abs(self.seen) if self.seen else math.inf

    def misses(self, deviations: float) -> bool:
        """Whether they differ by more than 5 %, and by more than so many standard deviations."""
        off = abs(self.fitted - self.seen)
        return not off <= max(TOLERANCE * abs(self.seen), deviations * self.seen_sd)

    @property
    def contradicts(self) -> bool:
        """Whether they differ by more than 5 % and by more than chance explains, and it counts."""
        return not self.overruled and self.misses(_CERTAIN)

    @property
    def p_value(self) -> float:
        """How often chance alone makes them differ so; 1 within 5 %."""
        if not self.misses(0.0):
            return 1.0
        off = abs(self.fitted - self.seen)
        return math.erfc(off / self.seen_sd * math.sqrt(0.5)) if self.seen_sd > 0.0 else 0.0

    @property
    def confirms(self) -> bool:
        """Whether they agree, and so closely that this says something."""
        return not self.misses(_CERTAIN) and self.seen_sd <= CONFIRMED * abs(self.seen)

    def sentence(self, unit: str, of: str = "turning points") -> str:
        """Say it in a clause."""
        return (
            f"at {compact(self.amplitude_rad, unit)} it loses {self.fitted:.3g} s⁻¹, the {of}"
            f" show {with_error(self.seen, self.seen_sd, '1/s', short=True)}"
            f" ({100.0 * self.excess:+.0f} %)"
        )


def standing_out(points: TurningPoints) -> TurningPoints:
    """The turning points that stand out of their errors, and of the step of the readings."""
    least = np.maximum(CLEAR * points.angle_sd_rad, _STEPS * points.step_rad)
    return points.chosen(points.amplitude_rad > least)


def check_decrement(points: TurningPoints, law: Eq8) -> tuple[Check, ...]:
    """Compare a law's loss with the decrement at a large, a middle and a small amplitude.

    Parameters
    ----------
    points
        The turning points that were analysed.
    law
        What was fitted.

    Returns
    -------
    tuple of Check
        The large amplitude first; empty where there are too few turning points.
    """
    clear = standing_out(points)
    while (
        len(clear) > 3 * _FEWEST
        and math.log(clear.amplitude_rad[-_FEWEST] / clear.amplitude_rad[-1]) > _STEEP
    ):
        clear = clear.first(len(clear) - 1)
    if len(clear) < SIDES:
        return ()
    found = _seen(clear)
    part = clear
    while not found[-1][2] <= CONFIRMED * abs(found[-1][1]) and len(part) > 3 * _FEWEST:
        # The smallest amplitude at which the decrement is seen well.
        part = part.first(int(0.95 * len(part)))
        further = _seen(part)
        if further[-1][2] <= CONFIRMED * abs(further[-1][1]):
            found = further
    return tuple(
        Check(amplitude, loss_of(law, amplitude), loss, sd, scatter)
        for amplitude, loss, sd, scatter in found
    )


def _seen(points: TurningPoints) -> list[tuple[float, float, float, float]]:
    """The decrement about the large, the middle and the small amplitude; see `seen_loss`."""
    logs, count = np.log(points.amplitude_rad), len(points)
    index, found = np.arange(count), []
    middle = int(np.argmin(np.abs(logs - 0.5 * (logs[0] + logs[-1]))))
    for centre, reach in ((0, _FALL), (middle, 0.5 * _FALL), (count - 1, _FALL)):
        # A third of them at most, from the centre on until the amplitude has fallen or risen.
        order = np.argsort(np.abs(index - centre), kind="stable")[: max(_FEWEST, -(-count // 3))]
        beyond = np.abs(logs[order] - logs[centre]) > reach
        beyond[:_FEWEST] = False
        window = order[np.cumsum(beyond) == 0]
        found.append(seen_loss(points, slice(window.min(), window.max() + 1)))
    return found


def seen_loss(
    points: TurningPoints, part: slice = slice(None)
) -> tuple[float, float, float, float]:
    """Relative loss of amplitude of a part of some turning points, neighbours all.

    A parabola in time is fitted to ln y, beside an error of the level, which raises the
    amplitudes of one side and lowers those of the other.

    Returns
    -------
    amplitude, loss, sd, scatter
        In the middle of the window: y in rad, -d ln y/dt in 1/s, and its standard deviation from
        the scatter about the parabola (neighbours may scatter alike) and not below the turning
        points' own.
    """
    amplitude, side, time_s = points.amplitude_rad[part], points.side[part], points.time_s[part]
    centre, span = float(np.mean(time_s)), float(np.ptp(time_s))
    z = (time_s - centre) / span
    columns = [np.ones_like(z), z]
    if len(z) > SIDES and np.ptp(side):
        columns.append(side * float(np.mean(amplitude)) / amplitude)
    if len(z) > SIDES + 1:
        columns.append(z**2)
    weight = amplitude / points.angle_sd_rad[part]
    design = np.stack(columns, axis=1) * weight[:, None]
    scale = np.linalg.norm(design, axis=0)
    design, logs = design / scale, weight * np.log(amplitude)
    inverse = np.linalg.inv(design.T @ design)
    sizes = inverse @ (design.T @ logs)
    values, residual = sizes / scale, logs - design @ sizes
    freedom = len(z) - len(columns)
    variance, scatter = float(inverse[1, 1]) / scale[1] ** 2, 1.0
    if freedom > 0:
        square = float(residual @ residual)
        scatter = max(1.0, square / freedom * of_neighbours(residual, 0.8))
    sd = math.sqrt(variance * scatter) / span
    return math.exp(values[0]), -float(values[1]) / span, sd, scatter


def loss_of(law: Eq8, amplitude: float) -> float:
    """Relative loss of a law, 1/s, averaged over the cycle in whose middle y is `amplitude`."""
    cycle = _cycle(law, amplitude)
    return losses_of(law, amplitude)[0] if cycle is None else cycle[1]


@lru_cache(maxsize=16)
def losses_of(law: Eq8, amplitude: float) -> tuple[float, FloatArray]:
    """The same, and the parts of it that a, b and c take, shape (3,).

    A part is what the cycle would keep without it, to first order.
    """
    b = law.hysteretic + law.viscous
    cycle, slow = (
        _cycle(law, amplitude),
        np.array([law.quadratic * amplitude, b, law.coulomb / amplitude]),
    )
    if cycle is None:
        # Eq. 13.
        return float(slow.sum()), slow
    start, loss = cycle
    turning, _, by_angle = turning_points_with_jacobian(law, Release(0.0, start), 3)
    parts = -np.array(law.rates()) * by_angle[2, :4] / float(turning.angle_rad[2])
    parts = np.array([parts[0], parts[1] + parts[2], parts[3]])
    total = float(parts.sum())
    return loss, loss / total * parts if total > 0.0 else slow


@lru_cache(maxsize=16)
def _cycle(law: Eq8, amplitude: float) -> tuple[float, float] | None:
    """Where a cycle with `amplitude` in its middle starts, and its loss; None where none is."""
    # By Eq. 13, half a period before.
    half, loss = math.pi / law.angular_frequency, law.hysteretic + law.viscous
    loss += law.quadratic * amplitude
    start = amplitude * math.exp(min(half * loss, 1.0)) + half * law.coulomb
    for _ in range(4):
        try:
            cycle = turning_points(law, Release(0.0, start), count=_OF_A_CYCLE)
        except ValueError:
            # Overdamped.
            return None
        if len(cycle.time_s) < _OF_A_CYCLE or not cycle.angle_rad[2] > 0.0:
            # It stops within the cycle.
            return None
        found = start, math.log(start / float(cycle.angle_rad[2])) / float(cycle.time_s[2])
        # Friction that does not depend on the speed takes the same from any start: one step.
        missed = amplitude - abs(float(cycle.angle_rad[1]))
        if abs(missed) < _MISSED * amplitude:
            break
        start += missed
        if not start > 0.0:
            return None
    return found
