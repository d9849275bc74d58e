"""Raw bytes to a recording: a step of its own that can be repeated at any time.

Where a device marks a loss, the scans that are missing are rows of quality 2. Where it does not,
nothing is moved: the stretch in which something was lost has quality 1, and it is said. Two things
show such a loss. Plain words that are cut across are rough where they were smooth
(`drivers.streams`). And whole scans that are missing make everything after them late by
the recorder's clock: bytes come late, never early, by how much changes with every piece, and other
delays (a busy host) pass. A rate that changes makes them later and later, or earlier and earlier:
the times then follow the recorder's clock on both sides.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Final, Literal

import numpy as np

from pendpipe.acquisition.drivers import find_driver
from pendpipe.acquisition.drivers.base import Driver
from pendpipe.acquisition.drivers.streams import Loss, Scans
from pendpipe.acquisition.raw import NothingRecordedError, RawRecording, check_description, read_raw
from pendpipe.arrays import AnyArray, ByteArray, FloatArray, IntArray
from pendpipe.errors import refuse_if
from pendpipe.recording import GOOD, MISSING, SUSPECT, Recording


@dataclass(frozen=True)
class Delay:
    """A step of the arrivals' lateness that stays.

    Parameters
    ----------
    begin, end
        The arrivals between which it happened, by their index.
    late_s
        By how much at least, in s.
    """

    begin: int
    end: int
    late_s: float


@dataclass(frozen=True)
class Segment:
    """One stream of a recording, from a start of the device to its end.

    Parameters
    ----------
    scans
        What the bytes are.
    arrival_s, made
        By ``arrival_s[i]`` of the recorder's clock the device had made ``made[i]`` scans since the
        first good one, shape (n,).
    delays
        Where whole scans seem to be missing.
    limit_s
        Scans missing for less than this leave no trace.
    changes
        Scans, of those made, at which the rate changes, shape (k,).
    """

    scans: Scans
    arrival_s: FloatArray
    made: FloatArray
    delays: Sequence[Delay]
    limit_s: float
    changes: FloatArray

    def rates_hz(self, raw: RawRecording, usual_hz: float) -> list[float]:
        """Scan rate before, between and behind the changes; `usual_hz` where there are none."""
        pieces = np.split(np.arange(len(self.made)), np.searchsorted(self.made, self.changes))
        if len(pieces) == 1:
            return [usual_hz]
        return [_measured(raw, self.arrival_s[each], self.made[each]).rate_hz for each in pieces]

    def time_s(self, scan: FloatArray, rates_hz: Sequence[float]) -> FloatArray:
        """When scans were made since the first one, by the rates on both sides of the changes."""
        knots = np.concatenate(([0.0], self.changes))
        begin_s = np.concatenate(([0.0], np.cumsum(np.diff(knots) / rates_hz[:-1])))
        piece = np.searchsorted(self.changes, scan, "right")
        return np.asarray(begin_s[piece] + (scan - knots[piece]) / np.array(rates_hz)[piece])


@dataclass(frozen=True)
class TimeBase:
    """The scan rate of a recording, as the device states it and as the recorder's clock shows it.

    Parameters
    ----------
    nominal_hz
        What the device's divisors say.
    measured_hz, measured_sd_hz
        As measured by the recorder's clock, with its standard deviation; NaN when too little
        arrived to tell.
    """

    nominal_hz: float
    measured_hz: float = math.nan
    measured_sd_hz: float = math.nan

    @property
    def chosen(self) -> Literal["nominal", "measured"]:
        """Which of the two the times are made with.

        The nominal one, unless the measured one differs from it by more than six of its own
        standard deviations: a quartz is better than a host's time stamps over one record,
        but a wrong divisor or a false formula is seen by them at once.
        """
        away = abs(self.measured_hz - self.nominal_hz)
        return "measured" if away > _RATE_TRUST * self.measured_sd_hz else "nominal"

    @property
    def rate_hz(self) -> float:
        """The rate that the times are made with."""
        return self.measured_hz if self.chosen == "measured" else self.nominal_hz


def decode_recording(
    source: str | Path | bytes | RawRecording, channel: int | None = None
) -> Recording:
    """Decode one channel of a raw recording, whole or half-written.

    Parameters
    ----------
    source
        A raw file, its content, or what `read_raw` made of it.
    channel
        The channel as printed on the box; by default the first one recorded.

    Returns
    -------
    Recording
        Volts on an even grid of times, the first scan at 0 s. Lost scans that the bytes tell of are
        rows of quality 2, one each; a scan next to bytes out of step, and a stretch in
        which something was lost without a mark, have quality 1. After a break (unplugged, silent,
        overflowed) the grid begins anew at the time that the recorder's clock tells, and rows of
        quality 2 fill the gap.

    Raises
    ------
    InputError
        If it is no raw recording, the channel was not recorded, or nothing was.
    """
    raw = source if isinstance(source, RawRecording) else read_raw(source)
    place = str(source) if isinstance(source, str | Path) else str(raw.header.get("port"))
    check_description(place, raw)
    header = raw.header
    channels: list[int] = list(header["channels"])
    chosen = channels[0] if channel is None else channel
    refuse_if(
        chosen not in channels,
        place,
        f"channel {chosen} was not recorded",
        f"choose from {', '.join(map(str, channels))}",
    )
    driver = find_driver(header["model"])
    segments = _segments(raw, driver)
    refuse_if(
        not segments,
        place,
        "no scan was recorded",
        "check the device, and record again",
        NothingRecordedError,
    )
    time_base = _time_base(raw, segments)
    high = float(header.get("range_volts", driver.range_volts))
    step = high / 2 ** (driver.bits - 1)
    rates_hz = [segment.rates_hz(raw, time_base.rate_hz) for segment in segments]
    time_s, values, quality = _rows(segments, rates_hz, channels.index(chosen), step)
    kept = ("firmware", "serial_number", "clock_scale", "volts_per_radian")
    return Recording(
        time_s=time_s,
        values=values,
        quantity="volts",
        quality=quality if quality.any() else None,
        metadata={
            "source": str(header.get("source") or f"{header['model']} on {header['port']}"),
            "model": str(header["model"]),
            "channel": str(chosen),
            "bits": str(driver.bits),
            "range_volts": repr(high),
            "sample_rate_hz": repr(time_base.rate_hz),
            "sample_rate_nominal_hz": repr(time_base.nominal_hz),
            "sample_rate_measured_hz": repr(time_base.measured_hz),
            "sample_rate_measured_sd_hz": repr(time_base.measured_sd_hz),
            "time_base": time_base.chosen,
            "unseen_loss_below_s": f"{max(segment.limit_s for segment in segments):.4g}",
            "recorded_at": str(header["recorded_at"]),
        }
        | {key: str(header[key]) for key in kept if header.get(key)},
        resolution=step,
        notes=_notes(raw, segments, time_base, time_s, rates_hz),
    )


def _segments(raw: RawRecording, driver: type[Driver]) -> list[Segment]:
    """Decode each stream of a raw recording; those without a scan are left out."""
    starts = [int(event["at_byte"]) for event in raw.events if event.get("event") == "restarted"]
    scale, rate_hz = float(raw.header.get("clock_scale", 1.0)), float(raw.header["rate_hz"])
    channels = len(raw.header["channels"])
    found: list[Segment] = []
    for number, (begin, end) in enumerate(pairwise([0, *starts, len(raw.data)])):
        holes = [(h.at_byte - begin, h.bytes_missing) for h in raw.holes if h.stream == number]
        scans = _scans(raw.data[begin:end], holes, driver, channels)
        inside = (raw.arrived_bytes > begin) & (raw.arrived_bytes <= end)
        arrival_s = raw.arrival_s[inside]
        made = _made(raw.arrived_bytes[inside] - begin, scans.losses, 2 * channels)
        if len(scans.counts):
            changes = find_changes(arrival_s, made, rate_hz, scale)
            ends = [0, *np.searchsorted(made, changes).tolist(), len(made)]
            pieces = [
                (first, *find_delays(arrival_s[first:last], made[first:last], rate_hz, scale))
                for first, last in pairwise(ends)
            ]
            delays = [
                Delay(first + each.begin, first + each.end, each.late_s)
                for first, delays, _ in pieces
                for each in delays
            ]
            limit_s = max(limit for *_, limit in pieces)
            found.append(Segment(scans, arrival_s, made, delays, limit_s, changes))
    kept = raw.event("stopped").get("keep_scans")
    if kept is not None and len(found) == 1:
        # What arrived beyond the number of scans that was asked for.
        scans = found[0].scans
        gone = sum(loss.lost_scans for loss in scans.losses if loss.reason == "damage")
        wanted = max(1, int(kept) - gone)
        scans = replace(scans, counts=scans.counts[:wanted], suspect=scans.suspect[:wanted])
        found = [replace(found[0], scans=scans)]
    return found


def _scans(
    data: bytes, holes: Sequence[tuple[int, int]], driver: type[Driver], channels: int
) -> Scans:
    """Decode a stream on both sides of every hole in it, from whole scan to whole scan."""
    size = 2 * channels
    parts: list[Scans] = []
    losses: list[Loss] = []
    begin = scans = 0
    for at_byte, missing in (*holes, (len(data), 0)):
        last = at_byte - (at_byte - begin) % size
        parts.append(driver.decode(data[begin : last if missing else at_byte], channels))
        losses += [replace(loss, after_scan=scans + loss.after_scan) for loss in parts[-1].losses]
        scans += len(parts[-1].counts)
        if missing:
            begin = min(at_byte + -(at_byte - last + missing) % size, len(data))
            lost = -(-(begin - last + missing) // size)
            losses.append(Loss(scans, begin - last, lost, "damage"))
    joined: AnyArray = np.concatenate([part.counts for part in parts])
    return Scans(joined, np.concatenate([part.suspect for part in parts]), tuple(losses))


def _made(arrived_bytes: IntArray, losses: Sequence[Loss], size: int) -> FloatArray:
    """Turn bytes arrived into scans that the device has made."""
    thrown = np.array([loss.discarded_bytes for loss in losses], dtype=np.float64)
    ends = np.array([loss.after_scan * size for loss in losses]) + np.cumsum(thrown)
    lost = np.array([loss.lost_scans * loss.is_gap for loss in losses], dtype=np.float64)
    more = np.concatenate(([0.0], np.cumsum(lost - thrown / size)))
    return np.asarray(arrived_bytes / size + more[np.searchsorted(ends, arrived_bytes, "right")])


def _rows(
    segments: Sequence[Segment], rates_hz: Sequence[Sequence[float]], column: int, step: float
) -> tuple[FloatArray, FloatArray, ByteArray]:
    """Put the streams one after the other, with rows for what is missing in and between them."""
    parts: list[tuple[AnyArray, AnyArray, AnyArray]] = []
    for segment, rates, begin_s in zip(
        segments, rates_hz, offsets_s(segments, rates_hz), strict=True
    ):
        scans, rate_hz = segment.scans, rates[0]
        count = len(scans.counts)
        if parts:
            last_s = float(parts[-1][0][-1])
            # Late stamps must not make time stand still.
            begin_s = max(begin_s, last_s + 1.0 / rate_hz)
            rows = max(0, math.ceil((begin_s - last_s) * rate_hz - 0.5) - 1)
            # A long break (the computer slept) gets its first and last row alone.
            gap = np.arange(rows) if rows <= max(_MOST_ROWS, count) else np.array([0, rows - 1])
            missing = np.full(len(gap), MISSING, "u1")
            parts.append((last_s + (gap + 1) / rate_hz, np.full(len(gap), np.nan), missing))
        lost = np.zeros(count, dtype=np.int64)
        for loss in scans.losses:
            # What came before the first scan was never one, unless its frame was damaged.
            if loss.is_gap and loss.after_scan < count:
                lost[loss.after_scan] += loss.lost_scans
        number = np.arange(count) + np.cumsum(lost)
        doubt = scans.suspect.copy()
        for delay in segment.delays:
            doubt |= (number >= segment.made[delay.begin] - 1) & (number < segment.made[delay.end])
        every = np.arange(number[-1] + 1)
        values, quality = np.full(len(every), np.nan), np.full(len(every), MISSING, "u1")
        values[number] = scans.counts[:, column] * step
        quality[number] = np.where(doubt, SUSPECT, GOOD)
        parts.append((begin_s + segment.time_s(every.astype(np.float64), rates), values, quality))
    times, readings, qualities = (np.concatenate(each) for each in zip(*parts, strict=True))
    return times, readings, qualities


_MOST_ROWS: Final = 1 << 20
"""Rows that a gap is filled with, 8 MB a channel: of more only its ends are marked."""
SHORT: Final = ("the recording was cut short", "ended early")


def _notes(
    raw: RawRecording,
    segments: Sequence[Segment],
    time_base: TimeBase,
    time_s: FloatArray,
    rates_hz: Sequence[Sequence[float]],
) -> tuple[str, ...]:
    """What a user should know about the session, one clause each."""
    losses = [loss for segment in segments for loss in segment.scans.losses]
    met = [loss for loss in losses if loss.after_scan and not loss.reason]
    lost, damaged = (
        sum(loss.lost_scans for loss in losses if loss.reason == reason and loss.is_gap)
        for reason in ("", "damage")
    )
    delays = [delay for segment in segments for delay in segment.delays]
    late_s = ", ".join(f"{delay.late_s:.3g} s" for delay in delays)
    doubtful = 0 if met else sum(int(segment.scans.suspect.sum()) for segment in segments)
    pieces = ", ".join(f"{len(segment.scans.counts)} scans" for segment in segments)
    stopped, asked_s = raw.event("stopped"), raw.header.get("duration_s")
    asked = f" of {asked_s:g} s" if isinstance(asked_s, int | float) else ""
    extent = f"{time_s[-1]:.6g} s{asked}"
    notes = (
        (
            met,
            f"{lost} scans lost at {len(met)} places"
            f" ({sum(loss.discarded_bytes for loss in met)} bytes out of step)",
        ),
        (
            delays,
            f"readings come late for good (by {late_s} at least): scans were lost without a mark"
            " where the quality is 1, and the times behind are early by as much",
        ),
        (
            doubtful,
            f"bytes were lost or doubled without a mark: {doubtful} scans are out of step or out"
            " of line (quality 1)",
        ),
        *(
            (loss.reason.startswith("stop"), f"the device's buffer overflowed ('{loss.reason}')")
            for loss in losses
        ),
        *(
            (event.get("event") == "restarted", f"broken off and resumed: {event.get('reason')}")
            for event in raw.events
        ),
        (len(segments) > 1, f"{len(segments)} pieces ({pieces}) in {time_s[-1]:.6g} s"),
        *(
            (
                True,
                f"the scan rate changes from {before:.6g} to {after:.6g} Hz at"
                f" {begin_s + segment.time_s(np.array([scan]), rates)[0]:.4g} s: times follow the"
                " recorder's clock",
            )
            for segment, rates, begin_s in zip(
                segments, rates_hz, offsets_s(segments, rates_hz), strict=True
            )
            for scan, (before, after) in zip(segment.changes, pairwise(rates), strict=True)
        ),
        (
            time_base.chosen == "measured" and not any(len(each.changes) for each in segments),
            f"the device scans at {time_base.measured_hz:.6g} Hz, "
            f"not at {time_base.nominal_hz:.6g} Hz as it should: times follow the recorder's clock",
        ),
        (not stopped, f"{SHORT[0]}: the {extent} that had arrived are kept"),
        (
            stopped and not raw.is_complete,
            f"{SHORT[1]}: {stopped.get('reason')} ({extent} kept)",
        ),
        (
            raw.damaged_bytes,
            f"{raw.damaged_bytes} bytes of the raw file are damaged: {damaged} scans are lost",
        ),
    )
    return tuple(note for is_so, note in notes if is_so)


_NEAR: Final = 64
"""Arrivals on either side of a break that fix its extent."""


def offsets_s(segments: Sequence[Segment], rates_hz: Sequence[Sequence[float]]) -> list[float]:
    """Return when each stream began, by the recorder's clock, since the first did.

    The least late arrivals on either side of a break count, so that a delay that is alike
    on both sides does not matter.
    """
    late = [
        segment.arrival_s - segment.time_s(segment.made, rates)
        for segment, rates in zip(segments, rates_hz, strict=True)
    ]
    steps = [float(new[:_NEAR].min() - old[-_NEAR:].min()) for old, new in pairwise(late)]
    return [0.0, *np.cumsum(steps).tolist()]


_HOST_S: Final = 0.010
"""Seconds by which a busy host's delays may step or drift within a record: less is not believed."""
_RATE_STRETCHES: Final = 12
"""Parts of a record whose least late blocks tell the rate: ten degrees of freedom are left."""
_FEWEST_IN_STRETCH: Final = 3
"""Blocks in each: the least late of three is one that did not wait."""
_RATE_TRUST: Final = 6.0
"""How many standard deviations the measured rate must differ from the nominal one before
it is believed: by chance alone (ten degrees of freedom) once in 8000 records."""


