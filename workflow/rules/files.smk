# A record's own files come out of the archives: of every record in a campaign of up to a hundred,
# else of those that are asked for. `snakemake all_fit` makes what all fits leave.
if SMALL:
    for number, (stage, chunk) in enumerate(
        (each, chunk) for each in STAGES for chunk in CHUNKS
    ):
        archive = stage.path(CAMPAIGN, chunk)
        names = record_files(stage, [row.record for row in CHUNKS[chunk]])
        # A refusal, figures of a diagnosis: those that there are.
        names += [
            f"{RESULTS}/{name}" for name in chunks.extras(CAMPAIGN, stage, archive)
        ]

        rule:
            name:
                f"{stage.rule}_files_{number}"
            input:
                str(archive),
            output:
                update(names),
            log:
                f"{RESULTS}/logs/files-{stage.name}-{chunk}.log",
            localrule: True
            conda:
                environment
            params:
                folder=subpath(input[0], ancestor=2),
                damages=history(*names),
            message:
                "the records' files, {input}"
            shell:
                "pendpipe unpack {input:q} {params.folder:q} 2> {log:q}"

else:

    rule record_file:
        input:
            lambda wildcards: chunk_of(
                *(each.name for each in STAGES if wildcards.file == each.output),
                only=CHUNK_OF.get(wildcards.record, "no-such-record"),
            ),
        output:
            f"{RESULTS}/{{record}}/{{file}}",
        log:
            f"{RESULTS}/logs/files-{{record}}-{{file}}.log",
        wildcard_constraints:
            record=NAME.pattern,
            file="|".join(re.escape(each.output) for each in STAGES),
        localrule: True
        conda:
            environment
        params:
            folder=subpath(input[0], ancestor=2),
        message:
            "{output}"
        shell:
            "pendpipe unpack {input:q} {params.folder:q} --file {wildcards.record:q}/{wildcards.file:q} 2> {log:q}"


for stage in STAGES:

    rule:
        name:
            f"all_{stage.rule}"
        input:
            of_stage(stage),
