"""A recording in the plain form, with the metadata that a laboratory would have."""

from __future__ import annotations

from pathlib import Path

from pendpipe.arrays import FloatArray, IntArray
from pendpipe.challenge.scenario import Scenario
from pendpipe.files import replaced


def plain_text(time_s: FloatArray, volts: FloatArray, metadata: dict[str, str]) -> str:
    """The file's text: ``# key: value`` lines, a header, rows."""
    lines = [f"# {key}: {value}" for key, value in metadata.items()]
    lines.append("time_s,volts")
    lines += [f"{t:.9g},{v:.9g}" for t, v in zip(time_s.tolist(), volts.tolist(), strict=True)]
    return "\n".join(lines) + "\n"


def recording_text(scenario: Scenario, codes: IntArray) -> str:
    """What the laboratory's file of these codes says: nothing about what acted."""
    chain = scenario.chain
    metadata = {
        "volts_per_radian": repr(chain.nominal_volts_per_radian),
        "bits": str(chain.bits),
        "range_volts": repr(chain.range_volts),
    }
    return plain_text(scenario.time_s, codes * chain.step_volts, metadata)


def write_recording(path: str | Path, scenario: Scenario, codes: IntArray) -> None:
    """Write a recording in the plain form."""
    with replaced(path) as stream:
        stream.write(recording_text(scenario, codes))
