"""What goes over the wire: devices and drivers by the fact sheets, and decoders of the bytes."""

import ast
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

import pendpipe.acquisition
from pendpipe.acquisition.clock import ScaledClock
from pendpipe.acquisition.devices import DEVICES
from pendpipe.acquisition.devices.simulated import convert
from pendpipe.acquisition.drivers import DRIVERS, find_driver
from pendpipe.acquisition.drivers.streams import Loss, marked_scans, out_of_step, plain_scans
from pendpipe.arrays import AnyArray
from pendpipe.errors import InputError

# Drivers and simulated devices against the worked bytes and sessions of the fact sheet (A1-A8).

FAST = ScaledClock(1e6)
"""The waits between attempts take no time."""
Pair = tuple[bytes, bytes]
WORKED = [
    ("di154", "00 01", -2048, 10.0, -10.0),
    ("di154", "08 01", -2047, 10.0, -9.9951171875),
    ("di154", "90 4D", 1234 - 2048, 10.0, -3.974609375),
    ("di154", "F8 7F", -1, 10.0, -0.0048828125),
    ("di154", "00 81", 0, 10.0, 0.0),
    ("di154", "F8 FF", 2047, 10.0, 9.9951171875),
    ("di194", "00 01", -512, 10.0, -10.0),
    ("di194", "20 01", -511, 10.0, -9.98046875),
    ("di194", "E0 7F", -1, 10.0, -0.01953125),
    ("di194", "00 81", 0, 10.0, 0.0),
    ("di194", "E0 FF", 511, 10.0, 9.98046875),
    ("di149", "00 01", -2048, 10.0, -10.0),
    ("di149", "F8 7F", -1, 10.0, -0.0048828125),
    ("di149", "60 81", 12, 10.0, 0.05859375),
    ("di149", "A0 81", 20, 10.0, 0.09765625),
    ("di149", "00 C1", 1024, 10.0, 5.0),
    ("di149", "F8 FF", 2047, 10.0, 9.9951171875),
    ("di155", "00 C1", 4096, 50.0, 25.0),
    ("di245", "00 01", -8192, 10.0, -10.0),
    ("di245", "FE 7F", -1, 10.0, -10.0 / 8192),
    ("di245", "02 81", 1, 10.0, 10.0 / 8192),
    ("di245", "00 C1", 4096, 50.0, 25.0),
    ("di245", "FE FF", 8191, 50.0, 49.99389648),
    ("di1100", "F0 7F", 2047, 10.0, 9.9951171875),
    ("di1110", "00 80", -2048, 10.0, -10.0),
    ("di1120", "00 40", 4096, 100.0, 50.0),
    ("di2108", "FF 7F", 32767, 10.0, 9.99969),
    ("di2108", "00 80", -32768, 10.0, -10.0),
    ("di2108", "00 00", 0, 10.0, 0.0),
    ("di2108", "FF FF", -1, 10.0, -0.00031),
    ("di4108", "FF 7F", 32767, 5.0, 4.99985),
    ("di4108", "00 60", 24576, 5.0, 3.75),
    ("di2108p", "FF FF", -1, 5.0, -0.00015),
    ("di2108p", "00 40", 16384, 10.0, 5.0),
    ("di4208", "00 40", 16384, 100.0, 50.0),
    ("di4718b", "FF 7F", 32767, 5.0, 4.99985),
]


@pytest.mark.parametrize(("kind", "sent", "count", "high", "volts"), WORKED)
def test_worked_bytes(kind: str, sent: str, count: int, high: float, volts: float) -> None:
    driver, data = find_driver(kind), bytes.fromhex(sent)
    assert driver.decode(data, 1).counts.tolist() == [[count]]
    assert DEVICES[kind]().encode(np.full((1, 1), count)) == data
    assert count * high / 2 ** (driver.bits - 1) == pytest.approx(volts, abs=5e-6)


@pytest.mark.parametrize("kind", sorted(DRIVERS))
@pytest.mark.parametrize("channels", [1, 3])
def test_what_the_device_sends_the_driver_reads(kind: str, channels: int) -> None:
    """Every code of every model on every channel; they share no code."""
    driver, device = find_driver(kind), DEVICES[kind]()
    assert (device.bits, device.model) == (driver.bits, driver.model)
    half = 2 ** (driver.bits - 1)
    codes = np.stack([np.roll(np.arange(-half, half), 5 * c) for c in range(channels)], axis=1)
    scans = driver.decode(device.encode(codes), channels)
    assert np.array_equal(scans.counts, codes)
    assert not scans.losses


