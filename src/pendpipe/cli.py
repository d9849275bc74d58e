"""The command ``pendpipe``: its entry point."""

import sys

from pendpipe.commands.main import COMMANDS, STAGES, main, parse

__all__ = ["COMMANDS", "STAGES", "main", "parse"]

if __name__ == "__main__":
    sys.exit(main())
