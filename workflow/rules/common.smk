# What the rules share: the checked configuration, and names. No rule, no physics.
import os
import re
import shlex
from pathlib import Path

from snakemake.exceptions import WorkflowError

from pendpipe import manifest
from pendpipe.configuration import jobs
from pendpipe.configuration.load import load_campaign, read_configuration
from pendpipe.errors import InputError
from pendpipe.figures import OF_EVERY_DIAGNOSIS
from pendpipe.files import check_writable
from pendpipe.provenance import code_version
from pendpipe.report.captions import CAPTIONS

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


def in_every_folder(look):
    """What `look` finds in the campaign's folders of results, by folder."""
    pendulums = (f"pendulums/{name}" for name in PENDULUMS)
    folders = ("", "calibration", *RECORDS, *pendulums)
    return {folder: checked(look, Path(RESULTS, folder)) for folder in folders}


# Before any job has begun: while they run, results come and go.
FOUND = in_every_folder(manifest.histories)


def repaired(folder, *stages):
    """The damages that made a job's stages run again: a new one is a changed parameter."""

    def of_job(wildcards):
        histories, _ = FOUND[folder.format(**wildcards)]
        return " ".join(filter(None, map(histories.get, stages)))

    return of_job


wildcard_constraints:
    record="|".join(map(re.escape, RECORDS)),


def refusal(wildcards):
    """The option that lets a stage refuse a record instead of failing."""
    refused = f"{RESULTS}/{wildcards.record}/refused.json"
    return "" if STRICT else option("refused", refused)


def of_all_records(name):
    """One file of every record."""
    return expand(
        "{results}/{record}/{name}", results=RESULTS, record=RECORDS, name=name
    )


def diagnosis_figures():
    """The figures that every record's diagnosis has, with `record` still to be put in."""
    if CAMPAIGN.configuration.diagnose.figures == "none":
        return []
    folder = f"{RESULTS}/{{record}}/diagnosis"
    return [f"{folder}/{name}.svg" for name in OF_EVERY_DIAGNOSIS]


def diagnoses():
    """Every record's diagnosis, where the campaign asks for it."""
    asked = CAMPAIGN.configuration.diagnose.enabled
    return of_all_records("diagnosis/diagnosis.json") if asked else []


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
    """All results of all records."""
    names = ["recording.csv", "calibration.json", "turning_points.csv", "fit.json"]
    if CAMPAIGN.configuration.diagnose.enabled:
        names += [f"diagnosis/{Path(path).name}" for path in diagnosis_figures()]
    return [path for name in names for path in of_all_records(name)] + diagnoses()


def figure_files():
    """The figures of the paper, where the campaign has an apparatus to compare with."""
    if CAMPAIGN.configuration.apparatus is None:
        return []
    names = [name for name in CAPTIONS if name.startswith("fig")]
    return expand(
        "{results}/figures/{name}.{form}", results=RESULTS, name=names, form=FORMS
    )


def option(name, value):
    """An option of the command line, or nothing."""
    return "" if value is None else f"--{name} {shlex.quote(str(value))}"


# Where a challenge has left its scores; rules/challenge.smk says so.
PROOF = None


def proof_option(wildcards):
    """For the report: a scored challenge, if there is one; it depends on none."""
    scored = PROOF is not None and Path(PROOF, "scores.json").exists()
    return option("proof", PROOF if scored else None)


def wanted():
    """What `rule all` makes: everything, or of some records alone their own results."""
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


def of_pendulum(name):
    """One file of each record of a pendulum."""

    def files(wildcards):
        return expand(
            "{results}/{record}/{name}",
            results=RESULTS,
            record=PENDULUMS[wildcards.pendulum],
            name=name,
        )

    return files
