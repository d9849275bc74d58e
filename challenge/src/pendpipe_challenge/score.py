"""Scores of an opened set, what was promised beside them, and why promises were missed.

Causes are counted from the opened truth; the reasons in words stand in `reasons.toml` and are
shown only for what happened.
"""

from __future__ import annotations

import tomllib
from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping
from importlib.resources import files
from typing import Any, Final, NamedTuple

import numpy as np

from pendpipe_challenge import intervals
from pendpipe_challenge.answers import Solved, read_items, right, six_cases
from pendpipe_challenge.intervals import Score, percent, with_interval
from pendpipe_challenge.items import WITHOUT_STRENGTH
from pendpipe_challenge.measures import (
    BANDS,
    abstention,
    alarmed,
    calibration,
    combinations,
    confident_and_wrong,
    confusion,
    dynamics_or_measurement,
    false_alarms,
    naming,
    noise_of,
    outside,
    places,
    pulls_of,
    rated,
    real,
    ties,
    true_of_any,
    withheld,
)
from pendpipe_challenge.peers import peers
from pendpipe_challenge.sets import UNRECORDED


def promises(scores: Score) -> list[dict[str, Any]]:
    """Promises with what was measured; ``kept`` is None where there was too little to judge.

    ``key`` is what `causes.EXPLAINED` knows each by.

    A miss is called a miss: but for false alarms it is the measured value that counts, and
    not the end of its interval that would flatter us.
    """
    rows = [*_detection(scores), *_naming(scores), *_confidence(scores)]
    return [
        {"key": key, "promise": promise, "measured": text, "kept": kept}
        for key, promise, text, kept in rows
    ]


PROMISED: Final = 1.3
"""By how much a size or a class may be larger than the oracle's."""

Row = tuple[str, str, str, bool | None]


def _at_most(value: float | None, limit: float) -> bool | None:
    return None if value is None else value <= limit


def _detection(scores: Score) -> Iterator[Row]:
    alarm = scores["false_alarms"]
    yield (
        "false alarms",
        "false alarms: interval contains 1 % or lies below",
        percent(alarm),
        _at_most(alarm["interval95"][0], 0.01),
    )
    largest = scores["detection"]["against_largest_score"]
    for key, label in (("half", "half"), ("nine_tenths", "nine tenths")):
        found = largest.get(key) or {}
        value = found.get("ratio")
        yield (
            label,
            f"Δχ² at which {label} are detected, over the oracle's: at most {PROMISED}",
            with_interval(value, found),
            _at_most(value, PROMISED),
        )


def _naming(scores: Score) -> Iterator[Row]:
    for band in ("50", "100"):
        found = scores["naming"][band]
        share, size = found["share_of_the_oracle"], found["class_size_ratio"]
        value = share["ratio"]
        yield (
            f"class at {band}",
            f"class accuracy at {band} over the oracle's: at least 0.9",
            with_interval(value, share),
            None if value is None else value >= 0.9,
        )
        yield (
            f"size at {band}",
            f"mean class size at {band} over the oracle's: at most {PROMISED}",
            with_interval(size["ratio"], size),
            _at_most(size["ratio"], PROMISED),
        )


def _confidence(scores: Score) -> Iterator[Row]:
    wrong = scores["outside"]["confident_wrong_names"]
    yield (
        "confident",
        "confident wrong names outside the catalogue: at most 5 %",
        percent(wrong),
        _at_most(wrong["rate"], 0.05),
    )
    found = scores["calibration"]
    error = found["expected_calibration_error"]
    text = with_interval(error, found, ".3f")
    if error is not None:
        text += f"; perfect probabilities would show {found['by_chance']:.3f}"
    promise = "expected calibration error: at most 0.05"
    yield "calibration", promise, text, _at_most(error, 0.05)


NOTHING: Final = "nothing"
_SHOWN: Final = 4
"""Culprits of one bin of the probabilities."""


class Failure(NamedTuple):
    """What was hidden, by which law, and what was answered in its place."""

    hidden: str
    law: str
    answer: str


