"""What the instrument has recorded, real or simulated: a record, or the caliper run."""

import sys
from dataclasses import replace
from itertools import takewhile
from pathlib import Path

import numpy as np

from pendpipe.arrays import FloatArray
from pendpipe.configuration.load import Campaign, Record
from pendpipe.errors import InputError, refuse_if
from pendpipe.files import MADE_BY, MARK, SET_ASIDE, replaced, write_whole, writing
from pendpipe.recording import Recording, read_plain, write_plain

RATE_HZ = 60.0
"""Scans a second of an instrument in a campaign."""
OF_THE_RUN = (
    "recorded_at",
    "sample_rate_measured_hz",
    "sample_rate_measured_sd_hz",
    "unseen_loss_below_s",
)
"""What depends on the date and the host's clock: of a simulated record it goes to the log."""


def acquire_record(
    campaign: Campaign,
    name: str,
    out: Path,
    *,
    anew: bool = False,
    accept_short: bool = False,
    place: Path | str = "CONFIG",
) -> None:
    """Write the plain recording of one record.

    Parameters
    ----------
    campaign, name
        The record and its campaign.
    out
        The recording; an instrument's raw files are kept in the record's folder of results.
    anew
        Record from an instrument even if a recording is kept.
    accept_short
        Take what a lost line has left for the record, as what a killed process has left.
    place
        The campaign's configuration, for the message on how to record anew.

    Raises
    ------
    InputError
        If the source can't be read or opened: the file or port, what is wrong, a remedy.
    LineLostError
        If the line was lost. What had come is kept, and the next call records anew.
    """
    record = campaign.record(name)
    if record.source.startswith("dataq:"):
        _instrument(
            record,
            campaign.folder / name,
            out,
            f"pendpipe acquire --campaign {place} --record {name} --anew records it anew",
            anew=anew,
            accept_short=accept_short,
        )
    else:
        made = _simulated(campaign, record) if record.source == "simulated" else _file(record)
        write_plain(out, made)


def _simulated(campaign: Campaign, record: Record) -> Recording:
    """Let the simulated instrument record the simulated pendulum over its serial line."""
    from pendpipe.acquisition.recorder import acquire_simulated
    from pendpipe.simulation.record import simulated_record

    signal, setting = simulated_record(campaign, record)
    # The engine is compiled on its first call on a machine; a device must not wait for it.
    signal.angle(np.zeros(1))
    recording = acquire_simulated(signal=signal, **setting)
    # What a laboratory would not know stays out of the recording: no truth in its header. So
    # does what only this run of the simulation could know: the same campaign gives the same bytes.
    metadata = {**recording.metadata, "source": "simulated"}
    for key in OF_THE_RUN:
        print(f"{key}: {metadata.pop(key)}", file=sys.stderr)
    return replace(recording, metadata=metadata)


def _instrument(
    record: Record, home: Path, out: Path, again: str, *, anew: bool, accept_short: bool
) -> None:
    """Write the recording of a ``dataq:`` record from its raw file; record only if there is none.

    An attempt that a lost line has ended is none, unless it is accepted.

    Raises
    ------
    InputError
        If nothing is kept and nothing can be recorded, or what is kept can't be decoded.
    """
    from pendpipe.acquisition.attempts import (
        accept,
        choose,
        decode_attempt,
        kept_in,
        read_attempts,
    )

    refuse_if(
        record.channel and not record.channel.isdecimal(),
        f"record {record.record}",
        f"channel '{record.channel}' is not a number",
        "fix the cell",
    )
    channel = int(record.channel) if record.channel else None
    folder, earlier = home / "raw", home / "recording.csv"
    attempts = read_attempts(folder.glob("*.raw"))
    if attempts and accept_short and not anew and choose(attempts).lost_line:
        accept(choose(attempts))
        attempts = read_attempts(folder.glob("*.raw"))
    if not attempts and not anew and _is_recording(earlier):
        if not (out.exists() and out.samefile(earlier)):
            write_whole(out, earlier.read_bytes())
        print(f"{record.record}: {out.name} is kept as it is, without a raw file; {again}")
        return
    if anew or all(attempt.lost_line for attempt in attempts):
        _record(record, folder, channel or 1, accept_short=accept_short)
        attempts = read_attempts(folder.glob("*.raw"))
    used = choose([attempt for attempt in attempts if not attempt.lost_line])
    recording = decode_attempt(used.path, home, channel)
    # What was made from one of the raw files can be made from it again.
    kept = {str(attempt.header["recorded_at"]) for attempt in attempts}
    with kept_in(used.path, out), writing(force=_recorded_at(out) in kept):
        write_plain(out, recording, original=True)
    others = f", {len(attempts) - 1} more kept beside it" if len(attempts) > 1 else ""
    notes = "".join(f"; {note}" for note in recording.notes)
    print(
        f"{record.record}: {len(recording)} samples from {used.path.name}, "
        f"recorded {used.header['recorded_at']}{others}{notes}"
        + ("" if used.is_complete else f"; {again}")
    )


