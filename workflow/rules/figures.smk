rule figures:
    input:
        comparison=f"{RESULTS}/comparison.json",
        together=campaign_diagnosis(),
        fits=of_all_chunks("fit"),
    output:
        figures=report(
            figure_files(),
            category="Figures",
            caption="../report/figure.rst",
        ),
        # What was drawn beside these: a figure for every record that was not refused.
        drawn=f"{RESULTS}/figures/drawn.json",
    log:
        f"{RESULTS}/logs/figures.log",
    conda:
        "../envs/pendpipe.yaml"
    threads: 2
    resources:
        mem_mb=doubled(3000),
        runtime=doubled(60),
        configuration=CONFIGURATION,
    params:
        folder=subpath(output.drawn, parent=True),
        repaired=repaired("figures", ""),
        code=code_version("pendpipe.commands.figures"),
    message:
        "figures 3 to 10"
    shell:
        "pendpipe figures --campaign {resources.configuration:q} --comparison {input.comparison:q}"
        " --out {params.folder:q} --processes {threads} 2> {log:q}"
