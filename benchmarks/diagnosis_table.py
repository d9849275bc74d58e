"""The table of `benchmarks.diagnosis`."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from itertools import permutations
from typing import Any

import numpy as np

Outcome = dict[str, Any]


def share(hits: int, count: int) -> str:
    """A rate with its 95 % interval (Clopper and Pearson)."""
    if count == 0:
        return "-"
    from scipy.stats import binomtest

    low, high = binomtest(hits, count).proportion_ci(0.95, "exact")
    return f"{hits}/{count} = {100 * hits / count:.1f} % ({100 * low:.1f} to {100 * high:.1f})"


def of(done: Sequence[Outcome], family: str) -> list[Outcome]:
    """The recordings of a family."""
    return [entry for entry in done if entry["family"] == family]


def classes(entry: Outcome) -> list[list[str]]:
    """The class of each effect that was reported, the leader first."""
    return [[name, *rest] for name, _, rest in entry["effects"]]


def found(entry: Outcome) -> bool:
    """Whether anything was detected."""
    return bool(entry["effects"])


def oracle_found(entry: Outcome) -> bool:
    """The same of the oracle."""
    return bool(entry["oracle"]["detected"])


def in_class(entry: Outcome) -> bool:
    """Whether the first effect's class holds the truth."""
    right = set(entry["right"][0])
    return any(right & set(names) for names in classes(entry)[:1])


def in_a_class(entry: Outcome) -> bool:
    """Whether the class of any effect that was reported holds the truth."""
    right = set(entry["right"][0])
    return any(right & set(names) for names in classes(entry))


def first(entry: Outcome) -> bool:
    """Whether the first name is the truth."""
    return bool(entry["effects"]) and entry["effects"][0][0] in entry["right"][0]


def oracle_in_class(entry: Outcome) -> bool:
    """Whether the oracle's class holds the truth."""
    right = set(entry["right"][0])
    return oracle_found(entry) and bool(right & set(entry["oracle"]["class"] or []))


def oracle_first(entry: Outcome) -> bool:
    """Whether the oracle's first name is the truth."""
    return oracle_found(entry) and entry["oracle"]["named"] in entry["right"][0]


def oracle_tells_apart(entry: Outcome) -> bool:
    """Whether nothing but the truth is in the oracle's class."""
    return oracle_first(entry) and len(entry["oracle"]["class"]) == 1


def detection(done: Sequence[Outcome]) -> str:
    """How many single effects are found and named at each size, and the sizes of each effect."""
    singles = of(done, "single")
    if not singles:
        return ""
    return "\n\n".join(
        ["**Single effects**", _by_size(singles), _reached(singles), _by_effect(singles)]
    )


def _by_size(singles: Sequence[Outcome]) -> str:
    rows = [
        "| Delta chi^2 | detected | oracle | class right | oracle | first | oracle |",
        "|---|---|---|---|---|---|---|",
    ]
    for size in sorted({entry["size"] for entry in singles}):
        part = [entry for entry in singles if entry["size"] == size]
        tests = (
            found,
            oracle_found,
            in_class,
            oracle_in_class,
            first,
            oracle_first,
        )
        counts = [sum(test(entry) for entry in part) for test in tests]
        cells = " | ".join(f"{100 * count / len(part):.0f} %" for count in counts)
        rows.append(f"| {size:g} ({len(part)}) | {cells} |")
    return "\n".join(rows)


def _power(singles: Sequence[Outcome]) -> dict[str, Any]:
    from pendpipe_challenge.intervals import power_ratio

    sizes = np.array([entry["size"] for entry in singles])
    ours, best = (
        np.array([float(test(entry)) for entry in singles]) for test in (found, oracle_found)
    )
    return power_ratio(sizes, ours, best)


