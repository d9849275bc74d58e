"""Record from a simulated device: the device, its line, the driver and the recorder."""

import math
from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np

from pendpipe.acquisition.devices.simulated import Signal, SimulatedDevice
from pendpipe.acquisition.recorder import AcquisitionRequest, record
from pendpipe.arrays import FloatArray
from pendpipe.errors import InputError
from pendpipe.recording import Recording

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
    request = AcquisitionRequest(tuple(channels), rate_hz, duration_s)
    fastest = min(
        _LINE_BYTES_PER_S / (2 * len(request.channels or (1,)) * rate_hz),
        duration_s / _SHORTEST_S,
    )
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
