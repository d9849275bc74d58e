# A campaign in print: a row of its table has no recording, and so no job of its own.
from pendpipe.configuration.published import load_published
from pendpipe.files import digest

PUBLISHED = checked(load_published, PLACE, config)
RESULTS = PUBLISHED.results
FIGURES = expand(f"{RESULTS}/figures/left.{{form}}", form=["svg", "png"])


def wanted():
    """The targets of `all`."""
    return rules.published.output


rule published:
    input:
        PUBLISHED.table,
    output:
        diagnosis=f"{RESULTS}/campaign_diagnosis.json",
        answer=f"{RESULTS}/campaign_diagnosis.txt",
        figures=report(FIGURES, category="Figures"),
    log:
        f"{RESULTS}/logs/published.log",
    conda:
        environment
    resources:
        mem_mb=doubled(1000),
        runtime=doubled(10),
        configuration=checked(jobs.store, PUBLISHED, OURS),
    params:
        depends=digest(PUBLISHED.model_dump(mode="json")),
        code=CODE,
    message:
        "theory beside the printed numbers, and what is missing"
    shell:
        "pendpipe published . --campaign {resources.configuration:q} --out {output.diagnosis:q}"
        " --figure {output.figures[0]:q} > {output.answer:q} 2> {log:q}"
