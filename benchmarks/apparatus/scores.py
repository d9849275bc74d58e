"""What an answer about an item is worth."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Mapping
from statistics import median
from typing import Any, Final

from benchmarks.table import share

LIKELY: Final = 0.5
"""A probability from which a name is meant."""
CONFIDENT: Final = 0.8
"""A probability above which a name is confident, as in the first generator's proof."""
Kept = Mapping[str, Any]


def catalogue() -> frozenset[str]:
    """Names that the library knows, as it prints them, and can know from a file of angles."""
    command = [sys.executable, "-m", "pendpipe", "effects", "--list"]
    listed = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    return frozenset(line.split()[0] for line in listed.splitlines()) - {"tracking-noise"}


def judge(kept: Kept, names: frozenset[str]) -> dict[str, Any]:
    """Judge one answer.

    Parameters
    ----------
    kept
        Truth and answer as `benchmarks.apparatus.__main__` keeps them.
    names
        The library's catalogue; what is hidden and stands not in it counts as outside.

    Returns
    -------
    dict
        ``detected``, ``first``, ``held`` and ``both`` are None where they are not asked.
    """
    truth = kept["truth"]
    hidden, present = truth["hidden"], set(truth["present"])
    # What was presumed and fitted is found where it is there, and elsewhere no claim.
    fitted = [(name, 1.0, []) for name in kept.get("presumed", ()) if name in present]
    effects = [*kept["effects"], *fitted]
    outside = bool(truth["outside"]) or any(name not in names for name in hidden)
    true = present | set(truth["near"]) | set(truth["allowed"])
    groups = [{name, *others} for name, _, others in effects]
    named = [not name.startswith("unnamed") for name, _, _ in effects]
    # A class that holds what is there is right, whichever of its names leads.
    false = [
        each
        for each, group, is_name in zip(effects, groups, named, strict=True)
        if is_name and not group & true
    ]
    curves = [each for each, is_name in zip(effects, named, strict=True) if not is_name]
    asked = truth["part"] in ("one", "two") and not outside
    held = [any(name in group for group in groups) for name in hidden]
    sine = "circular-error" in present
    return {
        "outside": outside,
        "refused": kept["verdict"] in ("not-analysable", "failed"),
        "detected": bool(kept["effects"]) or bool(set(hidden) & {e[0] for e in fitted})
        if asked
        else None,
        "first": bool(effects) and effects[0][0] in present if asked or sine else None,
        "leads": any(name == each[0] for name in hidden for each in effects) if asked else None,
        "held": held[0] if asked and len(hidden) == 1 else None,
        "both": all(held) if asked and len(hidden) == 2 else None,
        "sine": any("circular-error" in group for group in groups) if sine else None,
        "false": [each[0] for each in false],
        "likely": [each[0] for each in false if each[1] >= LIKELY],
        "confident": [each[0] for each in false if each[1] > CONFIDENT],
        "curves": [each[0] for each in curves],
    }


def rows(kept: list[Kept]) -> dict[str, list[bool]]:
    """What is asked of a set, with the answer for each item of which it is asked."""
    names = catalogue()
    judged = [(each, judge(each, names)) for each in kept]

    def asked(key: str) -> list[bool]:
        return [each[key] for _, each in judged if each[key] is not None]

    nulls = [each for item, each in judged if item["truth"]["part"] == "null"]
    inside = [
        each for item, each in judged if item["truth"]["part"] != "null" and not each["outside"]
    ]
    outside = [each for _, each in judged if each["outside"]]
    return {
        "refused": [each["refused"] for _, each in judged],
        "circular error named or in a class, where there is sin x": asked("sine"),
        "detected, one or two hidden in the catalogue": asked("detected"),
        "first name is there": asked("first"),
        "a hidden one leads a class": asked("leads"),
        "class holds the hidden one": asked("held"),
        "both of two": asked("both"),
        "nulls with a false name": [bool(each["false"]) for each in nulls],
        "nulls with a false name or a curve": [
            bool(each["false"] or each["curves"]) for each in nulls
        ],
        "false name beside one or two hidden": [bool(each["false"]) for each in inside],
        "the same, with 50 % or more": [bool(each["likely"]) for each in inside],
        "the same, confident": [bool(each["confident"]) for each in inside],
        "outside: a false name with 50 % or more": [bool(each["likely"]) for each in outside],
        "outside: confidently wrong": [bool(each["confident"]) for each in outside],
        "outside: a curve, or no name but true ones": [
            bool(each["curves"]) or not each["false"] for each in outside
        ],
    }


def table(kept: list[Kept]) -> str:
    """The scores of a set, a line each."""
    lines = ["| what | share, % (95 % interval) |", "|---|---|"]
    lines += [f"| {what} | {share(sum(hits), len(hits))} |" for what, hits in rows(kept).items()]
    cpu_s = [item["cpu_s"] for item in kept]
    lines += [f"| CPU s, median and largest | {median(cpu_s):.1f}, {max(cpu_s):.1f} |"]
    return "\n".join(lines)


def line(kept: Kept) -> str:
    """One item's truth and answer."""
    truth, judged = kept["truth"], judge(kept, catalogue())
    present = ", ".join(f"{name} {worth:.2g}" for name, worth in truth["present"].items())
    answer = "; ".join(
        f"{name} {probability:.2f}" + (f" [{', '.join(others)}]" if others else "")
        for name, probability, others in kept["effects"]
    )
    marks = [key for key in ("first", "held", "both", "sine") if judged[key] is False]
    marks += [f"false {name}" for name in judged["false"]]
    cells = [
        f"{truth['number']} {truth['part']}",
        f"{truth['apparatus']}, {truth['noise']}",
        f"{present}{'; ' + truth['outside'] if truth['outside'] else ''}",
        answer or kept["verdict"],
        "; ".join(marks),
        f"{kept['over_noise']:.2f}" if kept.get("over_noise") else "",
        f"{kept['cpu_s']:.1f}",
    ]
    return f"| {' | '.join(cells)} |"
