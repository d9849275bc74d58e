"""Record from an instrument, real or simulated: what the front door and the command call."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from pendpipe.options import POSITIVE, SENSOR, Option, checked

if TYPE_CHECKING:
    from pendpipe.acquisition.devices.simulated import Signal
    from pendpipe.acquisition.recorder import ProgressLine
    from pendpipe.recording import Recording


@checked
def acquire(
    port: str,
    *,
    model: Annotated[
        str | None,
        Option("the instrument: di154rs, di2108, ...; it is asked when not given", "MODEL"),
    ] = None,
    rate_hz: Annotated[float, Option("scans per second", "HZ", flag="--rate")] = 60.0,
    duration_s: Annotated[
        float, Option("length of the recording, s", "S", flag="--duration")
    ] = 60.0,
    range_volts: Annotated[float | None, Option("the signal stays within +-V", "V")] = None,
    reconnect_s: Annotated[
        float,
        Option("how long to wait for an unplugged device, s", "S", flag="--reconnect"),
    ] = 30.0,
    clock_scale: Annotated[
        float | None,
        Option(
            "simulated seconds per real second: 1 from the command line, 1000 from Python",
            "FACTOR",
            POSITIVE,
        ),
    ] = None,
    volts_per_radian: Annotated[float | None, Option(SENSOR, "V")] = None,
    channel: int = 1,
    signal: "Signal | None" = None,
    raw_path: str | Path | None = None,
    progress: "ProgressLine | None" = None,
) -> "Recording":
    """Record from a DATAQ instrument, or from a simulated one.

    Parameters
    ----------
    port
        A device file, a COM port, ``socket://HOST:PORT`` or ``rfc2217://HOST:PORT``;
        ``"simulated:di2108"`` needs none.
    {options}
    channel
        As printed on the box.
    signal
        What a simulated instrument reads: a function from times in s to volts. By default a
        decaying pendulum.
    raw_path
        A new file for the bytes from the line; by default they stay in memory.
    progress
        A display to update.

    Returns
    -------
    Recording
        In volts.

    Raises
    ------
    InputError
        If the port can't be opened, the device does not answer, or the setting is impossible.

    Examples
    --------
    >>> acquire("simulated:di2108", duration_s=20)
    Recording(1200 samples of volts, 0 to 19.9833 s)
    """
    from pendpipe.acquisition.recorder import acquire_simulated, example_signal, record

    request: dict[str, Any] = {
        "channels": (channel,),
        "rate_hz": rate_hz,
        "duration_s": duration_s,
        "range_volts": range_volts,
        "reconnect_s": reconnect_s,
        "volts_per_radian": volts_per_radian,
        "raw_path": raw_path,
        "progress": progress,
    }
    where, _, kind = port.partition(":")
    if where == "simulated":
        signal = signal or example_signal()
        return acquire_simulated(kind, signal, clock_scale=clock_scale or 1000.0, **request)
    return record(port, model, **request)
