"""The simulated devices alone: worked bytes of the fact sheet (A1, A8), commands and echoes."""

from __future__ import annotations

import numpy as np
import pytest

from pendpipe.acquisition.devices.letters import SimulatedDI154RS
from pendpipe.acquisition.devices.simulated import convert
from pendpipe.acquisition.devices.text import SimulatedDI2108


@pytest.mark.parametrize(
    ("raw", "first", "later"),
    [
        (0, "00 01", "01 01"),
        (1, "08 01", "09 01"),
        (1234, "90 4D", "91 4D"),
        (2047, "F8 7F", "F9 7F"),
        (2048, "00 81", "01 81"),
        (2049, "08 81", "09 81"),
        (4095, "F8 FF", "F9 FF"),
    ],
)
def test_di154rs_sends_the_worked_bytes(raw: int, first: str, later: str) -> None:
    codes = np.full((1, 2), raw - 2048)
    assert SimulatedDI154RS().encode(codes) == bytes.fromhex(first + later)


@pytest.mark.parametrize(
    ("sent", "code"),
    [
        ("FF 7F", 32767),
        ("00 80", -32768),
        ("00 00", 0),
        ("FF FF", -1),
        ("00 40", 16384),
        ("00 60", 24576),
    ],
)
@pytest.mark.parametrize("scans", [1, 100])
def test_di2108_sends_the_worked_bytes(sent: str, code: int, scans: int) -> None:
    assert SimulatedDI2108().encode(np.full((scans, 1), code)) == bytes.fromhex(sent) * scans


def test_converter_rounds_to_the_nearest_code_and_stops_at_its_ends() -> None:
    step = 20 / 4096
    volts = np.array([-99.0, -10.0, -0.51 * step, -0.49 * step, 0.0, 0.51 * step, 10.0, 99.0])
    assert convert(volts, 12, 10.0).tolist() == [-2048, -2048, -1, 0, 0, 1, 2047, 2047]


@pytest.mark.parametrize(
    ("sent", "received"),
    [
        (b"\0NZ", b"NZ0000000001"),
        (b"\0C\x05", b"C\x05"),
        (b"\0L\x14", b"L\x14"),
        (b"\0M\x00", b"M\x00"),
        (b"\0B\x04", b"B\x04"),
        (b"\0S1", b"S1"),
        (b"\0S0", b"S0"),
        (b"info 0\r", b""),
    ],
)
def test_di154rs_echoes_letter_and_argument_but_not_the_nul(sent: bytes, received: bytes) -> None:
    assert SimulatedDI154RS().respond(sent) == received


def test_di154rs_echoes_byte_by_byte() -> None:
    device = SimulatedDI154RS()
    assert [device.respond(bytes([byte])) for byte in b"\0S1"] == [b"", b"S", b"1"]
    assert device.streaming


def test_di154rs_channel_mask_and_rate() -> None:
    device = SimulatedDI154RS()
    assert device.scan_rate_hz == 240.0
    device.respond(b"\0C\x0f")
    assert device.channels == (1, 2, 3, 4)
    assert device.scan_rate_hz == 60.0
    device.respond(b"\0B\x04")
    assert device.scan_rate_hz == 120.0
    device.respond(b"\0B\x01\0C\x01\0L\x14")
    # 20 is what a third party's program sends for 120 Hz.
    assert device.scan_rate_hz == 120.0


@pytest.mark.parametrize(
    ("sent", "received"),
    [
        (b"info 0\r", b"info 0 DATAQ\r"),
        (b"info 1\r", b"info 1 2108\r"),
        (b"info 9\r", b"info 9 60000000\r"),
        (b"slist 0 0\r", b"slist 0 0\r"),
        (b"srate 11718\r", b"srate 11718\r"),
        (b"start\r", b""),
        (b"stop\r", b"stop\r"),
        (b"nonsense\r", b"Command not found\r"),
        (b"\0S1", b""),
    ],
)
def test_di2108_echoes_all_but_start(sent: bytes, received: bytes) -> None:
    assert SimulatedDI2108().respond(sent) == received


def test_di2108_rate_is_sixty_megahertz_over_its_divisors() -> None:
    device = SimulatedDI2108()
    device.respond(b"srate 11718\rdec 512\r")
    # The fact sheet rounds this up, to 10.0007.
    assert device.scan_rate_hz == pytest.approx(10.00064, abs=5e-6)


def test_di2108_obeys_only_stop_while_data_flow() -> None:
    device = SimulatedDI2108()
    device.respond(b"slist 0 2\rslist 1 5\rstart\r")
    assert device.channels == (3, 6)
    assert device.respond(b"info 0\r") == b""
    assert device.respond(b"stop\r") == b"stop\r"
    assert not device.streaming
