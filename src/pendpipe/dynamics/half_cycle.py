"""One half cycle of Eq. 8 by the phase clock: panel after panel, halved where it must be.

What a half cycle hands on is one row of numbers, the same whether it was solved here or read
from the table (`table.py`):

    [0]  ln(y/y'), the loss of amplitude          [1]  duration in radians, less pi
         (for the sine ln(y C'/(C y')), the loss of `panel.log_amplitude`)
    [HEAD ...]  for each sensitivity (the amplitude y at the start, then the rates)
                dy'/dy or (dy'/dp)/y, and after these y dtau/dy or dtau/dp
    then for each panel   tau - w at its end, and the polynomials of degree 16 in time:
                x/y, dx/dy, (dx/dp)/y at fixed time since the start of the half cycle.

An amplitude y is one of s (see `panel.py`), x is the angle.

Its derivatives are plain quadratures. Differentiating the phase clock's equation for s = ln r by
any parameter p gives a linear equation for sigma = ds/dp at fixed phase, solved by its integrating
factor,

    dsigma/dpsi = F_s sigma + F_p,        F = -nu sin(psi)/(1 - nu cos(psi)),

and then dtau/dp by one more integral (both taken over w, see `panel.py`). Turning points stay at
psi = 0 and pi whatever p is, so there is no jump in the friction to differentiate through.
"""

from __future__ import annotations

import math

import numpy as np

from pendpipe.arrays import FloatArray
from pendpipe.dynamics.chebyshev import INTEGRATION_T
from pendpipe.dynamics.kernel import Matrix, kernel
from pendpipe.dynamics.layout import DEGREE, HEAD, NODE_COUNT, SLOTS, Work
from pendpipe.dynamics.panel import (
    BEND,
    BY_CENTRE,
    BY_H,
    BY_Q,
    BY_RADIUS,
    COLUMN,
    COS,
    CURVATURE,
    EXCESS,
    FORCING,
    GROWTH,
    LAG,
    LEAN,
    LOSS,
    PULL,
    SCRATCH,
    SIN,
    SLIP,
    TILT,
    VISCOUS,
    WEIGHT,
    angle_of,
    curve,
    drag_lever,
    horner,
    multiply,
    place,
    polynomial,
    solve,
    time_nodes,
    unresolved,
)


@kernel()
def _differentiate(node: FloatArray, shape: FloatArray, radius: float) -> None:
    """Write the derivatives of nu by ln r, m, h and q (by g it is 2 sin(psi)/C), and their weights.

    PULL is the weight of nu in dln r/dw and LAG in dtau/dw, TILT that of s in dtau/dw. What comes
    of 1/C, and of what the sine adds to C nu, vanishes for the linear torque.
    """
    m, h, q, g = shape[0], shape[1], shape[2], shape[VISCOUS]
    k, centre = shape[CURVATURE], curve(shape, m)
    for j in range(NODE_COUNT):
        cos, bend = node[COS + j], node[BEND + j]
        r = radius * (1.0 + node[LOSS + j])
        s = m + r * cos
        distance = math.sqrt(abs(r * r + m * (2.0 * r * cos + m)))
        inverse = 1.0 / (distance + m)
        # Where s and u vanish together R has no derivative; its direction is then of no weight.
        direction = 1.0 / distance if distance > 0.0 else 0.0
        lever = r + 2.0 * m * cos
        sin = node[SIN + j]
        drag = drag_lever(shape, lever, r, sin)
        drop = lever * h * inverse * inverse
        nu = (lever * h * inverse + q * drag + 2.0 * g * sin + node[LEAN + j]) * bend
        # d ln(1/C)/ds, and the same of the sum C + C(m) in the denominator of LEAN
        steeper = 0.25 * k * s * bend * bend
        whole = 1.0 / (1.0 / bend + centre)
        by_s, by_m = 0.25 * s * bend * whole, 0.25 * m / centre * whole
        scale = 0.25 * k * cos * whole * bend
        by_r, by_centre = drag_lever(shape, r, r, sin), drag_lever(shape, 2.0 * cos, 0.0, sin)
        node[BY_RADIUS + j] = r * (h * inverse - drop * (r + m * cos) * direction) * bend
        node[BY_RADIUS + j] += q * by_r * bend
        node[BY_RADIUS + j] += r * cos * (scale * m * (1.0 + (s + m) * by_s) + nu * steeper)
        node[BY_CENTRE + j] = 2.0 * cos * h * inverse + q * by_centre
        node[BY_CENTRE + j] = (node[BY_CENTRE + j] - drop * (1.0 + s * direction)) * bend
        node[BY_CENTRE + j] += scale * (s + m + m * (2.0 + (s + m) * (by_s + by_m))) + nu * steeper
        node[BY_H + j] = lever * inverse * bend
        node[BY_Q + j] = drag * bend
        weight = node[WEIGHT + j] * node[SLIP + j] ** 2
        node[PULL + j] = -weight * node[SIN + j]
        node[LAG + j] = weight * cos * bend
        node[TILT + j] = node[WEIGHT + j] * node[SLIP + j] * bend * steeper


