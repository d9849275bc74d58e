"""Maximum likelihood of a model's values, from however far away."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np

from pendpipe.arrays import FloatArray
from pendpipe.diagnose.bounded import bounded_least_squares
from pendpipe.diagnose.data import Data
from pendpipe.diagnose.noise import Noise
from pendpipe.diagnose.unwrapped import unwrapped
from pendpipe.dynamics.any_law import NoMotionError
from pendpipe.effects.baseline import OMEGA, SHARE, B, C
from pendpipe.effects.derivatives import jacobian
from pendpipe.effects.evaluated import Evaluated
from pendpipe.effects.held_parts import share_by_b
from pendpipe.effects.model import Model

_ROUNDS: Final = 14
_SETTLED: Final = 0.02
"""Of chi^2: a step that promises less is the last."""
_PULL: Final = 3.0
"""Standard deviations beyond a bound from which it is the bound that is believed."""
_SHARE_SD: Final = 0.3
"""The hysteretic share of b is hardly seen in one record: any between 0 and 1 may be."""


@dataclass(frozen=True)
class Fit:
    """A model at its best values.

    Parameters
    ----------
    model, value
        The model, and its values.
    chi2
        Sum of squares of the whitened residual, with the share's prior.
    residual
        Whitened; one entry more than there are readings (the prior), shape (n + 1,).
    jacobian
        Of the whitened readings by all values, with the prior's row, shape (n + 1, size).
    at
        The model there.
    free
        Indices of the values that were fitted.
    converged
        Whether the last step was negligible.
    slip_rad
        The largest phase by which model and readings differ.
    spread
        Factor of all standard deviations, for what is left beyond the noise.
    """

    model: Model
    value: FloatArray
    chi2: float
    residual: FloatArray
    jacobian: FloatArray
    at: Evaluated
    free: tuple[int, ...]
    converged: bool
    slip_rad: float
    spread: float = 1.0

    def covariance(self) -> FloatArray:
        """Of all values; zero for those held, shape (size, size)."""
        matrix = np.zeros((len(self.value), len(self.value)))
        part = self.jacobian[:, self.free]
        scale = np.linalg.norm(part, axis=0)
        scale[scale == 0.0] = 1.0
        inverse = np.linalg.pinv(np.linalg.qr(part / scale, mode="r"), rcond=1e-12)
        matrix[np.ix_(self.free, self.free)] = inverse @ inverse.T / np.outer(scale, scale)
        return self.spread**2 * matrix


def pulled(fit: Fit) -> list[int]:
    """Indices of fitted values that are at a bound and would be far beyond it, if they could."""
    low, high = fit.model.bounds()
    found = []
    for index in fit.free:
        if low[index] < fit.value[index] < high[index]:
            continue
        column = fit.jacobian[:, index]
        length = float(np.linalg.norm(column))
        others = [k for k in fit.free if k != index and low[k] < fit.value[k] < high[k]]
        part = fit.jacobian[:, others]
        rest = column - part @ np.linalg.lstsq(part, column, rcond=1e-11)[0]
        alone = float(np.linalg.norm(rest))
        if alone > 1e-9 * length and abs(float(rest @ fit.residual)) > _PULL * alone:
            found.append(index)
    return found


def refine(
    model: Model, data: Data, noise: Noise, start: FloatArray, *, held: Iterable[int] = (),
    rounds: int = _ROUNDS,
) -> Fit:  # fmt: skip
    """Minimise chi^2 by Gauss and Newton, within the bounds.

    Where model and readings are out of phase by much, the residual is taken along the
    motion (amplitude and unwrapped phase, cycle by cycle), so that it stays linear.

    Raises
    ------
    NoMotionError
        If the model can't be evaluated at the start.
    """
    fixed = {*held, *model.held()}
    free = np.array([k for k in range(model.size) if k not in fixed])
    low, high = model.bounds()
    value = model.settled(np.clip(start, low, high))
    at = model.evaluate(value)
    residual, slip = _residual(data, noise, at, value)
    converged = False
    for _ in range(rounds):
        columns = _jacobian(model, noise, value, at)
        step = _step(columns, residual, free, value, low, high)
        promised = float(residual @ residual - np.sum((residual - columns @ step) ** 2))
        tried = _tried(model, data, noise, value, step, residual)
        if tried is None and C in free:
            # More friction would stop it before the last reading: the others go first.
            step = _step(columns, residual, free[free != C], value, low, high)
            tried = _tried(model, data, noise, value, step, residual)
        if tried is None:
            converged = promised < 10.0 * _SETTLED
            break
        gained = float(residual @ residual - tried.residual @ tried.residual)
        value, at, residual, slip = tried
        if promised < _SETTLED or (gained < _SETTLED and promised < 1.0):
            converged = True
            break
    columns = _jacobian(model, noise, value, at)
    return Fit(
        model, value, float(residual @ residual), residual, columns, at, tuple(free.tolist()),
        converged, slip,
    )  # fmt: skip


def misfit(model: Model, data: Data, noise: Noise, value: FloatArray) -> float:
    """Return chi^2 at values, nothing fitted.

    Raises
    ------
    NoMotionError
        If the model can't be evaluated there.
    """
    residual, _ = _residual(data, noise, model.evaluate(value), value)
    return float(residual @ residual)


class _Tried(NamedTuple):
    value: FloatArray
    at: Evaluated
    residual: FloatArray
    slip_rad: float


def _tried(
    model: Model, data: Data, noise: Noise, value: FloatArray, step: FloatArray,
    residual: FloatArray,
) -> _Tried | None:  # fmt: skip
    """Go along a step as far as it lowers chi^2; None where it does nowhere."""
    low, high = model.bounds()
    for shrink in (1.0, 0.3, 0.1, 0.02):
        trial = model.settled(np.clip(value + shrink * step, low, high))
        try:
            there = model.evaluate(trial)
        except NoMotionError:
            continue
        new, slip = _residual(data, noise, there, trial)
        if new @ new < residual @ residual + 0.5 * _SETTLED:
            return _Tried(trial, there, new, slip)
    return None


def _residual(
    data: Data, noise: Noise, at: Evaluated, value: FloatArray
) -> tuple[FloatArray, float]:
    """The whitened residual with the prior's entry, and the largest slip of the phase."""
    plain, slip = unwrapped(data, at)
    prior = (0.5 - value[SHARE]) / _SHARE_SD
    return np.append(noise.whiten(plain), prior), slip


