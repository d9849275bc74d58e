"""Half cycle after half cycle, from the release to the last sample or to the stop."""

from __future__ import annotations

import math

from pendpipe.arrays import FloatArray
from pendpipe.dynamics.half_cycle import direct_half_cycle, emit, rest
from pendpipe.dynamics.kernel import kernel
from pendpipe.dynamics.layout import (
    ENDINGS,
    HEAD,
    MOST_PANELS,
    OVERDAMPED,
    RUNNING,
    SLOTS,
    STOPPED,
    Work,
)
from pendpipe.dynamics.panel import (
    CURVATURE,
    PLACED,
    amplitude_at,
    angle_of,
    curve,
    log_amplitude,
    panel_width,
    row_width,
)
from pendpipe.dynamics.table import (
    DONE,
    HIGH,
    LOW,
    MORE_PANELS,
    NARROWEST,
    PANELS,
    SMOOTH_FROM,
    build,
    half_cycles_and_span,
    look_up,
    look_up_turning_point,
    points_for,
    widest,
)


@kernel
def sticks(shape: FloatArray, y: float) -> bool:
    """Return whether the pendulum, at rest at amplitude y, stays: delta + h y + q y^2 >= y C(y).

    So it does, for all that could ever matter, below 1e-120 rad, where squares soon underflow.
    """
    m, h, q = shape[0], shape[1], shape[2]
    if y <= m or y < 1e-120:
        return True
    # The friction less the restoring torque is (y - m) [h + q (y + m) - (y C(y) - m C(m))/(y - m)].
    squares = 0.25 * shape[CURVATURE] * (y * y + m * m)
    slope = (y + m) * (1.0 - squares) / (y * curve(shape, y) + m * curve(shape, m))
    return bool(h + q * (y + m) >= slope)


@kernel
def _advance(work: Work, y: float) -> None:
    """Carry dy/dp and dtau/dp over the half cycle in `work.row`, which started at y."""
    row, columns = work.row, work.sensitivities
    for c in range(columns):
        before = work.amplitude[c]
        work.amplitude[c] = row[HEAD] * before
        work.clock[c] += row[HEAD + columns] / y * before
        if c > 0:
            work.amplitude[c] += y * row[HEAD + c]
            work.clock[c] += row[HEAD + columns + c]


