"""Eq. 8 by two slow and trusted ways, which share nothing with the engine.

`MpmathPendulum` solves half cycles to 40 digits by collocation in the phase about the
Coulomb-shifted centre (the engine has another centre), and checks itself by Taylor series in
time. `heyoka_turning_points` integrates in time and searches for the zeros of the velocity.
"""

import functools
import math
from dataclasses import dataclass, replace
from operator import mul
from typing import Any

import mpmath
import numpy as np
import pytest
from mpmath import mp, mpf

from pendpipe.dynamics import (
    Eq8,
    Release,
    sample_with_jacobian,
    turning_points,
    turning_points_with_jacobian,
)

DIGITS = 40
NODES = 36
BITS = 200
"""After the point, of the whole numbers that stand for fractions in the sums of products."""


def whole(number: Any) -> int:
    """Return a number times 2^BITS, rounded; mpmath's own sums take ten times as long."""
    return int(mp.ldexp(number, BITS))


def summed(row: list[int], values: list[int]) -> Any:
    """Return the sum of products of two rows of `whole` numbers."""
    return mp.ldexp(mpf(sum(map(mul, row, values))), -2 * BITS)


@functools.cache
def collocation() -> tuple[list[Any], list[Any], list[list[int]]]:
    """Return cos and sin at the nodes of the phase, and the integration matrix (`whole`)."""
    with mp.workdps(DIGITS + 10):
        n = NODES
        z = [-mp.cos(mp.pi * j / n) for j in range(n + 1)]
        rows = []
        for i in range(n + 1):
            # The integral of T_k from -1 to z_i, then the values' Chebyshev coefficients.
            integral = []
            for k in range(n + 1):
                if k == 0:
                    integral.append(z[i] + 1)
                elif k == 1:
                    integral.append((z[i] ** 2 - 1) / 2)
                else:
                    turn = mp.acos(z[i])
                    upper = mp.cos((k + 1) * turn) / (2 * (k + 1)) - mp.cos((k - 1) * turn) / (
                        2 * (k - 1)
                    )
                    lower = mpf((-1) ** (k + 1)) / (2 * (k + 1)) - mpf((-1) ** (k - 1)) / (
                        2 * (k - 1)
                    )
                    integral.append(upper - lower)
            row = []
            for j in range(n + 1):
                weight = mpf(0)
                for k in range(n + 1):
                    end = (mpf("0.5") if k in (0, n) else 1) * (mpf("0.5") if j in (0, n) else 1)
                    weight += integral[k] * end * (-1) ** k * mp.cos(mp.pi * k * j / n) * mpf(2) / n
                row.append(weight)
            rows.append(row)
        psi = [mp.pi * (1 + node) / 2 for node in z]
        half_turn = [[whole(mp.pi / 2 * weight) for weight in row] for row in rows]
        return [mp.cos(p) for p in psi], [mp.sin(p) for p in psi], half_turn


