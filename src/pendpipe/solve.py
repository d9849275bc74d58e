"""One least-squares solver: bounded, damped Gauss-Newton steps, covariance and profile intervals.

What is minimised is chi^2, a sum of squares of residuals r(p), those of priors among them. About a
point, with the Jacobian J = dr/dp, chi^2 is as good as ``|r + J d|^2``; its least value within the
bounds, and within a radius of trust, is the next step. A `Problem` says what chi^2 is at a point
(`Point`); `Squares` has residuals and their Jacobian, `Summed` normal equations that were added up
piece by piece, or those of a likelihood that is no sum of squares.

scipy's `least_squares` takes 0.8 s to import, as long as a thousand of these fits, and 3 ms for
five steps of five parameters. It needs the Jacobian of all readings in memory (10^8 have none), has
no normal equations, no last step unverified, none that follow a curve, and can't be interrupted and
resumed, as refits are that compete. So this is ours.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from typing import Final, Generic, NamedTuple, Self, TypeVar

import numpy as np

from pendpipe.arrays import FloatArray, IntArray, scaled_qr
from pendpipe.dynamics.kernel import Matrix, Stack, kernel
from pendpipe.priors import NO_PRIORS, Priors

_SLACK: Final = 1e-9
"""Rounding error of the gradient."""
_SAFE: Final = 1e-5
"""Least entry of a root's diagonal with which a system is solved as it is: it loses five digits of
sixteen, and half of them."""
_PRECISE: Final = 1e-11
"""Singular value over the largest from which a direction is seen."""
_HAIR: Final = 1e-13
"""Least square of a singular value of normal equations: their rounding error."""
_RADIUS_MET: Final = 0.01
"""Relative precision of the length of a damped step."""
_LEAST_DAMPING: Final = 1e-12
"""Of the damping of a step along the gradient: with it no length overflows."""
_LINEAR_WITHIN: Final = 0.02
"""Relative difference between the expected and the actual gain up to which the model counts as
linear."""
AS_PROMISED: Final = 0.03
"""By how much chi^2 behind a step may differ from what is promised for the step to be the last:
what bends the model by e standard deviations makes it differ by about 2 e."""
_SLOW: Final = 12.5
"""Tolerances: a search ends after three rounds that gain less."""
_FAR_OFF: Final = 50.0
"""Tolerances below which a step that gained less than one is the last."""
_LAST_STEPS: Final = 3
"""Last steps from which the gain of further ones is extrapolated."""
_TRIES: Final = 6
"""Lengths of one step that are tried: from a tenth each, six reach 1e-6 of it."""
_POOR: Final = 0.25  # as More (1978) has it
_GOOD: Final = 0.75
"""Parts of the expected gain below (above) which a step was too long (may be longer)."""
_SHORTER: Final = (0.1, 0.5)
"""Least and usual part of a step by which it is shortened, as More (1978) has them."""
_LONGER: Final = 2.0
"""Radius of the next step over the length of the last; with the two above as More (1978) has."""
_CLOSE: Final = 0.1
"""Of what a law is worse by than its rival."""
_ROUNDING: Final = 1e-12  # of 10^6 squares, each right to 1e-16, with room
_BY_ROUNDING: Final = 1e-6
"""Parts of chi^2 that are gained, and promised, by rounding errors alone."""
_TINY: Final = 1e-300
"""Of what is divided by."""


class Bounds(NamedTuple):
    """Least and greatest value of each entry, infinite where there is none; shape (n,) each."""

    lower: FloatArray
    upper: FloatArray

    @classmethod
    def none(cls, size: int) -> Self:
        """No bounds."""
        return cls(np.full(size, -np.inf), np.full(size, np.inf))

    def about(self, value: FloatArray) -> Self:
        """The bounds of a step from `value`."""
        return type(self)(self.lower - value, self.upper - value)

    def clip(self, value: FloatArray) -> FloatArray:
        """Put each entry within its bounds."""
        # Numpy's own clip takes three times as long for a few numbers.
        return np.minimum(np.maximum(value, self.lower), self.upper)


class Quadratic(NamedTuple):
    """chi^2 at a point, with minus half its gradient and its normal matrix."""

    chi2: float
    gradient: FloatArray
    normal: FloatArray


class Linear(NamedTuple):
    """Chi^2 about a point, of what is free: ``|triangle (scale d) - right|^2`` and a constant."""

    triangle: FloatArray
    """Shape (k, n), with columns of unit length."""
    scale: FloatArray
    """Of the columns, shape (n,)."""
    right: FloatArray
    """Shape (k,)."""
    free: IntArray
    """Indices of what is free among all values."""

    def measured(self, lengths: FloatArray) -> Self:
        """The same, with columns measured by other lengths, which are updated to the largest."""
        lengths[self.free] = longest = np.maximum(lengths[self.free], self.scale)
        return self._replace(triangle=self.triangle * (self.scale / longest), scale=longest)

    def pulled(self, gradient: FloatArray) -> Self:
        """The same with another gradient, g of `of_normal`, shape (n,)."""
        right = np.linalg.solve(self.triangle.T, gradient[self.free] / self.scale)
        return self._replace(right=np.asarray(right, dtype=np.float64))

    def falls(self, step: FloatArray) -> float:
        """By how much chi^2 falls along a step of all values."""
        change = self.triangle @ (self.scale * step[self.free])
        return float(2.0 * self.right @ change - change @ change)

    def step(self, room: Bounds, radius: float = math.inf) -> tuple[FloatArray, float]:
        """The best step within `room`, and its length, which is `radius` at most.

        The length is that of the changes that each value makes by itself in the residuals (More
        1978): values that compensate each other have long steps.
        """
        step = np.zeros(len(room.lower))
        floor, ceiling = room.lower[self.free] * self.scale, room.upper[self.free] * self.scale
        best, damping = self._damped(radius)
        if np.any(best < floor) or np.any(best > ceiling):
            best = self._within(floor, ceiling, radius, damping)
        # What met a bound ends there, to the last digit.
        inside = np.where(best >= ceiling, room.upper[self.free], best / self.scale)
        step[self.free] = np.where(best <= floor, room.lower[self.free], inside)
        return room.clip(step), float(np.linalg.norm(best))

    def _damped(self, radius: float) -> tuple[FloatArray, float]:
        """The best step of a length, and the damping that it takes."""
        rows, columns = self.triangle.shape
        if rows == columns and np.abs(self.triangle.diagonal()).min(initial=1.0) > _SAFE:
            best = np.asarray(np.linalg.solve(self.triangle, self.right), dtype=np.float64)
            if float(np.linalg.norm(best)) <= radius:
                return best, 0.0
        left, singular, turned = np.linalg.svd(self.triangle, full_matrices=False)
        seen = singular > _PRECISE * np.max(singular, initial=0.0)
        pull, squares = (singular * (left.T @ self.right))[seen], singular[seen] ** 2
        damping = damping_for(pull, squares, radius)
        return turned[seen].T @ (pull / (squares + damping)), damping

    def _within(
        self, floor: FloatArray, ceiling: FloatArray, radius: float, damping: float
    ) -> FloatArray:
        """The best step within bounds, of a length.

        What meets a bound no longer makes up for the others, whose steps may be longer then than
        without bounds: they take a damping of their own.
        """
        nothing = np.zeros(len(floor))
        while True:
            matrix, right = self.triangle, self.right
            if damping > 0.0:
                matrix = np.vstack([matrix, math.sqrt(damping) * np.eye(len(floor))])
                right = np.append(right, nothing)
            best = bounded_least_squares(matrix, right, floor, ceiling)
            if float(np.linalg.norm(best)) <= (1.0 + 2.0 * _RADIUS_MET) * radius:
                return best
            inside = (best > floor) & (best < ceiling)
            left = radius**2 - float(best[~inside] @ best[~inside])
            # What is held at its bounds is longer by itself: it has to come off them.
            more = _LONGER * max(damping, _LEAST_DAMPING)
            if left > 0.0:
                rest = self.right - self.triangle[:, ~inside] @ best[~inside]
                axes, singular, _ = np.linalg.svd(self.triangle[:, inside], full_matrices=False)
                seen = singular > _PRECISE * np.max(singular, initial=0.0)
                pull, squares = (singular * (axes.T @ rest))[seen], singular[seen] ** 2
                more = max(
                    damping_for(pull, squares, math.sqrt(left)), (1.0 + _RADIUS_MET) * damping
                )
            damping = more


def damping_for(pull: FloatArray, squares: FloatArray, radius: float) -> float:
    """The least damping with which a step ``pull/(squares + damping)`` is no longer than a radius.

    One over its length is concave in the damping, so that Newton's steps from zero come to it from
    below (Hebden 1973).
    """
    # Without a limit there is nothing to damp, and the length may overflow.
    damping = 0.0 if math.isinf(radius) else _LEAST_DAMPING * float(np.linalg.norm(pull)) / radius
    while not math.isinf(radius):
        step = pull / (squares + damping)
        length = float(np.linalg.norm(step))
        if length <= (1.0 + _RADIUS_MET) * radius:
            break
        steepness = float(np.sum((step / length) ** 2 / (squares + damping)))
        damping += (length / radius - 1.0) / steepness
    return damping


def of_normal(
    normal: FloatArray, gradient: FloatArray, free: IntArray | Sequence[int] | None = None
) -> Linear:
    """The linear problem of ``d' H d/2 - g' d`` in what is free of d, with a root of H."""
    chosen = np.arange(len(normal)) if free is None else np.asarray(free, dtype=np.int64)
    part, scale = _scaled(normal, chosen)
    root = _root(part)
    if root is None:
        # A hair for what the readings do not tell apart.
        squares, axes = np.linalg.eigh(part)
        root = np.sqrt(np.maximum(squares, _HAIR))[:, None] * axes.T
    return Linear(root, scale, np.zeros(0), chosen).pulled(gradient)


def _root(matrix: FloatArray) -> FloatArray | None:
    """The upper triangular root of a matrix whose columns are told apart; None of another."""
    with suppress(np.linalg.LinAlgError):
        root = np.asarray(np.linalg.cholesky(matrix).T)
        return root if root.diagonal().min(initial=1.0) >= _SAFE else None
    return None


def bounded_step(
    normal: FloatArray, gradient: FloatArray, bounds: Bounds, held: Sequence[int] = ()
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
    return of_normal(normal, gradient, _others(len(normal), held)).step(bounds)[0]


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
    rows, size = matrix.shape
    x, work = np.clip(np.zeros(size), floor, ceiling), np.empty((size + 4, rows + size))
    _active_set(np.ascontiguousarray(matrix.T), right, floor, ceiling, work, x)
    return x


@kernel()
def _active_set(
    columns: Matrix,
    right: FloatArray,
    floor: FloatArray,
    ceiling: FloatArray,
    work: Matrix,
    x: FloatArray,
) -> None:
    """Move x to where `bounded_least_squares` has it; `work` has shape (n + 4, m + n)."""
    size, rows = columns.shape[0], columns.shape[1]
    rest, goal, held, largest = work[size], work[size + 1], work[size + 2], 0.0
    for i in range(rows):
        largest = max(largest, abs(right[i]))
    for p in range(size):
        held[p] = 0.0
    for _ in range(10 * size + 10):
        _free_optimum(columns, right, x, held, work)
        share, met = np.inf, -1
        for p in range(size):
            within = min(max(goal[p], floor[p]), ceiling[p])
            if within != goal[p]:
                part = (within - x[p]) / (goal[p] - x[p])
                if part < share:
                    share, met = part, p
        for p in range(size):
            step = goal[p] - x[p]
            step *= 1.0 if met < 0 else max(share, 0.0)
            x[p] = min(max(x[p] + step, floor[p]), ceiling[p])
        if met >= 0:
            x[met], held[met] = min(max(goal[met], floor[met]), ceiling[met]), 1.0
            continue
        most, released = _SLACK * (1.0 + largest), -1
        for i in range(rows):
            rest[i] = right[i]
            for p in range(size):
                rest[i] -= columns[p, i] * x[p]
        for p in range(size):
            pull = 0.0
            for i in range(rows):
                pull += columns[p, i] * rest[i]
            pull = pull if x[p] <= floor[p] else -pull
            if held[p] != 0.0 and pull > most:
                most, released = pull, p
        if released < 0:
            return
        held[released] = 0.0


@kernel()
def _free_optimum(
    columns: Matrix, right: FloatArray, x: FloatArray, held: FloatArray, work: Matrix
) -> None:
    """Fill the row of `work` behind the next with the best x, some of it held, by reflections.

    A row of its own for each value, as long as what is not seen of it, keeps that at zero.
    """
    size, rows = columns.shape[0], columns.shape[1]
    rest, goal, diagonal = work[size], work[size + 1], work[size + 3]
    for i in range(rows + size):
        rest[i] = right[i] if i < rows else 0.0
    for p in range(size):
        square = 0.0
        for i in range(rows):
            work[p, i], square = columns[p, i], square + columns[p, i] * columns[p, i]
            rest[i] -= columns[p, i] * x[p] if held[p] != 0.0 else 0.0
        for i in range(size):
            own = _PRECISE * math.sqrt(square) if square > 0.0 else 1.0
            work[p, rows + i] = own if i == p else 0.0
    used = 0
    for p in range(size):
        if held[p] != 0.0:
            continue
        square = 0.0
        for i in range(used, rows + size):
            square += work[p, i] * work[p, i]
        diagonal[p] = -math.copysign(math.sqrt(square), work[p, used])
        work[p, used] -= diagonal[p]
        half = -diagonal[p] * work[p, used]
        for q in range(p + 1, size + 1):
            if q < size and held[q] != 0.0:
                continue
            along = 0.0
            for i in range(used, rows + size):
                along += work[p, i] * work[q, i]
            for i in range(used, rows + size):
                work[q, i] -= along / half * work[p, i]
        used += 1
    for p in range(size - 1, -1, -1):
        if held[p] != 0.0:
            goal[p] = x[p]
            continue
        used -= 1
        goal[p] = rest[used]
        for q in range(p + 1, size):
            goal[p] -= work[q, used] * goal[q] if held[q] == 0.0 else 0.0
        goal[p] /= diagonal[p]


@dataclass(frozen=True)
class Squares:
    """A sum of squares.

    Parameters
    ----------
    value
        Of the model, shape (n,).
    residual
        Data less model, and priors behind, each in standard deviations; shape (m,).
    """

    value: FloatArray
    residual: FloatArray

    @cached_property
    def chi2(self) -> float:
        """The sum."""
        return float(self.residual @ self.residual)

    @property
    def unit(self) -> float:
        """The chi^2 that counts as 1: more where it is a misfit beyond the noise."""
        return 1.0

    @cached_property
    def columns(self) -> FloatArray:
        """Derivatives of the model, shape (m, n)."""
        raise NotImplementedError

    @cached_property
    def factored(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """QR factors of the derivatives with columns of unit length, and their lengths."""
        if not np.all(np.isfinite(self.columns)):
            raise np.linalg.LinAlgError("derivatives are not finite")
        return scaled_qr(self.columns)

    def rest(self) -> None:
        """Forget the factors: they are as large as the derivatives, which a kept point needs."""
        vars(self).pop("factored", None)

    def linear(self, free: IntArray, at: Self | None = None) -> Linear:
        """About another point with the derivatives here; by default here."""
        basis, triangle, scale = self.factored
        right = basis.T @ (at or self).residual
        return Linear(triangle[:, free], scale[free], right, free)


@dataclass(frozen=True)
class Weighted(Squares):
    """A sum of squares whose derivatives a function has, shape (m, n)."""

    derivatives: Callable[[FloatArray], FloatArray]

    @cached_property
    def columns(self) -> FloatArray:
        """Of the model."""
        return self.derivatives(self.value)


@dataclass(frozen=True)
class Summed:
    """chi^2 whose derivatives are normal equations.

    Parameters
    ----------
    value, chi2
        Where, and what it is there.
    derivatives
        Has the normal equations where they are asked for.
    count
        Of the data; if chi^2 is more, so is the scatter by which a step counts.
    """

    value: FloatArray
    chi2: float
    derivatives: Callable[[FloatArray], Quadratic]
    count: float = math.inf

    @property
    def unit(self) -> float:
        """The scatter's variance, in units of what was expected, where that is less."""
        return max(1.0, self.chi2 / self.count)

    @cached_property
    def quadratic(self) -> Quadratic:
        """About the point."""
        return self.derivatives(self.value)

    def linear(self, free: IntArray) -> Linear:
        """About the point.

        Raises
        ------
        numpy.linalg.LinAlgError
            If a derivative is not finite.
        """
        _, gradient, normal = self.quadratic
        if not np.isfinite(normal).all():
            raise np.linalg.LinAlgError("derivatives are not finite")
        return of_normal(normal, gradient, free)


