CALIPER = CAMPAIGN.configuration.calibration


rule caliper:
    output:
        table=f"{RESULTS}/calibration/caliper.csv",
        sensor=f"{RESULTS}/calibration/sensor.json",
    log:
        f"{RESULTS}/calibration/logs/caliper.log",
    conda:
        environment
    resources:
        mem_mb=doubled(1000),
        runtime=doubled(30),
        configuration=CONFIGURATION,
    params:
        arm=option("arm-m", CALIPER and CALIPER.arm_m),
        error=option("displacement-sd-m", CALIPER and CALIPER.displacement_sd_m),
        depends=jobs.caliper(CAMPAIGN, source_hash),
        damages=history(
            f"{RESULTS}/calibration/caliper.csv", f"{RESULTS}/calibration/sensor.json"
        ),
        code=CODE,
    message:
        "the sensor against a caliper"
    shell:
        "pendpipe acquire --campaign {resources.configuration:q} --caliper --out {output.table:q} 2> {log:q}"
        " && pendpipe calibrate {output.table:q} {params.arm} {params.error} --out {output.sensor:q} >> {log:q} 2>&1"


rule calibrate:
    input:
        recordings=chunk_of("acquire"),
        sensor=rules.caliper.output.sensor if CAMPAIGN.configuration.calibration else [],
    output:
        update(chunk_of("calibrate")),
    log:
        f"{RESULTS}/logs/calibrate-{{chunk}}.log",
    conda:
        environment
    resources:
        mem_mb=doubled(1000),
        runtime=doubled(10),
        configuration=CONFIGURATION,
    params:
        plan=planned("calibrate"),
        code=CODE,
    message:
        "calibrate, chunk {wildcards.chunk}"
    shell:
        "pendpipe stage calibrate --campaign {resources.configuration:q} --chunk {wildcards.chunk:q}"
        " --reading {input.recordings:q} --out {output:q} 2> {log:q}"
