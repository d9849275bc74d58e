rule report:
    input:
        comparison=f"{RESULTS}/comparison.json",
        campaign=f"{RESULTS}/campaign.json",
        together=campaign_diagnosis(),
        figures=rules.figures.output.drawn,
        diagnoses=of_all_chunks("diagnose"),
    output:
        report(
            f"{RESULTS}/report.html",
            category="Report",
            caption="../report/report.rst",
        ),
    log:
        f"{RESULTS}/logs/report.log",
    conda:
        "../envs/pendpipe.yaml"
    resources:
        mem_mb=doubled(2000),
        runtime=doubled(20),
        configuration=CONFIGURATION,
    params:
        repaired=repaired("report", ""),
        code=code_version("pendpipe.commands.report"),
    message:
        "the page about the campaign"
    shell:
        "pendpipe report --campaign {resources.configuration:q} --comparison {input.comparison:q}"
        " --summary {input.campaign:q} --out {output:q} 2> {log:q}"
