"""Diagnose a table of published numbers, as a campaign of records is diagnosed.

DIR holds ``config/config.yaml`` (who, where, the fluids as they were held to be, and as they are
known today) and ``config/table.tsv`` (a row a number). Each question is answered with what was
calculated at the time, what was observed, and what is missing (docs/published.md).
"""

from pathlib import Path

from pendpipe.arguments import Arguments, command, print_answer
from pendpipe.files import write_json
from pendpipe.options import OUTPUT, flags
from pendpipe.quantities import in_columns


@command(
    {"folder": {"type": Path, "metavar": "DIR", "help": "the campaign's folder"}}
    | flags("--campaign", help="another configuration than DIR's")
    | {
        "--figure": {"type": Path, "metavar": "FILE", "help": "what is left, as SVG and PNG"}
        | OUTPUT,
        "--out": {"type": Path, "metavar": "FILE", "help": "the answer as JSON"} | OUTPUT,
        **flags("--json"),
    }
)
def run(arguments: Arguments) -> None:
    """Answer, print, and draw."""
    from pendpipe.campaign.published import ask, by_group
    from pendpipe.configuration.published import load_published
    from pendpipe.figures.published import draw_published
    from pendpipe.figures.style import save

    other = load_published(arguments.campaign) if arguments.campaign else None
    published, asked = ask(arguments.folder, other)
    lines = [published.title, f"  {published.source}"]
    lines += [f"  {row}" for row in in_columns(by_group(asked)).splitlines()]
    for one in asked:
        lines += ["", *one.answer.lines(one.case.title)]
    content = {
        "title": published.title,
        "source": published.source,
        "cases": [one.as_json() for one in asked],
    }
    if arguments.out:
        write_json(arguments.out, content)
    print_answer(arguments, content, "\n".join(lines))
    if arguments.figure:
        save(draw_published(asked), arguments.figure.with_suffix(""))
