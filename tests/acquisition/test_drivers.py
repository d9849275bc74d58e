"""The drivers alone, in pairs of bytes sent and received."""

from __future__ import annotations

from typing import Any

import pytest

from pendpipe.acquisition.clock import ScaledClock
from pendpipe.acquisition.drivers import find_driver
from pendpipe.acquisition.drivers.letters import DI154RS
from pendpipe.acquisition.drivers.text import DI2108
from pendpipe.errors import InputError

FAST = ScaledClock(1e6)
"""The waits between attempts take no time."""
STOP_154 = [(b"\0S", b"S"), (b"0", b"0")]
IDENTIFY_154 = [*STOP_154, (b"\0N", b"N"), (b"Z", b"Z0000000001")]


def test_di154rs_session(script: Any) -> None:
    line = script(
        *IDENTIFY_154,
        (b"\0C", b"C"),
        (b"\x05", b"\x05"),
        (b"\0L", b"L"),
        (b"\x28", b"\x28"),
        (b"\0M", b"M"),
        (b"\x00", b"\x00"),
        (b"\0S", b"S"),
        (b"1", b"1" + bytes.fromhex("90 4D 01 81")),
        *STOP_154,
    )
    driver = DI154RS(line, FAST)
    assert driver.identify().model == "DI-154RS"
    # Two channels take 40 bit times; 40 more make it 60 Hz.
    setup = driver.configure([3, 1], 60.0)
    assert (setup.channels, setup.rate_hz) == ((1, 3), 60.0)
    driver.start()
    assert driver.decode(driver.line.receive(1.0), 2).counts.tolist() == [[1234 - 2048, 0]]
    driver.stop()
    assert line.finished


def test_di154rs_waits_for_each_echo(script: Any) -> None:
    """The argument is not sent before the letter's echo, else the script would break here."""
    line = script(*STOP_154, (b"\0N", b""))
    driver = DI154RS(line, FAST)
    driver.attempts = 1  # type: ignore[misc]
    with pytest.raises(InputError, match="does not answer"):
        driver.identify()
    assert line.finished


def test_di154rs_passes_over_the_junk_of_its_supply(script: Any) -> None:
    line = script(
        (b"\0S", b"\xff\xfe"), (b"0", b"\x7fS0"), (b"\0N", b"\xff\x7fN"), (b"Z", b"Z0000000001")
    )
    assert DI154RS(line, FAST).identify().model == "DI-154RS"


@pytest.mark.parametrize("bad", [b"", b"M"], ids=["missing", "wrong"])
def test_di154rs_tries_an_echo_again(script: Any, bad: bytes) -> None:
    line = script(*STOP_154, (b"\0N", bad), (b"\0N", b"N"), (b"Z", b"Z0000000001"))
    assert DI154RS(line, FAST).identify().model == "DI-154RS"
    assert line.finished


def test_di154rs_stops_before_it_starts_again(script: Any) -> None:
    """After a bad echo of the start the device may stream already."""
    line = script((b"\0S", b"S"), (b"1", b"?"), *STOP_154, (b"\0S", b"S"), (b"1", b"1"))
    DI154RS(line, FAST)._command(b"S", b"1", undo=True)
    assert line.finished


def test_di154rs_stop_is_repeated_while_data_flow(script: Any) -> None:
    line = script((b"\0S", b"\x90\x4d"), (b"0", b"\x90\x4d"), *STOP_154)
    DI154RS(line, FAST).stop()
    assert line.finished


def test_di154rs_takes_9600_baud_for_what_4800_cannot_carry(script: Any) -> None:
    quiet = [(b"\0L", b"L"), (b"\x00", b"\x00"), (b"\0M", b"M"), (b"\x00", b"\x00")]
    line = script(
        (b"\0B", b"B"),
        (b"\x04", b"\x04"),
        (b"\0C", b"C"),
        (b"\x01", b"\x01"),
        *quiet,
        *STOP_154,
        (b"\0B", b"B"),
        (b"\x01", b"\x01"),
    )
    driver = DI154RS(line, FAST)
    assert driver.configure([1], 480.0).rate_hz == 480.0
    driver.stop()
    assert line.baudrates == [9600, 4800]
    assert line.finished


