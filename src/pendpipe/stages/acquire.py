"""A record's recording, from wherever its source says: simulated, instrument or file."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from pendpipe.configuration.load import Campaign
from pendpipe.configuration.records import Record
from pendpipe.errors import InputError
from pendpipe.recording import Recording, write_plain


def acquire_record(campaign: Campaign, name: str, out: Path) -> None:
    """Write the plain recording of one record.

    Raises
    ------
    InputError
        If the source can't be read or opened: the file or port, what is wrong, a remedy.
    """
    record = campaign.record(name)
    if record.source == "simulated":
        recording = _simulated(campaign, record)
    elif record.source.startswith("dataq:"):
        recording = _instrument(record)
    else:
        recording = _file(record)
    write_plain(out, recording)


def _simulated(campaign: Campaign, record: Record) -> Recording:
    """Let the simulated instrument record the simulated pendulum over its serial line."""
    from pendpipe.acquire.simulated import acquire_simulated
    from pendpipe.simulation.record import SensorVolts, generator, simulated_record

    truth = simulated_record(campaign, record)
    signal = SensorVolts(truth, generator(campaign, record.record))
    # The engine is compiled on its first call on a machine; a device must not wait for it.
    signal.angle(np.zeros(1))
    recording = acquire_simulated(
        truth.device.kind,
        signal,
        rate_hz=truth.rate_hz,
        duration_s=truth.duration_s,
        clock_scale=truth.device.clock_scale,
    )
    # What a laboratory would not know stays out of the recording: no truth in its header.
    return replace(recording, metadata={**recording.metadata, "source": "simulated"})


def _instrument(record: Record) -> Recording:
    """Record from the port that the source names, as long as the table says."""
    from pendpipe.acquire import record_from_port

    port = record.source.removeprefix("dataq:")
    if record.stop_s is None:
        raise InputError(
            f"record {record.record}", "how long to record is not said", "give stop_s in seconds"
        )
    if record.channel and not record.channel.isdecimal():
        raise InputError(
            f"record {record.record}", f"channel '{record.channel}' is no number", "mend the cell"
        )
    channel = int(record.channel) if record.channel else None
    return record_from_port(port, channel=channel, duration_s=record.stop_s)


def _file(record: Record) -> Recording:
    """Read a recording that somebody else made."""
    from pendpipe.formats import ReadOptions, read

    path = record.file
    assert path is not None
    options = ReadOptions(channel=record.channel or None, volts_per_radian=record.volts_per_radian)
    recording = read(path, options)
    # The folder is the user's own business: the results name the file only.
    return replace(recording, metadata={**recording.metadata, "source": path.name})
