# What the rules share: the checked configuration, and names. No rule, no physics.
import os
import re
import shlex
from functools import cache
from pathlib import Path

from snakemake.exceptions import WorkflowError

from pendpipe import manifest
from pendpipe.configuration import jobs
from pendpipe.configuration.load import load_campaign, read_configuration
from pendpipe.errors import InputError
from pendpipe.files import check_writable
from pendpipe.provenance import code_version
from pendpipe.report.captions import CAPTIONS
from pendpipe.stages import chunks

jobs.prepare_environment()


def checked(call, *arguments):
    """Call what may find the user's input wrong; an error is one line, without a traceback."""
    try:
        return call(*arguments)
    except InputError as error:
        raise WorkflowError(str(error)) from None


# Snakemake itself takes the last of two keys of one name.
for path in filter(os.path.isfile, workflow.configfiles):
    checked(read_configuration, path)
CAMPAIGN = checked(
    load_campaign, config, ", ".join(map(str, workflow.configfiles)) or "--config"
)
# The rules hand the file on as a resource: unlike a parameter, that is nothing to rerun for.
# What a rule takes from the configuration is digested in its own parameters.
CONFIGURATION = checked(jobs.store, CAMPAIGN, ".snakemake/pendpipe")
RESULTS = CAMPAIGN.configuration.results
# With `only` the campaign's own stages are not run: they need all records.
RECORDS = [record.record for record in CAMPAIGN.selected]
WHOLE = not CAMPAIGN.configuration.only
# Several records of one pendulum are diagnosed together as well.
PENDULUMS = {}
for record in CAMPAIGN.selected:
    if record.pendulum:
        PENDULUMS.setdefault(record.pendulum, []).append(record.record)
FORMS = ["svg", "png"]
STRICT = CAMPAIGN.configuration.strict


# A job does a stage for a chunk of records. Live recordings are a chunk each, and stay on this
# machine.
CHUNKS = chunks.chunks_of(CAMPAIGN)
LIVE = [chunk for chunk, rows in CHUNKS.items() if rows[0].source.startswith("dataq:")]
STAGES = [
    stage
    for name, stage in chunks.STAGES.items()
    if name != "diagnose" or CAMPAIGN.configuration.diagnose.enabled
]


RULE_NAMES = {
    name: workflow.modifier.modify_rulename(name.replace("-", "_"))
    for name in chunks.STAGES
}


# Before any job has begun: while they run, results come and go.
PLANS = {
    (stage.name, chunk): checked(chunks.plan, CAMPAIGN, stage, chunk, records)
    for stage in STAGES
    for chunk, records in CHUNKS.items()
}
# The campaign's own stages, by the file of their manifest.
FOUND = {
    str(each.path): checked(manifest.look_through, [each])
    for folder in ("", "calibration", *(f"pendulums/{name}" for name in PENDULUMS))
    for each in manifest.manifests(Path(RESULTS, folder))
}


@cache
def hand_on():
    """Let the jobs inherit what is forced, and the damages that they can't find themselves.

    Snakemake says what is forced after it has read the rules. Another workflow may give them names
    of its own (`use rule * from ... as`).
    """
    if workflow.is_main_process:
        asked = workflow.dag_settings
        forced = [
            name
            for name, rule in RULE_NAMES.items()
            if asked.forceall or rule in asked.forcerun
        ]
        own = {path: found.repaired for path, found in FOUND.items()}
        torn = {
            str(chunks.STAGES[name].path(CAMPAIGN, chunk)): plan.own
            for (name, chunk), plan in PLANS.items()
            if plan.own
        }
        manifest.hand_on(anew=forced, repaired=own | torn)


def damages():
    """The results that are not as their stages wrote them."""
    found = (*(plan.found for plan in PLANS.values()), *FOUND.values())
    return [damage for each in found for damage in each.damages]


def planned(name):
    """What the configuration says of the records of a job."""

    def of_job(wildcards):
        hand_on()
        return PLANS[name, wildcards.chunk].settings

    return of_job


