rule diagnose:
    input:
        chunk_of("acquire", "calibrate", "turning-points"),
    output:
        update(chunk_of("diagnose")),
    log:
        f"{RESULTS}/logs/diagnose-{{chunk}}.log",
    # It takes longest: begun last, it would leave the other cores idle.
    priority: 1
    conda:
        environment
    resources:
        mem_mb=doubled(2000),
        runtime=doubled(240),
        configuration=CONFIGURATION,
    params:
        plan=planned("diagnose"),
        code=CODE,
    message:
        "what physics is missing, chunk {wildcards.chunk}"
    shell:
        "pendpipe stage diagnose --campaign {resources.configuration:q} --chunk {wildcards.chunk:q}"
        " --reading {input:q} --out {output:q} 2> {log:q}"