def test_a_converter_rounds_to_the_nearest_code_and_stops_at_its_ends() -> None:
    step = 20 / 4096
    volts = np.array([-99.0, -10.0, -0.51 * step, -0.49 * step, 0.0, 0.51 * step, 10.0, 99.0])
    assert convert(volts, 12, 10.0).tolist() == [-2048, -2048, -1, 0, 0, 1, 2047, 2047]


@pytest.mark.parametrize(
    ("kind", "sent", "received", "rate_hz"),
    [
        ("di154", b"\0NZ", b"NZ0000000001", 240.0),
        ("di154", b"\0C\x0f", b"C\x0f", 60.0),
        ("di154", b"\0C\x0f\0B\x04", b"C\x0fB\x04", 120.0),
        # 20 is what a third party's program sends for 120 Hz.
        ("di154", b"\0L\x14\0M\x00", b"L\x14M\x00", 120.0),
        ("di154", b"\0S1\0S0", b"S1S0", 240.0),
        ("di154", b"info 0\r", b"", 240.0),
        ("di2108", b"info 0\r", b"info 0 DATAQ\r", 1000.0),
        ("di2108", b"info 1\rinfo 9\r", b"info 1 2108\rinfo 9 60000000\r", 1000.0),
        # The fact sheet rounds this up, to 10.0007.
        ("di2108", b"srate 11718\rdec 512\r", b"srate 11718\rdec 512\r", 10.00064),
        ("di2108", b"start\rinfo 0\rstop\r", b"stop\r", 1000.0),
        ("di2108", b"nonsense\r", b"Command not found\r", 1000.0),
    ],
)
def test_a_device_echoes_as_the_fact_sheet_says(
    kind: str, sent: bytes, received: bytes, rate_hz: float
) -> None:
    device = DEVICES[kind]()
    assert b"".join(device.respond(bytes([byte])) for byte in sent) == received
    assert device.scan_rate_hz == pytest.approx(rate_hz, abs=5e-6)


def echoed(*lines: str) -> list[Pair]:
    return [(f"{line}\r".encode(), f"{line}\r".encode()) for line in lines]


def letters(*commands: bytes) -> list[Pair]:
    """NUL and letter, then the argument, each sent after the echo of the last."""
    pairs = []
    for command in commands:
        pairs += [(b"\0" + command[:1], command[:1]), (command[1:2], command[1:])]
    return pairs


def asked(number: str, firmware: str = "141", serial: str = "5F2A") -> list[Pair]:
    answers = ("info 0 DATAQ", f"info 1 {number}", f"info 2 {firmware}", f"info 6 {serial}")
    return [(line[:6].encode() + b"\r", f"{line}\r".encode()) for line in answers]


CDC = ("srate 60000", "dec 10", "deca 1", "filter * 0", "ps 0")
SESSIONS: dict[str, tuple[list[int], float, list[Pair], list[Pair], list[Pair], list[int]]] = {
    # Two channels take 40 bit times; 40 more make it 60 Hz.
    "di154rs": (
        [3, 1],
        60.0,
        letters(b"S0", b"NZ0000000001"),
        letters(b"C\x05", b"L\x28", b"M\x00"),
        [*letters(b"S1" + bytes.fromhex("90 4D 01 81")), *letters(b"S0")],
        [1234 - 2048, 0],
    ),
    "di149": (
        [3, 1],
        100.0,
        [(b"stop\r", b"\x01\x02stop\r"), *asked("149")],
        echoed("asc", "slist 0 x0000", "slist 1 x0002", "slist 2 xffff", "srate 7500", "bin"),
        [(b"start\r", b"start\r" + bytes.fromhex("60 81 01 C1")), (b"stop\r", b"\x01stop\r")],
        [12, 1024],
    ),
    # Word 0x0A00 and 0x0A03; 10 Hz of each is 20 in all: 8000/((99 + 1)(1 + 3)).
    "di245": (
        [1, 4],
        10.0,
        letters(b"S0", b"A1 2450\r", b"A2 141\r", b"NZ5F2A\r"),
        echoed("chn 0 2560", "chn 1 2563", "xrate 355 20"),
        [*letters(b"S1" + bytes.fromhex("02 81 01 C1")), *letters(b"S0")],
        [1, 4096],
    ),
    "di2108": (
        [1, 7],
        100.0,
        [(b"stop\r", b"\x00\x40stop\r"), *asked("2108")],
        echoed("encode 0", "slist 0 0", "slist 1 6", *CDC),
        [(b"start\r", bytes.fromhex("FF 7F 00 80 00 40")), (b"stop\r", b"\x01stop\r")],
        [32767, -32768],
    ),
}


