"""Compare a campaign's losses with Eq. 16, and sum the campaign up in numbers."""

from importlib.metadata import version
from pathlib import Path
from typing import Any, Final

import numpy as np

from pendpipe.analysis.compare import amplitude_misfit, tail_fits
from pendpipe.analysis.turning_points import read_turning_points
from pendpipe.arguments import Arguments, command, load
from pendpipe.campaign.design import design_of
from pendpipe.campaign.fit import InertiaSds, inertia_sds, joint_values
from pendpipe.campaign.values import Line, Values, campaign_values
from pendpipe.configuration.load import Campaign
from pendpipe.estimate import Estimate
from pendpipe.files import digest, read_json, write_json, writing
from pendpipe.options import INPUT, OUTPUT, flags
from pendpipe.physics import inertia_from_frequency
from pendpipe.provenance import code_version
from pendpipe.stages.archive import gathered
from pendpipe.stages.results import (
    RecordResult,
    branch_curves,
    campaign_data,
    enough,
    read_results,
    record_theory,
    twins,
)
from pendpipe.stages.separate import is_line
from pendpipe.version import __version__


@command(
    flags("--campaign", required=True)
    | {
        "--separation": {"type": Path, "required": True, "help": "the stage before's JSON"} | INPUT,
        "--out": {"type": Path, "required": True, "help": "the comparison, JSON"} | OUTPUT,
        "--summary": {"type": Path, "required": True, "help": "campaign.json"} | OUTPUT,
    }
)
def run(arguments: Arguments) -> None:
    """Compare."""
    campaign = load(arguments.campaign)
    names = ("fit.json", "calibration.json", "turning_points.csv")
    with writing(inputs=[arguments.separation]), gathered(campaign.folder, *names) as folder:
        content = compare_campaign(campaign, folder, read_json(arguments.separation))
        write_json(arguments.out, content)
        write_json(arguments.summary, campaign_summary(content))


def compare_campaign(campaign: Campaign, folder: Path, separated: dict[str, Any]) -> dict[str, Any]:
    """Compare the losses of the records, whose results are in `folder`, with Eq. 16."""
    results = read_results(campaign, folder)
    together = campaign_data(campaign, results, separated["left_out"])
    # Of all that were built, also those that nothing of the campaign is made from.
    built = [
        each.record
        for each in results
        if each.fit and each.record.fluid and campaign.geometry(each.record)
    ]
    told = built and campaign.configuration.apparatus
    spread = inertia_sds(design_of(campaign, built)) if told else {}
    values = together and campaign_values(*together)
    found = values if values and values.wet and is_line(values) else None
    split = {entry["record"]: entry for entry in separated["records"]}
    joint = joint_values(*together) if together and enough(together[0]) else None
    settings = campaign.configuration
    excluded = {
        name: f"{name} is the same recording as {first}" for name, first in twins(results).items()
    } | separated["left_out"]
    return {
        "schema_version": 1,
        "title": settings.title,
        "typical_record": settings.typical_record,
        "has_theory": settings.apparatus is not None,
        "records": [
            _record(
                campaign, folder, result, split, found, spread.get(result.record.record), excluded
            )
            for result in results
        ],
        "curves": _curves(campaign, separated["hysteretic_coefficient"]),
        **{
            name: separated[name]
            for name in (
                *("hysteretic_coefficient", "reference_inertia", "loss_torque", "benchmark"),
                "left_out",
            )
        },
        "drag_factor": joint and joint["with_benchmark"]["drag_factor"],
        **_campaign_numbers(found),
        "joint": joint,
        # The trap of tail fits, on the typical record.
        "tail": [
            fit
            for result in results
            if result.record.record == settings.typical_record and result.refused is None
            for fit in tail_fits(
                read_turning_points(folder / result.record.record / "turning_points.csv")
            )
        ],
        "calibration": read_json(campaign.sensor) if campaign.sensor else None,
        "provenance": {
            "version": __version__,
            "code": code_version(),
            "configuration": digest(settings.model_dump(exclude={"results", "records", "batch"})),
            "seed": settings.seed,
            "packages": {name: version(name) for name in PACKAGES},
        },
    }


