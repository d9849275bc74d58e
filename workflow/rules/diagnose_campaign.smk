rule diagnose_campaign:
    input:
        of_all("calibrate", "fit"),
    output:
        f"{RESULTS}/campaign_diagnosis.json",
    log:
        f"{RESULTS}/logs/diagnose_campaign.log",
    conda:
        environment
    resources:
        mem_mb=doubled(2000),
        runtime=doubled(30),
        configuration=CONFIGURATION,
    params:
        folder=subpath(output[0], parent=True),
        depends=jobs.theory(CAMPAIGN),
        level=CAMPAIGN.configuration.diagnose.level,
        damages=history(f"{RESULTS}/campaign_diagnosis.json"),
        code=CODE,
    message:
        "what all records together say is missing"
    shell:
        "pendpipe diagnose-campaign {params.folder:q} --campaign {resources.configuration:q}"
        " --out {output:q} > {log:q} 2>&1"
