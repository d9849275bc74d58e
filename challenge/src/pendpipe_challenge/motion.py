"""Motions: Runge-Kutta of order 8 from sample to sample, anew at every reversal and switch."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Final

import numpy as np

from pendpipe.arrays import FloatArray
from pendpipe_challenge.torques import (
    BASSET,
    GROUPS,
    IWAN,
    MAXWELL,
    MAXWELL_ELEMENTS,
    PARAMETERS,
    RECORD,
    SECOND,
    STATES,
    compiled,
    friction,
    rates,
)

STAGES: Final = 11


def _tableau() -> tuple[FloatArray, FloatArray, FloatArray]:
    """Cooper and Verner's eighth-order formula (SIAM J. Numer. Anal. 9, 389, 1972)."""
    s = math.sqrt(21.0)
    lower = [
        [],
        [1 / 2],
        [1 / 4, 1 / 4],
        [1 / 7, (-7 - 3 * s) / 98, (21 + 5 * s) / 49],
        [(11 + s) / 84, 0, (18 + 4 * s) / 63, (21 - s) / 252],
        [(5 + s) / 48, 0, (9 + s) / 36, (-231 + 14 * s) / 360, (63 - 7 * s) / 80],
        [
            (10 - s) / 42,
            0,
            (-432 + 92 * s) / 315,
            (633 - 145 * s) / 90,
            (-504 + 115 * s) / 70,
            (63 - 13 * s) / 35,
        ],
        [1 / 14, 0, 0, 0, (14 - 3 * s) / 126, (13 - 3 * s) / 63, 1 / 9],
        [
            1 / 32,
            0,
            0,
            0,
            (91 - 21 * s) / 576,
            11 / 72,
            (-385 - 75 * s) / 1152,
            (63 + 13 * s) / 128,
        ],
        [
            1 / 14,
            0,
            0,
            0,
            1 / 9,
            (-733 - 147 * s) / 2205,
            (515 + 111 * s) / 504,
            (-51 - 11 * s) / 56,
            (132 + 28 * s) / 245,
        ],
        [
            0,
            0,
            0,
            0,
            (-42 + 7 * s) / 18,
            (-18 + 28 * s) / 45,
            (-273 - 53 * s) / 72,
            (301 + 53 * s) / 72,
            (28 - 28 * s) / 45,
            (49 - 7 * s) / 18,
        ],
    ]
    a = np.zeros((STAGES, STAGES))
    for row, values in enumerate(lower):
        a[row, : len(values)] = values
    b = np.zeros(STAGES)
    b[[0, 7, 8, 9, 10]] = np.array([9, 49, 64, 49, 9]) / 180
    return a, b, a.sum(1)


A, B, C = _tableau()


@compiled
def step(
    p: Any,
    s: FloatArray,
    new: FloatArray,
    k: FloatArray,
    work: FloatArray,
    t: float,
    h: float,
    sign: float,
    region: int,
    turn: float,
    turned_at: float,
    states: int,
) -> None:
    """Put the state after `h` into `new`."""
    middle = t + 0.5 * h
    for i in range(STAGES):
        for n in range(states):
            work[n] = s[n]
        for j in range(i):
            if A[i, j] != 0.0:
                factor = h * A[i, j]
                for n in range(states):
                    work[n] += factor * k[j, n]
        rates(p, work, k[i], t + C[i] * h, middle, sign, region, turn, turned_at)
    for n in range(states):
        new[n] = s[n]
    for i in range(STAGES):
        if B[i] != 0.0:
            factor = h * B[i]
            for n in range(states):
                new[n] += factor * k[i, n]


