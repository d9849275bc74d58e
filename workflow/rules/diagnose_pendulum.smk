rule diagnose_pendulum:
    input:
        recordings=chunks_of_pendulum("acquire"),
        calibrations=chunks_of_pendulum("calibrate"),
    output:
        f"{RESULTS}/pendulums/{{pendulum}}/diagnosis.json",
    log:
        f"{RESULTS}/pendulums/{{pendulum}}/logs/diagnose.log",
    conda:
        "../envs/pendpipe.yaml"
    resources:
        mem_mb=doubled(2000),
        runtime=doubled(120),
    params:
        recordings=of_pendulum("recording.csv"),
        calibrations=of_pendulum("calibration.json"),
        folder=subpath(output[0], parent=True),
        refusal="" if STRICT else "--refused -",
        baseline=CAMPAIGN.configuration.diagnose.baseline,
        level=CAMPAIGN.configuration.diagnose.level,
        seed=CAMPAIGN.configuration.seed,
        repaired=repaired("diagnose-pendulum", "pendulums/{pendulum}"),
        code=code_version("pendpipe.commands.diagnose"),
    message:
        "{wildcards.pendulum}: what its recordings say together"
    shell:
        "pendpipe diagnose {params.recordings} --calibration {params.calibrations}"
        " --baseline {params.baseline:q} --level {params.level:q} --seed {params.seed}"
        " --record {wildcards.pendulum:q} --out {params.folder:q} {params.refusal} > {log:q} 2>&1"
