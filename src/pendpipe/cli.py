"""The command ``pendpipe``: its entry point."""

import sys

from pendpipe.commands.main import COMMANDS, STAGES, command_of, main, parse

__all__ = ["COMMANDS", "STAGES", "command_of", "main", "parse"]

if __name__ == "__main__":
    sys.exit(main())
