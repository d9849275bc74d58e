"""What `.ci/run` asks of its small campaign: the truth within five standard deviations."""

from __future__ import annotations

import sys
from pathlib import Path

import yaml

from pendpipe.files import read_json

ROOT = Path(__file__).parents[1]


def main() -> None:
    """Compare the campaign's numbers with the configuration's hidden truth."""
    folder = Path(sys.argv[1])
    summary = read_json(folder / "campaign.json")
    told = yaml.safe_load((ROOT / "config/config.yaml").read_text(encoding="utf-8"))["simulated"]
    truth = {
        "hysteretic_coefficient": told["hysteretic_coefficient_s2"],
        "theory_factor": told["drag_factor"],
        "volts_per_radian": told["sensor"]["volts_per_radian"],
    }
    for name, value in truth.items():
        number = summary[name]
        pull = (number["value"] - value) / number["sd"]
        print(
            f"{name}: {number['value']:.6g} +- {number['sd']:.2g}, truth {value}, pull {pull:+.1f}"
        )
        if abs(pull) > 5:
            sys.exit(f"{name} is {pull:.1f} standard deviations from the truth")
    refused = [entry["record"] for entry in summary["refused"]]
    if refused != ["broken"]:
        sys.exit(f"refused were {refused}, not the one broken record")


if __name__ == "__main__":
    main()
