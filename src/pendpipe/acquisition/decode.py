"""Raw bytes to a recording: a step of its own that can be repeated at any time.

The recorder's clock shows the true scan rate, and whole scans that were lost. Bytes arrive late,
never early: by how much changes with every piece. The pieces that were least late lie on a straight
line whose slope is the true interval between scans. In a stream without marks lost scans leave no
trace but one: everything after them arrives late, and stays so. Other delays (a busy host) pass,
and the pieces that were not held up are as early as before.

Each attempt at a recording keeps its bytes in a raw file of its own, never overwritten: a campaign
in ``results/<record>/raw/``, the command line beside ``--out``. A recording is always decoded from
such a file, so it can be made again at any time.
"""

import math
import re
import secrets
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from itertools import pairwise
from pathlib import Path
from typing import Final, Literal

import numpy as np

from pendpipe.acquisition.drivers import find_driver
from pendpipe.acquisition.drivers.base import Decoder, Driver, Loss, WordDecoder
from pendpipe.acquisition.line import LineLostError
from pendpipe.acquisition.raw import (
    Hole,
    NothingRecordedError,
    RawRecording,
    append_event,
    is_being_recorded,
    read_raw,
)
from pendpipe.acquisition.slips import Cut, find_slips
from pendpipe.arrays import AnyArray, ByteArray, FloatArray, IntArray
from pendpipe.errors import InputError, refuse_if
from pendpipe.files import is_stream
from pendpipe.recording import GOOD, MISSING, SUSPECT, Recording

_NUMBERS: Final[Mapping[str, tuple[float, float]]] = {
    "rate_hz": (1e-6, 1e9),
    "range_volts": (1e-6, 1e6),
    "clock_scale": (1e-3, 1e9),
    "volts_per_radian": (-1e9, 1e9),
}
"""What can be true of any instrument."""
_NEEDED: Final = ("model", "port", "channels", "rate_hz", "recorded_at")
_TEXTS: Final = ("model", "port", "recorded_at")
_MOST_CHANNELS: Final = 64