def causes(items: list[Solved], promises: list[dict[str, Any]]) -> dict[str, Any]:
    """For each promise that was not kept: what accounts for it.

    Returns
    -------
    dict
        By the promise's key: ``promise``; ``rows`` (hidden, law, answer, how often, of how
        many, and the largest size); ``reasons`` (of what kind of failure, cause and words);
        for the probabilities ``bins``.
    """
    return {
        row["key"]: {"promise": row["promise"], **EXPLAINED[row["key"]](items)}
        for row in promises
        if row["kept"] is False
    }


def _of(items: Iterable[Solved], *families: str) -> list[Solved]:
    return [item for item in items if item.truth["family"] in families]


def _by_cause(
    failed: list[tuple[Failure, float]], asked: list[Solved], table: str
) -> dict[str, list[dict[str, Any]]]:
    """Failures by cause, the most frequent first, with how many there might have been."""
    sizes: dict[Failure, list[float]] = defaultdict(list)
    for failure, size in failed:
        sizes[failure].append(size)
    rows = [
        {
            **failure._asdict(),
            "count": len(found),
            "largest": max(found),
            "of": sum((i.effect["effect"], i.effect["law"]) == failure[:2] for i in asked),
        }
        for failure, found in sizes.items()
    ]
    rows.sort(key=lambda row: (-row["count"], -row["largest"], row["hidden"], row["law"]))
    return {"rows": rows, "reasons": _reasons(sizes, table)}


def _reasons(failures: Iterable[Failure], table: str) -> list[dict[str, str]]:
    """The reasons that are known of these failures, each once."""
    known = tomllib.loads(files("pendpipe_challenge").joinpath("reasons.toml").read_text("utf-8"))
    found: dict[str, str] = {}
    for failure in failures:
        hidden, law, answer = failure
        for key in (
            f"{hidden} ({law}) -> {answer}",
            f"{hidden} -> {answer}",
            f"{hidden} ({law})",
            hidden,
            law,
        ):
            if key in known.get(table, {}):
                found[key] = known[table][key]
                break
    return [{"of": table, "cause": key, "why": why} for key, why in sorted(found.items())]


def _failure(item: Solved) -> tuple[Failure, float]:
    answer = item.answer.lead if item.answer.detected else NOTHING
    return Failure(item.effect["effect"], item.effect["law"], answer), item.size


def _undetected(items: list[Solved]) -> dict[str, Any]:
    """Singles that the oracle sees at the same level, and the answer does not.

    ``narrowly``: how many of them the oracle itself saw by less than the promised factor.
    """
    tuned = [i for i in _of(items, "single") if i.effect["effect"] not in WITHOUT_STRENGTH]
    seen = [item for item in tuned if item.oracle.get("detected")]
    missed = [item for item in seen if not item.answer.detected]
    found = _by_cause([_failure(item) for item in missed], seen, "undetected")
    for row in found["rows"]:
        alike = [i for i in missed if _failure(i)[0] == Failure(row["hidden"], row["law"], NOTHING)]
        row["narrowly"] = sum(map(_narrow, alike))
    return found


def _narrow(item: Solved) -> bool:
    """Whether the oracle's own score was above its threshold by no more than was promised."""
    return bool(item.oracle["largest_score"] < PROMISED * item.oracle["threshold"])


def _misnamed(band: str) -> Callable[[list[Solved]], dict[str, Any]]:
    """Of one band: the oracle's class holds what was hidden, and the answer's does not."""
    low, high = BANDS[band]

    def rows(items: list[Solved]) -> dict[str, Any]:
        here = [i for i in _of(items, "single", "tie") if low <= i.size < high]
        known = [i for i in here if i.oracle.get("detected") and _holds(i.oracle["class"], i)]
        wrong = [i for i in known if not (i.answer.detected and _holds(i.answer.members, i))]
        named = _by_cause([_failure(i) for i in wrong if i.answer.detected], known, "misnamed")
        silent = _by_cause(
            [_failure(i) for i in wrong if not i.answer.detected], known, "undetected"
        )
        return {key: named[key] + silent[key] for key in named}

    return rows


def _holds(names: Iterable[str], item: Solved) -> bool:
    return any(right(name, item.effect) for name in names)