def _reached(singles: Sequence[Outcome]) -> str:
    """Delta chi^2 at which half and nine tenths of the effects are detected, and the oracle's."""
    power = _power(singles)
    if "half" not in power:
        return "Too few to say where half and nine tenths are detected."
    said = []
    for key, words in (("half", "Half"), ("nine_tenths", "Nine tenths")):
        one = power[key]
        said.append(
            f"{words} are detected at {one['found']:.3g}, by the oracle at {one['oracle']:.3g}:"
            f" {_ratio(one)}."
        )
    return " ".join(said)


def _by_effect(singles: Sequence[Outcome]) -> str:
    """The same for each effect."""
    rows = [
        "| effect | half at | oracle | times | nine tenths at | oracle | times |",
        "|---|---|---|---|---|---|---|",
    ]
    for name in sorted({entry["names"][0] for entry in singles}):
        power = _power([entry for entry in singles if entry["names"][0] == name])
        if "half" not in power:
            continue
        cells = (
            f"{one['found']:.3g} | {one['oracle']:.3g} | {_ratio(one)}"
            for one in (power["half"], power["nine_tenths"])
        )
        rows.append(f"| {name} | {' | '.join(cells)} |")
    return "\n".join(rows)


def _ratio(one: dict[str, Any]) -> str:
    low, high = one["interval95"]
    return f"{one['ratio']:.2f} ({low:.2f} to {high:.2f})"


NEEDED = 50.0
"""Delta chi^2 by which two effects are better than any one, above which two are needed."""
BESIDE = "pair-beside"
"""The family of pairs of which each is worth its Delta chi^2 with the other one in the model,
by laws of the catalogue's form: what is asked is whether two at once are told apart."""


def table(outcomes: Sequence[Outcome]) -> str:
    """All figures, as Markdown."""
    done = [entry for entry in outcomes if "p_value" in entry]
    refused = [entry for entry in outcomes if "refused" in entry]
    not_made = [entry for entry in outcomes if "not_made" in entry]
    cpu = sorted(entry["cpu_s"] for entry in done)
    head = [
        f"{len(done)} recordings of at most 4000 readings were diagnosed, {len(refused)} refused"
        f" as not analysable, {len(not_made)} could not be made at the size asked."
        f" CPU: median {cpu[len(cpu) // 2]:.1f} s, largest {cpu[-1]:.1f} s."
    ]
    parts = [
        _nulls(done),
        detection(done),
        _naming(done),
        _pairs(done),
        _outside(done),
        _peers(done),
    ]
    return "\n\n".join([*head, *(part for part in parts if part)])


def _nulls(done: Sequence[Outcome]) -> str:
    nulls = of(done, "null")
    alarms = [entry for entry in nulls if entry["effects"]]
    counts = Counter(entry["effects"][0][0] for entry in alarms)
    names = ", ".join(f"{name} {count}" for name, count in sorted(counts.items()))
    return f"**False alarms** at 1 % nominal: {share(len(alarms), len(nulls))}" + (
        f"; reported were {names}." if alarms else "."
    )


def _naming(done: Sequence[Outcome]) -> str:
    singles = [entry for entry in of(done, "single") if entry["size"] == 100.0]
    if not singles:
        return ""
    rows = [
        "| effect | detected | class right | first | class size | oracle's | named instead |",
        "|---|---|---|---|---|---|---|",
    ]
    for name in sorted({entry["names"][0] for entry in singles}):
        part = [entry for entry in singles if entry["names"][0] == name]
        sizes = [len(classes(entry)[0]) for entry in part if entry["effects"]]
        oracle = [len(entry["oracle"]["class"] or []) for entry in part if oracle_found(entry)]
        wrong = sorted(
            {entry["effects"][0][0] for entry in part if entry["effects"] and not in_class(entry)}
        )
        rows.append(
            f"| {name} | {sum(map(found, part))}/{len(part)} | {sum(map(in_class, part))}"
            f" | {sum(map(first, part))} | {_mean(sizes)} | {_mean(oracle)} | {', '.join(wrong)} |"
        )
    sizes = [len(classes(entry)[0]) for entry in singles if entry["effects"]]
    oracle = [len(entry["oracle"]["class"] or []) for entry in singles if oracle_found(entry)]
    return (
        "**Naming at Delta chi^2 = 100**: the class holds the true effect in"
        f" {share(sum(map(in_class, singles)), len(singles))}, it comes first in"
        f" {share(sum(map(first, singles)), len(singles))} (the oracle:"
        f" {sum(map(oracle_first, singles))}); mean class size {_mean(sizes)}, the oracle's"
        f" {_mean(oracle)}. {_nameable(singles)} {_coverage(singles, of(done, 'single'))}\n\n"
        + "\n".join(rows)
    )


