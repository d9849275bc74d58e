"""What the instrument's bytes mean, and how they are kept.

`drivers` decode and `devices` encode; neither imports the other. `recorder.record` keeps
the bytes first and decodes them afterwards, `simulated.acquire_simulated` does the same
with a simulated device on a line of its own.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pathlib import Path

    from pendpipe.recording import Recording


def record_from_port(
    port: str,
    *,
    channel: int | None = None,
    duration_s: float,
    rate_hz: float = 60.0,
    model: str | None = None,
    raw_path: str | Path | None = None,
) -> Recording:
    """Record one channel from whatever known device is on a port.

    Parameters
    ----------
    port
        A device file, a COM port, or a URL of pyserial.
    channel
        As printed on the box; 1 by default.
    duration_s, rate_hz, raw_path
        See `recorder.record`.
    model
        The device; it is asked for its name when not given.

    Returns
    -------
    Recording
        In volts.

    Raises
    ------
    InputError
        See `recorder.record`.
    """
    from pendpipe.acquire.ports import identify
    from pendpipe.acquire.recorder import record

    return record(
        port,
        model or identify(port).model,
        channels=(channel or 1,),
        rate_hz=rate_hz,
        duration_s=duration_s,
        raw_path=raw_path,
    )
