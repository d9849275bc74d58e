"""Recordings in the plain form."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import islice
from pathlib import Path

import numpy as np

from pendpipe.arrays import FloatArray, IntArray
from pendpipe.files import replaced
from pendpipe_challenge.scenario import Scenario


def plain_text(
    time_s: FloatArray, values: FloatArray, metadata: dict[str, str], quantity: str = "volts"
) -> str:
    """The file's text: ``# key: value`` lines, a header, rows."""
    lines = [f"# {key}: {value}" for key, value in metadata.items()]
    lines.append(f"time_s,{quantity}")
    lines += [f"{t:.9g},{v:.9g}" for t, v in zip(time_s.tolist(), values.tolist(), strict=True)]
    return "\n".join(lines) + "\n"


def recording_text(scenario: Scenario, codes: IntArray) -> str:
    """The laboratory's file of these codes, with nothing about what acted."""
    chain = scenario.chain
    metadata = {
        "volts_per_radian": repr(chain.nominal_volts_per_radian),
        "bits": str(chain.bits),
        "range_volts": repr(chain.range_volts),
    }
    volts = chain.step_volts * codes.astype(np.float64)
    return plain_text(scenario.time_s, volts, metadata)


def write_recording(path: str | Path, scenario: Scenario, codes: IntArray) -> None:
    """Write a recording in the plain form."""
    with replaced(path) as stream:
        stream.write(recording_text(scenario, codes))


def intervals_s(folder: Path, names: Iterable[str]) -> dict[str, float]:
    """Between the samples of a set's recordings, those that are there."""
    found = {}
    for name in names:
        path = folder / "recordings" / f"{name}.csv"
        if path.is_file():
            with path.open(encoding="utf-8") as stream:
                rows = [line for line in islice(stream, 40) if not line.startswith("#")][1:]
            times = [float(row.split(",")[0]) for row in rows]
            found[name] = (times[-1] - times[0]) / (len(times) - 1)
    return found
