"""Separate the hysteretic from the viscous losses of a campaign (Fig. 4, Eq. 17)."""

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final

from pendpipe.analysis.separate import (
    MeasuredRecord,
    SeparatedRecord,
    fit_benchmark,
    separate,
)
from pendpipe.arguments import OUTPUT, Arguments, load, shared
from pendpipe.campaign.fit import InertiaSds, inertia_sds
from pendpipe.configuration.load import Campaign
from pendpipe.estimate import Estimate
from pendpipe.files import read_json, write_json
from pendpipe.manifest import job
from pendpipe.stages.results import (
    RecordResult,
    campaign_data,
    read_results,
    record_files,
    record_theory,
)

ARGUMENTS: Final = shared("--campaign", required=True) | {
    "--out": {"type": Path, "required": True, "help": "the separation, JSON"} | OUTPUT
}


def run(arguments: Arguments) -> None:
    """Separate."""
    campaign = load(arguments.campaign)
    inputs = record_files(campaign, "fit.json", "calibration.json")
    with job(campaign.folder, "separate", inputs=inputs, outputs=[arguments.out]):
        separate_campaign(campaign, arguments.out)


@dataclass(frozen=True)
class Separation:
    """What the stage leaves: k of Q_hys = k f^2 with its test, and the separated records."""

    benchmark: dict[str, Any] | None
    records: list[SeparatedRecord]


def separate_campaign(campaign: Campaign, out: Path) -> None:
    """Fit k to the records in air and apply Eq. 17 to all; write ``separation.json``.

    A campaign without records of the branch ``air`` has no k: nothing is separated. Records whose
    fitted law contradicts the decay (a red light) are left out; `compare` reports the reason.
    """
    results = [result for result in read_results(campaign) if result.usable]
    together = campaign_data(campaign, results)
    spread = {} if together is None else inertia_sds(together[0])
    measured = [_measured(campaign, result, spread) for result in results]
    air = [record for record in measured if record.branch == "air"]
    if not air:
        write_json(out, {"schema_version": 1, "hysteretic_coefficient": None, "records": []})
        return
    benchmark = fit_benchmark(air)
    separated = separate(measured, benchmark, calibration_relative_sd=common_relative_sd(results))
    write_json(
        out,
        {
            "schema_version": 1,
            # In the form of campaign.json, with the tests of the line.
            "hysteretic_coefficient": benchmark.coefficient.as_json()
            | {
                "inverse": benchmark.inverse,
                "inverse_sd": benchmark.inverse_sd,
                "chi2": benchmark.chi2,
                "dof": benchmark.degrees_of_freedom,
                "p_value": benchmark.p_value,
                "free_exponent": benchmark.free_exponent.as_json(),
                "exponent_p_value": benchmark.exponent_p_value,
                "records": list(benchmark.records),
            },
            "records": [asdict(record) for record in separated],
        },
    )


def read_separation(path: Path) -> Separation:
    """Read ``separation.json`` back."""
    content = read_json(path)
    return Separation(
        content["hysteretic_coefficient"], [_separated(entry) for entry in content["records"]]
    )


def common_relative_sd(results: list[RecordResult]) -> float:
    """Relative sd of the sensor constant that the records share; 0 where they need none."""
    shared = [
        result.calibration["volts_per_radian"]
        for result in results
        if result.calibration.get("from") == "the caliper run"
    ]
    return float(shared[0]["sd"]) / abs(float(shared[0]["value"])) if shared else 0.0


def _measured(
    campaign: Campaign, result: RecordResult, spread: dict[str, InertiaSds]
) -> MeasuredRecord:
    row = result.record
    theory = record_theory(campaign, row)
    inertia = None
    if theory is not None:
        value = theory["moment_of_inertia_kg_m2"]
        # What the records share of it is in the comparison's budget.
        own = spread[row.record].own if row.record in spread else 0.0
        inertia = Estimate(value, value * own, "kg m^2")
    return MeasuredRecord(
        record=row.record,
        fluid=row.fluid,
        branch=row.branch,
        frequency=result.parameter("frequency"),
        quadratic=result.parameter("a"),
        linear=result.parameter("b"),
        coulomb=result.parameter("c"),
        moment_of_inertia=inertia,
    )


def _separated(content: dict[str, Any]) -> SeparatedRecord:
    """Read a separated record back from its JSON."""

    def fields(entries: dict[str, Any]) -> dict[str, Any]:
        return {
            name: Estimate.from_json(entry) if isinstance(entry, dict) else entry
            for name, entry in entries.items()
        }

    measured = MeasuredRecord(**fields(content.pop("measured")))
    return SeparatedRecord(measured=measured, **fields(content))
