"""The recorder: the bytes off the wire are kept first, and decoded afterwards."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from datetime import UTC, datetime
from io import BytesIO
from pathlib import Path
from typing import IO, Final, Protocol

from pendpipe.acquire.clock import Clock, ScaledClock
from pendpipe.acquire.decode import decode_recording
from pendpipe.acquire.drivers import find_driver
from pendpipe.acquire.drivers.base import Driver, Identity, Setup
from pendpipe.acquire.line import Line, LineLostError
from pendpipe.acquire.raw import RawWriter
from pendpipe.errors import InputError
from pendpipe.recording import Recording

_POLLS: Final = 256
"""Time stamps of a recording, at least, so that its rate can be measured."""
_SHORTEST_POLL_S, _LONGEST_POLL_S = 0.001, 0.02
_BACKLOG: Final = 2048
"""So many bytes at once say that more wait: a pseudo-terminal hands out 4 kB at a time."""
_SILENCE_S: Final = 3.0
"""Seconds of the host without a byte (beyond the time of a few scans) that end a session."""
_PATIENCE_S: Final = 5.0
"""Seconds of the host, beyond a tenth more than asked, that a slow device is waited for."""


class Progress(Protocol):
    """Somebody who wants to see how a recording goes on."""

    def begin(self, driver: type[Driver], setup: Setup) -> None:
        """Take notice of what is recorded."""

    def update(self, elapsed_s: float, data: bytes) -> None:
        """Take notice of further bytes, by `elapsed_s` of the recorder's clock."""

    def end(self) -> None:
        """Take leave."""


@dataclass(frozen=True)
class Wish:
    """What is to be recorded.

    Parameters
    ----------
    channels
        Channels as printed on the box, from 1.
    rate_hz
        Scans a second; the nearest that the device can do is taken.
    duration_s
        Seconds of the recorder's clock.
    """

    channels: tuple[int, ...]
    rate_hz: float
    duration_s: float

    def __post_init__(self) -> None:
        for name in ("rate_hz", "duration_s"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0):
                raise InputError(name, f"{value:g} is no positive number", "give one above 0")


def record(
    port: str,
    driver: str,
    *,
    channels: Sequence[int] = (1,),
    rate_hz: float,
    duration_s: float,
    clock: Clock | None = None,
    raw_path: str | Path | None = None,
    volts_per_radian: float | None = None,
    source: str | None = None,
    progress: Progress | None = None,
) -> Recording:
    """Record from the device on a port, and decode.

    Parameters
    ----------
    port
        A device file, a COM port, or a URL of pyserial.
    driver
        The model, a key of `drivers.DRIVERS`.
    channels
        Channels as printed on the box, from 1; the first of them is returned (the others
        by `decode_recording` from the raw file).
    rate_hz
        Scans a second; the nearest that the device can do is taken.
    duration_s
        Length in s: as many scans as it holds at the device's nominal rate. A device that is
        faster than it says is heard for the whole time.
    clock
        The recorder's clock; real time by default, a simulated device's ``clock`` for one.
    raw_path
        Where the bytes off the wire are kept; in memory only when not given.
    volts_per_radian
        The sensor's constant, for the metadata.
    source
        What to call the source in the metadata; model and port by default.
    progress
        Somebody to keep informed.

    Returns
    -------
    Recording
        In volts. Read its `notes`: losses, an early end, a rate that is not the nominal one.

    Raises
    ------
    InputError
        If the port can't be opened, the device is silent or another one, the setting is
        impossible, or nothing was received.
    """
    wish = Wish(tuple(channels), rate_hz, duration_s)
    clock = clock or ScaledClock()
    kind = find_driver(driver)
    with Line(port, kind.baudrate) as line:
        instrument = kind(line, clock)
        identity = instrument.identify()
        setup = instrument.configure(wish.channels, wish.rate_hz)
        with _opened(raw_path) as stream:
            header = _header(port, identity, setup, wish, clock)
            header |= {"volts_per_radian": volts_per_radian, "source": source}
            writer = RawWriter(stream, {key: v for key, v in header.items() if v is not None})
            if progress:
                progress.begin(kind, setup)
            try:
                _stream(instrument, setup, wish, clock, writer, progress)
            except OSError as fault:
                raise _cannot_write(raw_path or "memory", fault) from None
            content = stream.getvalue() if isinstance(stream, BytesIO) else None
    return decode_recording(content if content is not None else Path(raw_path or ""))


