"""Write the page about a campaign: one self-contained HTML file.

It opens without a network, prints, and can be read without a script. Figures are taken
from the folder `figures` beside the page, where pendpipe figures has put them. The
campaign's numbers go to standard output too, beside the paper's and the simulated truth.
"""

import os
import shutil
from pathlib import Path
from tempfile import TemporaryDirectory

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
    from pendpipe.files import make_folder, read_json, write_whole, writing
    from pendpipe.report.page import OF_A_RECORD, OF_THE_CAMPAIGN, OWN_PAGES, render
    from pendpipe.report.tables import as_text, headline
    from pendpipe.stages.archive import gather
    from pendpipe.stages.chunks import SMALL

    configuration, folder, comparison = read_compared(arguments.campaign, arguments.comparison)
    out: Path = arguments.out or folder / "report.html"
    compared = arguments.comparison or folder / "comparison.json"
    summary = arguments.summary or compared.with_name("campaign.json")
    figures = arguments.figures or out.parent / "figures"
    small = len(comparison["records"]) <= SMALL
    make_folder(out.parent)
    with writing(inputs=[compared, summary]), TemporaryDirectory(prefix="pendpipe-") as place:
        beside, home = folder, out
        if not small:  # as the results lie beside the page, for the links
            way = os.path.relpath(folder, out.parent)
            if way.startswith(".."):
                beside = Path(place)
            else:
                beside, home = Path(place, way), Path(place, out.name)
            gather(folder, beside, (*OF_A_RECORD, "diagnosis/residual_map.svg"))
            for name in filter(lambda name: (folder / name).is_file(), OF_THE_CAMPAIGN):
                shutil.copy(folder / name, beside / name)
        page = render(
            configuration,
            comparison,
            read_json(summary),
            beside,
            figures,
            home=home,
            own_page=lambda record, page: write_whole(folder / OWN_PAGES / f"{record}.html", page),
            linked=small,
        )
        write_whole(out, page)
    tell(f"{out}: {len(page.encode()) / 1e6:.1f} MB")
    if rows := headline(comparison, configuration):
        print(as_text(rows))
