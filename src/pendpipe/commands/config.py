"""Check a campaign's configuration, or print its schema or the manual's tables."""

import argparse


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of ``pendpipe config``."""
    parser.add_argument(
        "file", nargs="?", default="config/config.yaml", help="configuration to check"
    )
    shown = parser.add_mutually_exclusive_group()
    shown.add_argument("--schema", action="store_true", help="print the JSON schema")
    shown.add_argument("--manual", action="store_true", help="print the tables of the manual")


def run(arguments: argparse.Namespace) -> None:
    """Check, or print."""
    from pendpipe.configuration import document
    from pendpipe.configuration.load import load_campaign, read_configuration

    if arguments.schema:
        print(document.schema(), end="")
    elif arguments.manual:
        print(document.manual())
    else:
        campaign = load_campaign(read_configuration(arguments.file), arguments.file)
        print(f"{arguments.file}: in order, {len(campaign.records)} records")
