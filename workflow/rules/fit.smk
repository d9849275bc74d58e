rule fit:
    input:
        recording=f"{RESULTS}/{{record}}/recording.csv",
        calibration=f"{RESULTS}/{{record}}/calibration.json",
        turning_points=f"{RESULTS}/{{record}}/turning_points.csv",
    output:
        f"{RESULTS}/{{record}}/fit.json",
    log:
        f"{RESULTS}/{{record}}/logs/fit.log",
    conda:
        "../envs/pendpipe.yaml"
    params:
        refusal=refusal,
        method=CAMPAIGN.configuration.fit.method,
        restoring=lambda wildcards: option(
            "restoring", CAMPAIGN.record(wildcards.record).restoring or None
        ),
        seed=CAMPAIGN.configuration.seed,
        repaired=repaired("{record}", "fit"),
        code=code_version("pendpipe.commands.fit"),
    message:
        "{wildcards.record}: fit a, b, c"
    shell:
        "pendpipe fit {input.recording:q} --record {wildcards.record:q}"
        " --calibration {input.calibration:q} --turning-points {input.turning_points:q}"
        " --method {params.method:q} {params.restoring} --seed {params.seed} --out {output:q} {params.refusal} 2> {log:q}"
