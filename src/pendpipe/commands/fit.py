"""Fit a, b, c, Q and the period of free decays.

One FILE prints its fit; several print a table, a line a recording. --method waveform fits Eq. 8
to all readings, --method turning-points fits Eq. 14 to the turning points (the paper's way), and
auto, the default, takes the turning points, or the larger amplitudes alone, only where the
waveform's law contradicts the decay. The restoring torque is sin x where the recording asks for it.

The light compares the fitted law's loss with the decrement of the turning points at three
amplitudes. green: they agree, and noise explains the rest. amber: they agree, but the readings
differ from the law by more than noise. red: they contradict each other; then the reason is
printed instead of the law, and the exit status is 2 unless --accept is given.
"""

from dataclasses import replace
from pathlib import Path
from typing import Final

from pendpipe import api
from pendpipe.analysis.fit.by_points import parse_fixed
from pendpipe.analysis.fit.result import FitResult, gravity_line, lines, row, table
from pendpipe.analysis.turning_points import read_turning_points
from pendpipe.arguments import (
    FILES,
    OUTPUT,
    Arguments,
    Flags,
    number_within,
    print_answer,
    print_json,
    read_motion,
    shared,
    tell,
)
from pendpipe.errors import InputError, refuse_if
from pendpipe.files import is_stream, write_json

_OWN: Final[Flags] = {
    "--out": {"metavar": "JSON", "help": "the result; - is standard output"} | OUTPUT,
    "--figure": {
        "type": Path,
        "metavar": "FILE",
        "help": "draw the decay with its fit, the residual, and Q against amplitude (.svg, .png)",
    }
    | OUTPUT,
    "--length": {
        "type": number_within(0),
        "metavar": "M",
        "help": "length of a simple pendulum, m: prints g",
    },
    "--gravity": {
        "type": number_within(0),
        "metavar": "G",
        "help": "g in m/s^2: prints the equivalent length",
    },
    "--method": {"choices": ("auto", "waveform", "turning-points"), "default": "auto"},
    "--restoring": {
        "choices": ("auto", "linear", "sine"),
        "default": "auto",
        "help": "the restoring torque: omega^2 x, omega^2 sin x, or what the recording asks for",
    },
    "--accept": {
        "action": "store_true",
        "help": "print a law that contradicts the decay, status 0",
    },
    "--seed": {"type": int, "metavar": "N", "help": "recorded only"},
}
ARGUMENTS: Final = (
    FILES
    | _OWN
    | shared("--json", "--baseline", "--fix", "--turning-points", "--calibration")
    | shared("--record", "--refused")
)


def run(arguments: Arguments) -> int:
    """Fit and print; write what is asked for."""
    if len(arguments.files) > 1:
        return _table(arguments)
    arguments.file = arguments.files[0]
    if arguments.record is not None or arguments.refused is not None:
        _stage(arguments)
        return 0
    figure: Path | None = arguments.figure
    # A form that nobody can draw is refused before the file is written.
    refuse_if(
        figure and figure.suffix not in (".svg", ".png"),
        f"--figure {figure}",
        "its form is unknown",
        "end its name in .svg or .png",
    )
    result = _fit(arguments)
    if result.light == "red":
        why = result.light_reason if arguments.json else "no law is printed"
        tell(f"pendpipe: {arguments.file}: {why} (--accept prints it)")
    if arguments.out:
        _write(arguments, result)
    if figure:
        from pendpipe.figures.style import save

        save(result.plot(), figure.with_suffix(""), forms=[figure.suffix[1:]])
    if arguments.out and is_stream(arguments.out):
        return _status(arguments, result)
    if arguments.json:
        print_json(result.to_dict())
    else:
        _print(arguments, result)
    return _status(arguments, result)


def _stage(arguments: Arguments) -> None:
    """Fit one record of a campaign; a red light stands in the result and stops nothing."""
    from pendpipe.stages.refusal import run_stage

    refuse_if(not arguments.out, "--out", "a record's fit needs a file", "give --out fit.json")
    run_stage(
        "fit",
        arguments.record,
        lambda: _write(arguments, _fit(arguments)),
        outputs=[Path(arguments.out)],
        refused=arguments.refused,
        inputs=[Path(arguments.file), arguments.calibration, arguments.turning_points],
    )


def _fit(arguments: Arguments) -> FitResult:
    fixed = parse_fixed(arguments.fix, arguments.baseline)
    recording, provenance = read_motion(arguments)
    points = arguments.turning_points and read_turning_points(arguments.turning_points)
    result = api.fit(
        recording,
        points=points,
        method=None if arguments.method == "auto" else arguments.method,
        restoring=None if arguments.restoring == "auto" else arguments.restoring,
        baseline=arguments.baseline,
        fixed=fixed,
        name=arguments.file,
    )
    return replace(
        result,
        provenance={
            "input_sha256": provenance["input_sha256"],
            "version": provenance["version"],
            "seed": arguments.seed,
            "volts_per_radian": provenance["volts_per_radian"],
            "fixed": list(arguments.fix),
        },
    )


def _write(arguments: Arguments, result: FitResult) -> None:
    write_json(arguments.out, result.to_dict())
    for warning in result.warnings:
        tell(f"{arguments.file}: {warning}")


def _print(arguments: Arguments, result: FitResult) -> None:
    """Print the summary."""
    printed = lines(result, law=result.light != "red" or arguments.accept)
    if arguments.length or arguments.gravity:
        length_m, gravity = arguments.length, arguments.gravity
        printed.insert(-1, gravity_line(result, length_m=length_m, gravity=gravity))
    print("\n".join(printed))


def _status(arguments: Arguments, result: FitResult) -> int:
    return 2 if result.light == "red" and not arguments.accept else 0


def _table(arguments: Arguments) -> int:
    """Fit several recordings; what can't be fitted gets its reason, and the others go on."""
    for option in ("out", "figure", "turning_points", "record"):
        refuse_if(
            getattr(arguments, option),
            f"--{option.replace('_', '-')}",
            "it belongs to one FILE",
            "fit that file alone",
        )
    status, found, rows = 0, [], []
    for file in arguments.files:
        arguments.file = file
        try:
            result = _fit(arguments)
        except InputError as problem:
            tell(f"pendpipe: {problem}")
            found.append({"file": file, "error": str(problem)})
            rows.append(row(file, None))
            status = 2
        else:
            found.append({"file": file, **result.to_dict()})
            rows.append(row(file, result))
            status = max(status, _status(arguments, result))
    print_answer(arguments, {"schema_version": 1, "fits": found}, table(rows))
    return status
