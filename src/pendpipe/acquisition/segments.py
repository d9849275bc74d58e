"""What the bytes between two starts of a device hold, and when."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Final, NamedTuple

import numpy as np

from pendpipe.acquisition.drivers.base import Driver
from pendpipe.acquisition.drivers.decoders import Decoder, Loss, WordDecoder
from pendpipe.acquisition.raw import Hole, RawRecording
from pendpipe.acquisition.slips import find_slips
from pendpipe.acquisition.timebase import find_clock_losses
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
    offsets = [0.0]
    for before, after in pairwise(segments):
        old = before.arrival_s - before.scans_made / rate_hz
        new = after.arrival_s - after.scans_made / rate_hz
        offsets.append(offsets[-1] + float(new[:_NEAR].min() - old[-_NEAR:].min()))
    return offsets


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
    for loss in missing:
        # It was lost on the way to this arrival, behind what the one before had brought.
        place = min(len(counts), max(1, round(float(good[loss.first_arrival - 1]))))
        losses = (*losses, Loss(place, 0, loss.scans, suspect_before=True, reason="clock"))
        made[loss.first_arrival :] += loss.scans
    ordered = tuple(sorted(losses, key=lambda loss: loss.after_scan))
    return Segment(counts, ordered, arrival_s, made, limit_s)


def _scans_of(
    data: bytes, holes: Sequence[Hole], decoder: Decoder
) -> tuple[AnyArray, tuple[Loss, ...]]:
    """Decode a stream, put into step again behind every hole and, without marks, every slip."""
    size = decoder.bytes_per_scan
    parts: list[AnyArray] = []
    losses: list[Loss] = []
    begin = scans = 0
    marked = not isinstance(decoder, WordDecoder)
    for cut in _cuts(data, holes, size, marked=marked):
        fed = decoder.feed(data[begin : cut.last_byte])
        # (What might be the beginning of a stop code is held back.)
        ended = decoder.finish()
        parts += [fed.counts, ended.counts]
        # A decoder of words tells of a stop code whenever it ends: once is enough.
        losses += [*fed.losses, *ended.losses] if marked else []
        scans += len(fed) + len(ended)
        thrown = cut.next_byte - cut.last_byte
        lost = -(-(thrown + cut.bytes_missing) // size)
        losses.append(Loss(scans, thrown, lost, suspect_before=cut.suspect, reason=cut.reason))
        begin = cut.next_byte
    fed, ended = decoder.feed(data[begin:]), decoder.finish()
    # A decoder counts its scans on over a cut.
    counts = [part for part in (*parts, fed.counts, ended.counts) if len(part)]
    joined = np.concatenate(counts) if len(counts) > 1 else (counts or [fed.counts])[0]
    return joined, (*losses, *fed.losses, *ended.losses)


class _Cut(NamedTuple):
    """Where a stream is taken apart: what is between the two bytes is thrown away."""

    last_byte: int
    next_byte: int
    reason: str
    bytes_missing: int = 0
    suspect: bool = False


def _cuts(data: bytes, holes: Sequence[Hole], size: int, *, marked: bool) -> list[_Cut]:
    """Find the places where a stream of scans of so many bytes is out of step."""
    cuts: list[_Cut] = []
    begin = 0
    for hole in (*holes, None):
        end = len(data) if hole is None else hole.at_byte
        if not marked:
            for slip in find_slips(data[begin:end], size // 2):
                reason = "slip" if slip.sure else "slip, channels unsure"
                last, following = begin + slip.last_byte, begin + slip.next_byte
                cuts.append(_Cut(last, following, reason, suspect=True))
            begin = cuts[-1].next_byte if cuts else begin
        if hole is None:
            break
        last = end - (end - begin) % size
        following = end + -(end - last + hole.bytes_missing) % size
        cuts.append(_Cut(last, min(following, len(data)), "damage", hole.bytes_missing))
        begin = cuts[-1].next_byte
    return cuts


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
