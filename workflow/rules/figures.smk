rule figures:
    input:
        comparison=f"{RESULTS}/comparison.json",
        turning_points=of_all_records("turning_points.csv"),
        fits=of_all_records("fit.json"),
    output:
        report(
            figure_files(),
            category="Figures",
            caption="../report/figure.rst",
        ),
    log:
        f"{RESULTS}/logs/figures.log",
    conda:
        "../envs/pendpipe.yaml"
    params:
        code=code_version("pendpipe.commands.figures"),
    message:
        "figures 3 to 10"
    shell:
        "pendpipe figures --campaign {CONFIGURATION} --comparison {input.comparison}"
        " --out {RESULTS}/figures 2> {log}"
