"""Predict another experiment on a pendulum: its next decay, and its response to a drive.

Frequency and loss against amplitude come from one FILE of a free decay, or from several of one
pendulum, whose differences then widen the bands. --from predicts a decay; --drive, with
--drive-force or --support, the driven response, all branches of a bent resonance. --points compares
with what was measured: a table from pendpipe turning-points, or one with the columns frequency_hz,
amplitude, phase_deg, and drive where its size is known. Bands hold 95 %. Beyond the amplitudes of
the decays they open, and that is said.
"""

from pathlib import Path
from typing import Any, Final

from pendpipe.arguments import FILES, Arguments, command, print_answer
from pendpipe.commands.fit import OPTIONS, figure_of, fitted, take_lengths
from pendpipe.files import write_json
from pendpipe.options import INPUT, OUTPUT, flags, flags_of, given
from pendpipe.prediction import predict

PREDICTED: Final = flags_of(predict) | {
    "--points": {"type": Path, "metavar": "CSV", "help": "what was measured, to compare"} | INPUT
}
"""What is predicted, by whatever command."""


@command(
    FILES
    | PREDICTED
    | {
        "--out": {"type": Path, "metavar": "JSON", "help": "the prediction"} | OUTPUT,
        "--figure": {
            "type": Path,
            "metavar": "FILE",
            "help": "draw the bands, and the points (.svg, .png, .pdf)",
        }
        | OUTPUT,
    }
    | OPTIONS
    | flags("--json")
)
def run(arguments: Arguments) -> None:
    """Fit, predict, print and write."""
    take_lengths(arguments)
    figure = figure_of(arguments)
    fits = list[Any]()
    for file in arguments.files:
        arguments.file = file
        fits.append(fitted(arguments)[1])
    found = predict(fits, points=arguments.points, **given(arguments, predict))
    if arguments.out:
        write_json(arguments.out, found.to_dict())
    if figure:
        from pendpipe.figures.style import save

        save(found.plot(), figure.with_suffix(""), forms=[figure.suffix[1:]])
    print_answer(arguments, found.to_dict(), str(found))
