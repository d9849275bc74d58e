"""Maximum likelihood of a model's values, from however far away."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final

import numpy as np

from pendpipe.arrays import FloatArray
from pendpipe.diagnose.data import Data
from pendpipe.diagnose.gauss_newton import SETTLED, GaussNewton, Place
from pendpipe.diagnose.noise import Noise
from pendpipe.effects.baseline import C
from pendpipe.effects.model import Evaluated, Model

ROUNDS: Final = 14
"""How many steps a fit may take."""
_AS_PROMISED: Final = 0.02
"""Part by which a step may gain less or more than promised, and the model be called linear."""
_CREEP: Final = 0.25
"""Of chi^2: three rounds that gain less are the last."""
_LAST: Final = 3
"""How many steps show what further ones may gain."""
_PULL: Final = 3.0
"""Standard deviations beyond a bound from which it is the bound that is believed."""


@dataclass(frozen=True)
class Fit:
    """A model at its best values.

    Parameters
    ----------
    place
        Its values, and what they give.
    free
        Indices of the values that were fitted.
    converged
        Whether the last step was negligible.
    error_scale
        Factor of all standard deviations, for what is left beyond the noise.
    """

    place: Place
    free: tuple[int, ...]
    converged: bool
    error_scale: float = 1.0

    @property
    def model(self) -> Model:
        """The model."""
        return self.place.model

    @property
    def value(self) -> FloatArray:
        """Its values."""
        return self.place.value

    @property
    def at(self) -> Evaluated:
        """The model there."""
        return self.place.at

    @property
    def chi2(self) -> float:
        """Sum of squares of the whitened residual, with the share's prior."""
        return self.place.chi2

    @property
    def residual(self) -> FloatArray:
        """Whitened; one entry more than there are readings (the prior), shape (n + 1,)."""
        return self.place.residual

    @property
    def jacobian(self) -> FloatArray:
        """Of the whitened readings by all values, with the prior's row, shape (n + 1, size)."""
        return self.place.columns

    @property
    def max_phase_error_rad(self) -> float:
        """The largest phase by which model and readings differ."""
        return self.place.max_phase_error_rad

    def covariance(self) -> FloatArray:
        """Of all values; zero for those held, shape (size, size)."""
        matrix = np.zeros((len(self.value), len(self.value)))
        part = self.jacobian[:, self.free]
        scale = np.linalg.norm(part, axis=0)
        scale[scale == 0.0] = 1.0
        inverse = np.linalg.pinv(np.linalg.qr(part / scale, mode="r"), rcond=1e-12)
        matrix[np.ix_(self.free, self.free)] = inverse @ inverse.T / np.outer(scale, scale)
        return self.error_scale**2 * matrix


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
    model: Model,
    data: Data,
    noise: Noise,
    start: FloatArray,
    *,
    held: Iterable[int] = (),
    rounds: int = ROUNDS,
    of_use: float = math.inf,
) -> Fit:
    """Minimise chi^2 by Gauss and Newton, within the bounds.

    Where model and readings are out of phase by much, the residual is taken along the
    motion (amplitude and unwrapped phase, cycle by cycle), so that it stays linear. A fit that
    can't come down to a chi^2 `of_use` is left where it is.

    Raises
    ------
    NoMotionError
        If the model can't be evaluated at the start.
    """
    refining = Refining(model, data, noise, start, held=held)
    refining.go(rounds, of_use)
    return refining.fit


class Refining:
    """A refit that can be left and gone on with; parameters are those of `refine`.

    Two rounds that gain less than `little` are the last, and so are three that creep.
    """

    def __init__(
        self,
        model: Model,
        data: Data,
        noise: Noise,
        start: FloatArray,
        *,
        held: Iterable[int] = (),
        little: float = SETTLED,
    ) -> None:
        fixed = {*held, *model.held()}
        self._free = np.array([k for k in range(model.size) if k not in fixed])
        self._climb = GaussNewton(model, data, noise)
        self._here = self._climb.start(start)
        self._gains: list[float] = []
        self._stalled = ((2, little), (3, max(little, _CREEP)))
        self._ended = self._converged = False

    @property
    def chi2(self) -> float:
        """Where it is now."""
        return self._here.chi2

    @property
    def fit(self) -> Fit:
        """What it has come to."""
        return Fit(self._here, tuple(self._free.tolist()), self._converged)

    def go(self, rounds: int, of_use: float = math.inf) -> None:
        """Go on for some rounds, or until it is at the minimum, or hopeless.

        Parameters
        ----------
        rounds
            How many.
        of_use
            A chi^2 above which the fit is of no use: it is left where it is where as many rounds
            as are left, if they gain what the last ones have, won't bring it there.
        """
        for left in range(rounds, 0, -1):
            if self._ended or self._hopeless(left, of_use):
                break
            self._round()
        self._climb.forget()

    def _hopeless(self, left: int, of_use: float) -> bool:
        last = self._gains[-_LAST:]
        return len(last) == _LAST and self.chi2 - left * sum(last) / _LAST > of_use

    def _round(self) -> None:
        here, free, climb = self._here, self._free, self._climb
        step = climb.step(here, free)
        promised = _promised(here, here.columns, step)
        tried = climb.tried(here, step, free, promised)
        straight = tried is not None
        if tried is None and C in free:
            # More friction would stop it before the last reading: the others go first.
            others = free[free != C]
            step = climb.step(here, others)
            tried = climb.tried(here, step, others, _promised(here, here.columns, step))
        if tried is None:
            self._ended, self._converged = True, promised < 10.0 * SETTLED
            return
        self._here = tried
        gained = here.chi2 - tried.chi2
        self._gains.append(gained)
        if promised < SETTLED or (gained < SETTLED and promised < 1.0):
            self._ended = self._converged = True
        elif straight and abs(promised - gained) < _AS_PROMISED * promised:
            self._settle(here)
        self._ended |= self._stalls()

    def _stalls(self) -> bool:
        """Whether what is promised is not given any more.

        A derivative is wrong there (of an instant, say), the motion stops just beyond, or two
        values take each other's place.
        """
        return any(
            len(self._gains) >= rounds and max(self._gains[-rounds:]) < little
            for rounds, little in self._stalled
        )

    def _settle(self, before: Place) -> None:
        """Take the last step by the derivatives of the step before, where it is negligible.

        They are as good as those here where that step gave what it had promised.
        """
        here = self._here
        if not np.all(np.any(before.columns[:, self._free], axis=0)):
            # The shape of an effect that was not there did nothing then.
            return
        step = self._climb.step(here, self._free, before.columns)
        promised = _promised(here, before.columns, step)
        if promised < SETTLED:
            self._here = self._climb.tried(here, step, self._free, promised) or here
            self._ended = self._converged = True


def _promised(here: Place, columns: FloatArray, step: FloatArray) -> float:
    """What a step takes off chi^2, if the model is linear."""
    return here.chi2 - float(np.sum((here.residual - columns @ step) ** 2))


def misfit(model: Model, data: Data, noise: Noise, value: FloatArray) -> float:
    """Return chi^2 at values, nothing fitted.

    Raises
    ------
    NoMotionError
        If the model can't be evaluated there.
    """
    return GaussNewton(model, data, noise).place(value).chi2
