"""Bounded Gauss-Newton for a handful of parameters: steps, the search, covariance and intervals.

scipy's optimisers cost more to import (0.7 s) than a thousand of these fits, and none of them
combines bounds, a prior and normal equations summed piece by piece.
"""

import math
from collections.abc import Callable, Sequence
from typing import Final, NamedTuple, Self

import numpy as np

from pendpipe.arrays import FloatArray

_SLACK: Final = 1e-9
"""Rounding error of the gradient."""


class Bounds(NamedTuple):
    """Least and greatest value of each entry, infinite where there is none; shape (n,) each."""

    lower: FloatArray
    upper: FloatArray

    def about(self, value: FloatArray) -> Self:
        """The bounds of a step from `value`."""
        return type(self)(self.lower - value, self.upper - value)

    def clip(self, value: FloatArray) -> FloatArray:
        """Put each entry within its bounds."""
        return np.clip(value, self.lower, self.upper)


def bounded_step(
    normal: FloatArray,
    gradient: FloatArray,
    bounds: Bounds,
    held: Sequence[int] = (),
) -> FloatArray:
    """Minimise ``d' H d/2 - g' d`` with some entries of d bounded.

    Parameters
    ----------
    normal, gradient
        H, shape (n, n), positive definite in what is free, and g, shape (n,).
    bounds
        Of d; zero is within them.
    held
        Entries that stay zero.
    """
    free, scaled, scale = _scaled(normal, held)
    step, right = np.zeros(len(gradient)), gradient[free] * scale
    step[free] = np.linalg.lstsq(scaled, right, rcond=1e-14)[0] * scale
    if bool(((step >= bounds.lower) & (step <= bounds.upper)).all()):
        return step
    # A hair for what the readings do not tell apart.
    squares, axes = np.linalg.eigh(scaled)
    root = np.sqrt(np.maximum(squares, 1e-13))
    within = Bounds(bounds.lower[free] / scale, bounds.upper[free] / scale)
    best = bounded_least_squares(root[:, None] * axes.T, axes.T @ right / root, *within)
    step[free] = best * scale
    return bounds.clip(step)


def bounded_least_squares(
    matrix: FloatArray, right: FloatArray, floor: FloatArray, ceiling: FloatArray
) -> FloatArray:
    """Minimise |matrix x - right| with floor <= x <= ceiling, by active sets.

    The values move from zero (which must be within the bounds) towards the free optimum. A value
    that meets a bound is held there, and released if that lowers the sum (Stark and Parker 1995).

    Parameters
    ----------
    matrix, right
        Shapes (m, n) and (m,).
    floor, ceiling
        Shape (n,); infinite for no bound.
    """
    x = np.clip(np.zeros(len(floor)), floor, ceiling)
    held = np.zeros(len(floor), dtype=bool)
    for _ in range(10 * len(floor) + 10):
        goal = x.copy()
        rest = right - matrix[:, held] @ x[held]
        goal[~held] = np.linalg.lstsq(matrix[:, ~held], rest, rcond=1e-11)[0]
        within = np.clip(goal, floor, ceiling)
        out = within != goal
        if out.any():
            share = np.full(len(x), np.inf)
            np.divide(within - x, goal - x, out=share, where=out)
            met = int(np.argmin(share))
            x = np.clip(x + max(float(share[met]), 0.0) * (goal - x), floor, ceiling)
            x[met], held[met] = within[met], True
            continue
        x, pull = goal, matrix.T @ (right - matrix @ goal)
        inwards = np.where(x <= floor, pull, -pull) * held
        released = int(np.argmax(inwards))
        if inwards[released] <= _SLACK * (1.0 + float(np.abs(right).max())):
            break
        held[released] = False
    return x


