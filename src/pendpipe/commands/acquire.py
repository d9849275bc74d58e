"""Record from a Dataq instrument, real or simulated, to the plain CSV form.

pendpipe acquire --list
pendpipe acquire --port /dev/ttyUSB0 --model di154rs --rate 60 --duration 300 --out decay.csv
pendpipe acquire --device simulated:di2108 --rate 110 --duration 60 --out decay.csv
pendpipe acquire --recover decay.raw --out decay.csv
"""

from __future__ import annotations

import argparse
import math
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from pendpipe.commands._campaign import add_campaign, add_record
from pendpipe.errors import InputError

if TYPE_CHECKING:
    from pendpipe.acquire.devices.simulated import Signal
    from pendpipe.acquire.progress import ProgressLine
    from pendpipe.recording import Recording


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the arguments."""
    what = parser.add_mutually_exclusive_group()
    what.add_argument("--port", help="serial port of a real instrument: /dev/ttyUSB0, COM3")
    what.add_argument("--device", metavar="simulated:MODEL", help="a simulated instrument")
    what.add_argument("--recover", metavar="RAW", help="decode kept bytes, of a crash for one")
    parser.add_argument("--list", action="store_true", help="list ports; with --port, ask it")
    parser.add_argument("--model", help="the instrument on --port: di154rs, di2108, ...")
    parser.add_argument("--channel", type=int, help="as printed on the box (1)")
    parser.add_argument(
        "--rate", type=float, default=60.0, metavar="HZ", help="scans a second (60)"
    )
    parser.add_argument("--duration", type=float, default=60.0, metavar="S", help="length (60)")
    parser.add_argument("--samples", type=int, metavar="N", help="length, instead of --duration")
    parser.add_argument(
        "--until-noise", action="store_true", help="end when the amplitude has reached the noise"
    )
    parser.add_argument(
        "--range-volts", type=float, metavar="V", help="the signal stays within +-V"
    )
    parser.add_argument(
        "--reconnect",
        type=float,
        default=30.0,
        metavar="S",
        help="how long a device that was unplugged is waited for (30)",
    )
    parser.add_argument("--out", metavar="FILE", help="the recording; FILE.wdh for WinDaq")
    parser.add_argument("--raw", metavar="FILE", help="where the bytes off the wire go (FILE.raw)")
    parser.add_argument("--volts-per-radian", type=float, help="sensor constant, for the metadata")
    parser.add_argument("--seed", type=int, default=0, help="of the simulated noise (0)")
    parser.add_argument(
        "--clock-scale", type=float, default=1.0, help="simulated seconds in one of the wall's (1)"
    )
    workflow = parser.add_argument_group("as a stage of a campaign")
    add_campaign(workflow)
    add_record(workflow)
    workflow.add_argument(
        "--caliper", action="store_true", help="the campaign's caliper run instead of a record"
    )


def run(arguments: argparse.Namespace) -> int:
    """List ports, or record."""
    if arguments.list:
        return _list(arguments.port)
    if not arguments.out:
        raise InputError("--out", "no file is named", "give --out FILE.csv")
    if arguments.campaign:
        return _stage(arguments)
    from pendpipe.acquire.progress import ProgressLine
    from pendpipe.formats.writing import check_name, write

    check_name(arguments.out)
    _complete(arguments)
    progress = ProgressLine(sys.stderr, arguments.duration)
    if arguments.recover:
        from pendpipe.acquire.decode import decode_recording

        recording = decode_recording(Path(arguments.recover), arguments.channel)
    elif arguments.device:
        recording = _simulated(arguments, progress)
    elif arguments.port:
        recording = _real(arguments, progress)
    else:
        raise InputError(
            "acquire", "no instrument is named", "give --port PORT or --device simulated:di2108"
        )
    for note in (*recording.notes, *write(arguments.out, recording)):
        print(f"pendpipe: {arguments.out}: {note}", file=sys.stderr)
    rate = recording.metadata["sample_rate_hz"]
    print(f"{arguments.out}: {len(recording)} samples at {float(rate):.6g} Hz")
    return 0


def _complete(arguments: argparse.Namespace) -> None:
    """Put in what follows from other arguments."""
    if arguments.samples is not None:
        if arguments.samples < 1:
            raise InputError("--samples", "it must be positive", "give a whole number above 0")
        if arguments.rate > 0:
            arguments.duration = arguments.samples / arguments.rate
    if not arguments.raw and not arguments.recover:
        # Always: what a crash leaves is there.
        arguments.raw = str(Path(arguments.out).with_suffix(".raw"))


def _stage(arguments: argparse.Namespace) -> int:
    """Acquire one record of a campaign, or its caliper run."""
    from pendpipe.commands._campaign import load

    campaign, out = load(arguments.campaign), Path(arguments.out)
    if arguments.caliper:
        from pendpipe.configuration.jobs import caliper_source
        from pendpipe.manifest import job
        from pendpipe.stages.caliper import run_caliper

        source = caliper_source(campaign)
        with job(out.parent, "caliper", sources=[source] if source else []) as running:
            run_caliper(campaign, out)
            running.outputs.append(out)
        return 0
    from pendpipe.stages.acquire import acquire_record
    from pendpipe.stages.refusal import run_stage

    source = campaign.record(arguments.record).file
    return run_stage(
        "acquire",
        arguments.record,
        lambda: acquire_record(campaign, arguments.record, out),
        outputs=[out],
        refused=arguments.refused,
        sources=[source] if source else [],
    )


def _real(arguments: argparse.Namespace, progress: ProgressLine) -> Recording:
    """Record from the instrument on a port."""
    from pendpipe.acquire.ports import identify
    from pendpipe.acquire.recorder import record

    return record(
        arguments.port,
        arguments.model or identify(arguments.port).model,
        channels=(arguments.channel or 1,),
        rate_hz=arguments.rate,
        duration_s=arguments.duration,
        raw_path=arguments.raw,
        volts_per_radian=arguments.volts_per_radian,
        progress=progress,
        range_volts=arguments.range_volts,
        until_noise=arguments.until_noise,
        reconnect_s=arguments.reconnect,
    )


def _simulated(arguments: argparse.Namespace, progress: ProgressLine) -> Recording:
    """Record from a simulated instrument."""
    from pendpipe.acquire.simulated import acquire_simulated

    where, _, kind = arguments.device.partition(":")
    if where != "simulated" or not kind:
        raise InputError(
            f"--device {arguments.device}",
            "only simulated devices go here",
            "give simulated:di2108",
        )
    if not (math.isfinite(arguments.clock_scale) and arguments.clock_scale > 0):
        raise InputError("--clock-scale", "it must be positive", "give 1 for real time")
    return acquire_simulated(
        kind,
        _default_signal(arguments.seed, arguments.volts_per_radian or 3.85),
        channels=(arguments.channel or 1,),
        rate_hz=arguments.rate,
        duration_s=arguments.duration,
        clock_scale=arguments.clock_scale,
        raw_path=arguments.raw,
        volts_per_radian=arguments.volts_per_radian or 3.85,
        progress=progress,
        range_volts=arguments.range_volts,
        until_noise=arguments.until_noise,
        reconnect_s=arguments.reconnect,
    )


def _default_signal(seed: int, volts_per_radian: float) -> Signal:
    """A pendulum for somebody who has named none: viscous decay with a little noise.

    theta = 0.3 rad exp(-beta t) cos(2 pi f t), f = 0.5 Hz, Q = pi f/beta = 150, read by a
    sensor with 1 mV of white noise.
    """
    import numpy as np

    from pendpipe.arrays import FloatArray

    random = np.random.default_rng(seed)
    frequency_hz, quality_factor, amplitude_rad, noise_volts = 0.5, 150.0, 0.3, 1e-3
    beta = math.pi * frequency_hz / quality_factor

    def signal(time_s: FloatArray) -> FloatArray:
        angle_rad = amplitude_rad * np.exp(-beta * time_s)
        angle_rad *= np.cos(2.0 * math.pi * frequency_hz * time_s)
        volts = volts_per_radian * angle_rad
        return np.asarray(volts + random.normal(0.0, noise_volts, len(time_s)))

    return signal


def _list(port: str | None) -> int:
    """Print the ports; ask the device on one of them who it is."""
    from pendpipe.acquire.ports import identify, list_ports
    from pendpipe.acquire.usb import no_ports, without_port

    if port:
        identity = identify(port)
        extra = f", firmware {identity.firmware}" if identity.firmware else ""
        print(f"{port}: {identity.model}{extra}")
        return 0
    found = list_ports()
    for entry in found:
        told = "Dataq" if entry.is_dataq else entry.description
        # Only a device with the vendor's number is asked: others may not bear it.
        if entry.is_dataq:
            try:
                told = f"Dataq {identify(entry.port).model}"
            except InputError as fault:
                told = f"Dataq, {fault.problem}"
        print(f"{entry.port}: {told}")
    unbound = without_port()
    for device in unbound:
        print(device)
    if not found and not unbound:
        print(no_ports())
    return 0
