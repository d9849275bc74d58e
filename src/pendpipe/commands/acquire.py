"""Record from a Dataq instrument, real or simulated, to the plain CSV form.

pendpipe acquire --list
pendpipe acquire --port /dev/ttyUSB0 --model di154rs --rate 60 --duration 300 --out decay.csv
pendpipe acquire --device simulated:di2108 --rate 110 --duration 60 --view --out decay.csv
pendpipe acquire --recover decay.raw --out decay.csv
pendpipe acquire --campaign config/config.yaml --record decay-1 --anew
pendpipe acquire --serve di2108 --signal config/model.toml
"""

import signal
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from types import FrameType
from typing import Any

from pendpipe.acquisition import verbs
from pendpipe.arguments import Arguments, command, load, tell_written
from pendpipe.errors import InputError, refuse_if
from pendpipe.files import check_output, check_writable, is_stream
from pendpipe.options import (
    ALTERNATIVES,
    INPUT,
    NATURAL,
    OUTPUTS,
    POSITIVE,
    flags,
    flags_of,
    given,
    under,
)


@command(
    under(
        ALTERNATIVES,
        {
            "--port": {"help": "serial port of a real instrument: /dev/ttyUSB0, COM3"},
            "--device": {"metavar": "simulated:MODEL", "help": "a simulated instrument"},
            "--recover": {"metavar": "RAW", "help": "decode a raw file, for instance after a crash"}
            | INPUT,
            "--serve": {
                "metavar": "MODEL",
                "help": "simulate an instrument for other programs: di2108, ...",
            },
        },
    )
    | {
        "--list": {"action": "store_true", "help": "list ports; with --port, identify its device"},
        "--channel": {"type": int, "help": "number of the channel, as printed on the box (1)"},
        "--samples": {
            "type": POSITIVE,
            "metavar": "N",
            "help": "number of scans, instead of --duration",
        },
        "--out": {"metavar": "FILE", "help": "the recording; FILE.wdh for WinDaq"} | OUTPUTS,
        "--raw": {
            "metavar": "FILE",
            "help": "a new file for the bytes off the wire (FILE.raw, FILE.<time stamp>.raw)",
        },
        "--anew": {
            "action": "store_true",
            "help": "record again, even if a recording exists or is not yet written as CSV",
        },
        "--accept-short": {
            "action": "store_true",
            "help": "accept what was recorded before the line was lost",
        },
        "--view": {
            "action": "store_true",
            "help": "show the recording on a local web page; prints its address",
        },
        "--signal": {
            "metavar": "TOML",
            "help": "with --serve: the signal, a model as for pendpipe simulate",
        }
        | INPUT,
        "--link": {"choices": ("pty", "socket"), "help": "with --serve: the kind of line"},
    }
    | flags_of(verbs.acquire)
    | {
        "--seed": {
            "type": NATURAL,
            "metavar": "N",
            "default": 0,
            "help": "seed of the simulated noise (0)",
        },
    }
    | under(
        "as a stage of a campaign",
        flags("--campaign", "--record", "--refused")
        | {
            "--caliper": {
                "action": "store_true",
                "help": "the campaign's caliper run instead of a record",
            }
        },
    )
)
def run(arguments: Arguments) -> None:
    """List ports, serve a device, or record."""
    if arguments.list:
        _list(arguments.port)
        return
    refuse_if(
        arguments.view and not (arguments.port or arguments.device),
        "--view",
        "it shows a recording in progress, and this call makes none",
        "give --port PORT or --device simulated:di2108",
    )
    kinds = {"serve": _serve, "caliper": _caliper, "campaign": _stage}
    work = next((each for name, each in kinds.items() if getattr(arguments, name)), _record)
    with _signals_end_like_ctrl_c():
        work(arguments)


