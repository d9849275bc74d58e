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
        seed=CAMPAIGN.configuration.seed,
        repaired=repaired("{record}", "fit"),
        code=code_version("pendpipe.commands.fit"),
    message:
        "{wildcards.record}: fit a, b, c"
    shell:
        "pendpipe fit {input.recording} --record {wildcards.record}"
        " --calibration {input.calibration} --turning-points {input.turning_points}"
        " --method {params.method} --seed {params.seed} --out {output} {params.refusal} 2> {log}"
