"""What a scored challenge has shown: whether the diagnosis finds what is hidden from it."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final, NamedTuple

from markupsafe import Markup

from pendpipe.files import read_json
from pendpipe.report.captions import PROOF_CAPTIONS, Caption
from pendpipe.report.health import Health
from pendpipe.report.vector import inline_svg

KEPT: Final = {
    True: Health("kept", "✔", "good", "what was promised came out"),
    False: Health("not kept", "▲", "look", "less came out than was promised"),
    None: Health("not judged", "○", "none", "too few items to judge"),
}
"""How each promise is shown."""


class Drawn(NamedTuple):
    """A figure with its words."""

    svg: Markup
    caption: Caption


class Proof(NamedTuple):
    """A scored set, ready for the page."""

    scores: dict[str, Any]
    promises: list[tuple[str, str, Health]]
    figures: list[Drawn]


def proof(folder: Path | None, *, spent: int, budget: int) -> Proof | None:
    """Read a set's scores and figures; None where there is no scored set.

    Parameters
    ----------
    folder
        Where ``pendpipe challenge score`` has put ``scores.json`` and ``figures/``.
    spent, budget
        Bytes of the page that other figures take, and that it may have: a figure beyond it
        is left out.
    """
    if folder is None or not (folder / "scores.json").is_file():
        return None
    scores = read_json(folder / "scores.json")
    promises = [(row["promise"], row["measured"], KEPT[row["kept"]]) for row in scores["promises"]]
    figures = []
    for name, caption in PROOF_CAPTIONS.items():
        path = folder / "figures" / f"{name}.svg"
        if not path.is_file():
            continue
        text = path.read_text(encoding="utf-8")
        svg = inline_svg(text, f"proof-{name}", caption.title, caption.shows)
        spent += len(svg.encode())
        if spent < budget:
            figures.append(Drawn(svg, caption))
    return Proof(scores, promises, figures)
