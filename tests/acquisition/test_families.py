"""The other families alone: worked bytes of the fact sheet (A1, A5 to A8), and sessions."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from pendpipe.acquisition.clock import ScaledClock
from pendpipe.acquisition.devices import DEVICES
from pendpipe.acquisition.drivers import DRIVERS, find_driver
from pendpipe.acquisition.drivers.letters import DI245
from pendpipe.acquisition.drivers.streams import Loss, plain_scans
from pendpipe.acquisition.drivers.text import DI149, DI155
from pendpipe.errors import InputError

FAST = ScaledClock(1e6)
WORKED = [
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
    ("di4108", "FF 7F", 32767, 5.0, 4.99985),
    ("di4108", "00 60", 24576, 5.0, 3.75),
    ("di2108p", "FF FF", -1, 5.0, -0.00015),
    ("di2108p", "00 40", 16384, 10.0, 5.0),
    ("di4208", "00 40", 16384, 100.0, 50.0),
    ("di4718b", "FF 7F", 32767, 5.0, 4.99985),
]


@pytest.mark.parametrize(("kind", "received", "count", "high", "volts"), WORKED)
def test_worked_bytes_decode(
    kind: str, received: str, count: int, high: float, volts: float
) -> None:
    driver = find_driver(kind)
    assert driver.decode(bytes.fromhex(received), 1).counts.tolist() == [[count]]
    assert count * high / 2 ** (driver.bits - 1) == pytest.approx(volts, abs=5e-6)


@pytest.mark.parametrize(("kind", "sent", "code", "high", "volts"), WORKED)
def test_worked_bytes_are_sent(kind: str, sent: str, code: int, high: float, volts: float) -> None:
    assert DEVICES[kind]().encode(np.full((1, 1), code)) == bytes.fromhex(sent)


def test_digital_inputs_below_a_left_justified_word_are_no_signal() -> None:
    """On the DI-1100 the two low bits of the first item are digital inputs."""
    assert plain_scans(bytes.fromhex("F3 7F"), 1, 12).counts.tolist() == [[2047]]


@pytest.mark.parametrize("kind", sorted(DRIVERS))
@pytest.mark.parametrize("channels", [1, 3])
def test_what_the_device_sends_the_driver_reads(kind: str, channels: int) -> None:
    """Every code of every model on every channel; they share no code."""
    driver, device = find_driver(kind), DEVICES[kind]()
    assert device.bits == driver.bits
    assert device.model == driver.model
    half = 2 ** (driver.bits - 1)
    codes = np.stack([np.roll(np.arange(-half, half), 5 * c) for c in range(channels)], axis=1)
    scans = driver.decode(device.encode(codes), channels)
    assert np.array_equal(scans.counts, codes)
    assert not scans.losses


def test_di149_session(script: Any) -> None:
    echoed = ["asc", "slist 0 x0000", "slist 1 x0002", "slist 2 xffff", "srate 7500", "bin"]
    line = script(
        (b"stop\r", b"\x01\x02stop\r"),
        (b"info 0\r", b"info 0 DATAQ\r"),
        (b"info 1\r", b"info 1 149\r"),
        (b"info 2\r", b"info 2 65\r"),
        (b"info 6\r", b"info 6 12345601\r"),
        *[(f"{text}\r".encode(), f"{text}\r".encode()) for text in echoed],
        (b"start\r", b"start\r" + bytes.fromhex("60 81 01 C1")),
        (b"stop\r", b"\x01stop\r"),
    )
    driver = DI149(line, FAST)
    assert driver.identify().serial_number == "12345601"
    assert driver.configure([3, 1], 100.0).rate_hz == 100.0
    driver.start()
    assert driver.decode(driver.line.receive(1.0), 2).counts.tolist() == [[12, 1024]]
    driver.stop()
    assert line.finished


def test_di155_gain_is_the_largest_that_holds_the_signal(script: Any) -> None:
    """7 V: +-10 V is gain 5, code 3 in bits 8 to 10."""
    echoed = ["asc", "slist 0 x0301", "slist 1 xffff", "srate 12500", "bin"]
    line = script(*[(f"{text}\r".encode(), f"{text}\r".encode()) for text in echoed])
    setup = DI155(line, FAST).configure([2], 60.0, range_volts=7.0)
    assert (setup.rate_hz, setup.range_volts) == (60.0, 10.0)
    assert line.finished


def test_di245_session(script: Any) -> None:
    def short(text: str, answer: bytes = b"") -> list[tuple[bytes, bytes]]:
        first, second = (letter.encode() for letter in text)
        return [(b"\0" + first, first), (second, second + answer)]

    line = script(
        *short("S0"),
        *short("A1", b" 2450\r"),
        *short("A2", b" 68\r"),
        *short("NZ", b"12345601\r"),
        # Channel 1 in +-5 V is word 0x0B00, channel 4 0x0B03; 10 Hz of each is 20 in all:
        # 8000/((99 + 1)(1 + 3)).
        (b"chn 0 2816\r", b"chn 0 2816\r"),
        (b"chn 1 2819\r", b"chn 1 2819\r"),
        (b"xrate 355 20\r", b"xrate 355 20\r"),
        *short("S1", bytes.fromhex("02 81 01 C1")),
        *short("S0"),
    )
    driver = DI245(line, FAST)
    assert driver.identify().firmware == "68"
    setup = driver.configure([1, 4], 10.0, range_volts=3.0)
    assert (setup.rate_hz, setup.range_volts) == (10.0, 5.0)
    driver.start()
    assert driver.decode(driver.line.receive(1.0), 2).counts.tolist() == [[1, 4096]]
    driver.stop()
    assert line.finished


def test_di4108_range_code_stands_in_bits_8_to_11(script: Any) -> None:
    echoed = ["encode 0", "slist 0 1027", "srate 60000", "dec 10", "deca 1", "filter * 0", "ps 0"]
    line = script(*[(f"{text}\r".encode(), f"{text}\r".encode()) for text in echoed])
    setup = find_driver("di4108")(line, FAST).configure([4], 100.0, range_volts=0.5)
    assert setup.range_volts == 0.5
    assert line.finished


def test_di2108p_has_ranges_and_no_deca(script: Any) -> None:
    """+-2.5 V is code 2: word 0x0201 for the second channel."""
    echoed = ["encode 0", "slist 0 513", "srate 60000", "dec 10", "filter * 0", "ps 0"]
    line = script(*[(f"{text}\r".encode(), f"{text}\r".encode()) for text in echoed])
    setup = find_driver("DI-2108-P")(line, FAST).configure([2], 100.0, range_volts=2.0)
    assert (setup.rate_hz, setup.range_volts) == (100.0, 2.5)
    assert line.finished


def test_a_hyphen_more_or_less_in_a_name_is_the_same_model(script: Any) -> None:
    answers = ["info 0 DATAQ", "info 1 2108P", "info 2 1", "info 6 1"]
    asked = ["info 0", "info 1", "info 2", "info 6"]
    pairs = [(f"{a}\r".encode(), f"{b}\r".encode()) for a, b in zip(asked, answers, strict=True)]
    line = script((b"stop\r", b"stop\r"), *pairs)
    assert find_driver("di2108p")(line, FAST).identify().model == "DI-2108P"
    line = script((b"stop\r", b"stop\r"), *pairs)
    with pytest.raises(InputError, match="this is a DI-2108P, no DI-2108"):
        find_driver("di2108")(line, FAST).identify()


def test_di4718b_stands_behind_its_amplifiers(script: Any) -> None:
    echoed = ["encode 0", "slist 0 0", "srate 60000", "dec 10", "deca 1", "filter * 0", "ps 0"]
    line = script(*[(f"{text}\r".encode(), f"{text}\r".encode()) for text in echoed])
    assert find_driver("di4718b")(line, FAST).configure([1], 100.0).range_volts == 5.0
    assert line.finished


def test_di1100_has_one_decimation_only(script: Any) -> None:
    echoed = ["encode 0", "slist 0 0", "srate 60000", "deca 10", "filter * 0", "ps 0"]
    line = script(*[(f"{text}\r".encode(), f"{text}\r".encode()) for text in echoed])
    assert find_driver("di1100")(line, FAST).configure([1], 100.0).rate_hz == 100.0
    assert line.finished


@pytest.mark.parametrize(
    ("kind", "channels", "rate_hz", "volts", "message"),
    [
        ("di194rs", [5], 60.0, None, "has no channel 5"),
        ("di149", [1, 2], 6000.0, None, "can't scan 2 channel"),
        ("di149", [1], 5.0, None, "can't scan 1 channel"),
        ("di155", [1], 60.0, 51.0, "has no range of \\+-51 V"),
        ("di245", [1], 2001.0, None, "can't scan 1 channel"),
        ("di1100", [1], 50e3, None, "can't scan at 50000 Hz"),
        ("di2108", [1], 60.0, 12.0, "has no range of \\+-12 V"),
        ("di154rs", [1], 60.0, 20.0, "has no range of \\+-20 V"),
    ],
)
def test_what_the_box_cannot_do_is_refused(
    script: Any, kind: str, channels: list[int], rate_hz: float, volts: float | None, message: str
) -> None:
    with pytest.raises(InputError, match=f"SCRIPT: the DI-.* {message}"):
        find_driver(kind)(script(), FAST).configure(channels, rate_hz, volts)


def test_a_stop_code_ends_the_scans_and_what_only_begins_like_one_is_data() -> None:
    scans = plain_scans(bytes.fromhex("01 00 02 00") + b"stop 02\rxx", 1)
    assert scans.counts.ravel().tolist() == [1, 2]
    assert scans.losses == (Loss(2, 10, 0, reason="stop 02"),)
    assert plain_scans(b"stop 0", 1).counts.tobytes() == b"stop 0"
