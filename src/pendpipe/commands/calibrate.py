"""The sensor's constant in V/rad from a table of volts against angles.

FILE is a CSV with a header: `volts` and one of `angle_rad`, `angle_deg`, `displacement_m`
(with --arm-m, the distance from the axis to where the caliper touches), and optionally
`volts_sd` and `angle_sd_rad`. Lines that start with # are remarks.

With --record (the workflow's way) FILE is a recording instead, and the result says which
constant holds for it.
"""

from pathlib import Path
from typing import Any

import numpy as np

from pendpipe.arguments import Arguments, command, print_answer
from pendpipe.errors import InputError, refuse_if
from pendpipe.files import is_stream, read_json, write_json
from pendpipe.options import INPUT, OUTPUT, SENSOR, flags, under
from pendpipe.recording import Recording, read_plain
from pendpipe.stages.refusal import run_stage


@command(
    {
        "file": {"metavar": "FILE", "type": Path, "help": "table of volts against angles"} | INPUT,
        "--out": {"type": Path, "metavar": "JSON", "help": "write the result here"} | OUTPUT,
        **flags("--json"),
        "--arm-m": {"type": float, "metavar": "M", "help": "arm of the displacements, metres"},
        "--arm-sd-m": {
            "type": float,
            "default": 0.0,
            "metavar": "M",
            "help": "its standard deviation",
        },
        "--displacement-sd-m": {
            "type": float,
            "default": 0.0,
            "metavar": "M",
            "help": "standard deviation of a displacement (the caliper's)",
        },
        "--delimiter": {
            "metavar": "SIGN",
            "help": "separator of the cells; guessed from the header",
        },
        "--decimal": {
            "metavar": "SIGN",
            "choices": ".,",
            "help": "decimal sign; guessed from the delimiter",
        },
    }
    | under(
        "with --record",
        flags("--record", "--refused")
        | {
            "--volts-per-radian": {"type": float, "metavar": "V", "help": SENSOR},
            "--sensor": {"type": Path, "metavar": "JSON", "help": "the campaign's calibration"}
            | INPUT,
        },
    )
)
def run(arguments: Arguments) -> None:
    """Calibrate a sensor, or pick the constant of a record."""
    out: Path | None = arguments.out
    if arguments.record is not None:
        refuse_if(out is None, "--out", "it is missing", "give the file for the record's constant")
        run_stage(
            "calibrate",
            arguments.record,
            lambda: _of_record(arguments),
            outputs=[arguments.out],
            refused=arguments.refused,
            inputs=[arguments.file, arguments.sensor],
        )
    else:
        _sensor(arguments)


def _sensor(arguments: Arguments) -> None:
    """Fit, print and write a sensor's line."""
    from pendpipe.analysis.calibrate import calibrate, read_caliper_table

    table = read_caliper_table(
        arguments.file,
        arm_m=arguments.arm_m,
        arm_sd_m=arguments.arm_sd_m,
        displacement_sd_m=arguments.displacement_sd_m,
        delimiter=arguments.delimiter,
        decimal=arguments.decimal,
    )
    calibration = calibrate(**table)
    if not (arguments.out and is_stream(arguments.out)):
        print_answer(arguments, calibration.as_json(), str(calibration))
    if arguments.out:
        write_json(arguments.out, calibration.as_json())


def _of_record(arguments: Arguments) -> None:
    """Write the sensor constant of one record with its standard deviation.

    The record's own constant (from the table) comes before the one in the recording's
    metadata, and that before the campaign's caliper run. A recording in radians or
    metres needs none: ``"volts_per_radian": null``.
    """
    recording = read_plain(arguments.file)
    constant, shared, warnings = None, False, list[str]()
    given = arguments.volts_per_radian
    own = given if given is not None else recording.number("volts_per_radian", arguments.file)
    if recording.quantity != "volts":
        origin = f"recorded in {recording.unit}"
    elif own is not None:
        origin = "the table of records" if given is not None else "the recording"
        constant = {"value": own, "sd": 0.0, "unit": "V/rad"}
        warnings = ["the sensor constant is given without an uncertainty"]
    elif arguments.sensor is not None:
        origin, shared, result = "the caliper run", True, read_json(arguments.sensor)
        constant, warnings = result["volts_per_radian"], _range_warnings(recording, result)
    else:
        raise InputError(
            arguments.file,
            "the readings are volts and no sensor constant is known",
            "give volts_per_radian in the table of records, or a calibration",
        )
    if short := recording.metadata.get("incomplete"):
        warnings = [*warnings, f"the recording is incomplete: {short}"]
    content = {"volts_per_radian": constant, "warnings": warnings, "from": origin, "shared": shared}
    write_json(arguments.out, {"schema_version": 1, **content})


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
