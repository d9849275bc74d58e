"""Fit a, b, c, frequency, amplitude, phase and offset of one free decay.

--method turning-points fits Eq. 14 to the turning points (the paper's way); --method
waveform fits Eq. 8 to all readings, starting from there. --method auto, the default, takes the
waveform, and the turning points where the waveform's law contradicts the decay. --fix holds a
parameter, so that a prediction is compared with the recording.

The light compares the fitted law's loss with the decrement of the turning points at three
amplitudes. green: they agree, and noise explains the rest. amber: they agree, but the readings
differ from the law by more than noise. red: they contradict each other; then the reason is
printed instead of the law, and the exit status is 2 unless --accept is given.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pendpipe.commands import _reading
from pendpipe.commands._campaign import add_record

if TYPE_CHECKING:
    from pendpipe.analysis.fit import FitResult


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of ``pendpipe fit``."""
    _reading.add_arguments(parser)
    parser.add_argument("--out", type=Path, required=True, metavar="JSON", help="the result")
    parser.add_argument(
        "--method",
        choices=("auto", "waveform", "turning-points"),
        default="auto",
        help="%(default)s",
    )
    parser.add_argument(
        "--accept",
        action="store_true",
        help="print a law that contradicts the decay, and end with 0",
    )
    parser.add_argument(
        "--baseline",
        choices=("eq8", "viscous"),
        default="eq8",
        help="eq8: Eq. 8, linear restoring torque (default); viscous: Eq. 3",
    )
    parser.add_argument(
        "--fix",
        action="append",
        default=[],
        metavar="NAME=VALUE",
        help="hold a parameter (a, b, c, frequency, amplitude, offset, quality_factor_hysteretic,"
        " quality_factor_viscous); repeatable",
    )
    parser.add_argument(
        "--turning-points", type=Path, metavar="CSV", help="found before, with their cuts"
    )
    parser.add_argument(
        "--calibration", type=Path, metavar="JSON", help="the sensor's, from pendpipe calibrate"
    )
    parser.add_argument("--seed", type=int, metavar="N", help="noted; the fit draws no numbers")
    add_record(parser)


def run(arguments: argparse.Namespace) -> int:
    """Fit and write."""
    from pendpipe.stages.refusal import run_stage

    lights: list[str] = []
    status = run_stage(
        "fit",
        arguments.record,
        lambda: lights.append(_fit(arguments)),
        outputs=[arguments.out],
        refused=arguments.refused,
        inputs=[Path(arguments.file), arguments.calibration, arguments.turning_points],
    )
    # In a campaign the light stands in the result, and the other records go on.
    contradicted = "red" in lights and not arguments.accept and arguments.refused is None
    return 2 if contradicted else status


def _fit(arguments: argparse.Namespace) -> str:
    from dataclasses import replace

    from pendpipe.analysis.fit import fit_recording
    from pendpipe.analysis.fit.fixed import parse_fixed
    from pendpipe.analysis.turning_points import read_turning_points
    from pendpipe.commands._motion import read_motion
    from pendpipe.files import write_json

    fixed = parse_fixed(arguments.fix, arguments.baseline)
    recording, provenance = read_motion(arguments)
    if arguments.turning_points is not None:
        points = read_turning_points(arguments.turning_points)
        part = recording.between(points.start_s, points.stop_s)
    else:
        from pendpipe.analysis.turning_points.recorded import measure_recording

        points, part = measure_recording(recording, arguments.file)
    result = fit_recording(
        part,
        points=points,
        method=None if arguments.method == "auto" else arguments.method,
        baseline=arguments.baseline,
        fixed=fixed,
        place=arguments.file,
    )
    result = replace(
        result,
        cuts=tuple(cut._asdict() for cut in points.cuts),
        provenance=_provenance(arguments, provenance),
    )
    write_json(arguments.out, result.as_json())
    if result.light == "red":
        remedy = "see pendpipe diagnose; --accept prints the law all the same"
        print(f"pendpipe: {arguments.file}: {result.light_reason}; {remedy}", file=sys.stderr)
    for warning in result.warnings:
        print(f"{arguments.file}: {warning}", file=sys.stderr)
    print(_statement(arguments.out, result, law=result.light != "red" or arguments.accept))
    return result.light


def _provenance(arguments: argparse.Namespace, provenance: dict[str, Any]) -> dict[str, Any]:
    """What the result must say of its making."""
    return {
        "input_sha256": provenance["input_sha256"],
        "version": provenance["version"],
        "seed": arguments.seed,
        "volts_per_radian": provenance["volts_per_radian"],
        "fixed": list(arguments.fix),
    }


def _statement(out: Path, result: FitResult, *, law: bool) -> str:
    """The light with its reason, the numbers a line each (with `law`), and the check."""
    lines = [
        f"{result.light}: {result.light_reason}",
        f"{out}: {result.method}, {result.restoring} restoring torque,"
        f" {result.turning_points} turning points",
    ]
    if law:
        lines += _numbers(result)
    unit = result.parameters["amplitude"].unit
    for check in result.decrement_check:
        lines.append(f"  {'decrement_check':<22}{check.sentence(unit)}")
    return "\n".join(lines)


def _numbers(result: FitResult) -> list[str]:
    lines = []
    for name, estimate in result.parameters.items():
        bound = " (at its bound)" if estimate.at_bound else ""
        lines.append(
            f"  {name:<22}{estimate.value:.8g} +- {estimate.sd:.2g} {estimate.unit}{bound}"
        )
    limit = result.quality_factor_limit
    if limit is not None:
        lines.append(f"  {'quality_factor_limit':<22}{limit.value:.6g} +- {limit.sd:.2g}")
    lines.append(f"  {'chi2_per_dof':<22}{result.chi2_per_dof:.4g}")
    return lines
