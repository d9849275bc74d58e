"""Raw bytes to a recording: a step of its own that can be repeated at any time."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np

from pendpipe.acquisition.drivers import find_driver
from pendpipe.acquisition.drivers.decoders import Loss
from pendpipe.acquisition.raw import COMPLETE, NothingRecordedError, RawRecording, read_raw
from pendpipe.acquisition.segments import Segment, offsets_s, split
from pendpipe.acquisition.timebase import TimeBase, measure_rate
from pendpipe.arrays import ByteArray, FloatArray, IntArray
from pendpipe.errors import InputError
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
    if chosen not in channels:
        listed = ", ".join(map(str, channels))
        raise InputError(place, f"channel {chosen} was not recorded", f"choose from {listed}")
    driver = find_driver(raw.header["model"])
    segments = split(raw, driver)
    kept = raw.event("stopped").get("keep_scans")
    if kept is not None and len(segments) == 1:
        gone = sum(loss.lost_scans for loss in segments[0].losses if loss.reason == "damage")
        first = segments[0].counts[: max(1, int(kept) - gone)]
        segments = [replace(segments[0], counts=first)]
    if not segments:
        raise NothingRecordedError(
            place, "no scan was recorded", "check the device, and record again"
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


def _check_description(place: str, raw: RawRecording) -> None:
    """Refuse a raw recording whose description can't be true.

    Raises
    ------
    InputError
        On a missing or impossible entry, or time stamps that fall.
    """
    header = raw.header
    for key in _NEEDED:
        if key not in header:
            raise _damaged(place, f"{key} is missing")
    for key in _TEXTS:
        if not isinstance(header[key], str):
            raise _damaged(place, f"{key} is no text")
    for key, (low, high) in _NUMBERS.items():
        value = header.get(key, low)
        # A comparison with NaN is false.
        if not (_is_number(value) and low <= value <= high):
            raise _damaged(place, f"{key} is {value!r:.40}")
    channels = header["channels"]
    if (
        not isinstance(channels, list)
        or not 0 < len(channels) <= _MOST_CHANNELS
        or not all(type(channel) is int and channel > 0 for channel in channels)
        or len(set(channels)) != len(channels)
    ):
        raise _damaged(place, f"channels are {channels!r:.40}")
    kept = raw.event("stopped").get("keep_scans")
    if kept is not None and not (type(kept) is int and kept > 0):
        raise _damaged(place, f"keep_scans is {kept!r:.40}")
    if not np.isfinite(raw.arrival_s).all() or np.any(np.diff(raw.arrival_s) < 0):
        raise _damaged(place, "time stamps that fall")


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _damaged(place: str, what: str) -> InputError:
    return InputError(
        place, f"the description of the recording is damaged ({what})", "give another copy"
    )


def _join(
    segments: Sequence[Segment], rate_hz: float, column: int, step: float
) -> tuple[FloatArray, FloatArray, ByteArray]:
    """Put the streams one after the other, with rows for what is missing between them."""
    times: list[FloatArray] = []
    values: list[FloatArray] = []
    qualities: list[ByteArray] = []
    for segment, offset_s in zip(segments, offsets_s(segments, rate_hz), strict=True):
        length = len(segment.counts)
        grid = _place(length, [loss for loss in segment.losses if 0 < loss.after_scan < length])
        begin_s = offset_s
        if times:
            last_s = float(times[-1][-1])
            # Late stamps must not make time stand still.
            begin_s = max(offset_s, last_s + 1.0 / rate_hz)
            rows = max(0, math.ceil((begin_s - last_s) * rate_hz - 0.5) - 1)
            shown = np.arange(1, rows + 1) if rows <= _most_rows(length) else np.array([1, rows])
            times.append(last_s + shown / rate_hz)
            values.append(np.full(len(shown), np.nan))
            qualities.append(np.full(len(shown), MISSING, dtype=np.uint8))
        reading = np.full(len(grid.quality), np.nan)
        reading[grid.index] = segment.counts[:, column] * step
        times.append(begin_s + grid.number / rate_hz)
        values.append(reading)
        qualities.append(grid.quality)
    return np.concatenate(times), np.concatenate(values), np.concatenate(qualities)


def _most_rows(scans: int) -> int:
    """How many rows a gap may fill: of a longer one (a computer that slept) the ends do."""
    return max(1 << 20, scans)


@dataclass(frozen=True)
class _Grid:
    """Rows for good scans and lost ones.

    Parameters
    ----------
    number
        Each row's place in time, in scans, shape (rows,).
    index
        The rows of the good scans.
    quality
        Of each row.
    """

    number: IntArray
    index: IntArray
    quality: ByteArray


def _place(scans: int, losses: Sequence[Loss]) -> _Grid:
    """Give every scan, good or lost, its row."""
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
    return _Grid(np.arange(len(quality)) + np.cumsum(left_out), index, quality)


def _metadata(
    raw: RawRecording,
    channel: int,
    time_base: TimeBase,
    range_volts: float,
    segments: Sequence[Segment],
) -> dict[str, str]:
    """Say where the recording comes from, as text."""
    header = raw.header
    driver = find_driver(header["model"])
    metadata = {
        "source": str(header.get("source") or f"{header['model']} on {header['port']}"),
        "model": str(header["model"]),
        "channel": str(channel),
        "bits": str(driver.bits),
        "range_volts": repr(range_volts),
        "sample_rate_hz": repr(time_base.rate_hz),
        "sample_rate_nominal_hz": repr(time_base.nominal_hz),
        "sample_rate_measured_hz": repr(time_base.measured_hz),
        "sample_rate_measured_sd_hz": repr(time_base.measured_sd_hz),
        "time_base": time_base.chosen,
        "unseen_loss_below_s": f"{max(segment.limit_s for segment in segments):.4g}",
        "recorded_at": str(header["recorded_at"]),
    }
    for key in ("firmware", "serial_number", "clock_scale", "volts_per_radian"):
        if header.get(key):
            metadata[key] = str(header[key])
    return metadata


def _notes(
    raw: RawRecording, segments: Sequence[Segment], time_base: TimeBase, time_s: FloatArray
) -> tuple[str, ...]:
    """Say what a user should know of the session, a clause each."""
    notes: list[str] = []
    losses = [loss for segment in segments for loss in segment.losses]
    met = [loss for loss in losses if loss.after_scan and not loss.reason]
    if met:
        scans, discarded = (
            sum(loss.lost_scans for loss in met),
            sum(loss.discarded_bytes for loss in met),
        )
        notes.append(f"{scans} scans lost at {len(met)} places ({discarded} bytes out of step)")
    if silent := [loss for loss in losses if loss.reason == "clock"]:
        scans = sum(loss.lost_scans for loss in silent)
        notes.append(f"{scans} scans lost at {len(silent)} places, by the recorder's clock")
    if slipped := [loss for loss in losses if loss.reason.startswith("slip")]:
        unsure = sum(loss.reason != "slip" for loss in slipped)
        doubt = f"; behind {unsure} of them which channel is which is a guess" if unsure else ""
        notes.append(
            f"bytes slipped at {len(slipped)} places: put into step again behind a gap{doubt}"
        )
    notes += [
        f"the device's buffer overflowed ('{loss.reason}')"
        for loss in losses
        if loss.reason.startswith("stop")
    ]
    notes += [
        f"broken off and resumed: {event.get('reason')}"
        for event in raw.events
        if event.get("event") == "restarted"
    ]
    if len(segments) > 1:
        steps = [f"{len(segment.counts)} scans" for segment in segments]
        notes.append(f"{len(segments)} pieces ({', '.join(steps)}) in {time_s[-1]:.6g} s")
    if time_base.chosen == "measured":
        notes.append(
            f"the device scans at {time_base.measured_hz:.6g} Hz, "
            f"not at {time_base.nominal_hz:.6g} Hz as it should: times follow the recorder's clock"
        )
    stopped = raw.event("stopped")
    extent = f"{time_s[-1]:.6g} s"
    if isinstance(asked_s := raw.header.get("duration_s"), int | float):
        extent += f" of {asked_s:g} s"
    if not stopped:
        notes.append(f"the recording was cut short: the {extent} that had arrived are kept")
    elif stopped.get("reason") not in COMPLETE:
        notes.append(f"ended early: {stopped.get('reason')} ({extent} kept)")
    if raw.damaged_bytes:
        scans = sum(loss.lost_scans for loss in losses if loss.reason == "damage")
        notes.append(
            f"{raw.damaged_bytes} bytes of the raw file are damaged: {scans} scans are lost"
        )
    return tuple(notes)