_OF_A_FIT: Final = (
    "quality_factor_limit",
    "method",
    "noise_rms_rad",
    "residual_rms_rad",
    "chi2_per_dof",
    "samples",
    "turning_points",
    "cuts",
    "light",
    "light_reason",
)
"""What is taken over from fit.json as it stands."""


def _record(
    campaign: Campaign,
    folder: Path,
    result: RecordResult,
    split: dict[str, dict[str, Any]],
    found: Values | None,
    spread: InertiaSds | None,
    reasons: dict[str, str],
) -> dict[str, Any]:
    """Everything that is known of one record."""
    row = result.record
    content: dict[str, Any] = {
        "record": row.record,
        "source": campaign.shown_sources[row.record],
        "fluid": row.fluid,
        "branch": row.branch,
        "geometry": row.geometry,
        "temperature_c": row.temperature_c,
        "refused": result.refused,
    }
    if result.fit is None:
        return content
    fit = result.fit.to_dict()
    excluded = [] if result.usable else [f"not separated: {fit['light_reason']}"]
    excluded += [reasons[row.record]] if row.record in reasons else []
    points = read_turning_points(folder / row.record / "turning_points.csv")
    content |= {
        **fit["parameters"],
        **{name: fit[name] for name in _OF_A_FIT},
        "input_sha256": fit["provenance"].get("input_sha256"),
        "warnings": [*excluded, *fit["warnings"], *result.calibration["warnings"]],
        "volts_per_radian": result.calibration["volts_per_radian"],
        "start_s": float(points.time_s[0]),
        "stop_s": float(points.time_s[-1]),
        "misfit": amplitude_misfit(points),
        # The losses after Eq. 17, with the errors of the calibration and of the loss torque.
        **split.get(row.record, {}),
    }
    return content | _theory(campaign, result, found, spread)


def _theory(
    campaign: Campaign,
    result: RecordResult,
    found: Values | None,
    spread: InertiaSds | None,
) -> dict[str, Any]:
    """Inertia in two ways, Eq. 16 and its neighbours."""
    theory = record_theory(campaign, result.record)
    if theory is None:
        return {}
    torque = theory["restoring_torque_n_m_per_rad"]
    frequency = result.parameter("frequency")
    known = theory["moment_of_inertia_kg_m2"]
    inertia = float(inertia_from_frequency(frequency.value, torque))
    spread = spread or InertiaSds(0.0, 0.0)
    relative = np.hypot(2.0 * frequency.sd / frequency.value, spread.from_frequency)
    content: dict[str, Any] = {
        "moment_of_inertia": Estimate(known, known * spread.from_distances, "kg m^2").as_json(),
        "moment_of_inertia_from_frequency": Estimate(
            inertia, inertia * float(relative), "kg m^2"
        ).as_json(),
        "frequency_theory_hz": theory["frequency_hz"],
    }
    if "a_over_delta" not in theory:
        return content
    content |= {name: theory[name] for name in ("a_over_delta", "lengthening")}
    if found is None or result.record.record not in found.records:
        return content
    number = [run.record for run in found.design.runs].index(result.record.record)
    limit = found.quality("limit_theory_rate", number)
    return content | {
        "quality_factor_viscous_theory": found.quality("theory_rate", number).as_json(),
        "quality_factor_viscous_steady": found.quality("steady_rate", number).value,
        "quality_factor_limit_theory": limit.value,
        "quality_factor_limit_theory_sd": limit.sd,
        "drag_over_theory": float(found.quantities["factor"][number]),
    }


def _curves(campaign: Campaign, coefficient: dict[str, Any] | None) -> dict[str, Any]:
    """Theory along each branch, with the hysteresis where k is known."""
    curves: dict[str, Any] = {}
    for branch in dict.fromkeys(record.branch for record in campaign.records if record.branch):
        curve = branch_curves(campaign, branch)
        if curve is None:
            continue
        if coefficient is not None and campaign.configuration.apparatus is not None:
            law = campaign.configuration.apparatus.hysteresis
            viscous, frequency, inertia = (
                np.array(curve[name])
                for name in (
                    "quality_factor_viscous_theory",
                    "frequency_hz",
                    "moment_of_inertia_kg_m2",
                )
            )
            relative = inertia / law.reference_inertia_kg_m2
            hysteretic = coefficient["value"] * frequency**2
            hysteretic = hysteretic * relative ** (1.0 - law.inertia_exponent)
            curve["quality_factor_limit_theory"] = (1 / (1 / viscous + 1 / hysteretic)).tolist()
        curves[branch] = curve
    return curves


