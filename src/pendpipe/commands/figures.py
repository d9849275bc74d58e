"""Draw figures 3 to 10 of a campaign, and the decay of each record.

What has no data is left out, and said on standard error; in a campaign with an apparatus
each of figures 3 to 10 is written all the same, with the reason in its place.
"""

from pathlib import Path

from pendpipe.arguments import Arguments, command, tell
from pendpipe.files import write_json
from pendpipe.manifest import job
from pendpipe.options import OUTPUTS, flags


@command(
    flags("--campaign", "--comparison", required=True)
    | {
        "--out": {
            "required": True,
            "type": Path,
            "metavar": "FOLDER",
            "help": "where figures 3 to 10 go; a record's figures go to RESULTS/<record>/figures",
        }
        | OUTPUTS,
        "--processes": {
            "type": int,
            "default": 1,
            "metavar": "N",
            "help": "how many may draw at once (1)",
        },
    }
)
def run(arguments: Arguments) -> None:
    """Draw."""
    from pendpipe.figures.campaign import draw_all
    from pendpipe.figures.data import read_compared

    _, folder, comparison = read_compared(arguments.campaign, arguments.comparison)
    inputs = [
        folder / entry["record"] / name
        for entry in comparison["records"]
        for name in ("recording.csv", "turning_points.csv", "fit.json")
    ]
    together = folder / "campaign_diagnosis.json"
    inputs += [arguments.comparison, *([together] if together.is_file() else [])]
    listed = arguments.out / "drawn.json"
    with job(folder, "figures", inputs=inputs, outputs=[listed]) as written:
        drawn = draw_all(comparison, folder, arguments.out, processes=arguments.processes)
        for name, reason in drawn.left_out.items():
            tell(f"pendpipe: {name} is not drawn: {reason}")
        names = [
            (file.relative_to(folder) if file.is_relative_to(folder) else file).as_posix()
            for file in drawn.files
        ]
        write_json(listed, {"schema_version": 1, "files": names, "left_out": dict(drawn.left_out)})
        written += drawn.files
    tell(f"{arguments.out}: {len(drawn.files)} files drawn")
