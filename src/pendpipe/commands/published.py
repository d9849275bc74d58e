"""Diagnose a table of published numbers, as a campaign of records is diagnosed.

DIR holds ``published.yaml`` (who, where, the fluids as they were held to be, and as they are known
today) and ``table.tsv`` (a row a number). Each question is answered with what was calculated at the
time, what was observed, and what is missing (docs/published.md).
"""

from pathlib import Path

from pendpipe.arguments import Arguments, command, print_answer
from pendpipe.options import OUTPUT, flags
from pendpipe.quantities import in_columns


@command(
    {"folder": {"type": Path, "metavar": "DIR", "help": "published.yaml and table.tsv"}}
    | {
        "--figure": {"type": Path, "metavar": "FILE", "help": "what is left, as SVG and PNG"}
        | OUTPUT,
        **flags("--json"),
    }
)
def run(arguments: Arguments) -> None:
    """Answer, print, and draw."""
    from pendpipe.campaign.published import ask, by_group
    from pendpipe.figures.published import draw_published
    from pendpipe.figures.style import save

    published, asked = ask(arguments.folder)
    lines = [published.title, f"  {published.source}"]
    lines += [f"  {row}" for row in in_columns(by_group(asked)).splitlines()]
    for one in asked:
        lines += ["", *one.answer.lines(one.case.title)]
    content = {
        "title": published.title,
        "source": published.source,
        "cases": [one.as_json() for one in asked],
    }
    print_answer(arguments, content, "\n".join(lines))
    if arguments.figure:
        save(draw_published(asked), arguments.figure.with_suffix(""))
