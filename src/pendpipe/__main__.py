"""What ``python -m pendpipe`` runs: the command line."""

import sys

from pendpipe.cli import main

if __name__ == "__main__":
    sys.exit(main())
