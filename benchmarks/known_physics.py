"""What is known of real recordings, and whether the library finds it.

    python -m benchmarks.known_physics [--only NAME] [--limit SECONDS] [--number N] [--answers]

`known_physics.tsv` lists the free decays of ../shared/recordings with what their README states
(`known`), what was worked out by hand (`by_hand`), and names that would be wrong. `pendpipe fit`
and `pendpipe diagnose` run on each with the path and the listed options alone. An item is found
if one of its alternatives (split by `/`) is named, or belongs to the class of a named effect.
"""

from __future__ import annotations

import csv
import json
import re
import subprocess
import sys
from collections import Counter
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from resource import RUSAGE_CHILDREN, getrusage
from statistics import median
from typing import Any, Final

import numpy as np

from benchmarks.journal import ROOT, answers, judge_parser
from benchmarks.table import head, table_row
from pendpipe.files import without_folders

RECORDINGS: Final = ROOT.parent / "shared/recordings"
TABLE: Final = Path(__file__).with_suffix(".tsv")
FOLLOWED: Final = 0.1
"""A model whose residual is a larger part of the reading's rms does not follow the motion."""
LIMITED: Final = """
import resource, sys
from pendpipe.cli import main
limit = int(sys.argv[1])
resource.setrlimit(resource.RLIMIT_CPU, (limit, limit + 5))
sys.exit(main(sys.argv[2:]))
"""
"""The command line, which the system ends when its CPU seconds are spent."""
Content = Mapping[str, Any]


# ---------------------------------------------------------------- what is asked


class Answers:
    """Both answers about one recording, as the commands print them."""

    def __init__(self, fit: Content, diagnosis: Content) -> None:
        self.fit, self.diagnosis = fit, diagnosis
        self.content: Content = diagnosis.get("content", {})
        self.effects: list[Content] = self.content.get("effects", [])
        best = self.content.get("improved") or fit.get("content", {})
        self.parameters: Content = (best or {}).get("parameters", {})

    @property
    def names(self) -> dict[str, float]:
        """Effects that are named or in the class of one, with their greatest probability."""
        found: dict[str, float] = {}
        for effect in self.effects:
            for each in (effect, *effect["indistinguishable_from"]):
                found[each["id"]] = max(found.get(each["id"], 0.0), each["probability"])
        return found

    @property
    def said(self) -> str:
        """All words that were printed, those of the reader too."""
        return " ".join(
            [
                *self.content.get("warnings", []),
                self.content.get("statement", ""),
                self.diagnosis.get("said", ""),
                self.fit.get("said", ""),
            ]
        )

    def between(self, name: str, low: float = -np.inf, high: float = np.inf) -> bool:
        """Whether an interval of 95 % lies between two values."""
        low95, high95 = self.parameters.get(name, {}).get("interval95") or (None, None)
        return low95 is not None and high95 is not None and low < low95 and high95 < high

    def value(self, name: str) -> float:
        """Of a parameter of the law; not a number where there is none."""
        found = self.parameters.get(name, {}).get("value")
        return float("nan") if found is None else float(found)

    @property
    def quality_factor(self) -> float:
        """At half of the first amplitude, by the law that was fitted."""
        y = self.value("amplitude") / 2
        loss = self.value("a") * y + self.value("b") + self.value("c") / y
        return float(np.pi * self.value("frequency") / loss) if loss else float("inf")

    def coefficient(self, effect: str, sign: float) -> bool:
        """Whether an effect is named with a first coefficient of that sign."""
        return any(
            sign * float(next(iter(each["parameters"].values()))["value"] or 0.0) > 0
            for each in self.effects
            if each["id"] == effect
        )


def _below(answers: Answers, sign: float) -> bool:
    found = answers.content.get("small_amplitudes")
    return bool(found) and sign * found["frequency_excess"] > 0


def _stiffness(answers: Answers, sign: float) -> bool:
    """Whether the frequency grows (or falls) with the amplitude, by any torque that says so.

    Or by the frequency at the smallest swings, which the answer compares with the model's.
    """
    named = ("cubic-stiffness", "amplitude-linear-stiffness")
    other = {"unnamed-restoring", "keulegan-carpenter-drag", "frequency-drift"}
    if sign < 0:
        other |= {"presliding-friction"}
    small = _below(answers, -sign)
    return (
        small
        or any(answers.coefficient(each, sign) for each in named)
        or not other.isdisjoint(answers.names)
    )


