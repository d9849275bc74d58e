rule acquire:
    input:
        lambda wildcards: jobs.source_files(CAMPAIGN, wildcards.record),
    output:
        # Not deleted before the job, nor after its failure. An instrument's raw files, in the
        # folder beside it, are no output at all: the job decodes what they keep, and records
        # only where there is nothing.
        update(f"{RESULTS}/{{record}}/recording.csv"),
    log:
        f"{RESULTS}/{{record}}/logs/acquire.log",
    conda:
        "../envs/pendpipe.yaml"
    resources:
        configuration=CONFIGURATION,
    params:
        refusal=refusal,
        depends=lambda wildcards: jobs.acquisition(CAMPAIGN, wildcards.record),
        repaired=repaired("{record}", "acquire"),
        code=code_version("pendpipe.commands.acquire"),
    message:
        "{wildcards.record}: acquire"
    shell:
        "pendpipe acquire --campaign {resources.configuration:q} --record {wildcards.record:q}"
        " --out {output:q} {params.refusal} 2> {log:q}"
