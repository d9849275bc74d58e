"""The command line: it picks a command and turns user errors into one line and a status.

A command is a module of `pendpipe.commands`, or of `pendpipe.stages` where it is a stage of a
campaign and no more, with the function ``run(arguments)``, which returns the exit status where it
is not 0; or, where it takes a few lines, a function of `pendpipe.commands.small`. What stands above
it, `pendpipe.arguments.command`, declares its arguments.
Only the module of the command that was asked for is imported, since a job's cost is its imports.
Other packages add commands by entry points of the group ``pendpipe.commands``; one that has
commands of its own declares them by a function ``add_arguments(parser)`` instead.
"""

import argparse
import difflib
import importlib
import io
import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final, NoReturn

from pendpipe.errors import OF_DISKS, InputError
from pendpipe.process import leave_the_folder_out, one_thread
from pendpipe.version import __version__

COMMANDS: Final = {
    "inspect": "describe a recording: format, channels, rate, gaps, clipping",
    "convert": "convert a recording to the plain CSV form or to WinDaq (.wdh)",
    "acquire": "record from a DATAQ instrument, real or simulated",
    "calibrate": "find V/rad from volts against angles, with a linearity test",
    "simulate": "simulate the recording of a described pendulum and measurement chain",
    "turning-points": "find the turning points of a recording",
    "fit": "find period, Q and the losses a, b, c of free decays",
    "diagnose": "find which physics is missing: located, named, modelled",
    "predict": "predict another decay, and the driven response, with bands",
    "page": "write an HTML page about recordings",
    "open": "open a page on this machine: drop recordings, see their sheets and table",
    "init": "begin a campaign of your own recordings in a folder",
    "campaign": "run a campaign, every recording of a table, by Snakemake",
    "published": "diagnose a table of published numbers as a campaign",
    "decay": "draw the decay of a campaign's record",
    "figures": "draw figures 3 to 10 of a campaign",
    "report": "write one self-contained page about a campaign",
    "doctor": "find damaged results of a campaign, and say what is safe to do",
    "config": "check a configuration, or print its schema",
    "effects": "print the catalogue of effects",
    "completion": "print the completion script of a shell",
    "stage": "run one stage of a chunk of a campaign's records, as a job of the workflow",
}
"""The commands with the line that ``--help`` shows for each."""
SMALL: Final = frozenset(
    ("inspect", "convert", "simulate", "init", "campaign", "config", "effects")
)
"""Those in one file, `pendpipe.commands.small`."""
STAGES: Final = {
    "separate": "separate hysteretic from viscous loss in a campaign",
    "compare": "compare a campaign's losses with Eq. 16",
    "records": "write one table of a campaign's records, as Parquet and CSV",
    "unpack": "write records' files out of an archive of a campaign",
    "diagnose-campaign": "diagnose all records of a campaign together",
}
"""Stages of a campaign that are commands themselves."""

FIRST_STEPS: Final = """\
pendpipe analyses free decays of pendulums. With a recording in FILE:

  pendpipe inspect FILE                       what the file holds
  pendpipe FILE                               a, b, c, Q and the period: pendpipe fit FILE
  pendpipe diagnose FILE --out diagnosis      what physics is missing from the fit

Without a recording: pendpipe acquire --device simulated:di2108 --duration 20 --out try.csv
All commands: pendpipe --help"""

IN_A_CLONE: Final = {"challenge": "pip install --editable ./challenge"}
"""Commands of packages beside the library, and what installs each in a clone."""


class _Parser(argparse.ArgumentParser):
    """Reports a usage error in one line, like every other user error."""

    def error(self, message: str) -> NoReturn:
        """End the program with status 2."""
        line = " ".join(message.split())
        self.exit(2, f"{self.prog}: {line}; see {self.prog} --help\n")


def _added() -> dict[str, Any]:
    """The entry points of the commands that other packages add."""
    from importlib.metadata import entry_points

    return {found.name: found for found in entry_points(group="pendpipe.commands")}


def _descriptions() -> dict[str, str]:
    """All commands with a line about each; an added one's is the first of its module."""
    added = {name: (found.load().__doc__ or "").splitlines() for name, found in _added().items()}
    return (
        COMMANDS | STAGES | {name: lines[0].rstrip(".") for name, lines in added.items() if lines}
    )


