"""What a scored challenge has shown: whether the diagnosis finds what is hidden from it."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final, NamedTuple

from markupsafe import Markup

from pendpipe.files import read_json
from pendpipe.report.captions import CAPTIONS, PROOF_CAPTIONS, Caption
from pendpipe.report.health import Health
from pendpipe.report.vector import Room

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
    cases: list[Markup | None]


def proof(folder: Path | None, room: Room) -> Proof | None:
    """Read a set's scores and figures; None where there is no scored set.

    Parameters
    ----------
    folder
        Where ``pendpipe challenge score`` has put ``scores.json`` and ``figures/``.
    room
        What the page has left for figures.
    """
    if folder is None or not (folder / "scores.json").is_file():
        return None
    scores = read_json(folder / "scores.json")
    promises = [(row["promise"], row["measured"], KEPT[row["kept"]]) for row in scores["promises"]]

    def drawn(name: str, title: str, shows: str) -> Markup | None:
        return room.drawing(folder / "figures" / f"{name}.svg", f"proof-{name}", title, shows)

    figures = [
        Drawn(svg, caption)
        for name, caption in PROOF_CAPTIONS.items()
        if (svg := drawn(name, caption.title, caption.shows)) is not None
    ]
    words = CAPTIONS["residual_map"]
    cases = [
        drawn(str(row["figure"]).removesuffix(".svg"), f"{words.title}: {row['item']}", words.shows)
        if row.get("figure") and row["same_answer"]
        else None
        for row in scores["six_cases"]
    ]
    return Proof(scores, promises, figures, cases)