def _stream(
    instrument: Driver,
    setup: Setup,
    wish: Wish,
    clock: Clock,
    writer: RawWriter,
    progress: Progress | None,
) -> None:
    """Keep everything from start to stop, with its time."""
    scans = max(1, round(wish.duration_s * setup.rate_hz))
    wanted = scans * type(instrument).decoder(len(setup.channels)).bytes_per_scan
    poll_s = wish.duration_s / clock.scale / _POLLS
    poll_s = min(_LONGEST_POLL_S, max(_SHORTEST_POLL_S, poll_s))
    latest_s = 1.1 * wish.duration_s + _PATIENCE_S * clock.scale
    # A packet may gather many scans before it is sent.
    silence_s = _SILENCE_S + 64 / setup.rate_hz / clock.scale
    received, reason, fast = 0, "", False
    # Taken before the start, so that a device can only seem late, never early.
    origin_s = clock.now()
    instrument.start()
    try:
        while not reason:
            data = instrument.receive(silence_s)
            elapsed_s = clock.now() - origin_s
            if data:
                writer.data(elapsed_s, data)
                received += len(data)
            if progress:
                progress.update(elapsed_s, data)
            enough = received >= wanted
            fast = fast or (enough and elapsed_s < 0.9 * (scans - 1) / setup.rate_hz)
            if not data:
                reason = f"the device fell silent after {elapsed_s:.6g} s"
            elif enough and not fast:
                reason = "scans"
            elif elapsed_s >= (wish.duration_s if fast else latest_s):
                reason = "time"
            elif len(data) < _BACKLOG:
                time.sleep(poll_s)
        instrument.stop()
    except LineLostError as fault:
        reason = fault.problem
    except KeyboardInterrupt:
        reason = "interrupted by the user"
        instrument.stop()
    finally:
        if progress:
            progress.end()
    keep = {"keep_scans": scans} if reason == "scans" else {}
    writer.event(clock.now() - origin_s, event="stopped", reason=reason, **keep)


def _opened(raw_path: str | Path | None) -> AbstractContextManager[IO[bytes]]:
    """Open the raw file, which is appended to in its place so that a crash leaves it."""
    if raw_path is None:
        return nullcontext(BytesIO())
    try:
        Path(raw_path).parent.mkdir(parents=True, exist_ok=True)
        return Path(raw_path).open("wb")
    except OSError as fault:
        raise _cannot_write(raw_path, fault) from None


def _cannot_write(place: str | Path, fault: OSError) -> InputError:
    return InputError(
        place, f"can't be written ({fault.strerror})", "make room, or give another file"
    )


def _header(
    port: str, identity: Identity, setup: Setup, wish: Wish, clock: Clock
) -> dict[str, object]:
    """Describe a recording for whoever finds the file."""
    kind = find_driver(identity.model)
    return {
        "model": identity.model,
        "firmware": identity.firmware or None,
        "serial_number": identity.serial_number or None,
        "port": port,
        "channels": list(setup.channels),
        "bits": kind.bits,
        "range_volts": kind.range_volts,
        "rate_hz": setup.rate_hz,
        "requested_rate_hz": wish.rate_hz,
        "duration_s": wish.duration_s,
        "clock_scale": clock.scale,
        "recorded_at": datetime.now(UTC).isoformat(timespec="seconds"),
    }
