"""chi^2 of all the readings of a free decay against Eq. 8, with the engine's exact derivatives."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from pendpipe.analysis.fit.rounding import rounded
from pendpipe.analysis.torque import TOP
from pendpipe.arrays import FloatArray
from pendpipe.dynamics.eq8 import BASELINE, START, TIME
from pendpipe.dynamics.eq8_model import LOWER, SHARES, UPPER, Eq8Model, known_losses
from pendpipe.solve import Bounds, Problem, Quadratic, Summed

DRIFT: Final = len(BASELINE)
"""Behind the model's eight values: by how much the zero rises in a second."""
_PIECE: Final = 1 << 18
"""Readings whose Jacobian is in memory at a time: 16 MB."""


@dataclass(frozen=True)
class Waveform(Eq8Model):
    """chi^2 of the readings against Eq. 8, with that of the share's prior.

    Parameters
    ----------
    time_s, values
        The readings, shape (n,).
    noise_rms
        Standard deviation of one.
    step
        The step of readings whose rounding is not random (see `rounding`); `noise_rms` is
        then that before the rounding. Zero: the readings scatter as `noise_rms` says.
    """

    time_s: FloatArray
    values: FloatArray
    noise_rms: float
    step: float = 0.0
    _residuals: list[tuple[FloatArray, FloatArray]] = field(
        default_factory=list, init=False, repr=False, compare=False
    )

    @property
    def bounds(self) -> Bounds:
        """Of the nine parameters: the start is before all readings, with sin x below the top."""
        low, high = np.append(LOWER, -np.inf), np.append(UPPER, np.inf)
        high[TIME] = self.time_s[0]
        if self.restoring == "sine":
            low[START], high[START] = -TOP, TOP
        return Bounds(low, high)

    def _late(self, time_s: FloatArray) -> FloatArray:
        """Time since the middle of the readings: what the drift is multiplied by."""
        return np.asarray(time_s - 0.5 * (self.time_s[0] + self.time_s[-1]))

    def _drifted(self, value: FloatArray, time_s: FloatArray) -> FloatArray | float:
        return value[DRIFT] * self._late(time_s) if value[DRIFT] != 0.0 else 0.0

    def residual(self, value: FloatArray) -> FloatArray:
        """Readings less model, shape (n,)."""
        if not (self._residuals and np.array_equal(self._residuals[0][0], value)):
            self._residuals[:] = [(value.copy(), self._residual(value))]
        return self._residuals[0][1]

    def _residual(self, value: FloatArray) -> FloatArray:
        if self.seen != "rate":
            found = self.readings(value, self.time_s)
        else:
            # A rate takes the derivatives, which fill the memory.
            pieces = range(0, len(self.time_s), _PIECE)
            times = [self.time_s[first : first + _PIECE] for first in pieces]
            found = np.concatenate([self.readings(value, each) for each in times])
        return np.asarray(self.values - found - self._drifted(value, self.time_s))

    def _has_motion(self, value: FloatArray) -> bool:
        """Whether there is a motion from before the readings on, and one that they can show."""
        try:
            law, release = self.motion_of(value)
        except ValueError:
            return False
        turns = law.angular_frequency * (self.time_s[-1] - release.time_s) / np.pi
        # Of more half cycles than two a reading nothing is seen, and they would never end.
        seen = turns < 2.0 * len(self.values) and bool(np.isfinite(law.stop_rad))
        return seen and release.time_s <= self.time_s[0]

    @property
    def problem(self) -> Problem[Summed]:
        """What is minimised."""
        return Problem(self.at, self.bounds, moved=self.curved)

    def at(self, value: FloatArray) -> Summed | None:
        """chi^2 at some values; None where nothing moves, or it is overdamped."""
        try:
            chi2 = self.deviance(self.residual(value)) if self._has_motion(value) else math.inf
        except ValueError:
            return None
        count, chi2 = len(self.values), chi2 + float(np.sum(SHARES.residual(value) ** 2))
        return Summed(value, chi2, self.evaluate, count) if math.isfinite(chi2) else None

    def deviance(self, residual: FloatArray) -> float:
        """Return -2 ln likelihood of some residuals."""
        if self.step == 0.0:
            return float(residual @ residual) / self.noise_rms**2
        unused = np.empty_like(residual), np.empty_like(residual)
        return float(rounded(residual, 0.5 * self.step, self.noise_rms, *unused))

    def read(self, value: FloatArray, time_s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Readings, shape (n,), and their derivatives by the engine's parameters and the drift."""
        reading, jacobian = self.readings_with_jacobian(value, time_s, more=1)
        jacobian[:, DRIFT] = self._late(time_s)
        return reading + self._drifted(value, time_s), jacobian

    def evaluate(self, value: FloatArray) -> Quadratic:
        """chi^2, gradient and normal matrix, summed over pieces of the record."""
        chi2, slope, normal = 0.0, np.zeros(len(value)), np.zeros((len(value), len(value)))
        for first in range(0, len(self.values), _PIECE):
            piece = slice(first, first + _PIECE)
            reading, jacobian = self.read(value, self.time_s[piece])
            residual = self.values[piece] - reading
            if self.step == 0.0:
                part, score, weighted = float(residual @ residual), residual, jacobian
            else:
                score, weights = np.empty_like(residual), np.empty_like(residual)
                part = rounded(residual, 0.5 * self.step, self.noise_rms, score, weights)
                weighted = jacobian * weights[:, None]
            chi2 += part
            slope += jacobian.T @ score
            normal += jacobian.T @ weighted
        unit = self.noise_rms**-2 if self.step == 0.0 else 1.0
        chi2, slope, normal = unit * chi2, unit * slope, unit * normal
        change, prior, row = (
            self.engine_by_values(value),
            SHARES.residual(value),
            SHARES.rows(len(value)),
        )
        slope, normal = change.T @ slope, change.T @ normal @ change
        return Quadratic(chi2 + float(prior @ prior), slope + row.T @ prior, normal + row.T @ row)

    def weighed(self, value: FloatArray, at: Quadratic, noise_rms: float) -> Quadratic:
        """The same chi^2 with another noise.

        Of rounded readings the likelihood has its own noise. What is known of the share beforehand
        is as it was, and that no loss is more than the whole.
        """
        scale = 1.0 if self.step else (self.noise_rms / noise_rms) ** 2
        of_share = SHARES.rows(len(value))
        known = of_share.T @ of_share
        normal = scale * (at.normal - known) + known + known_losses(value)
        return Quadratic(scale * at.chi2, scale * at.gradient, normal)