def _time_base(raw: RawRecording, segments: Sequence[Segment]) -> TimeBase:
    """Measure the rate over the most arrivals between which nothing seems to be missing."""
    runs = [
        (segment.arrival_s[begin:end], segment.made[begin:end])
        for segment in segments
        for begin, end in pairwise(
            sorted(
                [
                    *(0, len(segment.arrival_s)),
                    *(delay.end for delay in segment.delays),
                    *np.searchsorted(segment.made, segment.changes).tolist(),
                ]
            )
        )
    ]
    return _measured(raw, *max(runs, key=lambda run: len(run[0])))


def _measured(raw: RawRecording, arrival_s: FloatArray, made: FloatArray) -> TimeBase:
    scale = float(raw.header.get("clock_scale", 1.0))
    return measure_rate(arrival_s, made, float(raw.header["rate_hz"]), scale)


def measure_rate(
    arrival_s: FloatArray, scans: FloatArray, nominal_hz: float, clock_scale: float = 1.0
) -> TimeBase:
    """Measure the scan rate from times of arrival.

    Parameters
    ----------
    arrival_s
        Times by the recorder's clock, in s, shape (n,).
    scans
        How many scans had arrived by then, shape (n,).
    nominal_hz
        The device's own word, kept beside.
    clock_scale
        Seconds of the recorder's clock in one of the host's.

    Returns
    -------
    TimeBase
        The measured rate is NaN for fewer than 36 arrivals, or all at one time.

    Notes
    -----
    The arrivals are cut into twelve stretches with equally many; in each the least late one
    counts (late relative to the straight line through the ends). A least-squares line through
    the twelve gives the interval, its scatter the standard deviation: a constant delay
    changes nothing, and a stretch in which the host slept throughout shows up as scatter.
    Delays that drift do not scatter: a rate is believed only where it puts the last arrival more
    than 10 ms of the host off (10 s of a clock a thousand times as fast). Nor is a count believed
    to better than one scan.
    """
    fresh = np.flatnonzero(np.diff(scans, prepend=-1.0) > 0)
    arrival_s, scans = arrival_s[fresh], scans[fresh]
    nothing = TimeBase(nominal_hz)
    if len(scans) < _RATE_STRETCHES * _FEWEST_IN_STRETCH or arrival_s[-1] <= arrival_s[0]:
        return nothing
    slope = (arrival_s[-1] - arrival_s[0]) / (scans[-1] - scans[0])
    late = arrival_s - slope * scans
    first = _least_late(late, _RATE_STRETCHES)
    (interval, _), covariance = np.polyfit(scans[first], arrival_s[first], 1, cov=True)
    if interval <= 0:
        return nothing
    floor = math.hypot(interval / math.sqrt(12.0), _HOST_S / _RATE_TRUST * clock_scale)
    sd = math.hypot(math.sqrt(covariance[0, 0]), floor / (scans[-1] - scans[0]))
    return TimeBase(nominal_hz, float(1.0 / interval), float(sd / interval**2))


