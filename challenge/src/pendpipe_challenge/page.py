"""The page about a scored set: what was hidden, what was found, what was missed."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from pendpipe_challenge.intervals import Score, cell, number, percent, with_interval

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
    for key, label in (
        ("against_largest_score", "largest score"),
        ("against_by_effect", "effect by effect"),
    ):
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


def rest(scores: Score) -> Iterator[str]:
    """Parameters of effects, blocks held out, and probabilities."""
    pulls, held, known = scores["pulls"], scores["held_out"], scores["calibration"]
    yield "## Parameters, prediction, probabilities"
    yield ""
    yield f"Pulls of {pulls['parameters']} parameters of rightly named effects that act by the"
    yield f"catalogue's own law: mean {_of(pulls['mean'])}, standard deviation {_of(pulls['sd'])}"
    yield f"(robust {_of(pulls['robust_sd'])}); within one error {percent(pulls['coverage68'])},"
    yield f"within the 95 % interval {percent(pulls['coverage95'])}."
    yield ""
    yield f"Held-out blocks are predicted better in {percent(held['improved'])}, worse by two"
    yield f"standard errors in {percent(held['worse_by_two_errors'])}; median gain"
    yield f"{number(held['median_gain'], '.1f')} in log density. Above Δχ² = 50 the median gain is"
    yield f"{_of(held['share_of_the_expected'])} of Δχ²/2 - 1, which knowing the effect would gain."
    yield ""
    error = with_interval(known["expected_calibration_error"], known, ".3f")
    yield f"Expected calibration error {error} over {known['items']} items; perfect probabilities"
    yield f"would show {number(known['by_chance'], '.3f')} on as many."
    yield ""
    yield from _abstention(scores)


def _abstention(scores: Score) -> Iterator[str]:
    """What keeping silent on small probabilities would gain."""
    rows = [row for row in scores["abstention"] if row["accuracy"]["rate"] is not None]
    if not rows:
        return
    shown = {row["threshold"]: row for row in rows if row["threshold"] in (0.0, 0.5, 0.8, 0.9)}
    said = [
        f"above {threshold:g} {100.0 * row['answered']['rate']:.0f} % are given and"
        f" {percent(row['accuracy'])} of them are right"
        for threshold, row in shown.items()
    ]
    yield "If first names are given only above a probability: " + "; ".join(said) + "."
    yield ""


def places(scores: Score) -> Iterator[str]:
    """Whether local effects are where the answer puts them."""
    yield "## Places"
    yield ""
    yield "Local effects that were rightly named, in any family: how often the place reported (the"
    yield "95 % interval of the instant or the frequency, the span of lost or wild samples) holds"
    yield "the true one; the median width of the place, and how far its middle is off."
    yield ""
    yield "| | true place inside | width | off by |"
    yield "|---|---|---|---|"
    for group, found in scores["places"].items():
        width, error = (f"{found[key]:.2g} {found['unit']}" for key in ("width", "error"))
        yield f"| {group} | {percent(found)} | {width} | {error} |"
    yield ""


def peers(scores: Score) -> Iterator[str]:
    """Other ways to judge the same recordings."""
    yield "## Peers"
    yield ""
    yield "AIC, BIC and the test of whiteness are flattered by the oracle's own residuals and"
    yield "scores. PySINDy has the recordings of the first nulls and singles with Eq. 8 for a"
    yield "baseline, as many as its columns count, and is told the frequency and when it stops."
    yield ""
    yield "| peer | false alarms | detected | first name right |"
    yield "|---|---|---|---|"
    for name, found in scores["peers"].items():
        if "install" in found:
            yield f"| {name} | not installed here (`{found['install']}`) | | |"
            continue
        cells = [percent(found[key]) for key in ("false_alarms", "detected", "top1")]
        yield f"| {name} | {' | '.join(cells)} |"
    yield ""


def _of(score: Score) -> str:
    return with_interval(score["value"], score)


MOST: Final = 12
"""Rows of a table; what is rarer is summed up."""
KINDS: Final = {
    "undetected": "Not detected",
    "misnamed": "Misnamed",
    "outside": "Outside the catalogue",
    "false-alarm": "False alarms",
}
"""Of failures, and how the page calls them."""


def why(scores: Score) -> Iterator[str]:
    """For each promise that was not kept: the causes by number, and what physics says of them."""
    if not scores["causes"]:
        return
    yield "## Why promises were missed"
    yield ""
    yield "Counted from the opened truth. Narrowly: the oracle's own score was above its threshold"
    yield "by less than the factor that was promised, so that chance had a part in it."
    yield ""
    before: Score = {}
    for found in scores["causes"].values():
        yield f"### {found['promise']}"
        yield ""
        if found.get("bins") is not None:
            yield from _bins(found["bins"])
        elif found["rows"] == before.get("rows"):
            yield "The same as above."
            yield ""
            continue
        else:
            yield from _rows(found["rows"])
        before = found
    yield from _reasons(scores)


def _reasons(scores: Score) -> Iterator[str]:
    """What physics says of the causes that occurred, each once."""
    if not any(each["reasons"] for each in scores["causes"].values()):
        return
    yield "### What physics says of these causes"
    yield ""
    yield "Reasons are kept in the challenge's `reasons.toml`; only those whose cause occurred are"
    yield "shown."
    yield ""
    found = {
        (reason["of"], reason["cause"]): reason["why"]
        for each in scores["causes"].values()
        for reason in each["reasons"]
    }
    for kind, words in KINDS.items():
        for (of, cause), text in sorted(found.items()):
            if of == kind:
                yield f"- {words}, **{cause}**: {text}"
    yield ""


def _rows(rows: list[Score]) -> Iterator[str]:
    """Failures by cause."""
    if not rows:
        yield "No single item accounts for it: it is the sum of small differences."
        yield ""
        return
    narrow = any("narrowly" in row for row in rows)
    heads = ["hidden", "law", "answer", "how often", "of", "largest Δχ²"]
    heads += ["narrowly"] if narrow else []
    yield f"| {' | '.join(heads)} |"
    yield "|---" * len(heads) + "|"
    for row in rows[:MOST]:
        cells = [row["hidden"], cell(row["law"]), row["said"], str(row["count"]), str(row["of"])]
        cells += [f"{row['largest']:.0f}" if row["largest"] else ""]
        cells += [str(row["narrowly"])] if narrow else []
        yield f"| {' | '.join(cells)} |"
    if len(rows) > MOST:
        rest = sum(row["count"] for row in rows[MOST:])
        yield f"| others | | | {rest} " + "| " * (len(heads) - 4) + "|"
    yield ""


def _bins(bins: list[Score]) -> Iterator[str]:
    """Stated probabilities that did not come true, and what was behind them."""
    if not bins:
        yield "No bin by itself is off by more than its interval."
        yield ""
        return
    yield "| stated | came true | of the error | families (right of all) | mostly |"
    yield "|---|---|---|---|---|"
    for row in bins:
        low, high = row["edges"]
        families = ", ".join(f"{name} {a} of {b}" for name, (a, b) in row["families"].items())
        culprits = "; ".join(
            f"{cell(each['law']) if each['hidden'].startswith('unnamed-') else each['hidden']}"
            f" → {each['said']} {each['count']}"
            for each in row["culprits"]
        )
        kind = "wrong" if row["boasts"] else "right"
        yield (
            f"| {low:.1f} to {high:.1f} | {100 * row['met']:.0f} % of {row['of']} |"
            f" {row['error']:.3f} | {families} | {kind}: {culprits} |"
        )
    yield ""
    if not any(row["boasts"] for row in bins):
        yield "More came true than was stated, in each of these: what the readings say for a name"
        yield "and against its rivals was discounted too far."
        yield ""
