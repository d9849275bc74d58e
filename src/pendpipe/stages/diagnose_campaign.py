"""Diagnose a campaign as one measurement: what is missing from all its records together.

Frequency and b of every record are fitted at once, with every uncertain input of the
configuration as a nuisance. What Eq. 16 lacks is searched for in the catalogue of campaign
effects. DIR is the campaign's folder of results; it gets campaign_diagnosis.json, and the answer
goes to standard output as one paragraph.
"""

from pathlib import Path
from typing import Any

from pendpipe.arguments import Arguments, command, load, print_answer
from pendpipe.configuration.load import Campaign
from pendpipe.files import write_json
from pendpipe.options import OUTPUT, flags
from pendpipe.provenance import code_version
from pendpipe.stages.archive import gathered
from pendpipe.stages.results import campaign_data, enough, read_results, twins
from pendpipe.version import __version__

FILE_NAME = "campaign_diagnosis.json"


@command(
    {"folder": {"type": Path, "metavar": "DIR", "help": "the campaign's results"}}
    | flags("--campaign", default=Path("config/config.yaml"))
    | {
        "--out": {
            "type": Path,
            "metavar": "FILE",
            "help": f"the answer; DIR/{FILE_NAME} by default",
        }
        | OUTPUT,
        **flags("--json"),
        "--fail-on": {
            "choices": ("missing-physics",),
            "help": "end with status 3 on that verdict",
        },
    }
)
def run(arguments: Arguments) -> int:
    """Diagnose the campaign, write the result, and print the answer."""
    campaign = load(arguments.campaign)
    there = campaign.configuration.model_copy(update={"results": str(arguments.folder)})
    campaign = Campaign(there, campaign.records)
    out = arguments.out or arguments.folder / FILE_NAME
    with gathered(campaign.folder, "fit.json", "calibration.json") as folder:
        answer = diagnose_campaign(campaign, folder)
    write_json(out, answer)
    print_answer(arguments, answer, answer["statement"])
    return 3 if arguments.fail_on and answer["verdict"] == arguments.fail_on else 0


def diagnose_campaign(campaign: Campaign, folder: Path) -> dict[str, Any]:
    """Return the content of campaign_diagnosis.json, from the records' results in a folder."""
    from pendpipe.campaign.diagnose import BASELINE, campaign_diagnosis
    from pendpipe.campaign.search import search

    provenance = {"version": __version__, "code": code_version()}
    results = read_results(campaign, folder)
    found = campaign_data(campaign, results)
    if found is None or not enough(found[0]):
        from pendpipe.diagnosis.result import not_analysable

        return not_analysable(
            BASELINE,
            "it takes three records with a geometry, two of them with a sphere in a fluid",
            provenance,
        )
    return campaign_diagnosis(
        search(*found, level=campaign.configuration.diagnose.level), provenance, twins(results)
    )
