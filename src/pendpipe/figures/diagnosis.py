"""The figures of a diagnosis: where model and recording differ, before and after."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Final

from matplotlib.figure import Figure

from pendpipe.diagnosis.run import Outcome
from pendpipe.figures import (
    diagnosis_codes,
    diagnosis_curve,
    diagnosis_cycles,
    diagnosis_decay,
    diagnosis_map,
    diagnosis_spectrum,
)
from pendpipe.figures.data import NothingToDrawError
from pendpipe.figures.diagnosis_data import Shown, shown
from pendpipe.figures.style import save

DRAWINGS: Final[dict[str, Callable[[Shown], Figure]]] = {
    "decay": diagnosis_decay.draw,
    "residual_map": diagnosis_map.draw,
    "residual_spectrum": diagnosis_spectrum.draw,
    "damping": diagnosis_cycles.draw_damping,
    "frequency": diagnosis_cycles.draw_frequency,
    "curve": diagnosis_curve.draw,
    "codes": diagnosis_codes.draw,
}
"""By name, in the order in which they are read."""


def draw_diagnosis(outcome: Outcome, folder: Path) -> list[Path]:
    """Draw what there is to show.

    Returns
    -------
    list of Path
        The SVG files; a PNG stands beside each.
    """
    content, drawn = shown(outcome), []
    for name, draw in DRAWINGS.items():
        try:
            figure = draw(content)
        except NothingToDrawError:
            continue
        drawn.append(save(figure, folder / name, dpi=150)[0])
    return drawn