@compiled
def crossing(
    p: Any,
    s: FloatArray,
    new: FloatArray,
    k: FloatArray,
    work: FloatArray,
    t: float,
    h: float,
    sign: float,
    region: int,
    turn: float,
    turned_at: float,
    states: int,
    which: int,
    level: float,
) -> float:
    """When within the step component `which` crosses `level`: safeguarded secant."""
    low, high = 0.0, h
    at_low, at_high = s[which] - level, new[which] - level
    tau = 0.0 if at_low == at_high else h * at_low / (at_low - at_high)
    for _ in range(60):
        step(p, s, new, k, work, t, tau, sign, region, turn, turned_at, states)
        value = new[which] - level
        if abs(value) <= 1e-16 or high - low <= 1e-15 * (1.0 + abs(t)):
            break
        if (value > 0.0) == (at_low > 0.0) and at_low != 0.0:
            low = tau
        else:
            high = tau
        # Newton from the step's own rate at its end, kept inside the bracket.
        middle = t + 0.5 * tau
        rates(p, new, work, t + tau, middle, sign, region, turn, turned_at)
        slope = work[which]
        guess = tau - value / slope if slope != 0.0 else 0.5 * (low + high)
        if not low < guess < high:
            guess = 0.5 * (low + high)
        if abs(guess - tau) <= 1e-15 * (1.0 + abs(t)):
            tau = guess
            break
        tau = guess
    step(p, s, new, k, work, t, tau, sign, region, turn, turned_at, states)
    return tau


@compiled
def longest_step(p: Any, s: FloatArray) -> float:
    """How long a step may be: a twentieth of a cycle, less where something is quick."""
    rate = p.omega / p.step_phase
    speed = math.sqrt(s[1] * s[1] + (p.omega * s[0]) ** 2)
    if p.dahl != 0.0:
        rate = max(rate, speed / (0.5 * p.dahl_reach))
    if p.iwan != 0.0:
        rate = max(rate, speed / (0.25 * p.iwan_reach))
    if p.second != 0.0:
        rate = max(rate, p.second_omega / 0.32)
    if p.drive != 0.0:
        rate = max(rate, p.drive_omega / 0.5)
    if p.rough != 0.0:
        away = max(abs(s[0] - p.rough_place) - 4.0 * p.rough_width, 0.35 * p.rough_width)
        rate = max(rate, speed / away)
    if p.stribeck != 0.0 or p.bristle_stribeck != 0.0:
        reach = 4.0 if p.stribeck_power > 1.0 else 15.0
        away = max(abs(s[1]) - reach * p.stribeck_speed, 0.4 * p.stribeck_speed)
        rate = max(rate, p.omega * speed / away)
    if p.power != 0.0 and s[1] != 0.0:
        stiff = p.power_exponent * p.power * abs(s[1]) ** (p.power_exponent - 1.0)
        rate = max(rate, min(stiff, 200.0 * p.omega))
    if p.power != 0.0 or p.reynolds != 0.0:
        rate = max(rate, p.omega / 0.12)
    if p.book != 0.0:
        rate = max(rate, p.omega / 0.03)
    return float(1.0 / rate)


@compiled
def sticks(
    p: Any,
    s: FloatArray,
    work: FloatArray,
    t: float,
    region: int,
    turn: float,
    turned_at: float,
) -> float:
    """The direction in which a pendulum at rest sets off, or 0 if friction holds it."""
    free = rates(p, s, work, t, t, 1.0, region, turn, turned_at)
    if abs(free) <= friction(p, s[0], 0.0, t, turn, turned_at):
        return 0.0
    return 1.0 if free > 0.0 else -1.0


