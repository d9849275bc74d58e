"""Samples, and their derivatives, from the polynomials of one panel."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from pendpipe.dynamics.layout import NODE_COUNT
from pendpipe.dynamics.panel import kernel, part

if TYPE_CHECKING:
    from pendpipe.arrays import FloatArray
    from pendpipe.dynamics.workspace import Work

_BLOCK = 16


@kernel
def horner(c: FloatArray, theta: FloatArray, out: FloatArray) -> None:
    """Evaluate the polynomial of degree 16 with coefficients `c` at `theta`.

    Written out, so that the compiler keeps the coefficients in registers.
    """
    c0, c1, c2, c3, c4, c5, c6, c7, c8 = c[0], c[1], c[2], c[3], c[4], c[5], c[6], c[7], c[8]
    c9, c10, c11, c12, c13, c14, c15, c16 = c[9], c[10], c[11], c[12], c[13], c[14], c[15], c[16]
    for i in range(theta.size):
        z = theta[i]
        upper = ((((((((c16 * z + c15) * z + c14) * z + c13) * z + c12) * z) + c11) * z) + c10) * z
        lower = ((((((upper + c9) * z + c8) * z + c7) * z + c6) * z + c5) * z + c4) * z
        out[i] = (((lower + c3) * z + c2) * z + c1) * z + c0


@kernel
def samples_before(time_s: FloatArray, first: int, end_s: float, guess: int) -> int:
    """Return the index of the first sample from `first` on that is not before `end_s`."""
    i = min(first + guess, time_s.size)
    while i > first and not time_s[i - 1] < end_s:
        i -= 1
    while i < time_s.size and time_s[i] < end_s:
        i += 1
    return i


@kernel
def combine(
    polynomials: FloatArray,
    duration: float,
    y: float,
    sign: float,
    first_sign: float,
    amplitude: FloatArray,
    clock: FloatArray,
    total: FloatArray,
) -> None:
    """Turn a half cycle's own derivatives into those by the parameters of the whole motion.

    Row 0 of `total` is the angle, row 1 its velocity dx/dtau, row 2 the derivative by the
    release's angle, then the directions: dx/dp = x_p + x_y dy/dp - (dx/dtau) dtau/dp, with
    dy/dp = `amplitude` and dtau/dp = `clock` at the turning point where the half cycle starts.
    """
    columns = amplitude.size
    for j in range(NODE_COUNT):
        total[0, j] = sign * y * polynomials[j]
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
        for j in range(NODE_COUNT):
            total[2 + c, j] = outer * (
                weight * own[j] + sign * amplitude[c] * by_start[j] - clock[c] * total[1, j]
            )


@part
def emit(
    work: Work, polynomials: FloatArray, start: float, duration: float, y: float,
    signs: FloatArray, time_s: FloatArray, first: int, guess: int, angle_rad: FloatArray,
    jacobian: FloatArray,
) -> int:  # fmt: skip
    """Write the samples of one panel; return the index of the first sample after it.

    Parameters
    ----------
    polynomials
        Of the panel, as in a row of `half_cycle.py`.
    start, duration
        Of the panel, in radians since the release.
    signs
        The side of the turning point before the panel, and that of the release.
    first, guess
        The index of the first sample, and about how many lie in the panel.
    jacobian
        (rates + 4, samples): by the rates, omega, the release's angle and time, the offset.
    """
    omega, release_s = work.motion[0], work.motion[1]
    end = samples_before(time_s, first, release_s + (start + duration) / omega, guess)
    if end == first:
        return end
    combine(polynomials, duration, y, signs[0], signs[1], work.amplitude, work.clock, work.total)
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
        if work.amplitude.size > 0:
            _emit_derivatives(work, z, t, jacobian, at)
        at = stop
    return end


@part
def _emit_derivatives(
    work: Work, theta: FloatArray, time_s: FloatArray, jacobian: FloatArray, at: int
) -> None:
    """Write the columns of the Jacobian for a block of samples."""
    omega, release_s, directions = work.motion[0], work.motion[1], work.rates.size
    stop = at + theta.size
    by_omega, by_time = jacobian[directions, at:stop], jacobian[directions + 2, at:stop]
    horner(work.total[1], theta, by_time)
    horner(work.total[2], theta, jacobian[directions + 1, at:stop])
    # By omega at fixed rates: time runs faster, and delta, h, q, g fall as 1/omega.
    for i in range(theta.size):
        by_omega[i] = (time_s[i] - release_s) * by_time[i]
        by_time[i] *= -omega
    for c in range(directions):
        column, rate = jacobian[c, at:stop], work.rates[c] / omega
        horner(work.total[3 + c], theta, column)
        for i in range(theta.size):
            by_omega[i] -= rate * column[i]


@part
def rest(
    work: Work, y: float, signs: FloatArray, first: int, angle_rad: FloatArray,
    jacobian: FloatArray,
) -> None:  # fmt: skip
    """Write the samples after the stop: the last turning point, exactly."""
    directions, omega = work.rates.size, work.motion[0]
    for i in range(first, angle_rad.size):
        angle_rad[i] = signs[0] * y + work.motion[2]
    if work.amplitude.size == 0:
        return
    by_omega = 0.0
    for c in range(directions):
        by_rate = signs[0] * work.amplitude[c + 1]
        by_omega -= work.rates[c] / omega * by_rate
        for i in range(first, angle_rad.size):
            jacobian[c, i] = by_rate
    for i in range(first, angle_rad.size):
        jacobian[directions, i] = by_omega
        jacobian[directions + 1, i] = signs[0] * signs[1] * work.amplitude[0]
        jacobian[directions + 2, i] = 0.0
