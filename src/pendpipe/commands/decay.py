"""Draw a record's decay: the amplitudes of its turning points, the law, and what the fit leaves.

Of a record that was refused the figure says so.
"""

from pathlib import Path

from pendpipe.arguments import Arguments, command
from pendpipe.options import INPUT, OUTPUT, flags


@command(
    {
        "fit": {"type": Path, "metavar": "FIT.json", "help": "a record's fit"} | INPUT,
        "--out": {"type": Path, "required": True, "metavar": "SVG", "help": "the figure"} | OUTPUT,
        **flags("--turning-points", required=True),
        **flags("--record", "--refused"),
    }
)
def run(arguments: Arguments) -> None:
    """Draw."""
    from pendpipe.figures.data import NothingToDrawError, decay_of
    from pendpipe.figures.decays import draw_decay
    from pendpipe.figures.style import placeholder, save

    entry = {"record": arguments.record or arguments.fit.stem}
    try:
        figure = draw_decay(decay_of(entry, arguments.fit, arguments.turning_points))
    except NothingToDrawError as fault:
        figure = placeholder(str(fault))
    # For the page: the same in pixels would take as long again.
    save(figure, arguments.out.with_suffix(""), forms=("svg",))
