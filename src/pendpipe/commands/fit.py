"""Fit a, b, c, Q and the period of free decays.

One FILE prints its fit; several print a table, one line per recording. --method waveform fits Eq. 8
to all readings, --method turning-points fits Eq. 14 to the turning points (the paper's way), and
auto, the default, takes the turning points, or the larger amplitudes alone, only where the
waveform's law contradicts the decay. The restoring torque is sin x unless the recording
rejects it.

The light compares period and Q with those that the turning points show without a law. green: right
to 5 %, and the misfit moves them by less than their errors. amber: it names what can't be quoted.
red: the law contradicts the decay; then Q and the period of the turning points are printed instead,
and the exit status is 2 unless --accept is given. Of several FILEs it is 2 if none could be fitted.
"""

import csv
from argparse import ArgumentTypeError
from collections.abc import Callable
from dataclasses import replace
from math import inf
from pathlib import Path
from typing import Any, Final

from pendpipe import api
from pendpipe.analysis.fit.fixed import parse_fixed
from pendpipe.analysis.fit.printed import answer_of
from pendpipe.analysis.fit.result import FitResult
from pendpipe.analysis.turning_points import (
    TurningPoints,
    is_turning_points,
    read_turning_points,
)
from pendpipe.answer import WIDTH
from pendpipe.arguments import FILES, Arguments, command, name_of, print_answer, read_motion, tell
from pendpipe.errors import InputError, nearest, refuse_if
from pendpipe.estimate import over
from pendpipe.files import is_stream, read_json, read_text, write_json
from pendpipe.options import (
    ALTERNATIVES,
    INPUT,
    NATURAL,
    OUTPUT,
    flags,
    flags_of,
    given,
    measured_number,
)
from pendpipe.recording import Recording
from pendpipe.report.class_table import Fitted, form_of, printed, together, write_fits

OPTIONS: Final = (
    flags_of(api.fit)
    | {
        "--frequency": {
            "type": measured_number,
            "metavar": "HZ",
            "help": "frequency of small swings, Hz, instead of the period",
            "heading": ALTERNATIVES,
        },
        "--lengths": {
            "type": Path,
            "metavar": "CSV",
            "help": "with several FILEs: a table of file and length in m, a row each",
        }
        | INPUT,
    }
    | flags("--calibration")
)
"""How a recording is fitted, by whatever command."""


@command(
    FILES
    | {
        "--out": {
            "metavar": "FILE",
            "help": "the result (.json), or the table (.csv, .xlsx, .html, .tex); - is standard"
            " output",
        }
        | OUTPUT,
        "--figure": {
            "type": Path,
            "metavar": "FILE",
            "help": "draw decay, residual, and Q against amplitude (.svg, .png, .pdf)",
        }
        | OUTPUT,
        "--accept": {
            "action": "store_true",
            "help": "print a law that contradicts the decay, status 0",
        },
        "--wide": {"action": "store_true", "help": "with several FILEs: columns for a, b and c"},
        "--mean": {
            "action": "store_true",
            "help": "with several FILEs: means of T0 and Q even if they differ by more than errors",
        },
    }
    | OPTIONS
    | flags("--verbose", "-v", "--json", "--turning-points")
    | flags("--record", "--refused")
    | {
        "--seed": {
            "type": NATURAL,
            "metavar": "N",
            "help": "stored with the result; a fit draws no random numbers",
        }
    }
)
def run(arguments: Arguments) -> int:
    """Fit and print; write what is asked for."""
    take_lengths(arguments)
    if arguments.out and arguments.record is None:
        form_of(arguments.out)
    if len(arguments.files) > 1:
        return _table(arguments)
    arguments.file = arguments.files[0]
    if arguments.record is not None or arguments.refused is not None:
        _stage(arguments)
        return 0
    figure = figure_of(arguments)
    result = _stored(arguments)
    if result.light == "red":
        why = result.light_reason if arguments.json else "no law is printed"
        tell(f"pendpipe: {arguments.file}: {why} (--accept prints it)")
    if arguments.out:
        write_fits(arguments.out, [Fitted(arguments.file, result)], result.to_dict())
    if figure:
        from pendpipe.figures.style import save

        save(result.plot(), figure.with_suffix(""), forms=[figure.suffix[1:]])
    if not (arguments.out and is_stream(arguments.out)):
        print_answer(arguments, result.to_dict(), _text(arguments, result))
    return _status(arguments, result)


def figure_of(arguments: Arguments) -> Path | None:
    """The figure that is asked for; a form that nobody can draw is refused before any work."""
    figure: Path | None = arguments.figure
    refuse_if(
        figure and figure.suffix not in (".svg", ".png", ".pdf"),
        f"--figure {figure}",
        "its format is unknown",
        "end its name in .svg, .png or .pdf",
    )
    return figure


def _stage(arguments: Arguments) -> None:
    """Fit one record of a campaign; a red light stands in the result and stops nothing."""
    from pendpipe.stages.refusal import run_stage

    refuse_if(not arguments.out, "--out", "a record's fit needs a file", "give --out fit.json")
    run_stage(
        "fit",
        arguments.record,
        lambda: write_json(arguments.out, _stored(arguments).to_dict()),
        outputs=[Path(arguments.out)],
        refused=arguments.refused,
        inputs=[Path(arguments.file), arguments.calibration, arguments.turning_points],
    )


