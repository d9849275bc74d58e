"""Measure the turning points of a free decay, each from all readings of its half cycle.

The table has one row per turning point: its half cycle's number, time and signed angle about
the level, with standard deviations (independent of each other), and the level. The head
holds what they share: noise, the level's standard deviation, the spans that were cut.
"""

from pathlib import Path

from pendpipe.analysis.free_decay import measure_recording
from pendpipe.analysis.turning_points import write_turning_points
from pendpipe.arguments import FILE, Arguments, command, read_motion, tell, tell_written
from pendpipe.options import OUTPUT, flags
from pendpipe.quantities import after_number
from pendpipe.stages.refusal import run_stage


@command(
    FILE
    | {"--out": {"type": Path, "required": True, "metavar": "CSV", "help": "the table"} | OUTPUT}
    | flags("--calibration", "--record", "--refused")
)
def run(arguments: Arguments) -> None:
    """Measure and write."""
    run_stage(
        "turning-points",
        arguments.record,
        lambda: _measure(arguments),
        outputs=[arguments.out],
        refused=arguments.refused,
        inputs=[Path(arguments.file), arguments.calibration],
    )


def _measure(arguments: Arguments) -> None:
    recording, provenance = read_motion(arguments)
    points, _ = measure_recording(recording, arguments.file, provenance)
    write_turning_points(arguments.out, points)
    for note in points.notes:
        tell(f"{arguments.file}: {note}")
    tell_written(
        arguments.out,
        f"{len(points)} turning points, {points.apparent_frequency_hz:.6g} Hz,"
        f" {abs(points.angle_rad[0]):.4g}{after_number(points.unit)} at first",
    )