def _record(record: Record, folder: Path, channel: int, *, accept_short: bool) -> None:
    """Record from the instrument into a new raw file."""
    from pendpipe.acquisition.attempts import accept, new_path, read_attempts, refuse_lost
    from pendpipe.acquisition.recorder import record as record_from

    if record.stop_s is None:
        raise InputError(
            f"record {record.record}", "its length is unknown", "give stop_s in seconds"
        )
    port, raw_path = record.source.removeprefix("dataq:"), new_path(f"{folder}/")
    record_from(
        port, channels=[channel], rate_hz=RATE_HZ, duration_s=record.stop_s, raw_path=raw_path
    )
    (newest,) = read_attempts([raw_path])
    if accept_short and newest.lost_line:
        accept(newest)
    else:
        refuse_lost(newest, "the next run records anew; --accept-short takes what is kept")


def _recorded_at(out: Path) -> str | None:
    """When the recording in a file was made, as its head says; None where nothing does."""
    if not out.is_file():
        return None
    with out.open(encoding="utf-8", errors="replace") as stream:
        remarks = takewhile(lambda line: line.startswith("#"), stream)
        head = (line.lstrip("# ").partition(": ") for line in remarks)
        return next((text.strip() for key, _, text in head if key == "recorded_at"), None)


def _is_recording(out: Path) -> bool:
    """Whether a recording made without a raw file is there; a refused record's stub is none.

    Raises
    ------
    InputError
        If it is there, or was set aside, and is damaged: only the user may give it up.
    """
    for damaged in out.parent.glob(f"{out.name}{SET_ASIDE}*"):
        raise InputError(
            damaged,
            "the recording was damaged and set aside, and no raw file of it is kept",
            "put back a copy, or record anew with --anew",
        )
    if not out.exists():
        return False
    with out.open("rb") as stream:
        if stream.read(9) in (b"", b"# refused"):
            return False
    read_plain(out)
    return True


def _file(record: Record) -> Recording:
    """Read a recording that somebody else made."""
    from pendpipe.formats import ReadOptions, read

    path = Path(record.source)
    options = ReadOptions(
        channel=record.channel or None,
        unit=record.unit or None,
        decimal=record.decimal or None,
        sample_rate=record.sample_rate,
        start_s=record.start_s,
        stop_s=record.stop_s,
        volts_per_radian=record.volts_per_radian,
    )
    recording = read(path, options)
    # The folder is the user's own business: the results name the file only.
    return replace(recording, metadata={**recording.metadata, "source": path.name})


CALIPER_HZ = 200.0
"""Scans a second of the caliper run."""
SETTLING = 0.1
"""Part of each dwell that is left out at either end, where the caliper is moved."""


def run_caliper(campaign: Campaign, table: Path) -> None:
    """Make the table of a caliper run, or copy the one that the configuration names.

    Columns ``displacement_m``, ``volts``, ``volts_sd``: the caliper's reading, the mean of
    the samples at that position, and the mean's standard deviation.
    """
    from pendpipe.acquisition.recorder import acquire_simulated
    from pendpipe.simulation.record import SensorVolts, generator

    settings = campaign.configuration
    run, truth = settings.calibration, settings.simulated
    assert run is not None
    if run.source != "simulated":
        # The user's own table is kept beside the results that were made with it.
        from pendpipe.formats.reading import file_bytes

        write_whole(table, file_bytes(Path(run.source)))
        return
    if truth is None:
        raise InputError("calibration", "a simulated run needs the section simulated", "add it")
    random = generator(campaign, "caliper run")
    displacement = np.linspace(-run.travel_m, run.travel_m, run.points)
    reading = displacement + run.displacement_sd_m * random.standard_normal(run.points)
    dwell_s = run.samples / CALIPER_HZ / (1.0 - 2.0 * SETTLING)

    def held(time_s: FloatArray) -> FloatArray:
        """The rod's angle while the caliper holds one position after the other."""
        position = np.floor(time_s / dwell_s).astype(np.int64)
        return np.asarray(displacement[np.clip(position, 0, run.points - 1)] / run.arm_m)

    recording = acquire_simulated(
        truth.device.kind,
        SensorVolts(held, truth.sensor, np.random.default_rng([settings.seed, run.points])),
        rate_hz=CALIPER_HZ,
        duration_s=run.points * dwell_s,
        clock_scale=truth.device.clock_scale,
    )
    dwells = recording.time_s / dwell_s
    steps, settled = np.floor(dwells), np.abs(dwells % 1.0 - 0.5) < 0.5 - SETTLING
    with replaced(table) as stream:
        stream.write(
            f"# {MARK}: {MADE_BY}\n# arm_m: {run.arm_m!r}\ndisplacement_m,volts,volts_sd\n"
        )
        for index, length in enumerate(reading.tolist()):
            volts = recording.values[settled & (steps == index)]
            spread = float(np.std(volts, ddof=1) / np.sqrt(len(volts)))
            stream.write(f"{length!r},{float(np.mean(volts))!r},{spread!r}\n")
