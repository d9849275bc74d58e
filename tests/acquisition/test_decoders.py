"""The decoders alone: worked bytes of the fact sheet (A1, A7, A8), damage, any cutting."""

from collections.abc import Sequence

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pendpipe.acquisition.drivers.streams import Loss, marked_scans, out_of_step, plain_scans
from pendpipe.arrays import AnyArray


def frame(codes: Sequence[int], bits: int = 12) -> bytes:
    """One scan in the notation of A1: bit by bit, and slowly."""
    out = []
    for place, code in enumerate(codes):
        text = f"{code + 2 ** (bits - 1):0{bits}b}"
        high, low = text[:7], text[7:].ljust(7, "0")
        out += [int(low + ("1" if place else "0"), 2), int(high + "1", 2)]
    return bytes(out)


def flipped(data: bytes, place: int) -> bytes:
    """The mark of a byte is wrong."""
    return data[:place] + bytes([data[place] ^ 1]) + data[place + 1 :]


FIRST, BROKEN, LAST = frame([11, 12]), frame([22, 23]), frame([33, 34])
BOTH = [(11, 12), (33, 34)]
LOSS_3, LOSS_4 = Loss(1, 3, 1), Loss(1, 4, 1)


def test_digital_inputs_do_not_reach_the_analog_reading() -> None:
    """D1 and D0 stand in bits 2 and 1 of the first byte; in words in the two low bits."""
    assert plain_scans(bytes.fromhex("F3 7F"), 1, 12).counts.tolist() == [[2047]]
    assert marked_scans(bytes.fromhex("96 4D"), 1, 12).counts.tolist() == [[1234 - 2048]]


def test_a_stop_code_ends_the_scans_and_what_only_begins_like_one_is_data() -> None:
    scans = plain_scans(bytes.fromhex("01 00 02 00") + b"stop 02\rxx", 1)
    assert scans.counts.ravel().tolist() == [1, 2]
    assert scans.losses == (Loss(2, 10, 0, reason="stop 02"),)
    assert plain_scans(b"stop 0", 1).counts.tobytes() == b"stop 0"


@pytest.mark.parametrize("channels", [1, 2, 3, 4])
@pytest.mark.parametrize("bits", [10, 12, 14])
def test_every_code_on_every_channel(bits: int, channels: int) -> None:
    codes = np.arange(-(2 ** (bits - 1)), 2 ** (bits - 1))
    scans = np.stack([np.roll(codes, 7 * channel) for channel in range(channels)], axis=1)
    data = b"".join(frame(scan, bits) for scan in scans.tolist())
    decoded = marked_scans(data, channels, bits)
    assert np.array_equal(decoded.counts, scans)
    assert not decoded.losses


@pytest.mark.parametrize(
    ("what", "data", "good", "suspect", "losses"),
    [
        ("a cut first scan", FIRST[1:] + LAST, [(33, 34)], [0], [Loss(0, 3, 1)]),
        ("a first byte lost", FIRST + BROKEN[1:] + LAST, BOTH, [1, 0], [Loss(1, 3, 1)]),
        ("a second byte lost", FIRST + BROKEN[:1] + BROKEN[2:] + LAST, BOTH, [0, 0], [LOSS_3]),
        # Nobody can say which of the bytes with mark 1 came first.
        ("a byte too many", FIRST[:2] + FIRST[1:] + LAST, None, [1, 0], [Loss(1, 1, 1)]),
        *(
            (f"mark {place} flipped", FIRST + flipped(BROKEN, place) + LAST, BOTH, None, [LOSS_4])
            for place in range(4)
        ),
        ("an unfinished scan at the end", FIRST + LAST[:3], [(11, 12)], [0], []),
        ("nothing", b"", [], [], []),
    ],
)
def test_what_breaks_the_marks_costs_the_scan_it_meets(
    what: str,
    data: bytes,
    good: list[tuple[int, int]] | None,
    suspect: list[int] | None,
    losses: list[Loss],
) -> None:
    scans = marked_scans(data, 2, 12)
    assert good is None or scans.counts.tolist() == [list(scan) for scan in good]
    assert suspect is None or scans.suspect.tolist() == [bool(each) for each in suspect]
    assert list(scans.losses) == losses


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


@given(codes=_CODES, damage=_DAMAGE)
def test_every_byte_is_in_a_scan_or_counted_or_waiting(
    codes: list[tuple[int, int]], damage: list[tuple[str, int]]
) -> None:
    data = damaged(b"".join(frame(scan) for scan in codes), damage)
    scans = marked_scans(data, 2, 12)
    thrown = sum(loss.discarded_bytes for loss in scans.losses)
    unaccounted = len(data) - 4 * len(scans.counts) - thrown
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
    scans = marked_scans(damaged(data, [(kind, at)]), 1, 12)
    assert [loss.lost_scans for loss in scans.losses] == [1]
    got = scans.counts[~scans.suspect].ravel().tolist()
    assert got == [code for code in codes if code in set(got)]
    assert len(got) >= len(codes) - 2


def words(codes: AnyArray) -> bytes:
    return np.clip(np.rint(codes), -32768, 32767).astype("<i2").tobytes()


def swing(channels: int = 1, scans: int = 4000) -> AnyArray:
    """Codes of a decaying swing with noise of three codes (0.5 Hz at 100 Hz)."""
    time_s = np.arange(scans)[:, None] / 100.0
    motion = 9000.0 * np.exp(-0.01 * time_s) * np.cos(np.pi * time_s + np.arange(channels))
    return motion + np.random.default_rng(4).normal(0.0, 3.0, motion.shape)


@settings(deadline=None, max_examples=25)
@given(at=st.integers(400, 7000), lost=st.sampled_from([-1, 1, 3]), channels=st.integers(1, 4))
def test_plain_words_that_are_cut_across_are_suspect(at: int, lost: int, channels: int) -> None:
    """From a lost or doubled byte on: none that is left as good was not sent."""
    data = words(swing(channels))
    scans = plain_scans(data[: at * channels] + data[at * channels + lost :], channels)
    good, sent = scans.counts[~scans.suspect], plain_scans(data, channels).counts
    assert np.array_equal(good, sent[: len(good)])
    assert len(good) >= at // 2 - 3 * 48
    assert scans.suspect[-1]


def test_a_second_slip_puts_the_words_into_step_again() -> None:
    data = words(swing(scans=8000))
    suspect = out_of_step(data[:5001] + b"\x55" + data[5001:11000] + data[11001:], 1)
    places = np.flatnonzero(suspect)
    assert np.all(np.diff(places) == 1)
    assert 2500 - 96 <= places[0] <= 2500
    assert 5500 <= places[-1] <= 5500 + 96


@pytest.mark.parametrize(
    "codes",
    [
        np.random.default_rng(1).integers(-32768, 32768, 6000),
        np.where(np.arange(6000) // 50 % 2, 256, 0),
        256 * np.rint(100 * np.sin(np.arange(6000) / 30)),
        40000 * np.sin(np.arange(6000) / 50),
        np.where(np.random.default_rng(2).random(6000) < 0.01, 30000, 0),
        np.zeros(6000),
        swing(scans=40)[:, 0],
        np.zeros(0),
        *(
            np.rint(a * np.sin(r * np.arange(3000)) / step) * step
            for a, r, step in ((3e4, 0.002, 1), (3e4, 0.9, 4), (3000, 0.1, 16), (20, 0.02, 16))
        ),
    ],
)
def test_odd_signals_are_in_step(codes: AnyArray) -> None:
    assert not out_of_step(words(codes), 1).any()