def _nameable(singles: Sequence[Outcome]) -> str:
    """The same of those that the oracle itself can name."""
    held = [entry for entry in singles if oracle_in_class(entry)]
    led = [entry for entry in singles if oracle_first(entry)]
    alone = [entry for entry in singles if oracle_tells_apart(entry)]
    return (
        "Where more than one effect was reported, the first one's class is asked; the class of"
        f" any of them holds the truth in {share(sum(map(in_a_class, singles)), len(singles))}."
        " Of those that the oracle's own class holds it is in the class in"
        f" {share(sum(map(in_class, held)), len(held))}; of those that the oracle names, first in"
        f" {share(sum(map(first, led)), len(led))}; of those that the oracle can name (its class"
        f" holds nothing else), first in {share(sum(map(first, alone)), len(alone))} and in the"
        f" class in {share(sum(map(in_class, alone)), len(alone))}."
    )


def _coverage(asked: Sequence[Outcome], singles: Sequence[Outcome]) -> str:
    at_100, of_all = (
        [each for entry in part for each in entry["inside"]] for part in (asked, singles)
    )
    return (
        "95 % intervals of the named effect's parameters, where it acts by the catalogue's own"
        f" law, hold the truth in {share(sum(at_100), len(at_100))}; over all sizes, those"
        f" included that chance had to help above the level, in {share(sum(of_all), len(of_all))}."
    )


def _peers(done: Sequence[Outcome]) -> str:
    """Everyone on the same recordings."""
    judged = [entry for entry in done if len(entry.get("peers", {})) > 1]
    if not judged:
        return ""
    kinds = {
        "false alarms": [entry for entry in judged if entry["family"] == "null"],
        "at 50 detected": [entry for entry in judged if entry["size"] == 50.0],
        "at 100 detected": [entry for entry in judged if entry["size"] == 100.0],
    }
    named = [entry for entry in judged if entry["size"] in (50.0, 100.0)]
    outside = [entry for entry in judged if entry["family"] == "outside"]
    head = [*kinds, "named right first", "wrong name outside"]
    rows = [f"| | {' | '.join(head)} |", "|---" * (len(head) + 1) + "|"]
    for who in ("pendpipe", *judged[0]["peers"]):
        cells = [
            share(sum(_says(entry, who) for entry in part), len(part)) for part in kinds.values()
        ]
        right = sum(_name(entry, who) in entry["right"][0] for entry in named)
        wrong = sum(not (_name(entry, who) or "unnamed").startswith("unnamed") for entry in outside)
        cells += [share(right, len(named)), share(wrong, len(outside))]
        rows.append(f"| {who} | {' | '.join(cells)} |")
    return (
        "**Beside others' ways, on the same recordings.** AIC and BIC choose one template, a"
        " whiteness test (Ljung and Box, 1 %) names nothing, pysindy chooses its terms on smoothed"
        " derivatives. The peers are told the noise.\n\n" + "\n".join(rows)
    )


def _says(entry: Outcome, who: str) -> bool:
    return bool(entry["effects"]) if who == "pendpipe" else bool(entry["peers"][who][0])


def _name(entry: Outcome, who: str) -> str | None:
    if who != "pendpipe":
        name: str | None = entry["peers"][who][1]
        return name
    return entry["effects"][0][0] if entry["effects"] else None


