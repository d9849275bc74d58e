# What the rules share: the checked configuration, and names. No rule, no physics.
import os
import re
import sys
from pathlib import Path

from snakemake.exceptions import WorkflowError

from pendpipe.configuration import jobs
from pendpipe.configuration.load import load_campaign
from pendpipe.errors import InputError
from pendpipe.provenance import code_version

# The jobs find `pendpipe` beside the Python that runs Snakemake, activated or not, and
# leave threads to Snakemake, which runs them side by side.
os.environ["PATH"] = os.pathsep.join(
    [str(Path(sys.executable).parent), os.environ["PATH"]]
)
for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(variable, "1")


def checked_campaign():
    """Check the configuration before any job starts; a fault is one line."""
    place = ", ".join(map(str, workflow.configfiles)) or "--config"
    try:
        return load_campaign(config, place)
    except InputError as fault:
        raise WorkflowError(str(fault)) from None


CAMPAIGN = checked_campaign()
RESULTS = CAMPAIGN.configuration.results
RECORDS = [record.record for record in CAMPAIGN.records]
FORMS = ["svg", "png"]
STRICT = CAMPAIGN.configuration.strict
CONFIGURATION = jobs.store(config, ".snakemake/pendpipe")


wildcard_constraints:
    record="|".join(map(re.escape, RECORDS)),


def refusal(wildcards):
    """The option that lets a stage refuse a record instead of failing."""
    return "" if STRICT else f"--refused {RESULTS}/{wildcards.record}/refused.json"


def of_all_records(name):
    """One file of every record."""
    return expand(
        "{results}/{record}/{name}", results=RESULTS, record=RECORDS, name=name
    )


def figure_files():
    """The figures of the paper, where the campaign has an apparatus to compare with."""
    if CAMPAIGN.configuration.apparatus is None:
        return []
    names = [f"fig{number:02d}" for number in range(3, 11)]
    return expand(
        "{results}/figures/{name}.{form}", results=RESULTS, name=names, form=FORMS
    )