@contextmanager
def _signals_end_like_ctrl_c() -> Iterator[None]:
    """Let SIGTERM and SIGHUP end a recording as Ctrl-C does: what was recorded is written.

    The first of them counts, since a closing terminal may send several. One that is ignored
    (nohup) stays so; Windows has no SIGHUP.
    """
    before: dict[int, Any] = {}

    def interrupt(_number: int, _frame: FrameType | None) -> None:
        for number in before:
            signal.signal(number, signal.SIG_IGN)
        raise KeyboardInterrupt

    for number in (getattr(signal, name, None) for name in ("SIGTERM", "SIGHUP")):
        in_main = threading.current_thread() is threading.main_thread()
        if in_main and number is not None and signal.getsignal(number) is not signal.SIG_IGN:
            before[number] = signal.signal(number, interrupt)
    try:
        yield
    finally:
        for number, old in before.items():
            signal.signal(number, old)


def _record(arguments: Arguments) -> None:
    """Record, or write what an earlier call has recorded and could not write."""
    refuse_if(not arguments.out, "--out", "no file is named", "give --out FILE.csv")
    from pendpipe.acquisition import attempts
    from pendpipe.acquisition.raw import append_event
    from pendpipe.formats.writing import check_name, write

    out = Path(arguments.out)
    check_name(out)
    # Before anything is recorded: a place where no recording can be written.
    refuse_if(out.is_dir(), out, "this is a folder", "name a file in it")
    check_output(out)
    if not is_stream(out) and (out.is_file() or not out.exists()):  # else a device or a pipe
        check_writable(out.parent)
    if arguments.samples is not None:
        arguments.duration_s = arguments.samples / max(arguments.rate_hz, 1e-9)
    kept = [Path(arguments.raw)] if arguments.raw else attempts.paths_beside(out)
    no_earlier_one = arguments.recover or arguments.anew
    earlier = [] if no_earlier_one else attempts.read_attempts(kept)
    if not arguments.accept_short:
        earlier = [attempt for attempt in earlier if not attempt.lost_line]
    if arguments.recover:
        raw = Path(arguments.recover)
    elif earlier and not earlier[-1].event("saved"):
        raw = earlier[-1].path
        print(
            f"pendpipe: {out}: made from {raw}, recorded {earlier[-1].header['recorded_at']} and "
            "not yet written; nothing was recorded now (call again, or give --anew)",
            file=sys.stderr,
        )
    else:
        raw = Path(arguments.raw) if arguments.raw else attempts.new_path_beside(out)
        if arguments.view:
            from pendpipe.acquisition.view import shown

            with shown(raw):
                _from_device(arguments, raw)
        else:
            _from_device(arguments, raw)
        if not arguments.accept_short:
            (attempt,) = attempts.read_attempts([raw])
            remedy = "call again to record anew, or with --accept-short to take what is kept"
            attempts.refuse_lost(attempt, remedy)
    recording = attempts.decode_attempt(raw, out.parent, arguments.channel)
    with attempts.kept_in(raw, out):
        lost = write(out, recording, original=True)
    if not arguments.recover:
        with suppress(OSError):
            append_event(raw, event="saved", file=out.name)
    for note in (*recording.notes, *lost):
        print(f"pendpipe: {out}: {note}", file=sys.stderr)
    rate = recording.metadata["sample_rate_hz"]
    tell_written(out, f"{len(recording)} samples at {float(rate):.6g} Hz (raw bytes: {raw})")


def _caliper(arguments: Arguments) -> None:
    """Acquire the caliper run of a campaign."""
    from pendpipe.configuration.jobs import caliper_source
    from pendpipe.files import writing
    from pendpipe.stages.acquire import run_caliper

    refuse_if(not arguments.out, "--out", "no file is named", "give --out FILE.csv")
    campaign = load(arguments.campaign)
    with writing(inputs=filter(None, [caliper_source(campaign)])):
        run_caliper(campaign, Path(arguments.out))