AnyPoint = TypeVar("AnyPoint", bound=Squares | Summed)


@dataclass(frozen=True)
class Problem(Generic[AnyPoint]):
    """What is minimised.

    Parameters
    ----------
    at
        The model at some values within the bounds; None where it has none.
    bounds
        Of the values.
    room
        Within what a step from some values stays; by default the bounds.
    moved
        Where a step from some values ends, where more is known of the model than its derivatives.
    places
        Values along which chi^2 has many minima, such as an instant: such a one stays where it is
        if a step overshoots, unless the gain is its own.
    """

    at: Callable[[FloatArray], AnyPoint | None]
    bounds: Bounds
    room: Callable[[FloatArray], Bounds] | None = None
    moved: Callable[[FloatArray, FloatArray], FloatArray] = np.add
    places: Sequence[int] | IntArray = ()


def squares(
    residual: Callable[[FloatArray], FloatArray],
    derivatives: Callable[[FloatArray], FloatArray],
    bounds: Bounds,
    priors: Priors = NO_PRIORS,
) -> Problem[Summed]:
    """The problem of a function that returns data less model, and one that has the derivatives.

    Parameters
    ----------
    residual
        Data less model in standard deviations, shape (m,), at some values.
    derivatives
        Of the model (not of the residuals), shape (m, n).
    bounds, priors
        Of the values.

    Examples
    --------
    >>> t, y = np.arange(4.0), np.array([2.0, 1.2, 0.75, 0.42])
    >>> law = lambda p: p[0] * np.exp(-p[1] * t)
    >>> by_p = lambda p: np.stack([law(p) / p[0], -t * law(p)], axis=1)
    >>> problem = squares(lambda p: y - law(p), by_p, Bounds(np.zeros(2), np.full(2, np.inf)))
    >>> minimise(problem, np.array([1.0, 1.0])).value.round(3)
    array([2.   , 0.506])
    """

    def at(value: FloatArray) -> Summed | None:
        rows = np.append(residual(value), priors.residual(value))

        def quadratic(value: FloatArray) -> Quadratic:
            columns = np.vstack([derivatives(value), priors.rows(len(value))])
            return Quadratic(chi2, columns.T @ rows, columns.T @ columns)

        chi2 = float(rows @ rows)
        return Summed(value, chi2, quadratic) if math.isfinite(chi2) else None

    return Problem(at, bounds)