SPRINGS: Final = (
    *("presliding-friction", "cubic-stiffness", "amplitude-linear-stiffness"),
    *("unnamed-restoring", "frequency-drift", "complex-modulus"),
)
DRY: Final = ("coulomb-friction", "presliding-friction")
"""Dahl's friction is dry friction at amplitudes far above its depth."""
BEATS: Final = ("second-mode", "tone-pickup", "plane-coupling", "periodic-drive")
TESTS: Final[dict[str, Callable[[Answers], bool]]] = {
    "a>0": lambda it: it.between("a", low=0) or "quadratic-drag" in it.names,
    "b>0": lambda it: it.between("b", low=0),
    "c>0": lambda it: it.between("c", low=0) or any(each in it.names for each in DRY),
    "stiffer-below": lambda it: _below(it, 1) or "presliding-friction" in it.names,
    "softer-below": lambda it: _below(it, -1) or "softer" in it.said,
    "hardening": lambda it: _stiffness(it, 1),
    "softens": lambda it: _stiffness(it, -1),
    "spring-type": lambda it: not it.names.keys().isdisjoint(SPRINGS),
    "beat": lambda it: "beating" in it.said or any(each in it.names for each in BEATS),
    "wander": lambda it: "wanders" in it.said or "offset-drift" in it.names,
    "offset": lambda it: it.between("offset", low=0) or it.between("offset", high=0),
    "gap": lambda it: re.search(r"\bgaps?\b|missing|dropped", it.said) is not None,
    "cut": lambda it: bool(it.fit.get("content", {}).get("cuts")) or it.diagnosis["status"] == 2,
}
"""Items that are no name of the catalogue."""


def is_found(item: str, answers: Answers) -> bool:
    """Whether one of the alternatives of an item is in the answers."""
    for each in item.split("/"):
        word, _, rest = each.partition(":")
        bounds = [float(v) for v in rest.split(":")] if re.fullmatch(r"[\d.:]+", rest) else []
        if word == "quality":
            found = bounds[0] <= answers.quality_factor <= bounds[1]
        elif word == "period":
            found = bounds[0] <= 1 / (answers.value("frequency") or np.nan) <= bounds[1]
        elif word in ("from", "until"):
            at = answers.fit.get("kept_s", (np.nan, np.nan))[word == "until"]
            found = bounds[0] <= at <= bounds[1]
        elif word == "says":
            found = rest in answers.said
        elif word == "gap" and bounds:
            found = (
                re.search(rf"of {bounds[0]:.0f}\.\d* s|gap.{{0,40}}{rest}", answers.said)
                is not None
            )
        elif word in TESTS:
            found = TESTS[word](answers)
        else:
            found = word in answers.names
        if found:
            return True
    return False


# ---------------------------------------------------------------- what is measured


def run(command: str, words: list[str], limit_s: float) -> dict[str, Any]:
    """Run a command of the library; its status, its answer, what it said, its CPU seconds."""
    before = getrusage(RUSAGE_CHILDREN)
    call = [sys.executable, "-c", LIMITED, str(int(limit_s)), command, *words, "--json"]
    done = subprocess.run(call, capture_output=True, text=True)
    status, printed, said = done.returncode, done.stdout, done.stderr
    if status < 0:
        said = f"not done in {limit_s:g} s of CPU"
    after = getrusage(RUSAGE_CHILDREN)
    try:
        content = json.loads(printed)
    except ValueError:
        content = {}
    cpu_s = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return {"status": status, "content": content, "said": said, "cpu_s": cpu_s}


def options(row: Mapping[str, str]) -> dict[str, str]:
    """A row's options, as `pp.read` takes them."""
    words = row["options"].split()
    names = [each.removeprefix("--") for each in words[::2]]
    return dict(zip(names, words[1::2], strict=True))


def ask(row: Mapping[str, str], limit_s: float) -> dict[str, Any]:
    """Both commands on one recording, and the rms of its free part."""
    import pendpipe as pp

    path = RECORDINGS / row["file"]
    words = [str(path), *row["options"].split()]
    fit = run("fit", words, limit_s)
    diagnosis = run("diagnose", [*words, "--no-figures"], limit_s)
    recording = pp.read(path, **options(row))
    kept = slice(None)
    try:
        decay = pp.find_free_decay(recording)
        fit["kept_s"] = decay.start_s, decay.stop_s
        within = (recording.time_s >= decay.start_s) & (recording.time_s <= decay.stop_s)
        kept = np.flatnonzero(within)
    except pp.InputError:
        pass
    rms = float(np.std(recording.values[kept]))
    return {"record": row["record"], "fit": fit, "diagnosis": diagnosis, "rms": rms}


# ---------------------------------------------------------------- the table


def table() -> list[dict[str, str]]:
    """The table of facts."""
    with TABLE.open(encoding="utf-8", newline="") as stream:
        return list(csv.DictReader(stream, delimiter="\t", quoting=csv.QUOTE_NONE))


def items(cell: str) -> list[str]:
    """Of a cell of the table of facts."""
    return [each.strip() for each in cell.split(";") if each.strip()]