def _stage(arguments: Arguments) -> None:
    """Acquire one record of a campaign."""
    from pendpipe.stages.acquire import acquire_record
    from pendpipe.stages.refusal import run_stage

    campaign = load(arguments.campaign)
    record = campaign.record(arguments.record)
    folder = Path(campaign.configuration.results, record.record)
    out = Path(arguments.out) if arguments.out else folder / "recording.csv"
    if not arguments.out:  # by hand: the next run of the campaign reads what is kept now
        from pendpipe.stages.chunks import ALONE, STAGES

        STAGES["acquire"].path(campaign, f"{ALONE}{record.record}").unlink(missing_ok=True)
    refused = arguments.refused
    if record.source.startswith("dataq:"):
        # What fails here is the line, not the record: the job fails, and the next run tries
        # again. Whatever refused an earlier recording has to judge this one anew.
        out.with_name("refused.json").unlink(missing_ok=True)
        refused = None
    else:
        refuse_if(
            arguments.anew,
            f"record {record.record}",
            "its source is not an instrument",
            "leave out --anew",
        )
    run_stage(
        "acquire",
        record.record,
        lambda: acquire_record(
            campaign,
            record.record,
            out,
            anew=arguments.anew,
            accept_short=arguments.accept_short,
            place=arguments.campaign,
        ),
        outputs=[out],
        refused=refused,
        sources=[record.file] if record.file else [],
    )


def _from_device(arguments: Arguments, raw: Path) -> None:
    """Record into a raw file."""
    from pendpipe.acquisition.recorder import ProgressLine, example_signal

    device, where = arguments.device, arguments.device or arguments.port
    refuse_if(
        not where,
        "acquire",
        "no instrument is named",
        "give --port PORT or --device simulated:di2108",
    )
    refuse_if(
        device and not device.startswith("simulated:"),
        f"--device {device}",
        "this option is for simulated devices",
        "give simulated:di2108",
    )
    options, simulated = given(arguments, verbs.acquire), None
    options["clock_scale"] = arguments.clock_scale or 1.0
    if device:
        options["volts_per_radian"] = arguments.volts_per_radian or 3.85
        simulated = example_signal(arguments.seed, options["volts_per_radian"])
    verbs.acquire(
        where,
        channel=arguments.channel or 1,
        signal=simulated,
        raw_path=raw,
        progress=ProgressLine(sys.stderr, arguments.duration_s),
        **options,
    )


def _serve(arguments: Arguments) -> None:
    """Simulate an instrument for other programs until interrupted."""
    from pendpipe.acquisition.devices.simulated import SimulatedDevice
    from pendpipe.acquisition.recorder import example_signal

    signal_volts = example_signal(arguments.seed, arguments.volts_per_radian or 3.85)
    if arguments.signal:
        from pendpipe.simulation.model import read_model, simulated_volts

        signal_volts = simulated_volts(read_model(arguments.signal), arguments.signal)
    kind = arguments.serve.removeprefix("simulated:")
    with SimulatedDevice(
        kind, signal_volts, clock_scale=arguments.clock_scale or 1.0, link=arguments.link
    ) as device:
        print(device.port, flush=True)
        with suppress(KeyboardInterrupt):
            while device.failure is None:
                time.sleep(0.05)


def _list(port: str | None) -> None:
    """Print the ports; ask the device on one of them who it is."""
    from serial.tools.list_ports import comports

    from pendpipe.acquisition.drivers import NO_PORTS, VENDOR, identify, without_port

    if port:
        identity = identify(port)
        extra = f", firmware {identity.firmware}" if identity.firmware else ""
        print(f"{port}: {identity.model}{extra}")
        return
    lines = []
    for entry in sorted(comports(), key=lambda entry: entry.device):
        shown = entry.description
        # Only a device with the vendor's number is asked: others may not bear it.
        if entry.vid == VENDOR:
            try:
                shown = f"Dataq {identify(entry.device).model}"
            except InputError as fault:
                shown = f"Dataq, {fault.problem}"
        lines.append(f"{entry.device}: {shown}")
    lines += without_port()
    print("\n".join(lines or [NO_PORTS]))
