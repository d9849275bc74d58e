rule turning_points:
    input:
        chunk_of("acquire"),
        chunk_of("calibrate"),
    output:
        chunk_of("turning-points"),
    log:
        f"{RESULTS}/logs/turning_points-{{chunk}}.log",
    conda:
        "../envs/pendpipe.yaml"
    resources:
        mem_mb=doubled(1000),
        runtime=doubled(20),
        configuration=CONFIGURATION,
    params:
        settings=planned("turning-points"),
        repaired=repaired("turning-points"),
        code=code_version("pendpipe.commands.turning_points"),
    message:
        "turning points, chunk {wildcards.chunk}"
    shell:
        "pendpipe stage turning-points --campaign {resources.configuration:q} --chunk {wildcards.chunk:q}"
        " --out {output:q} 2> {log:q}"
