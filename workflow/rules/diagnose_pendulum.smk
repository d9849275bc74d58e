rule diagnose_pendulum:
    input:
        recordings=of_pendulum("recording.csv"),
        calibrations=of_pendulum("calibration.json"),
    output:
        f"{RESULTS}/pendulums/{{pendulum}}/diagnosis.json",
    log:
        f"{RESULTS}/pendulums/{{pendulum}}/logs/diagnose.log",
    conda:
        environment
    resources:
        mem_mb=doubled(2000),
        runtime=doubled(120),
    params:
        folder=subpath(output[0], parent=True),
        refusal="" if STRICT else "--refused -",
        baseline=CAMPAIGN.configuration.diagnose.baseline,
        level=CAMPAIGN.configuration.diagnose.level,
        seed=CAMPAIGN.configuration.seed,
        damages=lambda wildcards: OF_PENDULUMS[wildcards.pendulum],
        code=CODE,
    message:
        "{wildcards.pendulum}: what its recordings say together"
    shell:
        "pendpipe diagnose {input.recordings:q} --calibration {input.calibrations:q}"
        " --baseline {params.baseline:q} --level {params.level:q} --seed {params.seed}"
        " --record {wildcards.pendulum:q} --out {params.folder:q} {params.refusal} > {log:q} 2>&1"