@dataclass(frozen=True)
class Segment:
    """The scans of one stream.

    Parameters
    ----------
    counts
        Shape (scans, channels).
    losses
        Those met in it, in order.
    arrival_s, scans_made
        By ``arrival_s[i]`` the device had made ``scans_made[i]`` scans since the first
        good one, shape (n,).
    limit_s
        Whole scans lost for less than this leave no trace.
    """

    counts: AnyArray
    losses: tuple[Loss, ...]
    arrival_s: FloatArray
    scans_made: FloatArray
    limit_s: float


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
        Volts on an even grid of times, the first scan at 0 s. Lost scans are rows of
        quality 2, one each; a scan next to bytes out of step has quality 1. After a break
        (unplugged, silent, overflowed) the grid begins anew at the time that the
        recorder's clock tells, and rows of quality 2 fill the gap.

    Raises
    ------
    InputError
        If it is no raw recording, the channel was not recorded, or nothing was.
    """
    raw = source if isinstance(source, RawRecording) else read_raw(source)
    place = str(source) if isinstance(source, str | Path) else str(raw.header.get("port"))
    _check_description(place, raw)
    channels: list[int] = list(raw.header["channels"])
    chosen = channels[0] if channel is None else channel
    refuse_if(
        chosen not in channels,
        place,
        f"channel {chosen} was not recorded",
        f"choose from {', '.join(map(str, channels))}",
    )
    driver = find_driver(raw.header["model"])
    segments = _wanted(raw, split(raw, driver))
    refuse_if(
        not segments,
        place,
        "no scan was recorded",
        "check the device, and record again",
        NothingRecordedError,
    )
    longest = max(segments, key=lambda segment: len(segment.arrival_s))
    time_base = measure_rate(
        longest.arrival_s,
        longest.scans_made,
        float(raw.header["rate_hz"]),
        float(raw.header.get("clock_scale", 1.0)),
    )
    high = float(raw.header.get("range_volts", driver.range_volts))
    step = high / 2 ** (driver.bits - 1)
    time_s, values, quality = _join(segments, time_base.rate_hz, channels.index(chosen), step)
    return Recording(
        time_s=time_s,
        values=values,
        quantity="volts",
        quality=quality if quality.any() else None,
        metadata=_metadata(raw, chosen, time_base, high, segments),
        resolution=step,
        notes=_notes(raw, segments, time_base, time_s),
    )


def _wanted(raw: RawRecording, segments: list[Segment]) -> list[Segment]:
    """Leave out what arrived beyond the number of scans that was asked for."""
    kept = raw.event("stopped").get("keep_scans")
    if kept is None or len(segments) != 1:
        return segments
    gone = _lost([loss for loss in segments[0].losses if loss.reason == "damage"])
    return [replace(segments[0], counts=segments[0].counts[: max(1, int(kept) - gone)])]


def _check_description(place: str, raw: RawRecording) -> None:
    """Refuse a raw recording whose description can't be true.

    Raises
    ------
    InputError
        On a missing or impossible entry, or time stamps that fall.
    """
    header, channels = raw.header, raw.header.get("channels")
    kept = raw.event("stopped").get("keep_scans")
    faults = (
        *((key not in header, f"{key} is missing") for key in _NEEDED),
        *((not isinstance(header.get(key), str), f"{key} is no text") for key in _TEXTS),
        *(
            # (A comparison with NaN is false; and True is no number.)
            (not (type(value) in (int, float) and low <= value <= high), f"{key} is {value!r:.40}")
            for key, (low, high) in _NUMBERS.items()
            for value in (header.get(key, low),)
        ),
        (
            not isinstance(channels, list)
            or not 0 < len(channels) <= _MOST_CHANNELS
            or not all(type(channel) is int and channel > 0 for channel in channels)
            or len(set(channels)) != len(channels),
            f"channels are {channels!r:.40}",
        ),
        (kept is not None and not (type(kept) is int and kept > 0), f"keep_scans is {kept!r:.40}"),
        (
            not np.isfinite(raw.arrival_s).all() or np.any(np.diff(raw.arrival_s) < 0),
            "time stamps that fall",
        ),
    )
    for wrong, fault in faults:
        refuse_if(
            wrong,
            place,
            f"the description of the recording is damaged ({fault})",
            "give another copy",
        )


def _join(
    segments: Sequence[Segment], rate_hz: float, column: int, step: float
) -> tuple[FloatArray, FloatArray, ByteArray]:
    """Put the streams one after the other, with rows for what is missing between them."""
    parts: list[tuple[FloatArray, FloatArray, ByteArray]] = []
    for segment, begin_s in zip(segments, offsets_s(segments, rate_hz), strict=True):
        length = len(segment.counts)
        # What came before the first scan was never one, unless its frame was damaged.
        inside = [loss for loss in segment.losses if loss.after_scan < length and loss.is_gap]
        number, index, quality = _place(length, inside)
        if parts:
            last_s = float(parts[-1][0][-1])
            # Late stamps must not make time stand still.
            begin_s = max(begin_s, last_s + 1.0 / rate_hz)
            rows = max(0, math.ceil((begin_s - last_s) * rate_hz - 0.5) - 1)
            shown = np.arange(1, rows + 1) if rows <= _most_rows(length) else np.array([1, rows])
            nothing = np.full(len(shown), np.nan), np.full(len(shown), MISSING, dtype=np.uint8)
            parts.append((last_s + shown / rate_hz, *nothing))
        reading = np.full(len(quality), np.nan)
        reading[index] = segment.counts[:, column] * step
        parts.append((begin_s + number / rate_hz, reading, quality))
    time_s, values, qualities = zip(*parts, strict=True)
    return np.concatenate(time_s), np.concatenate(values), np.concatenate(qualities)


def _most_rows(scans: int) -> int:
    """The most rows that fill a gap; a longer one (the computer slept) gets its first and last."""
    return max(1 << 20, scans)


def _place(scans: int, losses: Sequence[Loss]) -> tuple[IntArray, IntArray, ByteArray]:
    """Give every scan, good or lost, its row.

    Returns
    -------
    number
        Each row's place in time, in scans, shape (rows,).
    index
        The rows of the good scans.
    quality
        Of each row.
    """
    lost = np.zeros(scans, dtype=np.int64)
    for loss in losses:
        lost[loss.after_scan] += loss.lost_scans
    long = lost > _most_rows(scans)
    index = np.arange(scans) + np.cumsum(np.where(long, 2, lost))
    quality = np.full(int(index[-1]) + 1, MISSING, dtype=np.uint8)
    quality[index] = GOOD
    for loss in losses:
        if loss.suspect_before:
            quality[index[loss.after_scan - 1]] = SUSPECT
    left_out = np.zeros(len(quality), dtype=np.int64)
    left_out[index[long] - 1] = lost[long] - 2
    return np.arange(len(quality)) + np.cumsum(left_out), index, quality


def _metadata(
    raw: RawRecording,
    channel: int,
    time_base: TimeBase,
    range_volts: float,
    segments: Sequence[Segment],
) -> dict[str, str]:
    """Where the recording comes from, as text."""
    header = raw.header
    told = ("firmware", "serial_number", "clock_scale", "volts_per_radian")
    return {
        "source": str(header.get("source") or f"{header['model']} on {header['port']}"),
        "model": str(header["model"]),
        "channel": str(channel),
        "bits": str(find_driver(header["model"]).bits),
        "range_volts": repr(range_volts),
        "sample_rate_hz": repr(time_base.rate_hz),
        "sample_rate_nominal_hz": repr(time_base.nominal_hz),
        "sample_rate_measured_hz": repr(time_base.measured_hz),
        "sample_rate_measured_sd_hz": repr(time_base.measured_sd_hz),
        "time_base": time_base.chosen,
        "unseen_loss_below_s": f"{max(segment.limit_s for segment in segments):.4g}",
        "recorded_at": str(header["recorded_at"]),
    } | {key: str(header[key]) for key in told if header.get(key)}


def _lost(losses: Sequence[Loss]) -> int:
    """How many scans were lost."""
    return sum(loss.lost_scans for loss in losses)


_SHORT: Final = ("the recording was cut short", "ended early")


def _notes(
    raw: RawRecording, segments: Sequence[Segment], time_base: TimeBase, time_s: FloatArray
) -> tuple[str, ...]:
    """What a user should know about the session, one clause each."""
    losses = [loss for segment in segments for loss in segment.losses]
    met = [loss for loss in losses if loss.after_scan and not loss.reason]
    silent = [loss for loss in losses if loss.reason == "clock"]
    damaged = [loss for loss in losses if loss.reason == "damage"]
    slipped = [loss.reason for loss in losses if loss.reason.startswith("slip")]
    unsure = len(slipped) - slipped.count("slip")
    doubt = f"; behind {unsure} of them which channel is which is a guess" if unsure else ""
    discarded = sum(loss.discarded_bytes for loss in met)
    pieces = ", ".join(f"{len(segment.counts)} scans" for segment in segments)
    stopped, asked_s = raw.event("stopped"), raw.header.get("duration_s")
    asked = f" of {asked_s:g} s" if isinstance(asked_s, int | float) else ""
    extent = f"{time_s[-1]:.6g} s{asked}"
    notes = (
        (met, f"{_lost(met)} scans lost at {len(met)} places ({discarded} bytes out of step)"),
        (silent, f"{_lost(silent)} scans lost at {len(silent)} places, by the recorder's clock"),
        (
            slipped,
            f"bytes slipped at {len(slipped)} places: put into step again behind a gap{doubt}",
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
        (
            time_base.chosen == "measured",
            f"the device scans at {time_base.measured_hz:.6g} Hz, "
            f"not at {time_base.nominal_hz:.6g} Hz as it should: times follow the recorder's clock",
        ),
        (not stopped, f"{_SHORT[0]}: the {extent} that had arrived are kept"),
        (
            stopped and not raw.is_complete,
            f"{_SHORT[1]}: {stopped.get('reason')} ({extent} kept)",
        ),
        (
            raw.damaged_bytes,
            f"{raw.damaged_bytes} bytes of the raw file are damaged:"
            f" {_lost(damaged)} scans are lost",
        ),
    )
    return tuple(note for is_so, note in notes if is_so)


_NEAR: Final = 64
"""Arrivals on either side of a break that fix its extent."""


def split(raw: RawRecording, driver: type[Driver]) -> list[Segment]:
    """Decode each stream of a raw recording; those without a scan are left out."""
    edges = [0, *(int(e["at_byte"]) for e in raw.events if e.get("event") == "restarted")]
    edges.append(len(raw.data))
    scale = float(raw.header.get("clock_scale", 1.0))
    found: list[Segment] = []
    for number, (begin, end) in enumerate(pairwise(edges)):
        inside = (raw.arrived_bytes > begin) & (raw.arrived_bytes <= end)
        segment = _decode(
            raw.data[begin:end],
            [
                hole._replace(at_byte=hole.at_byte - begin)
                for hole in raw.holes
                if hole.stream == number
            ],
            driver.decoder(len(raw.header["channels"])),
            raw.arrival_s[inside],
            raw.arrived_bytes[inside] - begin,
            float(raw.header["rate_hz"]),
            scale,
        )
        if len(segment.counts):
            found.append(segment)
    return found


def offsets_s(segments: Sequence[Segment], rate_hz: float) -> list[float]:
    """Return when each stream began, by the recorder's clock, since the first did.

    The least late arrivals on either side of a break count, so that a delay that is alike
    on both sides does not matter.
    """
    late = [segment.arrival_s - segment.scans_made / rate_hz for segment in segments]
    steps = [float(new[:_NEAR].min() - old[-_NEAR:].min()) for old, new in pairwise(late)]
    return [0.0, *np.cumsum(steps).tolist()]


def _decode(
    data: bytes,
    holes: Sequence[Hole],
    decoder: Decoder,
    arrival_s: FloatArray,
    arrived_bytes: IntArray,
    rate_hz: float,
    scale: float,
) -> Segment:
    """Decode one stream and look for what only the clock can tell."""
    counts, losses = _scans_of(data, holes, decoder)
    made, good = _scans_by(arrived_bytes, losses, decoder.bytes_per_scan)
    missing, limit_s = find_clock_losses(arrival_s, made, rate_hz, scale)
    for arrival, lost in missing:
        # It was lost on the way to this arrival, behind what the one before had brought.
        place = min(len(counts), max(1, round(float(good[arrival - 1]))))
        losses = (*losses, Loss(place, 0, lost, suspect_before=True, reason="clock"))
        made[arrival:] += lost
    return Segment(
        counts, tuple(sorted(losses, key=lambda loss: loss.after_scan)), arrival_s, made, limit_s
    )


def _scans_of(
    data: bytes, holes: Sequence[Hole], decoder: Decoder
) -> tuple[AnyArray, tuple[Loss, ...]]:
    """Decode a stream, realigned after every hole and, where scans have no marks, every slip."""
    size = decoder.bytes_per_scan
    parts: list[AnyArray] = []
    losses: list[Loss] = []
    begin = scans = 0
    marked = not isinstance(decoder, WordDecoder)
    for cut in (*_cuts(data, holes, size, marked=marked), None):
        fed = decoder.feed(data[begin : cut.last_byte if cut else len(data)])
        # (What might be the beginning of a stop code is held back.)
        ended = decoder.finish()
        # A decoder counts its scans on over a cut.
        parts += [fed.counts, ended.counts]
        # A decoder of words tells of a stop code whenever it ends: once is enough.
        losses += [*fed.losses, *ended.losses] if marked or not cut else []
        scans += len(fed.counts) + len(ended.counts)
        if not cut:
            break
        thrown = cut.next_byte - cut.last_byte
        lost = -(-(thrown + cut.bytes_missing) // size)
        losses.append(
            Loss(scans, thrown, lost, suspect_before=cut.reason != "damage", reason=cut.reason)
        )
        begin = cut.next_byte
    counts = [part for part in parts if len(part)] or parts[:1]
    return np.concatenate(counts) if len(counts) > 1 else counts[0], tuple(losses)


def _cuts(data: bytes, holes: Sequence[Hole], size: int, *, marked: bool) -> list[Cut]:
    """Find the places where a stream of scans of so many bytes is out of step."""
    cuts: list[Cut] = []
    begin = 0
    for hole in (*holes, None):
        end = len(data) if hole is None else hole.at_byte
        if not marked:
            cuts += find_slips(data[:end], size // 2, begin)
            begin = cuts[-1].next_byte if cuts else begin
        if hole is None:
            break
        last = end - (end - begin) % size
        following = end + -(end - last + hole.bytes_missing) % size
        cuts.append(Cut(last, min(following, len(data)), "damage", hole.bytes_missing))
        begin = cuts[-1].next_byte
    return cuts


def _scans_by(
    arrived_bytes: IntArray, losses: Sequence[Loss], bytes_per_scan: int
) -> tuple[FloatArray, FloatArray]:
    """Turn bytes arrived into scans the device has made, and into those that are good."""
    good = arrived_bytes / bytes_per_scan
    made, discarded = good.copy(), 0
    for loss in losses:
        discarded += loss.discarded_bytes
        later = arrived_bytes >= loss.after_scan * bytes_per_scan + discarded
        good[later] -= loss.discarded_bytes / bytes_per_scan
        made[later] -= loss.discarded_bytes / bytes_per_scan
        made[later] += loss.lost_scans if loss.is_gap else 0
    return made, good


_HOST_S: Final = 0.010
"""Seconds by which a busy host's delays may step or drift within a record: less is not believed."""
_RATE_STRETCHES: Final = 12
_FEWEST_IN_STRETCH: Final = 3
_RATE_TRUST: Final = 6.0
"""How many standard deviations the measured rate must differ from the nominal one before
it is believed: by chance alone (ten degrees of freedom) once in 8000 records."""

