"""Record from a simulated device: the device, its line, the driver and the recorder."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Final

from pendpipe.acquire.devices.faults import Fault
from pendpipe.acquire.devices.simulated import Signal, SimulatedDevice
from pendpipe.acquire.recorder import record
from pendpipe.acquire.session import Progress, Wish
from pendpipe.errors import InputError
from pendpipe.recording import Recording

_LINE_BYTES_PER_S: Final = 2e6
"""What a pseudo-terminal is asked to carry at most; it was seen to carry twice as much."""
_SHORTEST_S: Final = 0.1
"""Seconds of the wall that a recording takes at least."""


def acquire_simulated(
    device_kind: str,
    signal: Signal | Mapping[int, Signal],
    *,
    rate_hz: float,
    duration_s: float,
    clock_scale: float = 1000.0,
    channels: Sequence[int] = (1,),
    raw_path: str | Path | None = None,
    volts_per_radian: float | None = None,
    link: str | None = None,
    rate_error: float = 0.0,
    progress: Progress | None = None,
    range_volts: float | None = None,
    until_noise: bool = False,
    reconnect_s: float = 30.0,
    faults: Iterable[Fault] = (),
) -> Recording:
    """Start a simulated device on a line of its own and record from it.

    Parameters
    ----------
    device_kind
        A key of `devices.models.DEVICES`: ``"di154"`` (12 bits), ``"di2108"`` (16 bits), ...
    signal
        Times in s since the start to volts at the terminals, noise included; or a mapping
        from channel to that. See `SimulatedDevice`.
    rate_hz, duration_s, channels, raw_path, volts_per_radian, progress, range_volts, \
until_noise, reconnect_s
        See `recorder.record`.
    clock_scale
        How many seconds of device and recorder pass in one of the wall's. It is lowered to
        what the line can carry (2 MB/s of the wall), and so that a recording takes 0.1 s at
        least: in less the rate can't be measured.
    link
        ``"pty"``, ``"socket"``, or ``None`` for what the system has.
    rate_error
        The device's clock is fast by this fraction.
    faults
        What is to go wrong, see `devices.faults.FAULTS`.

    Returns
    -------
    Recording
        In volts.

    Raises
    ------
    InputError
        As `recorder.record`; and whatever `signal` raises.
    """
    wish = Wish(tuple(channels), rate_hz, duration_s)
    fastest = min(
        _LINE_BYTES_PER_S / (2 * len(wish.channels or (1,)) * wish.rate_hz),
        wish.duration_s / _SHORTEST_S,
    )
    scale = min(clock_scale, max(1.0, fastest))
    with SimulatedDevice(
        device_kind, signal, clock_scale=scale, link=link, rate_error=rate_error, faults=faults
    ) as device:
        try:
            return record(
                device.port,
                device_kind,
                channels=channels,
                rate_hz=rate_hz,
                duration_s=duration_s,
                clock=device.clock,
                raw_path=raw_path,
                volts_per_radian=volts_per_radian,
                source=f"simulated {device.dialect.model}",
                progress=progress,
                range_volts=range_volts,
                until_noise=until_noise,
                reconnect_s=reconnect_s,
            )
        except InputError:
            # A device whose signal has failed is silent; the failure is the better answer.
            if device.failure is not None:
                raise device.failure from None
            raise
