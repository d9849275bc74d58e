rule fit:
    input:
        chunk_of("acquire", "calibrate", "turning-points"),
    output:
        update(chunk_of("fit")),
    log:
        f"{RESULTS}/logs/fit-{{chunk}}.log",
    conda:
        environment
    resources:
        mem_mb=doubled(1000),
        runtime=doubled(30),
        configuration=CONFIGURATION,
    params:
        plan=planned("fit"),
        code=CODE,
    message:
        "fit a, b, c, chunk {wildcards.chunk}"
    shell:
        "pendpipe stage fit --campaign {resources.configuration:q} --chunk {wildcards.chunk:q}"
        " --reading {input:q} --out {output:q} 2> {log:q}"
