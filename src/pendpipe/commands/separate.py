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
    from pendpipe.manifest import job
    from pendpipe.stages.results import record_files
    from pendpipe.stages.separate import separate_campaign

    campaign = load(arguments.campaign)
    home = Path(campaign.configuration.results)
    inputs = record_files(campaign, "fit.json", "calibration.json")
    with job(home, "separate", inputs=inputs, out=arguments.out) as running:
        separate_campaign(campaign, arguments.out)
        running.outputs.append(arguments.out)
    return 0
