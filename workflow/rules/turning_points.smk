rule turning_points:
    input:
        chunk_of("acquire", "calibrate"),
    output:
        update(chunk_of("turning-points")),
    log:
        f"{RESULTS}/logs/turning_points-{{chunk}}.log",
    conda:
        environment
    resources:
        mem_mb=doubled(1000),
        runtime=doubled(20),
        configuration=CONFIGURATION,
    params:
        plan=planned("turning-points"),
        code=CODE,
    message:
        "turning points, chunk {wildcards.chunk}"
    shell:
        "pendpipe stage turning-points --campaign {resources.configuration:q} --chunk {wildcards.chunk:q}"
        " --reading {input:q} --out {output:q} 2> {log:q}"
