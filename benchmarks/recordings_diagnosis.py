"""The diagnoses of the real recordings: their part of ``docs/recordings.md``."""

from __future__ import annotations

import re
import shutil
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from pendpipe.analysis.fit import read_fit
from pendpipe.files import read_json
from pendpipe.quantities import compact, with_error

Content = Mapping[str, Any]
"""Of ``diagnosis.json``."""


class Known(NamedTuple):
    """One known property, and a test of the diagnosis for it: the evidence in words, or None."""

    words: str
    shown: Callable[[Content], str | None]


def by_name(*names: str) -> Callable[[Content], str | None]:
    """Whether one of these effects is named, or can't be distinguished from a named one."""

    def shown(content: Content) -> str | None:
        for effect in content["effects"]:
            if effect["id"] in names:
                return f"{effect['id']} {effect['probability']:.0%}"
            for mate in effect["indistinguishable_from"]:
                if mate["id"] in names:
                    return f"{mate['id']} {mate['probability']:.0%}, beside {effect['id']}"
        return None

    return shown


def hardens(content: Content) -> str | None:
    """A cubic restoring torque of positive sign: dT/T = -(3/8) k3 A^2."""
    for effect in content["effects"]:
        if effect["id"] == "cubic-stiffness" and effect["parameters"]["k3"]["value"] > 0.0:
            share = -0.375 * effect["parameters"]["k3"]["value"]
            return f"cubic-stiffness, dT/T = {share:.2f} A^2"
    return None


def stiffens(content: Content) -> str | None:
    """The frequency is above the named model's at the smallest amplitudes."""
    found = content.get("small_amplitudes")
    if found and found["frequency_excess"] > 0.0:
        return f"+{found['frequency_excess']:.1%} at {found['amplitude_rad']:.2g} rad"
    return by_name("presliding-friction")(content)


def beats(content: Content) -> str | None:
    """A tone beside the motion's, with the period of its beats."""
    for effect in content["effects"]:
        found = re.search(r"beating with the motion every \S+ s", effect["location"]["summary"])
        if found:
            return f"{effect['id']}, {found.group()}"
    return None


def warned(words: str) -> Callable[[Content], str | None]:
    """A warning holds these words."""

    def shown(content: Content) -> str | None:
        return next((each for each in content["warnings"] if words in each), None)

    return shown


def like_a_spring(content: Content) -> str | None:
    """The period changes with the amplitude, but not as sin x makes it."""
    if by_name("circular-error")(content):
        return None
    return by_name("presliding-friction", "cubic-stiffness", "unnamed-restoring")(content)


def isochronous(content: Content) -> str | None:
    """Nothing that changes the period with the amplitude."""
    names = "circular-error", "cubic-stiffness", "quadratic-stiffness", "presliding-friction"
    return None if by_name(*names)(content) else "none of the restoring torque's entries"


CIRCULAR = Known("circular error", by_name("circular-error"))
COULOMB = Known("Coulomb friction", by_name("coulomb-friction"))
DRAG = Known("quadratic drag", by_name("quadratic-drag"))
STIFFENING = Known("stiffer below 0.04 rad", stiffens)
WANDER = Known("slow wander of the offset", warned("the offset wanders"))
SPRING = Known("spring-type period change, no circular error", like_a_spring)

KNOWN: Mapping[str, tuple[Known, ...]] = {
    "data32": (CIRCULAR, STIFFENING),
    "data2_14": (CIRCULAR, STIFFENING),
    "data2_20": (CIRCULAR, STIFFENING),
    "data2_12": (
        CIRCULAR,
        STIFFENING,
        Known("a gap of 13 s in the time column", warned("of 13.")),
    ),
    "adip": (CIRCULAR,),
    "AAAtAmp3": (CIRCULAR, WANDER),
    "8050": (CIRCULAR, WANDER),
    "8055": (CIRCULAR, WANDER),
    "1.3_100mA": (SPRING,),
    "1.3_200mA": (SPRING,),
    "21337": (Known("hardening moment, dT/T = -0.27 A^2", hardens),),
    "test1pend1": (CIRCULAR, Known("presliding at the end", stiffens)),
    "filo0509": (Known("a beat with a second mode", beats),),
    "lab1_data": (CIRCULAR,),
    "real_pend_h_1": (CIRCULAR,),
    "real_linear_h_1": (Known("isochronous", isochronous),),
    "damping_angle": (CIRCULAR, Known("one tracking error", by_name("glitches"))),
}
"""What the README knows beside a, b and c."""
KNOWN_VISCOUS: Mapping[str, tuple[Known, ...]] = {
    "1.3_100mA": (COULOMB,),
    "data32": (COULOMB, DRAG, CIRCULAR),
    "adip": (COULOMB, DRAG, CIRCULAR),
    "lab1_data": (DRAG, CIRCULAR),
}
"""And what Eq. 3 lacks."""


