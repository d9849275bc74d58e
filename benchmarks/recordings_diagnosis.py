"""What the diagnosis says of the real recordings: its part of ``docs/recordings.md``."""

from __future__ import annotations

import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pendpipe.figures.units import compact, with_error
from pendpipe.files import read_json

KNOWN = {
    "data32": "circular error; stiffer below 0.04 rad",
    "data2_14": "circular error; stiffer below 0.04 rad",
    "data2_20": "circular error; stiffer below 0.04 rad",
    "data2_12": "a gap of 13 s in the time column",
    "adip": "circular error",
    "AAAtAmp3": "circular error, slow wander of the level",
    "8050": "circular error, slow wander of the level",
    "8055": "circular error, slow wander of the level",
    "1.3_100mA": "spring-type period change, no circular error",
    "1.3_200mA": "spring-type period change, no circular error",
    "21337": "hardening moment, dT/T = -0.27 A^2",
    "test1pend1": "circular error, presliding at the end",
    "filo0509": "a 9 s beat with a second mode",
    "lab1_data": "circular error",
    "real_pend_h_1": "circular error",
    "real_linear_h_1": "isochronous",
    "damping_angle": "circular error, one tracking error",
}
"""What the recordings' own README knows beside a, b and c."""
SHOWN = ("AAAtAmp3", "21337", "filo0509")

HEAD = """## What Eq. 8 leaves out in them

`pendpipe diagnose` on the same files, nothing told. *Residual* is the rms of all readings
used, without and with what was found; *over noise* is what is left of it in units of the
noise (1 is perfect); *open* is the global p-value of what remains. In brackets: what the
record can't tell apart from the name.
"""


def section(results: Path, names: list[str], images: Path) -> list[str]:
    """The section's lines; figures are copied to the documentation's images."""
    lines = [
        *HEAD.splitlines(), "",
        "| record | verdict | left out | residual (before, after) | over noise | open | known |",
        "|---|---|---|---|---|---|---|",
    ]  # fmt: skip
    for name in names:
        path = results / name / "diagnosis/diagnosis.json"
        if path.is_file():
            lines.append(row(name, read_json(path)))
    lines.append("")
    for name in SHOWN:
        for figure, words in (("residual_map", "Residual"), ("frequency", "Frequency")):
            drawn = results / name / f"diagnosis/{figure}.svg"
            if drawn.is_file():
                target = images / f"diagnosis-{name}-{figure}.svg"
                shutil.copyfile(drawn, target)
                lines += [f"![{words} of {name}](images/{target.name})", ""]
    return lines


def row(name: str, content: Mapping[str, Any]) -> str:
    """One line of the table."""
    known = KNOWN.get(name, "")
    if content["verdict"] == "not-analysable":
        return f"| {name} | not analysable | {content['reason']} |||| {known} |"
    unit = content["baseline"]["parameters"]["amplitude"]["unit"]
    before, after = (content[key]["residual_rms_rad"] for key in ("baseline", "improved"))
    left = after / content["noise_rms_rad"]
    found = "; ".join(effect(each) for each in content["effects"])
    sizes = f"{compact(before, unit)}, {compact(after, unit)}"
    rest = f"{left:.3g} | {content['unexplained']['p_value']:.2g}"
    return f"| {name} | {content['verdict']} | {found} | {sizes} | {rest} | {known} |"


def effect(found: Mapping[str, Any]) -> str:
    """An effect with its parameters and rivals."""
    numbers = ", ".join(
        f"{name} {with_error(each['value'], each['sd'], each['unit'], short=True)}"
        for name, each in found["parameters"].items()
        if each["value"] is not None
    )
    rivals = ", ".join(other["id"] for other in found["indistinguishable_from"])
    text = f"**{found['id']}**" + (f" {numbers}" if numbers else "")
    return text + (f" [{rivals}]" if rivals else "")


def main() -> None:
    """Print the section alone, from diagnoses in ``FOLDER/<record>/diagnosis.json``."""
    import sys

    for path in sorted(Path(sys.argv[1]).glob("*/diagnosis.json")):
        print(row(path.parent.name, read_json(path)))


if __name__ == "__main__":
    main()
