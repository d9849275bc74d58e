rule acquire:
    input:
        sources,
    output:
        update(chunk_of("acquire")),
    log:
        f"{RESULTS}/logs/acquire-{{chunk}}.log",
    conda:
        environment
    resources:
        mem_mb=doubled(1000),
        runtime=doubled(30),
        configuration=CONFIGURATION,
    params:
        plan=planned("acquire"),
        code=CODE,
    message:
        "acquire, chunk {wildcards.chunk}"
    shell:
        "pendpipe stage acquire --campaign {resources.configuration:q} --chunk {wildcards.chunk:q}"
        " --out {output:q} 2> {log:q}"


if LIVE:

    # On the machine with the instrument, a job each; what an instrument has recorded is kept.
    localrules:
        acquire_live,

    ruleorder: acquire_live > acquire

    use rule acquire as acquire_live with:
        wildcard_constraints:
            chunk="|".join(map(re.escape, LIVE)),