def _unspecific(band: str) -> Callable[[list[Solved]], dict[str, Any]]:
    """Of one band: classes that are larger than the oracle's."""
    low, high = BANDS[band]

    def rows(items: list[Solved]) -> dict[str, Any]:
        here = [i for i in _of(items, "single", "tie") if low <= i.size < high]
        both = [i for i in here if i.answer.detected and i.oracle.get("detected")]
        large = [i for i in both if len(i.answer.members) > len(i.oracle["class"])]
        return _by_cause([_failure(item) for item in large], both, "unspecific")

    return rows


def _confident(items: list[Solved]) -> dict[str, Any]:
    """Laws outside the catalogue that were given one of its names without doubt."""
    hidden = _of(items, "outside")
    return _by_cause([_failure(i) for i in hidden if confident_and_wrong(i)], hidden, "outside")


def _alarms(items: list[Solved]) -> dict[str, Any]:
    """Nulls that were called something, by the noise that they have."""
    nulls = [item for item in _of(items, "null") if item.answer.solved]
    failed = [(Failure(noise_of(i), "", i.answer.lead), 0.0) for i in nulls if alarmed(i)]
    found = _by_cause(failed, [], "false-alarm")
    for row in found["rows"]:
        row["of"] = sum(noise_of(item) == row["hidden"] for item in nulls)
    return found


def _uncalibrated(items: list[Solved]) -> dict[str, Any]:
    """The bins whose interval does not hold what was stated, and what fills them."""
    named = rated(_of(items, "single", "tie", "outside"))
    bins, culprits = [], []
    for row in calibration(named)["bins"]:
        if row["interval95"][0] <= row["stated"] <= row["interval95"][1]:
            continue
        low, high = row["edges"]
        inside = [i for i in named if low <= min(i.answer.probability, 1.0 - 1e-12) < high]
        overconfident = row["stated"] > row["met"]
        failures = [_failure(item) for item in inside if true_of_any(item) != overconfident]
        culprits += [failure for failure, _ in failures if overconfident]
        part = abs(row["stated"] - row["met"]) * row["of"] / len(named)
        bins.append(
            {
                **row,
                "overconfident": overconfident,
                "error": part,
                "families": _families(inside),
                "culprits": _by_cause(failures, inside, "misnamed")["rows"][:_SHOWN],
            }
        )
    reasons = {
        reason["cause"]: reason
        for table in ("outside", "misnamed")
        for reason in _reasons(culprits, table)
    }
    return {"rows": [], "reasons": list(reasons.values()), "bins": bins}


def _families(items: list[Solved]) -> dict[str, list[int]]:
    """How many of each family are right, and how many there are."""
    found: dict[str, list[int]] = {}
    for item in items:
        count = found.setdefault(item.truth["family"], [0, 0])
        count[0] += true_of_any(item)
        count[1] += 1
    return found


EXPLAINED: Final[dict[str, Callable[[list[Solved]], dict[str, Any]]]] = {
    "false alarms": _alarms,
    "half": _undetected,
    "nine tenths": _undetected,
    "class at 50": _misnamed("50"),
    "class at 100": _misnamed("100"),
    "size at 50": _unspecific("50"),
    "size at 100": _unspecific("100"),
    "confident": _confident,
    "calibration": _uncalibrated,
}
"""By a promise's key: what accounts for its being missed."""


SEALS: Final = (
    "set",
    "count",
    "sealed_at",
    "answered_at",
    "answered_by",
    "opened_at",
    "sets_before",
    "seed",
    "truth_sha256",
    "answers_sha256",
)
"""Of an opened set: which it was, and when what was known."""
OBVIOUS: Final = 30.0
"""Delta chi^2 above which an effect that was not detected is listed."""


