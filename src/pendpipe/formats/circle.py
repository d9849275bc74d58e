"""Positions x, y on a circle about a pivot: whether they are, about which, and the angle."""

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from pendpipe.analysis.half_cycles import periods
from pendpipe.arrays import FloatArray
from pendpipe.facts import Fact
from pendpipe.formats.lists import one_way
from pendpipe.formats.table import ABSURD, FEWEST, Column, swing_of
from pendpipe.physics.pendulum import STANDARD_GRAVITY_M_PER_S2


def on_a_circle(x: FloatArray, y: FloatArray, *, named: bool) -> bool:
    """Say whether x, y go to and fro on a circle about the origin, and hang above or below it.

    Pixels counted from an image's corner keep much the same distance from it as well: but
    there the distance follows x, and the vertical through the origin lies outside the swing.
    """
    good = np.isfinite(x) & np.isfinite(y)
    x, y, sides = x[good], np.abs(y[good]), np.sign(y[good])
    if len(x) < FEWEST or max(np.abs(x).max(), y.max()) > ABSURD:
        return False
    radius, angle = np.hypot(x, y), np.arctan2(x, y)
    if (
        not 0.0 < np.std(radius) <= min(0.08 * np.mean(radius), 0.3 * np.std(x))
        or abs(np.mean(sides)) <= 0.95
        or abs(np.median(angle)) > min(0.4, 0.5 * np.ptp(angle))
        or not swing_of(x).clear
    ):
        return False
    # On a circle y falls with x squared; two columns without names must show it.
    follows = float(np.corrcoef(x**2, y)[0, 1])  # NaN where either stands still
    shown = follows < -0.5 and np.std(radius) < 0.5 * np.std(y) and one_way(y) < 0.9
    return not follows >= 0.5 if named else bool(shown)


@dataclass(frozen=True)
class Seen:
    """Angles about the pivot, shape (n,), with the distance over its median, less 1."""

    angle_rad: FloatArray
    radius_excess: FloatArray
    fact: Fact


def seen_from_pivot(x: Column, y: Column, time_s: FloatArray) -> Seen:
    """Turn a position into an angle about the pivot: atan2(x, -y), 0 straight down.

    Positions that are not on a circle about (0, 0) are on one about the pivot. Where both fit
    nearly, and the other's centre fits better by an F test, the length of the pendulum that has
    this period under gravity decides; where that agrees with neither, the better circle is a guess.
    """
    left, up, seen = x.values, y.values, "the position seen from (0, 0)"
    pivot, guess = pivot_of(left, up), ""
    if pivot is None and (better := _better_circle(left, up)) is not None:
        period_s = float(np.median(periods(time_s, left)[0]))
        length_m = STANDARD_GRAVITY_M_PER_S2 * (period_s / (2.0 * np.pi)) ** 2
        arms = [float(np.nanmedian(np.hypot(left - a, up - b))) for a, b in ((0.0, 0.0), better)]
        agree = [any(abs(arm * f / length_m - 1.0) < 0.05 for f in _LENGTHS) for arm in arms]
        if not agree[0]:
            pivot = better
        if agree == [False, False]:
            guess = (
                f"the pivot is not (0, 0) but ({better[0]:.4g}, {better[1]:.4g}), about which"
                " the positions lie on a circle"
            )
    if pivot is not None:
        left, up = left - pivot[0], up - pivot[1]
        seen = f"about the centre of their circle, ({pivot[0]:.5g}, {pivot[1]:.5g})"
    down, sign = (-1.0, "-") if float(np.nanmedian(up)) < 0 else (1.0, "")
    note = f"angle = atan2({x.label}, {sign}{y.label}), {seen}"
    radius = np.hypot(left, up)
    excess = radius / np.nanmedian(radius) - 1.0
    where = "({:.5g}, {:.5g})".format(*((0.0, 0.0) if pivot is None else pivot))
    fact = Fact(
        "pivot", where, "guessed" if guess else "shown", f"{guess}; {note}" if guess else note
    )
    return Seen(np.arctan2(left, down * up), excess, fact)