@kernel
def _lay_out(work: Work, log_y: float, half_cycles: float) -> bool:
    """Tabulate from ln y downwards if it pays; else note how far to go without a table.

    `work.wanted` holds the number of panels last used, and the ln y down to which no table is
    tried.
    """
    wanted = work.wanted
    room = widest(work.shape, log_y)
    if work.shape[0] > 0.0:
        room = min(room, log_y - math.log(SMOOTH_FROM * work.shape[0]))
    count, span = half_cycles_and_span(work.shape, log_y, half_cycles, room)
    panels = max(1, int(wanted[0]) // 2)  # what is smaller may need fewer
    while count > 1.5 * points_for(work.shape, log_y, span) and span >= NARROWEST:
        outcome = build(work, log_y, span, panels)
        if outcome == DONE:
            wanted[0] = panels
            return True
        if outcome == MORE_PANELS and panels < MOST_PANELS:
            panels *= 2
        else:
            span *= 0.5
            count *= 0.5
    wanted[1] = log_y - span
    return False


@kernel
def _record(work: Work, k: int, tau: float, y: float) -> None:
    """Write the time and the angle of turning point k, and their derivatives if there is room."""
    omega, release_s, offset = work.motion[0], work.motion[1], work.motion[2]
    turning, signs = work.turning, work.signs
    turning[0, k] = release_s + tau / omega
    turning[1, k] = signs[0] * angle_of(work.shape, y) + offset
    directions, columns = work.rates, work.sensitivities
    if columns == 0:
        return
    times, angles = turning[2 : 2 + directions + 4, k], turning[6 + directions :, k]
    bend = curve(work.shape, y)
    times[directions], angles[directions] = -tau / (omega * omega), 0.0
    for c in range(directions):
        times[c] = work.clock[c + 1] / omega
        angles[c] = signs[0] * work.amplitude[c + 1] / bend
        times[directions] -= work.rate[c] / omega * times[c]
        angles[directions] -= work.rate[c] / omega * angles[c]
    times[directions + 1] = signs[1] * work.clock[0] / omega
    angles[directions + 1] = signs[0] * signs[1] * work.amplitude[0] / bend
    times[directions + 2], angles[directions + 2] = 1.0, 0.0
    times[directions + 3], angles[directions + 3] = 0.0, 1.0


@kernel
def _emit_row(work: Work, y: float, tau: float, first: int, guess: int) -> tuple[int, int]:
    """Write the samples of a half cycle read from the table."""
    row, panels = work.row, int(work.segment[PANELS])
    width, at, start = panel_width(work.polynomials), HEAD + 2 * work.sensitivities, 0.0
    for p in range(panels):
        end = math.pi * (p + 1) / panels + row[at]
        own = row[at + 1 : at + width]
        stop = emit(work, own, tau + start, end - start, y, first, guess)
        first, guess, at, start = stop, stop - first, at + width, end
    return first, guess


@kernel
def _begin(work: Work) -> float:
    """Forget what an earlier call left in the workspace; return the amplitude of the release."""
    shape, angle = work.shape, work.limits[0]
    work.segment[LOW], work.segment[HIGH] = 1.0, 0.0  # no table yet
    for slot in range(SLOTS):
        work.nodes[slot, PLACED + 1] = 0.0  # and no panel
    y = 2.0 * math.sin(0.5 * angle) if shape[CURVATURE] > 0.0 else angle
    for c in range(work.sensitivities):
        work.amplitude[c], work.clock[c] = (curve(shape, y) if c == 0 else 0.0), 0.0
    work.wanted[0], work.wanted[1] = 1.0, math.inf
    return y


@kernel
def march(work: Work) -> int:
    """Follow the pendulum from its release.

    Samples are written to `work.angle_rad`, with rates their Jacobian, whose last column, by the
    offset, is left to the caller. Turning points are written as far as there
    is room for them.

    Parameters
    ----------
    work
        The arrays, see `layout.FIELDS`; in `work.limits` the release's angle, positive, and the
        time after which no turning point is wanted (with samples, that of the last of these).
        Python gives the call's integers instead: `layout.ADDRESSES`, `layout.counts`.

    Returns
    -------
    int
        The number of turning points times ENDINGS, plus RUNNING, STOPPED or OVERDAMPED.
    """
    shape, motion, until_s, samples = work.shape, work.motion, work.limits[1], work.samples
    y = _begin(work)
    log_y, excess, k, level, first, guess = log_amplitude(shape, y), 0.0, 0, 0, 0, 0
    while True:
        tau = math.pi * k + excess
        now_s = motion[1] + tau / motion[0]
        if now_s > until_s and samples == 0:
            return ENDINGS * k + RUNNING
        if k < work.room:
            _record(work, k, tau, y)
        k += 1
        if sticks(shape, y):
            rest(work, y, first)
            return ENDINGS * k + STOPPED
        if k >= work.most or (samples > 0 and first >= samples):
            return ENDINGS * k + RUNNING
        listed = work.segment[LOW] <= log_y <= work.segment[HIGH]
        untried = log_y < work.wanted[1] and y > SMOOTH_FROM * shape[0]
        if not listed and untried:
            ahead = min(float(work.most - k), (until_s - now_s) * motion[0] / math.pi) + 2.0
            listed = _lay_out(work, log_y, ahead)
        if listed and work.sensitivities == 0 and samples == 0:
            loss, more = look_up_turning_point(work.segment, work.table, log_y)
            log_y -= loss
            y = amplitude_at(shape, log_y)
            excess += more
        elif listed:
            width = row_width(work.sensitivities, work.polynomials, int(work.segment[PANELS]))
            look_up(work.segment, work.table, log_y, width, work.row)
            if samples > 0:
                first, guess = _emit_row(work, y, tau, first, guess)
            _advance(work, y)
            log_y -= work.row[0]
            y = amplitude_at(shape, log_y)
            excess += work.row[1]
        else:
            if k % 8 == 0 and level > 0:
                level -= 1  # the damping may have eased
            after, more, first, level = direct_half_cycle(work, y, tau, level, first, guess)
            if level < 0:
                return ENDINGS * k + OVERDAMPED
            _advance(work, y)
            y = after
            log_y = log_amplitude(shape, y)
            excess += more
        work.signs[0] = -work.signs[0]
