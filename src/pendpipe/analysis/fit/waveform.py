"""chi^2 of all the readings of a free decay against Eq. 8, with the engine's exact derivatives."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Final, Literal

import numpy as np

from pendpipe.analysis.fit.rounding import rounded
from pendpipe.analysis.torque import TOP
from pendpipe.arrays import FloatArray
from pendpipe.dynamics import Eq8, Release, sample, sample_with_jacobian
from pendpipe.dynamics.eq8 import (
    OFFSET,
    OMEGA,
    SHARE,
    SHARE_MEAN,
    SHARE_SD,
    START,
    TIME,
    A,
    B,
    C,
    Drag,
    Restoring,
    share_of,
)
from pendpipe.solve import Bounds, Priors, Problem, Quadratic, Summed

Seen = Literal["angle", "rate", "position"]

DRIFT: Final = 8
"""Behind the engine's eight: by how much the zero rises in a second."""
BOUNDS: Final = Bounds(
    np.array([0.0, 0.0, 0.0, 0.0, 1e-12, -np.inf, -np.inf, -np.inf, -np.inf]),
    np.array([np.inf] * 3 + [1.0] + [np.inf] * 5),
)
SHARES: Final = Priors(np.array([SHARE]), np.array([SHARE_MEAN]), np.array([SHARE_SD]))
"""The hysteretic share of b, as normal about its mean: one recording hardly tells it."""
_PIECE: Final = 1 << 18
"""Readings whose Jacobian is in memory at a time: 16 MB."""
_BY_SHARE: Final = 0.5 - 4.0 / 3.0 + math.pi**2 / 8.0
"""(omega/b)^2 times the relative lengthening of the period by the square of b's hysteretic share
(`by_points.period_excess`)."""
_BESIDE: Final = 2e-3
"""Phase between the two motions that tell the velocity: 1e-13 of it is lost in the sixth power."""

_LEAST: Final = 1e-100
"""Of a loss that is divided by."""


def most_of_each(value: FloatArray) -> FloatArray:
    """What a, b and c may be at most: no loss is more than the whole at the start.

    It counts as the standard deviation of each beforehand where readings tell the sum alone.
    """
    y = abs(float(value[START]))
    by_rate = np.array([y, 1.0, 1.0 / y])
    return np.asarray(max(float(by_rate @ value[[A, B, C]]), _LEAST) / by_rate)


