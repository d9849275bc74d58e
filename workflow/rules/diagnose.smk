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
        restoring=lambda wildcards: (
            "--restoring linear"
            if CAMPAIGN.record(wildcards.record).restoring == "linear"
            else ""
        ),
        seed=CAMPAIGN.configuration.seed,
        repaired=repaired("{record}", "diagnose"),
        code=code_version("pendpipe.commands.diagnose"),
    message:
        "{wildcards.record}: what physics is missing"
    shell:
        "pendpipe diagnose {input.recording:q} --record {wildcards.record:q}"
        " --calibration {input.calibration:q} --turning-points {input.turning_points:q}"
        " --baseline {params.baseline:q} --level {params.level:q} --seed {params.seed}"
        " --figures {params.figures:q} {params.restoring} --out {params.folder:q} {params.refusal} > {log:q} 2>&1"
