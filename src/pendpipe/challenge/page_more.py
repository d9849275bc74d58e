"""The part of the page on places, parameters, prediction, probabilities and peers."""

from __future__ import annotations

from collections.abc import Iterator

from pendpipe.challenge.wording import Score, number, percent, with_interval


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
