"""The recorder: bytes off the wire are kept first, over breaks of the line, and decoded later.

A simulated device is recorded from as a real one is, over a line of its own (`acquire_simulated`).
"""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext, suppress
from dataclasses import dataclass
from datetime import UTC, datetime
from io import BytesIO, StringIO
from pathlib import Path
from typing import IO, Any, Final, TextIO, cast

import numpy as np

from pendpipe.acquisition.clock import ScaledClock
from pendpipe.acquisition.decode import decode_recording
from pendpipe.acquisition.devices.simulated import Signal, SimulatedDevice
from pendpipe.acquisition.drivers import find_driver, identify
from pendpipe.acquisition.drivers.base import Driver, Identity, Setup
from pendpipe.acquisition.drivers.streams import STOP_CODE, Scans
from pendpipe.acquisition.line import Line, LineLostError
from pendpipe.acquisition.raw import (
    INTERRUPTED,
    RawWriter,
    is_being_recorded,
    lock,
    read_raw,
)
from pendpipe.arrays import FloatArray
from pendpipe.errors import InputError, refuse_if
from pendpipe.recording import Recording

_POLLS: Final = 256
"""Time stamps of a recording, at least, so that its rate can be measured."""
_SHORTEST_POLL_S, _LONGEST_POLL_S = 0.001, 0.02
_BACKLOG: Final = 2048
"""So many bytes at once say that more wait: a pseudo-terminal hands out 4 kB at a time."""
_SILENCE_S: Final = 3.0
"""Seconds of the host without a byte (beyond the time of a few scans) that are a break."""
_PATIENCE_S: Final = 5.0
"""Seconds of the host, beyond a tenth more than asked, that a slow device is waited for."""
_RETRY_S: Final = 0.2
"""Seconds of the host between two attempts to find the device again."""


@dataclass(frozen=True)
class AcquisitionRequest:
    """What is to be recorded.

    Parameters
    ----------
    rate_hz
        Scans a second; the nearest that the device can do is taken.
    duration_s
        Length in s of the recorder's clock: as many scans as it holds at the device's nominal
        rate. A device that is faster than it claims is recorded for the whole time.
    channels
        Channels as printed on the box, from 1; `record` returns the first of them (the others are
        decoded by `decode_recording` from the raw file).
    range_volts
        The signal stays within plus and minus it: the smallest range that holds it is taken.
    reconnect_s
        For so many seconds of the host a device that was unplugged, fell silent or
        overflowed is looked for again; what was missed is a gap.
    """

    rate_hz: float
    duration_s: float
    channels: Sequence[int] = (1,)
    range_volts: float | None = None
    reconnect_s: float = 30.0

    def __post_init__(self) -> None:
        for name in ("rate_hz", "duration_s", "range_volts"):
            value = getattr(self, name)
            refuse_if(
                value is not None and not (math.isfinite(value) and value > 0),
                name,
                f"{value or 0:g} is not a positive number",
                "give one above 0",
            )


_REFRESH_S: Final = 0.2
"""Between two lines of progress: five a second are read as motion."""
_MEMORY_S: Final = 5.0
"""The amplitude shown is that of the last seconds, of the recorder's clock."""


class ProgressLine:
    """Elapsed time, scans, rate, amplitude now and losses, rewritten in place.

    Parameters
    ----------
    stream
        Where to write, usually standard error; nothing is written if it is no terminal.
    duration_s
        What was asked for.
    """

    def __init__(self, stream: TextIO, duration_s: float) -> None:
        self._stream = stream
        self._duration_s = duration_s
        self._shown = 0.0
        self._scans = self._lost = self._breaks = 0
        self._new = b""
        self._extremes: deque[tuple[float, float, float]] = deque()

    def add(self, elapsed_s: float, data: bytes, session: Session) -> None:
        """Show further bytes of the stream, by `elapsed_s` of the recorder's clock."""
        if not self._stream.isatty():
            return
        self._new += data
        if time.monotonic() - self._shown <= _REFRESH_S:
            return
        self._shown = time.monotonic()
        scans = session.decode(self._new)
        self._new = b""
        self._scans += len(scans.counts)
        self._lost += sum(loss.lost_scans for loss in scans.losses if loss.after_scan)
        if len(scans.counts):
            volts = scans.counts[:, 0] * session.step_volts
            self._extremes.append((elapsed_s, float(volts.min()), float(volts.max())))
        while len(self._extremes) > 1 and self._extremes[0][0] < elapsed_s - _MEMORY_S:
            self._extremes.popleft()
        self._write(f"\r{self.text(elapsed_s)}\x1b[K")

    def interrupt(self) -> None:
        """Count a break; what follows is another stream."""
        self._breaks += 1
        self._new = b""
        self._extremes.clear()

    def text(self, elapsed_s: float) -> str:
        """The line without its control characters."""
        _, low, high = zip(*self._extremes or [(0.0, 0.0, 0.0)], strict=True)
        return (
            f"{elapsed_s:.1f} of {self._duration_s:g} s, {self._scans} scans,"
            f" {self._scans / max(elapsed_s, 1e-9):.1f} Hz,"
            f" amplitude {0.5 * (max(high) - min(low)):.3f} V, {self._lost} lost"
            + (f", {self._breaks} break(s)" if self._breaks else "")
        )

    def end(self) -> None:
        """Close the display."""
        if self._shown:
            self._write("\n")

    def _write(self, text: str) -> None:
        """Show it, unless the terminal has gone: that must not end a recording."""
        with suppress(OSError):
            self._stream.write(text)
            self._stream.flush()


