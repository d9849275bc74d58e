"""The page about a scored set: what was hidden, what was found, what was missed."""

from __future__ import annotations

from collections.abc import Iterator

from pendpipe.challenge.page_more import peers, places, rest
from pendpipe.challenge.page_why import why
from pendpipe.challenge.wording import Score, cell, number, percent, with_interval

FAMILIES = ("combinations", "ties", "outside", "withheld", "real")


def page(scores: Score, figures: list[str], folder: str) -> str:
    """Write the page as Markdown.

    Parameters
    ----------
    scores
        Of `score.score`.
    figures, folder
        Names of the drawn figures, and where they lie beside the page.
    """
    parts = [_head(scores), _promises(scores), _rules(), _detection(scores), _naming(scores)]
    parts += [_families(scores), places(scores), rest(scores), peers(scores)]
    parts += [_missed(scores), why(scores), _cases(scores, folder)]
    lines = [line for part in parts for line in part]
    lines += ["## Figures", ""]
    lines += [f"![{name.removesuffix('.svg')}]({folder}/{name})" for name in figures]
    return "\n".join(lines) + "\n"


def _head(scores: Score) -> Iterator[str]:
    yield "# Proof: concealed effects"
    yield ""
    yield "Written by `pendpipe challenge score`; nothing here is edited by hand. A generator that"
    yield "shares no code with the diagnosis made the recordings, the truth was sealed, the"
    yield "released `pendpipe diagnose` solved them one by one in processes that saw one recording"
    yield "and no more, its answers were hashed, and only then was the truth opened, once."
    yield ""
    yield "A fresh set from a seed drawn at run time:"
    yield ""
    yield f"    make proof SET=fresh ITEMS={scores['set']['count']}"
    yield ""
    yield "| | |"
    yield "|---|---|"
    for key, value in scores["set"].items():
        yield f"| {key.replace('_', ' ')} | {value} |"
    families = ", ".join(f"{count} {name}" for name, count in sorted(scores["families"].items()))
    yield f"| families | {families} |"
    yield f"| without a diagnosis | {', '.join(scores['unsolved']) or 'none'} |"
    yield ""


def _rules() -> Iterator[str]:
    """How the answers are judged, laid down before any was seen."""
    yield "## How it is judged"
    yield ""
    yield "- Δχ² is what is left, squared and whitened with the true noise, of the effect's"
    yield "  change of a noise-free reading after the baseline was fitted anew; samples about a"
    yield "  stop are left out. For random effects and codes it is the expected 2 ln L."
    yield "- Nulls are Eq. 8 with 12 and 16 bits, stops, heavy-tailed noise, and in half of them"
    yield "  noise that is red below 0.05 Hz. Calling red noise `coloured-noise` is no false alarm,"
    yield "  since it is true; any other name is one, `glitches` for heavy tails too."
    yield "- A class is the first name with what the answer calls indistinguishable from it; the"
    yield "  oracle's are the names whose likelihood is within exp(-3) of its best."
    yield "- An item without a diagnosis counts as not detected and not named."
    yield "- Outside the catalogue a name is right if it is `unnamed-...` of the hidden kind, and"
    yield "  confident above a probability of 0.8. Items are sized by what the best catalogue entry"
    yield "  leaves; naming is asked where that is above 70."
    yield "- A changed real recording is compared with its unchanged twin."
    yield ""


def _promises(scores: Score) -> Iterator[str]:
    """What was promised beside what came out; a miss is called a miss."""
    yield "## What was promised"
    yield ""
    yield "| promise | measured | kept |"
    yield "|---|---|---|"
    words = {None: "-", True: "yes", False: "**no**"}
    for row in scores["promises"]:
        yield f"| {row['promise']} | {row['measured']} | {words[row['kept']]} |"
    yield ""


def _detection(scores: Score) -> Iterator[str]:
    yield "## Detection of single effects"
    yield ""
    yield "The oracle knows nuisances, noise and catalogue and uses the same level: once by the"
    yield "largest score over the whole catalogue with its scans, once with each effect's own"
    yield "look-elsewhere taken off (harder to equal)."
    yield ""
    yield "| Δχ² (median) | pendpipe diagnose | oracle, largest score | oracle, effect by effect |"
    yield "|---|---|---|---|"
    for level in scores["detection"]["levels"]:
        cells = [percent(level[key]) for key in ("solver", "oracle", "oracle_by_effect")]
        yield f"| {level['delta_chi2']:.0f} | {' | '.join(cells)} |"
    yield ""
    for key, label in (("against_largest_score", "largest score"),
                       ("against_by_effect", "effect by effect")):  # fmt: skip
        found = scores["detection"][key]
        for share, words in (("half", "Half"), ("nine_tenths", "Nine tenths")):
            if share in found:
                yield _sizes(words, label, found[share])
                yield ""
    alarm = scores["false_alarms"]
    yield f"False alarms on nulls: {percent(alarm)}; the oracle's own: {percent(alarm['oracle'])}."
    yield f"A p-value below 5 %: {percent(alarm['at_five_percent'])}. False alarms on heavy-tailed"
    yield f"noise: {percent(alarm['heavy_tailed'])}; where the pendulum stops:"
    yield f"{percent(alarm['stopped'])}. Names given: {_counts(alarm['named'])}. Red noise rightly"
    yield f"called coloured (no false alarm): {alarm['rightly_called_coloured']}."
    yield ""