def _campaign_numbers(found: Values | None) -> dict[str, Any]:
    """The numbers that describe the whole campaign."""
    names = ("viscous_exponents", "theory_factor", "history_coefficient", "checks", "budget")
    if found is None:
        return dict.fromkeys((*names, "theory_factor_in_tank", "walls", "steady_stokes_percent"))
    # Of Eq. 2 over Eq. 1, less 1: the paper compares theory with theory.
    excess = 100.0 * (found.quantities["theory_over_steady"][found.wet] - 1.0)
    in_tank = found.theory_factor_in_tank
    return {
        "viscous_exponents": {
            branch: {
                **fitted.exponent.as_json(),
                "sd_own": fitted.sd_own,
                "sd_common": fitted.sd_common,
                "curvature": fitted.curvature.as_json(),
                "local_slopes": list(fitted.local_slopes),
                "records": list(fitted.records),
            }
            for branch, fitted in found.exponents.items()
        },
        "theory_factor": _flags(found.theory_factor),
        "theory_factor_in_tank": in_tank and in_tank.as_json(),
        "walls": found.walls,
        "history_coefficient": _flags(found.history_coefficient),
        "checks": found.checks(),
        "budget": [
            {"source": name, "relative_sd": sd} for name, sd in found.theory_factor.budget.items()
        ],
        "steady_stokes_percent": [float(np.min(excess)), float(np.max(excess))],
    }


def _flags(number: Line) -> dict[str, Any]:
    return {
        **number.estimate.as_json(),
        "sd_own": number.sd_own,
        "sd_common": number.sd_common,
        "chi2": number.chi2,
        "dof": number.degrees_of_freedom,
        "p_value": number.p_value,
    }


NUMBERS: Final = (
    "frequency",
    "moment_of_inertia",
    "a",
    "b",
    "c",
    "quality_factor_limit",
    "quality_factor_hysteretic",
    "quality_factor_viscous",
    "quality_factor_viscous_theory",
)


def campaign_summary(comparison: dict[str, Any]) -> dict[str, Any]:
    """Take the contract's numbers out of the comparison; each has value, sd and unit."""
    exponents = comparison["viscous_exponents"] or {}
    calibration = comparison["calibration"]
    return {
        "schema_version": 1,
        "hysteretic_coefficient": _number(comparison["hysteretic_coefficient"]),
        "reference_inertia": _number(comparison["reference_inertia"]),
        "loss_torque": comparison["loss_torque"],
        "drag_factor": _number(comparison["drag_factor"]),
        "viscous_exponents": {branch: _number(exponents.get(branch)) for branch in ("low", "high")},
        "theory_factor": _number(comparison["theory_factor"]),
        "theory_factor_in_tank": _number(comparison["theory_factor_in_tank"]),
        "history_coefficient": _number(comparison["history_coefficient"]),
        "volts_per_radian": _number(calibration and calibration["volts_per_radian"]),
        "joint": comparison["joint"],
        "left_out": comparison["left_out"],
        "records": [
            {name: record[name] for name in ("record", "fluid", "branch")}
            | {name: _number(record.get(name)) for name in NUMBERS}
            for record in comparison["records"]
            if record["refused"] is None
        ],
        "refused": [
            {"record": record["record"], "reason": record["refused"]}
            for record in comparison["records"]
            if record["refused"] is not None
        ],
    }


def _number(content: dict[str, Any] | None) -> dict[str, Any] | None:
    """Value, sd and unit of a number; ``None`` where the campaign has none."""
    return content and {name: content[name] for name in ("value", "sd", "unit")}


PACKAGES: Final = ("numpy", "scipy", "numba", "matplotlib", "pyserial", "snakemake")
