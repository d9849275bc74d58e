"""What `.ci/run` asks of its small challenge: wide bounds, since forty items tell little.

python -m benchmarks.check_challenge results/challenge/NAME
"""

from __future__ import annotations

import sys
from pathlib import Path

from pendpipe.files import read_json


def main() -> None:
    """Check false alarms, power and names of large effects, and that all were solved."""
    folder = Path(sys.argv[1])
    scores = read_json(folder / "scores/scores.json")
    alarms, faults = scores["false_alarms"], []
    print(f"false alarms {alarms['hits']} of {alarms['of']}")
    # With an honest 1 % three or more of some fourteen come once in three thousand sets.
    if alarms["hits"] > 2:
        faults.append("too many false alarms")
    if len(scores["unsolved"]) > 0.1 * scores["items"]:
        faults.append(f"without a diagnosis: {scores['unsolved']}")
    large = [level for level in scores["detection"]["levels"] if level["delta_chi2"] > 70]
    hits = sum(level["solver"]["hits"] for level in large)
    count = sum(level["solver"]["of"] for level in large)
    print(f"detected above a Delta chi^2 of 70: {hits} of {count}")
    if count and hits < 0.6 * count:
        faults.append("too few large effects are detected")
    named = scores["naming"]["all"]["class"]
    print(f"in the class named, of the detected: {named['hits']} of {named['of']}")
    if named["of"] and named["hits"] < 0.5 * named["of"]:
        faults.append("too few are named")
    if faults:
        sys.exit("; ".join(faults))


if __name__ == "__main__":
    main()