def command_of(name: str) -> Any:
    """Find a command; None where there is none of the name."""
    from pendpipe import arguments

    place = name.replace("-", "_")
    if name in SMALL:
        small = importlib.import_module("pendpipe.commands.small")
        return arguments.COMMANDS[getattr(small, place)]
    if name in COMMANDS:
        return arguments.COMMANDS[importlib.import_module(f"pendpipe.commands.{place}").run]
    if name in STAGES:
        return arguments.COMMANDS[importlib.import_module(f"pendpipe.stages.{place}").run]
    if (found := _added().get(name)) is not None:
        module = found.load()
        return arguments.Command(module.__doc__ or "", {}, module.run, module.add_arguments)
    if name in IN_A_CLONE:
        raise InputError(
            name, "this command is not installed", f"in a clone of pendpipe: {IN_A_CLONE[name]}"
        )
    return None


def parse(argv: Sequence[str]) -> argparse.Namespace:
    """Parse the words of one call; argparse ends the program with 2 on bad usage.

    ``help fit`` is ``fit --help``, and a file in the place of a command is one to fit: what has a
    suffix is no command, but may be the misspelt name of a file.
    """
    if argv[:1] == ["help"]:
        argv = [*argv[1:], "--help"]
    command = command_of(argv[0]) if argv and not argv[0].startswith("-") else None
    named = argv[0] if argv and command is None else ""
    if named and (Path(named).is_file() or (Path(named).suffix and named[0] != "-")):
        argv = ["fit", *argv]
        command = command_of("fit")
    if command is not None:
        parser = _Parser(
            prog=f"pendpipe {argv[0]}",
            description=command.description,
            formatter_class=argparse.RawDescriptionHelpFormatter,
        )
        command.declare(parser)
        arguments = parser.parse_args(argv[1:])
        arguments.run, arguments.declared = command.run, command.arguments
        return arguments
    # Looking for added commands takes longer than all the rest.
    descriptions = COMMANDS if list(argv) == ["--version"] else _descriptions()
    if argv and not argv[0].startswith("-"):
        close = difflib.get_close_matches(argv[0], descriptions, n=1)
        hint = f"did you mean 'pendpipe {close[0]}'?" if close else "pendpipe --help lists them"
        raise InputError(argv[0], "there is no such command", hint)
    width = max(map(len, descriptions)) + 2
    listed = "\n".join(f"  {name:<{width}}{text}" for name, text in descriptions.items())
    parser = _Parser(
        prog="pendpipe",
        description=(__import__("pendpipe").__doc__ or "").splitlines()[0],
        epilog="commands (each has its own --help):\n" + listed,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action="version", version=f"pendpipe {__version__}")
    parser.add_argument("command", nargs="?", metavar="COMMAND", help="see below")
    arguments = parser.parse_args(argv)
    # Whoever gave no command sees where to begin.
    arguments.run, arguments.declared = lambda _: print(FIRST_STEPS), {}
    return arguments


def _run(arguments: argparse.Namespace) -> int:
    """Run the command, its outputs guarded."""
    if not arguments.declared:
        return int(arguments.run(arguments) or 0)
    from pendpipe.arguments import checked_outputs

    with checked_outputs(arguments, arguments.declared):
        return int(arguments.run(arguments) or 0)


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command.

    Returns
    -------
    int
        0 done; 1 a fault of the program's own (with its traceback), or of the line to an
        instrument; 2 the input or the usage is wrong (one line on standard error); 3 only
        where ``--fail-on`` asks.
    """
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")  # a console without Greek letters
    one_thread()
    if argv is None:  # called by another program, what that has set stays
        leave_the_folder_out()
    try:
        arguments = parse(sys.argv[1:] if argv is None else argv)
        status = _run(arguments)
        sys.stdout.flush()
        return status
    except InputError as fault:
        print(f"pendpipe: {fault}", file=sys.stderr)
        return fault.status
    except BrokenPipeError:
        # The reader of our output (`head`, say) has gone; that is nobody's fault.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except OSError as fault:
        if fault.errno in OF_DISKS and fault.filename is None:
            # What is left in the buffer would fail once more when Python ends.
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
            problem = f"it can't be written ({fault.strerror}); make room, or name a file"
            print(f"pendpipe: standard output: {problem}", file=sys.stderr)
            return 2
        if fault.filename is None:
            raise
        reason = fault.strerror or str(fault)
        print(f"pendpipe: {fault.filename}: {reason}; check the path", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("pendpipe: interrupted", file=sys.stderr)
        return 130
