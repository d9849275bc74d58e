# A campaign of recordings: its rules, and what is said of its results when a run begins and ends.
include: "common.smk"
include: "acquire.smk"
include: "calibrate.smk"
include: "turning_points.smk"
include: "fit.smk"
include: "decay.smk"
include: "diagnose.smk"
include: "diagnose_pendulum.smk"
include: "separate.smk"
include: "compare.smk"
include: "diagnose_campaign.smk"
include: "records.smk"
include: "figures.smk"
include: "report.smk"
include: "files.smk"


# What is wrong is named when a run is planned, a dry run too.
if WATCH:
    checked(WATCH.keep)
    for line in [*WATCH.damages, *missing_sources()]:
        logger.warning(f"pendpipe: {line}")


# Of a module Snakemake runs no hook. Nothing depends on these: a copy of what Snakemake deletes
# before the job that makes it again (what no job of this run makes, the next does), a line instead
# of several, and no leftovers.
onstart:
    checked(check_writable, RESULTS)
    for damage in WATCH.damages:
        logger.warning(f"pendpipe: {damage.path}: {checked(damage.set_aside)}")


onsuccess:
    chunks.tidy(CAMPAIGN)
    if refusals():
        logger.warning(f"pendpipe: {refusals()}; each says why in its refused.json")
