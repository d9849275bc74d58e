"""The arguments by which a workflow's rule runs a stage of one record of a campaign."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pendpipe.configuration.load import Campaign


def add_campaign(parser: argparse._ActionsContainer, *, required: bool = False) -> None:
    """Declare ``--campaign``."""
    parser.add_argument(
        "--campaign",
        type=Path,
        required=required,
        metavar="CONFIG",
        help="a campaign's configuration",
    )


def add_record(parser: argparse._ActionsContainer) -> None:
    """Declare ``--record`` and ``--refused``."""
    parser.add_argument("--record", metavar="NAME", help="the campaign's name for this record")
    parser.add_argument(
        "--refused",
        type=Path,
        metavar="FILE",
        help="write here why the record can't be used, and end with 0, instead of ending with 2",
    )


def load(path: Path) -> Campaign:
    """Read and check a campaign."""
    from pendpipe.configuration.load import load_campaign, read_configuration

    return load_campaign(read_configuration(path), path)