class Minimum(NamedTuple, Generic[AnyPoint]):
    """Where a search ended."""

    point: AnyPoint
    converged: bool

    @property
    def value(self) -> FloatArray:
        """The values there."""
        return self.point.value

    @property
    def chi2(self) -> float:
        """The sum of squares there."""
        return self.point.chi2


class NoStartError(ArithmeticError):
    """The model has no value where a search should begin."""


def minimise(
    problem: Problem[AnyPoint],
    start: FloatArray,
    *,
    held: Iterable[int] = (),
    tolerance: float = 1e-5,
    trust: float = 0.0,
    useful: float = math.inf,
    rounds: int = 60,
) -> Minimum[AnyPoint]:
    """Search for the minimum from one start; parameters are those of `Search`.

    Raises
    ------
    NoStartError
        If the model has no value at the start.
    """
    search = Search(problem, start, held=held, tolerance=tolerance, trust=trust)
    with suppress(np.linalg.LinAlgError):
        search.go(rounds, useful)
    return Minimum(search.here, search.converged)


class Search(Generic[AnyPoint]):
    """A search for the minimum that can be interrupted and resumed.

    Each step is the best within the bounds and a radius of trust, which grows where chi^2 falls as
    the derivatives promise, and shrinks where it does not (More 1978).

    Parameters
    ----------
    problem
        What is minimised.
    start
        Where to begin, shape (n,).
    held
        Indices of values that are not fitted.
    tolerance
        Fall of chi^2 below which a step is the last: 1e-5 is 0.003 standard deviations.
    trust
        By how much chi^2 behind a step of its full length may differ from what is promised for it
        to be the last. Without it, the last step is one with the derivatives of the step before.
    little
        The search ends after two rounds that gain less, or three that gain less than 12.5
        tolerances.

    Raises
    ------
    NoStartError
        If the model has no value at the start.
    """

    def __init__(
        self,
        problem: Problem[AnyPoint],
        start: FloatArray,
        *,
        held: Iterable[int] = (),
        tolerance: float = 1e-5,
        trust: float = 0.0,
        little: float | None = None,
    ) -> None:
        self._problem, self._tolerance, self._trust = problem, tolerance, trust
        self._free = _others(len(start), held)
        self._still = self._free[~np.isin(self._free, problem.places)]
        here = problem.at(problem.bounds.clip(start))
        if here is None:
            raise NoStartError
        self.here = here
        self._gains: list[float] = []
        self._lengths = np.zeros(len(start))
        self._radius = math.inf
        little = tolerance if little is None else little
        self._stalled = ((2, little), (3, max(little, _SLOW * tolerance)))
        self._ended = self.converged = self.hopeless = False

    @property
    def free(self) -> IntArray:
        """Indices of what is fitted."""
        return self._free

    def go(self, rounds: int, useful: float = math.inf) -> None:
        """Run some rounds, or fewer if the search converges or becomes hopeless.

        Parameters
        ----------
        rounds
            How many.
        useful
            Largest chi^2 that is of any use: the search stops where the remaining rounds, gaining
            what the last ones did, would not reach it; and the farther above it, the less chi^2
            needs to be as promised (`trust`).
        """
        for left in range(rounds, 0, -1):
            self.hopeless = self._cannot_reach(useful, left)
            if self._ended or self.hopeless:
                break
            self._round(useful)
        if isinstance(self.here, Squares):
            self.here.rest()

    def _cannot_reach(self, useful: float, left: int) -> bool:
        last = self._gains[-_LAST_STEPS:]
        return len(last) == _LAST_STEPS and self.here.chi2 - left * sum(last) / _LAST_STEPS > useful

    def _from(self, here: AnyPoint, step: FloatArray) -> AnyPoint | None:
        """The model a step away, within the bounds; None where it has no value."""
        return self._problem.at(self._problem.bounds.clip(self._problem.moved(here.value, step)))

    def _room(self, here: AnyPoint) -> Bounds:
        room = self._problem.room
        return room(here.value) if room else self._problem.bounds.about(here.value)

    def _round(self, useful: float) -> None:
        """Go one step: the whole one if chi^2 falls by what it promises, else a shorter one."""
        here, free, tries = self.here, self._free, 0
        enough, room = self._tolerance * here.unit, self._room(here)
        while True:
            linear = here.linear(free).measured(self._lengths)
            step, length = linear.step(room, self._radius)
            expected, whole = linear.falls(step), length < self._radius
            there = self._from(here, step)
            if tries == 0 and len(self._still) < len(free):
                # Along a place chi^2 has many minima: it stays, unless the gain is its own.
                without = here.linear(self._still).measured(self._lengths)
                lost = there is None or there.chi2 > here.chi2
                if lost and without.falls(without.step(room, self._radius)[0]) > _POOR * expected:
                    tries, free = 1, self._still
                    continue
            there = self._corrected(there, free, expected)
            gained = here.chi2 - there.chi2 if there else -math.inf
            if gained < _POOR * expected:
                # Where the parabola through chi^2 here, its slope, and chi^2 there is least.
                least = expected / (2.0 * expected - gained) if expected > 0.0 else 0.0
                self._radius = min(max(least, _SHORTER[0]), _SHORTER[1]) * length
            elif gained > _GOOD * expected:
                self._radius = max(self._radius, _LONGER * length)
            if gained > -0.5 * self._tolerance:
                break
            tries += 1
            if tries > _TRIES or expected < enough:
                self._ended, self.converged = True, expected < 10.0 * enough
                return
        assert there is not None
        self.here = there
        self._gains.append(gained)
        rounding = gained <= _ROUNDING * here.chi2 and expected < _BY_ROUNDING * here.chi2
        settled = gained < enough and expected < _FAR_OFF * enough
        if expected < enough or settled or rounding:
            self._ended = self.converged = True
        elif tries == 0 and self._trust > 0.0:
            trust = max(self._trust * there.unit, _CLOSE * (there.chi2 - useful))
            self._ended = self.converged = whole and abs(expected - gained) < trust
        elif tries == 0 and abs(expected - gained) < _LINEAR_WITHIN * expected:
            self._settle(here)
        self._ended |= self._stalls()

    def _corrected(
        self, there: AnyPoint | None, free: IntArray, expected: float
    ) -> AnyPoint | None:
        """Step back to where chi^2 is what it should be, with the derivatives at the start.

        Two laws of friction that replace each other leave the motion unchanged to first order; to
        second order the frequency changes, which accumulates over the record. A correction no
        longer than what was not expected of the residuals leaves the exchange as it is.
        """
        here = self.here
        # Of normal equations no residuals are kept.
        while isinstance(here, Squares) and isinstance(there, Squares):
            missing = expected - (here.chi2 - there.chi2)
            if missing <= (1.0 - _POOR) * max(expected, 0.0):
                break
            step, _ = here.linear(free, there).step(self._room(there), math.sqrt(missing))
            nearer = self._from(there, step)
            if nearer is None or expected - (here.chi2 - nearer.chi2) > _POOR * missing:
                break
            there = nearer
        return there

    def _stalls(self) -> bool:
        """Whether steps no longer gain what is expected.

        A derivative is wrong there (that of an instant, say), the motion stops just beyond, or two
        values compensate each other.
        """
        return any(
            len(self._gains) >= rounds and max(self._gains[-rounds:]) < little * self.here.unit
            for rounds, little in self._stalled
        )

    def _settle(self, before: AnyPoint) -> None:
        """Take the last, negligible step with the derivatives of the step before.

        They are as good as new ones where the step before gained what was expected.
        """
        here, enough = self.here, self._tolerance * self.here.unit
        if not (isinstance(before, Squares) and isinstance(here, Squares)):
            return
        linear = before.linear(self._free, here)
        # The shape of an effect has no influence while its size is zero.
        if not np.all(np.any(linear.triangle, axis=0)):
            return
        step, _ = linear.step(self._room(here))
        if linear.falls(step) < enough:
            there = self._from(here, step)
            if there and there.chi2 < here.chi2 + 0.5 * self._tolerance:
                self.here = there
            self._ended = self.converged = True


