rule turning_points:
    input:
        recording=f"{RESULTS}/{{record}}/recording.csv",
        calibration=f"{RESULTS}/{{record}}/calibration.json",
    output:
        f"{RESULTS}/{{record}}/turning_points.csv",
    log:
        f"{RESULTS}/{{record}}/logs/turning_points.log",
    conda:
        "../envs/pendpipe.yaml"
    params:
        refusal=refusal,
        repaired=repaired("{record}", "turning-points"),
        code=code_version("pendpipe.commands.turning_points"),
    message:
        "{wildcards.record}: turning points"
    shell:
        "pendpipe turning-points {input.recording:q} --record {wildcards.record:q}"
        " --calibration {input.calibration:q} --out {output:q} {params.refusal} > {log:q} 2>&1"