@dataclass(frozen=True)
class Session:
    """An instrument that has been set.

    Parameters
    ----------
    instrument
        Its driver.
    identity, setup
        What it says of itself, and how it samples.
    """

    instrument: Driver
    identity: Identity
    setup: Setup

    @property
    def scan_bytes(self) -> int:
        """Bytes in a scan: two a sample, in all families."""
        return 2 * len(self.setup.channels)

    @property
    def step_volts(self) -> float:
        """Volts a count."""
        return float(self.setup.range_volts / 2 ** (self.instrument.bits - 1))

    def decode(self, data: bytes) -> Scans:
        """Turn bytes of the stream into scans."""
        return self.instrument.decode(data, len(self.setup.channels))

    def description(self, request: AcquisitionRequest, clock: ScaledClock) -> dict[str, object]:
        """What instrument this is, and how it records."""
        return {
            "model": self.identity.model,
            "firmware": self.identity.firmware or None,
            "serial_number": self.identity.serial_number or None,
            "channels": list(self.setup.channels),
            "bits": self.instrument.bits,
            "range_volts": self.setup.range_volts,
            "rate_hz": self.setup.rate_hz,
            "requested_rate_hz": request.rate_hz,
            "duration_s": request.duration_s,
            "clock_scale": clock.scale,
            "recorded_at": datetime.now(UTC).isoformat(timespec="seconds"),
        }


def begin(
    line: Line, driver: type[Driver], request: AcquisitionRequest, clock: ScaledClock
) -> Session:
    """Ask the device who it is, and set it."""
    instrument = driver(line, clock)
    identity = instrument.identify()
    setup = instrument.configure(request.channels, request.rate_hz, request.range_volts)
    return Session(instrument, identity, setup)


def receive(
    session: Session,
    request: AcquisitionRequest,
    clock: ScaledClock,
    writer: RawWriter,
    progress: ProgressLine,
) -> None:
    """Keep everything from start to end, with its time; a break ends or resumes it."""
    line, scale, rate_hz = session.instrument.line, clock.scale, session.setup.rate_hz
    wanted = max(1, round(request.duration_s * rate_hz))
    poll_s = min(_LONGEST_POLL_S, max(_SHORTEST_POLL_S, request.duration_s / scale / _POLLS))
    # A packet may gather many scans before it is sent.
    silence_s = _SILENCE_S + 64 / rate_hz / scale
    latest_s = 1.1 * request.duration_s + _PATIENCE_S * scale
    received, recent, by_clock, reason = 0, b"", False, ""
    # Taken before the start, so that a device can only seem late, never early.
    origin_s = clock.now()
    try:
        session.instrument.start()
        while not reason:
            try:
                data = line.receive(silence_s)
                broken = ""
            except LineLostError as fault:
                data, broken = b"", fault.problem
            elapsed_s = clock.now() - origin_s
            if data:
                writer.data(elapsed_s, data)
                received += len(data)
            progress.add(elapsed_s, data, session)
            recent = recent[-16:] + data
            stop = STOP_CODE.search(recent) if session.instrument.sends_stop_codes else None
            enough = received >= wanted * session.scan_bytes
            # A device that is faster than it claims is recorded for the whole time.
            by_clock |= enough and elapsed_s < 0.9 * (wanted - 1) / rate_hz
            if elapsed_s >= (request.duration_s if by_clock else latest_s) and not broken:
                reason = "time"
            elif broken or not data or stop:
                broken = broken or (
                    f"the device ended its stream with '{stop.group().decode()}'"
                    if data and stop
                    else f"the device fell silent after {elapsed_s:.6g} s"
                )
                writer.event(elapsed_s, event="broken", reason=broken)
                by_clock, recent = True, b""
                again = _resumed(session, request, clock, origin_s, writer, broken)
                if again is None:
                    reason = broken
                else:
                    session = again
                    progress.interrupt()
            elif enough and not by_clock:
                reason = "scans"
            elif len(data) < _BACKLOG:
                time.sleep(poll_s)
        session.instrument.stop()
    except LineLostError as fault:
        reason = reason or fault.problem
    except KeyboardInterrupt:
        reason = INTERRUPTED
        _stop(session)
    except OSError:
        # The disk, not the line: the device need not fill its buffer meanwhile.
        _stop(session)
        raise
    finally:
        progress.end()
    keep = {"keep_scans": wanted} if reason == "scans" else {}
    writer.event(clock.now() - origin_s, event="stopped", reason=reason, **keep)


