"""The recorder: bytes off the wire are kept first, over breaks of the line, and decoded later.

A simulated device is recorded from as a real one is, over a line of its own (`acquire_simulated`).
"""

import math
import time
from collections import deque
from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager, closing, nullcontext, suppress
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
from pendpipe.acquisition.drivers.base import Driver, Identity, Scans, Setup
from pendpipe.acquisition.line import Line, LineLostError
from pendpipe.acquisition.raw import (
    COMPLETE,
    INTERRUPTED,
    RawWriter,
    is_being_recorded,
    lock,
    read_raw,
)
from pendpipe.arrays import AnyArray, FloatArray
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
                f"{value or 0:g} is no positive number",
                "give one above 0",
            )


_REFRESH_S = 0.2
_MEMORY_S = 5.0
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
        self._recent: deque[tuple[float, AnyArray]] = deque()
        self._step = 0.0

    def begin(self, step_volts: float) -> None:
        """Show a stream of counts of so many volts each; another one after a break."""
        self._breaks += self._step > 0.0
        self._recent.clear()
        self._step = step_volts

    def update(self, elapsed_s: float, scans: Scans) -> None:
        """Show further scans, by `elapsed_s` of the recorder's clock."""
        if not self._stream.isatty():
            return
        self._scans += len(scans.counts)
        self._lost += sum(loss.lost_scans for loss in scans.losses if loss.after_scan)
        if len(scans.counts):
            self._recent.append((elapsed_s, scans.counts[:, 0]))
        while len(self._recent) > 1 and self._recent[0][0] < elapsed_s - _MEMORY_S:
            self._recent.popleft()
        if time.monotonic() - self._shown > _REFRESH_S:
            self._shown = time.monotonic()
            self._write(f"\r{self.text(elapsed_s)}\x1b[K")

    def text(self, elapsed_s: float) -> str:
        """The line without its control characters."""
        recent = [counts.astype(np.int64) for _, counts in self._recent]
        amplitude = 0.5 * self._step * float(np.ptp(np.concatenate(recent))) if recent else 0.0
        rate = self._scans / elapsed_s if elapsed_s > 0 else 0.0
        return (
            f"{elapsed_s:.1f} of {self._duration_s:g} s, {self._scans} scans, {rate:.1f} Hz, "
            f"amplitude {amplitude:.3f} V, {self._lost} lost"
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


class Session:
    """One recording with one instrument, kept as it comes.

    Parameters
    ----------
    line
        The open line; the session closes it, and opens it again after a break.
    driver
        The model.
    request
        What is to be recorded.
    clock
        The recorder's clock.
    progress
        A display to keep up to date.
    """

    def __init__(
        self,
        line: Line,
        driver: type[Driver],
        request: AcquisitionRequest,
        clock: ScaledClock,
        progress: ProgressLine | None = None,
    ) -> None:
        self._line = line
        self._driver = driver
        self._request = request
        self._clock = clock
        self._progress = progress or ProgressLine(StringIO(), request.duration_s)
        self._received = 0
        self._by_clock = False  # the clock ends it, not the count of scans
        self.identity, self.setup = self._introduce()

    def close(self) -> None:
        """Close the line."""
        self._line.close()

    def description(self) -> dict[str, object]:
        """What instrument this is, and how it records."""
        return {
            "model": self.identity.model,
            "firmware": self.identity.firmware or None,
            "serial_number": self.identity.serial_number or None,
            "channels": list(self.setup.channels),
            "bits": self._driver.bits,
            "range_volts": self.setup.range_volts,
            "rate_hz": self.setup.rate_hz,
            "requested_rate_hz": self._request.rate_hz,
            "duration_s": self._request.duration_s,
            "clock_scale": self._clock.scale,
            "recorded_at": datetime.now(UTC).isoformat(timespec="seconds"),
        }

    def run(self, stream: IO[bytes], header: Mapping[str, object]) -> None:
        """Keep everything from start to end, with its time; a break ends or resumes it."""
        known = {key: value for key, value in header.items() if value is not None}
        bytes_per_s = self.setup.rate_hz * self._decoder.bytes_per_scan
        writer = RawWriter(stream, known, bytes_per_s=bytes_per_s)
        # Taken before the start, so that a device can only seem late, never early.
        self._origin_s = self._clock.now()
        reason = ""
        try:
            self._instrument.start()
            reason = self._listen(writer)
            while reason not in COMPLETE and self._resume(reason, writer):
                reason = self._listen(writer)
            self._instrument.stop()
        except LineLostError as fault:
            reason = reason or fault.problem
        except KeyboardInterrupt:
            reason = INTERRUPTED
            self._stop()
        except OSError:
            # The disk, not the line: the device need not fill its buffer meanwhile.
            self._stop()
            raise
        finally:
            self._progress.end()
        keep = {"keep_scans": self._scans} if reason == "scans" else {}
        writer.event(self._elapsed_s(), event="stopped", reason=reason, **keep)

    @property
    def _scans(self) -> int:
        """How many scans were requested, at the device's own rate."""
        return max(1, round(self._request.duration_s * self.setup.rate_hz))

    def _elapsed_s(self) -> float:
        return self._clock.now() - self._origin_s

    def _stop(self) -> None:
        try:
            self._instrument.stop()
        except InputError:
            self._line.close()

    def _introduce(self) -> tuple[Identity, Setup]:
        """Ask the device who it is, and set it."""
        self._instrument = self._driver(self._line, self._clock)
        request = self._request
        identity = self._instrument.identify()
        setup = self._instrument.configure(request.channels, request.rate_hz, request.range_volts)
        self._decoder = self._driver.decoder(len(setup.channels))
        self._progress.begin(setup.range_volts / 2 ** (self._driver.bits - 1))
        return identity, setup

    def _listen(self, writer: RawWriter) -> str:
        """Keep what comes until it is enough or breaks off; return which."""
        scans, request, scale = self._scans, self._request, self._clock.scale
        wanted = scans * self._decoder.bytes_per_scan
        poll_s = min(_LONGEST_POLL_S, max(_SHORTEST_POLL_S, request.duration_s / scale / _POLLS))
        latest_s = 1.1 * request.duration_s + _PATIENCE_S * scale
        # A packet may gather many scans before it is sent.
        silence_s = _SILENCE_S + 64 / self.setup.rate_hz / scale
        while True:
            try:
                data = self._line.receive(silence_s)
            except LineLostError as fault:
                return fault.problem
            elapsed_s = self._elapsed_s()
            if data:
                writer.data(elapsed_s, data)
                self._received += len(data)
            self._progress.update(elapsed_s, self._decoder.feed(data))
            enough = self._received >= wanted
            if enough and elapsed_s < 0.9 * (scans - 1) / self.setup.rate_hz:
                self._by_clock = True
            if elapsed_s >= (request.duration_s if self._by_clock else latest_s):
                return "time"
            if not data:
                return f"the device fell silent after {elapsed_s:.6g} s"
            if self._decoder.ended:
                return f"the device ended its stream with '{self._decoder.ended}'"
            if enough and not self._by_clock:
                return "scans"
            if len(data) < _BACKLOG:
                time.sleep(poll_s)

    def _resume(self, reason: str, writer: RawWriter) -> bool:
        """Find the device again and start it; return whether that was possible in time."""
        writer.event(self._elapsed_s(), event="broken", reason=reason)
        self._by_clock = True
        until_s = time.monotonic() + self._request.reconnect_s
        while time.monotonic() < until_s and self._elapsed_s() < self._request.duration_s:
            try:
                if not self._line.is_open:
                    self._line = Line(self._line.port, self._driver.baudrate)
                self._line.set_baudrate(self._driver.baudrate)
                # Another device, or an answer that was damaged: it is asked again.
                refuse_if(
                    self._introduce() != (self.identity, self.setup),
                    self._line.port,
                    "another device answers",
                    "ask it again",
                )
                writer.event(self._elapsed_s(), event="restarted", reason=reason)
                self._instrument.start()
            except InputError:
                self._line.close()
                time.sleep(_RETRY_S)
            else:
                return True
        return False


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
    with (
        Line(port, kind.baudrate) as line,
        closing(Session(line, kind, request, clock, progress)) as session,
        _opened(raw_path) as stream,
    ):
        own = {"port": port, "volts_per_radian": volts_per_radian, "source": source}
        try:
            session.run(stream, session.description() | own)
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
            "there is such a file already, and no raw recording is overwritten",
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
        "make room, or give another file; what was kept till then is opened with "
        "pendpipe acquire --recover",
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
