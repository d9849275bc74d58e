"""Serial captures of a DI-149 in its ASCII mode: ``start``, ``sc 12 13`` ..., ``stop``."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Final

import numpy as np

from pendpipe.errors import InputError
from pendpipe.formats.options import ReadOptions
from pendpipe.formats.table import Column, NotThisFormatError, Table
from pendpipe.formats.text import decode

_CLOCK_HZ: Final = 750_000.0
_SLOWEST: Final = 65535
_VOLTS_PER_COUNT: Final = 10.0 / 2048.0
_SCAN: Final = re.compile(r"sc((?:\s+[+-]?\d+)+)\s*")


def read_table(place: Path, data: bytes, options: ReadOptions) -> Table:
    """Read a capture; the volts are 10 counts/2048, the scan rate 750 kHz over ``srate``.

    Raises
    ------
    NotThisFormatError
        When there is no ``sc`` line.
    InputError
        When a scan is spoilt.
    """
    if not re.search(rb"(^|[\r\n])sc\s+[+-]?\d", data[:65536]):
        raise NotThisFormatError("there is no line 'sc' with counts")
    lines = decode(data).replace("\0", "").split("\n")
    scans: list[list[int]] = []
    numbers: list[int] = []
    notes: list[str] = []
    metadata: dict[str, str] = {}
    srate = None
    for number, line in enumerate(lines, start=1):
        text = line.strip()
        told = re.search(r"srate\s+(x[0-9a-f]+|\d+)", text)
        if told:
            srate = int(told[1][1:], 16) if told[1][0] == "x" else int(told[1])
        if re.fullmatch(r"1\d{9}(\.\d+)?", text):
            metadata["recorded_at"] = f"{text} s since 1970"
        if not text.startswith("sc"):
            continue
        match = _SCAN.fullmatch(text)
        row = [int(count) for count in match[1].split()] if match else []
        if not row or (scans and len(row) != len(scans[0])):
            if not any(rest.strip().startswith("sc") for rest in lines[number:]):
                notes.append(f"the last scan (line {number}) is cut short and left out")
                break
            raise InputError(
                f"{place}, line {number}", f"'{text}' is no whole scan", "drop the row"
            )
        scans.append(row)
        numbers.append(number)
    if not scans:
        raise InputError(place, "there is no whole scan", "record again, or give another file")
    if not srate and options.sample_rate is None:
        srate = _SLOWEST
        notes.append("the capture does not say its srate: 65535 (11.44 Hz) is taken")
    counts = np.array(scans, dtype=np.float64)
    columns = tuple(
        Column(
            name=f"channel {channel + 1}",
            unit="V",
            values=counts[:, channel] * _VOLTS_PER_COUNT,
            number=channel + 1,
            resolution=_VOLTS_PER_COUNT,
            limits=(-10.0, 2047 * _VOLTS_PER_COUNT),
        )
        for channel in range(counts.shape[1])
    )
    return Table(
        place=place,
        format="di149-ascii",
        columns=columns,
        lines=np.array(numbers, dtype=np.int64),
        interval_s=srate / _CLOCK_HZ if srate else None,
        metadata={**metadata, "bits": "12", "range_volts": "10"},
        notes=tuple(notes),
    )
