"""Draw figures 3 to 10 of a campaign.

What has no data is left out, and said on standard error; in a campaign with an apparatus
each of figures 3 to 10 is written all the same, with the reason in its place.
"""

from pathlib import Path

from pendpipe.arguments import Arguments, command, tell
from pendpipe.files import write_json, writing
from pendpipe.options import OUTPUTS, flags
from pendpipe.stages.archive import gathered


@command(
    flags("--campaign", "--comparison", required=True)
    | {
        "--out": {"required": True, "type": Path, "metavar": "FOLDER", "help": "where they go"}
        | OUTPUTS
    }
)
def run(arguments: Arguments) -> None:
    """Draw."""
    from pendpipe.figures.campaign import draw_all
    from pendpipe.figures.data import read_compared

    _, folder, comparison = read_compared(arguments.campaign, arguments.comparison)
    out: Path = arguments.out
    typical = f"{comparison.get('typical_record')}/"
    names = (typical + name for name in ("recording.csv", "turning_points.csv", "fit.json"))
    with writing(inputs=[arguments.comparison]), gathered(folder, *names) as records:
        drawn = draw_all(comparison, folder, out, records=records)
    files = [
        path.relative_to(folder) if path.is_relative_to(folder) else path for path in drawn.files
    ]
    content = {"files": [path.as_posix() for path in files], "left_out": dict(drawn.left_out)}
    write_json(out / "drawn.json", {"schema_version": 1, **content})
    for name, reason in drawn.left_out.items():
        tell(f"pendpipe: {name} is not drawn: {reason}")
    tell(f"{out}: {len(drawn.files)} files drawn")
