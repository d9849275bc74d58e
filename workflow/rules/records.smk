rule records:
    input:
        of_all("calibrate", "fit", "diagnose"),
    output:
        f"{RESULTS}/records.parquet",
        f"{RESULTS}/records.csv",
    log:
        f"{RESULTS}/logs/records.log",
    conda:
        environment
    resources:
        mem_mb=doubled(1000),
        runtime=doubled(10),
        configuration=CONFIGURATION,
    params:
        depends=jobs.theory(CAMPAIGN),
        damages=history(f"{RESULTS}/records.parquet", f"{RESULTS}/records.csv"),
        code=CODE,
    message:
        "a table of the records"
    shell:
        "pendpipe records --campaign {resources.configuration:q} --out {output:q} 2> {log:q}"