@compiled
def follow(
    parameters: Any,
    start: FloatArray,
    times: FloatArray,
    breaks: FloatArray,
    kicks: FloatArray,
    states: int,
) -> FloatArray:
    """Integrate from `times[0]` and return x, v, u and the last turning point at `times`.

    Parameters
    ----------
    parameters
        One parameters' record in an array.
    start
        State at ``times[0]``.
    times
        Rising, s.
    breaks
        Moments at which something switches, rising, s.
    kicks
        Change of v at the beginning of each interval between times; empty for none.
    states
        How many of the hidden states are in use, x and v included.
    """
    p = parameters[0]
    out = np.zeros((len(times), 4))
    s, new = start.copy(), np.zeros(STATES)
    k, work = np.zeros((STAGES, STATES)), np.zeros(STATES)
    t, turn, turned_at = times[0], start[0], times[0] - 1e9
    if s[1] == 0.0:
        turned_at = times[0]
    region = 0
    if p.play != 0.0 and abs(s[0]) > p.play:
        region = 1 if s[0] > 0.0 else -1
    budget = 40 * len(times) + 20000  # steps; a motion that needs more has run away
    still = 1e-10 * (abs(s[0]) + abs(s[1]) / p.omega)
    at = 0
    while at < len(breaks) and breaks[at] <= t:
        at += 1
    out[0, 0], out[0, 1], out[0, 2], out[0, 3] = s[0], s[1], s[SECOND], turn
    sign = math.copysign(1.0, s[1])
    if s[1] == 0.0:
        sign = sticks(p, s, work, t, region, turn, turned_at)
    for i in range(1, len(times)):
        end = times[i]
        # Time since `base`: what a step rounds off does not grow with t.
        base, done = t, 0.0
        if len(kicks) and kicks[i - 1] != 0.0:
            s[1] += kicks[i - 1]
            sign = math.copysign(1.0, s[1])
        while t < end:
            budget -= 1
            if budget < 0:
                out[i:, :] = np.nan
                return out
            if sign == 0.0:
                sign = sticks(p, s, work, t, region, turn, turned_at)
            limit = end if at >= len(breaks) else min(end, breaks[at])
            left = (limit - base) - done
            if left > 0.0:
                if sign == 0.0:
                    t, base, done = limit, limit, 0.0
                else:
                    h = left / max(math.ceil(left / longest_step(p, s) - 1e-9), 1)
                    step(p, s, new, k, work, t, h, sign, region, turn, turned_at, states)
                    kind, edge = 0, 0.0
                    if p.play != 0.0:
                        side = 0
                        if abs(new[0]) > p.play:
                            side = 1 if new[0] > 0.0 else -1
                        if side != region:
                            kind = 1
                            edge = region * p.play if region != 0 else side * p.play
                    if new[1] * sign < 0.0:
                        kind = 2
                    if kind == 1:
                        h = crossing(
                            p,
                            s,
                            new,
                            k,
                            work,
                            t,
                            h,
                            sign,
                            region,
                            turn,
                            turned_at,
                            states,
                            0,
                            edge,
                        )
                        region = 0 if region != 0 else (1 if edge > 0.0 else -1)
                        new[0] = edge
                    elif kind == 2:
                        h = crossing(
                            p,
                            s,
                            new,
                            k,
                            work,
                            t,
                            h,
                            sign,
                            region,
                            turn,
                            turned_at,
                            states,
                            1,
                            0.0,
                        )
                        new[1] = 0.0
                    for n in range(states):
                        s[n] = new[n]
                    if kind == 0 and h >= left:
                        t, base, done = limit, limit, 0.0
                    else:
                        done += h
                        t = base + done
                    if kind == 2:
                        turn, turned_at = s[0], t
                        sign = sticks(p, s, work, t, region, turn, turned_at)
                        if abs(s[0]) < still and p.any_time == 0.0 and p.any_push == 0.0:
                            # Damped away to nothing, in ever shorter half cycles perhaps.
                            out[i:, 0] = s[0]
                            out[i:, 1] = 0.0
                            out[i:, 2] = s[SECOND]
                            out[i:, 3] = turn
                            return out
            if at < len(breaks) and t >= breaks[at]:
                if p.impulse != 0.0 and p.impulse_width == 0.0 and breaks[at] == p.impulse_at:
                    s[1] += p.impulse
                if p.scaling != 0.0 and breaks[at] == p.scaling_at:
                    s[0] *= 1.0 + p.scaling
                    s[1] *= 1.0 + p.scaling
                if s[1] != 0.0:
                    sign = math.copysign(1.0, s[1])
                at += 1
        t = end
        out[i, 0], out[i, 1], out[i, 2], out[i, 3] = s[0], s[1], s[SECOND], turn
    return out


