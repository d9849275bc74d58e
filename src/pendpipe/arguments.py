"""What the commands share: their arguments declared and checked, what is read and printed."""

from __future__ import annotations

import argparse
import hashlib
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from inspect import getdoc
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, NamedTuple, TypeAlias, TypeVar

from pendpipe.errors import InputError
from pendpipe.files import check_output, is_stream, json_text, read_json, sealed, writing
from pendpipe.options import ALTERNATIVES, INPUT, Flags, flags_of, given
from pendpipe.reading import read
from pendpipe.version import __version__

if TYPE_CHECKING:
    from pendpipe.configuration.load import Campaign
    from pendpipe.recording import Recording

_RECORDING: Final = {
    "metavar": "FILE",
    "help": "a recording in any supported format; - is standard input",
}
FILE: Final[Flags] = {"file": _RECORDING | INPUT} | flags_of(read)
FILES: Final[Flags] = {"files": _RECORDING | {"nargs": "+"} | INPUT} | flags_of(read)
"""The argument of a command that reads a recording, or several, with the overrides."""
Arguments: TypeAlias = argparse.Namespace
"""What one call gave for a command's arguments."""


_FORCE: Final = {
    "action": "store_true",
    "help": "replace files that pendpipe did not make (never an input or a raw file)",
}


class Command(NamedTuple):
    """A command: what ``--help`` says of it, its arguments, and what does it."""

    description: str
    arguments: Flags
    run: Callable[[Arguments], int | None]
    add_arguments: Callable[[argparse.ArgumentParser], None] | None = None
    """Of a command that another package adds: it declares its arguments by itself."""

    def declare(self, parser: argparse.ArgumentParser) -> None:
        """Declare its arguments, each by its name and the options of argparse.

        Two options are our own: the `heading` that it stands under in the help (of those under
        `ALTERNATIVES` a call gives one at most), and the `file` that it names (`INPUT`, `OUTPUT`).
        """
        if self.add_arguments:
            self.add_arguments(parser)
        arguments = self.arguments
        groups: dict[str | None, argparse._ActionsContainer] = {None: parser}
        if any(options.get("file", "input") != "input" for options in arguments.values()):
            arguments = arguments | {"--force": _FORCE}
        for name, options in arguments.items():
            heading = options.get("heading")
            if heading == ALTERNATIVES and heading not in groups:
                groups[heading] = parser.add_mutually_exclusive_group()
            elif heading not in groups:
                groups[heading] = parser.add_argument_group(heading)
            own = {key: value for key, value in options.items() if key not in ("heading", "file")}
            groups[heading].add_argument(name, **own)


COMMANDS: Final[dict[Any, Command]] = {}
"""By the functions that run them, once their modules are imported."""
_Run = TypeVar("_Run", bound=Callable[[Arguments], int | None])


def command(arguments: Flags) -> Callable[[_Run], _Run]:
    """Make a function the command that takes these arguments.

    Its docstring is what ``--help`` says; that of its module, where it is called ``run``.
    """

    def enter(run: _Run) -> _Run:
        text = sys.modules[run.__module__].__doc__ if run.__name__ == "run" else getdoc(run)
        COMMANDS[run] = Command(text or "", arguments, run)
        return run

    return enter


@contextmanager
def checked_outputs(arguments: Arguments, declared: Flags) -> Iterator[None]:
    """Refuse outputs that are not to be replaced, before any work; guard those that are written.

    Raises
    ------
    InputError
        See `pendpipe.files.check_output`.
    """
    named: dict[str, list[str | Path]] = {"input": [], "output": [], "outputs": []}
    for name, options in declared.items():
        value = getattr(arguments, options.get("dest", name.lstrip("-").replace("-", "_")))
        if "file" in options and value:
            named[options["file"]] += value if isinstance(value, list) else [value]
    with writing(inputs=named["input"], force=getattr(arguments, "force", False)):
        for output in named["output"]:
            check_output(output)
        yield


def announce(
    arguments: Arguments,
    recording: Recording,
    *,
    quiet: bool = False,
    say: Callable[[str], None] | None = None,
) -> None:
    """Print what was guessed, the weak guesses first, to stderr; these alone where `quiet`."""
    weak = [f"a guess: {guess}" for guess in recording.weak_guesses]
    for line in (*weak, *(() if quiet else recording.notes)):
        (say or tell)(f"{arguments.file}: {line}")


def read_motion(
    arguments: Arguments, *, quiet: bool = False, say: Callable[[str], None] | None = None
) -> tuple[Recording, dict[str, Any]]:
    """Read FILE, apply the sensor constant, and say what was guessed; see `announce`.

    Returns
    -------
    recording
        In rad, or in its own unit where no constant makes it an angle.
    provenance
        ``input_sha256`` (of what came through standard input too), ``version``,
        ``volts_per_radian`` (None where none was used).
    """
    from pendpipe.analysis.readings import motion_of
    from pendpipe.formats.reading import file_bytes

    recording = read(arguments.file, **given(arguments, read))
    constant = arguments.volts_per_radian or _calibrated(arguments.calibration)
    was_volts = recording.quantity == "volts"
    recording = motion_of(recording, constant, arguments.file)
    announce(arguments, recording, quiet=quiet, say=say)
    return recording, {
        "input_sha256": hashlib.sha256(file_bytes(Path(arguments.file))).hexdigest(),
        "version": __version__,
        "volts_per_radian": recording.number("volts_per_radian") if was_volts else None,
    }


def _calibrated(path: Path | None) -> float | None:
    """The sensor constant in a result of ``pendpipe calibrate``; None where it has none."""
    if path is None:
        return None
    try:
        constant = read_json(path)["volts_per_radian"]
    except (KeyError, TypeError):
        raise InputError(path, "this is not a calibration", "run pendpipe calibrate") from None
    return None if constant is None else float(constant["value"])


def load(path: Path) -> Campaign:
    """Read and check a campaign."""
    from pendpipe.configuration.load import load_campaign, read_configuration

    return load_campaign(read_configuration(path), path)


def name_of(file: str) -> str:
    """Name a recording in an answer: its file, without the folders."""
    return "standard input" if file == "-" else Path(file).name


def tell(line: str) -> None:
    """Print a line to standard error; results go to standard output."""
    print(line, file=sys.stderr)


def tell_written(out: str | Path, line: str) -> None:
    """Say what was written: beside the data, where these go to standard output."""
    print(f"{out}: {line}", file=sys.stderr if is_stream(out) else sys.stdout)


def print_answer(arguments: Arguments, content: Any, text: str) -> None:
    """Print a command's answer: in words, or with ``--json`` as one object."""
    if arguments.json:
        print_json(content)
    else:
        print(text)


def print_json(content: Any) -> None:
    """Print one JSON object for programs; what is not finite is null."""
    print(sealed(json_text(content) + "\n"), end="")
