"""What the diagnoses of a campaign's records have found, for the page."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final, NamedTuple

from markupsafe import Markup

from pendpipe.figures.data import number
from pendpipe.files import read_json, without_folders
from pendpipe.quantities import compact
from pendpipe.report.captions import CAPTIONS
from pendpipe.report.health import Health
from pendpipe.report.vector import Room

VERDICTS: Final = {
    "consistent": Health("consistent", "✔", "good", "the noise explains what the model leaves"),
    "missing-physics": Health("missing physics", "▲", "look", "something was left out"),
    "not-analysable": Health("not analysable", "○", "none", "there is no diagnosis"),
}
"""How each verdict is shown."""


class Diagnosed(NamedTuple):
    """A record's diagnosis, ready for the page."""

    name: str
    anchor: str
    light: Health
    p_value: str
    effects: list[str]
    residual: str
    noise: str
    chi2: str
    statement: str
    figure: Markup | None


def diagnoses(folder: Path, names: list[str], room: Room) -> list[Diagnosed]:
    """Read every record's diagnosis; none where the campaign was not diagnosed.

    Parameters
    ----------
    folder
        The campaign's results.
    names
        Of the records.
    room
        What the page has left for figures.
    """
    found = []
    for index, name in enumerate(names, start=1):
        place, anchor = folder / name / "diagnosis", f"diagnosis-{index}"
        if not (place / "diagnosis.json").is_file():
            continue
        content = read_json(place / "diagnosis.json")
        figure = None
        if content["verdict"] == "missing-physics":
            words = f"{CAPTIONS['residual_map'].shows} Record {name}."
            title = f"Residual of {name} before and after"
            figure = room.drawing(place / "residual_map.svg", anchor, title, words)
        found.append(_diagnosed(name, anchor, content, figure))
    return found


def _diagnosed(
    name: str, anchor: str, content: Mapping[str, Any], figure: Markup | None
) -> Diagnosed:
    before, after = content["baseline"], content["improved"]
    unit = str(((before["parameters"] or {}).get("amplitude") or {}).get("unit", "rad"))
    models = (before, after)[: 2 if content["effects"] else 1]
    sizes = [compact(size, unit) for size in _numbers(models, "residual_rms_rad")]
    chi2 = [_three_digits(value) for value in _numbers(models, "chi2_per_dof")]
    noise = number(content["noise_rms_rad"])
    p_value = number(content["p_value"])
    return Diagnosed(
        name,
        anchor,
        VERDICTS[content["verdict"]],
        f"{p_value:.2g}" if math.isfinite(p_value) else "–",
        [_effect(effect) for effect in content["effects"]],
        " → ".join(sizes) or "–",
        compact(noise, unit) if math.isfinite(noise) else "–",
        " → ".join(chi2) or "–",
        without_folders(str(content["statement"])),
        figure,
    )


def _numbers(models: Sequence[Mapping[str, Any]], name: str) -> list[float]:
    """What is known of each model."""
    return [value for model in models if math.isfinite(value := number(model[name]))]


def _three_digits(value: float) -> str:
    return f"{value:.3g}" if value < 1e4 else f"{value:.0f}"


def _effect(effect: Mapping[str, Any]) -> str:
    """An effect with its probability and what it can't be distinguished from."""
    rest = ", ".join(
        f"{other['id']} {100.0 * other['probability']:.0f} %"
        for other in effect["indistinguishable_from"]
    )
    chance = number(effect["probability"])
    own = f"{effect['id']} {100.0 * chance:.0f} %" if math.isfinite(chance) else str(effect["id"])
    return f"{own} (or {rest})" if rest else own
