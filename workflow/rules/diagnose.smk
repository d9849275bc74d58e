rule diagnose:
    input:
        recording=f"{RESULTS}/{{record}}/recording.csv",
        calibration=f"{RESULTS}/{{record}}/calibration.json",
        turning_points=f"{RESULTS}/{{record}}/turning_points.csv",
    output:
        result=f"{RESULTS}/{{record}}/diagnosis/diagnosis.json",
        figures=diagnosis_figures(),
    log:
        f"{RESULTS}/{{record}}/logs/diagnose.log",
    conda:
        "../envs/pendpipe.yaml"
    params:
        refusal=refusal,
        folder=subpath(output.result, parent=True),
        baseline=CAMPAIGN.configuration.diagnose.baseline,
        level=CAMPAIGN.configuration.diagnose.level,
        figures=CAMPAIGN.configuration.diagnose.figures,
        seed=CAMPAIGN.configuration.seed,
        repaired=repaired("{record}", "diagnose"),
        code=code_version("pendpipe.commands.diagnose"),
    message:
        "{wildcards.record}: what physics is missing"
    shell:
        "pendpipe diagnose {input.recording} --record {wildcards.record}"
        " --calibration {input.calibration} --turning-points {input.turning_points}"
        " --baseline {params.baseline} --level {params.level} --seed {params.seed}"
        " --figures {params.figures} --out {params.folder} {params.refusal} > {log} 2>&1"