def covariance(
    normal: FloatArray, held: Sequence[int] = (), beyond: FloatArray | None = None
) -> FloatArray:
    """Invert the normal matrix H; rows and columns of what is held are zero.

    What the gradient scatters by `beyond` the noise, B, adds ``H^-1 B H^-1``.

    A bound is not used: what it would take off the standard deviations depends on where
    the truth lies, so they are those of the free estimate.
    """
    free = _others(len(normal), held)
    scaled, scale = _scaled(normal, free)
    if not np.isfinite(scaled).all():
        # A search that got to where nothing moves has no errors, and does not count as settled.
        return np.full_like(normal, np.nan)
    result, clear = np.zeros_like(normal), _root(scaled) is not None
    own = np.linalg.inv(scaled) if clear else np.linalg.pinv(scaled, rcond=1e-14, hermitian=True)
    result[free[:, None], free] = own / scale[:, None] / scale
    return result if beyond is None else result + result @ beyond @ result


def _others(size: int, held: Iterable[int]) -> IntArray:
    """Indices of what is not held."""
    free = np.ones(size, dtype=bool)
    free[list(held)] = False
    return np.flatnonzero(free)


def _scaled(normal: FloatArray, free: IntArray) -> tuple[FloatArray, FloatArray]:
    """The normal matrix of what is free with a diagonal of ones, and the scale of each entry.

    Parameters differ by many orders of size.
    """
    part = normal if len(free) == len(normal) else normal[free[:, None], free]
    scale = np.sqrt(np.maximum(part.diagonal(), _TINY))
    return part / scale[:, None] / scale, scale


