"""Samples, and their derivatives, from the polynomials of one panel."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from pendpipe.dynamics.kernel import kernel
from pendpipe.dynamics.layout import NODE_COUNT
from pendpipe.dynamics.panel import angle_of, curve, horner

if TYPE_CHECKING:
    from pendpipe.arrays import FloatArray
    from pendpipe.dynamics.layout import Work

_BLOCK = 16


@kernel(inline=True)
def samples_before(time_s: FloatArray, first: int, end_s: float, guess: int) -> int:
    """Return the index of the first sample from `first` on that is not before `end_s`."""
    i = min(first + guess, time_s.size)
    while i > first and not time_s[i - 1] < end_s:
        i -= 1
    while i < time_s.size and time_s[i] < end_s:
        i += 1
    return i


@kernel(inline=True)
def combine(work: Work, polynomials: FloatArray, duration: float, y: float) -> None:
    """Turn a half cycle's own derivatives into those by the parameters of the whole motion.

    Row 0 of `work.total` is the angle, row 1 its velocity dx/dtau, row 2 the derivative by the
    release's angle, then the directions: dx/dp = x_p + x_y dy/dp - (dx/dtau) dtau/dp, with
    dy/dp = `work.amplitude` and dtau/dp = `work.clock` at the turning point where the half cycle
    starts.
    """
    total, amplitude, clock = work.total, work.amplitude, work.clock
    sign, first_sign = work.signs[0], work.signs[1]
    columns = work.sensitivities
    waveform = polynomials[:NODE_COUNT]
    for j in range(waveform.size):
        total[0, j] = sign * y * waveform[j]
    if columns == 0:
        return
    for j in range(NODE_COUNT - 1):
        total[1, j] = 2.0 / duration * (j + 1) * total[0, j + 1]
    total[1, NODE_COUNT - 1] = 0.0
    for c in range(columns):
        own = polynomials[(c + 1) * NODE_COUNT : (c + 2) * NODE_COUNT]
        by_start = polynomials[NODE_COUNT : 2 * NODE_COUNT]
        weight = 0.0 if c == 0 else sign * y
        outer = first_sign if c == 0 else 1.0
        moved, late = outer * sign * amplitude[c], outer * clock[c]
        # Its size unknown to the compiler, or it would write the loop out instead of vectorising.
        for j in range(own.size):
            total[2 + c, j] = outer * weight * own[j] + moved * by_start[j] - late * total[1, j]


@kernel
def emit(
    work: Work,
    polynomials: FloatArray,
    start: float,
    duration: float,
    y: float,
    first: int,
    guess: int,
) -> int:
    """Write the samples of one panel; return the index of the first sample after it.

    Parameters
    ----------
    polynomials
        Of the panel, as in a row of `half_cycle.py`.
    start, duration
        Of the panel, in radians since the release.
    first, guess
        The index of the first sample, and about how many lie in the panel.
    """
    omega, release_s = work.motion[0], work.motion[1]
    time_s, angle_rad = work.time_s, work.angle_rad
    end = samples_before(time_s, first, release_s + (start + duration) / omega, guess)
    if end == first:
        return end
    combine(work, polynomials, duration, y)
    work.total[0, 0] += work.motion[2]
    # Whole blocks keep the loops free of remainders; what is written past the panel's end is
    # written again by the next panel (or as rest).
    last = min(first + math.ceil((end - first) / _BLOCK) * _BLOCK, time_s.size)
    at = first
    while at < last:
        stop = min(last, at + work.theta.size)
        z, t = work.theta[: stop - at], time_s[at:stop]
        for i in range(z.size):
            z[i] = ((t[i] - release_s) * omega - start) * (2.0 / duration) - 1.0
        horner(work.total[0], z, angle_rad[at:stop])
        if work.sensitivities > 0:
            _emit_derivatives(work, z, t, at)
        at = stop
    return end


@kernel
def _emit_derivatives(work: Work, theta: FloatArray, time_s: FloatArray, at: int) -> None:
    """Write the columns of the Jacobian for a block of samples."""
    omega, release_s, directions = work.motion[0], work.motion[1], work.rates
    stop, jacobian = at + theta.size, work.jacobian
    by_omega, by_time = jacobian[directions, at:stop], jacobian[directions + 2, at:stop]
    horner(work.total[1], theta, by_time)
    horner(work.total[2], theta, jacobian[directions + 1, at:stop])
    # By omega at fixed rates: time runs faster, and delta, h, q, g fall as 1/omega.
    for i in range(theta.size):
        by_omega[i] = (time_s[i] - release_s) * by_time[i]
        by_time[i] *= -omega
    for c in range(directions):
        column, rate = jacobian[c, at:stop], work.rate[c] / omega
        horner(work.total[3 + c], theta, column)
        for i in range(theta.size):
            by_omega[i] -= rate * column[i]


@kernel
def rest(work: Work, y: float, first: int) -> None:
    """Write the samples after the stop: the last turning point, exactly."""
    angle_rad, signs = work.angle_rad, work.signs
    level = signs[0] * angle_of(work.shape, y) + work.motion[2]
    for i in range(first, angle_rad.size):
        angle_rad[i] = level
    if work.sensitivities == 0:
        return
    directions, side = work.rates, signs[0] / curve(work.shape, y)
    by_omega = 0.0
    for c in range(directions):
        by_rate = side * work.amplitude[c + 1]
        by_omega -= work.rate[c] / work.motion[0] * by_rate
        _fill(work.jacobian[c, first:], by_rate)
    _fill(work.jacobian[directions, first:], by_omega)
    _fill(work.jacobian[directions + 1, first:], side * signs[1] * work.amplitude[0])
    _fill(work.jacobian[directions + 2, first:], 0.0)


@kernel
def _fill(column: FloatArray, value: float) -> None:
    """Write one value to a part of a column."""
    for i in range(column.size):
        column[i] = value
