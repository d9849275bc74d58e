"""Eq. 8 and the sensor that reads it: one vector of parameters for the fit and the diagnosis.

Of b = b_h + b_v one part, or both, may be held: then the share, or b as well, is not free.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from typing import Final, Literal, Protocol

import numpy as np

from pendpipe.arrays import FloatArray
from pendpipe.dynamics.eq8 import (
    BASELINE,
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
    Eq8,
    Release,
    Restoring,
    sample,
    sample_with_jacobian,
    share_of,
)
from pendpipe.priors import Priors

Seen = Literal["angle", "rate", "position"]
"""What of the motion is read: the angle, its rate, or a position L sin x."""
DRIFT: Final = len(BASELINE)
"""Behind the eight values: by how much the zero rises in a second, where that is fitted."""
HYSTERETIC, VISCOUS = "hysteretic", "viscous"
LOWER: Final = np.array([0.0, 0.0, 0.0, 0.0, 1e-12, -np.inf, -np.inf, -np.inf])  # omega > 0
UPPER: Final = np.array([np.inf, np.inf, np.inf, 1.0, np.inf, np.inf, np.inf, np.inf])
"""Least and greatest values, in the order of `BASELINE`."""
SHARES: Final = Priors(np.array([SHARE]), np.array([SHARE_MEAN]), np.array([SHARE_SD]))
"""The hysteretic share of b, as normal about its mean: one recording hardly tells it."""
_LEAST: Final = 1e-100
"""Of a loss that is divided by."""
_BY_SHARE: Final = 0.5 - 4.0 / 3.0 + math.pi**2 / 8.0
"""(omega/b)^2 times the relative lengthening of the period by the square of b's hysteretic share
(`torque.period_excess`)."""
_BESIDE: Final = 2e-3
"""Phase between the two motions that tell the velocity: 1e-13 of it is lost in the sixth power."""


def known_losses(value: FloatArray) -> FloatArray:
    """What is known of a, b and c beforehand, as a normal matrix: none is more than the whole loss.

    That at the start, a y + b + c/y, counts as the standard deviation of each of its parts where
    readings tell the sum alone.
    """
    y, known = abs(float(value[START])), np.zeros((len(value), len(value)))
    by_rate = np.array([y, 1.0, 1.0 / y])
    known[[A, B, C], [A, B, C]] = (by_rate / max(float(by_rate @ value[[A, B, C]]), _LEAST)) ** 2
    return known


def values_of(law: Eq8, release: Release, offset: float = 0.0) -> FloatArray:
    """The values of a law that moves from a turning point."""
    losses = law.quadratic, law.hysteretic + law.viscous, law.coulomb, law.share
    return np.array([*losses, law.angular_frequency, release.angle_rad, release.time_s, offset])


class Evaluates(Protocol):
    """A model at given values, by whichever engine."""

    @property
    def reading(self) -> FloatArray:
        """What the sensor reads, shape (n,)."""

    @property
    def jacobian(self) -> FloatArray:
        """Its derivatives by the values, shape (n, size)."""


@dataclass(frozen=True)
class Eq8Model:
    """Eq. 8 in one of its forms, and what of its motion is read.

    Its values are the eight of `BASELINE`; what a user of it adds follows behind.

    Parameters
    ----------
    time_s
        When it is read, ascending, shape (n,).
    restoring, drag
        The forms of the torque and of the quadratic loss.
    seen
        What is read: the angle, its rate (rad/s), or a position L sin x.
    length_m
        L of a position.
    parts
        The parts of b that are held (``"hysteretic"``, ``"viscous"``), with their rates in 1/s.
    """

    time_s: FloatArray
    restoring: Restoring = field(default="linear", kw_only=True)
    drag: Drag = field(default="energy", kw_only=True)
    seen: Seen = field(default="angle", kw_only=True)
    length_m: float = field(default=1.0, kw_only=True)
    parts: Mapping[str, float] = field(default_factory=dict, kw_only=True)

    @property
    def eq8(self) -> Eq8Model:
        """The law and sensor alone, of a model with more, without the times of its readings."""
        forms = {each.name: getattr(self, each.name) for each in fields(Eq8Model)}
        return Eq8Model(**forms | {"time_s": np.zeros(0)})

    def held_parts(self) -> Mapping[str, float]:
        """The parts of b that are held."""
        return self.parts

    def settled(self, value: FloatArray) -> FloatArray:
        """The values with the share (and, if both parts of b are held, the b) that these make."""
        parts = self.held_parts()
        if not parts:
            return value
        value, least = value.copy(), sum(parts.values())
        value[B] = least if len(parts) == 2 else max(float(value[B]), least)
        share = share_of(parts, float(value[B]))
        value[SHARE] = value[SHARE] if share is None else share
        return value

    def share_by_b(self, value: FloatArray) -> float:
        """Derivative of the share by b where one part of b is held; else b has it for itself."""
        parts = self.held_parts()
        if len(parts) != 1 or value[B] <= 0.0:
            return 0.0
        return float(-value[SHARE] if HYSTERETIC in parts else 1.0 - value[SHARE]) / float(value[B])

    def motion_of(self, value: FloatArray) -> tuple[Eq8, Release]:
        """What moves, and from where."""
        a, b, c, share, omega, angle, time, offset = value[: len(BASELINE)].tolist()
        known = share_of(self.held_parts(), b)
        share = share if known is None else known
        law = Eq8(omega, a, share * b, (1.0 - share) * b, c, self.restoring, self.drag)
        return law, Release(time, angle, offset if self.seen == "angle" else 0.0)

    def amplitude_scale(self, value: FloatArray) -> float:
        """Amplitude of the readings over that of a small angle."""
        return {"angle": 1.0, "rate": float(value[OMEGA]), "position": self.length_m}[self.seen]

    def evaluate(self, value: FloatArray) -> Evaluates:
        """Return what the sensor reads at the model's times, with its derivatives when asked."""
        return Followed(self, value, self.time_s)

    def curved(self, value: FloatArray, step: FloatArray) -> FloatArray:
        """Return where a step ends: omega makes up for the square of what b's share changes."""
        end = value + step
        if step[OMEGA] != 0.0:  # else it is held
            end[OMEGA] += _BY_SHARE * value[B] ** 2 / value[OMEGA] * step[SHARE] ** 2
        return end

    def by_values(self, value: FloatArray, columns: FloatArray) -> FloatArray:
        """Derivatives by the values from those by the engine's parameters, along the last axis."""
        # What is held of one part leaves a change of b to the other.
        share = float(VISCOUS in self.parts) if self.parts else float(value[SHARE])
        hysteretic, viscous, found = columns[..., 1], columns[..., 2], columns.copy()
        found[..., B] = share * hysteretic + (1.0 - share) * viscous
        found[..., C] = columns[..., 3]
        found[..., SHARE] = (hysteretic - viscous) * (0.0 if self.parts else float(value[B]))
        return found