def repaired(name, folder=None):
    """The damages that made a job run again: a new one is a changed parameter."""

    def of_job(wildcards):
        hand_on()
        if folder is None:
            return PLANS[name, wildcards.chunk].found.repaired
        home = Path(RESULTS, folder.format(**wildcards))
        found = FOUND.get(str(manifest.Manifest(home, name).path), manifest.Findings())
        return found.repaired

    return of_job


def chunk_of(name, only=None):
    """What the jobs of a stage leave: that of the same chunk, or of all (or of `only`)."""
    path = f"{RESULTS}/chunks/{name}-{{chunk}}.json"
    return path if only is None else expand(path, chunk=only)


wildcard_constraints:
    chunk="|".join(map(re.escape, CHUNKS)),
    pendulum="|".join(map(re.escape, PENDULUMS)) or "-",


def of_all_chunks(name):
    """What all jobs of a stage leave; nothing of a stage that the campaign does not ask for."""
    return (
        chunk_of(name, only=list(CHUNKS))
        if any(name == stage.name for stage in STAGES)
        else []
    )


def campaign_diagnosis():
    """The diagnosis of all records together, where the campaign asks for one and has theory."""
    asked = CAMPAIGN.configuration.diagnose.enabled
    compared = CAMPAIGN.configuration.apparatus is not None
    return [f"{RESULTS}/campaign_diagnosis.json"] if asked and compared else []


def pendulum_diagnoses():
    """The diagnosis of each pendulum that several records are of."""
    asked = CAMPAIGN.configuration.diagnose.enabled
    names = [name for name, records in PENDULUMS.items() if asked and len(records) > 1]
    return [f"{RESULTS}/pendulums/{name}/diagnosis.json" for name in names]


def of_every_record():
    """All results of all records: what the jobs of each stage leave."""
    return [path for stage in STAGES for path in of_all_chunks(stage.name)]


def figure_files():
    """The figures of the paper, where the campaign has an apparatus to compare with."""
    if CAMPAIGN.configuration.apparatus is None:
        return []
    names = [name for name in CAPTIONS if name.startswith("fig")]
    return expand(
        "{results}/figures/{name}.{form}", results=RESULTS, name=names, form=FORMS
    )


def doubled(number):
    """A resource, MB or minutes, that is doubled where a cluster ended the first attempt."""
    return lambda wildcards, attempt: number * attempt


def option(name, value):
    """An option of the command line, or nothing."""
    return "" if value is None else f"--{name} {shlex.quote(str(value))}"


def wanted():
    """The targets of `all`. Of some records alone: their own results."""
    if not WHOLE:
        return of_every_record()
    return [
        f"{RESULTS}/campaign.json",
        f"{RESULTS}/report.html",
        f"{RESULTS}/records.parquet",
        *figure_files(),
        # Whatever else is missing: Snakemake makes a lost file again only where a job that is
        # to run declares it.
        f"{RESULTS}/separation.json",
        f"{RESULTS}/records.csv",
        *campaign_diagnosis(),
        *pendulum_diagnoses(),
        *of_every_record(),
    ]


def missing_sources():
    """A line for each of the first records whose file is missing, and the number of the others."""
    lines = CAMPAIGN.missing_files()
    others = len(lines) - 10
    return lines[:10] + ([f"{others} more files are missing"] if others > 0 else [])


def refusals():
    """How many of the records were refused, in a line; empty for none."""
    refused = sum(Path(RESULTS, record, "refused.json").exists() for record in RECORDS)
    return f"{refused} of {len(RECORDS)} records were refused" if refused else ""


def chunks_of_pendulum(name):
    """What a stage leaves of the chunks with a pendulum's records."""

    def files(wildcards):
        own = set(PENDULUMS[wildcards.pendulum])
        return chunk_of(
            name,
            only=[
                chunk
                for chunk, rows in CHUNKS.items()
                if own & {row.record for row in rows}
            ],
        )

    return files


def of_pendulum(name):
    """One file of each record of a pendulum, as words of a command."""

    def words(wildcards):
        records = PENDULUMS[wildcards.pendulum]
        return " ".join(shlex.quote(f"{RESULTS}/{record}/{name}") for record in records)

    return words
