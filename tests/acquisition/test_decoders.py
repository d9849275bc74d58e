"""The decoders alone: worked bytes of the fact sheet (A1, A7, A8), damage, any cutting."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pendpipe.acquisition.drivers.base import Decoder, Loss, SyncBitDecoder, WordDecoder
from pendpipe.arrays import AnyArray


def decode(decoder: Decoder, *pieces: bytes) -> tuple[AnyArray, list[Loss]]:
    """Feed the pieces and finish."""
    fed = [decoder.feed(piece) for piece in pieces] + [decoder.finish()]
    return np.concatenate([scans.counts for scans in fed]), [
        loss for scans in fed for loss in scans.losses
    ]


def frame(codes: Sequence[int], bits: int = 12) -> bytes:
    """One scan in the notation of A1: bit by bit, and slowly."""
    out = []
    for place, code in enumerate(codes):
        text = f"{code + 2 ** (bits - 1):0{bits}b}"
        high, low = text[:7], text[7:].ljust(7, "0")
        out += [int(low + ("1" if place else "0"), 2), int(high + "1", 2)]
    return bytes(out)


@pytest.mark.parametrize(
    ("bits", "received", "raw"),
    [
        (12, "00 01", 0),
        (12, "08 01", 1),
        (12, "90 4D", 1234),
        (12, "F8 7F", 2047),
        (12, "00 81", 2048),
        (12, "08 81", 2049),
        (12, "F8 FF", 4095),
        (10, "00 01", 0),
        (10, "20 01", 1),
        (10, "E0 7F", 511),
        (10, "00 81", 512),
        (10, "E0 FF", 1023),
        (14, "00 01", 0),
        (14, "FE 7F", 8191),
        (14, "02 81", 8193),
        (14, "00 C1", 12288),
        (14, "FE FF", 16383),
    ],
)
def test_sync_bit_worked_bytes(bits: int, received: str, raw: int) -> None:
    counts, losses = decode(SyncBitDecoder(1, bits), bytes.fromhex(received))
    assert counts.tolist() == [[raw - 2 ** (bits - 1)]]
    assert not losses


def test_digital_inputs_do_not_reach_the_analog_reading() -> None:
    """D1 and D0 stand in bits 2 and 1 of the first byte."""
    counts, _ = decode(SyncBitDecoder(1, 12), bytes.fromhex("96 4D"))
    assert counts.tolist() == [[1234 - 2048]]


def test_a_stream_goes_on_behind_a_hole_without_what_was_told_before_it() -> None:
    """A stray byte before the hole is told once."""
    decoder = SyncBitDecoder(1, 12)
    scan = bytes.fromhex("90 4D")
    assert not decoder.feed(scan + scan[1:]).losses
    assert [loss.discarded_bytes for loss in decoder.finish().losses] == [1]
    behind = decoder.feed(scan)
    assert behind.counts.tolist() == [[1234 - 2048]]
    assert not behind.losses
    assert not decoder.finish().losses


@pytest.mark.parametrize(
    ("received", "count"),
    [("FF 7F", 32767), ("00 80", -32768), ("FF FF", -1), ("00 40", 16384), ("F0 7F", 32752)],
)
def test_word_worked_bytes(received: str, count: int) -> None:
    assert decode(WordDecoder(1), bytes.fromhex(received))[0].tolist() == [[count]]


@pytest.mark.parametrize("channels", [1, 2, 3, 4])
@pytest.mark.parametrize("bits", [10, 12, 14])
def test_every_code_on_every_channel(bits: int, channels: int) -> None:
    codes = np.arange(-(2 ** (bits - 1)), 2 ** (bits - 1))
    scans = np.stack([np.roll(codes, 7 * channel) for channel in range(channels)], axis=1)
    data = b"".join(frame(scan, bits) for scan in scans.tolist())
    counts, losses = decode(SyncBitDecoder(channels, bits), data)
    assert np.array_equal(counts, scans)
    assert not losses


def test_a_cut_first_scan_is_passed_over() -> None:
    """A stream entered in its midst begins with bytes of mark 1."""
    data = frame([5, 6])[1:] + frame([7, 8])
    counts, losses = decode(SyncBitDecoder(2, 12), data)
    assert counts.tolist() == [[7, 8]]
    assert losses == [Loss(0, 3, 1)]


@pytest.mark.parametrize("place", [0, 1])
def test_a_dropped_byte_costs_its_own_scan_only(place: int) -> None:
    broken = frame([22])
    data = frame([11]) + broken[:place] + broken[place + 1 :] + frame([33])
    counts, losses = decode(SyncBitDecoder(1, 12), data)
    assert counts.ravel().tolist() == [11, 33]
    assert losses == [Loss(1, 1, 1, suspect_before=place == 0)]


def test_a_byte_too_many_makes_the_scan_before_it_suspect() -> None:
    """Nobody can say which of three bytes with mark 1 came first."""
    first = frame([11, 12])
    data = first[:2] + first[1:] + frame([33, 34])
    counts, losses = decode(SyncBitDecoder(2, 12), data)
    assert len(counts) == 2
    assert counts[1].tolist() == [33, 34]
    assert losses == [Loss(1, 1, 1, suspect_before=True)]


@pytest.mark.parametrize("place", range(4))
def test_a_flipped_mark_costs_one_scan(place: int) -> None:
    broken = bytearray(frame([22, 23]))
    broken[place] ^= 1
    data = frame([11, 12]) + bytes(broken) + frame([33, 34])
    counts, losses = decode(SyncBitDecoder(2, 12), data)
    assert counts.tolist() == [[11, 12], [33, 34]]
    assert [(loss.after_scan, loss.discarded_bytes, loss.lost_scans) for loss in losses] == [
        (1, 4, 1)
    ]


_CODES = st.lists(
    st.tuples(st.integers(-2048, 2047), st.integers(-2048, 2047)), min_size=1, max_size=30
)
_DAMAGE = st.lists(
    st.tuples(st.sampled_from(["drop", "double", "flip"]), st.integers(0, 200)), max_size=6
)


def damaged(data: bytes, damage: list[tuple[str, int]]) -> bytes:
    """Drop or double a byte, or flip its mark, at each of the places."""
    out = bytearray(data)
    for kind, place in damage:
        at = place % max(1, len(out))
        if kind == "drop":
            del out[at : at + 1]
        elif kind == "double":
            out[at:at] = out[at : at + 1]
        elif out:
            out[at] ^= 1
    return bytes(out)


@given(codes=_CODES, damage=_DAMAGE, cuts=st.lists(st.integers(0, 200), max_size=10))
@pytest.mark.parametrize(
    "make", [lambda: SyncBitDecoder(2, 12), lambda: SyncBitDecoder(1, 12), lambda: WordDecoder(2)]
)
def test_how_the_bytes_are_cut_changes_nothing(
    make: Callable[[], Decoder],
    codes: list[tuple[int, int]],
    damage: list[tuple[str, int]],
    cuts: list[int],
) -> None:
    data = damaged(b"".join(frame(scan) for scan in codes), damage)
    edges = [0, *sorted(cut % (len(data) + 1) for cut in cuts), len(data)]
    pieces = [data[a:b] for a, b in pairwise(edges)]
    whole_counts, whole_losses = decode(make(), data)
    counts, losses = decode(make(), *pieces)
    assert np.array_equal(counts, whole_counts)
    assert losses == whole_losses


@given(codes=_CODES, damage=_DAMAGE)
def test_every_byte_is_in_a_scan_or_counted_or_waiting(
    codes: list[tuple[int, int]], damage: list[tuple[str, int]]
) -> None:
    data = damaged(b"".join(frame(scan) for scan in codes), damage)
    counts, losses = decode(SyncBitDecoder(2, 12), data)
    unaccounted = len(data) - 4 * len(counts) - sum(loss.discarded_bytes for loss in losses)
    assert 0 <= unaccounted < 4


@given(
    codes=st.lists(st.integers(-2048, 2047), min_size=3, max_size=60, unique=True),
    kind=st.sampled_from(["drop", "double", "flip"]),
    place=st.integers(0, 1000),
)
def test_one_fault_is_flagged_and_costs_at_most_two_scans(
    codes: list[int], kind: str, place: int
) -> None:
    """Neighbours are whole again: all scans but at most two are delivered, in order."""
    data = b"".join(frame([code]) for code in codes)
    # The first and the last scan have no neighbour that could tell.
    at = 2 + place % (len(data) - 4)
    counts, losses = decode(SyncBitDecoder(1, 12), damaged(data, [(kind, at)]))
    assert len(losses) == 1
    assert losses[0].lost_scans == 1
    suspect = losses[0].after_scan - 1 if losses[0].suspect_before else None
    got = [int(c) for row, c in enumerate(counts.ravel()) if row != suspect]
    assert got == [code for code in codes if code in set(got)]
    assert len(got) >= len(codes) - 2