@kernel()
def _grow(node: FloatArray, half_width: float) -> None:
    """Write the integrating factor exp(integral of F_s)."""
    for j in range(NODE_COUNT):
        node[SCRATCH + j] = node[PULL + j] * node[BY_RADIUS + j]
    multiply(INTEGRATION_T, node, SCRATCH, node, GROWTH)
    for j in range(NODE_COUNT):
        node[GROWTH + j] = math.exp(half_width * node[GROWTH + j])


@kernel()
def sensitivities(work: Work, node: FloatArray, radius: float, half_width: float) -> None:
    """Differentiate a solved panel, at fixed time, by the amplitude and along the directions.

    `work.sigma` and `work.shift` hold d ln r/dp and dtau/dp at fixed phase at the start of the
    panel, and on return at its end; entry 0 is by the amplitude at the start of the half cycle,
    then come the directions. `work.columns` receives dx/dp at fixed time at the nodes, a row each.

    Parameters
    ----------
    work
        The engine's arrays.
    node, radius, half_width
        As in `panel.solve`, after it.
    """
    shape, directions = work.shape, work.directions
    sigma, shift, columns = work.sigma, work.shift, work.columns
    _differentiate(node, shape, radius)
    _grow(node, half_width)
    for c in range(work.sensitivities):
        dm, dh, dq, dg = directions[c, 0], directions[c, 1], directions[c, 2], directions[c, 3]
        column = columns[c]
        for j in range(NODE_COUNT):
            node[FORCING + j] = (
                dm * node[BY_CENTRE + j]
                + dh * node[BY_H + j]
                + dq * node[BY_Q + j]
                + 2.0 * dg * node[SIN + j] * node[BEND + j]
            )
            node[SCRATCH + j] = node[PULL + j] * node[FORCING + j] / node[GROWTH + j]
        multiply(INTEGRATION_T, node, SCRATCH, node, COLUMN)
        for j in range(NODE_COUNT):
            column[j] = node[GROWTH + j] * (sigma[c] + half_width * node[COLUMN + j])
            r = radius * (1.0 + node[LOSS + j])
            moved = dm + r * node[COS + j] * column[j]  # ds/dp at fixed phase
            node[SCRATCH + j] = (
                node[LAG + j] * (node[BY_RADIUS + j] * column[j] + node[FORCING + j])
                + node[TILT + j] * moved
            )
        multiply(INTEGRATION_T, node, SCRATCH, node, COLUMN)
        sigma_end = column[DEGREE]
        for j in range(NODE_COUNT):
            r = radius * (1.0 + node[LOSS + j])
            delay = shift[c] + half_width * node[COLUMN + j]
            moved = dm + r * node[COS + j] * column[j]
            column[j] = moved * node[BEND + j] + r * node[SIN + j] * delay
        sigma[c] = sigma_end
        shift[c] += half_width * node[COLUMN + DEGREE]


_BLOCK = 16
"""Readings in whole multiples of which a panel is evaluated: loops without remainders."""


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
    sign, first_sign = work.sign, work.first_sign
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


