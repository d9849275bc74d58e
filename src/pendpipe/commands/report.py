"""Write the page about a campaign: one self-contained HTML file.

It opens without a network, prints, and can be read without a script. Figures are taken
from the folder `figures` beside the page, where pendpipe figures has put them. The
campaign's numbers go to standard output too, beside the paper's and the simulated truth.
"""

from pathlib import Path

from pendpipe.arguments import Arguments, command, tell
from pendpipe.options import INPUT, OUTPUT, flags


@command(
    {
        **flags("--campaign", required=True),
        **flags("--comparison"),
        "--summary": {
            "type": Path,
            "metavar": "FILE",
            "help": "campaign.json, from pendpipe compare, by default that beside the comparison;"
            " it can be saved from the page",
        }
        | INPUT,
        "--figures": {
            "type": Path,
            "metavar": "FOLDER",
            "help": "where figures 3 to 10 are; the folder figures beside the page by default",
        },
        "--out": {
            "type": Path,
            "metavar": "PAGE.html",
            "help": "the page; report.html among the campaign's results by default",
        }
        | OUTPUT,
    }
)
def run(arguments: Arguments) -> None:
    """Write the page."""
    from pendpipe.figures.data import read_compared
    from pendpipe.files import read_json, write_whole
    from pendpipe.manifest import job
    from pendpipe.report.page import OWN_PAGE, page_files, render
    from pendpipe.report.tables import as_text, headline

    configuration, folder, comparison = read_compared(arguments.campaign, arguments.comparison)
    out = arguments.out or folder / "report.html"
    compared = arguments.comparison or folder / "comparison.json"
    summary = arguments.summary or compared.with_name("campaign.json")
    figures = arguments.figures or out.parent / "figures"
    inputs = [compared, summary, *page_files(comparison, folder, figures)]
    with job(folder, "report", inputs=inputs, outputs=[out]) as written:

        def own_page(record: str, page: str) -> None:
            write_whole(folder / record / OWN_PAGE, page)
            written.append(folder / record / OWN_PAGE)

        page = render(
            configuration,
            comparison,
            read_json(summary),
            folder,
            figures,
            home=out,
            own_page=own_page,
        )
        write_whole(out, page)
    tell(f"{out}: {len(page.encode()) / 1e6:.1f} MB")
    if rows := headline(comparison, configuration.get("simulated") or {}):
        print(as_text(rows))
