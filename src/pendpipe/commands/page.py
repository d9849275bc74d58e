"""Write one page about one recording: its fit, its figures, and what physics is missing.

The page is a single HTML file that needs no network.
"""

from pathlib import Path
from typing import Final

from pendpipe.arguments import FILE, OUTPUT, Arguments, read_motion, shared, tell

ARGUMENTS: Final = (
    FILE
    | {
        "--out": {"metavar": "HTML", "help": "the page (FILE.html); - is standard output"} | OUTPUT,
        "--no-diagnosis": {"action": "store_true", "help": "the fit alone, in a second"},
    }
    | shared("--calibration")
)


def run(arguments: Arguments) -> None:
    """Fit, diagnose, and write the page."""
    from dataclasses import replace

    from pendpipe import api
    from pendpipe.files import check_output, write_whole
    from pendpipe.report.page import render_recording

    name = "standard input" if arguments.file == "-" else Path(arguments.file).name
    out = arguments.out or Path(name).with_suffix(".html")
    check_output(out)
    recording, provenance = read_motion(arguments)
    result = replace(api.fit(recording, name=arguments.file), provenance=provenance)
    statement = None
    if not arguments.no_diagnosis:
        from pendpipe.diagnosis.run import diagnose_recording

        statement = diagnose_recording(recording, place=arguments.file).diagnosis.statement
    page = render_recording(name, recording, result, statement)
    write_whole(out, page)
    tell(f"{out}: written")
