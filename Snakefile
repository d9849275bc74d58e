# The campaign: acquire -> calibrate -> turning points -> fit -> separate -> compare ->
# figures -> report, and beside the fit the diagnosis. A stage's rule is in workflow/rules, its work in src/pendpipe.
from snakemake.utils import min_version

min_version("9.8")


configfile: "config/config.yaml"


include: "workflow/rules/common.smk"


for stage in sorted(Path(workflow.basedir, "workflow/rules").glob("*.smk")):
    if stage.name != "common.smk":

        include: stage


# Damaged results are named when a run is planned, a dry run too; they are renamed when it
# starts, holding Snakemake's lock.
if workflow.is_main_process:
    for _, lines in FOUND.values():
        for line in lines:
            logger.warning(f"pendpipe: {line}")


onstart:
    checked(check_writable, RESULTS)
    for lines in in_every_folder(manifest.set_aside_damaged).values():
        for line in lines:
            logger.warning(f"pendpipe: {line}")


# `all` stands in this file: Snakemake forgets the default target of an included one.
rule all:
    default_target: True
    input:
        f"{RESULTS}/campaign.json",
        f"{RESULTS}/report.html",
        rules.records.output,
        figure_files(),
        # Whatever else is missing: Snakemake makes a lost file again only where a job that is
        # to run declares it.
        f"{RESULTS}/separation.json",
        campaign_diagnosis(),
        pendulum_diagnoses(),
        of_every_record(),