@pytest.mark.parametrize("kind", SESSIONS)
def test_a_session_is_what_the_fact_sheet_says(script: Any, kind: str) -> None:
    channels, rate_hz, hello, setting, stream, counts = SESSIONS[kind]
    line = script(*hello, *setting, *stream)
    driver = find_driver(kind)(line, FAST)
    identity = driver.identify()
    assert identity.model == driver.model
    assert kind == "di154rs" or (identity.firmware, identity.serial_number) == ("141", "5F2A")
    setup = driver.configure(channels, rate_hz)
    assert (setup.channels, setup.rate_hz) == (tuple(sorted(channels)), rate_hz)
    driver.start()
    assert driver.decode(line.receive(1.0), 2).counts[0].tolist() == counts
    driver.stop()
    assert line.finished


@pytest.mark.parametrize(
    ("kind", "channel", "volts", "range_volts", "lines"),
    [
        # 7 V: +-10 V is gain 5, code 3 in bits 8 to 10.
        ("di155", 2, 7.0, 10.0, ("asc", "slist 0 x0301", "slist 1 xffff", "srate 7500", "bin")),
        ("di4108", 4, 0.5, 0.5, ("encode 0", "slist 0 1027", *CDC)),
        ("di2108p", 2, 2.0, 2.5, ("encode 0", "slist 0 513", *CDC[:2], *CDC[3:])),
        ("di4718b", 1, None, 5.0, ("encode 0", "slist 0 0", *CDC)),
        (
            "di1100",
            1,
            None,
            10.0,
            ("encode 0", "slist 0 0", "srate 60000", "deca 10", *CDC[3:]),
        ),
        ("di245", 1, 3.0, 5.0, ("chn 0 2816", "xrate 275 100")),
    ],
)
def test_a_range_is_the_smallest_that_holds_the_signal(
    script: Any,
    kind: str,
    channel: int,
    volts: float | None,
    range_volts: float,
    lines: tuple[str, ...],
) -> None:
    line = script(*echoed(*lines))
    setup = find_driver(kind)(line, FAST).configure([channel], 100.0, volts)
    assert (setup.rate_hz, setup.range_volts) == (pytest.approx(100.0), range_volts)
    assert line.finished


@pytest.mark.parametrize(
    "pairs",
    [
        [(b"\0S", b"\xff\xfe"), (b"0", b"\x7fS0"), (b"\0N", b"\xff\x7fN"), (b"Z", b"Z0000000001")],
        [*letters(b"S0"), (b"\0N", b""), *letters(b"NZ0000000001")],
        [*letters(b"S0"), (b"\0N", b"M"), *letters(b"NZ0000000001")],
        # The stop is repeated while data flow.
        [(b"\0S", b"\x90\x4d"), (b"0", b"\x90\x4d"), *letters(b"S0", b"NZ0000000001")],
    ],
    ids=["junk of the supply", "echo missing", "echo wrong", "data flow"],
)
def test_an_answer_that_is_spoilt_is_asked_for_again(script: Any, pairs: list[Pair]) -> None:
    line = script(*pairs)
    assert find_driver("di154rs")(line, FAST).identify().model == "DI-154RS"
    assert line.finished


def test_a_device_that_may_have_started_is_stopped_before_it_is_started_again(script: Any) -> None:
    """And none is sent its argument before the echo of the letter, else the script would break."""
    line = script((b"\0S", b"S"), (b"1", b"?"), *letters(b"S0", b"S1"))
    find_driver("di154rs")(line, FAST).start()
    assert line.finished
    silent = find_driver("di154rs")(line := script(*letters(b"S0"), (b"\0N", b"")), FAST)
    silent.attempts = 1
    with pytest.raises(InputError, match="does not answer"):
        silent.identify()
    assert line.finished


def test_9600_baud_carry_what_4800_cannot(script: Any) -> None:
    setting = letters(b"B\x04", b"C\x01", b"L\x00", b"M\x00")
    line = script(*setting, *letters(b"S0", b"B\x01"))
    driver = find_driver("di154rs")(line, FAST)
    assert driver.configure([1], 480.0).rate_hz == 480.0
    driver.stop()
    assert line.baudrates == [9600, 4800]
    assert line.finished


def test_a_missing_echo_to_encode_stops_nothing(script: Any) -> None:
    """Seen on a DI-4108."""
    line = script(*[(b"encode 0\r", b"")] * 3, *echoed("slist 0 0", *CDC))
    assert find_driver("di4108")(line, FAST).configure([1], 100.0).rate_hz == 100.0
    assert line.finished


