rule report:
    input:
        comparison=f"{RESULTS}/comparison.json",
        campaign=f"{RESULTS}/campaign.json",
        together=campaign_diagnosis(),
        figures=[*figure_files(), f"{RESULTS}/figures/drawn.json"],
        records=[path for stage in STAGES for path in of_stage(stage)],
    output:
        page=report(
            f"{RESULTS}/report.html",
            category="Report",
            caption="../report/report.rst",
        ),
        # Of records that are not wholly on that page: which they are is known when it is written.
        own=directory(f"{RESULTS}/pages"),
    log:
        f"{RESULTS}/logs/report.log",
    conda:
        environment
    resources:
        mem_mb=doubled(2000),
        runtime=doubled(20),
        configuration=CONFIGURATION,
    params:
        damages=history(f"{RESULTS}/report.html"),
        code=CODE,
    message:
        "the page about the campaign"
    shell:
        "mkdir -p {output.own:q} && pendpipe report --campaign {resources.configuration:q} --comparison {input.comparison:q}"
        " --summary {input.campaign:q} --out {output.page:q} 2> {log:q}"