def cell(known: tuple[Known, ...], content: Content) -> str:
    """List what is known of a recording, each item with what was found of it."""
    cells = []
    for item in known:
        found = item.shown(content)
        cells.append(f"{item.words}: " + (f"**found** ({found})" if found else "not found"))
    return "; ".join(cells)


SHOWN = (
    ("adip", "frequency", "Frequency against amplitude"),
    ("data2_14", "frequency", "Frequency against amplitude"),
    ("AAAtAmp3", "residual_map", "Residual"),
    ("21337", "frequency", "Frequency against amplitude"),
    ("filo0509", "residual_spectrum", "Spectrum of the residual"),
)
"""Recording, figure, words."""
ANSWERED = (
    *("8050", "lab1_data", "damping_angle", "adip", "data2_14"),
    *("data32", "1.3_100mA", "21337", "filo0509", "dataset4"),
)
"""Recordings whose answers are printed."""
VISCOUS = ("1.3_100mA", "data32", "adip", "lab1_data")

HEAD = """## What Eq. 8 lacks in them

`pendpipe diagnose` on the same files, without options. *Residual* is the rms of all readings
used, without and with the effects found; *over noise* is the square root of chi^2 per degree of
freedom at the end (1 is perfect); *open* is the global p-value of the final residual. Behind each
name stand its probability and, in brackets, the effects that the record can't distinguish from it.

**Where more than 1.14 times the noise remains, the misfit is systematic**: a camera's
distortion, an encoder's eccentricity or its lost counts, a bearing. A named effect is then kept
only if it explains three quarters of the misfit and is significant against the rest (not against
the noise); its probability is at most the part that it explains; and all errors are enlarged by
the excess per independent number of the rest. The rest has no name: it is described by a curve if
one explains most of it, and *remainder* gives the parts of the motion in which it lies.

Nothing in the recordings' README was given to the diagnosis: the last column lists what is known
from it, and what was found of that. The beat of filo0509, 9 s in the README, is a line at 1.006 Hz
beside the motion's 1.345 Hz: the beats come every 2.95 s. Amplitudes taken every 12 half cycles
(4.46 s) alternate, with a period of 8.9 s.
"""

ANSWERS_HEAD = """### Answers as they are printed

What `pendpipe fit` and `pendpipe diagnose` print, for string pendulums (8050, lab1_data,
damping_angle), rods (adip, data2_14, data32), a torsion wheel (1.3_100mA), a ship's roll (21337),
a mass on a spring (filo0509) and a Furuta arm (dataset4).
"""

VISCOUS_HEAD = """### From the viscous baseline

`pendpipe diagnose --baseline viscous`: Eq. 3 has neither Coulomb friction nor quadratic drag, so
that both should be found, beside what Eq. 8 lacks. Effects that stand for part of a law that was
not found (a step of the damping, a drift) are errors of the tool.
"""

COLUMNS = [
    "| record | missing | residual (before, after) | over noise | open | remainder"
    " | known, and found |",
    "|---|---|---|---|---|---|---|",
]


def section(results: Path, names: list[str], images: Path) -> list[str]:
    """The section's lines; figures are copied to the documentation's images."""
    lines = [*HEAD.splitlines(), "", *COLUMNS]
    lines += table(results, names, "diagnosis", KNOWN)
    lines += ["", *ANSWERS_HEAD.splitlines(), "", *answers(results)]
    lines += [*VISCOUS_HEAD.splitlines(), "", *COLUMNS]
    lines += [*table(results, list(VISCOUS), "viscous", KNOWN_VISCOUS), ""]
    for name, figure, words in SHOWN:
        drawn = results / name / f"diagnosis/{figure}.svg"
        if drawn.is_file():
            target = images / f"diagnosis-{name}-{figure}.svg"
            shutil.copyfile(drawn, target)
            lines += [f"![{words} of {name}](images/{target.name})", ""]
    return lines


def answers(results: Path) -> list[str]:
    """Quote what both commands print about some recordings."""
    lines = []
    for name in ANSWERED:
        fit, diagnosis = results / name / "fit.json", results / name / "diagnosis/diagnosis.json"
        if fit.is_file() and "refused" not in read_json(fit):
            lines += [f"**{name}**, `pendpipe fit`:", "", "```", str(read_fit(fit)), "```", ""]
        if diagnosis.is_file():
            statement = str(read_json(diagnosis)["statement"])
            lines += [f"**{name}**, `pendpipe diagnose`:", "", "```", statement, "```", ""]
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
