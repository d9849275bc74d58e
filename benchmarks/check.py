"""What `.ci/run` asks of its small campaign and its small challenge.

python -m benchmarks.check campaign RESULTS      the truth within five standard deviations
python -m benchmarks.check challenge SET         what chance explains is no fault
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import yaml
from scipy.stats import binomtest

from benchmarks.journal import ROOT
from pendpipe.configuration.apparatus import in_tank
from pendpipe.configuration.models import Tank
from pendpipe.files import read_json

BY_CHANCE = 0.001
"""A count so bad must come less often than this, at the promised share, to be a fault."""


def campaign_faults(summary: dict[str, Any]) -> list[str]:
    """Compare the campaign's numbers with the configuration's hidden truth."""
    told = yaml.safe_load((ROOT / "config/config.yaml").read_text(encoding="utf-8"))["simulated"]
    truth = {
        "hysteretic_coefficient": told["hysteretic_coefficient_s2"],
        # At the paper's record, whose layer is 0.79 mm thick.
        "theory_factor": told["drag_factor"]
        * in_tank(Tank.model_validate(told["tank"]), 0.019, 7.9e-4).drag_factor,
        "volts_per_radian": told["sensor"]["volts_per_radian"],
    }
    off = {name: (summary[name]["value"] - truth[name]) / summary[name]["sd"] for name in truth}
    print("in standard deviations from the truth:", {key: f"{x:+.1f}" for key, x in off.items()})
    refused = [entry["record"] for entry in summary["refused"]]
    faults = [f"{name} is off by {pull:.1f} sd" for name, pull in off.items() if abs(pull) > 5]
    return faults + [f"refused, not the one broken record: {refused}"] * (refused != ["broken"])


def challenge_faults(scores: dict[str, Any]) -> list[str]:
    """Check false alarms, power and names of large effects, and that all were solved."""
    levels = [row["solver"] for row in scores["detection"]["levels"] if row["delta_chi2"] > 70]
    large = {key: sum(row[key] for row in levels) for key in ("hits", "of")}
    # What the proof promises: nine tenths are detected from 1.3 times the oracle's 45 on, and
    # nine tenths as many have the right class as the oracle's 94 %.
    asked = (
        ("too many false alarms", scores["false_alarms"], 0.01, "greater"),
        ("too few large effects are detected", large, 0.9, "less"),
        ("too few are named", scores["naming"]["all"]["class"], 0.85, "less"),
    )
    faults = []
    for words, count, promised, side in asked:
        print(f"{words}? {count['hits']} of {count['of']}, promised {promised}")
        of = count["of"]
        if of and binomtest(count["hits"], of, promised, side).pvalue < BY_CHANCE:
            faults.append(words)
    unsolved = scores["unsolved"]
    return faults + [f"without a diagnosis: {unsolved}"] * (len(unsolved) > 0.1 * scores["items"])


if __name__ == "__main__":
    what, folder = sys.argv[1:]
    made = Path(folder) / ("campaign.json" if what == "campaign" else "scores/scores.json")
    faults = campaign_faults if what == "campaign" else challenge_faults
    sys.exit("; ".join(faults(read_json(made))) or None)
