"""The page about a scored set: what was hidden, what was found, what was missed."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from pendpipe.challenge.draw import six_cases
from pendpipe.challenge.solved import read_items

Score = dict[str, Any]


def percent(score: Score | None) -> str:
    """A rate as hits of count, with its 95 % interval."""
    if not score or score.get("rate") is None:
        return "none to judge"
    low, high = score["interval95"]
    return (
        f"{100 * score['rate']:.1f} % ({score['hits']} of {score['of']};"
        f" {100 * low:.1f} to {100 * high:.1f} %)"
    )


def number(value: float | None, form: str = ".2f") -> str:
    """A number or a dash."""
    return "-" if value is None else format(value, form)


def page(opened: Score, scores: Score, figures: list[str], folder: str) -> str:
    """Write the page as Markdown.

    Parameters
    ----------
    opened, scores
        The opened set and its scores.
    figures, folder
        Names of the drawn figures, and where they lie beside the page.
    """
    parts = [_head(opened, scores), _promises(scores), _rules(), _detection(scores)]
    parts += [_naming(scores)]
    parts += [_families(scores), _rest(scores), _missed(opened), _cases(opened)]
    lines = [line for part in parts for line in part]
    lines += ["## Figures", ""]
    lines += [f"![{name.removesuffix('.svg')}]({folder}/{name})" for name in figures]
    return "\n".join(lines) + "\n"


def _head(opened: Score, scores: Score) -> Iterator[str]:
    yield "# Proof: concealed effects"
    yield ""
    yield "Written by `pendpipe challenge score`; nothing here is edited by hand. A generator that"
    yield "shares no code with the diagnosis made the recordings, the truth was sealed, the"
    yield "released `pendpipe diagnose` solved them one by one in processes that saw one recording"
    yield "and no more, its answers were hashed, and only then was the truth opened, once."
    yield ""
    yield "A fresh set from a seed drawn at run time:"
    yield ""
    yield "    PENDPIPE_CHALLENGE_SET=fresh snakemake --cores 2 challenge"
    yield ""
    yield "| | |"
    yield "|---|---|"
    for key in ("set", "count", "sealed_at", "answered_at", "opened_at", "seed", "truth_sha256",
                "answers_sha256"):  # fmt: skip
        yield f"| {key.replace('_', ' ')} | {opened[key]} |"
    families = ", ".join(f"{count} {name}" for name, count in sorted(scores["families"].items()))
    yield f"| families | {families} |"
    yield f"| without a diagnosis | {len(scores['unsolved'])} |"
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
    at50, at100 = scores["naming"]["50"], scores["naming"]["100"]
    largest = scores["detection"]["against_largest_score"]
    alarm = scores["false_alarms"]
    rows: list[tuple[str, str, bool | None]] = []
    low = alarm["interval95"][0]
    rows.append(("false alarms: interval contains 1 % or lies below", percent(alarm),
                 None if low is None else low <= 0.01))  # fmt: skip
    for key, label in (("half", "a half"), ("nine_tenths", "nine tenths")):
        found = largest.get(key)
        text = "too few items"
        if found:
            text = f"{found['ratio']:.2f} ({found['interval95'][0]:.2f} to"
            text += f" {found['interval95'][1]:.2f})"
        rows.append((f"Δχ² at which {label} is detected, over the oracle's: at most 1.3", text,
                     found["ratio"] <= 1.3 if found else None))  # fmt: skip
    for name, band in (("50", at50), ("100", at100)):
        share = band["share_of_the_oracle"]
        rows.append((f"class accuracy at {name} over the oracle's: at least 0.9", number(share),
                     None if share is None else share >= 0.9))  # fmt: skip
        own, best = band["class_size"], band["oracle_class_size"]
        ratio = own / best if own and best else None
        rows.append((f"mean class size at {name} over the oracle's: at most 1.3", number(ratio),
                     None if ratio is None else ratio <= 1.3))  # fmt: skip
    wrong = scores["outside"]["confident_wrong_names"]
    rows.append(("confident wrong names outside the catalogue: at most 5 %", percent(wrong),
                 None if wrong["rate"] is None else wrong["rate"] <= 0.05))  # fmt: skip
    error = scores["calibration"]["expected_calibration_error"]
    rows.append(("expected calibration error: at most 0.05", number(error, ".3f"), error <= 0.05))
    yield "## What was promised"
    yield ""
    yield "| promise | measured | kept |"
    yield "|---|---|---|"
    for promise, measured, kept in rows:
        yield f"| {promise} | {measured} | {'-' if kept is None else 'yes' if kept else '**no**'} |"
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
        if "half" in found:
            half, most = found["half"], found["nine_tenths"]
            yield (
                f"Half are found at {half['found']:.1f} (oracle, {label}: {half['oracle']:.1f}),"
                f" nine tenths at {most['found']:.1f} ({most['oracle']:.1f})."
            )
            yield ""
    alarm = scores["false_alarms"]
    yield f"False alarms on nulls: {percent(alarm)}; the oracle's own: {percent(alarm['oracle'])}."
    yield f"On heavy-tailed noise {percent(alarm['heavy_tailed'])}; with a stop"
    yield f"{percent(alarm['stopped'])}. Names given: {alarm['named'] or 'none'}. Red noise rightly"
    yield f"called coloured (no false alarm): {alarm['rightly_called_coloured']}."
    yield ""


def _naming(scores: Score) -> Iterator[str]:
    yield "## Naming"
    yield ""
    yield "| Δχ² | | first | among three | in class | class size |"
    yield "|---|---|---|---|---|---|"
    for band, found in scores["naming"].items():
        for who, prefix in (("diagnose", ""), ("oracle", "oracle_")):
            cells = [percent(found[f"{prefix}{key}"]) for key in ("top1", "top3", "class")]
            size = number(found[f"{prefix}class_size"])
            yield f"| {band} | {who} | {' | '.join(cells)} | {size} |"
    yield ""
    yield f"Dynamics or measurement, rightly told: {percent(scores['dynamics_or_measurement'])}."
    yield ""


def _families(scores: Score) -> Iterator[str]:
    yield "## The other families"
    yield ""
    for family in ("combinations", "ties", "outside", "withheld", "real"):
        yield f"**{family}**"
        yield ""
        for key, value in scores[family].items():
            label = key.replace("_", " ")
            if isinstance(value, dict) and "rate" in value:
                yield f"- {label}: {percent(value)}"
            elif key == "named":
                yield f"- first names: {value}"
        yield ""
    if scores["real"]["by_change"]:
        yield "| real recording | concealed | named | named without it |"
        yield "|---|---|---|---|"
        for entry in scores["real"]["by_change"].values():
            told = ["yes" if entry[key] else "no" for key in ("named", "twin_named")]
            yield f"| {entry['source']} | {entry['effect']} | {told[0]} | {told[1]} |"
        yield ""


def _rest(scores: Score) -> Iterator[str]:
    pulls, held = scores["pulls"], scores["held_out"]
    yield "## Parameters, prediction, probabilities, peers"
    yield ""
    yield (
        f"Pulls of {pulls['parameters']} parameters of rightly named effects: mean"
        f" {number(pulls['mean'])}, sd {number(pulls['sd'])} (robust"
        f" {number(pulls['robust_sd'])}); nominal 95 % intervals cover"
        f" {percent(pulls['coverage95'])}."
    )
    yield ""
    yield (
        f"Held-out blocks are predicted better in {percent(held['improved'])}, worse by two"
        f" standard errors in {percent(held['worse_by_two_errors'])}; median gain"
        f" {number(held['median_gain'], '.1f')}."
    )
    yield ""
    yield (
        f"Expected calibration error {scores['calibration']['expected_calibration_error']:.3f}"
        f" over {scores['calibration']['items']} items."
    )
    yield ""
    yield "Peers, flattered by the oracle's own residuals and scores:"
    yield ""
    yield "| peer | false alarms | detected | first name right |"
    yield "|---|---|---|---|"
    for name, found in scores["peers"].items():
        cells = [percent(found[key]) for key in ("false_alarms", "detected", "top1")]
        yield f"| {name} | {' | '.join(cells)} |"
    yield ""


def _missed(opened: Score) -> Iterator[str]:
    items = read_items(opened)
    missed = [
        i for i in items
        if i.truth["family"] in ("single", "withheld") and not i.answer.detected
        and i.size > 30.0
    ]  # fmt: skip
    yield "## What was missed"
    yield ""
    yield "Singles above Δχ² = 30 that were not detected:"
    yield ""
    yield "| item | hidden | law | Δχ² | oracle detected |"
    yield "|---|---|---|---|---|"
    for i in missed:
        seen = "yes" if i.oracle.get("detected") else "no"
        yield f"| {i.name} | {i.effect['effect']} | {i.effect['law']} | {i.size:.0f} | {seen} |"
    yield ""


def _cases(opened: Score) -> Iterator[str]:
    yield "## Six cases"
    yield ""
    yield "By rule: of each of six kinds of effect, the first single in the set above Δχ² = 70."
    yield ""
    for item in six_cases(read_items(opened)):
        content = item.answer.content
        statement = " ".join(str(content.get("statement") or "(no statement)").split())
        yield f"**{item.name}**, hidden: {item.effect['effect']} ({item.effect['law']},"
        yield f"Δχ² = {item.size:.0f}), answer: {item.answer.lead or 'nothing'}. {statement}"
        yield ""
