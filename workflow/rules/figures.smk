rule figures:
    input:
        comparison=f"{RESULTS}/comparison.json",
        together=campaign_diagnosis(),
        records=of_all("acquire", "turning-points", "fit"),
    output:
        figures=report(
            figure_files(),
            category="Figures",
            caption="../report/figure.rst",
        ),
        drawn=f"{RESULTS}/figures/drawn.json",
    log:
        f"{RESULTS}/logs/figures.log",
    conda:
        environment
    resources:
        mem_mb=doubled(3000),
        runtime=doubled(60),
        configuration=CONFIGURATION,
    params:
        folder=subpath(output.drawn, parent=True),
        damages=history(*figure_files(), f"{RESULTS}/figures/drawn.json"),
        code=CODE,
    message:
        "figures 3 to 10"
    shell:
        "pendpipe figures --campaign {resources.configuration:q} --comparison {input.comparison:q}"
        " --out {params.folder:q} 2> {log:q}"