@kernel()
def emit(
    work: Work,
    time_s: FloatArray,
    out: Matrix,
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
    time_s, out
        When samples are wanted; and where the angle (row 0) and its Jacobian are written.
    polynomials
        Of the panel, as in a row of `half_cycle.py`.
    start, duration
        Of the panel, in radians since the release.
    first, guess
        The index of the first sample, and about how many lie in the panel.
    """
    omega, release_s = work.omega, work.release_s
    end = samples_before(time_s, first, release_s + (start + duration) / omega, guess)
    if end == first:
        return end
    combine(work, polynomials, duration, y)
    work.total[0, 0] += work.offset
    # Whole blocks keep the loops free of remainders; what is written past the panel's end is
    # written again by the next panel (or as rest).
    last = min(first + math.ceil((end - first) / _BLOCK) * _BLOCK, time_s.size)
    at = first
    while at < last:
        stop = min(last, at + work.theta.size)
        z, t = work.theta[: stop - at], time_s[at:stop]
        for i in range(z.size):
            z[i] = ((t[i] - release_s) * omega - start) * (2.0 / duration) - 1.0
        horner(work.total[0], z, out[0, at:stop])
        if work.sensitivities > 0:
            _emit_derivatives(work, z, t, out, at)
        at = stop
    return end


def _derivatives(work: Work, theta: FloatArray, time_s: FloatArray, out: Matrix, at: int) -> None:
    rates, into = work.rates, out[1:, at : at + theta.size]
    powers = np.vander(theta, NODE_COUNT, increasing=True)
    by_time, by_release, *columns = work.total[1 : rates + 3] @ powers.T
    into[:rates] = columns
    late = (time_s - work.release_s) * by_time
    into[rates] = late - work.rate[:rates] / work.omega @ into[:rates]
    into[rates + 1], into[rates + 2] = by_release, -work.omega * by_time


@kernel(arrays=_derivatives)
def _emit_derivatives(
    work: Work, theta: FloatArray, time_s: FloatArray, out: Matrix, at: int
) -> None:
    """Write the columns of the Jacobian for a block of samples."""
    omega, release_s, directions = work.omega, work.release_s, work.rates
    stop = at + theta.size
    by_omega, by_time = out[directions + 1, at:stop], out[directions + 3, at:stop]
    horner(work.total[1], theta, by_time)
    horner(work.total[2], theta, out[directions + 2, at:stop])
    # By omega at fixed rates: time runs faster, and delta, h, q, g fall as 1/omega.
    for i in range(theta.size):
        by_omega[i] = (time_s[i] - release_s) * by_time[i]
        by_time[i] *= -omega
    for c in range(directions):
        column, rate = out[c + 1, at:stop], work.rate[c] / omega
        horner(work.total[3 + c], theta, column)
        for i in range(theta.size):
            by_omega[i] -= rate * column[i]


@kernel()
def rest(work: Work, out: Matrix, y: float, first: int) -> None:
    """Write the samples after the stop: the last turning point, exactly."""
    directions = work.rates
    out[0, first:] = work.sign * angle_of(work.shape, y) + work.offset
    if work.sensitivities == 0:
        return
    side = work.sign / curve(work.shape, y)
    by_omega = 0.0
    for c in range(directions):
        by_rate = side * work.amplitude[c + 1]
        by_omega -= work.rate[c] / work.omega * by_rate
        out[c + 1, first:] = by_rate
    out[directions + 1, first:] = by_omega
    out[directions + 2, first:] = side * work.first_sign * work.amplitude[0]
    out[directions + 3, first:] = 0.0


LOSS_TOLERANCE = 5e-9
"""Bound of `solve`'s estimate, a thousand times the error: that is 5e-12 of a half cycle's loss."""
WAVEFORM_TOLERANCE, SINE_TOLERANCE = 1e-12, 2e-11
"""Of the polynomial in time, relative to the amplitude."""
FINEST = 30
"""The finest panel is a half cycle halved so often; it is accepted as it is."""


@kernel()
def _start(work: Work, radius: float) -> None:
    """Set d ln r/dp and dtau/dp at the turning point y = m + r."""
    for c in range(work.sensitivities):
        work.sigma[c] = ((1.0 if c == 0 else 0.0) - work.directions[c, 0]) / radius
        work.shift[c] = 0.0


@kernel()
def _end(work: Work, radius: float, y: float, row: FloatArray) -> None:
    """Write the derivatives of the next turning point, y' = r - m, to the row's head."""
    columns = work.sensitivities
    for c in range(columns):
        row[HEAD + c] = (radius * work.sigma[c] - work.directions[c, 0]) / (1.0 if c == 0 else y)
        row[HEAD + columns + c] = (y if c == 0 else 1.0) * work.shift[c]


@kernel()
def _solve_panel(
    work: Work,
    node: FloatArray,
    radius: float,
    p: int,
    panels: int,
    y: float,
    complement: float,
    finest: bool,
    polynomials: FloatArray,
) -> bool:
    """Solve panel p of `panels` with all that is asked of it; return whether it is resolved."""
    half_width = 0.5 * math.pi / panels
    place(node, 2.0 * p * half_width, half_width, complement)
    tolerance = math.inf if finest else LOSS_TOLERANCE
    if not solve(node, work.shape, radius, half_width, tolerance):
        return False
    timed = polynomials.size > 0
    if timed and not (_in_time(work, node, radius, half_width, y, polynomials) or finest):
        return False
    if work.sensitivities == 0:
        return True
    sensitivities(work, node, radius, half_width)
    for c in range(work.sensitivities if timed else 0):
        column = work.columns[c]
        for j in range(NODE_COUNT):
            column[j] /= 1.0 if c == 0 else y
        polynomial(node, column, work.chebyshev, polynomials, (c + 1) * NODE_COUNT)
    return True


@kernel()
def _in_time(
    work: Work,
    node: FloatArray,
    radius: float,
    half_width: float,
    y: float,
    polynomials: FloatArray,
) -> bool:
    """Write a solved panel's waveform as a polynomial in time; return whether that resolves it."""
    time_nodes(node, half_width, work.chebyshev)
    waveform = work.columns[work.sensitivities]
    for j in range(NODE_COUNT):
        s = work.shape[0] + radius * (1.0 + node[LOSS + j]) * node[COS + j]
        waveform[j] = angle_of(work.shape, s) / y
    polynomial(node, waveform, work.chebyshev, polynomials, 0)
    bent = work.shape[CURVATURE] > 0.0
    return unresolved(waveform, 0) <= (SINE_TOLERANCE if bent else WAVEFORM_TOLERANCE)


@kernel()
def half_cycle(
    work: Work,
    time_s: FloatArray,
    out: Matrix,
    row: FloatArray,
    y: float,
    complement: float,
    begin: float,
    level: int,
    first: int,
    guess: int,
    even: bool,
) -> tuple[float, float, int, int]:
    """Solve a half cycle on panels as fine as it needs, and write its samples.

    `complement` is that of `panel.place`, `begin` its start in radians since the release, and
    `level` the number of halvings to begin with; `even` keeps it to these, writes no samples, and
    leaves all panels in `row`. Returns the amplitude at its end (negative if the pendulum stops
    before it reaches its equilibrium), its duration less pi, the index of the next sample, and the
    number of halvings it began with, which is negative if the pendulum is overdamped, or the even
    panels do not resolve the half cycle.
    """
    m = work.shape[0]
    radius = y - m
    _start(work, radius)
    change, excess, k = 0.0, 0.0, 0
    coarsest = -1
    width = work.polynomials * NODE_COUNT
    while k < 1 << level:
        panels = 1 << level
        node = work.nodes[(panels + k) % SLOTS]
        at = work.head + (k * work.per_panel if even else 0)
        own = row[at + 1 : at + 1 + width]
        finest = level >= FINEST
        if not _solve_panel(
            work, node, radius * (1.0 + change), k, panels, y, complement, finest, own
        ):
            if finest or even:
                return y, 0.0, first, -1
            level, k = level + 1, 2 * k
            continue
        if coarsest < 0:
            coarsest = level
        if width > 0 and not even:
            begins = begin + math.pi * k / panels + excess
            duration = math.pi / panels + node[EXCESS + DEGREE]
            end = emit(work, time_s, out, own, begins, duration, y, first, guess)
            first, guess = end, end - first
        excess += node[EXCESS + DEGREE]
        if width > 0:
            row[at] = excess
        change += node[LOSS + DEGREE] * (1.0 + change)
        k += 1
        if k % 2 == 0 and level > 0 and not even:
            k, level = k // 2, level - 1
    end_radius = radius * (1.0 + change)
    gain = radius * change - 2.0 * m
    row[0] = -math.log1p(gain / y)
    if work.shape[CURVATURE] > 0.0:
        row[0] += 0.5 * math.log1p(-0.25 * gain * (2.0 * y + gain) / curve(work.shape, y) ** 2)
    row[1] = excess
    _end(work, end_radius, y, row)
    return end_radius - m, excess, first, coarsest
