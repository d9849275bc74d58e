"""Separate the hysteretic from the viscous losses of a campaign (Fig. 4, Eq. 17)."""

from __future__ import annotations

import argparse
from pathlib import Path

from pendpipe.commands._campaign import add_campaign, load


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of ``pendpipe separate``."""
    add_campaign(parser, required=True)
    parser.add_argument("--out", type=Path, required=True, help="the separation, JSON")


def run(arguments: argparse.Namespace) -> int:
    """Separate."""
    from pendpipe.stages.separate import separate_campaign

    separate_campaign(load(arguments.campaign), arguments.out)
    return 0
