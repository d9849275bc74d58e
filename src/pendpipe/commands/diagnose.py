"""Find where model and recording differ, and what physics is missing.

Eq. 8 (or Eq. 3) is fitted to a free decay. Its residual is searched for every effect of the
catalogue, of the pendulum and of the measurement; those that chance does not explain are added to
the model. About twelve lines go to standard output; --out DIR also gets diagnosis.json and the
figures.

With --together the FILEs are recordings of one pendulum: they share the physics, and each has its
own start and noise (docs/several.md).
"""

from itertools import product
from math import inf
from pathlib import Path
from typing import Any

from pendpipe import api
from pendpipe.analysis.fit.fixed import parse_fixed
from pendpipe.analysis.turning_points import read_turning_points
from pendpipe.arguments import (
    FILES,
    Arguments,
    command,
    name_of,
    print_answer,
    print_json,
    read_motion,
    tell,
)
from pendpipe.diagnosis.result import FILE_NAME, Diagnosis, not_analysable
from pendpipe.errors import DamagedError, InputError, refuse_if
from pendpipe.figures import OF_A_DIAGNOSIS
from pendpipe.files import check_output, distinct_names, make_folder, write_json
from pendpipe.options import OUTPUTS, flags, flags_of, given
from pendpipe.process import keep_memory
from pendpipe.quantities import listed
from pendpipe.stages.refusal import is_stub, reason_of, within_results

FOUND = 3
"""Exit status where ``--fail-on`` asks for it."""


@command(
    FILES
    | {
        "--out": {
            "type": Path,
            "metavar": "DIR",
            "help": "write diagnosis.json and the figures there",
        }
        | OUTPUTS,
        "--fail-on": {
            "choices": ("missing-physics",),
            "help": f"end with status {FOUND} on that verdict",
        },
        "--figures": {
            "choices": ("all", "found", "none"),
            "default": "all",
            "help": "draw them always (all), where something is missing (found), or never (none)",
        },
        "--no-figures": {
            "dest": "figures",
            "action": "store_const",
            "const": "none",
            "help": "as --figures none",
        },
    }
    | flags_of(api.diagnose)
    | flags("--verbose", "-v", "--json", "--turning-points", "--record", "--refused")
    # With several FILEs one for all, or one for each.
    | flags("--calibration", nargs="+", default=[])
)
def run(arguments: Arguments) -> int:
    """Diagnose, write the result, and print the answer."""
    keep_memory()
    if arguments.out is not None:
        for path in (arguments.out / FILE_NAME, *_figures_in(arguments.out)):
            check_output(path)
    refuse_if(
        arguments.record is not None and arguments.out is None,
        "--record",
        "a campaign's record needs a folder",
        "add --out DIR",
    )
    if len(arguments.files) > 1:
        return _diagnose_several(arguments)
    arguments.file = arguments.files[0]
    arguments.calibration = next(iter(arguments.calibration), None)
    fixed = parse_fixed(arguments.fixed, arguments.baseline)
    if arguments.out is not None and Path(arguments.file).is_file():
        # Before the work: a long diagnosis must not end without a folder to write to.
        make_folder(arguments.out)
    return _diagnose(arguments, fixed)


def _diagnose(arguments: Arguments, fixed: dict[str, float]) -> int:
    """Diagnose, unless a stage that this one builds on has refused the record.

    The fit runs beside the diagnosis, so its refusal does not count. Nor does a diagnosis refuse
    a record: what can't be diagnosed may still have been fitted.
    """
    earlier = arguments.refused and reason_of(arguments.refused, before="fit")
    if earlier:
        return _not_analysable(arguments, earlier, {})
    provenance: dict[str, Any] = {"seed": arguments.seed, "fixed": list(arguments.fixed)}
    provenance["restoring"] = arguments.restoring
    try:
        recording, made = read_motion(arguments, quiet=not arguments.verbose)
        provenance = made | provenance | {"level": arguments.level}
        outcome = _outcome(
            arguments, recording, fixed=fixed, provenance=provenance, name=arguments.file
        )
    except InputError as error:
        if isinstance(error, DamagedError) or not Path(arguments.file).is_file():
            raise
        return _not_analysable(arguments, within_results(error, arguments.refused), provenance)
    return _report(arguments, outcome, name_of(arguments.file))


