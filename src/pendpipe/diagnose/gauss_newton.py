"""Steps of Gauss and Newton towards the best values of a model, within their bounds."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np

from pendpipe.arrays import FloatArray, IntArray
from pendpipe.diagnose.data import Data
from pendpipe.diagnose.noise import Noise
from pendpipe.diagnose.numerics import bounded_least_squares
from pendpipe.diagnose.unwrapped import unwrapped
from pendpipe.dynamics.any_law import NoMotionError
from pendpipe.effects.baseline import OMEGA, SHARE, B, share_by_b
from pendpipe.effects.derivatives import jacobian
from pendpipe.effects.model import Evaluated, Model

SETTLED: Final = 0.02
"""Of chi^2: a step that promises less is the last."""
_FACTOR: Final = 1.5
"""By which a scale may change in one step."""
_PARTS: Final = (0.3, 0.1, 0.02)
"""Of a step that does not lower chi^2."""
_BENT_PARTS: Final = (1.0, 0.3)
"""The same where everything else follows what is not linear."""
_MUCH: Final = 0.5
"""Part of what a step has promised with which one is content."""
_SHARE_SD: Final = 0.3
"""The hysteretic share of b is hardly seen in one record: any between 0 and 1 may be."""


@dataclass(frozen=True)
class Place:
    """Values with what they give; shapes are those of `refine.Fit`.

    Parameters
    ----------
    value
        Of the model.
    at, residual, max_phase_error_rad
        The model there, the whitened residual, and the largest slip of the phase.
    model, noise
        From which the Jacobian is worked out, where it is asked for.
    """

    value: FloatArray
    at: Evaluated
    residual: FloatArray
    max_phase_error_rad: float
    model: Model
    noise: Noise

    @cached_property
    def chi2(self) -> float:
        """Sum of squares."""
        return float(self.residual @ self.residual)

    @cached_property
    def columns(self) -> FloatArray:
        """The Jacobian."""
        return _jacobian(self.model, self.noise, self.value, self.at)


class GaussNewton:
    """Steps of Gauss and Newton from place to place."""

    def __init__(self, model: Model, data: Data, noise: Noise) -> None:
        self._model, self._data, self._noise = model, data, noise
        self._low, self._high = model.bounds()
        self._shapes = np.array(_shapes(model), dtype=np.int64)
        # What must be positive is a speed, a time or a length of the effect's own.
        self._scales = self._shapes[self._low[self._shapes] > 0.0]
        self._stay = np.zeros(model.size, dtype=bool)
        self._stay[np.setdiff1d(self._shapes, self._scales)] = True
        self._factored: _Factored | None = None

    def start(self, value: FloatArray) -> Place:
        """The place of values, within the bounds."""
        return self.place(self._model.settled(np.clip(value, self._low, self._high)))

    def place(self, value: FloatArray) -> Place:
        """The place of these very values."""
        at = self._model.evaluate(value)
        residual, slip = _residual(self._data, self._noise, at, value)
        return Place(value, at, residual, slip, self._model, self._noise)

    def step(self, here: Place, free: IntArray, columns: FloatArray | None = None) -> FloatArray:
        """The best step of the free values, if the model were linear, of these `columns`."""
        low, high = self._low.copy(), self._high.copy()
        # The readings are linear in a scale over a part of it at most; and while the effect's
        # size is still small, a step may ask for any change of it.
        scales = self._scales
        low[scales] = np.maximum(low[scales], here.value[scales] / _FACTOR)
        high[scales] = np.minimum(high[scales], here.value[scales] * _FACTOR)
        columns = here.columns if columns is None else columns
        if self._factored is None or not self._factored.is_of(columns, free):
            self._factored = _Factored.of(columns, free)
        return _step(self._factored, here.residual, here.value, low, high)

    def forget(self) -> None:
        """Keep no columns beyond those of the places."""
        self._factored = None

    def tried(self, here: Place, step: FloatArray, free: IntArray, promised: float) -> Place | None:
        """Go along a step as far as it lowers chi^2; None where it does nowhere.

        `promised` is what it would take off, if the model were linear.
        """
        enough = here.chi2 + 0.5 * SETTLED
        whole = self._reached(here.value + step)
        if whole is not None and whole.chi2 < enough:
            return whole
        bent = (self._followed(here, part * step, free) for part in _BENT_PARTS)
        shorter = (self._reached(here.value + part * step) for part in _PARTS)
        lowest: Place | None = None
        for way in (bent, shorter):
            found = next((there for there in way if there and there.chi2 < enough), None)
            if found and (lowest is None or found.chi2 < lowest.chi2):
                lowest = found
            if lowest and here.chi2 - lowest.chi2 > _MUCH * promised:
                break
        return lowest

    def _followed(self, here: Place, step: FloatArray, free: IntArray) -> Place | None:
        """Go along a step, and bring sizes and baseline to where it has taken the scales, if any.

        Laws that take each other's place leave the motion as it is but for what friction does
        in second order: its frequency changes by g^2, which adds up over the whole record.
        Other shapes (a line's frequency, an instant) stay: chi^2 has many minima along them,
        and whatever followed would lead from one to another.
        """
        if not np.isin(self._scales, free).any():
            return None
        there = self._reached(here.value + np.where(self._stay, 0.0, step))
        if there is None:
            return None
        try:
            further = self.step(there, free[~np.isin(free, self._shapes)])
        except NoMotionError:
            return None
        return self._reached(there.value + further)

    def _reached(self, value: FloatArray) -> Place | None:
        try:
            return self.start(value)
        except NoMotionError:
            return None


def _shapes(model: Model) -> list[int]:
    """Indices of the values on which the readings do not depend in proportion."""
    return [
        index
        for effect, place in model.places()
        for index in range(place.start + (1 if effect.parameter_free else effect.sizes), place.stop)
    ]


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


@dataclass(frozen=True)
class _Factored:
    """The columns of the free values, at unit length, as an orthonormal basis and the rest."""

    columns: FloatArray
    free: IntArray
    scale: FloatArray
    basis: FloatArray
    triangle: FloatArray

    @classmethod
    def of(cls, columns: FloatArray, free: IntArray) -> _Factored:
        """Factor them."""
        part = columns[:, free]
        if not np.all(np.isfinite(part)):
            raise NoMotionError("its derivatives are out of reach")
        scale = np.linalg.norm(part, axis=0)
        scale[scale == 0.0] = 1.0
        return cls(columns, free, scale, *np.linalg.qr(part / scale))

    def is_of(self, columns: FloatArray, free: IntArray) -> bool:
        """Whether these are what was factored."""
        return columns is self.columns and np.array_equal(free, self.free)


def _step(
    factored: _Factored, residual: FloatArray, value: FloatArray, low: FloatArray, high: FloatArray
) -> FloatArray:
    """The Gauss-Newton step, the best within the bounds."""
    step, free, scale = np.zeros(len(value)), factored.free, factored.scale
    right = factored.basis.T @ residual
    solved = np.linalg.lstsq(factored.triangle, right, rcond=1e-11)[0]
    floor, ceiling = (low - value)[free] * scale, (high - value)[free] * scale
    if np.any(solved < floor) or np.any(solved > ceiling):
        solved = bounded_least_squares(factored.triangle, right, floor, ceiling)
    step[free] = solved / scale
    limit = 0.05 * value[OMEGA]
    if abs(step[OMEGA]) > limit:
        step *= limit / abs(step[OMEGA])
    return step
