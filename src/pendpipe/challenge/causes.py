"""Why promises were missed: which hidden effects account for it, and what physics says of them.

Everything is counted from the opened truth; the reasons in words stand in `reasons.toml` and
are shown only for what happened.
"""

from __future__ import annotations

import tomllib
from collections import defaultdict
from collections.abc import Callable, Iterable
from importlib.resources import files
from typing import Any, Final, NamedTuple

from pendpipe.challenge.answers import right
from pendpipe.challenge.families import WITHOUT_STRENGTH
from pendpipe.challenge.promises import PROMISED
from pendpipe.challenge.score_confidence import calibration, rated, true_of_any
from pendpipe.challenge.score_families import confident_and_wrong
from pendpipe.challenge.score_naming import BANDS
from pendpipe.challenge.score_nulls import alarmed, noise_of
from pendpipe.challenge.solved import Solved

NOTHING: Final = "nothing"
_SHOWN: Final = 4
"""Culprits of one bin of the probabilities."""


class Failure(NamedTuple):
    """What was hidden, by which law, and what the answer said in its place."""

    hidden: str
    law: str
    said: str


def causes(items: list[Solved], promises: list[dict[str, Any]]) -> dict[str, Any]:
    """For each promise that was not kept: what accounts for it.

    Returns
    -------
    dict
        By the promise's key: ``promise``; ``rows`` (hidden, law, said, how often, of how
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


def _told(
    failed: list[tuple[Failure, float]], asked: list[Solved], table: str
) -> dict[str, list[dict[str, Any]]]:
    """Failures by cause, the most frequent first, with how many there might have been."""
    sizes: dict[Failure, list[float]] = defaultdict(list)
    for failure, size in failed:
        sizes[failure].append(size)
    rows = [
        {**failure._asdict(), "count": len(found), "largest": max(found),
         "of": sum((i.effect["effect"], i.effect["law"]) == failure[:2] for i in asked)}
        for failure, found in sizes.items()
    ]  # fmt: skip
    rows.sort(key=lambda row: (-row["count"], -row["largest"], row["hidden"], row["law"]))
    return {"rows": rows, "reasons": _reasons(sizes, table)}


def _reasons(failures: Iterable[Failure], table: str) -> list[dict[str, str]]:
    """The reasons that are known of these failures, each once."""
    known = tomllib.loads(files("pendpipe.challenge").joinpath("reasons.toml").read_text("utf-8"))
    found: dict[str, str] = {}
    for failure in failures:
        hidden, law, said = failure
        for key in (f"{hidden} ({law}) -> {said}", f"{hidden} -> {said}", f"{hidden} ({law})",
                    hidden, law):  # fmt: skip
            if key in known.get(table, {}):
                found[key] = known[table][key]
                break
    return [{"of": table, "cause": key, "why": why} for key, why in sorted(found.items())]


def _failure(item: Solved) -> tuple[Failure, float]:
    said = item.answer.lead if item.answer.detected else NOTHING
    return Failure(item.effect["effect"], item.effect["law"], said), item.size


def _undetected(items: list[Solved]) -> dict[str, Any]:
    """Singles that the oracle sees at the same level, and the answer does not.

    ``narrowly``: how many of them the oracle itself saw by less than the promised factor.
    """
    tuned = [i for i in _of(items, "single") if i.effect["effect"] not in WITHOUT_STRENGTH]
    seen = [item for item in tuned if item.oracle.get("detected")]
    missed = [item for item in seen if not item.answer.detected]
    told = _told([_failure(item) for item in missed], seen, "undetected")
    for row in told["rows"]:
        alike = [i for i in missed if _failure(i)[0] == Failure(row["hidden"], row["law"], NOTHING)]
        row["narrowly"] = sum(map(_narrow, alike))
    return told


def _narrow(item: Solved) -> bool:
    """Whether the oracle's own score was above its threshold by no more than was promised."""
    return bool(item.oracle["largest_score"] < PROMISED * item.oracle["threshold"])


def _misnamed(band: str) -> Callable[[list[Solved]], dict[str, Any]]:
    """Of one band: the oracle's class holds what was hidden, and the answer's does not."""
    low, high = BANDS[band]

    def rows(items: list[Solved]) -> dict[str, Any]:
        here = [i for i in _of(items, "single", "tie") if low <= i.size < high]
        told = [i for i in here if i.oracle.get("detected") and _holds(i.oracle["class"], i)]
        wrong = [i for i in told if not (i.answer.detected and _holds(i.answer.members, i))]
        named = _told([_failure(i) for i in wrong if i.answer.detected], told, "misnamed")
        silent = _told([_failure(i) for i in wrong if not i.answer.detected], told, "undetected")
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
        return _told([_failure(item) for item in large], both, "unspecific")

    return rows


def _confident(items: list[Solved]) -> dict[str, Any]:
    """Laws outside the catalogue that were given one of its names without doubt."""
    hidden = _of(items, "outside")
    return _told([_failure(i) for i in hidden if confident_and_wrong(i)], hidden, "outside")


def _alarms(items: list[Solved]) -> dict[str, Any]:
    """Nulls that were called something, by the noise that they have."""
    nulls = [item for item in _of(items, "null") if item.answer.solved]
    failed = [(Failure(noise_of(i), "", i.answer.lead), 0.0) for i in nulls if alarmed(i)]
    told = _told(failed, [], "false-alarm")
    for row in told["rows"]:
        row["of"] = sum(noise_of(item) == row["hidden"] for item in nulls)
    return told


def _uncalibrated(items: list[Solved]) -> dict[str, Any]:
    """The bins whose interval does not hold what was stated, and what fills them."""
    told = rated(_of(items, "single", "tie", "outside"))
    bins, culprits = [], []
    for row in calibration(told)["bins"]:
        if row["interval95"][0] <= row["stated"] <= row["interval95"][1]:
            continue
        low, high = row["edges"]
        inside = [i for i in told if low <= min(i.answer.probability, 1.0 - 1e-12) < high]
        boasts = row["stated"] > row["met"]
        guilty = [_failure(item) for item in inside if true_of_any(item) != boasts]
        culprits += [failure for failure, _ in guilty if boasts]
        part = abs(row["stated"] - row["met"]) * row["of"] / len(told)
        bins.append(
            {**row, "boasts": boasts, "error": part, "families": _families(inside),
             "culprits": _told(guilty, inside, "misnamed")["rows"][:_SHOWN]}
        )  # fmt: skip
    reasons = {
        reason["cause"]: reason
        for table in ("outside", "misnamed") for reason in _reasons(culprits, table)
    }  # fmt: skip
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
