rule compare:
    input:
        of_all("calibrate", "turning-points", "fit"),
        separation=f"{RESULTS}/separation.json",
        sensor=rules.caliper.output.sensor if CAMPAIGN.configuration.calibration else [],
    output:
        comparison=f"{RESULTS}/comparison.json",
        campaign=f"{RESULTS}/campaign.json",
    log:
        f"{RESULTS}/logs/compare.log",
    conda:
        environment
    resources:
        mem_mb=doubled(1000),
        runtime=doubled(30),
        configuration=CONFIGURATION,
    params:
        depends=jobs.theory(CAMPAIGN),
        damages=history(f"{RESULTS}/comparison.json", f"{RESULTS}/campaign.json"),
        code=CODE,
    message:
        "the losses beside Eq. 16"
    shell:
        "pendpipe compare --campaign {resources.configuration:q} --separation {input.separation:q}"
        " --out {output.comparison:q} --summary {output.campaign:q} 2> {log:q}"
