"""What `.ci/run` asks of its small challenge: what chance explains is no fault.

python -m benchmarks.check_challenge results/challenge/NAME
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

from scipy.stats import binomtest

from pendpipe.files import read_json

BY_CHANCE = 0.001
"""A count so bad must come less often than this, at the promised share, to be a fault."""


def is_beyond(count: dict[str, Any], promised: float, side: str) -> bool:
    """Whether chance gives so few hits (`less`), or so many, too seldom to explain them."""
    test = count["of"] and binomtest(count["hits"], count["of"], promised, side)
    return bool(test) and test.pvalue < BY_CHANCE


def faults_of(scores: dict[str, Any]) -> list[str]:
    """Check false alarms, power and names of large effects, and that all were solved."""
    levels = [row["solver"] for row in scores["detection"]["levels"] if row["delta_chi2"] > 70]
    large = {key: sum(row[key] for row in levels) for key in ("hits", "of")}
    # What the proof promises: nine tenths are detected from 1.3 times the oracle's 45 on, and
    # nine tenths as many have the right class as the oracle's 94 %.
    asked = {
        "too many false alarms": (scores["false_alarms"], 0.01, "greater"),
        "too few large effects are detected": (large, 0.9, "less"),
        "too few are named": (scores["naming"]["all"]["class"], 0.85, "less"),
    }
    for words, (count, promised, _) in asked.items():
        print(f"{words}? {count['hits']} of {count['of']}, promised {promised}")
    faults = [words for words, each in asked.items() if is_beyond(*each)]
    if len(scores["unsolved"]) > 0.1 * scores["items"]:
        faults.append(f"without a diagnosis: {scores['unsolved']}")
    return faults


if __name__ == "__main__":
    if found := faults_of(read_json(Path(sys.argv[1]) / "scores/scores.json")):
        sys.exit("; ".join(found))
