"""The arguments that several commands share, and what is read and printed by them."""

from __future__ import annotations

import argparse
import hashlib
import math
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import fields
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, TypeAlias

from pendpipe.errors import InputError
from pendpipe.files import check_output, is_stream, json_text, read_json, writing
from pendpipe.version import __version__

if TYPE_CHECKING:
    from pendpipe.configuration.load import Campaign
    from pendpipe.estimate import Estimate
    from pendpipe.formats import ReadOptions
    from pendpipe.recording import Recording

Flags = dict[str, dict[str, Any]]
"""Arguments by their names, each with its options; see `declare`."""
Arguments: TypeAlias = argparse.Namespace
"""What one call gave for them."""
ALTERNATIVES: Final = "alternatives"
INPUT: Final[dict[str, Any]] = {"file": "input"}
OUTPUT: Final[dict[str, Any]] = {"file": "output"}
OUTPUTS: Final[dict[str, Any]] = {"file": "outputs"}
"""What an argument names: a file that is read; one that is written, and looked at before any work;
a folder, or a file, that the command looks at itself. The last two give a command ``--force``."""
_FORCE: Final = {
    "action": "store_true",
    "help": "replace files that pendpipe did not make (never an input, nor a raw file)",
}


def under(heading: str, arguments: Flags) -> Flags:
    """Put arguments under a heading of the help."""
    return {name: options | {"heading": heading} for name, options in arguments.items()}


_OVERRIDES: Final[Flags] = {
    "--channel": {"metavar": "CHANNEL", "help": "number (from 1) or name, see inspect"},
    "--column": {
        "metavar": "COLUMN",
        "help": "number (from 1) or name; X,Y for a position; TIME:COLUMN",
    },
    "--unit": {"metavar": "UNIT", "help": "rad, deg, V, mm, counts, ...; or ms:deg"},
    "--sample-rate": {"metavar": "HZ", "type": float, "help": "samples a second"},
    "--decimal": {"metavar": "SIGN", "help": "decimal sign, '.' or ','"},
    "--delimiter": {"metavar": "SIGN", "help": "sign between cells, or tab, space"},
    "--volts-per-radian": {
        "metavar": "V",
        "type": float,
        "help": "the sensor's constant, V/rad",
    },
    "--start": {
        "metavar": "S",
        "type": float,
        "dest": "start_s",
        "help": "first time to read, seconds",
    },
    "--stop": {
        "metavar": "S",
        "type": float,
        "dest": "stop_s",
        "help": "last time to read, seconds",
    },
}
"""Overrides of a reader's guesses, one a field of `pendpipe.formats.ReadOptions`."""
_READING: Final = under("where a guess is wrong", _OVERRIDES)
_A_RECORDING: Final = "a recording in any supported format; - is standard input"
FILE: Final[Flags] = {"file": {"metavar": "FILE", "help": _A_RECORDING} | INPUT} | _READING
FILES: Final[Flags] = {
    "files": {"metavar": "FILE", "nargs": "+", "help": _A_RECORDING} | INPUT
} | _READING
"""The argument of a command that reads a recording, or several, with the overrides."""

SHARED: Final[Flags] = {
    "--json": {"action": "store_true", "help": "print one JSON object"},
    "--calibration": {
        "type": Path,
        "metavar": "JSON",
        "help": "the sensor's, from pendpipe calibrate",
    }
    | INPUT,
    "--turning-points": {
        "type": Path,
        "metavar": "CSV",
        "help": "of an earlier stage, with their cuts",
    }
    | INPUT,
    "--baseline": {
        "choices": ("eq8", "viscous"),
        "default": "eq8",
        "help": "eq8: Eq. 8 (default); viscous: Eq. 3, a = c = 0",
    },
    "--fix": {
        "action": "append",
        "default": [],
        "metavar": "NAME=VALUE",
        "help": "hold a parameter, as for a prediction (a, b, c, frequency, amplitude, offset,"
        " quality_factor_hysteretic, quality_factor_viscous); repeatable",
    },
    "--campaign": {"type": Path, "metavar": "CONFIG", "help": "a campaign's configuration"} | INPUT,
    "--comparison": {
        "type": Path,
        "metavar": "FILE",
        "help": "comparison.json, from pendpipe compare",
    }
    | INPUT,
    "--record": {"metavar": "NAME", "help": "the campaign's name for this record"},
    "--refused": {
        "type": Path,
        "metavar": "FILE",
        "help": "write here why the record can't be used, and end with 0, instead of ending with 2",
    }
    | OUTPUT,
}
"""Arguments of more than one command."""


def shared(*names: str, **more: Any) -> Flags:
    """Look up arguments that other commands have as well."""
    return {name: SHARED[name] | more for name in names}


def number_within(low: float, high: float = math.inf) -> Callable[[str], float]:
    """Make a type of argparse: a number between two limits, themselves left out."""

    def read(text: str) -> float:
        try:
            value = float(text)
        except ValueError:
            raise argparse.ArgumentTypeError(f"'{text}' is no number") from None
        if not low < value < high:
            limits = f"lie between {low:g} and {high:g}" if high < math.inf else "be positive"
            raise argparse.ArgumentTypeError(f"it must {limits} (it is {text})")
        return value

    return read


def measured_number(text: str) -> Estimate:
    """Read a number with its error, as a type of argparse: 0.600(1)."""
    from pendpipe.estimate import measured

    try:
        return measured(text)
    except ValueError as problem:
        raise argparse.ArgumentTypeError(str(problem)) from None


def natural(text: str) -> int:
    """Be a type of argparse: a whole number that is not negative."""
    try:
        value = int(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"'{text:.40}' is no whole number") from None
    if value < 0:
        raise argparse.ArgumentTypeError(f"it must not be negative (it is {text:.40})")
    return value


def declare(parser: argparse.ArgumentParser, arguments: Flags) -> None:
    """Declare a command's arguments, each by its name and the options of argparse.

    Two options are our own: the `heading` that it stands under in the help (of those under
    `ALTERNATIVES` a call gives one at most), and the `file` that it names (`INPUT`, `OUTPUT`).
    """
    groups: dict[str | None, argparse._ActionsContainer] = {None: parser}
    if any(options.get("file", "input") != "input" for options in arguments.values()):
        arguments = arguments | {"--force": _FORCE}
    for name, options in arguments.items():
        heading = options.get("heading")
        if heading == ALTERNATIVES and heading not in groups:
            groups[heading] = parser.add_mutually_exclusive_group()
        elif heading not in groups:
            groups[heading] = parser.add_argument_group(heading)
        groups[heading].add_argument(
            name,
            **{key: value for key, value in options.items() if key not in ("heading", "file")},
        )


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


def read_options(arguments: Arguments) -> ReadOptions:
    """Turn the parsed arguments into the readers' options."""
    from pendpipe.formats import ReadOptions

    return ReadOptions(**{each.name: getattr(arguments, each.name) for each in fields(ReadOptions)})


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
    from pendpipe.formats import read
    from pendpipe.formats.reading import file_bytes

    recording = read(arguments.file, read_options(arguments))
    constant = arguments.volts_per_radian or _calibrated(arguments.calibration)
    was_volts = recording.quantity == "volts"
    recording = recording.as_motion(constant, arguments.file)
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
        raise InputError(path, "this is no calibration", "run pendpipe calibrate") from None
    return None if constant is None else float(constant["value"])


def load(path: Path) -> Campaign:
    """Read and check a campaign."""
    from pendpipe.configuration.load import load_campaign, read_configuration

    return load_campaign(read_configuration(path), path)


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
    print(json_text(content))
