"""Say where model and recording differ, and what physics was left out.

Eq. 8 (or Eq. 3) is fitted to a free decay; what it leaves is searched for every effect of
the catalogue, dynamics and measurement alike, and those that chance does not explain are
added to the model. DIR gets diagnosis.json and the figures; the answer in one paragraph
goes to standard output.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pendpipe.commands import _reading
from pendpipe.commands._campaign import add_record

if TYPE_CHECKING:
    from pendpipe.stages.diagnose import DiagnosisOptions

FOUND = 3
"""Exit status where ``--fail-on`` asks for it."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of ``pendpipe diagnose``."""
    _reading.add_arguments(parser)
    parser.add_argument("--out", type=Path, required=True, metavar="DIR", help="for the results")
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
        help="hold a parameter, so that a prediction is compared (a, b, c, frequency, amplitude,"
        " offset, quality_factor_hysteretic, quality_factor_viscous); repeatable",
    )
    parser.add_argument(
        "--level",
        type=_probability,
        default=0.01,
        metavar="P",
        help="how often a recording that lacks nothing may be accused (%(default)s)",
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
        help="draw them always (all), where something is missing (found), or never",
    )
    parser.add_argument(
        "--no-figures", dest="figures", action="store_const", const="none", help="as --figures none"
    )
    parser.add_argument(
        "--turning-points", type=Path, metavar="CSV", help="found before, with their cuts"
    )
    parser.add_argument(
        "--calibration", type=Path, metavar="JSON", help="the sensor's, from pendpipe calibrate"
    )
    add_record(parser)


def run(arguments: argparse.Namespace) -> int:
    """Diagnose, write, and say it."""
    from pendpipe.analysis.fit.fixed import parse_fixed
    from pendpipe.files import make_folder
    from pendpipe.process import keep_memory
    from pendpipe.stages.diagnose import DiagnosisOptions

    keep_memory()
    fixed = parse_fixed(arguments.fix, arguments.baseline)
    question = DiagnosisOptions(
        arguments.baseline,
        fixed,
        arguments.seed,
        arguments.level,
        arguments.figures,
        arguments.record is not None,
    )
    if Path(arguments.file).is_file():
        # Before the work: a long diagnosis must not end without a place for it.
        make_folder(arguments.out)
    if arguments.record is None:
        return _answer(arguments, question)
    from pendpipe.manifest import check, job
    from pendpipe.stages.diagnose import RESULT

    check([arguments.refused] if arguments.refused is not None else [])
    read = (Path(arguments.file), arguments.calibration, arguments.turning_points)
    inputs = [path for path in read if path is not None]
    with job(arguments.out.parent, "diagnose", inputs=inputs) as running:
        status = _answer(arguments, question)
        running.outputs.append(arguments.out / RESULT)
        running.extras += sorted(
            path for path in arguments.out.iterdir() if path.suffix in (".svg", ".png")
        )
    return status


def _answer(arguments: argparse.Namespace, question: DiagnosisOptions) -> int:
    """Diagnose, unless the record was refused before."""
    from pendpipe.stages.diagnose import refused_before

    earlier = refused_before(arguments.refused)
    if earlier is not None:
        return _not_analysable(arguments, question, earlier, {})
    return _diagnose(arguments, question)


def _diagnose(arguments: argparse.Namespace, question: DiagnosisOptions) -> int:
    from pendpipe.commands._motion import read_motion
    from pendpipe.errors import DamagedError, InputError
    from pendpipe.stages.diagnose import diagnose_motion, write_diagnosis

    provenance: dict[str, Any] = {"seed": question.seed, "fixed": list(arguments.fix)}
    try:
        recording, made = read_motion(arguments)
        provenance = made | provenance | {"level": question.level}
        outcome = diagnose_motion(
            recording,
            question,
            place=arguments.file,
            turning_points=arguments.turning_points,
            provenance=provenance,
            progress=_say,
        )
    except InputError as fault:
        if isinstance(fault, DamagedError) or not Path(arguments.file).is_file():
            raise
        from pendpipe.stages.refusal import within_results

        reason = within_results(fault, arguments.refused)
        return _not_analysable(arguments, question, reason, provenance)
    content = write_diagnosis(arguments.out, outcome, question, _say)
    for warning in content["warnings"]:
        print(f"{arguments.file}: {warning}", file=sys.stderr)
    print(content["statement"])
    asked = arguments.fail_on == content["verdict"]
    return FOUND if asked else 0


def _not_analysable(
    arguments: argparse.Namespace,
    question: DiagnosisOptions,
    reason: str,
    provenance: dict[str, Any],
) -> int:
    """Write why there is no diagnosis; in a campaign the other records go on."""
    from pendpipe.stages.diagnose import write_not_analysable

    write_not_analysable(arguments.out, question, reason, provenance)
    print(f"pendpipe: {reason}", file=sys.stderr)
    return 2 if arguments.refused is None else 0


def _say(line: str) -> None:
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
