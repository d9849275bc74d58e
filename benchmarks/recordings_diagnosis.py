"""What the diagnosis says of the real recordings: its part of ``docs/recordings.md``."""

from __future__ import annotations

import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from benchmarks.recordings_known import KNOWN, KNOWN_VISCOUS, Known, cell
from pendpipe.files import read_json
from pendpipe.quantities import compact, with_error

SHOWN = (
    ("adip", "frequency", "Frequency against amplitude"),
    ("data2_14", "frequency", "Frequency against amplitude"),
    ("AAAtAmp3", "residual_map", "Residual"),
    ("21337", "frequency", "Frequency against amplitude"),
    ("filo0509", "residual_spectrum", "Spectrum of the residual"),
)
"""Recording, figure, words."""
VISCOUS = ("1.3_100mA", "data32", "adip", "lab1_data")

HEAD = """## What Eq. 8 leaves out in them

`pendpipe diagnose` on the same files, nothing told. *Residual* is the rms of all readings
used, without and with what was found; *over noise* is the square root of chi^2 per degree of
freedom at the end (1 is perfect); *open* is the global p-value of what remains. Behind each
name stand its probability and, in brackets, what the record can't tell apart from it.

**Where more than 1.14 times the noise is left, the remainder is systematic**: a camera's
distortion, an encoder's eccentricity or its lost counts, a bearing. A name is then kept only if it
explains three quarters of the misfit and stands out against the rest (not against the noise); it
is believed no more than the part that it explains; and all errors are widened by the excess
per independent number of the rest. What is left has no name: it is drawn as a curve where
one describes most of it, and *remainder* says in which parts of the motion it lies.

What the recordings' README knows was told to nobody: the last column says which of it was
found, and by what. The beat of filo0509, which the README gives as 9 s, is a line at 1.006 Hz
beside the motion's 1.345 Hz: the beats come every 2.95 s. Amplitudes taken every 12 half cycles
(4.46 s) go up and down in turns, every 8.9 s.
"""

VISCOUS_HEAD = """### From the viscous baseline

`pendpipe diagnose --baseline viscous`: Eq. 3 has neither Coulomb friction nor quadratic drag,
so that both are to be found, beside what Eq. 8 leaves out. Names that stand for a part of a
law that was not found (a step of the damping, a drift) are the tool's errors.
"""

COLUMNS = [
    "| record | left out | residual (before, after) | over noise | open | remainder"
    " | known, and what was found of it |",
    "|---|---|---|---|---|---|---|",
]


def section(results: Path, names: list[str], images: Path) -> list[str]:
    """The section's lines; figures are copied to the documentation's images."""
    lines = [*HEAD.splitlines(), "", *COLUMNS]
    lines += table(results, names, "diagnosis", KNOWN)
    lines += ["", *VISCOUS_HEAD.splitlines(), "", *COLUMNS]
    lines += [*table(results, list(VISCOUS), "viscous", KNOWN_VISCOUS), ""]
    for name, figure, words in SHOWN:
        drawn = results / name / f"diagnosis/{figure}.svg"
        if drawn.is_file():
            target = images / f"diagnosis-{name}-{figure}.svg"
            shutil.copyfile(drawn, target)
            lines += [f"![{words} of {name}](images/{target.name})", ""]
    return lines


def table(
    results: Path, names: list[str], folder: str, known: Mapping[str, tuple[Known, ...]]
) -> list[str]:
    """A row for each recording that has been diagnosed."""
    found = [(name, results / name / folder / "diagnosis.json") for name in names]
    return [
        row(name, read_json(path), known.get(name, ())) for name, path in found if path.is_file()
    ]


def diagnose_viscous(root: Path, results: Path) -> None:
    """Hold some recordings against Eq. 3, which the workflow does not."""
    import subprocess
    import sys

    with (root / "benchmarks/shared_recordings.tsv").open(encoding="utf-8") as stream:
        rows = [line.split("\t") for line in stream if not line.startswith("#")]
    source = {cells[0]: cells[1] for cells in rows}
    for name in VISCOUS:
        folder = results / name / "viscous"
        if not (folder / "diagnosis.json").is_file():
            subprocess.run(
                [
                    sys.executable,
                    "-m",
                    "pendpipe.cli",
                    "diagnose",
                    source[name],
                    "--out",
                    str(folder),
                    "--baseline",
                    "viscous",
                    "--no-figures",
                ],
                cwd=root,
                check=False,
            )


def row(name: str, content: Mapping[str, Any], items: tuple[Known, ...]) -> str:
    """One line of the table."""
    if content["verdict"] == "not-analysable":
        known = "; ".join(item.words for item in items)
        return f"| {name} | not analysable: {content['reason']} ||||| {known} |"
    unit = content["baseline"]["parameters"]["amplitude"]["unit"]
    before, after = (content[key]["residual_rms_rad"] for key in ("baseline", "improved"))
    found = "; ".join(effect(each) for each in content["effects"]) or "nothing"
    known = cell(items, content)
    sizes = f"{compact(before, unit)}, {compact(after, unit)}"
    left = content["unexplained"] | (content["remainder"] or {})
    p_value = left["p_value"]
    chance = f"{p_value:.2g}" if p_value >= 1e-12 else "< 1e-12"
    rest = f"{left['over_noise']:.3g} | {chance} | {remainder(left)}"
    return f"| {name} | {found} | {sizes} | {rest} | {known} |"


def remainder(left: Mapping[str, Any]) -> str:
    """Where the rest lies, and by how much it widens errors."""
    if not left["systematic"]:
        return "noise"
    shares = sorted(left["shares"].items(), key=lambda item: -item[1])
    where = ", ".join(f"{share:.0%} {name}" for name, share in shares[:3] if share > 0.1)
    return f"{where}; errors x {left['error_factor']:.2g}"


def effect(found: Mapping[str, Any]) -> str:
    """An effect with its parameters, its probability and rivals."""
    if found["kind"] == "unnamed":
        return f"*{found['id']}* ({found['name']})"
    numbers = ", ".join(
        f"{name} {with_error(each['value'], each['sd'], each['unit'], short=True)}"
        for name, each in found["parameters"].items()
        if each["value"] is not None
    )
    rivals = ", ".join(other["id"] for other in found["indistinguishable_from"])
    text = f"**{found['id']}** {found['probability']:.0%}" + (f", {numbers}" if numbers else "")
    return text + (f" [{rivals}]" if rivals else "")


def main() -> None:
    """Print the section alone, from diagnoses in ``FOLDER/<record>/diagnosis.json``."""
    import sys

    for path in sorted(Path(sys.argv[1]).glob("*/diagnosis.json")):
        print(row(path.parent.name, read_json(path), KNOWN.get(path.parent.name, ())))


if __name__ == "__main__":
    main()
