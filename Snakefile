# The campaign of this repository, and the proof beside it: `snakemake --cores 2`.
include: "workflow/Snakefile"
include: "workflow/rules/challenge.smk"


# Snakemake forgets the default target of an included file.
workflow.default_target = "all"