_KNOWN: Final = 0.03
"""Of the radius, to which a centre is known: angles are then wrong by as much at most."""
_AWAY: Final = 0.1
"""Of the radius, by which a pivot lies off (0, 0): three of `_KNOWN`."""
_FEWEST: Final = 50
_BETTER: Final = 30.0
"""F of one or two parameters and 47 positions beyond three, which chance exceeds 2 times in 10^6,
or 4 in 10^9."""
_LENGTHS: Final = (1.0, 0.01, 1e-3, 0.0254)
"""Metres of the units in which positions are given."""


def _better_circle(x: FloatArray, y: FloatArray) -> FloatArray | None:
    """Find the centre of a circle that fits positions better than that about (0, 0), by an F test.

    The two further parameters lower the sum of squares by F > 30; the centre is known to 3 % of the
    radius, and further than a tenth of it from (0, 0).
    """
    fit = _circle_of(x, y)
    if fit is None or len(fit[1]) < _FEWEST or not on_a_circle(x, y, named=True):
        return None
    centre, arm, known = fit
    about, origin = (np.hypot(*points.T) for points in (arm, arm + centre))
    test = 0.5 * (float(np.var(origin) / np.var(about)) - 1.0) * (len(arm) - 3)
    far = math.hypot(*centre) > _AWAY * float(about.mean())
    return centre if known < _KNOWN and test > _BETTER and far else None


def pivot_of(x: FloatArray, y: FloatArray) -> FloatArray | None:
    """Find the pivot of positions on a circle that is clearly not about (0, 0).

    None where they lie on none, by an F test as well on a straight line, its centre is uncertain by
    3 % of its radius, or within a tenth of it of (0, 0), and where the swing is below a tenth of a
    radian.
    """
    if (fit := _circle_of(x, y)) is None:
        return None
    centre, arm, known = fit
    radius, (wide, high) = np.hypot(*arm.T), np.abs(arm.T)
    mean = float(radius.mean())
    hangs = high.min() > 0.05 * mean and wide.max() > 0.1 * mean
    away = math.hypot(*centre) / mean
    # The farther from (0, 0), the less the circle need show: a string that grows is no other pivot.
    shown = np.std(radius) < min(max(0.3, 1.5 * away), 0.5) * np.std(arm[:, 1])
    # Of a straight line circles of any size are about as good.
    straight = float(np.linalg.eigvalsh(np.cov(arm.T, bias=True))[0])
    clear = (straight / float(np.var(radius)) - 1.0) * (len(arm) - 3) > _BETTER
    return centre if known < _KNOWN and hangs and shown and clear and away > _AWAY else None


def _circle_of(x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray, float] | None:
    """Fit a circle: the centre from which positions have the least rms distance.

    It starts from x^2 + y^2 = 2 (a x + b y) + c, which alone is biased by noise, and leaves out
    positions far from it (a hand, a lost marker).

    Returns
    -------
    centre, arm, known
        The centre; the other positions from there, shape (n, 2); its sd over the radius.
    """
    good = np.isfinite(x) & np.isfinite(y)
    points = np.column_stack([x[good], y[good]])
    if len(points) < FEWEST or np.abs(points).max() > ABSURD:
        return None
    one, middle = np.ones((len(points), 1)), points.mean(axis=0)
    inverse = np.linalg.pinv(np.hstack([2.0 * (points - middle), one]))
    centre = (inverse @ np.sum((points - middle) ** 2, axis=1))[:2] + middle
    for _ in range(6):
        arm = points - centre
        radius = np.hypot(*arm.T)
        off = np.abs(radius - np.median(radius))
        # Exact positions are off by rounding alone, which leaves none of them out.
        far = max(6.0 * float(np.median(off)), 1e-9 * float(np.median(radius)))
        near = (off <= far) & (radius > 0.0)
        inverse = np.linalg.pinv(np.hstack([arm / radius[:, None], one])[near])
        centre = centre + (inverse @ radius[near])[:2]
    sd = float(np.std(radius[near])) * float(np.linalg.norm(inverse[:2]))
    return centre, arm[near], sd / float(radius[near].mean())