@dataclass
class MpmathPendulum:
    """Eq. 8 to 40 digits; the numbers are taken as they stand (`mpf` of the floats, or `mpf`)."""

    omega: Any
    quadratic: Any = 0
    hysteretic: Any = 0
    viscous: Any = 0
    coulomb: Any = 0

    @classmethod
    def of(cls, model: Eq8) -> "MpmathPendulum":
        """Return the same pendulum."""
        numbers = (
            model.angular_frequency,
            model.quadratic,
            model.hysteretic,
            model.viscous,
            model.coulomb,
        )
        return cls(*(mpf(number) for number in numbers))

    def forces(self) -> tuple[Any, Any, Any, Any]:
        """Return f_c, f_h, f_q and 2 b_v of Eq. 8."""
        return (
            mp.pi * self.omega * self.coulomb / 2,
            mp.pi * self.hysteretic / 2,
            mp.pi * self.quadratic / (2 * self.omega),
            2 * self.viscous,
        )

    def half_cycle(self, y: Any) -> tuple[Any, Any]:
        """Return the next amplitude and the duration in s."""
        with mp.workdps(DIGITS):
            f_c, f_h, f_q, damping = self.forces()
            w = self.omega
            shift, h, q, g = f_c / w**2, f_h / w, f_q, damping / w
            cos, sin, matrix = collocation()
            start = y - shift
            r = [start] * len(cos)
            for _ in range(60):
                slope, clock = [], []
                for radius, c, s in zip(r, cos, sin, strict=True):
                    x, u = shift + radius * c, -radius * s
                    square = x * x + u * u
                    push = h * mp.sqrt(square) + q * square - g * u
                    turning = radius / (radius - push * c)
                    slope.append(-push * s * turning)
                    clock.append(turning)
                slopes = [whole(value) for value in slope]
                new = [start + summed(row, slopes) for row in matrix]
                # At the end and in the middle: an error of Picard's iteration is smooth.
                change = max(abs(new[j] - r[j]) for j in (NODES // 4, NODES // 2, NODES))
                r = new
                if change < mpf(10) ** (4 - DIGITS) * start:
                    break
            duration = summed(matrix[-1], [whole(value) for value in clock])
            return r[-1] - shift, duration / w

    def turning_points(self, y: Any, count: int) -> tuple[list[Any], list[Any]]:
        """Return the times and the signed angles of `count` turning points."""
        times, angles, sign = [mpf(0)], [mpf(y)], 1
        y = mpf(y)
        while len(times) < count:
            y, duration = self.half_cycle(y)
            sign = -sign
            times.append(times[-1] + duration)
            angles.append(sign * y)
        return times, angles

    def after(self, angle: Any, seconds: Any) -> tuple[Any, Any]:
        """Return angle and velocity some time after a turning point, within its half cycle."""
        f_c, f_h, f_q, damping = self.forces()
        w, side = self.omega, mp.sign(angle)

        def rates(_t: Any, state: Any) -> list[Any]:
            x, v = state
            square = w**2 * x**2 + v**2
            friction = f_c + f_h * mp.sqrt(square) + f_q * square
            return [v, side * friction - damping * v - w**2 * x]

        x, v = mpmath.odefun(rates, 0, [mpf(angle), mpf(0)])(seconds)
        return x, v

    def angle_at(self, y: Any, seconds: Any) -> Any:
        """Return the angle at a time since the release."""
        times, angles = [mpf(0)], [mpf(y)]
        while True:
            amplitude, duration = self.half_cycle(abs(angles[-1]))
            if times[-1] + duration > seconds:
                return self.after(angles[-1], seconds - times[-1])[0]
            times.append(times[-1] + duration)
            angles.append(-mp.sign(angles[-1]) * amplitude)


@functools.cache
def _heyoka_integrator(restoring: str) -> tuple[Any, list[tuple[float, float]]]:
    """Return an integrator of the half cycle from the right to the left, and the log of its end."""
    heyoka = pytest.importorskip("heyoka", reason="heyoka is not installed")
    x, v = heyoka.make_vars("x", "v")
    f_c, f_h, f_q, damping, omega2 = (heyoka.par[i] for i in range(5))
    sine = restoring == "sine"
    square = v**2 + omega2 * (4.0 * heyoka.sin(0.5 * x) ** 2 if sine else x**2)
    friction = f_c + f_h * heyoka.sqrt(square) + f_q * square
    torque = omega2 * (heyoka.sin(x) if sine else x)
    log: list[tuple[float, float]] = []

    def turned(integrator: Any, _slope: int) -> bool:
        log.append((integrator.time, float(integrator.state[0])))
        return False

    # The velocity falls from zero at the start, and rises to zero at the end.
    event = heyoka.t_event(v, callback=turned, direction=heyoka.event_direction.positive)
    integrator = heyoka.taylor_adaptive(
        [(x, v), (v, friction - torque - damping * v)],
        [1.0, 0.0],
        pars=[0.0] * 5,
        tol=1e-16,
        t_events=[event],
    )
    return integrator, log


def _released(model: Eq8, amplitude: float) -> tuple[Any, list[tuple[float, float]], float]:
    """Return heyoka's half cycle from an amplitude, the log of its end, and the unit of angle."""
    integrator, log = _heyoka_integrator(model.restoring)
    w = model.angular_frequency
    # In units of the amplitude: below 1 heyoka's tolerance is absolute. (sin x has no unit.)
    unit = amplitude if model.restoring == "linear" else 1.0
    integrator.pars[:] = [
        math.pi * w * model.coulomb / 2 / unit,
        math.pi * model.hysteretic / 2,
        math.pi * model.quadratic / (2 * w) * unit,
        2 * model.viscous,
        w**2,
    ]
    integrator.time, integrator.state[:] = 0.0, [amplitude / unit, 0.0]
    integrator.reset_cooldowns()
    log.clear()
    return integrator, log, unit


def heyoka_turning_points(
    model: Eq8, y: float, count: int, moves: Any = lambda _: True
) -> tuple[np.ndarray, np.ndarray]:
    """Return turning points by heyoka; `moves(amplitude)` is whether the pendulum leaves one."""
    times, angles = [0.0], [y]
    while len(times) < count and moves(abs(angles[-1])):
        integrator, log, unit = _released(model, abs(angles[-1]))
        integrator.propagate_until(100.0 * math.pi / model.angular_frequency)
        ((duration, angle),) = log
        times.append(times[-1] + duration)
        angles.append(math.copysign(unit, angles[-1]) * angle)
    return np.array(times), np.array(angles)


def heyoka_samples(model: Eq8, y: float, time_s: np.ndarray) -> np.ndarray:
    """Return the angles at ascending times, half cycle after half cycle."""
    count = int(model.angular_frequency * time_s[-1] / math.pi) + 2
    times, angles = heyoka_turning_points(model, y, count)
    found = np.empty(len(time_s))
    for begin, end, start in zip(times, times[1:], angles, strict=False):
        integrator, _, unit = _released(model, abs(start))
        for i in np.flatnonzero((time_s >= begin) & (time_s < end)):
            integrator.propagate_until(time_s[i] - begin)
            found[i] = math.copysign(unit, start) * integrator.state[0]
    return found


STRETCH = 8
"""Half cycles that are too few for the engine to tabulate: it solves them one by one."""


def turning_points_in_stretches(
    model: Eq8, release: Release, count: int
) -> tuple[np.ndarray, np.ndarray]:
    """Return turning points, the motion taken up anew at every eighth of them."""
    times, angles = np.array([release.time_s]), np.array([release.angle_rad])
    while len(times) < count:
        release = Release(float(times[-1]), float(angles[-1]))
        points = turning_points(model, release, count=min(STRETCH + 1, count + 1 - len(times)))
        times, angles = np.append(times, points.time_s[1:]), np.append(angles, points.angle_rad[1:])
        if points.stopped:
            break
    return times, angles


def samples_in_stretches(
    model: Eq8, release: Release, time_s: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return samples and Jacobian, the motion taken up anew at every eighth turning point."""
    angle, jacobian = np.empty(len(time_s)), np.empty((len(time_s), 8))
    first, carried = 0, np.eye(8)
    while True:
        points, times, angles = turning_points_with_jacobian(model, release, STRETCH + 1)
        end = float(points.time_s[-1])
        last = len(time_s) if points.stopped else int(np.searchsorted(time_s, end))
        angle[first:last], own = sample_with_jacobian(model, release, time_s[first:last])
        jacobian[first:last] = own @ carried
        if last == len(time_s):
            return angle, jacobian
        # The next release, by the parameters of this stretch: its angle is without the offset.
        step = np.eye(8)
        step[5], step[6] = angles[-1], times[-1]
        step[5, 7] -= 1.0
        carried = step @ carried
        release = replace(release, time_s=end, angle_rad=points.angle_rad[-1] - release.offset_rad)
        first = last
