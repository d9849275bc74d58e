rule fit:
    input:
        chunk_of("acquire"),
        chunk_of("calibrate"),
        chunk_of("turning-points"),
    output:
        chunk_of("fit"),
    log:
        f"{RESULTS}/logs/fit-{{chunk}}.log",
    conda:
        "../envs/pendpipe.yaml"
    resources:
        mem_mb=doubled(1000),
        runtime=doubled(30),
        configuration=CONFIGURATION,
    params:
        settings=planned("fit"),
        repaired=repaired("fit"),
        code=code_version("pendpipe.commands.fit"),
    message:
        "fit a, b, c, chunk {wildcards.chunk}"
    shell:
        "pendpipe stage fit --campaign {resources.configuration:q} --chunk {wildcards.chunk:q}"
        " --out {output:q} 2> {log:q}"
