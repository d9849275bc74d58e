"""Maximum likelihood of a model's values, from however far away."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final

import numpy as np

from pendpipe.arrays import FloatArray
from pendpipe.diagnose.climb import SETTLED, Climb
from pendpipe.diagnose.data import Data
from pendpipe.diagnose.noise import Noise
from pendpipe.effects.baseline import C
from pendpipe.effects.evaluated import Evaluated
from pendpipe.effects.model import Model

_ROUNDS: Final = 14
_PULL: Final = 3.0
"""Standard deviations beyond a bound from which it is the bound that is believed."""


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
    climb = Climb(model, data, noise)
    here = climb.start(start)
    converged = False
    for _ in range(rounds):
        step = climb.step(here, free)
        promised = here.chi2 - float(np.sum((here.residual - here.columns @ step) ** 2))
        tried = climb.tried(here, step, free)
        if tried is None and C in free:
            # More friction would stop it before the last reading: the others go first.
            others = free[free != C]
            tried = climb.tried(here, climb.step(here, others), others)
        if tried is None:
            converged = promised < 10.0 * SETTLED
            break
        gained, here = here.chi2 - tried.chi2, tried
        if promised < SETTLED or (gained < SETTLED and promised < 1.0):
            converged = True
            break
    return Fit(
        model, here.value, here.chi2, here.residual, here.columns, here.at,
        tuple(free.tolist()), converged, here.slip_rad,
    )  # fmt: skip


def misfit(model: Model, data: Data, noise: Noise, value: FloatArray) -> float:
    """Return chi^2 at values, nothing fitted.

    Raises
    ------
    NoMotionError
        If the model can't be evaluated there.
    """
    return Climb(model, data, noise).place(value).chi2
