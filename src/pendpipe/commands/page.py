"""Write a page about a recording: a sheet to print with its fit, and the rest below a fold.

The page is a single HTML file that needs no network. Several FILEs get a sheet each, and a table
that links to them.
"""

from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

from pendpipe import api
from pendpipe.analysis.fit.fixed import parse_fixed
from pendpipe.arguments import FILES, Arguments, command, name_of, tell
from pendpipe.commands.fit import OPTIONS, fitted, length_of, take_lengths
from pendpipe.commands.predict import PREDICTED
from pendpipe.errors import InputError, NotAnalysableError, refuse_if
from pendpipe.options import OUTPUT, given
from pendpipe.prediction import predict
from pendpipe.process import cores, in_order
from pendpipe.report.class_table import Fitted, class_page


class Sheet(NamedTuple):
    """A page, or why there is none."""

    fitted: Any
    page: str
    notes: tuple[str, ...] = ()


@command(
    FILES
    | {
        "--out": {
            "metavar": "HTML",
            "help": "the page (FILE.html), or the table of several; - is standard output",
        }
        | OUTPUT,
        "--no-diagnosis": {
            "action": "store_true",
            "help": "leave out the diagnosis",
        },
    }
    | PREDICTED
    | OPTIONS
)
def run(arguments: Arguments) -> int:
    """Fit, diagnose, and write the page, or a page each."""
    from pendpipe.files import check_output, is_stream, write_whole

    out = arguments.out
    take_lengths(arguments)
    refuse_if(
        out and not is_stream(out) and Path(out).suffix.lower() not in (".html", ".htm"),
        f"--out {out}",
        "its format is unknown",
        "end its name in .html",
    )
    if len(arguments.files) > 1:
        return _class(arguments)
    file = arguments.files[0]
    name = name_of(file)
    out = out or Path(name).with_suffix(".html")
    check_output(out)
    sheet = _sheet(arguments, file)
    for note in sheet.notes:
        tell(note)
    write_whole(out, sheet.page)
    tell(f"{out}: written")
    return 0


def _sheet(arguments: Arguments, file: str) -> Sheet:
    """Make the page of one recording."""
    from pendpipe.report.page import render_recording

    notes: list[str] = []
    arguments.file = file
    name = name_of(file)
    recording, result = fitted(arguments, notes.append)
    result, outcome = replace(result, name=name), None
    if not arguments.no_diagnosis and result.method != "amplitudes":
        try:
            outcome = api.diagnose(
                recording,
                restoring="sine" if arguments.gravity else arguments.restoring,
                length_m=length_of(arguments),
                baseline=arguments.baseline,
                fixed=parse_fixed(arguments.fixed, arguments.baseline),
                name=file,
            )
        except NotAnalysableError as problem:
            # What can't be diagnosed was fitted.
            notes.append(f"not diagnosed: {problem}")
    asked = given(arguments, predict) | {"points": arguments.points}
    wanted = any(each is not None for each in asked.values())
    page = render_recording(name, recording, result, outcome, wanted and predict(result, **asked))
    return Sheet(Fitted(file, replace(result, points=None, decay=None)), page, tuple(notes))


def sheet_of(arguments: Arguments, file: str) -> Sheet:
    """Make the page of one recording, or say why there is none."""
    try:
        return _sheet(arguments, file)
    except InputError as problem:
        return Sheet(Fitted(file, None, str(problem).removeprefix(f"{file}: ")), "")


def _class(arguments: Arguments) -> int:
    """Write a page a recording, and the table of all."""
    from pendpipe.files import check_output, distinct_names, make_folder, write_whole

    refuse_if(arguments.out == "-", "--out -", "there are several pages", "name a file")
    out = Path(arguments.out or "class.html")
    check_output(out)
    folder = out.with_name(f"{out.stem}_pages")
    names = [f"{name}.html" for name in distinct_names(arguments.files)]
    fits, links = [], []
    number = min(cores(), len(arguments.files))
    sheets = in_order(partial(sheet_of, arguments), arguments.files, number)
    for name, sheet in zip(names, sheets, strict=True):
        fits.append(sheet.fitted)
        links.append(f"{folder.name}/{name}" if sheet.page else None)
        for note in sheet.notes:
            tell(note)
        if sheet.page:
            make_folder(folder)
            write_whole(folder / name, sheet.page)
    write_whole(out, class_page(fits, links))
    made = sum(link is not None for link in links)
    tell(f"{out}: written, with {made} pages in {folder}")
    return 0 if made else 2
