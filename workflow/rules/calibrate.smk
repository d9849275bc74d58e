CALIPER = CAMPAIGN.configuration.calibration


rule caliper:
    output:
        table=f"{RESULTS}/calibration/caliper.csv",
        sensor=f"{RESULTS}/calibration/sensor.json",
    log:
        f"{RESULTS}/calibration/logs/caliper.log",
    conda:
        "../envs/pendpipe.yaml"
    resources:
        configuration=CONFIGURATION,
    params:
        arm=option("arm-m", CALIPER and CALIPER.arm_m),
        error=option("displacement-sd-m", CALIPER and CALIPER.displacement_sd_m),
        depends=jobs.caliper(CAMPAIGN),
        repaired=repaired("calibration", "caliper", "sensor"),
        code=code_version("pendpipe.stages.acquire")
        + code_version("pendpipe.commands.calibrate"),
    message:
        "the sensor against a caliper"
    shell:
        "pendpipe acquire --campaign {resources.configuration:q} --caliper --out {output.table:q} 2> {log:q}"
        " && pendpipe calibrate {output.table:q} {params.arm} {params.error} --out {output.sensor:q} >> {log:q} 2>&1"


rule calibrate:
    input:
        recording=f"{RESULTS}/{{record}}/recording.csv",
        sensor=rules.caliper.output.sensor if CAMPAIGN.configuration.calibration else [],
    output:
        f"{RESULTS}/{{record}}/calibration.json",
    log:
        f"{RESULTS}/{{record}}/logs/calibrate.log",
    conda:
        "../envs/pendpipe.yaml"
    params:
        refusal=refusal,
        sensor=lambda wildcards, input: option("sensor", input.sensor or None),
        given=lambda wildcards: option(
            "volts-per-radian", CAMPAIGN.record(wildcards.record).volts_per_radian
        ),
        repaired=repaired("{record}", "calibrate"),
        code=code_version("pendpipe.commands.calibrate"),
    message:
        "{wildcards.record}: calibrate"
    shell:
        "pendpipe calibrate {input.recording:q} --record {wildcards.record:q} {params.sensor}"
        " {params.given} --out {output:q} {params.refusal} 2> {log:q}"