def judge(row: Mapping[str, str], kept: Mapping[str, Any]) -> dict[str, Any]:
    """What one recording's answers are worth."""
    answers = Answers(kept["fit"], kept["diagnosis"])
    content, status = answers.content, kept["diagnosis"]["status"]
    refused = content.get("reason") or (kept["diagnosis"]["said"].strip().splitlines() or [""])[-1]
    judged: dict[str, Any] = {
        "known": {each: is_found(each, answers) for each in items(row["known"])},
        "by_hand": {each: is_found(each, answers) for each in items(row["by_hand"])},
        "wrong": [each["id"] for each in answers.effects if each["id"] in row["wrong"].split("/")],
        "answered": bool(answers.effects) or content.get("verdict") == "consistent",
        "refused": "" if status in (0, 3) else without_folders(refused),
        "restoring": kept["fit"]["content"].get("restoring", "none"),
        "light": kept["fit"]["content"].get("light", "refused"),
        "cpu_s": (kept["fit"]["cpu_s"], kept["diagnosis"]["cpu_s"]),
    }
    if judged["answered"]:
        judged["followed"] = content["improved"]["residual_rms_rad"] < FOLLOWED * kept["rms"]
    return judged


def line(row: Mapping[str, str], kept: Mapping[str, Any], judged: Mapping[str, Any]) -> str:
    """One recording's row of the printed table."""
    effects = Answers(kept["fit"], kept["diagnosis"]).effects
    shown = "; ".join(f"{each['id']} {each['probability']:.2f}" for each in effects) or "nothing"
    group = (
        ", ".join(each["id"] for each in effects[0]["indistinguishable_from"]) if effects else ""
    )
    found, missed = (
        [each for each, hit in judged["known"].items() if hit is wanted] for wanted in (True, False)
    )
    missed += [f"*wrong: {each}*" for each in judged["wrong"]]
    if judged["answered"] and not judged["followed"]:
        missed.append("**not followed**")
    hand = [each for each, hit in judged["by_hand"].items() if hit]
    cells = [
        shown if judged["answered"] else f"refused: {judged['refused'][:120]}",
        group,
        ", ".join(found),
        ", ".join(missed),
        f"{len(hand)} of {len(judged['by_hand'])}" if judged["by_hand"] else "",
        f"{judged['restoring']}, {judged['light']}",
        "{:.1f}, {:.1f}".format(*judged["cpu_s"]),
    ]
    return table_row(row["record"], cells)


def summary(judged: list[tuple[Mapping[str, str], dict[str, Any]]]) -> str:
    """What the rows come to."""
    facts = [hit for _, each in judged for hit in each["known"].values()]
    hand = [hit for _, each in judged for hit in each["by_hand"].values()]
    free = [each for row, each in judged if row["answer"] == "free"]
    driven = [each for row, each in judged if row["answer"] == "driven"]
    sine = [(row, each) for row, each in judged if "circular-error" in items(row["known"])]
    agree = sum(each["restoring"] == "sine" for _, each in sine)
    cpu_s = [each["cpu_s"][1] for _, each in judged]
    whole = sum(all(each["known"].values()) and not each["wrong"] for each in free)
    lines = [
        f"known: {sum(facts)} of {len(facts)} found ({sum(facts) / max(1, len(facts)):.0%});"
        f" {whole} of {len(free)} recordings without a miss",
        f"by hand: {sum(hand)} of {len(hand)} found",
        f"wrong names: {sum(len(each['wrong']) for _, each in judged)}",
        f"free decays not followed or refused: "
        f"{sum(not each.get('followed', False) for each in free)} of {len(free)}",
        f"driven and refused as such: {sum('driv' in each['refused'] for each in driven)}"
        f" of {len(driven)}",
        f"fit takes sin x where it is known: {agree} of {len(sine)}",
        f"lights of fit: {dict(Counter(each['light'] for _, each in judged))}",
        f"CPU of diagnose: median {median(cpu_s):.1f} s, largest {max(cpu_s):.1f} s",
    ]
    return "\n".join(f"* {each}" for each in lines)


def main() -> None:
    """Ask what has not been asked yet of this code, and print a row a recording."""
    parser = judge_parser(__doc__, "known_physics", 0)
    parser.add_argument("--only", action="append", default=[], help="part of a name; repeatable")
    parser.add_argument("--answers", action="store_true", help="print each answer in full")
    parser.add_argument("--limit", type=float, default=200.0, help="CPU seconds a command")
    arguments = parser.parse_args()
    wanted = arguments.only or [""]
    rows = [row for row in table() if any(each in row["record"] for each in wanted)]
    rows = rows[: arguments.number or None]
    titles = ("record", "named", "class of the first", "known: found", "missed", "by hand, found")
    if not arguments.answers:
        print(head(*titles, "torque and light of fit", "CPU s: fit, diagnose"), flush=True)
    judged = []
    asked = answers(arguments, rows, partial(ask, limit_s=arguments.limit))
    for row, kept in zip(rows, asked, strict=True):
        judged.append((row, judge(row, kept)))
        if arguments.answers:
            said = kept["diagnosis"]["content"].get("statement") or kept["diagnosis"]["said"]
            print(f"**{row['file']}**", "```", said.strip(), "```", sep="\n", flush=True)
        else:
            print(line(row, kept, judged[-1][1]), flush=True)
    print("", summary(judged), sep="\n")


if __name__ == "__main__":
    main()
