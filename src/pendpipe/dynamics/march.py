"""Half cycle after half cycle, from the release to the last sample or to the stop."""

from __future__ import annotations

import math

from pendpipe.arrays import FloatArray
from pendpipe.dynamics.half_cycle import emit, half_cycle, rest
from pendpipe.dynamics.kernel import Matrix, kernel
from pendpipe.dynamics.layout import (
    ENDINGS,
    HEAD,
    MOST_PANELS,
    OVERDAMPED,
    ROW,
    RUNNING,
    SLOTS,
    STOPPED,
    TABLE,
    Work,
)
from pendpipe.dynamics.panel import (
    CURVATURE,
    PLACED,
    amplitude_at,
    angle_of,
    complement_for,
    curve,
    log_amplitude,
    quadratic_at_rest,
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


@kernel()
def sticks(shape: FloatArray, y: float) -> bool:
    """Return whether the pendulum, at rest at amplitude y, stays: delta + h y + q y^2 >= y C(y).

    q is that of `quadratic_at_rest`.

    So it does, for all that could ever matter, below 1e-120 rad, where squares soon underflow.
    """
    m, h, q = shape[0], shape[1], quadratic_at_rest(shape)
    if y <= m or y < 1e-120:
        return True
    # The friction less the restoring torque is (y - m) [h + q (y + m) - (y C(y) - m C(m))/(y - m)].
    squares = 0.25 * shape[CURVATURE] * (y * y + m * m)
    slope = (y + m) * (1.0 - squares) / (y * curve(shape, y) + m * curve(shape, m))
    return bool(h + q * (y + m) >= slope)


@kernel()
def _advance(work: Work, row: FloatArray, y: float) -> None:
    """Carry dy/dp and dtau/dp over a half cycle, which started at y."""
    columns = work.sensitivities
    for c in range(columns):
        before = work.amplitude[c]
        work.amplitude[c] = row[HEAD] * before
        work.clock[c] += row[HEAD + columns] / y * before
        if c > 0:
            work.amplitude[c] += y * row[HEAD + c]
            work.clock[c] += row[HEAD + columns + c]


@kernel()
def _lay_out(work: Work, rows: Matrix, log_y: float, half_cycles: float) -> bool:
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
        outcome = build(work, rows, log_y, span, panels)
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


@kernel()
def _record(work: Work, turning: Matrix, k: int, tau: float, y: float) -> None:
    """Write the time and the angle of turning point k, and their derivatives."""
    omega, sign, first_sign = work.omega, work.sign, work.first_sign
    turning[0, k] = work.release_s + tau / omega
    turning[1, k] = sign * angle_of(work.shape, y) + work.offset
    directions, columns = work.rates, work.sensitivities
    if columns == 0:
        return
    times, angles = turning[2 : 2 + directions + 4, k], turning[6 + directions :, k]
    bend = curve(work.shape, y)
    times[directions], angles[directions] = -tau / (omega * omega), 0.0
    for c in range(directions):
        times[c] = work.clock[c + 1] / omega
        angles[c] = sign * work.amplitude[c + 1] / bend
        times[directions] -= work.rate[c] / omega * times[c]
        angles[directions] -= work.rate[c] / omega * angles[c]
    times[directions + 1] = first_sign * work.clock[0] / omega
    angles[directions + 1] = sign * first_sign * work.amplitude[0] / bend
    times[directions + 2], angles[directions + 2] = 1.0, 0.0
    times[directions + 3], angles[directions + 3] = 0.0, 1.0


@kernel()
def _emit_row(
    work: Work,
    time_s: FloatArray,
    out: Matrix,
    row: FloatArray,
    y: float,
    tau: float,
    first: int,
    guess: int,
) -> tuple[int, int]:
    """Write the samples of a half cycle read from the table."""
    panels = int(work.segment[PANELS])
    width, at, start = work.per_panel, work.head, 0.0
    for p in range(panels):
        end = math.pi * (p + 1) / panels + row[at]
        own = row[at + 1 : at + width]
        stop = emit(work, time_s, out, own, tau + start, end - start, y, first, guess)
        first, guess, at, start = stop, stop - first, at + width, end
    return first, guess


@kernel()
def _begin(work: Work) -> float:
    """Forget what an earlier call left in the workspace; return the amplitude of the release."""
    shape, angle = work.shape, work.release
    work.segment[LOW], work.segment[HIGH] = 1.0, 0.0  # no table yet
    for slot in range(SLOTS):
        work.nodes[slot, PLACED + 1] = 0.0  # and no panel
    y = 2.0 * math.sin(0.5 * angle) if shape[CURVATURE] > 0.0 else angle
    for c in range(work.sensitivities):
        work.amplitude[c], work.clock[c] = (curve(shape, y) if c == 0 else 0.0), 0.0
    work.wanted[0], work.wanted[1] = 1.0, math.inf
    return y


@kernel()
def march(
    work: Work,
    rows: Matrix,
    time_s: FloatArray,
    out: Matrix,
) -> int:
    """Follow the pendulum from its release.

    Parameters
    ----------
    work
        The workspace, see `layout.WORK`, with what is asked for in its first fields; with samples
        `until_s` is the time of the last of these.
    rows
        Room for half cycles, see `layout.ROW`.
    time_s
        When samples are wanted; none for turning points.
    out
        Rows of samples: the angle, and with rates its derivative by every parameter (that by the
        offset, the last, is left to the caller). Or of turning points, as far as there is room:
        time and angle, and with rates the derivatives of both.

    Returns
    -------
    int
        The number of turning points times ENDINGS, plus RUNNING, STOPPED or OVERDAMPED.
    """
    shape, until_s, samples = work.shape, work.until_s, time_s.size
    table, row = rows[TABLE:], rows[ROW]
    y = _begin(work)
    log_y, excess, k, level, first, guess = log_amplitude(shape, y), 0.0, 0, 0, 0, 0
    while True:
        tau = math.pi * k + excess
        now_s = work.release_s + tau / work.omega
        if now_s > until_s and samples == 0:
            return ENDINGS * k + RUNNING
        if samples == 0:
            _record(work, out, k, tau, y)
        k += 1
        if sticks(shape, y):
            if samples > 0:
                rest(work, out, y, first)
            return ENDINGS * k + STOPPED
        if k >= work.most or (samples > 0 and first >= samples):
            return ENDINGS * k + RUNNING
        listed = work.segment[LOW] <= log_y <= work.segment[HIGH]
        untried = log_y < work.wanted[1] and y > SMOOTH_FROM * shape[0]
        if not listed and untried:
            ahead = min(float(work.most - k), (until_s - now_s) * work.omega / math.pi) + 2.0
            listed = _lay_out(work, rows, log_y, ahead)
        if listed and work.sensitivities == 0 and samples == 0:
            loss, more = look_up_turning_point(work.segment, table, log_y)
            log_y -= loss
            y = amplitude_at(shape, log_y)
            excess += more
        elif listed:
            width = work.head + int(work.segment[PANELS]) * work.per_panel
            look_up(work.segment, table, log_y, width, row)
            if samples > 0:
                first, guess = _emit_row(work, time_s, out, row, y, tau, first, guess)
            _advance(work, row, y)
            log_y -= row[0]
            y = amplitude_at(shape, log_y)
            excess += row[1]
        else:
            if k % 8 == 0 and level > 0:
                level -= 1  # the damping may have eased
            complement = complement_for(shape, log_y)
            after, more, first, level = half_cycle(
                work, time_s, out, row, y, complement, tau, level, first, guess, False
            )
            if level < 0:
                return ENDINGS * k + OVERDAMPED
            _advance(work, row, y)
            y = after
            log_y = log_amplitude(shape, y)
            excess += more
        work.sign = -work.sign