def take_lengths(arguments: Arguments) -> None:
    """Read the table of lengths, in place of its path; a row is found by the file's name."""
    path, arguments.lengths = arguments.lengths, {}
    if path is None:
        return
    remedy = "give metres, as 0.600 or 0.600(1)"
    text = read_text(path, "give a table of file and length in m")
    # As many semicolons as commas: the commas are decimal.
    delimiter = max(";\t,", key=text.count)
    known = [name_of(file) for file in arguments.files]
    for number, row in enumerate(csv.reader(text.splitlines(), delimiter=delimiter), 1):
        name, size = [cell.strip() for cell in (*row, "", "")][:2]
        found = [file for file in arguments.files if name in (file, name_of(file))]
        try:
            length = measured_number(size if delimiter == "," else size.replace(",", "."))
        except ArgumentTypeError as problem:
            # Of a head, or of an empty row, none is expected.
            if not name or (number == 1 and not found):
                continue
            raise InputError(f"{path}, line {number}", str(problem), remedy) from None
        missing = f"no FILE is called '{name}'"
        refuse_if(
            not found, f"{path}, line {number}", missing, nearest(name, known, "check the name")
        )
        arguments.lengths |= dict.fromkeys(found, length)
    refuse_if(not arguments.lengths, path, "it has no length", remedy)


def length_of(arguments: Arguments) -> Any:
    """The length that is given for FILE, or for all."""
    return (arguments.lengths or {}).get(arguments.file, arguments.length_m)


def fitted(
    arguments: Arguments,
    say: Callable[[str], None] = tell,
    *,
    quiet: bool = True,
    points: TurningPoints | None = None,
) -> tuple[Recording, FitResult]:
    """Read FILE, and fit it by `OPTIONS`."""
    fixed = parse_fixed(arguments.fixed, arguments.baseline)
    recording, provenance = read_motion(arguments, quiet=quiet, say=say)
    period, frequency = arguments.period, arguments.frequency
    options = given(arguments, api.fit) | {
        "fixed": fixed,
        "length_m": length_of(arguments),
        "scale_percent": _scale_percent(arguments),
        "name": arguments.file,
        "period": over(1.0, frequency, "s") if frequency else period,
    }
    source = arguments.file if is_turning_points(arguments.file) else recording
    result = api.fit(source, points=points, **options)
    return recording, replace(result, provenance={**provenance, "fixed": list(arguments.fixed)})


def _stored(arguments: Arguments, say: Callable[[str], None] = tell) -> FitResult:
    """Fit FILE as this command does, and say what its user should know."""
    points = arguments.turning_points and read_turning_points(arguments.turning_points)
    _, result = fitted(arguments, say, quiet=not arguments.verbose, points=points)
    if arguments.verbose or arguments.record is not None:
        for warning in result.warnings:
            say(f"{arguments.file}: {warning}")
    own = {"seed": arguments.seed}
    return replace(result, provenance={**result.provenance, **own})


def _scale_percent(arguments: Arguments) -> float | None:
    """What the scale may be off by; a campaign has the calibration's error as a common one."""
    given: float | None = arguments.scale_percent
    of_campaign = getattr(arguments, "record", None) is not None
    if given is not None or arguments.calibration is None or of_campaign:
        return given
    constant = read_json(arguments.calibration).get("volts_per_radian")
    return None if constant is None else 100.0 * float(constant["sd"]) / float(constant["value"])


def _text(arguments: Arguments, result: FitResult) -> str:
    """The answer in words."""
    answer = answer_of(result, law=arguments.accept)
    width = inf if arguments.verbose else WIDTH
    return "\n".join(answer.lines(name_of(arguments.file), width))


def _status(arguments: Arguments, result: FitResult) -> int:
    return 2 if result.light == "red" and not arguments.accept else 0


def _table(arguments: Arguments) -> int:
    """Fit several recordings; what can't be fitted gets its reason, and the others go on."""
    for option in ("figure", "turning_points", "record"):
        refuse_if(
            getattr(arguments, option),
            f"--{option.replace('_', '-')}",
            "this option is for one FILE",
            "fit that file alone",
        )
    fits, found, notes = [], [], list[str]()
    for file in arguments.files:
        arguments.file = file
        try:
            result = _stored(arguments, notes.append)
        except InputError as problem:
            found.append({"file": file, "error": str(problem)})
            fits.append(Fitted(file, None, str(problem).removeprefix(f"{file}: ")))
        else:
            found.append({"file": file, **result.to_dict()})
            fits.append(Fitted(file, result))
    content = {
        "schema_version": 1,
        "fits": found,
        "together": together(fits, mean=arguments.mean),
    }
    if arguments.out:
        write_fits(arguments.out, fits, content)
    if not (arguments.out and is_stream(arguments.out)):
        print_answer(arguments, content, printed(fits, wide=arguments.wide, mean=arguments.mean))
    for each in fits:
        notes += [f"pendpipe: {each.file}: {each.refusal}"] if each.refusal else []
    for note in notes:
        tell(note)
    usable = [each.fit for each in fits if each.fit and not _status(arguments, each.fit)]
    return 0 if usable else 2