def _stop(session: Session) -> None:
    try:
        session.instrument.stop()
    except InputError:
        session.instrument.line.close()


def _resumed(
    session: Session,
    request: AcquisitionRequest,
    clock: ScaledClock,
    origin_s: float,
    writer: RawWriter,
    reason: str,
) -> Session | None:
    """Find the device again and start it, if that is possible in time."""
    line, driver = session.instrument.line, type(session.instrument)
    until_s = time.monotonic() + request.reconnect_s
    while time.monotonic() < until_s and clock.now() - origin_s < request.duration_s:
        try:
            if not line.is_open:
                line.open(driver.baudrate)
            line.set_baudrate(driver.baudrate)
            # Another device, or an answer that was damaged: it is asked again.
            again = begin(line, driver, request, clock)
            refuse_if(
                (again.identity, again.setup) != (session.identity, session.setup),
                line.port,
                "another device answers",
                "ask it again",
            )
            writer.event(clock.now() - origin_s, event="restarted", reason=reason)
            again.instrument.start()
        except InputError:
            line.close()
            time.sleep(_RETRY_S)
        else:
            return again
    return None


def record(
    port: str,
    driver: str | None = None,
    *,
    clock: ScaledClock | None = None,
    raw_path: str | Path | None = None,
    volts_per_radian: float | None = None,
    source: str | None = None,
    progress: ProgressLine | None = None,
    **wanted: Any,
) -> Recording:
    """Record from the device on a port, and decode.

    Parameters
    ----------
    port
        A device file, a COM port, ``socket://HOST:PORT`` or ``rfc2217://HOST:PORT``.
    driver
        The model, a key of `drivers.DRIVERS`; the device is asked when not given.
    clock
        The recorder's clock; real time by default, a simulated device's ``clock`` for one.
    raw_path
        The file, a new one, in which the bytes off the wire are kept; in memory only when
        not given.
    volts_per_radian
        The sensor's constant, for the metadata.
    source
        What to call the source in the metadata; model and port by default.
    progress
        A display to keep up to date.
    **wanted
        Rate, length, channels, ...: see `AcquisitionRequest`.

    Returns
    -------
    Recording
        In volts. Read its `notes`: losses, an early end, a rate that is not the nominal one.

    Raises
    ------
    InputError
        If the port can't be opened, the device is silent or another one, the setting is
        impossible, nothing was received, the raw file exists, or it can't be written: what it
        holds by then is good.
    """
    request, clock = AcquisitionRequest(**wanted), clock or ScaledClock()
    kind = find_driver(driver or identify(port).model)
    with Line(port, kind.baudrate) as line:
        session = begin(line, kind, request, clock)
        own = {"port": port, "volts_per_radian": volts_per_radian, "source": source}
        header = session.description(request, clock) | own
        known = {key: value for key, value in header.items() if value is not None}
        bytes_per_s = session.setup.rate_hz * session.scan_bytes
        with _opened(raw_path) as stream:
            try:
                writer = RawWriter(stream, known, bytes_per_s=bytes_per_s)
                progress = progress or ProgressLine(StringIO(), request.duration_s)
                receive(session, request, clock, writer, progress)
            except OSError as fault:
                raise _cannot_write(raw_path or "memory", fault) from None
            content = stream.getvalue() if isinstance(stream, BytesIO) else None
    return decode_recording(content if content is not None else Path(raw_path or ""))


