# What the rules of recordings share: the checked configuration, and names. No rule, no physics.
import os
import re
import shlex
from pathlib import Path

from pendpipe.configuration import jobs
from pendpipe.configuration.load import NAME, load_campaign
from pendpipe.files import check_writable, digest
from pendpipe.report.captions import CAPTIONS
from pendpipe.stages import chunks
from pendpipe.stages.watch import Watch

CAMPAIGN = checked(load_campaign, config, PLACE)
# The rules hand the file on as a resource: unlike a parameter, that is nothing to rerun for.
# What a rule takes from the configuration is digested in its own parameters.
CONFIGURATION = checked(jobs.store, CAMPAIGN.configuration, OURS)
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
SMALL = chunks.is_small(CAMPAIGN)


# A job does a stage for a chunk of records. Live recordings are a chunk each, and stay on this
# machine.
CHUNKS = chunks.chunks_of(CAMPAIGN)
CHUNK_OF = {row.record: chunk for chunk, rows in CHUNKS.items() for row in rows}
LIVE = [chunk for chunk, rows in CHUNKS.items() if rows[0].source.startswith("dataq:")]
STAGES = [
    stage
    for name, stage in chunks.STAGES.items()
    if name != "diagnose" or CAMPAIGN.configuration.diagnose.enabled
]


# One look at each file, by the process that plans; a job has no use for it.
WATCH = Watch(Path(OURS, "files.json")) if workflow.is_main_process else None


def history(*paths):
    """The damages that results have had, a parameter: a new one makes their rule run again."""
    return WATCH.history(*map(str, paths)) if WATCH else ""


def source_hash(path):
    """The hash of a user's file, a parameter as well."""
    return WATCH and WATCH.sha256(path)


# Before any job has begun: while they run, results come and go.
PLANS = {
    (stage.name, chunk): digest(
        [
            *(chunks.settings(CAMPAIGN, stage, row, source_hash) for row in rows),
            history(stage.path(CAMPAIGN, chunk)),
        ]
    )
    for stage in STAGES
    for chunk, rows in CHUNKS.items()
}


OF_PENDULUMS = {
    name: history(f"{RESULTS}/pendulums/{name}/diagnosis.json") for name in PENDULUMS
}


def planned(name):
    """What the configuration says of the records of a job, and the damages of what it left."""
    return lambda wildcards: PLANS[name, wildcards.chunk]


def chunk_of(*names, only=None):
    """What the jobs of stages leave: of the same chunk, or of those in `only`."""
    paths = expand(f"{RESULTS}/chunks/{{name}}-{{{{chunk}}}}.zip", name=names)
    return paths if only is None else expand(paths, chunk=only)


def of_all(*names):
    """What all jobs of stages leave; nothing of a stage that the campaign does not ask for."""
    return chunk_of(
        *(stage.name for stage in STAGES if stage.name in names), only=[*CHUNKS]
    )


def users(paths):
    """The user's files: known by their content, not by their times."""
    there = [str(path) for path in paths if path and os.path.isfile(path)]
    # Snakemake would take what stands in brackets for a variable of its own.
    return [ancient(path) for path in there if not {*"{}<>"} & {*path}]


def sources(wildcards):
    """The recordings of a chunk."""
    return users(row.file for row in CHUNKS[wildcards.chunk])


wildcard_constraints:
    chunk="|".join(map(re.escape, CHUNKS)),
    pendulum="|".join(map(re.escape, PENDULUMS)) or "-",


def record_files(stage, records=RECORDS):
    """The file of each of these records that a stage leaves."""
    return expand(f"{RESULTS}/{{record}}/{stage.output}", record=records)


def of_stage(stage):
    """All that a stage leaves: the records' files, or in a large campaign its archives."""
    return record_files(stage) if SMALL else chunk_of(stage.name, only=[*CHUNKS])


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


def figure_files():
    """The figures of the paper, where the campaign has an apparatus to compare with."""
    if CAMPAIGN.configuration.apparatus is None:
        return []
    names = [name for name in CAPTIONS if name.startswith("fig") or name == "walls"]
    names += ["causes"] if campaign_diagnosis() else []
    return expand(f"{RESULTS}/figures/{{name}}.{{form}}", name=names, form=FORMS)


def option(name, value):
    """An option of the command line, or nothing."""
    return "" if value is None else f"--{name} {shlex.quote(str(value))}"


def wanted():
    """The targets of `all`. Of some records alone: their own results."""
    records = [path for stage in STAGES for path in of_stage(stage)]
    if not WHOLE:
        return records
    # Also what others are made from: Snakemake makes a lost file again only where it is asked for.
    return [
        f"{RESULTS}/campaign.json",
        f"{RESULTS}/comparison.json",
        f"{RESULTS}/separation.json",
        f"{RESULTS}/report.html",
        f"{RESULTS}/pages",
        f"{RESULTS}/records.parquet",
        f"{RESULTS}/records.csv",
        f"{RESULTS}/figures/drawn.json",
        *figure_files(),
        *campaign_diagnosis(),
        *pendulum_diagnoses(),
        *records,
        *of_all(*chunks.STAGES),
        # What nothing here makes, so that `--archive` takes it along.
        *users([CAMPAIGN.configuration.records, jobs.caliper_source(CAMPAIGN)]),
        *users(path for chunk in LIVE for path in raw_files(*CHUNKS[chunk])),
    ]


def raw_files(row):
    """What an instrument has recorded."""
    return Path(RESULTS, row.record).glob("raw/*.raw")


def missing_sources():
    """A line for each of the first records whose file is missing, and the number of the others."""
    lines = CAMPAIGN.missing_files()
    others = len(lines) - 10
    return lines[:10] + ([f"{others} more files are missing"] if others > 0 else [])


def refusals():
    """How many of the records were refused, in a line; empty for none."""
    refused = len(chunks.refused(CAMPAIGN))
    return f"{refused} of {len(RECORDS)} records were refused" if refused else ""


def of_pendulum(file):
    """A file of each record of a pendulum."""
    return lambda wildcards: expand(
        f"{RESULTS}/{{record}}/{file}", record=PENDULUMS[wildcards.pendulum]
    )