def _report(arguments: Arguments, outcome: Diagnosis, name: str) -> int:
    """Write the result, and print a dozen lines; with ``--verbose`` all that was found."""
    content = outcome.to_dict() if arguments.out is None else _write(arguments, outcome)
    text = f"{name}: {content['statement']}"
    if arguments.verbose:
        for warning in content["warnings"]:
            tell(f"{name}: {warning}")
        excluded = "; ".join(f"{each['id']} {each['p_value']:.2g}" for each in content["excluded"])
        looked = [f"Looked for, with p-values: {excluded}."] if excluded else []
        text = "\n".join(
            [*outcome.summary.answer.lines(name, inf), "", content["details"], *looked]
        )
    print_answer(arguments, content, text)
    return FOUND if arguments.fail_on == content["verdict"] else 0


def _diagnose_several(arguments: Arguments) -> int:
    """Diagnose recordings of one pendulum together."""
    for option, value in (
        ("--fix", arguments.fixed),
        ("--turning-points", arguments.turning_points),
    ):
        refuse_if(
            value, option, "this option is for one recording", "give one FILE, or leave it out"
        )
    refuse_if(
        arguments.record is None and not arguments.together,
        "diagnose",
        f"{len(arguments.files)} files are given",
        "add --together if they are recordings of one pendulum; else diagnose them one by one",
    )
    recordings, made, constants = {}, [], arguments.calibration
    refuse_if(
        len(constants) not in (0, 1, len(arguments.files)),
        "--calibration",
        f"{len(constants)} are given",
        "give one, or one for each",
    )
    names = distinct_names(arguments.files)
    for number, (file, name) in enumerate(zip(arguments.files, names, strict=True)):
        arguments.file = file
        arguments.calibration = constants[number % len(constants)] if constants else None
        read = filter(None, (file, arguments.calibration))
        if arguments.record is not None and any(map(is_stub, read)):
            tell(f"{file}: refused, and left out")
            continue
        recordings[name], provenance = read_motion(arguments)
        made.append({"name": name, **provenance})
    if len(recordings) < 2:
        return _not_analysable(arguments, "fewer than two recordings can be used", {})
    joint = _outcome(
        arguments,
        recordings,
        together=True,
        provenance={"inputs": made, "seed": arguments.seed, "level": arguments.level},
    )
    return _report(arguments, joint, f"{listed(list(recordings))} together")


def _outcome(arguments: Arguments, recording: Any, **more: Any) -> Diagnosis:
    """Diagnose a recording, or several together."""
    points = arguments.turning_points and read_turning_points(arguments.turning_points)
    options = given(arguments, api.diagnose) | {"fixed": None} | more
    return api.diagnose(recording, points=points, progress=_print_progress, **options)


def _write(arguments: Arguments, outcome: Diagnosis) -> dict[str, Any]:
    """Draw the figures that are wanted, then write the result that names them."""
    asked = {"all": True, "found": outcome.verdict == "missing-physics", "none": False}
    wanted = asked[arguments.figures] and not outcome.alone
    _remove_figures(arguments.out)
    if wanted:
        _print_progress("drawing")
    return outcome.save(arguments.out, figures=wanted)


def _remove_figures(folder: Path) -> None:
    """Remove the figures of an earlier diagnosis."""
    for path in _figures_in(folder):
        path.unlink(missing_ok=True)


def _figures_in(folder: Path) -> list[Path]:
    """The places of all figures that a diagnosis may have."""
    return [folder / f"{name}{form}" for name, form in product(OF_A_DIAGNOSIS, (".svg", ".png"))]


def _not_analysable(arguments: Arguments, reason: str, provenance: dict[str, Any]) -> int:
    """Write why there is no diagnosis; in a campaign the other records go on."""
    content = not_analysable(arguments.baseline, reason, provenance)
    if arguments.out is not None:
        _remove_figures(arguments.out)
        write_json(arguments.out / FILE_NAME, content)
    if arguments.json:
        print_json(content)
    tell(f"pendpipe: {reason}")
    return 2 if arguments.refused is None else 0


def _print_progress(line: str) -> None:
    """Print progress to standard error."""
    tell(f"  {line}")
