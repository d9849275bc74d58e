"""``pendpipe completion``: for commands, options and files."""

import argparse

from pendpipe.arguments import Arguments, command
from pendpipe.commands.main import COMMANDS, STAGES, command_of


@command({"shell": {"choices": ("bash", "zsh", "tcsh"), "help": "the shell to print it for"}})
def run(arguments: Arguments) -> None:
    """Print the completion script of a shell: for commands, options and files.

    Its place is ~/.local/share/bash-completion/completions/pendpipe for bash, a file _pendpipe in a
    folder of fpath for zsh, and a file that ~/.tcshrc sources for tcsh.
    """
    import shtab

    parser = argparse.ArgumentParser(prog="pendpipe")
    commands = parser.add_subparsers()
    for name, line in (COMMANDS | STAGES).items():
        one = commands.add_parser(name, help=line)
        command_of(name).declare(one)
        declared = command_of(name).arguments
        for action in one._actions:
            names = {action.dest, *action.option_strings}
            if any("file" in declared[key] for key in names if key in declared):
                action.complete = shtab.FILE  # type: ignore[attr-defined]
    print(shtab.complete(parser, shell=arguments.shell))
