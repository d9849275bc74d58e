"""Find where model and recording differ, and what physics is missing.

Eq. 8 (or Eq. 3) is fitted to a free decay. Its residual is searched for every effect of the
catalogue, of the pendulum and of the measurement alike; those that chance does not explain are
added to the model. The answer goes to standard output as one paragraph, and DIR gets
diagnosis.json and the figures.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pendpipe.commands import _reading, print_json
from pendpipe.commands._campaign import add_record

if TYPE_CHECKING:
    from pendpipe.stages.diagnose import DiagnosisOptions

FOUND = 3
"""Exit status where ``--fail-on`` asks for it."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of ``pendpipe diagnose``."""
    _reading.add_arguments(parser)
    parser.add_argument(
        "--out", type=Path, metavar="DIR", help="write diagnosis.json and the figures there"
    )
    parser.add_argument(
        "--json", action="store_true", help="print diagnosis.json instead of the paragraph"
    )
    parser.add_argument(
        "--baseline",
        choices=("eq8", "viscous"),
        default="eq8",
        help="the null model; eq8: Eq. 8, linear restoring torque (default); viscous: Eq. 3",
    )
    parser.add_argument(
        "--fix",
        action="append",
        default=[],
        metavar="NAME=VALUE",
        help="hold a parameter, so that a prediction is tested (a, b, c, frequency, amplitude,"
        " offset, quality_factor_hysteretic, quality_factor_viscous); repeatable",
    )
    parser.add_argument(
        "--level",
        type=_probability,
        default=0.01,
        metavar="P",
        help="false-alarm probability for a recording that lacks nothing (%(default)s)",
    )
    parser.add_argument(
        "--seed", type=int, default=0, metavar="N", help="of the draws that count trials"
    )
    parser.add_argument(
        "--fail-on", choices=("missing-physics",), help=f"end with status {FOUND} on that verdict"
    )
    parser.add_argument(
        "--figures",
        choices=("all", "found", "none"),
        default="all",
        help="draw them always (all), where something is missing (found), or never (none)",
    )
    parser.add_argument(
        "--no-figures", dest="figures", action="store_const", const="none", help="as --figures none"
    )
    parser.add_argument(
        "--turning-points", type=Path, metavar="CSV", help="of an earlier stage, with their cuts"
    )
    parser.add_argument(
        "--calibration", type=Path, metavar="JSON", help="the sensor's, from pendpipe calibrate"
    )
    add_record(parser)


def run(arguments: argparse.Namespace) -> int:
    """Diagnose, write the result, and print the answer."""
    from pendpipe.analysis.fit.fixed import parse_fixed
    from pendpipe.errors import InputError
    from pendpipe.files import make_folder
    from pendpipe.process import keep_memory
    from pendpipe.stages.diagnose import DiagnosisOptions

    if arguments.record is not None and arguments.out is None:
        raise InputError("--record", "a campaign's record needs a folder", "add --out DIR")
    keep_memory()
    fixed = parse_fixed(arguments.fix, arguments.baseline)
    options = DiagnosisOptions(
        arguments.baseline,
        fixed,
        arguments.seed,
        arguments.level,
        arguments.figures,
        arguments.record is not None,
    )
    if arguments.out is not None and Path(arguments.file).is_file():
        # Before the work: a long diagnosis must not end without a folder to write to.
        make_folder(arguments.out)
    if arguments.record is None:
        return _answer(arguments, options)
    from pendpipe.manifest import check, job
    from pendpipe.stages.diagnose import RESULT

    check([arguments.refused] if arguments.refused is not None else [])
    read = (Path(arguments.file), arguments.calibration, arguments.turning_points)
    inputs = [path for path in read if path is not None]
    with job(arguments.out.parent, "diagnose", inputs=inputs) as running:
        status = _answer(arguments, options)
        running.outputs.append(arguments.out / RESULT)
        running.extras += sorted(
            path for path in arguments.out.iterdir() if path.suffix in (".svg", ".png")
        )
    return status


def _answer(arguments: argparse.Namespace, options: DiagnosisOptions) -> int:
    """Diagnose, unless the record was refused before."""
    from pendpipe.stages.diagnose import refused_before

    earlier = refused_before(arguments.refused)
    if earlier is not None:
        return _not_analysable(arguments, options, earlier, {})
    return _diagnose(arguments, options)


def _diagnose(arguments: argparse.Namespace, options: DiagnosisOptions) -> int:
    from pendpipe.commands._motion import read_motion
    from pendpipe.errors import DamagedError, InputError
    from pendpipe.stages.diagnose import diagnose_motion, write_diagnosis

    provenance: dict[str, Any] = {"seed": options.seed, "fixed": list(arguments.fix)}
    try:
        recording, made = read_motion(arguments)
        provenance = made | provenance | {"level": options.level}
        outcome = diagnose_motion(
            recording,
            options,
            place=arguments.file,
            turning_points=arguments.turning_points,
            provenance=provenance,
            progress=_print_progress,
        )
    except InputError as error:
        if isinstance(error, DamagedError) or not Path(arguments.file).is_file():
            raise
        from pendpipe.stages.refusal import within_results

        reason = within_results(error, arguments.refused)
        return _not_analysable(arguments, options, reason, provenance)
    content = outcome.to_dict()
    if arguments.out is not None:
        content = write_diagnosis(arguments.out, outcome, options, _print_progress)
    for warning in content["warnings"]:
        print(f"{arguments.file}: {warning}", file=sys.stderr)
    _print_answer(arguments, content)
    return FOUND if arguments.fail_on == content["verdict"] else 0


def _not_analysable(
    arguments: argparse.Namespace,
    options: DiagnosisOptions,
    reason: str,
    provenance: dict[str, Any],
) -> int:
    """Write why there is no diagnosis; in a campaign the other records go on."""
    from pendpipe.diagnosis.result import not_analysable
    from pendpipe.stages.diagnose import write_not_analysable

    if arguments.out is not None:
        write_not_analysable(arguments.out, options, reason, provenance)
    if arguments.json:
        _print_answer(arguments, not_analysable(options.baseline, reason, provenance))
    print(f"pendpipe: {reason}", file=sys.stderr)
    return 2 if arguments.refused is None else 0


def _print_answer(arguments: argparse.Namespace, content: dict[str, Any]) -> None:
    """Print the paragraph, or the whole result with ``--json``."""
    if arguments.json:
        print_json(content)
    else:
        print(content["statement"])


def _print_progress(line: str) -> None:
    """Progress goes to standard error."""
    print(f"  {line}", file=sys.stderr, flush=True)


def _probability(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"'{text}' is no number between 0 and 1") from None
    if not 0.0 < value < 1.0:
        raise argparse.ArgumentTypeError(f"{text} does not lie between 0 and 1")
    return value