CHI2_95: Final = 3.841458820694124
"""95 % point of chi^2 with one degree of freedom."""


def intervals95(
    value: FloatArray,
    normal: FloatArray,
    gradient: FloatArray,
    bounds: Bounds,
    indices: Sequence[int],
    held: Sequence[int] = (),
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

    Notes
    -----
    chi^2 is taken as quadratic. Where truth lies on a bound the interval covers it in at
    least 95 % of the cases (97.5 % with one bound), never less.
    """
    ends = np.stack([value[list(indices)]] * 2, axis=1)
    if not np.isfinite(normal).all():
        # A search that got to where nothing moves tells nothing.
        return [(low, high) for low, high in ends.tolist()]
    # By its root, since rounding may have made the matrix indefinite.
    linear, room = of_normal(normal, gradient, _others(len(value), held)), bounds.about(value)
    free, scale, root = linear.free, linear.scale, linear.triangle
    part, pull = root.T @ root + _HAIR * np.eye(len(free)), gradient[free] / scale
    best, room = linear.step(room)[0][free] * scale, Bounds(*(each[free] * scale for each in room))
    wanted = np.array([place for place, j in enumerate(indices) if j not in held], dtype=np.int64)
    own = np.searchsorted(free, np.asarray(indices, dtype=np.int64)[wanted])
    found, size = np.empty((len(own), 2)), len(free)
    space = np.empty((1, size, size)), np.empty((5, size))
    _walk(part, pull, room.lower, room.upper, best, own, *space, found)
    # What met a bound ends there, to the last digit.
    ends[wanted] = value[free[own], None] + found / scale[own, None]
    met = found <= room.lower[own, None], found >= room.upper[own, None]
    for side, limit in enumerate(bounds):
        ends[wanted, side] = np.where(met[side][:, side], limit[free[own]], ends[wanted, side])
    return [(low, high) for low, high in ends.tolist()]


@kernel()
def _walk(
    normal: Matrix,
    gradient: FloatArray,
    lower: FloatArray,
    upper: FloatArray,
    best: FloatArray,
    wanted: IntArray,
    room: Stack,
    work: Matrix,
    ends: Matrix,
) -> None:
    """Fill in how far some values get to the ends of their intervals, from the optimum on.

    The others follow within their bounds, straight on from one corner to the next, at which a
    value meets its bound or comes off it. So chi^2 is a parabola between corners, and the end is
    the root of one: the first, where no bound is met. There is `room` for a matrix, shape
    (1, n, n), and for five vectors, (5, n).
    """
    size = best.size
    step, wall, way, change, pull = work[0], work[1], work[2], work[3], work[4]
    for end in range(2 * wanted.size):
        index, side, last = wanted[end // 2], 2.0 * (end % 2) - 1.0, 0.0
        for turn in range(10 * size + 10):
            for p in range(size if turn == 0 else 0):
                step[p] = best[p]
            missing, bend, slope = CHI2_95, 0.0, 0.0
            for p in range(size):
                pull[p] = gradient[p]
                for q in range(size):
                    pull[p] -= normal[p, q] * step[q]
                missing += step[p] * (pull[p] + gradient[p])
                if turn == 0:
                    # It is stuck at its upper bound (1), at its lower one (-1), or free (0).
                    stuck = 1.0 if step[p] >= upper[p] and pull[p] > 0.0 else 0.0
                    wall[p] = -1.0 if step[p] <= lower[p] and pull[p] < 0.0 else stuck
            # What is looked for goes on by itself.
            wall[index] = 2.0
            for p in range(size):
                for q in range(size):
                    loose = wall[p] == 0.0 and wall[q] == 0.0
                    room[0, p, q] = normal[p, q] if loose else 1.0 if p == q else 0.0
            invert(room)
            for p in range(size):
                way[p], change[p] = side if p == index else 0.0, 0.0
                for q in range(size if wall[p] == 0.0 else 0):
                    way[p] -= side * room[0, p, q] * (normal[q, index] if wall[q] == 0.0 else 0.0)
            for p in range(size):
                for q in range(size):
                    change[p] += normal[p, q] * way[q]
                bend, slope = bend + way[p] * change[p], slope + way[p] * pull[p]
            bend = max(bend, _HAIR)
            last = (slope + math.sqrt(slope * slope + bend * max(missing, 0.0))) / bend
            corner, met = np.inf, index
            for p in range(size):
                if way[p] != 0.0:
                    ahead = ((upper[p] if way[p] > 0.0 else lower[p]) - step[p]) / way[p]
                elif wall[p] * change[p] > 0.0:
                    ahead = pull[p] / change[p]
                else:
                    continue
                if ahead < corner:
                    corner, met = ahead, p
            if met == index or not max(corner, 0.0) < last:
                break
            # From there on it is stuck, or no longer.
            wall[met] = math.copysign(1.0, way[met]) if way[met] != 0.0 else 0.0
            for p in range(size):
                step[p] = min(max(step[p] + max(corner, 0.0) * way[p], lower[p]), upper[p])
        reached = step[index] + last * way[index]
        ends[end // 2, end % 2] = min(max(reached, lower[index]), upper[index])


@kernel()
def invert(matrices: Stack) -> None:
    """Invert positive definite matrices in their place, shape (k, size, size), by sweeps."""
    size = matrices.shape[1]
    for k in range(matrices.shape[0]):
        one = matrices[k]
        for p in range(size):
            pivot = one[p, p]
            one[p, p] = 1.0
            for r in range(size):
                one[p, r] /= pivot
            for q in range(size):
                if q != p:
                    factor = one[q, p]
                    one[q, p] = 0.0
                    for r in range(size):
                        one[q, r] -= factor * one[p, r]
