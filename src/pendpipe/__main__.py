"""What ``python -m pendpipe`` runs: the command line."""

import sys

if not sys.flags.safe_path:
    # The working folder, where a file may have the name of one of Python's own modules.
    del sys.path[0]

from pendpipe.cli import main

if __name__ == "__main__":
    sys.exit(main())