_SWITCHES: Final = (
    ("rest_jump", "rest_jump_at", None),
    ("omega_jump", "omega_jump_at", None),
    ("gamma_jump", "gamma_jump_at", None),
    ("impulse", "impulse_at", "impulse_width"),
    ("scaling", "scaling_at", None),
    ("rub", "rub_at", "rub_width"),
)


@dataclass(frozen=True)
class Track:
    """x, v, the second coordinate, the last turning point at the asked times; rad, rad/s."""

    time_s: FloatArray
    angle_rad: FloatArray
    rate_rad_s: FloatArray
    second_rad: FloatArray
    turn_rad: FloatArray


@dataclass(frozen=True)
class Motion:
    """One pendulum: where it starts and what acts on it.

    Parameters
    ----------
    parameters
        What differs from `torques.PARAMETERS`, by name.
    angle_rad, rate_rad_s
        State at the first sample.
    second_rad, second_rate_rad_s
        The second coordinate's.
    held_rad
        Angle at which relaxing springs had settled before the start.
    kicks_rad_s
        Change of v at the start of each sampling interval.
    """

    parameters: Mapping[str, float]
    angle_rad: float
    rate_rad_s: float = 0.0
    second_rad: float = 0.0
    second_rate_rad_s: float = 0.0
    held_rad: float = 0.0
    kicks_rad_s: FloatArray = field(default_factory=lambda: np.empty(0))

    def value(self, name: str) -> float:
        """A parameter, or its default."""
        return self.parameters.get(name, PARAMETERS[name])

    def changed(self, **parameters: float) -> Motion:
        """The same motion with other parameters."""
        return replace(self, parameters={**self.parameters, **parameters})

    def run(self, time_s: FloatArray) -> Track:
        """Integrate and sample.

        Parameters
        ----------
        time_s
            Rising, s, shape (samples,); the start holds at the first.
        """
        unknown = set(self.parameters) - set(PARAMETERS)
        if unknown:
            raise KeyError(f"no such parameters: {sorted(unknown)}")
        record = np.zeros(1, RECORD)
        for name, value in (PARAMETERS | dict(self.parameters)).items():
            record[name] = value
        for group, names in GROUPS.items():
            record[group] = any(self.value(name) != 0.0 for name in names)
        found = follow(
            record,
            self._start(),
            np.ascontiguousarray(time_s, np.float64),
            self._breaks(),
            self.kicks_rad_s,
            self._states(),
        )
        return Track(time_s, *(found[:, each].copy() for each in range(4)))

    def _start(self) -> FloatArray:
        state = np.zeros(STATES)
        state[:2] = self.angle_rad, self.rate_rad_s
        state[MAXWELL : MAXWELL + MAXWELL_ELEMENTS] = self.held_rad
        state[SECOND:] = self.second_rad, self.second_rate_rad_s
        return state

    def _breaks(self) -> FloatArray:
        moments: set[float] = set()
        for size, at, width in _SWITCHES:
            if self.value(size) != 0.0:
                moments.add(self.value(at))
                if width is not None and self.value(width) > 0.0:
                    moments.add(self.value(at) + self.value(width))
        return np.array(sorted(moments), np.float64)

    def _states(self) -> int:
        """How many states move: the list is as long as the last one in use."""
        ends = {
            "dahl": IWAN,
            "iwan": MAXWELL,
            "maxwell": BASSET,
            "basset": SECOND,
            "second": STATES,
            "book": STATES,
        }
        return max([2, *(end for name, end in ends.items() if self.value(name) != 0.0)])