_SLEWED: Final = 5e-4
"""By what part a system lets its clock run fast or slow to set it right (500 ppm): a change of the
rate by less need not be the device's."""
_BETWEEN_CHANGES: Final = 5
"""Stretches of a rate: 40 arrivals, of which it can be measured."""
_WANDERING: Final = 1.5
"""Spread about straight pieces over that between neighbours: 1 of independent delays, and 2 or
more of a random walk."""
_SQUARES_OF_A_BEND: Final = 48.0
"""A line through a bend that ends 1 off leaves a mean square of 1/48."""


def find_changes(
    arrival_s: FloatArray, scans: FloatArray, nominal_hz: float, clock_scale: float = 1.0
) -> FloatArray:
    """Find where the scan rate changes.

    Parameters
    ----------
    arrival_s, scans, nominal_hz, clock_scale
        As for `find_delays`.

    Returns
    -------
    FloatArray
        The scans at which it does, in order, shape (k,).

    Notes
    -----
    The least late arrivals of the stretches are cut into straight pieces by least squares, each of
    which must save 36 variances of the noise (seen by neighbours, so that a drift is none). Where
    neighbouring pieces meet, the rate changes if their slopes differ by more than six standard
    deviations and 500 ppm, and if that puts the end of the shorter one off by more than 10 ms of
    the host and 1.5 scans. If no such pieces leave white noise, the delays wander, and nothing is
    found.
    """
    stretches = min(_STRETCHES, len(scans) // _IN_STRETCH)
    if stretches < 2 * _BETWEEN_CHANGES:
        return np.empty(0)
    first = _least_late(arrival_s - scans / nominal_hz, stretches)
    scan, time_s = scans[first], arrival_s[first]
    middle = np.interp(scan[1:-1], scan[::2], time_s[::2]) - time_s[1:-1]
    middle[1::2] = np.interp(scan[2:-1:2], scan[1::2], time_s[1::2]) - time_s[2:-1:2]
    noise_s = _spread(middle) / math.sqrt(1.5)
    noise_s = math.hypot(noise_s, 1.0 / (nominal_hz * math.sqrt(12.0)))
    price = max(_RATE_TRUST**2, stretches * _SPREADS**2 / _SQUARES_OF_A_BEND) * noise_s**2
    ends = _straight_pieces(scan, time_s, price)
    lines, left = [], []
    for piece in (slice(*pair) for pair in pairwise(ends)):
        slope, level = np.polyfit(scan[piece], time_s[piece], 1)
        weight = float(np.sum((scan[piece] - scan[piece].mean()) ** 2))
        left.append(time_s[piece] - level - slope * scan[piece])
        lines.append((slope, level, weight, scan[piece][0], scan[piece][-1]))
    if _spread(np.concatenate(left)) > _WANDERING * noise_s:
        return np.empty(0)
    least_s = max(_FEWEST_SCANS / nominal_hz, _HOST_S * clock_scale)
    found: list[float] = []
    (slope, level, weight, begin, end), *rest = lines
    for slope_after, level_after, more, begin_after, end_after in rest:
        change = slope_after - slope
        sd = noise_s * math.sqrt(1.0 / weight + 1.0 / more)
        shorter = min(end - begin, end_after - begin_after)
        if abs(change) > max(_RATE_TRUST * sd, _SLEWED * slope) and abs(change) * shorter > least_s:
            found.append(float(np.clip((level - level_after) / change, end, begin_after)))
            slope, weight, begin = slope_after, more, begin_after
        else:  # the same rate, and what is between them was lost
            slope = (weight * slope + more * slope_after) / (weight + more)
            weight += more
        level, end = level_after, end_after
    return np.array(found)


def _spread(values: FloatArray) -> float:
    """Standard deviation of the middle of some values; that of noise without the odd ones."""
    return 1.4826 * float(np.median(np.abs(values - np.median(values))))


def _straight_pieces(x: FloatArray, y: FloatArray, price: float) -> list[int]:
    """Cut points into straight pieces whose squares and prices add up to the least.

    Returns where the pieces begin, and the number of points.
    """
    count = len(x)
    x = (x - x[0]) / (x[-1] - x[0])
    y = y - np.polyval(np.polyfit(x, y, 1), x)
    powers = np.stack([np.ones(count), x, y, x * x, x * y, y * y])
    sums = np.concatenate([np.zeros((6, 1)), np.cumsum(powers, axis=1)], axis=1)
    best, before = np.full(count + 1, np.inf), np.zeros(count + 1, dtype=int)
    best[0] = 0.0
    for end in range(_BETWEEN_CHANGES, count + 1):
        begin = np.arange(end - _BETWEEN_CHANGES + 1)
        n, sx, sy, sxx, sxy, syy = sums[:, end, None] - sums[:, begin]
        across, along = sxx - sx * sx / n, sxy - sx * sy / n
        squares = np.maximum(syy - sy * sy / n - along**2 / across, 0.0)
        total = best[begin] + squares + price
        before[end] = begin[np.argmin(total)]
        best[end] = total.min()
    ends = [count]
    while ends[-1]:
        ends.append(int(before[ends[-1]]))
    return ends[::-1]


_IN_STRETCH: Final = 8
"""Arrivals in a stretch, at least; the least late of them counts."""
_STRETCHES: Final = 256
"""At most."""
_BESIDE: Final = 3
"""Stretches on either side that must bear a step out: nearer to the ends it can't be distinguished
from a busy host."""
_FEWEST_SCANS: Final = 1.5
"""Scans by which a step must exceed the rounding of an arrival: one that is lost, and a half."""
_SPREADS: Final = 8.0
"""Spreads of the steps between stretches that a delay must exceed: 8 of normal ones are chance
once in 10^15."""


def find_delays(
    arrival_s: FloatArray, scans: FloatArray, nominal_hz: float, clock_scale: float = 1.0
) -> tuple[list[Delay], float]:
    """Find where the arrivals become late and stay so: whole scans were lost there.

    Parameters
    ----------
    arrival_s
        Times by the recorder's clock, in s, shape (n,).
    scans
        Scans arrived by then, shape (n,).
    nominal_hz
        The device's own rate.
    clock_scale
        Seconds of the recorder's clock in one of the host's.

    Returns
    -------
    list of Delay
        In order.
    float
        The limit: losses shorter than so many seconds, and those within three stretches
        of the ends, are not seen. Infinite for too few arrivals.

    Notes
    -----
    The lateness of an arrival is its time less scans/rate; of each stretch (8 arrivals or
    more, at most 256 stretches) the least counts. A loss is a step between neighbouring
    stretches but one, beyond their median step (a rate that is not the nominal one), by more than
    eight robust standard deviations of the steps, 10 ms of the host and 1.5 scans, which
    all later stretches keep up and no earlier one had.
    """
    stretches = min(_STRETCHES, len(scans) // _IN_STRETCH)
    if stretches < 4 * _BESIDE:
        return [], math.inf
    late = arrival_s - scans / nominal_hz
    first = _least_late(late, stretches)
    # The drift of a wrong rate, per scan: a median is not moved by a few steps.
    slope = float(np.median(np.diff(late[first]) / np.maximum(1.0, np.diff(scans[first]))))
    late = late - slope * scans
    level = late[first]
    steps = np.diff(level)
    spread = _spread(steps)
    fewest_s = _FEWEST_SCANS * (slope + 1.0 / nominal_hz)
    limit_s = max(fewest_s, _HOST_S * clock_scale, _SPREADS * spread)
    before = np.maximum.accumulate(level)
    after = np.minimum.accumulate(level[::-1])[::-1]
    # The stretch in which it happens may show a part of the step: it is passed over.
    rise = (after[2:] - before[:-2])[_BESIDE - 1 : -_BESIDE]
    over = np.flatnonzero(rise > limit_s) + _BESIDE - 1
    groups = np.split(over, np.flatnonzero(np.diff(over) > 1) + 1) if len(over) else []
    return [
        Delay(
            int(first[group[0]]),
            int(first[group[-1] + 2]),
            float(rise[group - _BESIDE + 1].max()),
        )
        for group in groups
    ], limit_s


def _least_late(late: FloatArray, stretches: int) -> IntArray:
    """Return which arrival was least late in each of so many stretches."""
    parts = np.array_split(np.arange(len(late)), stretches)
    return np.array([part[np.argmin(late[part])] for part in parts])
