"""The catalogue's page in the docs, made from the effects' own declarations."""

import inspect
import math

from pendpipe.effects.catalogue import CATALOGUE
from pendpipe.templates import render

_HEADINGS = {
    "dynamics": "## Dynamics: the motion itself",
    "measurement": "## Measurement: the motion is as the baseline has it, the reading is not",
}


def page() -> str:
    """Return docs/effects.md."""
    return render(
        "pendpipe.effects",
        "manual.md",
        effects=CATALOGUE,
        headings=_HEADINGS,
        text=inspect.getdoc,
        number=_number,
    )


def _number(value: float | None) -> str:
    """A bound, a default or an example; nothing where there is none."""
    return "" if value is None or not math.isfinite(value) else f"{value:g}"
