"""Print what makes a shell complete commands, options and files.

Its place is ~/.local/share/bash-completion/completions/pendpipe for bash, a file _pendpipe in a
folder of fpath for zsh, and a file that ~/.tcshrc sources for tcsh.
"""

import argparse
from typing import Final

import shtab

from pendpipe.arguments import Arguments, declare

ARGUMENTS: Final = {
    "shell": {"choices": tuple(shtab.SUPPORTED_SHELLS), "help": "the shell to print it for"}
}


def run(arguments: Arguments) -> None:
    """Declare every command's arguments under one parser, and print that for the shell."""
    from pendpipe.cli import COMMANDS, STAGES, module_of

    parser = argparse.ArgumentParser(prog="pendpipe")
    commands = parser.add_subparsers()
    for name, line in (COMMANDS | STAGES).items():
        command = commands.add_parser(name, help=line)
        declared = module_of(name).ARGUMENTS
        declare(command, declared)
        for action in command._actions:
            names = {action.dest, *action.option_strings}
            if any("file" in declared[key] for key in names if key in declared):
                action.complete = shtab.FILE  # type: ignore[attr-defined]
    print(shtab.complete(parser, shell=arguments.shell))
