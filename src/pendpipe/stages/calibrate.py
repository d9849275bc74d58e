"""Which sensor constant holds for a record: its own, its file's, or the campaign's."""

from pathlib import Path
from typing import Any

import numpy as np

from pendpipe.errors import InputError
from pendpipe.files import read_json, write_json
from pendpipe.recording import Recording, read_plain


def calibrate_record(
    recording_path: Path, out: Path, *, sensor: Path | None, given: float | None
) -> None:
    """Write the sensor constant of one record with its standard deviation.

    The record's own constant (from the table) comes before the one in the recording's
    metadata, and that before the campaign's caliper run. A recording in radians or
    metres needs none: ``"volts_per_radian": null``.

    Parameters
    ----------
    recording_path
        The plain recording.
    out
        The JSON to write.
    sensor
        Result of the campaign's calibration, where there is one.
    given
        V/rad from the table of records, where there is one.

    Raises
    ------
    InputError
        If the recording is in volts and no sensor constant is known.
    """
    recording = read_plain(recording_path)
    content: dict[str, Any] = {"schema_version": 1, "volts_per_radian": None, "warnings": []}
    own = given if given is not None else recording.number("volts_per_radian", recording_path)
    if recording.quantity != "volts":
        content["from"] = f"recorded in {recording.unit}"
    elif own is not None:
        content["from"] = "the table of records" if given is not None else "the recording"
        content["volts_per_radian"] = {"value": own, "sd": 0.0, "unit": "V/rad"}
        content["warnings"].append("the sensor constant is given without an uncertainty")
    elif sensor is not None:
        result = read_json(sensor)
        content["from"] = "the caliper run"
        content["volts_per_radian"] = result["volts_per_radian"]
        content["warnings"] += _range_warnings(recording, result)
    else:
        raise InputError(
            recording_path,
            "the readings are volts and no sensor constant is known",
            "give volts_per_radian in the table of records, or a calibration",
        )
    write_json(out, content)


def _range_warnings(recording: Recording, result: dict[str, Any]) -> list[str]:
    """Say when a record goes beyond what the caliper run has tested."""
    tested = max(abs(float(point["angle_rad"])) for point in result["points"])
    volts = recording.values[recording.usable]
    largest = float(np.max(np.abs(volts - np.median(volts))))
    reached = largest / abs(float(result["volts_per_radian"]["value"]))
    warning = (
        f"the record reaches {reached:.3g} rad, the calibration was tested to {tested:.3g} rad:"
        " linearity beyond is assumed"
    )
    return [warning] if reached > 1.05 * tested else []
