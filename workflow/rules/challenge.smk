# The proof: conceal effects, solve by the released command, open, score. It has nothing to
# do with the campaign, and its own configuration.
import os

import yaml

with open("config/challenge.yaml", encoding="utf-8") as stream:
    CHALLENGE = yaml.safe_load(stream)
CHALLENGE_SET = os.environ.get("PENDPIPE_CHALLENGE_SET", CHALLENGE["set"])
CHALLENGE_ITEMS = os.environ.get("PENDPIPE_CHALLENGE_ITEMS", CHALLENGE["items"])
CHALLENGE_PAGE = os.environ.get("PENDPIPE_CHALLENGE_PAGE", CHALLENGE["page"])
# The solver's folder and the sealed truth lie apart. Seals and answers are protected: no
# changed option makes Snakemake make or solve a set anew.
OPEN = f"results/challenge/{CHALLENGE_SET}"
SEALED = f"results/challenge-sealed/{CHALLENGE_SET}"


rule challenge:
    input:
        f"{OPEN}/scores/scores.json",


rule challenge_make:
    output:
        protected(f"{OPEN}/manifest.json"),
    log:
        f"{OPEN}/logs/make.log",
    conda:
        environment
    threads: 2
    params:
        number=CHALLENGE_ITEMS,
        seed=option("seed", CHALLENGE["seed"]),
        folder=subpath(output[0], parent=True),
        sealed=SEALED,
    message:
        "make and seal {params.number} items"
    shell:
        "pendpipe challenge make {params.folder:q} --sealed {params.sealed:q} --items {params.number:q}"
        " {params.seed} --workers {threads} 2> {log:q}"


rule challenge_solve:
    input:
        f"{OPEN}/manifest.json",
    output:
        protected(f"{OPEN}/answers.json"),
    log:
        f"{OPEN}/logs/solve.log",
    conda:
        environment
    threads: 2
    params:
        folder=subpath(input[0], parent=True),
    message:
        "solve the set"
    shell:
        "pendpipe challenge solve {params.folder:q} --workers {threads} 2> {log:q}"


rule challenge_open:
    input:
        f"{OPEN}/answers.json",
    output:
        protected(f"{OPEN}/opened.json"),
    log:
        f"{OPEN}/logs/open.log",
    conda:
        environment
    params:
        folder=subpath(input[0], parent=True),
        sealed=SEALED,
    message:
        "check the seals and open the set"
    shell:
        "pendpipe challenge open {params.folder:q} --sealed {params.sealed:q} 2> {log:q}"


rule challenge_score:
    input:
        f"{OPEN}/opened.json",
    output:
        f"{OPEN}/scores/scores.json",
    log:
        f"{OPEN}/logs/score.log",
    conda:
        environment
    params:
        folder=subpath(input[0], parent=True),
        out=subpath(output[0], parent=True),
        page=option("page", CHALLENGE_PAGE),
    message:
        "score the set"
    shell:
        "pendpipe challenge score {params.folder:q} --out {params.out:q} {params.page} > {log:q} 2>&1"
