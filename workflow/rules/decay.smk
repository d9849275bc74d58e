rule decay:
    input:
        chunk_of("turning-points", "fit"),
    output:
        update(chunk_of("decay")),
    log:
        f"{RESULTS}/logs/decay-{{chunk}}.log",
    conda:
        environment
    resources:
        mem_mb=doubled(1000),
        runtime=doubled(30),
        configuration=CONFIGURATION,
    params:
        plan=planned("decay"),
        code=CODE,
    message:
        "draw the decays, chunk {wildcards.chunk}"
    shell:
        "pendpipe stage decay --campaign {resources.configuration:q} --chunk {wildcards.chunk:q}"
        " --reading {input:q} --out {output:q} 2> {log:q}"