def covariance(normal: FloatArray, held: Sequence[int] = ()) -> FloatArray:
    """Invert the normal matrix; rows and columns of what is held are zero.

    A bound is not used: what it would take off the standard deviations depends on where
    the truth lies, so they are those of the free estimate.
    """
    free, scaled, scale = _scaled(normal, held)
    if not np.isfinite(scaled).all():
        # A search that got to where nothing moves has no errors, and does not count as settled.
        return np.full_like(normal, np.nan)
    result, own = np.zeros_like(normal), np.linalg.pinv(scaled, rcond=1e-14, hermitian=True)
    result[np.ix_(free, free)] = own * scale[:, None] * scale
    return result


def _scaled(normal: FloatArray, held: Sequence[int]) -> tuple[list[int], FloatArray, FloatArray]:
    """What is free, its normal matrix with a diagonal of ones, and the scale of each entry.

    Parameters differ by many orders of size.
    """
    free = [j for j in range(len(normal)) if j not in held]
    part = normal[np.ix_(free, free)]
    scale = 1.0 / np.sqrt(np.maximum(part.diagonal(), 1e-300))
    return free, part * scale[:, None] * scale, scale


FRACTIONS: Final = (1.0, 0.3, 0.1, 0.02)
"""Of a step: the first that lowers chi^2 is taken."""
AS_PROMISED: Final = 0.03
"""By which chi^2 behind a step may differ from what its derivatives promise, for the step to be the
last: what bends the model by e standard deviations makes it differ by about 2 e."""


_CLOSE: Final = 0.1
"""Of what a law is worse by than its rival."""


class Quadratic(NamedTuple):
    """chi^2 at a point, with minus half its gradient and its normal matrix."""

    chi2: float
    gradient: FloatArray
    normal: FloatArray


class Minimum(NamedTuple):
    """Where the search ended."""

    value: FloatArray
    quadratic: Quadratic
    converged: bool


def minimise(
    evaluate: Callable[[FloatArray], Quadratic],
    start: FloatArray,
    bounds: Bounds,
    *,
    held: Sequence[int] = (),
    tolerance: float = 1e-5,
    chi2: Callable[[FloatArray], float] | None = None,
    curved: Callable[[FloatArray, FloatArray], FloatArray] = np.add,
    bar: float = math.inf,
    most: int = 60,
) -> Minimum:
    """Minimise chi^2 by Gauss-Newton steps that respect bounds, shortened where they overshoot.

    Parameters
    ----------
    evaluate
        chi^2, gradient and normal matrix at a point; an infinite chi^2 refuses it.
    start, bounds
        Where to begin, shape (n,), and within what.
    held
        Entries that are not fitted.
    tolerance
        The search ends when the next step would lower chi^2 by less: 1e-5 is 0.003
        standard deviations. That step is still accepted, unverified.
    chi2
        chi^2 at a point, where that costs less than its derivatives: a step behind which it is as
        promised is the last.
    curved
        Where a step from a point ends, where more is known of the model than its derivatives.
    bar
        chi^2 of a rival: the farther above it, the less closely a minimum is looked for.
    most
        Greatest number of evaluations.
    """
    value = bounds.clip(start)
    now = evaluate(value)
    for _ in range(most):
        step = bounded_step(now.normal, now.gradient, bounds.about(value), held)
        promised = float(2.0 * now.gradient @ step - step @ now.normal @ step)
        trial = bounds.clip(curved(value, step))
        expected = moved(now, step)
        close = max(AS_PROMISED, _CLOSE * (expected.chi2 - bar))
        if promised < tolerance or (chi2 is not None and abs(chi2(trial) - expected.chi2) < close):
            return Minimum(trial, expected, True)
        ways = (bounds.clip(curved(value, part * step)) for part in FRACTIONS)
        tried = ((way, evaluate(way)) for way in ways)
        enough = now.chi2 + 0.1 * tolerance
        found = next((there for there in tried if there[1].chi2 <= enough), None)
        if found is None:
            return Minimum(value, now, False)
        settled = now.chi2 - found[1].chi2 < 1e-12 * now.chi2 and promised < 1e-6 * now.chi2
        value, now = found
        if settled:
            return Minimum(value, now, True)
    return Minimum(value, now, False)


