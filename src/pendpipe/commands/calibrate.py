"""The sensor's constant in V/rad from a table of volts against angles.

FILE is a CSV with a header: `volts` and one of `angle_rad`, `angle_deg`, `displacement_m`
(with --arm-m, the distance from the axis to where the caliper touches), and optionally
`volts_sd` and `angle_sd_rad`. Lines that start with # are remarks.

With --record (the workflow's way) FILE is a recording instead, and the result says which
constant holds for it.
"""

from __future__ import annotations

import argparse
import math
from pathlib import Path
from typing import TYPE_CHECKING, Final

from pendpipe.arguments import SHARED, Flags, print_answer, shared, under

if TYPE_CHECKING:
    from pendpipe.analysis.calibrate import Calibration


_OWN: Final[Flags] = {
    "file": {"metavar": "FILE", "type": Path, "help": "table of volts against angles"},
    "--out": {"type": Path, "metavar": "JSON", "help": "write the result here"},
    "--json": SHARED["--json"],
    "--arm-m": {"type": float, "metavar": "M", "help": "arm of the displacements, metres"},
    "--arm-sd-m": {"type": float, "default": 0.0, "metavar": "M", "help": "its standard deviation"},
    "--displacement-sd-m": {
        "type": float,
        "default": 0.0,
        "metavar": "M",
        "help": "standard deviation of a displacement (the caliper's)",
    },
    "--delimiter": {"help": "between the cells; guessed from the header"},
    "--decimal": {"choices": ".,", "help": "decimal mark; guessed from the delimiter"},
}
_OF_A_RECORD: Final = shared("--record", "--refused") | {
    "--sensor": {"type": Path, "metavar": "JSON", "help": "the campaign's calibration"},
    "--volts-per-radian": {"type": float, "metavar": "V/RAD", "help": "a known constant"},
}
ARGUMENTS: Final = _OWN | under("with --record", _OF_A_RECORD)


def run(arguments: argparse.Namespace) -> int:
    """Calibrate a sensor, or pick the constant of a record."""
    if arguments.record is not None:
        return _record(arguments)
    from pendpipe import manifest

    if arguments.out is None or not (arguments.out.parent / manifest.FOLDER).is_dir():
        return _sensor(arguments)
    # The campaign's caliper run, in its folder of results.
    out: Path = arguments.out
    with manifest.job(out.parent, "sensor", inputs=[arguments.file], outputs=[out]):
        return _sensor(arguments)


def _sensor(arguments: argparse.Namespace) -> int:
    """Fit, print and write a sensor's line."""
    from pendpipe.analysis.calibrate import calibrate, read_caliper_table
    from pendpipe.files import write_json

    table = read_caliper_table(
        arguments.file,
        arm_m=arguments.arm_m,
        displacement_sd_m=arguments.displacement_sd_m,
        delimiter=arguments.delimiter,
        decimal=arguments.decimal,
    )
    relative_sd = arguments.arm_sd_m / arguments.arm_m if table.by_displacement else 0.0
    calibration = calibrate(
        table.angle_rad,
        table.volts,
        volts_sd=table.volts_sd,
        angle_sd_rad=table.angle_sd_rad,
        relative_scale_sd=relative_sd,
        place=str(arguments.file),
    )
    print_answer(arguments, calibration.as_json(), _statement(calibration))
    if arguments.out:
        write_json(arguments.out, calibration.as_json())
    return 0


def _statement(calibration: Calibration) -> str:
    """Say the result in a few lines."""
    constant, offset = calibration.volts_per_radian, calibration.offset
    low, high = calibration.angle_rad.min(), calibration.angle_rad.max()
    misfit = calibration.chi2_p_value
    linear = "linearity        not tested: it takes five points at four angles"
    if curve := calibration.linearity:
        verdict = "no curvature seen" if curve.p_value >= 0.01 else "the sensor is not linear here"
        linear = (
            f"linearity        p = {curve.p_value:.3g} ({verdict}; cubic departs from the line"
            f" by at most {100 * curve.largest_deviation:.2g} % of its span)"
        )
    lines = (
        f"volts_per_radian {constant.value:.7g} +- {constant.sd:.2g} V/rad",
        f"offset           {offset.value:.5g} +- {offset.sd:.2g} V",
        f"points           {len(calibration.volts)}, from {low:.4g} to {high:.4g} rad",
        f"residual sd      {calibration.residual_sd_volts:.3g} V",
        *([f"lack of fit      p = {misfit:.3g}"] if math.isfinite(misfit) else []),
        linear,
    )
    return "\n".join(lines)


def _record(arguments: argparse.Namespace) -> int:
    """Pick the constant that holds for one record of a campaign."""
    from pendpipe.errors import refuse_if
    from pendpipe.stages.calibrate import calibrate_record
    from pendpipe.stages.refusal import run_stage

    refuse_if(
        arguments.out is None, "--out", "it is missing", "give the file for the record's constant"
    )
    return run_stage(
        "calibrate",
        arguments.record,
        lambda: calibrate_record(
            arguments.file,
            arguments.out,
            sensor=arguments.sensor,
            given=arguments.volts_per_radian,
        ),
        outputs=[arguments.out],
        refused=arguments.refused,
        inputs=[arguments.file, arguments.sensor],
    )
