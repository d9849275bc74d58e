"""A recording in the plain form, with the metadata that a laboratory would have."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from pendpipe.arrays import FloatArray, IntArray
from pendpipe.challenge.scenario import Scenario
from pendpipe.files import replaced


def plain_text(
    time_s: FloatArray, values: FloatArray, metadata: dict[str, str], quantity: str = "volts"
) -> str:
    """The file's text: ``# key: value`` lines, a header, rows."""
    lines = [f"# {key}: {value}" for key, value in metadata.items()]
    lines.append(f"time_s,{quantity}")
    lines += [f"{t:.9g},{v:.9g}" for t, v in zip(time_s.tolist(), values.tolist(), strict=True)]
    return "\n".join(lines) + "\n"


def recording_text(scenario: Scenario, codes: IntArray) -> str:
    """What the laboratory's file of these codes says: nothing about what acted."""
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