_IN_STRETCH: Final = 8
"""Arrivals in a stretch, at least; the least late of them counts."""
_LOSS_STRETCHES: Final = 256
"""At most."""
_BESIDE: Final = 3
"""Stretches on either side that must bear a step out: nearer to the ends it can't be distinguished
from a busy host."""
_BESIDE_STEP: Final = 5
"""Stretches on either side whose median tells the height of a step."""
_FEWEST_SCANS: Final = 1.5
_SPREADS: Final = 8.0


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


def find_clock_losses(
    arrival_s: FloatArray, scans: FloatArray, nominal_hz: float, clock_scale: float = 1.0
) -> tuple[list[tuple[int, int]], float]:
    """Find whole-scan losses.

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
    list of tuple
        Steps of the lateness that stay, in order: the index of the first arrival after each,
        and how many scans are missing before it, rounded.
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
    stretches = min(_LOSS_STRETCHES, len(scans) // _IN_STRETCH)
    if stretches < 4 * _BESIDE:
        return [], math.inf
    late = arrival_s - scans / nominal_hz
    first = _least_late(late, stretches)
    # The drift of a wrong rate, per scan: a median is not moved by a few steps.
    slope = float(np.median(np.diff(late[first]) / np.maximum(1.0, np.diff(scans[first]))))
    late = late - slope * scans
    steps = np.diff(late[first])
    spread = 1.4826 * float(np.median(np.abs(steps - np.median(steps))))
    interval_s = slope + 1.0 / nominal_hz
    limit_s = max(_FEWEST_SCANS * interval_s, _HOST_S * clock_scale, _SPREADS * spread)
    found = _lasting_steps(late, first, limit_s)
    return [(at, max(1, round(rise / interval_s))) for at, rise in found], limit_s


def _least_late(late: FloatArray, stretches: int) -> IntArray:
    """Return which arrival was least late in each of so many stretches."""
    parts = np.array_split(np.arange(len(late)), stretches)
    return np.array([part[np.argmin(late[part])] for part in parts])


def _lasting_steps(
    late: FloatArray, first: IntArray, limit_s: float
) -> Iterator[tuple[int, float]]:
    """Find steps of the lateness that last: the arrival after each, and its height in s.

    Parameters
    ----------
    late
        Lateness of each arrival, s, shape (n,).
    first
        The least late arrival of each stretch.
    limit_s
        What a step must exceed.
    """
    level = late[first]
    before = np.maximum.accumulate(level)
    after = np.minimum.accumulate(level[::-1])[::-1]
    index = _BESIDE - 1
    while index < len(first) - _BESIDE - 1:
        # The stretch in which it happens may show a part of the step: it is passed over.
        rise = float(after[index + 2] - before[index])
        if rise <= limit_s:
            index += 1
            continue
        if float(after[index + 3] - before[index + 1]) > rise:
            index += 1
        # The detection took extremes of many levels, which exaggerate the delays.
        near = level[max(0, index - _BESIDE_STEP + 1) : index + 1]
        rise = float(np.median(level[index + 2 : index + 2 + _BESIDE_STEP]) - np.median(near))
        # The arrival between the two after which the lateness never falls back.
        begin, end = int(first[index]), int(first[index + 2])
        least_after = np.minimum.accumulate(late[begin : end + 1][::-1])[::-1]
        at = begin + 1 + int(np.argmax(np.diff(least_after)))
        yield at, rise
        index += _BESIDE


_STAMP: Final = r"\d{8}T\d{6}\.\d{6}Z-[0-9a-f]{8}"


def new_path(start: str | Path) -> Path:
    r"""Name a raw file that nobody else has: `start`, a UTC time stamp, and a random number.

    Examples
    --------
    >>> re.sub(r"\d", "0", new_path("raw/").name[:23])
    '00000000T000000.000000Z'
    """
    stamp = datetime.now(UTC).strftime("%Y%m%dT%H%M%S.%fZ")
    return Path(f"{start}{stamp}-{secrets.token_hex(4)}.raw")


def new_path_beside(out: Path) -> Path:
    """Name the raw file of a recording on the command line: ``OUT.raw`` if that is free.

    Beside a device or a pipe nothing is kept: ``recording.raw`` in the current folder is.
    """
    out = _file_of(out)
    first = out.with_suffix(".raw")
    return new_path(f"{out.with_suffix('')}.") if first.exists() else first


def _file_of(out: Path) -> Path:
    no_file = is_stream(out) or (out.exists() and not out.is_file())
    return Path("recording.csv") if no_file else out


def paths_beside(out: Path) -> list[Path]:
    """List the raw files that `new_path_beside` has named for a recording."""
    out = _file_of(out)
    pattern = re.compile(re.escape(out.stem) + rf"(\.{_STAMP})?\.raw")
    return [path for path in out.parent.glob("*") if pattern.fullmatch(path.name)]


def read_attempts(paths: Iterable[Path]) -> list[RawRecording]:
    """Read the attempts that hold at least one scan, the oldest first.

    Raises
    ------
    InputError
        If one of them is being recorded now, or none holds a scan and one is damaged.
    """
    found: list[RawRecording] = []
    damages: list[InputError] = []
    for path in sorted(path for path in paths if path.is_file()):
        refuse_if(
            is_being_recorded(path),
            path,
            "another process is recording into it",
            "wait for its end",
        )
        try:
            raw = read_raw(path)
            decode_recording(raw)
        except NothingRecordedError:
            continue
        except InputError as fault:
            damages.append(fault)
        else:
            found.append(raw)
    if damages and not found:
        raise damages[0]
    # A name has its time stamp down to microseconds; OUT.raw, the first of all, has none.
    return sorted(
        found, key=lambda raw: (str(raw.header["recorded_at"]), *re.findall(_STAMP, raw.path.name))
    )


def choose(attempts: Sequence[RawRecording]) -> RawRecording:
    """Return the newest complete attempt; if none is complete, the longest."""
    complete = [attempt for attempt in attempts if attempt.is_complete]
    return complete[-1] if complete else max(attempts, key=lambda attempt: len(attempt.data))


def decode_attempt(path: Path, folder: Path, channel: int | None = None) -> Recording:
    """Decode a raw file; the recording's metadata names it and holds the notes.

    Parameters
    ----------
    path
        The raw file.
    folder
        Where the recording goes: the file is named relative to it.
    channel
        As printed on the box; the first one recorded by default.
    """
    recording = decode_recording(path, channel)
    named = path.relative_to(folder) if path.is_relative_to(folder) else Path(path.name)
    short = next((note for note in recording.notes if note.startswith(_SHORT)), "")
    told = {"raw_file": named.as_posix(), "notes": "; ".join(recording.notes), "incomplete": short}
    kept = {key: text for key, text in told.items() if text}
    return replace(recording, metadata={**recording.metadata, **kept})


def accept(attempt: RawRecording) -> None:
    """Note in a raw file that what the line had brought before it was lost is the recording."""
    append_event(attempt.path, event="accepted")


def refuse_lost(attempt: RawRecording, remedy: str) -> None:
    """Refuse an attempt that a lost line has ended.

    Raises
    ------
    LineLostError
        With the seconds kept of those asked for. The raw file stays.
    """
    if not attempt.lost_line:
        return
    kept_s, asked_s = decode_recording(attempt).time_s[-1], attempt.header.get("duration_s")
    asked = f" of {asked_s:g} s" if isinstance(asked_s, int | float) else ""
    raise LineLostError(
        str(attempt.header["port"]),
        f"{attempt.lost_line}; {kept_s:.6g} s{asked} are kept in {attempt.path}",
        remedy,
    )


def mark_saved(path: Path, out: Path) -> None:
    """Note in a raw file, where it may be written to, that its recording was written."""
    with suppress(OSError):
        append_event(path, event="saved", file=out.name)


@contextmanager
def kept_in(raw_path: Path, out: Path) -> Iterator[None]:
    """Name the raw file that still holds a recording, if writing the recording fails.

    Raises
    ------
    InputError
        Where the recording can't be written, for a full disk for one.
    """
    kept = f"the recording is kept in {raw_path}: call again to write it"
    try:
        yield
    except OSError as fault:
        raise InputError(
            out, f"it can't be written ({fault.strerror or fault})", f"make room; {kept}"
        ) from None
    except InputError as fault:
        raise InputError(fault.place, fault.problem, f"{fault.remedy}; {kept}") from None
