"""Separate the hysteretic from the viscous losses of a campaign (Fig. 4, Eq. 17)."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from pendpipe.arguments import Arguments, command, load
from pendpipe.campaign.fit import coefficient, loss_torques
from pendpipe.campaign.values import WORST_LINE, Values, campaign_values
from pendpipe.configuration.load import Campaign
from pendpipe.estimate import Z95, Estimate
from pendpipe.files import write_json
from pendpipe.options import INPUT, OUTPUT, flags
from pendpipe.stages.archive import gathered
from pendpipe.stages.results import (
    RecordResult,
    campaign_data,
    left_out,
    read_results,
    surprises,
)


@command(
    flags("--campaign", required=True)
    | {
        "--out": {"type": Path, "required": True, "help": "the separation, JSON"} | OUTPUT,
        "--diagnosis": {
            "type": Path,
            "help": "campaign_diagnosis.json: says which records disagree with all others;"
            " without it they are searched for",
        }
        | INPUT,
    }
)
def run(arguments: Arguments) -> None:
    """Separate."""
    campaign = load(arguments.campaign)
    with gathered(campaign.folder, "fit.json", "calibration.json") as folder:
        results = read_results(campaign, folder)
    out = left_out(campaign, results, arguments.diagnosis)
    content = separate_campaign(campaign, results, out)
    known = surprises(arguments.diagnosis)
    for row in content["records"]:
        row["surprise"] = known.get(row["record"])
    write_json(arguments.out, content)


def separate_campaign(
    campaign: Campaign, results: Sequence[RecordResult], out: Mapping[str, str]
) -> dict[str, Any]:
    """Apply Eq. 17 to all records, with the loss torque of the joint fit; ``separation.json``.

    A campaign without records that swing in no fluid has no k, and nothing is separated; so it is
    where these contradict ``Q_h = k f^2 (I/I_0)^(1 - p)``. Records whose fitted law contradicts
    the decay (a red light) are left out, and those that disagree with all others (`out`, with the
    reasons that `compare` reports).
    """
    together = campaign_data(campaign, results, out)
    values = together and campaign_values(*together)
    content: dict[str, Any] = {
        "schema_version": 1,
        "hysteretic_coefficient": None,
        "reference_inertia": None,
        "loss_torque": None,
        "benchmark": None,
        "left_out": out,
    }
    if values:
        content["benchmark"] = _benchmark(values)
        inertia = Estimate(values.design.reference_inertia, 0.0, "kg m^2")
        content["reference_inertia"] = inertia.as_json()
    if values and is_line(values):
        content["hysteretic_coefficient"] = coefficient(values.fit).as_json() | content["benchmark"]
        content["loss_torque"] = {
            name: each.as_json() for name, each in loss_torques(values.fit).items()
        }
    usable = [result for result in results if result.usable]
    spread = common_relative_sd(usable)
    content["records"] = [
        {"record": result.record.record}
        | {name: widened(result.parameter(name), spread).as_json() for name in "ac"}
        | separated(values, result.record.record)
        for result in usable
    ]
    return content


def is_line(values: Values) -> bool:
    """Whether the benchmark is described by one k, so that a number can be made from it."""
    return not values.benchmark.p_value < WORST_LINE


def separated(values: Values | None, record: str) -> dict[str, Any]:
    """Eq. 17 of one record: Q_hys and Q_v, empty where there is no k."""
    if not values or not is_line(values):
        return {}
    names = [run.record for run in values.design.runs]
    if record not in names:
        return {}
    number = names.index(record)
    found = {"quality_factor_hysteretic": values.estimate("hysteretic_quality", number)}
    if number in values.wet:
        found["quality_factor_viscous"] = values.quality("viscous_rate", number)
    return {name: each.as_json() for name, each in found.items()}


def _benchmark(values: Values) -> dict[str, Any]:
    found = values.benchmark
    return {
        "chi2": found.chi2,
        "dof": found.degrees_of_freedom,
        "p_value": found.p_value,
        "free_exponent": found.free_exponent.as_json(),
        "exponent_p_value": found.exponent_p_value,
        "records": list(found.records),
    }


def common_relative_sd(results: list[RecordResult]) -> float:
    """Relative sd of the sensor constant that the records share; 0 where they need none."""
    shared = [
        result.calibration["volts_per_radian"]
        for result in results
        if result.calibration.get("shared")
    ]
    return float(shared[0]["sd"]) / abs(float(shared[0]["value"])) if shared else 0.0


def widened(estimate: Estimate, relative_sd: float) -> Estimate:
    """Add a relative error to an estimate's own, and to each side of its interval.

    With an angle that is volts over V/rad, a goes as V/rad and c as its inverse; b, and with it
    every quality factor, doesn't change.
    """
    added = relative_sd * abs(estimate.value)
    below, above = np.abs(np.array(estimate.bounds95) - estimate.value)
    ends = (
        estimate.value - float(np.hypot(below, Z95 * added)),
        estimate.value + float(np.hypot(above, Z95 * added)),
    )
    return replace(estimate, sd=float(np.hypot(estimate.sd, added)), interval95=ends)