@dataclass(frozen=True)
class Followed:
    """Eq. 8 at given values, by the compiled engine.

    Parameters
    ----------
    model, value
        What moves. A ninth value is the rate at which the zero rises.
    time_s
        When it is read, ascending, shape (n,).
    """

    model: Eq8Model
    value: FloatArray
    time_s: FloatArray

    @property
    def reading(self) -> FloatArray:
        """What the sensor reads, shape (n,)."""
        model, value = self.model, self.value
        if model.seen == "rate":
            return self.by_engine[0]
        law, release = model.motion_of(value)
        # Before it is let go it is held; a search that got there is no minimum, but has a residual.
        reading = sample(law, release, np.maximum(self.time_s, release.time_s))
        if model.seen == "position":
            reading = model.length_m * np.sin(reading) + value[OFFSET]
        return self._drifted(reading)

    @property
    def jacobian(self) -> FloatArray:
        """Its derivatives by the values, shape (n, size)."""
        return self.model.by_values(self.value, self.by_engine[1])

    @cached_property
    def by_engine(self) -> tuple[FloatArray, FloatArray]:
        """The reading, and its derivatives by the engine's parameters and what stands behind them.

        The motion depends on the time since its release alone, so that its rate is the derivative
        by the release's time, with the other sign.
        """
        model, value, time_s = self.model, self.value, self.time_s
        (law, release), more = model.motion_of(value), len(value) - len(BASELINE)
        if model.seen == "rate":
            beside = _BESIDE / law.angular_frequency
            earlier = replace(release, time_s=release.time_s - beside)
            later = replace(release, time_s=release.time_s + beside)
            after, by_after = sample_with_jacobian(law, earlier, time_s, more=more)
            before, by_before = sample_with_jacobian(law, later, time_s, more=more)
            jacobian = (by_after - by_before) / (2.0 * beside)
            # Both means of the rate miss it by its second derivative, one by three times the other.
            mean = -0.5 * (by_after[:, TIME] + by_before[:, TIME])
            reading = 1.5 * (after - before) / (2.0 * beside) - 0.5 * mean
        else:
            reading, jacobian = sample_with_jacobian(law, release, time_s, more=more)
        if model.seen == "position":
            jacobian = jacobian * (model.length_m * np.cos(reading))[:, None]
            reading = model.length_m * np.sin(reading)
        jacobian[:, OFFSET] = 1.0
        if more:
            jacobian[:, DRIFT] = self._late
        if model.seen != "angle":
            reading = reading + value[OFFSET]
        return self._drifted(reading), jacobian

    def _drifted(self, reading: FloatArray) -> FloatArray:
        drift = self.value[DRIFT:]
        return reading + drift[0] * self._late if drift.any() else reading

    @property
    def _late(self) -> FloatArray:
        """Time since the middle of the model's times: what the drift is multiplied by."""
        return np.asarray(self.time_s - 0.5 * (self.model.time_s[0] + self.model.time_s[-1]))
