rule records:
    input:
        fits=of_all_chunks("fit"),
        diagnoses=of_all_chunks("diagnose"),
    output:
        f"{RESULTS}/records.parquet",
        f"{RESULTS}/records.csv",
    log:
        f"{RESULTS}/logs/records.log",
    conda:
        "../envs/pendpipe.yaml"
    resources:
        mem_mb=doubled(1000),
        runtime=doubled(10),
        configuration=CONFIGURATION,
    params:
        depends=jobs.theory(CAMPAIGN),
        repaired=repaired("records", ""),
        code=code_version("pendpipe.stages.records"),
    message:
        "a table of the records"
    shell:
        "pendpipe records --campaign {resources.configuration:q} --out {output:q} 2> {log:q}"