def score(opened: dict[str, Any], interval_s: Mapping[str, float] | None = None) -> dict[str, Any]:
    """All scores of an opened set.

    Parameters
    ----------
    opened
        Truth and answers.
    interval_s
        Between the samples of each recording, where known: the truth tells the places of
        lost and wild samples by their numbers.
    """
    items = read_items(opened)

    def family(*names: str) -> list[Solved]:
        return [item for item in items if item.truth["family"] in names]

    nulls, singles = family("null"), family("single")
    named = [item for item in family("single", "tie") if item.answer.detected]
    found = {
        "set": {key: opened.get(key, UNRECORDED) for key in SEALS},
        "items": len(items),
        "families": dict(Counter(item.truth["family"] for item in items)),
        "unsolved": [item.name for item in items if not item.answer.solved],
        "false_alarms": false_alarms(nulls),
        "detection": detection(singles),
        "naming": naming(family("single", "tie")),
        "dynamics_or_measurement": dynamics_or_measurement(family("single", "tie")),
        "combinations": combinations(family("combination")),
        "outside": outside(family("outside")),
        "ties": ties(family("tie")),
        "withheld": withheld(family("withheld")),
        "real": real(family("real")),
        "pulls": pulls_of([(item.truth, item.answer) for item in singles]),
        "held_out": held_out([item for item in singles if item.answer.detected]),
        "calibration": calibration(family("single", "tie", "outside")),
        "abstention": abstention(family("single", "tie", "outside")),
        "places": places(family("single", "tie", "combination", "real"), interval_s or {}),
        "peers": peers(nulls, singles),
        "confusion": confusion(named),
        "missed": [in_words(item) for item in family("single", "withheld") if missed(item)],
        "six_cases": [in_words(item) for item in six_cases(items)],
    }
    judged = promises(found)
    return {**found, "promises": judged, "causes": causes(items, judged)}


def missed(item: Solved) -> bool:
    """An effect that anybody would have seen, and that was not."""
    return item.size > OBVIOUS and not item.answer.detected


def in_words(item: Solved) -> dict[str, Any]:
    """One item in words, for pages."""
    statement = " ".join(str(item.answer.content.get("statement") or "").split())
    return {
        "item": item.name,
        "hidden": item.effect["effect"],
        "law": item.effect["law"],
        "delta_chi2": item.size,
        "oracle_detected": bool(item.oracle.get("detected")),
        "answer": item.answer.lead,
        "statement": statement or "(no statement)",
    }


def detection(singles: list[Solved]) -> dict[str, Any]:
    """Power against Delta chi^2."""
    tuned = [item for item in singles if item.effect["effect"] not in WITHOUT_STRENGTH]
    sizes = np.array([item.size for item in tuned])
    found = np.array([float(item.answer.detected) for item in tuned])
    largest = np.array([float(item.oracle["detected"]) for item in tuned])
    own = np.array([float(item.oracle["detected_by_effect"]) for item in tuned])
    levels = []
    for low, high in (
        (0, 6),
        (6, 12),
        (12, 20),
        (20, 35),
        (35, 70),
        (70, 200),
        (200, 1e3),
        (1e3, np.inf),
    ):
        here = (sizes >= low) & (sizes < high)
        if here.any():
            levels.append(
                {
                    "delta_chi2": float(np.median(sizes[here])),
                    "solver": intervals.of((found[here] > 0).tolist()),
                    "oracle": intervals.of((largest[here] > 0).tolist()),
                    "oracle_by_effect": intervals.of((own[here] > 0).tolist()),
                }
            )
    return {
        "levels": levels,
        "against_largest_score": intervals.power_ratio(sizes, found, largest),
        "against_by_effect": intervals.power_ratio(sizes, found, own),
    }


def held_out(items: list[Solved]) -> dict[str, Any]:
    """Prediction of blocks that were not fitted, beside what knowing the effect would gain.

    Of the two halves each is predicted from the other: an effect of Delta chi^2 lambda,
    estimated from half of the record, gains half of lambda less 1 in log density.
    """
    known = []
    for item in items:
        blocks = item.answer.content.get("held_out") or {}
        if blocks.get("gain") is not None and blocks.get("gain_sd") is not None:
            known.append((item, float(blocks["gain"]), float(blocks["gain_sd"])))
    shares = [gain / (0.5 * item.size - 1.0) for item, gain, _ in known if item.size >= 50.0]
    return {
        "improved": intervals.of([gain > 0.0 for _, gain, _ in known]),
        "worse_by_two_errors": intervals.of([gain < -2.0 * sd for _, gain, sd in known]),
        "median_gain": _median([gain for _, gain, _ in known]),
        "share_of_the_expected": intervals.median(shares),
    }


def _median(values: list[float]) -> float | None:
    return float(np.median(values)) if values else None
