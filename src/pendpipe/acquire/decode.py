"""Raw bytes to a recording: a step of its own that can be repeated at any time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pendpipe.acquire.drivers import find_driver
from pendpipe.acquire.drivers.base import Loss
from pendpipe.acquire.raw import RawRecording, read_raw
from pendpipe.acquire.timebase import TimeBase, measure_rate
from pendpipe.arrays import ByteArray, FloatArray, IntArray
from pendpipe.errors import InputError
from pendpipe.recording import GOOD, MISSING, SUSPECT, Recording


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
        quality 2, one each; a scan next to bytes out of step has quality 1.

    Raises
    ------
    InputError
        If it is no raw recording, the channel was not recorded, or nothing was.
    """
    raw = source if isinstance(source, RawRecording) else read_raw(source)
    place = str(source) if isinstance(source, str | Path) else str(raw.header["port"])
    channels: list[int] = list(raw.header["channels"])
    chosen = channels[0] if channel is None else channel
    if chosen not in channels:
        listed = ", ".join(map(str, channels))
        raise InputError(place, f"channel {chosen} was not recorded", f"choose from {listed}")
    driver = find_driver(raw.header["model"])
    decoder = driver.decoder(len(channels))
    scans, end = decoder.feed(raw.data), decoder.finish()
    kept = raw.event("stopped").get("keep_scans", len(scans))
    counts = scans.counts[:kept, channels.index(chosen)]
    if not len(counts):
        raise InputError(place, "no scan was recorded", "check the device, and record again")
    losses = (*scans.losses, *end.losses)
    time_base = measure_rate(
        raw.arrival_s,
        _scans_arrived(raw.arrived_bytes, losses, decoder.bytes_per_scan),
        float(raw.header["rate_hz"]),
        float(raw.header.get("clock_scale", 1.0)),
    )
    step = driver.range_volts / 2 ** (driver.bits - 1)
    grid = _place(len(counts), [loss for loss in losses if 0 < loss.after_scan < len(counts)])
    values = np.full(grid.length, np.nan)
    values[grid.index] = counts * step
    return Recording(
        time_s=np.arange(grid.length) / time_base.rate_hz,
        values=values,
        quantity="volts",
        quality=grid.quality if grid.quality.any() else None,
        metadata=_metadata(raw, chosen, time_base),
        resolution=step,
        notes=_notes(raw, losses, time_base),
    )


def _scans_arrived(
    arrived_bytes: IntArray, losses: Sequence[Loss], bytes_per_scan: int
) -> FloatArray:
    """Turn bytes arrived into scans the device has made; a lost scan is one made."""
    scans = arrived_bytes / bytes_per_scan
    discarded = 0
    for loss in losses:
        discarded += loss.discarded_bytes
        place = loss.after_scan * bytes_per_scan + discarded
        made = loss.lost_scans if loss.after_scan else 0
        scans[arrived_bytes >= place] += made - loss.discarded_bytes / bytes_per_scan
    return scans


@dataclass(frozen=True)
class _Grid:
    """Where the good scans stand once the lost ones have their rows."""

    length: int
    index: IntArray
    quality: ByteArray


def _place(scans: int, losses: Sequence[Loss]) -> _Grid:
    """Give every scan, good or lost, its row."""
    lost = np.zeros(scans, dtype=np.int64)
    for loss in losses:
        lost[loss.after_scan] += loss.lost_scans
    index = np.arange(scans) + np.cumsum(lost)
    length = int(index[-1]) + 1
    quality = np.full(length, MISSING, dtype=np.uint8)
    quality[index] = GOOD
    for loss in losses:
        if loss.suspect_before:
            quality[index[loss.after_scan - 1]] = SUSPECT
    return _Grid(length, index, quality)


def _metadata(raw: RawRecording, channel: int, time_base: TimeBase) -> dict[str, str]:
    """Say where the recording comes from, as text."""
    header = raw.header
    driver = find_driver(header["model"])
    metadata = {
        "source": str(header.get("source") or f"{header['model']} on {header['port']}"),
        "model": str(header["model"]),
        "channel": str(channel),
        "bits": str(driver.bits),
        "range_volts": repr(driver.range_volts),
        "sample_rate_hz": repr(time_base.rate_hz),
        "sample_rate_nominal_hz": repr(time_base.nominal_hz),
        "sample_rate_measured_hz": repr(time_base.measured_hz),
        "sample_rate_measured_sd_hz": repr(time_base.measured_sd_hz),
        "time_base": time_base.chosen,
        "recorded_at": str(header["recorded_at"]),
    }
    for key in ("firmware", "serial_number", "clock_scale", "volts_per_radian"):
        if header.get(key):
            metadata[key] = str(header[key])
    return metadata


def _notes(raw: RawRecording, losses: Sequence[Loss], time_base: TimeBase) -> tuple[str, ...]:
    """Say what a user should know of the session, a clause each."""
    notes: list[str] = []
    met = [loss for loss in losses if loss.after_scan]
    if met:
        scans, discarded = (
            sum(loss.lost_scans for loss in met),
            sum(loss.discarded_bytes for loss in met),
        )
        notes.append(f"{scans} scans lost at {len(met)} places ({discarded} bytes out of step)")
    if time_base.chosen == "measured":
        notes.append(
            f"the device scans at {time_base.measured_hz:.6g} Hz, "
            f"not at {time_base.nominal_hz:.6g} Hz as it should: times follow the recorder's clock"
        )
    stopped = raw.event("stopped")
    if not stopped:
        notes.append("the recording was cut short: what had arrived is kept")
    elif stopped.get("reason") not in ("scans", "time"):
        notes.append(f"ended early: {stopped.get('reason')}")
    if raw.damaged_bytes:
        notes.append(f"{raw.damaged_bytes} bytes at the end of the raw file are no whole frame")
    return tuple(notes)