@dataclass(frozen=True)
class Waveform:
    """chi^2 of the readings against Eq. 8, with that of the share's prior.

    Parameters
    ----------
    time_s, values
        The readings, shape (n,).
    noise_rms
        Standard deviation of one.
    held_parts
        The parts of b that are held: ``"hysteretic"`` or ``"viscous"`` with its rate (1/s).
    step
        The step of readings whose rounding is not random (see `rounding`); `noise_rms` is
        then that before the rounding. Zero: the readings scatter as `noise_rms` says.
    restoring, drag
        The law's restoring torque, and the form of its drag.
    seen
        What is read: the angle, its rate, or a position L sin x.
    length_m
        L of a position.
    """

    time_s: FloatArray
    values: FloatArray
    noise_rms: float
    held_parts: Mapping[str, float]
    step: float = 0.0
    restoring: Restoring = "linear"
    drag: Drag = "energy"
    seen: Seen = "angle"
    length_m: float = 1.0
    _residuals: list[tuple[FloatArray, FloatArray]] = field(
        default_factory=list, init=False, repr=False, compare=False
    )

    def model(self, value: FloatArray) -> tuple[Eq8, Release]:
        """What moves, and from where, for a set of parameters."""
        a, b, c, share, omega, angle, time, offset = value[:DRIFT].tolist()
        known = share_of(self.held_parts, b)
        share = share if known is None else known
        law = Eq8(omega, a, share * b, (1.0 - share) * b, c, self.restoring, self.drag)
        return law, Release(time, angle, offset if self.seen == "angle" else 0.0)

    @property
    def bounds(self) -> Bounds:
        """Of the nine parameters: the start is before all readings, with sin x below the top."""
        low, high = BOUNDS.lower.copy(), BOUNDS.upper.copy()
        high[TIME] = self.time_s[0]
        if self.restoring == "sine":
            low[START], high[START] = -TOP, TOP
        return Bounds(low, high)

    def scale(self, value: FloatArray) -> float:
        """Amplitude of the readings over that of a small angle."""
        return {"angle": 1.0, "rate": float(value[OMEGA]), "position": self.length_m}[self.seen]

    def _late(self, time_s: FloatArray) -> FloatArray:
        """Time since the middle of the readings: what the drift is multiplied by."""
        return np.asarray(time_s - 0.5 * (self.time_s[0] + self.time_s[-1]))

    def _zero(self, value: FloatArray, time_s: FloatArray) -> FloatArray | float:
        """What the zero adds beyond the engine's offset."""
        drift = value[DRIFT] * self._late(time_s) if value[DRIFT] != 0.0 else 0.0
        return drift if self.seen == "angle" else drift + value[OFFSET]

    def residual(self, value: FloatArray) -> FloatArray:
        """Readings less model, shape (n,)."""
        if not (self._residuals and np.array_equal(self._residuals[0][0], value)):
            self._residuals[:] = [(value.copy(), self._residual(value))]
        return self._residuals[0][1]

    def _residual(self, value: FloatArray) -> FloatArray:
        model, release = self.model(value)
        if self.seen == "rate":
            pieces = range(0, len(self.time_s), _PIECE)
            times = [self.time_s[first : first + _PIECE] for first in pieces]
            found = np.concatenate([self.read(value, each)[0] for each in times])
            return np.asarray(self.values - found)
        # Before it is let go it is held; a search that got there is no minimum, but has a residual.
        angle = sample(model, release, np.maximum(self.time_s, release.time_s))
        read = self.length_m * np.sin(angle) if self.seen == "position" else angle
        return np.asarray(self.values - read - self._zero(value, self.time_s))

    def _has_motion(self, value: FloatArray) -> bool:
        """Whether there is a motion from before the readings on, and one that they can show."""
        try:
            model, release = self.model(value)
        except ValueError:
            return False
        turns = model.angular_frequency * (self.time_s[-1] - release.time_s) / np.pi
        # Of more half cycles than two a reading nothing is seen, and they would never end.
        seen = turns < 2.0 * len(self.values) and bool(np.isfinite(model.stop_rad))
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
        """Readings of the law, shape (n,), and their derivatives by the engine's and the drift.

        The motion depends on the time since its release alone, so that its rate is the derivative
        by the release's time, with the other sign.
        """
        model, release = self.model(value)
        if self.seen == "rate":
            beside = _BESIDE / model.angular_frequency
            earlier = replace(release, time_s=release.time_s - beside)
            later = replace(release, time_s=release.time_s + beside)
            after, by_after = sample_with_jacobian(model, earlier, time_s, more=1)
            before, by_before = sample_with_jacobian(model, later, time_s, more=1)
            jacobian = (by_after - by_before) / (2.0 * beside)
            # Both means of the rate miss it by its second derivative, one by three times the other.
            mean = -0.5 * (by_after[:, TIME] + by_before[:, TIME])
            reading = 1.5 * (after - before) / (2.0 * beside) - 0.5 * mean
        else:
            reading, jacobian = sample_with_jacobian(model, release, time_s, more=1)
        if self.seen == "position":
            jacobian = jacobian * (self.length_m * np.cos(reading))[:, None]
            reading = self.length_m * np.sin(reading)
        jacobian[:, OFFSET], jacobian[:, DRIFT] = 1.0, self._late(time_s)
        return reading + self._zero(value, time_s), jacobian

    def curved(self, value: FloatArray, step: FloatArray) -> FloatArray:
        """Return where a step ends: omega makes up for the square of what b's share changes."""
        end = value + step
        if step[OMEGA] != 0.0:  # else it is held
            end[OMEGA] += _BY_SHARE * value[B] ** 2 / value[OMEGA] * step[SHARE] ** 2
        return end

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
        change, prior, row = self.change(value), SHARES.residual(value), SHARES.rows(len(value))
        slope, normal = change.T @ slope, change.T @ normal @ change
        return Quadratic(chi2 + float(prior @ prior), slope + row.T @ prior, normal + row.T @ row)

    def weighed(self, value: FloatArray, at: Quadratic, noise_rms: float) -> Quadratic:
        """The same chi^2 with another noise.

        Of rounded readings the likelihood has its own noise. What is known of the share beforehand
        is as it was, and that no loss is more than the whole.
        """
        scale = 1.0 if self.step else (self.noise_rms / noise_rms) ** 2
        of_share, of_losses = SHARES.rows(len(value)), np.zeros(len(value))
        of_losses[[A, B, C]] = most_of_each(value) ** -2.0
        known = of_share.T @ of_share
        normal = scale * (at.normal - known) + known + np.diag(of_losses)
        return Quadratic(scale * at.chi2, scale * at.gradient, normal)

    def parts_of_b(self, share: float) -> tuple[float, float]:
        """How a change of b goes to its parts: what is held of one leaves it to the other."""
        if self.held_parts:
            share = float("viscous" in self.held_parts)
        return share, 1.0 - share

    def change(self, value: FloatArray) -> FloatArray:
        """Derivative of the engine's parameters by ours, shape (9, 9)."""
        by_share = 0.0 if self.held_parts else float(value[B])
        change = np.zeros((9, 9))
        change[[0, 3, 4, 5, 6, 7, 8], [A, C, OMEGA, START, TIME, OFFSET, DRIFT]] = 1.0
        change[1:3, B] = self.parts_of_b(float(value[SHARE]))
        change[1:3, SHARE] = by_share, -by_share
        return change
