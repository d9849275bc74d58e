"""What was promised before anything was solved, beside what came out."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Final

from pendpipe.challenge.wording import Score, percent, with_interval


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
        "false alarms: interval contains 1 % or lies below", percent(alarm),
        _at_most(alarm["interval95"][0], 0.01),
    )  # fmt: skip
    largest = scores["detection"]["against_largest_score"]
    for key, label in (("half", "half"), ("nine_tenths", "nine tenths")):
        found = largest.get(key) or {}
        value = found.get("ratio")
        yield (
            label,
            f"Δχ² at which {label} are detected, over the oracle's: at most {PROMISED}",
            with_interval(value, found), _at_most(value, PROMISED),
        )  # fmt: skip


def _naming(scores: Score) -> Iterator[Row]:
    for band in ("50", "100"):
        found = scores["naming"][band]
        share, size = found["share_of_the_oracle"], found["class_size_ratio"]
        value = share["ratio"]
        yield (
            f"class at {band}",
            f"class accuracy at {band} over the oracle's: at least 0.9",
            with_interval(value, share), None if value is None else value >= 0.9,
        )  # fmt: skip
        yield (
            f"size at {band}",
            f"mean class size at {band} over the oracle's: at most {PROMISED}",
            with_interval(size["ratio"], size), _at_most(size["ratio"], PROMISED),
        )  # fmt: skip


def _confidence(scores: Score) -> Iterator[Row]:
    wrong = scores["outside"]["confident_wrong_names"]
    yield (
        "confident",
        "confident wrong names outside the catalogue: at most 5 %", percent(wrong),
        _at_most(wrong["rate"], 0.05),
    )  # fmt: skip
    found = scores["calibration"]
    error = found["expected_calibration_error"]
    text = with_interval(error, found, ".3f")
    if error is not None:
        text += f"; perfect probabilities would show {found['by_chance']:.3f}"
    promise = "expected calibration error: at most 0.05"
    yield "calibration", promise, text, _at_most(error, 0.05)