def _opened(raw_path: str | Path | None) -> AbstractContextManager[IO[bytes]]:
    """Open a new raw file, which is appended to in its place so that a crash leaves it."""
    if raw_path is None:
        return nullcontext(BytesIO())
    path = Path(raw_path)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        # Unbuffered: what was written is the system's at once. What exists stays as it is,
        # but for devices (a null device may be written to) and attempts without data.
        free = (path.exists() and not path.is_file()) or _is_without_data(path)
        stream = cast("IO[bytes]", path.open("wb" if free else "xb", buffering=0))
    except FileExistsError:
        raise InputError(
            path,
            "the file exists, and a raw recording is never overwritten",
            f"name another one (pendpipe acquire --recover {path} --out FILE.csv decodes it)",
        ) from None
    except OSError as fault:
        raise _cannot_write(raw_path, fault) from None
    lock(stream)
    return stream


def _is_without_data(path: Path) -> bool:
    """Whether a file is an attempt that ended before the first byte of the stream."""
    with suppress(InputError):
        return path.is_file() and not is_being_recorded(path) and not read_raw(path).data
    return False


def _cannot_write(place: str | Path, fault: OSError) -> InputError:
    return InputError(
        place,
        f"can't be written ({fault.strerror})",
        "make room, or give another file; pendpipe acquire --recover opens what was kept",
    )


_LINE_BYTES_PER_S: Final = 2e6
"""What a pseudo-terminal is asked to carry at most; it was seen to carry twice as much."""
_SHORTEST_S: Final = 0.1
"""Seconds of wall-clock time that a recording takes at least."""


def acquire_simulated(
    device_kind: str,
    signal: Signal | Mapping[int, Signal],
    *,
    rate_hz: float,
    duration_s: float,
    clock_scale: float = 1000.0,
    channels: Sequence[int] = (1,),
    link: str | None = None,
    rate_error: float = 0.0,
    **options: Any,
) -> Recording:
    """Start a simulated device on a line of its own and record from it.

    Parameters
    ----------
    device_kind
        A key of `devices.DEVICES`: ``"di154"`` (12 bits), ``"di2108"`` (16 bits), ...
    signal
        Times in s since the start to volts at the terminals, noise included; or a mapping
        from channel to that. See `SimulatedDevice`.
    clock_scale
        How many seconds of device and recorder pass in one of wall-clock time. It is lowered to
        what the line can carry (2 MB/s), and so that a recording takes 0.1 s at least: in less
        the rate can't be measured.
    link
        ``"pty"``, ``"socket"``, or ``None`` for what the system has.
    rate_error
        The device's clock is fast by this fraction.
    rate_hz, duration_s, channels, **options
        See `recorder.record`.

    Returns
    -------
    Recording
        In volts.

    Raises
    ------
    InputError
        As `recorder.record`; and whatever `signal` raises.
    """
    AcquisitionRequest(rate_hz, duration_s)
    bytes_per_s = 2 * max(1, len(channels)) * rate_hz
    fastest = min(_LINE_BYTES_PER_S / bytes_per_s, duration_s / _SHORTEST_S)
    scale = min(clock_scale, max(1.0, fastest))
    with SimulatedDevice(
        device_kind, signal, clock_scale=scale, link=link, rate_error=rate_error
    ) as device:
        return record_from(
            device, rate_hz=rate_hz, duration_s=duration_s, channels=channels, **options
        )


def record_from(device: SimulatedDevice, **options: Any) -> Recording:
    """Record from a simulated device that is switched on.

    Raises
    ------
    InputError
        As `recorder.record`; and whatever the device's signal raises.
    """
    source = f"simulated {device.dialect.model}"
    try:
        return record(device.port, device.kind, clock=device.clock, **{"source": source, **options})
    except InputError:
        # A device whose signal has failed is silent; the failure is the better answer.
        if device.failure is not None:
            raise device.failure from None
        raise


def example_signal(seed: int = 0, volts_per_radian: float = 3.85) -> Signal:
    """A pendulum where none is given: viscous decay with a little noise.

    theta = 0.3 rad exp(-beta t) cos(2 pi f t), f = 0.5 Hz, Q = pi f/beta = 150, read by a
    sensor with 1 mV of white noise.
    """
    random = np.random.default_rng(seed)
    frequency_hz, quality_factor, amplitude_rad, noise_volts = 0.5, 150.0, 0.3, 1e-3
    beta = math.pi * frequency_hz / quality_factor

    def signal(time_s: FloatArray) -> FloatArray:
        angle_rad = amplitude_rad * np.exp(-beta * time_s)
        angle_rad *= np.cos(2.0 * math.pi * frequency_hz * time_s)
        volts = volts_per_radian * angle_rad
        return np.asarray(volts + random.normal(0.0, noise_volts, len(time_s)))

    return signal
