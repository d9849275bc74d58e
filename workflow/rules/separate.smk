rule separate:
    input:
        of_all("calibrate", "fit"),
        together=campaign_diagnosis(),
    output:
        f"{RESULTS}/separation.json",
    log:
        f"{RESULTS}/logs/separate.log",
    conda:
        environment
    resources:
        mem_mb=doubled(1000),
        runtime=doubled(20),
        configuration=CONFIGURATION,
    params:
        diagnosis=option("diagnosis", next(iter(campaign_diagnosis()), None)),
        depends=jobs.theory(CAMPAIGN),
        damages=history(f"{RESULTS}/separation.json"),
        code=CODE,
    message:
        "hysteretic and viscous losses"
    shell:
        "pendpipe separate --campaign {resources.configuration:q} {params.diagnosis} --out {output:q} 2> {log:q}"
