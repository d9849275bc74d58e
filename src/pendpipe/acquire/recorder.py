"""The recorder: the bytes off the wire are kept first, and decoded afterwards."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import AbstractContextManager, closing, nullcontext
from datetime import UTC, datetime
from io import BytesIO
from pathlib import Path
from typing import IO, cast

from pendpipe.acquire.clock import Clock, ScaledClock
from pendpipe.acquire.decode import decode_recording
from pendpipe.acquire.drivers import find_driver
from pendpipe.acquire.drivers.base import Identity, Setup
from pendpipe.acquire.line import Line
from pendpipe.acquire.raw import RawWriter, is_being_recorded, lock, read_raw
from pendpipe.acquire.session import Progress, Session, Wish
from pendpipe.errors import InputError
from pendpipe.recording import Recording


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
    range_volts: float | None = None,
    until_noise: bool = False,
    reconnect_s: float = 30.0,
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
        The file, a new one, in which the bytes off the wire are kept; in memory only when
        not given.
    volts_per_radian
        The sensor's constant, for the metadata.
    source
        What to call the source in the metadata; model and port by default.
    progress
        Somebody to keep informed.
    range_volts
        The signal stays within plus and minus it: the smallest range that holds it is taken.
    until_noise
        End also when the amplitude of the first channel has reached the noise, see
        `noise.NoiseWatch`.
    reconnect_s
        For so many seconds of the host a device that was unplugged, fell silent or
        overflowed is looked for again; what was missed is a gap.

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
    wish = Wish(
        tuple(channels), rate_hz, duration_s, range_volts, until_noise, max(0.0, reconnect_s)
    )
    clock = clock or ScaledClock()
    kind = find_driver(driver)
    line = Line(port, kind.baudrate)
    try:
        session = Session(line, kind, wish, clock, progress)
    except BaseException:
        line.close()
        raise
    with closing(session), _opened(raw_path) as stream:
        header = _header(port, session.identity, session.setup, wish, clock)
        header |= {"volts_per_radian": volts_per_radian, "source": source}
        kept = {key: value for key, value in header.items() if value is not None}
        try:
            size = kind.decoder(len(session.setup.channels)).bytes_per_scan
            bytes_per_s = session.setup.rate_hz * size
            session.run(RawWriter(stream, kept, bytes_per_s=bytes_per_s))
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
    if not path.is_file() or is_being_recorded(path):
        return False
    try:
        return not read_raw(path).data
    except InputError:
        return False


def _cannot_write(place: str | Path, fault: OSError) -> InputError:
    return InputError(
        place,
        f"can't be written ({fault.strerror})",
        "make room, or give another file; what was kept till then is opened with "
        "pendpipe acquire --recover",
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
        "range_volts": setup.range_volts,
        "rate_hz": setup.rate_hz,
        "requested_rate_hz": wish.rate_hz,
        "duration_s": wish.duration_s,
        "clock_scale": clock.scale,
        "recorded_at": datetime.now(UTC).isoformat(timespec="seconds"),
    }