def moved(quadratic: Quadratic, step: FloatArray) -> Quadratic:
    """The quadratic about a point a step further."""
    chi2 = quadratic.chi2 - 2.0 * quadratic.gradient @ step + step @ quadratic.normal @ step
    return Quadratic(float(chi2), quadratic.gradient - quadratic.normal @ step, quadratic.normal)


CHI2_95: Final = 3.841458820694124
"""95 % point of chi^2 with one degree of freedom."""
_FAR: Final = 8.0
"""Standard deviations from which a bound is out of sight."""
_CLOSE_TO: Final = 1e-10
_NEWTON: Final = 50
"""Steps to the end of an interval, at most."""


def intervals95(
    value: FloatArray,
    normal: FloatArray,
    gradient: FloatArray,
    bounds: Bounds,
    indices: Sequence[int],
    held: Sequence[int] = (),
    matrix: FloatArray | None = None,
) -> list[tuple[float, float]]:
    """Profile-likelihood intervals of some parameters, the others refitted within their bounds.

    Parameters
    ----------
    value
        The bounded optimum, shape (n,).
    normal, gradient
        Of chi^2/2 there; the gradient (-d chi^2/2) is not zero at a bound that is met.
    bounds
        Of the parameters.
    indices
        The parameters whose intervals are wanted.
    held
        Parameters that are not fitted.
    matrix
        The covariance, where it is known.

    Notes
    -----
    chi^2 is taken as quadratic. Where truth lies on a bound the interval covers it in at
    least 95 % of the cases (97.5 % with one bound), never less.
    """
    matrix = covariance(normal, held) if matrix is None else matrix
    deviations = np.sqrt(np.maximum(matrix.diagonal(), 0.0))
    pull = np.abs(gradient * deviations)
    fitted = [j for j in range(len(value)) if j not in held]
    at_rest = bool((pull if len(held) == 0 else pull[fitted]).max(initial=0.0) < 1e-2)
    half = math.sqrt(CHI2_95) * deviations
    room = bounds.about(value)
    if at_rest and bool(((room.lower <= -half) & (half <= room.upper)).all()):
        # None can come to a bound, since following another moves it by 1.96 of its own at most.
        return [(float(value[j] - half[j]), float(value[j] + half[j])) for j in indices]
    found = []
    for j in indices:
        ways = (-float(half[j]), float(half[j]))
        low, high = (_profiled_end(value, normal, gradient, room, j, held, way) for way in ways)
        found.append((low, high))
    return found


def _profiled_end(
    value: FloatArray,
    normal: FloatArray,
    gradient: FloatArray,
    room: Bounds,
    index: int,
    held: Sequence[int],
    half: float,
) -> float:
    """One end of an interval that a bound takes part in, `half` away without it.

    The others follow within their bounds. Chi^2 along the way is convex, and made of parabolas, so
    that Newton's steps come to where it has risen enough.
    """
    side = math.copysign(1.0, half)
    wall = float(room.upper[index] if side > 0.0 else -room.lower[index])
    most = min(_FAR / math.sqrt(CHI2_95) * abs(half), wall)
    if not most > 0.0:
        return float(value[index])
    end, moved = min(abs(half), most), np.zeros(len(value))
    for _ in range(_NEWTON):
        moved[index] = side * end
        step = moved + bounded_step(normal, gradient - normal @ moved, room, (*held, index))
        pull = normal @ step - gradient
        risen, slope = float(step @ (pull - gradient)), 2.0 * side * float(pull[index])
        before, end = end, most
        if slope > 0.0:
            end = min(max(before + (CHI2_95 - risen) / slope, 0.0), most)
        if abs(end - before) <= _CLOSE_TO * end:
            break
    return float(value[index] + side * end)
