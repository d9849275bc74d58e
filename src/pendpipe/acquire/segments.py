"""What the bytes between two starts of a device hold, and when."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Final

import numpy as np

from pendpipe.acquire.clock_losses import find_clock_losses
from pendpipe.acquire.drivers.base import Decoder, Driver, Loss
from pendpipe.acquire.drivers.words import WordDecoder
from pendpipe.acquire.raw import RawRecording
from pendpipe.acquire.slips import find_slips
from pendpipe.arrays import AnyArray, FloatArray, IntArray

_NEAR: Final = 64
"""Arrivals on either side of a break that fix its extent."""


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


def split(raw: RawRecording, driver: type[Driver]) -> list[Segment]:
    """Decode each stream of a raw recording; those without a scan are left out."""
    edges = [0, *(int(e["at_byte"]) for e in raw.events if e.get("event") == "restarted")]
    edges.append(len(raw.data))
    scale = float(raw.header.get("clock_scale", 1.0))
    found: list[Segment] = []
    for begin, end in pairwise(edges):
        inside = (raw.arrived_bytes > begin) & (raw.arrived_bytes <= end)
        segment = _decode(
            raw.data[begin:end],
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
    offsets = [0.0]
    for before, after in pairwise(segments):
        old = before.arrival_s - before.scans_made / rate_hz
        new = after.arrival_s - after.scans_made / rate_hz
        offsets.append(offsets[-1] + float(new[:_NEAR].min() - old[-_NEAR:].min()))
    return offsets


def _decode(
    data: bytes,
    decoder: Decoder,
    arrival_s: FloatArray,
    arrived_bytes: IntArray,
    rate_hz: float,
    scale: float,
) -> Segment:
    """Decode one stream and look for what only the clock can tell."""
    counts, losses = _scans_of(data, decoder)
    made, good = _scans_by(arrived_bytes, losses, decoder.bytes_per_scan)
    missing, limit_s = find_clock_losses(arrival_s, made, rate_hz, scale)
    for loss in missing:
        # It was lost on the way to this arrival, behind what the one before had brought.
        place = min(len(counts), max(1, round(float(good[loss.first_arrival - 1]))))
        losses = (*losses, Loss(place, 0, loss.scans, suspect_before=True, reason="clock"))
        made[loss.first_arrival :] += loss.scans
    ordered = tuple(sorted(losses, key=lambda loss: loss.after_scan))
    return Segment(counts, ordered, arrival_s, made, limit_s)


def _scans_of(data: bytes, decoder: Decoder) -> tuple[AnyArray, tuple[Loss, ...]]:
    """Decode a stream; one without marks is put into step again wherever it slips."""
    size = decoder.bytes_per_scan
    parts: list[AnyArray] = []
    losses: list[Loss] = []
    scans = begin = 0
    for slip in find_slips(data, size // 2) if isinstance(decoder, WordDecoder) else []:
        fed = decoder.feed(data[begin : slip.last_byte])
        # (What might be the beginning of a stop code is held back.)
        parts += [fed.counts, decoder.finish().counts]
        scans = sum(map(len, parts))
        thrown = slip.next_byte - slip.last_byte
        lost, reason = -(-thrown // size), "slip" if slip.sure else "slip, channels unsure"
        losses.append(Loss(scans, thrown, lost, suspect_before=True, reason=reason))
        begin = slip.next_byte
    fed, end = decoder.feed(data[begin:]), decoder.finish()
    if not parts:
        return (np.concatenate([fed.counts, end.counts]) if len(end) else fed.counts), (
            *fed.losses, *end.losses,
        )  # fmt: skip
    # A decoder of words counts its scans on over a slip.
    return np.concatenate([*parts, fed.counts, end.counts]), (*losses, *fed.losses, *end.losses)


def _scans_by(
    arrived_bytes: IntArray, losses: Sequence[Loss], bytes_per_scan: int
) -> tuple[FloatArray, FloatArray]:
    """Turn bytes arrived into scans the device has made, and into those that are good."""
    made, good = arrived_bytes / bytes_per_scan, arrived_bytes / bytes_per_scan
    discarded = 0
    for loss in losses:
        discarded += loss.discarded_bytes
        later = arrived_bytes >= loss.after_scan * bytes_per_scan + discarded
        good[later] -= loss.discarded_bytes / bytes_per_scan
        made[later] -= loss.discarded_bytes / bytes_per_scan
        if loss.after_scan:
            made[later] += loss.lost_scans
    return made, good


def cut(segment: Segment, scans: int) -> Segment:
    """Keep the first scans only."""
    return replace(segment, counts=segment.counts[:scans])