def _mean(values: Sequence[int]) -> str:
    return f"{sum(values) / len(values):.1f}" if values else "-"


def _pairs(done: Sequence[Outcome]) -> str:
    """Pairs sized alone, where one may hide the other, and sized beside each other."""
    alone, beside = of(done, "pair"), of(done, BESIDE)
    if not alone or not beside:
        return ""
    plain, needed = _needing_two(alone), _needing_two(beside)
    rows = [
        "| pair | both found, 400 each beside the other | of those that need two | one found"
        " | both found, 400 each alone | of those that need two |",
        "|---|---|---|---|---|---|",
    ]
    for names in sorted({tuple(entry["names"]) for entry in (*alone, *beside)}):
        part, told, other, asked = (
            [entry for entry in pairs if tuple(entry["names"]) == names]
            for pairs in (alone, plain, beside, needed)
        )
        some = sum(_count_right(entry) == 1 for entry in other)
        rows.append(
            f"| {' + '.join(names)} | {_of_both(other)} | {_of_both(asked)} | {some}"
            f" | {_of_both(part)} | {_of_both(told)} |"
        )
    return (
        "**Two effects at once**, each of which adds 400 to the other (laws of the catalogue's"
        " form): both found, each by an effect of its own, in"
        f" {share(sum(map(_both, beside)), len(beside))}. Each adds that to the other of a given"
        " shape; a law whose shape is free, or a curve, may do as well as both. Of those in which"
        f" two are better by {NEEDED:g} than any one thing that was fitted, both are found in"
        f" {share(sum(map(_both, needed)), len(needed))}. Where each is worth 400 alone one may"
        f" hide the other: {share(sum(map(_both, alone)), len(alone))}, of those that need two"
        f" {share(sum(map(_both, plain)), len(plain))}.\n\n" + "\n".join(rows)
    )


def _needing_two(pairs: Sequence[Outcome]) -> list[Outcome]:
    """Those in which two effects fit better than any one."""
    return [entry for entry in pairs if entry["over_one"] > NEEDED]


def _of_both(pairs: Sequence[Outcome]) -> str:
    return f"{sum(map(_both, pairs))}/{len(pairs)}"


def _count_right(entry: Outcome) -> int:
    """How many of the truths have an effect of their own in the answer, whose class holds them."""
    named = [set(names) for names in classes(entry)]
    truths = [set(right) for right in entry["right"]]
    # Fewer effects than truths leave some without.
    named += [set()] * len(truths)
    return max(
        sum(bool(right & names) for right, names in zip(truths, each, strict=True))
        for each in permutations(named, len(truths))
    )


def _both(entry: Outcome) -> bool:
    return _count_right(entry) == len(entry["right"])


def _outside(done: Sequence[Outcome]) -> str:
    outside = of(done, "outside")
    if not outside:
        return ""
    unnamed = [
        entry
        for entry in outside
        if any(name.startswith("unnamed") for name, _, _ in entry["effects"])
    ]
    wrong = [
        entry
        for entry in outside
        if any(p > 0.8 and not name.startswith("unnamed") for name, p, _ in entry["effects"])
    ]
    rows = ["| what | unnamed | confident name | names |", "|---|---|---|---|"]
    for name in sorted({entry["names"][0] for entry in outside}):
        part = [entry for entry in outside if entry["names"][0] == name]
        names = sorted({each[0] for entry in part for each in entry["effects"]})
        rows.append(
            f"| {name} | {sum(entry in unnamed for entry in part)}/{len(part)}"
            f" | {sum(entry in wrong for entry in part)} | {', '.join(names)} |"
        )
    return (
        f"**Outside the catalogue**: unnamed in {share(len(unnamed), len(outside))}; a name given"
        f" with more than 80 % in {share(len(wrong), len(outside))} (some laws may have a right"
        " name too).\n\n" + "\n".join(rows)
    )