def _jacobian(model: Model, noise: Noise, value: FloatArray, at: Evaluated) -> FloatArray:
    columns = np.empty((len(at.reading) + 1, model.size))
    columns[:-1] = noise.whiten(jacobian(model, value, at))
    columns[-1] = 0.0
    columns[-1, SHARE] = 1.0 / _SHARE_SD
    # Where one part of b is held, b moves the share.
    columns[:, B] += share_by_b(value, model.held_parts()) * columns[:, SHARE]
    return columns


def _step(
    jacobian: FloatArray, residual: FloatArray, free: FloatArray, value: FloatArray,
    low: FloatArray, high: FloatArray,
) -> FloatArray:  # fmt: skip
    """The Gauss-Newton step, the best within the bounds."""
    step = np.zeros(len(value))
    part = jacobian[:, free]
    if not np.all(np.isfinite(part)):
        raise NoMotionError("its derivatives are out of reach")
    scale = np.linalg.norm(part, axis=0)
    scale[scale == 0.0] = 1.0
    left, small = np.linalg.qr(part / scale)
    right = left.T @ residual
    solved = np.linalg.lstsq(small, right, rcond=1e-11)[0]
    floor, ceiling = (low - value)[free] * scale, (high - value)[free] * scale
    if np.any(solved < floor) or np.any(solved > ceiling):
        solved = bounded_least_squares(small, right, floor, ceiling)
    step[free] = solved / scale
    limit = 0.05 * value[OMEGA]
    if abs(step[OMEGA]) > limit:
        step *= limit / abs(step[OMEGA])
    return step
