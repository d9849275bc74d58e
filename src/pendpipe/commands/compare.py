"""Compare a campaign's losses with Eq. 16, and sum the campaign up in numbers."""

from __future__ import annotations

import argparse
from pathlib import Path

from pendpipe.commands._campaign import add_campaign, load


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of ``pendpipe compare``."""
    add_campaign(parser, required=True)
    parser.add_argument("--separation", type=Path, required=True, help="the stage before's JSON")
    parser.add_argument("--out", type=Path, required=True, help="the comparison, JSON")
    parser.add_argument("--summary", type=Path, required=True, help="campaign.json")


def run(arguments: argparse.Namespace) -> int:
    """Compare."""
    from pendpipe.manifest import job
    from pendpipe.stages.compare import compare_campaign
    from pendpipe.stages.results import record_files, sensor_file

    campaign = load(arguments.campaign)
    home = Path(campaign.configuration.results)
    inputs = [
        arguments.separation,
        sensor_file(campaign),
        *record_files(campaign, "fit.json", "calibration.json", "turning_points.csv"),
    ]
    with job(home, "compare", inputs=inputs, out=arguments.out) as running:
        compare_campaign(campaign, arguments.separation, arguments.out, arguments.summary)
        running.outputs += [arguments.out, arguments.summary]
    return 0
