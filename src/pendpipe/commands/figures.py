"""Draw figures 3 to 10 of a campaign, and the decay of each record.

What has no data is left out, and said on standard error; in a campaign with an apparatus
each of figures 3 to 10 is written all the same, with the reason in its place.
"""

from pathlib import Path

from pendpipe.arguments import Arguments, command, tell
from pendpipe.files import write_json, write_whole, writing
from pendpipe.options import OUTPUTS, flags
from pendpipe.stages.archive import gathered, pack
from pendpipe.stages.chunks import DECAYS, SMALL


@command(
    flags("--campaign", "--comparison", required=True)
    | {
        "--out": {
            "required": True,
            "type": Path,
            "metavar": "FOLDER",
            "help": "where figures 3 to 10 go; a record's goes to RESULTS/<record>/figures",
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
    out: Path = arguments.out
    with (
        writing(inputs=[arguments.comparison]),
        gathered(folder, "recording.csv", "turning_points.csv", "fit.json") as records,
    ):
        drawn = draw_all(comparison, folder, out, records=records, processes=arguments.processes)
        decays = [path for path in drawn.files if path.is_relative_to(records)]
        if len(comparison["records"]) > SMALL:
            pack(out / DECAYS, records, decays, {})
        elif records != folder:
            for path in decays:
                write_whole(folder / path.relative_to(records), path.read_bytes())
    homes = (records, folder)
    names = [next((p.relative_to(h) for h in homes if p.is_relative_to(h)), p) for p in drawn.files]
    content = {"files": [name.as_posix() for name in names], "left_out": dict(drawn.left_out)}
    write_json(out / "drawn.json", {"schema_version": 1, **content})
    for name, reason in drawn.left_out.items():
        tell(f"pendpipe: {name} is not drawn: {reason}")
    tell(f"{out}: {len(drawn.files)} files drawn")