def test_another_model_is_refused(script: Any) -> None:
    line = script(*STOP_154, (b"\0N", b"N"), (b"Z", b"Z0000000000"))
    with pytest.raises(InputError, match="this is a DI-194RS, no DI-154RS"):
        DI154RS(line, FAST).identify()
    line = script(
        (b"stop\r", b"stop\r"),
        (b"info 0\r", b"info 0 DATAQ\r"),
        (b"info 1\r", b"info 1 1100\r"),
        (b"info 2\r", b"info 2 101\r"),
        (b"info 6\r", b"info 6 1\r"),
    )
    with pytest.raises(InputError, match="this is a DI-1100, no DI-2108"):
        DI2108(line, FAST).identify()


def test_di2108_session(script: Any) -> None:
    echoed = ["encode 0", "slist 0 0", "slist 1 6", "srate 60000", "dec 10", "deca 1"]
    line = script(
        (b"stop\r", b"\x00\x40stop\r"),
        (b"info 0\r", b"info 0 DATAQ\r"),
        (b"info 1\r", b"\0\0info 1 2108\r"),
        (b"info 2\r", b"info 2 141\r"),
        (b"info 6\r", b"info 6 5F2A\r"),
        *[(f"{text}\r".encode(), f"{text}\r".encode()) for text in echoed],
        (b"filter * 0\r", b"filter * 0\r"),
        (b"ps 0\r", b"ps 0\r"),
        (b"start\r", bytes.fromhex("FF 7F 00 80 00 40")),
        (b"stop\r", b"\x01stop\r"),
    )
    driver = DI2108(line, FAST)
    identity = driver.identify()
    assert (identity.model, identity.firmware, identity.serial_number) == ("DI-2108", "141", "5F2A")
    assert driver.configure([1, 7], 100.0).rate_hz == 100.0
    driver.start()
    assert driver.decode(driver.line.receive(1.0), 2).counts.tolist() == [[32767, -32768]]
    driver.stop()
    assert line.finished


def test_di2108_without_an_echo_to_encode_goes_on(script: Any) -> None:
    """Seen on a DI-4108."""
    line = script(*[(b"encode 0\r", b"")] * 3)
    assert DI2108(line, FAST)._send_line("encode 0", needed=False) == ""
    assert line.finished


@pytest.mark.parametrize("rate_hz", [3.7, 10.0, 60.0, 110.0, 915.0, 10e3, 160e3])
def test_di2108_finds_divisors_near_any_rate(script: Any, rate_hz: float) -> None:
    divisor, decimation, further = DI2108(script(), FAST)._divisors(rate_hz)
    assert 375 <= divisor <= 65535
    assert 1 <= decimation <= 512
    # One part in the smallest divisor, halved by rounding, is the worst to be had.
    assert 60e6 / (divisor * decimation * further) == pytest.approx(rate_hz, rel=0.5 / 375)


@pytest.mark.parametrize(
    ("model", "channels", "rate_hz", "message"),
    [
        ("di154rs", [5], 60.0, "has no channel 5"),
        ("di154rs", [0], 60.0, "has no channel 0"),
        ("di154rs", [1, 2], 300.0, "can't scan 2 channel"),
        ("di154rs", [1], 0.1, "can't scan 1 channel"),
        ("di2108", [9], 60.0, "has no channel 9"),
        ("di2108", [1], 1e6, "can't scan at 1e\\+06 Hz"),
    ],
)
def test_what_the_box_cannot_do_is_refused(
    script: Any, model: str, channels: list[int], rate_hz: float, message: str
) -> None:
    with pytest.raises(InputError, match=f"SCRIPT: the DI-.* {message}"):
        find_driver(model)(script(), FAST).configure(channels, rate_hz)


@pytest.mark.parametrize("name", ["di154", "DI-154RS", "di154rs"])
def test_a_model_may_be_written_in_its_usual_ways(name: str) -> None:
    assert find_driver(name) is DI154RS


def test_an_unknown_model_is_refused() -> None:
    with pytest.raises(InputError, match="no driver"):
        find_driver("di-700")