@pytest.mark.parametrize("rate_hz", [3.7, 10.0, 60.0, 110.0, 915.0, 10e3, 160e3])
def test_divisors_come_near_any_rate(script: Any, rate_hz: float) -> None:
    divisor, decimation, further = find_driver("di2108")(script(), FAST)._divisors(rate_hz)  # type: ignore[attr-defined]
    assert 375 <= divisor <= 65535
    assert 1 <= decimation <= 512
    # One part in the smallest divisor, halved by rounding, is the worst to be had.
    assert 60e6 / (divisor * decimation * further) == pytest.approx(rate_hz, rel=0.5 / 375)


@pytest.mark.parametrize(
    ("kind", "number", "refused"),
    [
        ("di2108p", "2108P", ""),  # a hyphen more or less is the same model
        ("di2108", "2108P", "this is a DI-2108P, not a DI-2108"),
        ("di2108", "1100", "this is a DI-1100, not a DI-2108"),
    ],
)
def test_another_model_is_refused(script: Any, kind: str, number: str, refused: str) -> None:
    driver = find_driver(kind)(script((b"stop\r", b"stop\r"), *asked(number)), FAST)
    if not refused:
        assert driver.identify().model == f"DI-{number}"
        return
    with pytest.raises(InputError, match=refused):
        driver.identify()


@pytest.mark.parametrize(
    ("kind", "channels", "rate_hz", "volts", "message"),
    [
        ("di154rs", [5], 60.0, None, "has no channel 5"),
        ("di154rs", [0], 60.0, None, "has no channel 0"),
        ("di154rs", [1, 2], 300.0, None, "can't scan 2 channel"),
        ("di154rs", [1], 0.1, None, "can't scan 1 channel"),
        ("di154rs", [1], 60.0, 20.0, "has no range of \\+-20 V"),
        ("di194rs", [5], 60.0, None, "has no channel 5"),
        ("di149", [1, 2], 6000.0, None, "can't scan 2 channel"),
        ("di149", [1], 5.0, None, "can't scan 1 channel"),
        ("di155", [1], 60.0, 51.0, "has no range of \\+-51 V"),
        ("di245", [1], 2001.0, None, "can't scan 1 channel"),
        ("di1100", [1], 50e3, None, "can't scan at 50000 Hz"),
        ("di2108", [9], 60.0, None, "has no channel 9"),
        ("di2108", [1], 1e6, None, "can't scan at 1e\\+06 Hz"),
        ("di2108", [1], 60.0, 12.0, "has no range of \\+-12 V"),
    ],
)
def test_what_the_box_cannot_do_is_refused(
    script: Any, kind: str, channels: list[int], rate_hz: float, volts: float | None, message: str
) -> None:
    with pytest.raises(InputError, match=f"SCRIPT: the DI-.* {message}"):
        find_driver(kind)(script(), FAST).configure(channels, rate_hz, volts)


def test_a_model_may_be_written_in_its_usual_ways() -> None:
    assert {find_driver(name).model for name in ("di154", "DI-154RS", "di154rs")} == {"DI-154RS"}
    with pytest.raises(InputError, match="no driver"):
        find_driver("di-700")


# The decoders alone: worked bytes of the fact sheet (A1, A7, A8), damage, any cutting.


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


# Device and driver share no code, so that no error can be made on both sides alike.

ROOT = Path(pendpipe.acquisition.__file__).parent
NEUTRAL = {"pendpipe.acquisition.clock", "pendpipe.acquisition.models"}
LINE = "pendpipe.acquisition.line"
"""Time, the figures of a box, and the line: none knows a byte of a protocol."""


def imports(module: Path) -> set[str]:
    """Every module named in an import of the file, at any depth."""
    found: set[str] = set()
    for node in ast.walk(ast.parse(module.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found |= {name.name for name in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0
            found.add(node.module or "")
    return found


@pytest.mark.parametrize(
    ("side", "allowed"), [("devices", NEUTRAL), ("drivers", NEUTRAL | {LINE}), (".", None)]
)
def test_devices_and_drivers_know_nothing_of_each_other(
    side: str, allowed: set[str] | None
) -> None:
    """Nor does what both may use know either."""
    names = ["clock.py", "line.py", "models.py"] if allowed is None else ["*.py"]
    found = [path for name in names for path in (ROOT / side).glob(name)]
    assert found
    ours = {name for path in found for name in imports(path) if name.startswith("pendpipe.acq")}
    own = f"pendpipe.acquisition.{side}"
    assert {name for name in ours if not name.startswith(own)} <= (allowed or NEUTRAL)