def _sizes(words: str, label: str, found: Score) -> str:
    """At which size a share is found, beside the oracle."""
    return (
        f"{words} are found at {found['found']:.1f}, by the oracle ({label}) at"
        f" {found['oracle']:.1f}: {with_interval(found['ratio'], found)} times."
    )


def _counts(named: dict[str, int]) -> str:
    """Names with how often each was given."""
    return ", ".join(f"{name} {count}" for name, count in sorted(named.items())) or "none"


def _naming(scores: Score) -> Iterator[str]:
    yield "## Naming"
    yield ""
    yield "Of what was detected by each; the class's mean size beside it."
    yield ""
    yield "| Δχ² | | first | among three | in class | class size |"
    yield "|---|---|---|---|---|---|"
    for band, found in scores["naming"].items():
        for who, prefix in (("diagnose", ""), ("oracle", "oracle_")):
            cells = [percent(found[f"{prefix}{key}"]) for key in ("top1", "top3", "class")]
            size = number(found[f"{prefix}class_size"])
            yield f"| {band} | {who} | {' | '.join(cells)} | {size} |"
    yield ""
    told = scores["dynamics_or_measurement"]
    yield f"Dynamics or measurement, rightly told: {percent(told)}; the oracle:"
    yield f"{percent(told['oracle'])}."
    yield ""


def _families(scores: Score) -> Iterator[str]:
    yield "## The other families"
    yield ""
    for family in FAMILIES:
        count = scores["families"].get(family.removesuffix("s"), 0)
        yield f"**{family}**, {count} items"
        yield ""
        if not count:
            yield "- none: there was nothing to make them of"
            yield ""
            continue
        for key, value in scores[family].items():
            label = key.replace("_", " ")
            if isinstance(value, dict) and "rate" in value:
                yield f"- {label}: {percent(value)}"
            elif key == "named":
                yield f"- first names: {_counts(value)}"
        yield ""
    yield from _changes(list(scores["real"]["by_change"].values()))


def _changes(entries: list[Score]) -> Iterator[str]:
    """What was concealed in real recordings, each recording and change once."""
    if not entries:
        return
    yield "| real recording | concealed | how often | named | named without it |"
    yield "|---|---|---|---|---|"
    for source, effect in sorted({(entry["source"], entry["effect"]) for entry in entries}):
        same = [e for e in entries if (e["source"], e["effect"]) == (source, effect)]
        named, without = (sum(bool(e[key]) for e in same) for key in ("named", "twin_named"))
        yield f"| {source} | {effect} | {len(same)} | {named} | {without} |"
    yield ""


def _missed(scores: Score) -> Iterator[str]:
    yield "## What was missed"
    yield ""
    yield "Single effects and withheld physics above Δχ² = 30 that were not detected:"
    yield ""
    yield "| item | hidden | law | Δχ² | oracle detected |"
    yield "|---|---|---|---|---|"
    for row in scores["missed"]:
        seen = "yes" if row["oracle_detected"] else "no"
        yield (
            f"| {row['item']} | {row['hidden']} | {cell(row['law'])} |"
            f" {row['delta_chi2']:.0f} | {seen} |"
        )
    yield ""


def _cases(scores: Score, folder: str) -> Iterator[str]:
    yield "## Six cases"
    yield ""
    yield "By rule: of each of six kinds of effect, the first single in the set above Δχ² = 70. The"
    yield "figure is what the same command draws: data minus model against time and phase of the"
    yield "cycle, in standard errors of a cell, before and after."
    yield ""
    for row in scores["six_cases"]:
        yield f"**{row['item']}**, hidden: {row['hidden']} ({row['law']},"
        yield f"Δχ² = {row['delta_chi2']:.0f}), answer: {row['answer'] or 'nothing'}."
        yield row["statement"]
        yield ""
        if row.get("figure"):
            yield f"![residual before and after]({folder}/{row['figure']})"
            yield ""
            if not row["same_answer"]:
                yield "(The program was changed since: this figure is of another answer.)"
                yield ""
